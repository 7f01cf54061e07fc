//! Runs a script past failed statements, so that independent errors are reported together.
//!
//! Calls of the API note their errors themselves and return a placeholder. An error of the interpreter (an unknown function, a
//! wrong type) ends a statement: variables that the statement would have set hold a [`Poison`] from then on, and errors that a
//! poison causes are not reported. Unknown variables are found before anything runs, and hold a poison from the beginning. After
//! a failed loop or condition, all variables that it sets anywhere are poisoned; after a failed import, errors of calls into that
//! module are not reported.

use crate::build::{RunMode, ScriptContext};
use crate::compile::{UnknownVariable, declare_poisons, scope_with_constants};
use crate::diagnostic::Severity;
use crate::errors::{self, Thrown};
use crate::modules::EMPTY;
use crate::value::{HandleKind, POISON, Poison, kind_of};
use rhai::{AST, ASTNode, Dynamic, Engine, EvalAltResult, Expr, Position, Scope, Stmt};
use std::collections::BTreeSet;

/// Number of failed statements after which the script ends.
const MOST: usize = 20;

/// Runs the statements of a script and notes errors. Returns true if there were none.
pub(crate) fn run(
    engine: &Engine,
    name: &str,
    shared: &ScriptContext,
    ast: &AST,
    unknown: &[UnknownVariable],
) -> bool {
    let mut scope = scope_with_constants();
    declare_poisons(unknown, &mut scope);
    let statements = ast.statements();
    let mut rest: Option<(usize, AST)> = None;
    let mut missing = Missing::default();
    for failed in 0.. {
        let (first, part) = rest.as_ref().map_or((0, ast), |(first, part)| (*first, part));
        let Err(error) = engine.run_ast_with_scope(&mut scope, part) else { return failed == 0 };
        let (place, explained) = errors::explain_error(&error, name, shared);
        // The error of a failed import has no position, so that of the explanation is used.
        let of_import = (place.file == name).then_some((place.line, place.column));
        let position = key(error.position()).or(of_import);
        let at = position.and_then(|position| statement_at(statements, first, position));
        let poisoned = at.is_some_and(|at| mentions_poison(&statements[at], &scope));
        if !missing.caused(&error, poisoned) {
            shared.add_diagnostic(Severity::Error, &place, &explained);
        }
        let goes_on = failed < MOST && shared.mode == RunMode::Stage && may_go_on(&error);
        let at = at.filter(|at| goes_on && missing.poison_targets(&statements[*at], &mut scope));
        let Some(at) = at else { return false };
        // Modules are known only to the run that imports them, so earlier imports are repeated; they are not read again.
        let imports = statements[..=at].iter().filter_map(|statement| missing.import_to_repeat(statement));
        let part = imports.chain(statements[at + 1..].iter().cloned());
        let mut part = AST::new(part, ast.shared_lib().clone());
        part.set_source(name);
        rest = Some((at + 1, part));
    }
    false
}

/// Whether the script can go on after an error: not after an exceeded limit or a `throw` of the script.
fn may_go_on(error: &EvalAltResult) -> bool {
    match error {
        EvalAltResult::ErrorInFunctionCall(_, _, inner, _) | EvalAltResult::ErrorInModule(_, inner, _) => {
            may_go_on(inner)
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
fn key(at: Position) -> Option<(usize, usize)> {
    Some((at.line()?, at.position().unwrap_or(0)))
}

/// Index of the statement that a position lies in, from `first` on.
fn statement_at(statements: &[Stmt], first: usize, at: (usize, usize)) -> Option<usize> {
    let begun = |s: &&Stmt| key(s.position()).is_some_and(|start| start <= at);
    let begun = statements[first..].iter().take_while(begun).count();
    begun.checked_sub(1).map(|index| first + index)
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
struct Missing {
    modules: BTreeSet<String>,
}

impl Missing {
    /// Whether another error has caused this one. `poisoned`: the statement uses a poison.
    fn caused(&self, error: &EvalAltResult, poisoned: bool) -> bool {
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

    /// An `import` statement to repeat, with an empty module in place of a missing one; `None` for other statements.
    fn import_to_repeat(&self, statement: &Stmt) -> Option<Stmt> {
        let Stmt::Import(import, at) = statement else { return None };
        let mut import = import.clone();
        if self.modules.contains(import.1.name.as_str()) {
            import.0 = Expr::StringConstant(EMPTY.into(), *at);
        }
        Some(Stmt::Import(import, *at))
    }

    /// Poisons the variables that a failed statement would have set. False if these are unknown.
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
            Stmt::Assignment(both) => replace(&both.1.lhs, scope),
            Stmt::FnCall(..) => true,
            Stmt::Expr(expr) => match &**expr {
                Expr::FnCall(..) | Expr::MethodCall(..) => true,
                expr @ (Expr::Dot(..) | Expr::Index(..)) => replace(expr, scope),
                _ => false,
            },
            Stmt::If(..)
            | Stmt::Switch(..)
            | Stmt::While(..)
            | Stmt::Do(..)
            | Stmt::For(..)
            | Stmt::Block(..)
            | Stmt::TryCatch(..) => {
                replace_all(statement, scope);
                true
            }
            _ => false,
        }
    }
}

/// Poisons all variables outside a block that its statements assign or call methods of.
fn replace_all(block: &Stmt, scope: &mut Scope) {
    block.walk(&mut Vec::new(), &mut |path| {
        match path.last() {
            Some(ASTNode::Stmt(Stmt::Assignment(both))) => _ = replace(&both.1.lhs, scope),
            Some(ASTNode::Expr(expr @ (Expr::Dot(..) | Expr::Index(..)))) => _ = replace(expr, scope),
            _ => {}
        }
        true
    });
}

/// Poisons the variable that an expression begins with, unless it is a handle, which a failed call does not change.
fn replace(expr: &Expr, scope: &mut Scope) -> bool {
    match expr {
        Expr::Dot(both, ..) | Expr::Index(both, ..) => match &both.lhs {
            Expr::Variable(variable, ..) => {
                let name = variable.1.as_str();
                let handle = scope.get(name).is_some_and(|value| kind_of(value) != HandleKind::None);
                handle || set(name, scope)
            }
            lhs @ (Expr::Dot(..) | Expr::Index(..)) => replace(lhs, scope),
            _ => true,
        },
        Expr::Variable(variable, ..) => set(variable.1.as_str(), scope),
        _ => false,
    }
}

fn set(name: &str, scope: &mut Scope) -> bool {
    let changes = scope.is_constant(name) == Some(false);
    if changes {
        scope.set_value(name, Poison);
    }
    changes
}
