//! Translates errors of the Rhai interpreter into messages of this program.

use crate::api_error::{ApiError, Place};
use crate::build::ScriptContext;
use crate::call::describe;
use crate::compile::{
    FORBIDDEN_NAMES, MANY_ARGUMENTS, MOST_ARGUMENTS, OPEN_COMMENT, PARSE_TIMEOUT, UnknownVariable,
    is_forbidden,
};
use crate::def::Def;
use crate::diagnostic::Severity;
use crate::earlier_cause::EarlierCause;
use crate::limits::raise_hint;
use crate::suggest::{closest, did_you_mean, list};
use crate::synonyms::{self, Suggestion};
use crate::value::{HandleKind, POISON};
use choreo_sandbox::{declared_names, operator_error, signature_parts, type_word};
use rhai::{Dynamic, EvalAltResult, LexError, ParseErrorType, Position};
use std::sync::PoisonError;

/// An API error with its place, as a value that the interpreter throws.
#[derive(Clone, Debug)]
pub(crate) struct Thrown {
    pub error: ApiError,
    pub place: Place,
}

/// Wraps an API error for the interpreter.
pub(crate) fn throw(error: ApiError, place: Place) -> Box<EvalAltResult> {
    Box::new(EvalAltResult::ErrorRuntime(Dynamic::from(Thrown { error, place }), Position::NONE))
}

/// The error that a script uses a forbidden name.
pub(crate) fn forbidden_name_error(name: &str) -> ApiError {
    let why = FORBIDDEN_NAMES.iter().find(|(n, _)| *n == name).map_or("", |(_, why)| why);
    ApiError::new(format!("\"{name}\" cannot be used in a script: {why}"))
}

/// Place and message of an error of the interpreter. `file`: the script that was run.
pub(crate) fn explain_error(error: &EvalAltResult, file: &str, context: &ScriptContext) -> (Place, ApiError) {
    let place = |at: Position| Place {
        file: file.to_string(),
        line: at.line().unwrap_or(0),
        column: at.position().unwrap_or(0),
    };
    match error {
        EvalAltResult::ErrorInFunctionCall(_, source, inner, at) => {
            let file = if source.is_empty() { file } else { source };
            let (mut inner_place, error) = explain_error(inner, file, context);
            if inner_place.line == 0 {
                inner_place = place(*at);
            }
            (inner_place, error)
        }
        EvalAltResult::ErrorInModule(source, inner, at) => {
            let file = if source.is_empty() { file } else { source };
            let (inner_place, error) = explain_error(inner, file, context);
            if inner_place.line == 0 { (place(*at), error) } else { (inner_place, error) }
        }
        EvalAltResult::ErrorRuntime(value, at) => thrown_error(value, place(*at)),
        EvalAltResult::ErrorTerminated(value, at) if value.is::<Thrown>() => thrown_error(value, place(*at)),
        other => {
            let place = place(other.position());
            let earlier_cause = match other {
                EvalAltResult::ErrorParsing(kind, _) => earlier_cause(kind, &place, context),
                _ => None,
            };
            earlier_cause.unwrap_or_else(|| {
                let error = interpreter_error(other, &place, context);
                (place, error)
            })
        }
    }
}

/// Place and message of a parser error whose cause lies before the place at which the parser stops.
fn earlier_cause(kind: &ParseErrorType, place: &Place, context: &ScriptContext) -> Option<(Place, ApiError)> {
    let sources = context.sources.lock().unwrap_or_else(PoisonError::into_inner);
    let text = sources.get(&place.file).cloned()?;
    drop(sources);
    let EarlierCause { line, column, error } = EarlierCause::find(kind, (place.line, place.column), &text)?;
    Some((Place { line, column, ..place.clone() }, error))
}

