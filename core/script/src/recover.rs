//! Goes on after a statement that failed, so that independent errors are reported together.
//!
//! Calls of the API note their errors themselves and give a stand-in. An error of the interpreter (an unknown function, a wrong
//! type) ends a statement: what the statement would have set holds a [`Poison`] from then on, and errors that a poison causes are not
//! reported. After a loop, a condition or an import it is unknown what is missing, so the script ends there.

use crate::build::{Mode, Shared};
use crate::compile::constants;
use crate::diagnostic::Severity;
use crate::errors::{self, Thrown};
use crate::value::{HandleKind, POISON, Poison, kind_of};
use rhai::{AST, Dynamic, Engine, EvalAltResult, Expr, Position, Scope, Stmt};

/// Statements that may fail before the script ends.
const MOST: usize = 20;

/// Runs the statements of a script and notes what is wrong with them. Whether nothing was.
pub(crate) fn run(engine: &Engine, name: &str, shared: &Shared, ast: &AST) -> bool {
    let mut scope = constants();
    let mut rest: Option<(usize, AST)> = None;
    for failed in 0.. {
        let (first, part) = rest.as_ref().map_or((0, ast), |(first, part)| (*first, part));
        let Err(error) = engine.run_ast_with_scope(&mut scope, part) else { return failed == 0 };
        let caused_by_another = error.to_string().contains(POISON);
        if !caused_by_another {
            let (place, error) = errors::explain(&error, name, shared);
            shared.note(Severity::Error, &place, &error);
        }
        let goes_on = failed < MOST && shared.mode == Mode::Stage && may_go_on(&error);
        let at = goes_on.then(|| statement_at(ast.statements(), first, error.position())).flatten();
        let Some(at) = at.filter(|at| poison(&ast.statements()[*at], &mut scope)) else { return false };
        let mut part = AST::new(ast.statements()[at + 1..].iter().cloned(), ast.shared_lib().clone());
        part.set_source(name);
        rest = Some((at + 1, part));
    }
    false
}

/// Whether an error says nothing about what follows: no limit, no `throw` of the script's own.
fn may_go_on(error: &EvalAltResult) -> bool {
    match error {
        EvalAltResult::ErrorInFunctionCall(_, _, inner, _) => may_go_on(inner),
        EvalAltResult::ErrorRuntime(value, _) => value.is::<Thrown>(),
        EvalAltResult::ErrorFunctionNotFound(..)
        | EvalAltResult::ErrorVariableNotFound(..)
        | EvalAltResult::ErrorPropertyNotFound(..)
        | EvalAltResult::ErrorIndexNotFound(..)
        | EvalAltResult::ErrorMismatchDataType(..)
        | EvalAltResult::ErrorMismatchOutputType(..)
        | EvalAltResult::ErrorIndexingType(..)
        | EvalAltResult::ErrorArrayBounds(..)
        | EvalAltResult::ErrorStringBounds(..)
        | EvalAltResult::ErrorDotExpr(..)
        | EvalAltResult::ErrorArithmetic(..) => true,
        _ => false,
    }
}

/// Index of the statement that a position lies in, from `first` on.
fn statement_at(statements: &[Stmt], first: usize, at: Position) -> Option<usize> {
    let key = |at: Position| Some((at.line()?, at.position().unwrap_or(0)));
    let at = key(at)?;
    // Modules are known to the run that imports them alone.
    if statements.iter().any(|s| matches!(s, Stmt::Import(..))) {
        return None;
    }
    let begun = |s: &&Stmt| key(s.position()).is_some_and(|start| start <= at);
    let begun = statements[first..].iter().take_while(begun).count();
    begun.checked_sub(1).map(|index| first + index)
}

/// Puts poison where a statement would have put a value; false where that is unknown.
fn poison(statement: &Stmt, scope: &mut Scope) -> bool {
    let poison = || Dynamic::from(Poison);
    match statement {
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
        _ => false,
    }
}

/// Poisons the variable that an expression begins with, unless it is a handle, which a failed call leaves as it is.
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
