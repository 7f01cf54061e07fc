//! Parses a script to a syntax tree and refuses functions that scripts must not use.

use crate::build::ScriptContext;
use crate::value::Poison;
use rhai::{AST, ASTNode, Engine, Expr, LexError, ParseError, ParseErrorType, Position, Scope, Stmt};
use std::sync::PoisonError;

/// Names that a script cannot use, each with the reason.
pub(crate) const FORBIDDEN_NAMES: &[(&str, &str)] = &[
    ("eval", "all code of a script must be in its files"),
    ("sleep", "a script only describes the scene and never waits; give times to .from, .until and .key"),
    ("curry", "a closure, || f(x), captures the variables that it uses"),
    ("timestamp", "the same script must give the same scene at any time"),
    ("**", "write pow(x, y), which gives the same result on every machine"),
];

/// A scope with the constants of every script and module.
pub(crate) fn scope_with_constants() -> Scope<'static> {
    let mut scope = Scope::new();
    scope.push_constant("PI", std::f64::consts::PI).push_constant("TAU", std::f64::consts::TAU);
    scope
}

/// Name and description of each constant.
pub(crate) const CONSTANTS: &[(&str, &str)] =
    &[("PI", "Is π, 3.14159…: half a turn in radians."), ("TAU", "Is 2 π: a turn in radians.")];

/// Parses a script. An unclosed comment is an error: Rhai itself ignores the rest of the text without one. To detect it, the
/// script is parsed again with a `;` appended: the last token stays the same only inside a comment.
pub(crate) fn compile(engine: &Engine, context: &ScriptContext, text: &str) -> Result<AST, ParseError> {
    compile_in_scope(engine, context, text, &scope_with_constants())
}

/// A variable that is used without being declared before.
#[derive(Clone, Debug)]
pub(crate) struct UnknownVariable {
    pub name: String,
    pub at: Position,
}

/// Maximum number of unknown variable names that are searched for. Each of them takes another parse of the text.
const MOST_UNKNOWN: usize = 20;

/// Parses a script as [`compile`] does and returns all unknown variables: the parse is repeated with each unknown name declared.
/// If the text has another error, the variables before that error are returned.
pub(crate) fn compile_with_unknown_variables(
    engine: &Engine,
    context: &ScriptContext,
    text: &str,
) -> (Result<AST, ParseError>, Vec<UnknownVariable>) {
    let (mut scope, mut unknown) = (scope_with_constants(), Vec::<UnknownVariable>::new());
    let parsed = loop {
        match compile_in_scope(engine, context, text, &scope) {
            Err(ParseError(kind, at)) if unknown.len() < MOST_UNKNOWN => match *kind {
                ParseErrorType::VariableUndefined(name) if !scope.contains(&name) => {
                    scope.push(name.clone(), ());
                    unknown.push(UnknownVariable { name, at });
                }
                kind => break Err(ParseError(Box::new(kind), at)),
            },
            parsed => break parsed,
        }
    };
    if let Ok(ast) = &parsed {
        add_further_places(ast, &mut unknown);
    }
    unknown.sort_by_key(|variable| (variable.at.line(), variable.at.position()));
    (parsed, unknown)
}

/// Declares unknown variables as [`Poison`].
pub(crate) fn declare_poisons(unknown: &[UnknownVariable], scope: &mut Scope) {
    for variable in unknown {
        if !scope.contains(&variable.name) {
            scope.push(variable.name.clone(), Poison);
        }
    }
}

/// Adds the further places at which the unknown variables are used.
fn add_further_places(ast: &AST, unknown: &mut Vec<UnknownVariable>) {
    if unknown.is_empty() {
        return;
    }
    // The statement of a closure lists its captured variables, each with its first place. In the body of the closure, which is
    // removed here, all captured variables would look unknown.
    let mut functions = ast.clone_functions_only();
    functions.retain_functions(|_, _, name, _| !name.starts_with("anon$"));
    for part in [ast.clone_statements_only(), functions] {
        part.walk(&mut |path| {
            if let Some(ASTNode::Expr(Expr::Variable(variable, _, at))) = path.last()
                && variable.0.is_none()
                && variable.2.is_empty()
                && unknown.iter().any(|known| known.name == variable.1.as_str())
                && !unknown.iter().any(|known| known.at == *at)
            {
                unknown.push(UnknownVariable { name: variable.1.to_string(), at: *at });
            }
            true
        });
    }
}

fn compile_in_scope(
    engine: &Engine,
    context: &ScriptContext,
    text: &str,
    scope: &Scope,
) -> Result<AST, ParseError> {
    let last_token = || *context.last_token.lock().unwrap_or_else(PoisonError::into_inner);
    *context.last_token.lock().unwrap_or_else(PoisonError::into_inner) = (0, 0);
    let ast = engine.compile_with_scope(scope, text)?;
    check_calls(&ast)?;
    if !text.contains("/*") {
        return Ok(ast);
    }
    let last = last_token();
    engine.compile_with_scope(scope, format!("{text}\n;"))?;
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

/// Whether scripts must not use a name.
pub(crate) fn is_forbidden(name: &str) -> bool {
    FORBIDDEN_NAMES.iter().any(|(refused, _)| *refused == name)
}

/// Refuses forbidden methods and calls with too many arguments: Rhai searches for a function in a single step, which no limit
/// interrupts, and its time grows with the number of arguments and with 2 to the power of up to 16 of them.
fn check_calls(ast: &AST) -> Result<(), ParseError> {
    let mut wrong = None;
    ast.walk(&mut |path| {
        let (call, at) = match path.last() {
            Some(ASTNode::Expr(Expr::MethodCall(call, at))) if is_forbidden(&call.name) => {
                wrong = Some((call.name.to_string(), *at));
                return false;
            }
            Some(ASTNode::Expr(Expr::FnCall(call, at) | Expr::MethodCall(call, at))) => (call, at),
            Some(ASTNode::Stmt(Stmt::FnCall(call, at))) => (call, at),
            _ => return true,
        };
        // `curry` receives all variables that a closure captures; Rhai calls it without a search.
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

/// Maximum number of arguments of one call.
pub(crate) const MOST_ARGUMENTS: usize = 64;

/// Text of the parser's error about a call with more arguments, by which `errors` recognizes it.
pub(crate) const MANY_ARGUMENTS: &str = "arguments";

/// Text of the parser's error about a comment that is never closed, by which `errors` recognizes it.
pub(crate) const OPEN_COMMENT: &str = "comment";

/// Text of the parser's error past the time limit, by which `errors` recognizes it.
pub(crate) const PARSE_TIMEOUT: &str = "seconds";