/// Message and hint of an error of the interpreter itself.
fn interpreter_error(error: &EvalAltResult, place: &Place, context: &ScriptContext) -> ApiError {
    let limits = &context.limits;
    match error {
        EvalAltResult::ErrorParsing(kind, _) => parser_error(kind, place, context),
        EvalAltResult::ErrorVariableNotFound(name, _) => {
            let reported =
                context.reported_variables.lock().unwrap_or_else(PoisonError::into_inner).contains(name);
            if reported { ApiError::silent() } else { unknown_variable(name, place, context) }
        }
        EvalAltResult::ErrorFunctionNotFound(signature, _) => unknown_function(signature, context),
        EvalAltResult::ErrorModuleNotFound(name, _) => ApiError::new(format!("unknown module \"{name}\"")),
        EvalAltResult::ErrorTerminated(limit, _) => limit_error(limit, context),
        EvalAltResult::ErrorStackOverflow(_) => {
            ApiError::new("functions call each other too deeply; does one call itself without end?")
                .hint(raise_hint("call_levels", format!("{} levels", limits.call_levels)))
        }
        EvalAltResult::ErrorDataTooLarge(what, _) => size_error(what, context),
        EvalAltResult::ErrorTooManyVariables(_) => {
            ApiError::new("too many variables at once").hint(raise_hint("variables", limits.variables))
        }
        EvalAltResult::ErrorTooManyModules(_) => {
            ApiError::new("too many imported files").hint(raise_hint("modules", limits.modules))
        }
        EvalAltResult::ErrorMismatchDataType(wanted, got, _) => {
            ApiError::new(format!("{} is needed here, got {}", type_word(wanted), type_word(got)))
        }
        EvalAltResult::ErrorPropertyNotFound(name, _) => {
            ApiError::new(format!("unknown property \"{name}\""))
        }
        EvalAltResult::ErrorDotExpr(text, _) => {
            // `Unknown property 'foo' - a getter is not registered for type 'Actor'`.
            let mut quoted = text.split('\'').skip(1).step_by(2);
            match (quoted.next(), quoted.next()) {
                (Some(name), Some(kind)) => unknown_member(name, kind, context),
                _ => ApiError::new(text.clone()),
            }
        }
        EvalAltResult::ErrorIndexingType(kind, _) => {
            let kind = kind.split(" [").next().unwrap_or(kind);
            ApiError::new(format!("{} cannot be indexed with []", type_word_with_article(kind)))
        }
        EvalAltResult::ErrorArrayBounds(len, index, _) => {
            let elements = format_count(*len, "element");
            ApiError::new(format!("index {index} is outside this array, which has {elements}"))
        }
        EvalAltResult::ErrorStringBounds(len, index, _) => {
            let characters = format_count(*len, "character");
            ApiError::new(format!("index {index} is outside this text, which has {characters}"))
        }
        EvalAltResult::ErrorDataRace(name, _) => {
            let name = if name.is_empty() { "this value" } else { name };
            ApiError::new(format!("{name} is in use by the call that would change it")).hint(
                "a closure cannot use the variable that it is stored in, and an array cannot contain itself",
            )
        }
        EvalAltResult::ErrorFor(_) => ApiError::new("for loops over arrays, ranges, maps and texts only"),
        other => {
            let text = other.to_string();
            ApiError::new(lower_first(text.split_once(" (line ").map_or(&*text, |(text, _)| text)))
        }
    }
}

/// Place and message of a thrown value: an API error, or the value of a `throw` of the script.
fn thrown_error(value: &Dynamic, place: Place) -> (Place, ApiError) {
    if let Some(thrown) = value.read_lock::<Thrown>() {
        let has_place = thrown.place.line > 0;
        return (if has_place { thrown.place.clone() } else { place }, thrown.error.clone());
    }
    let text = match value.clone().into_string() {
        Ok(text) if !text.is_empty() => text,
        _ if value.is_unit() => "the script threw an error (throw)".to_string(),
        _ if value.is_array() || value.is_map() => format!("the script threw: {value}"),
        _ => format!("the script threw: {}", describe(value)),
    };
    (place, ApiError::new(text))
}

/// The error that a run has exceeded a limit. `limit`: its name.
fn limit_error(limit: &Dynamic, context: &ScriptContext) -> ApiError {
    let name = limit.clone().into_string().unwrap_or_default();
    let limits = &context.limits;
    match name.as_str() {
        "frame_operations" => {
            ApiError::new("this on_frame callback takes too many steps; does a loop never end?")
                .hint(raise_hint(&name, format!("{} steps a frame", limits.frame_operations)))
        }
        "frame_seconds" => ApiError::new("this on_frame callback takes too long; does a loop never end?")
            .hint(raise_hint(&name, format!("{} s a frame", limits.frame_seconds))),
        "seconds" => ApiError::new("the script takes too long; does a loop never end?")
            .hint(raise_hint(&name, format!("{} s", limits.seconds))),
        "timeout" => match context.timeout.map(|timeout| timeout.error()) {
            Some((what, hint)) => ApiError::new(what).hint(hint),
            None => ApiError::new("the test section takes too long"),
        },
        "memory" => ApiError::new("the script uses too much memory")
            .hint(raise_hint(&name, format!("{} bytes", limits.memory))),
        _ => ApiError::new("the script takes too many steps; does a loop never end?")
            .hint(raise_hint("operations", format!("{} steps", limits.operations))),
    }
}

