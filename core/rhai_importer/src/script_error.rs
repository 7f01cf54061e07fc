//! Error messages about a plugin's script, with the place and a suggestion.

use crate::engine::{MAX_ARRAY_LEN, MAX_CALL_DEPTH, MAX_TEXT_BYTES};
use choreo_plugin::excerpt;
use choreo_plugin::suggest::did_you_mean;
use choreo_sandbox::{declared_names, operator_error, signature_parts, type_word};
use rhai::{Engine, EvalAltResult, ParseErrorType};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// Error of a plugin's script, displayed with the source line and a caret below the place:
/// ```text
/// my.importer.rhai:9:24: unknown function f32ss; did you mean "f32s"?
///     let positions = b.f32ss(8, count);
///                       ^
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScriptError {
    pub file: String,
    /// Line number from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    pub message: String,
    /// The source line; empty if there is none.
    pub source_line: String,
}

impl ScriptError {
    pub(crate) fn new(script: &ScriptSource, (line, column): (usize, usize), message: String) -> ScriptError {
        let source_line = script.text.lines().nth(line.saturating_sub(1)).unwrap_or_default().to_string();
        ScriptError { file: script.file.to_string(), line, column, message, source_line }
    }

    /// The message with the source line and the caret, without file name and line number.
    pub fn what(&self) -> String {
        format!("{}{}", self.message, excerpt::below(&self.source_line, self.column))
    }
}

impl fmt::Display for ScriptError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ScriptError { file, line, column, .. } = self;
        write!(f, "{file}:{line}:{column}: {}", self.what())
    }
}

impl std::error::Error for ScriptError {}

/// Maximum number of signatures of a function that a message lists.
const MAX_SIGNATURES: usize = 4;

/// A plugin's text, and its name in messages.
#[derive(Clone, Copy)]
pub(crate) struct ScriptSource<'a> {
    pub file: &'a str,
    pub text: &'a str,
}

/// Names for suggestions.
#[derive(Default)]
pub(crate) struct KnownNames {
    /// Argument types of each signature, by function name.
    functions: BTreeMap<String, BTreeSet<String>>,
    /// Properties of native types.
    properties: BTreeSet<String>,
}

impl KnownNames {
    /// The functions and properties of an engine.
    pub(crate) fn of(engine: &Engine) -> KnownNames {
        let mut known = KnownNames::default();
        for signature in engine.gen_fn_signatures(true) {
            let name = signature.split('(').next().unwrap_or_default().trim();
            match name.split_once('$') {
                Some(("get", property)) => drop(known.properties.insert(property.to_string())),
                None if name.starts_with(|c: char| c.is_alphabetic()) => {
                    known.functions.entry(name.to_string()).or_default().insert(argument_types(&signature));
                }
                _ => {}
            }
        }
        known
    }
}

/// Argument types of a signature by their names in scripts: `Bytes, int` for `u8(_: &mut Bytes, _: i64) -> i64`.
fn argument_types(signature: &str) -> String {
    let inside = signature.split_once('(').map_or("", |(_, rest)| rest);
    let inside = inside.split(')').next().unwrap_or_default();
    let word = |argument: &str| {
        let of = argument.rsplit_once(": ").map_or(argument, |(_, of)| of).trim();
        match type_word(of.trim_start_matches("&mut ")) {
            "Dynamic" | "?" => "value".to_string(),
            "Map" => "object map".to_string(),
            "Array" => "array".to_string(),
            word => word.to_string(),
        }
    };
    inside.split(',').filter(|argument| !argument.trim().is_empty()).map(word).collect::<Vec<_>>().join(", ")
}

/// Names of properties (after a dot) and keys of object maps (before a colon) in a text.
fn property_names(text: &str) -> BTreeSet<String> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut names = BTreeSet::new();
    for line in text.lines() {
        let code = line.split("//").next().unwrap_or_default();
        let before_colons = code.split(':').filter_map(|part| part.trim_end().rsplit(|c| !is_word(c)).next());
        let after_dots = code.split('.').skip(1).filter_map(|part| part.split(|c| !is_word(c)).next());
        names.extend(before_colons.chain(after_dots).filter(|name| !name.is_empty()).map(String::from));
    }
    names
}

/// Keys of the object maps that plugins receive.
const MAP_KEYS: [&str; 16] = [
    "bytes", "name", "options", "needs", "geometry", "clips", "textures", "stem", "fps", "times", "actors",
    "cameras", "joints", "parents", "asset", "len",
];

