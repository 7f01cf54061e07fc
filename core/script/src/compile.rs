//! Reading of a script: text to syntax tree, without what scripts cannot use.

use crate::build::Shared;
use rhai::{AST, ASTNode, Engine, Expr, LexError, ParseError, ParseErrorType, Position, Scope, Stmt};
use std::sync::PoisonError;

/// Names that a script cannot use, and why.
pub(crate) const REFUSED: &[(&str, &str)] = &[
    ("eval", "all code of a script stands in its files"),
    ("sleep", "a script only describes the scene; times are given to .from, .until and .key"),
    ("curry", "a closure, || f(x), takes along what it uses"),
    ("timestamp", "the same script must give the same scene at any time"),
    ("**", "write pow(x, y), which gives the same result on every machine"),
];

/// Constants that every script and module sees.
pub fn constants() -> Scope<'static> {
    let mut scope = Scope::new();
    scope.push_constant("PI", std::f64::consts::PI).push_constant("TAU", std::f64::consts::TAU);
    scope
}

pub(crate) const CONSTANTS: &[(&str, &str)] =
    &[("PI", "Is π, 3.14159…: half a turn in radians."), ("TAU", "Is 2 π: a turn in radians.")];

/// Reads a script. Rhai takes a comment that is never closed for the end of the script, without a word: the last
/// statement of the script as read would be missing from the same script with one more at its end.
pub fn compile(engine: &Engine, shared: &Shared, text: &str) -> Result<AST, ParseError> {
    let last_token = || *shared.last_token.lock().unwrap_or_else(PoisonError::into_inner);
    *shared.last_token.lock().unwrap_or_else(PoisonError::into_inner) = (0, 0);
    let ast = engine.compile_with_scope(&constants(), text)?;
    check_calls(&ast)?;
    if !text.contains("/*") {
        return Ok(ast);
    }
    let last = last_token();
    engine.compile_with_scope(&constants(), format!("{text}\n;"))?;
    if last_token() != last {
        return Ok(ast);
    }
    let (mut line, mut column) = last;
    let from = text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum::<usize>();
    let rest = text.get(from..).unwrap_or("");
    let skip: usize = rest.chars().take(column.saturating_sub(1)).map(char::len_utf8).sum();
    if let Some(at) = rest.get(skip..).and_then(|r| r.find("/*")) {
        let before = &rest[..skip + at];
        line = line.max(1) + before.matches('\n').count();
        column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
    }
    let place =
        Position::new(u16::try_from(line).unwrap_or(u16::MAX), u16::try_from(column).unwrap_or(u16::MAX));
    let why = LexError::Runtime(OPEN_COMMENT.into());
    Err(ParseError(Box::new(ParseErrorType::BadInput(why)), place))
}

pub fn is_refused(name: &str) -> bool {
    REFUSED.iter().any(|(refused, _)| *refused == name)
}

/// Methods that are refused, and calls of too many arguments: Rhai looks for a function in time that grows with their number
/// and with 2 to the power of up to 16 of them, in one step that no limit interrupts.
fn check_calls(ast: &AST) -> Result<(), ParseError> {
    let mut wrong = None;
    ast.walk(&mut |path| {
        let (call, at) = match path.last() {
            Some(ASTNode::Expr(Expr::MethodCall(call, at))) if is_refused(&call.name) => {
                wrong = Some((call.name.to_string(), *at));
                return false;
            }
            Some(ASTNode::Expr(Expr::FnCall(call, at) | Expr::MethodCall(call, at))) => (call, at),
            Some(ASTNode::Stmt(Stmt::FnCall(call, at))) => (call, at),
            _ => return true,
        };
        // `curry` receives everything that a closure captures; Rhai calls it without a search.
        if call.args.len() > MOST_ARGUMENTS && call.name != "curry" {
            wrong = Some((MANY_ARGUMENTS.to_string(), *at));
        }
        wrong.is_none()
    });
    match wrong {
        None => Ok(()),
        Some((why, at)) => Err(ParseError(Box::new(ParseErrorType::BadInput(LexError::Runtime(why))), at)),
    }
}

/// Arguments of one call at most.
pub(crate) const MOST_ARGUMENTS: usize = 64;

/// The end of the message for a call with more arguments; `errors` recognizes it.
pub(crate) const MANY_ARGUMENTS: &str = "arguments";

/// The parser's error in a comment that is never closed; `errors` recognizes it.
pub(crate) const OPEN_COMMENT: &str = "comment";

/// The parser's error past the time limit; `errors` recognizes it.
pub(crate) const TOO_SLOW: &str = "seconds";