/// The error that a text, map or array grows too large. `what`: its type as Rhai names it.
fn size_error(what: &str, context: &ScriptContext) -> ApiError {
    let limits = &context.limits;
    let lower = what.to_lowercase();
    if lower.contains("string") {
        ApiError::new("this text grows too long")
            .hint(raise_hint("string", format!("{} bytes", limits.string)))
    } else if lower.contains("map") {
        ApiError::new("this object map grows too large")
            .hint(raise_hint("map", format!("{} entries", limits.map)))
    } else {
        ApiError::new("this array grows too large")
            .hint(raise_hint("array", format!("{} elements", limits.array)))
    }
}

/// Message and hint of an error of the parser.
fn parser_error(kind: &ParseErrorType, place: &Place, context: &ScriptContext) -> ApiError {
    match kind {
        ParseErrorType::VariableUndefined(name) => unknown_variable(name, place, context),
        ParseErrorType::ModuleUndefined(name) => ApiError::new(format!("unknown module \"{name}\""))
            .hint(format!("write import \"file\" as {name}; before it is used")),
        ParseErrorType::Reserved(word) | ParseErrorType::UnknownOperator(word) if is_forbidden(word) => {
            forbidden_name_error(word)
        }
        ParseErrorType::BadInput(LexError::ImproperSymbol(word, _) | LexError::Runtime(word))
            if is_forbidden(word) =>
        {
            forbidden_name_error(word)
        }
        ParseErrorType::BadInput(LexError::Runtime(why)) if why == PARSE_TIMEOUT => {
            ApiError::new("the script takes too long to read; split it into functions and modules")
                .hint(raise_hint("seconds", format!("{} s", context.limits.seconds)))
        }
        ParseErrorType::BadInput(LexError::Runtime(why)) if why == MANY_ARGUMENTS => {
            ApiError::new(format!("this call has too many arguments: {} at most", MOST_ARGUMENTS))
                .hint("give it an array")
        }
        ParseErrorType::BadInput(LexError::Runtime(why)) if why == OPEN_COMMENT => {
            ApiError::new("this comment is never closed: nothing after it is read")
                .hint("close it with */; comments may lie inside comments, so each /* needs its own")
        }
        ParseErrorType::Reserved(word) => {
            ApiError::new(format!("\"{word}\" is a reserved word and cannot be a name"))
        }
        // Rhai reports this for any keyword that stands in place of a key.
        ParseErrorType::PropertyExpected => ApiError::new("expected the name of a property")
            .hint("keywords, like if or loop, must be in quotes: #{ \"loop\": 1 }"),
        ParseErrorType::UnexpectedEOF => ApiError::new("the script ends too early; is a bracket left open?"),
        ParseErrorType::BadInput(LexError::UnexpectedInput(letters)) if !letters.is_ascii() => {
            let codes: Vec<String> = letters.chars().map(|c| format!("U+{:04X}", c as u32)).collect();
            ApiError::new(format!("unexpected '{letters}' ({})", codes.join(" ")))
                .hint("names consist of the letters a to z, digits and _; other characters are for texts and comments only")
        }
        ParseErrorType::BadInput(LexError::MalformedChar(text)) => {
            ApiError::new(format!("'{text}' is not a single character"))
                .hint(format!("write texts in double quotes: \"{text}\""))
        }
        ParseErrorType::BadInput(LexError::UnterminatedString) => {
            ApiError::new("this text has no closing quote")
        }
        ParseErrorType::ExprTooDeep => {
            ApiError::new("this expression is nested too deeply").hint("give its parts names with let")
        }
        ParseErrorType::TooManyFunctions => ApiError::new("too many functions in one file")
            .hint(raise_hint("functions", context.limits.functions)),
        ParseErrorType::LiteralTooLarge(what, _) => size_error(what, context),
        ParseErrorType::MissingToken(token, why) => {
            ApiError::new(format!("expected {} {}", quote_symbol(token), why.trim()))
        }
        ParseErrorType::AssignmentToConstant(name) => {
            ApiError::new(format!("\"{name}\" is a constant and cannot be changed"))
        }
        other => ApiError::new(lower_first(&other.to_string())),
    }
}