/// Error with the innermost place and reason. `line` is used for exceeded limits, whose place the interpreter loses when it
/// leaves the function.
pub(crate) fn script_error(
    script: &ScriptSource,
    error: Box<EvalAltResult>,
    known: &KnownNames,
    line: usize,
) -> ScriptError {
    let mut error = error;
    while let EvalAltResult::ErrorInFunctionCall(_, _, inner, _) = *error {
        error = inner;
    }
    let place = error.take_position();
    let at = (place.line().unwrap_or(line), place.position().unwrap_or(1));
    let message = error_message(script, &error, known, at.0);
    ScriptError::new(script, at, message)
}

fn error_message(script: &ScriptSource, error: &EvalAltResult, known: &KnownNames, line: usize) -> String {
    match error {
        EvalAltResult::ErrorRuntime(value, _) => value.to_string(),
        EvalAltResult::ErrorFunctionNotFound(signature, _) => unknown_function(script, signature, known),
        EvalAltResult::ErrorVariableNotFound(name, _) => unknown_variable(script, name, known, line),
        EvalAltResult::ErrorParsing(ParseErrorType::VariableUndefined(name), _) => {
            unknown_variable(script, name, known, line)
        }
        EvalAltResult::ErrorPropertyNotFound(name, _) => unknown_property(script, name, known),
        EvalAltResult::ErrorDotExpr(text, _) => match text.split('\'').nth(1) {
            // `Unknown property 'foo' - a getter is not registered for type 'Bytes'`.
            Some(name) => unknown_property(script, name, known),
            None => text.clone(),
        },
        EvalAltResult::ErrorTerminated(why, _) => why.to_string(),
        EvalAltResult::ErrorStackOverflow(_) => {
            format!(
                "more than {MAX_CALL_DEPTH} nested calls, which is the limit: does a function call itself without end?"
            )
        }
        EvalAltResult::ErrorDataTooLarge(what, _) if what.to_lowercase().contains("string") => {
            format!("a text of more than {MAX_TEXT_BYTES} bytes, which is the limit")
        }
        EvalAltResult::ErrorDataTooLarge(..) => format!(
            "an array or map of more than {MAX_ARRAY_LEN} elements, which is the limit; numbers(…) and f32s(…) hold more"
        ),
        _ => error.to_string(),
    }
}

fn unknown_function(script: &ScriptSource, signature: &str, known: &KnownNames) -> String {
    if let Some(text) = operator_error(signature) {
        return text;
    }
    let (name, types) = signature_parts(signature);
    let defined = defined_functions(script.text);
    let names = || known.functions.keys().chain(&defined).map(String::as_str);
    if names().any(|known| known == name) {
        let types = types.iter().map(|t| type_word(t)).collect::<Vec<_>>().join(", ");
        let forms = known.functions.get(name).into_iter().flatten();
        let shown: Vec<String> =
            forms.clone().take(MAX_SIGNATURES).map(|form| format!("{name}({form})")).collect();
        let there = if shown.is_empty() { String::new() } else { format!("; there is {}", shown.join(", ")) };
        // Elements of native arrays are floats, where an int may be needed.
        let is_rounded = forms.clone().any(|form| *form == types.replace("float", "int"));
        let whole = if is_rounded { "; x.to_int() makes a whole number of a float" } else { "" };
        return format!("wrong arguments: there is no {name}({types}){there}{whole}");
    }
    format!("unknown function {name}{}", did_you_mean(name, names()))
}

fn unknown_variable(script: &ScriptSource, name: &str, known: &KnownNames, line: usize) -> String {
    let before = declared_names(script.text, line);
    if before.contains(name) {
        return format!("unknown variable {name}: a function sees its parameters only; pass it as one");
    }
    if known.functions.contains_key(name) || defined_functions(script.text).contains(name) {
        return format!("unknown variable {name}; {name} is a function: write {name}(…)");
    }
    format!("unknown variable {name}{}", did_you_mean(name, before.iter().map(String::as_str)))
}

fn unknown_property(script: &ScriptSource, name: &str, known: &KnownNames) -> String {
    let written = property_names(script.text);
    let names = MAP_KEYS.iter().copied().chain(known.properties.iter().chain(&written).map(String::as_str));
    format!("unknown property {name}{}", did_you_mean(name, names.filter(|known| *known != name)))
}

/// Names of the functions that a text defines.
fn defined_functions(text: &str) -> BTreeSet<String> {
    let name = |rest: &str| rest.split('(').next().unwrap_or_default().trim().to_string();
    text.split("fn ")
        .skip(1)
        .map(name)
        .filter(|name| name.chars().all(|c| c.is_alphanumeric() || c == '_'))
        .collect()
}
