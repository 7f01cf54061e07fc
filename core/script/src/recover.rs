//! Runs a script past failed statements, so that independent errors are reported together.
//!
//! Calls of the API report their errors themselves and return a placeholder. An error of the interpreter (an unknown function, a
//! wrong type) ends a statement: variables that the statement would have set contain a [`Poison`] from then on, and errors that a
//! poison causes are not reported. Unknown variables are found before anything runs, and contain a poison from the beginning.
//! After a failed loop or condition, all variables that it sets anywhere are poisoned; after a failed import, errors of calls
//! into that module are not reported.

use crate::build::{RunMode, ScriptContext};
use crate::compile::{UnknownVariable, declare_poisons, scope_with_constants};
use crate::diagnostic::Severity;
use crate::errors::{self, Thrown};
use crate::modules::EMPTY_MODULE;
use crate::value::{HandleKind, POISON, Poison, kind_of};
use rhai::{AST, ASTNode, Dynamic, Engine, EvalAltResult, Expr, Position, Scope, Stmt};
use std::collections::BTreeSet;

/// Number of failed statements after which the script ends.
const MAX_FAILED_STATEMENTS: usize = 20;

/// Runs the statements of a script and reports errors. Returns whether there were none.
pub(crate) fn run_statements(
    engine: &Engine,
    name: &str,
    context: &ScriptContext,
    ast: &AST,
    unknown: &[UnknownVariable],
) -> bool {
    let mut scope = scope_with_constants();
    declare_poisons(unknown, &mut scope);
    let statements = ast.statements();
    // Index of the first statement that is still to be run, and a syntax tree of the statements from there.
    let mut remaining: Option<(usize, AST)> = None;
    let mut missing = MissingModules::default();
    for failed in 0.. {
        let (first, part) = remaining.as_ref().map_or((0, ast), |(first, part)| (*first, part));
        let Err(error) = engine.run_ast_with_scope(&mut scope, part) else { return failed == 0 };
        let (place, explained) = errors::explain_error(&error, name, context);
        // The error of a failed import has no position, so the place of its explanation is used.
        let explained_position = (place.file == name).then_some((place.line, place.column));
        let position = line_and_column(error.position()).or(explained_position);
        let at = position.and_then(|position| statement_at(statements, first, position));
        let poisoned = at.is_some_and(|at| mentions_poison(&statements[at], &scope));
        if !missing.is_follow_up(&error, poisoned) {
            context.add_diagnostic(Severity::Error, &place, &explained);
        }
        let continues =
            failed < MAX_FAILED_STATEMENTS && context.mode == RunMode::Stage && is_recoverable(&error);
        let at = at.filter(|at| continues && missing.poison_targets(&statements[*at], &mut scope));
        let Some(at) = at else { return false };
        // Modules are known only to the run that imports them, so earlier imports are repeated; they are not read again.
        let imports = statements[..=at].iter().filter_map(|statement| missing.import_for_rerun(statement));
        let part = imports.chain(statements[at + 1..].iter().cloned());
        let mut part = AST::new(part, ast.shared_lib().clone());
        part.set_source(name);
        remaining = Some((at + 1, part));
    }
    false
}

/// Whether the script can continue after an error: not after an exceeded limit or a `throw` of the script.
fn is_recoverable(error: &EvalAltResult) -> bool {
    match error {
        EvalAltResult::ErrorInFunctionCall(_, _, inner, _) | EvalAltResult::ErrorInModule(_, inner, _) => {
            is_recoverable(inner)
        }
        EvalAltResult::ErrorRuntime(value, _) => value.is::<Thrown>(),
        EvalAltResult::ErrorParsing(..)
        | EvalAltResult::ErrorFunctionNotFound(..)
        | EvalAltResult::ErrorVariableNotFound(..)
        | EvalAltResult::ErrorModuleNotFound(..)
        | EvalAltResult::ErrorPropertyNotFound(..)
        | EvalAltResult::ErrorIndexNotFound(..)
        | EvalAltResult::ErrorMismatchDataType(..)
        | EvalAltResult::ErrorMismatchOutputType(..)
        | EvalAltResult::ErrorIndexingType(..)
        | EvalAltResult::ErrorArrayBounds(..)
        | EvalAltResult::ErrorStringBounds(..)
        | EvalAltResult::ErrorDotExpr(..)
        | EvalAltResult::ErrorFor(..)
        | EvalAltResult::ErrorArithmetic(..) => true,
        _ => false,
    }
}

/// The error inside the function calls and modules that it has passed through.
fn innermost(error: &EvalAltResult) -> &EvalAltResult {
    match error {
        EvalAltResult::ErrorInFunctionCall(_, _, inner, _) | EvalAltResult::ErrorInModule(_, inner, _) => {
            innermost(inner)
        }
        error => error,
    }
}

/// Line and column of a position.
fn line_and_column(at: Position) -> Option<(usize, usize)> {
    Some((at.line()?, at.position().unwrap_or(0)))
}