/// A token for a message: punctuation in quotes.
fn quote_symbol(token: &str) -> String {
    if token.chars().all(|c| c.is_ascii_punctuation()) { format!("\"{token}\"") } else { token.to_string() }
}

/// Reports the unknown variables of a file.
pub(crate) fn report_unknown_variables(unknown: &[UnknownVariable], file: &str, context: &ScriptContext) {
    for variable in unknown {
        let (line, column) = (variable.at.line().unwrap_or(0), variable.at.position().unwrap_or(0));
        let place = Place { file: file.to_string(), line, column };
        context.add_diagnostic(Severity::Error, &place, &unknown_variable(&variable.name, &place, context));
    }
}

/// Marks unknown variables as reported, so that errors that they cause at run time are not shown.
pub(crate) fn mark_as_reported(unknown: &[UnknownVariable], context: &ScriptContext) {
    let names = unknown.iter().map(|variable| variable.name.clone());
    context.reported_variables.lock().unwrap_or_else(PoisonError::into_inner).extend(names);
}

/// Whether a message belongs to an error that another error has caused, so that it is not shown.
pub(crate) fn is_follow_up(message: &str) -> bool {
    message.is_empty() || message.contains(POISON)
}

fn unknown_variable(name: &str, place: &Place, context: &ScriptContext) -> ApiError {
    let sources = context.sources.lock().unwrap_or_else(PoisonError::into_inner);
    let text = sources.get(&place.file).cloned().unwrap_or_default();
    drop(sources);
    let mut known = declared_names(&text, place.line);
    let declared_anywhere = declared_names(&text, usize::MAX);
    known.extend(["PI".to_string(), "TAU".to_string()]);
    let error = ApiError::new(format!(
        "unknown variable \"{name}\"{}",
        did_you_mean(name, known.iter().map(String::as_str).filter(|k| *k != name))
    ));
    if known.contains(name) {
        return error.hint("a function sees its parameters only: pass it as one");
    }
    if declared_anywhere.contains(name) {
        return error.hint("it is declared further down: move that line up");
    }
    if context.defs.iter().any(|d| d.name == name && d.on == HandleKind::None) {
        return error.hint(format!("{name} is a function: write {name}(…)"));
    }
    if closest(name, known.iter().map(String::as_str)).is_some() {
        return error;
    }
    match synonyms::suggest_function(context.defs, name, HandleKind::None) {
        Some(synonym) => error.hint(synonym.hint),
        None => error,
    }
}

/// The error about an unknown function. `signature`: `name (type, type)`.
fn unknown_function(signature: &str, context: &ScriptContext) -> ApiError {
    let (name, types) = signature_parts(signature);
    let argument_types = || types.iter().map(|t| type_word(t)).collect::<Vec<_>>().join(", ");
    if name.starts_with("anon$") {
        return ApiError::new("this function is called with the wrong number of arguments").hint(format!(
            "it is called with ({}); an on_frame callback takes the time, |t| …",
            argument_types()
        ));
    }
    if let Some(error) = operator_error(signature) {
        return ApiError::new(error);
    }
    if FORBIDDEN_NAMES.iter().any(|(n, _)| *n == name) {
        return forbidden_name_error(name);
    }
    let with_name: Vec<&Def> = context.defs.iter().filter(|d| d.name == name).collect();
    let receiver = types.first().and_then(|t| HandleKind::from_name(t));
    if let Some(kind) = receiver {
        if let Some(def) = with_name.iter().find(|d| d.on == kind) {
            return ApiError::new(format!(
                "write {}, not with {}",
                def.usage(),
                format_count(types.len() - 1, "argument")
            ))
            .hint(format!("{}.{}: {}", kind.name(), def.name, def.about().join(" ")));
        }
        return unknown_member(name, kind.name(), context);
    }
    if let Some(def) = with_name.iter().find(|d| d.on == HandleKind::None) {
        return ApiError::new(format!(
            "write {}, not with {}",
            def.usage(),
            format_count(types.len(), "argument")
        ))
        .hint(format!("{}: {}", def.name, def.about().join(" ")));
    }
    if let Some((_, args, about)) = context.defs.maths.iter().find(|f| f.0 == name) {
        return ApiError::new(format!("write {name}({args}) with numbers, not {name}({})", argument_types()))
            .hint(format!("{name}: {about}"));
    }
    // Functions of tests are not suggested: many of their names are everyday words.
    let outside_tests: Vec<&Def> = with_name.iter().filter(|d| !d.is_for_tests).copied().collect();
    if let Some(def) = outside_tests.first() {
        let kinds: Vec<&str> = outside_tests.iter().map(|d| d.on.name()).collect();
        return ApiError::new(format!(
            "{name} is a method of {}, not of {}",
            kinds.join(", "),
            match types.first() {
                Some(t) => type_word(t),
                None => "nothing",
            }
        ))
        .hint(format!("write x.{}", def.usage()));
    }
    let script_functions = context.functions.lock().unwrap_or_else(PoisonError::into_inner).clone();
    if let Some((_, count)) = script_functions.iter().find(|(n, _)| n == name) {
        return ApiError::new(format!(
            "{name} takes {}, not {}",
            format_count(*count, "argument"),
            types.len()
        ));
    }
    let globals = context.defs.iter().filter(|d| d.on == HandleKind::None).map(|d| d.name);
    let known: Vec<&str> = globals
        .chain(context.defs.maths.iter().map(|f| f.0))
        .chain(script_functions.iter().map(|(n, _)| n.as_str()))
        .chain(synonyms::ALIASES.iter().map(|(alias, _)| *alias))
        .collect();
    let unknown = format!("unknown function \"{name}\"");
    // The receiver may be a number or a text, so functions are suggested first.
    if let Some(synonym) = synonyms::suggest_function(context.defs, name, HandleKind::None) {
        return ApiError::new(format!("{unknown}{}", suggestion_text(&synonym.name))).hint(synonym.hint);
    }
    ApiError::new(format!("{unknown}{}", did_you_mean(name, known.iter().copied())))
        .hint(format!("called with ({})", argument_types()))
}

/// A count with its noun in the singular or plural: "1 argument", "2 arguments".
pub(crate) fn format_count(count: usize, noun: &str) -> String {
    if count == 1 { format!("1 {noun}") } else { format!("{count} {noun}s") }
}

/// The error about an unknown method or property. `kind`: the type of the value, as Rhai names it.
fn unknown_member(name: &str, kind: &str, context: &ScriptContext) -> ApiError {
    let Some(on) = HandleKind::from_name(kind) else {
        return ApiError::new(format!("{} has no \"{name}\"", type_word_with_article(kind)));
    };
    let methods: Vec<&str> = context.defs.iter().filter(|d| d.on == on).map(|d| d.name).collect();
    if methods.contains(&name) {
        return ApiError::new(format!("{name} is a method of {kind}: write .{name}(…)"));
    }
    let other_kinds: Vec<&str> = context
        .defs
        .iter()
        .filter(|d| d.name == name && d.on != HandleKind::None)
        .map(|d| d.on.name())
        .collect();
    let synonym = synonyms::suggest_function(context.defs, name, on);
    let is_method = |synonym: &Suggestion| methods.contains(&&*synonym.name);
    let (suggestion, hint) = match (closest(name, methods.iter().copied()), synonym) {
        (_, Some(synonym)) if is_method(&synonym) => (suggestion_text(&synonym.name), Some(synonym.hint)),
        (Some(close), _) => (suggestion_text(close), None),
        (None, _) if !other_kinds.is_empty() => {
            (format!("; it is a method of {}", other_kinds.join(", ")), None)
        }
        (None, Some(synonym)) => (suggestion_text(&synonym.name), Some(synonym.hint)),
        (None, None) => (String::new(), None),
    };
    let methods = || format!("methods of {kind}: {}", list(methods.iter().copied(), 40));
    ApiError::new(format!("{kind} has no method \"{name}\"{suggestion}")).hint(hint.unwrap_or_else(methods))
}

fn suggestion_text(name: &str) -> String {
    format!("; did you mean \"{name}\"?")
}

/// The word for a Rust type with its article, such as "an array".
fn type_word_with_article(rust: &str) -> String {
    let word = type_word(rust);
    let article =
        if word.starts_with(['A', 'E', 'I', 'O', 'U', 'a', 'e', 'i', 'o', 'u']) { "an" } else { "a" };
    format!("{article} {word}")
}

fn lower_first(text: &str) -> String {
    let mut chars = text.chars();
    match chars.next() {
        Some(c) if !text.chars().nth(1).is_some_and(char::is_uppercase) => {
            c.to_lowercase().chain(chars).collect()
        }
        _ => text.to_string(),
    }
}