/// Index of the statement that contains a position, at least `first`.
fn statement_at(statements: &[Stmt], first: usize, at: (usize, usize)) -> Option<usize> {
    let begins_before = |s: &&Stmt| line_and_column(s.position()).is_some_and(|start| start <= at);
    let count = statements[first..].iter().take_while(begins_before).count();
    count.checked_sub(1).map(|index| first + index)
}

/// Whether a variable of a statement holds a poison.
fn mentions_poison(statement: &Stmt, scope: &Scope) -> bool {
    let mut mentions = false;
    statement.walk(&mut Vec::new(), &mut |path| {
        if let Some(ASTNode::Expr(Expr::Variable(variable, ..))) = path.last() {
            mentions |= scope.get(variable.1.as_str()).is_some_and(|value| value.is::<Poison>());
        }
        !mentions
    });
    mentions
}

/// Modules that could not be imported.
#[derive(Default)]
struct MissingModules {
    modules: BTreeSet<String>,
}

impl MissingModules {
    /// Whether another error has caused this one. `poisoned`: the statement uses a poison.
    fn is_follow_up(&self, error: &EvalAltResult, poisoned: bool) -> bool {
        match innermost(error) {
            EvalAltResult::ErrorFunctionNotFound(name, _) | EvalAltResult::ErrorVariableNotFound(name, _)
                if name.split_once("::").is_some_and(|(module, _)| self.modules.contains(module)) =>
            {
                true
            }
            // Such errors do not name the type of the value.
            EvalAltResult::ErrorFor(_) | EvalAltResult::ErrorDataRace(..) => poisoned,
            _ => error.to_string().contains(POISON),
        }
    }

    /// Copy of an `import` statement to run again, with an empty module in place of a missing one; `None` for other statements.
    fn import_for_rerun(&self, statement: &Stmt) -> Option<Stmt> {
        let Stmt::Import(import, at) = statement else { return None };
        let mut import = import.clone();
        if self.modules.contains(import.1.name.as_str()) {
            import.0 = Expr::StringConstant(EMPTY_MODULE.into(), *at);
        }
        Some(Stmt::Import(import, *at))
    }

    /// Poisons the variables that a failed statement would have set. Returns false if it cannot tell which these are.
    fn poison_targets(&mut self, statement: &Stmt, scope: &mut Scope) -> bool {
        let poison = || Dynamic::from(Poison);
        match statement {
            Stmt::Import(import, _) => {
                self.modules.insert(import.1.name.to_string());
                true
            }
            Stmt::Var(variable, ..) => {
                let (name, _, slot) = &**variable;
                match slot {
                    Some(_) => drop(scope.set_or_push(name.name.as_str(), poison())),
                    None => drop(scope.push_dynamic(name.name.as_str(), poison())),
                }
                true
            }
            Stmt::Assignment(both) => poison_variable(&both.1.lhs, scope),
            Stmt::FnCall(..) => true,
            Stmt::Expr(expr) => match &**expr {
                Expr::FnCall(..) | Expr::MethodCall(..) => true,
                expr @ (Expr::Dot(..) | Expr::Index(..)) => poison_variable(expr, scope),
                _ => false,
            },
            Stmt::If(..)
            | Stmt::Switch(..)
            | Stmt::While(..)
            | Stmt::Do(..)
            | Stmt::For(..)
            | Stmt::Block(..)
            | Stmt::TryCatch(..) => {
                poison_block(statement, scope);
                true
            }
            _ => false,
        }
    }
}

/// Poisons all variables outside a block that its statements assign or call methods of.
fn poison_block(block: &Stmt, scope: &mut Scope) {
    block.walk(&mut Vec::new(), &mut |path| {
        match path.last() {
            Some(ASTNode::Stmt(Stmt::Assignment(both))) => _ = poison_variable(&both.1.lhs, scope),
            Some(ASTNode::Expr(expr @ (Expr::Dot(..) | Expr::Index(..)))) => _ = poison_variable(expr, scope),
            _ => {}
        }
        true
    });
}

/// Poisons the variable with which an expression begins, unless it is a handle, which a failed call does not change. Returns
/// false if there is no such variable or if it cannot be poisoned.
fn poison_variable(expr: &Expr, scope: &mut Scope) -> bool {
    match expr {
        Expr::Dot(both, ..) | Expr::Index(both, ..) => match &both.lhs {
            Expr::Variable(variable, ..) => {
                let name = variable.1.as_str();
                let is_handle = scope.get(name).is_some_and(|value| kind_of(value) != HandleKind::None);
                is_handle || poison_name(name, scope)
            }
            lhs @ (Expr::Dot(..) | Expr::Index(..)) => poison_variable(lhs, scope),
            _ => true,
        },
        Expr::Variable(variable, ..) => poison_name(variable.1.as_str(), scope),
        _ => false,
    }
}

/// Poisons a variable by its name. Returns false if it is a constant or not declared.
fn poison_name(name: &str, scope: &mut Scope) -> bool {
    let is_variable = scope.is_constant(name) == Some(false);
    if is_variable {
        scope.set_value(name, Poison);
    }
    is_variable
}
