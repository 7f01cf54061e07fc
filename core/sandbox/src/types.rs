//! Names of Rhai's types as scripts know them, and names that a script declares.

use std::collections::BTreeSet;

/// The name of a type in messages to script authors: "int" for `i64`, "text" for `&str`.
pub fn type_word(rust: &str) -> &str {
    match rust {
        "i64" | "int" => "int",
        "f64" | "float" => "float",
        "()" => "nothing",
        "string" | "text" | "ImmutableString" | "&str" => "text",
        "array" => "array",
        "map" => "object map",
        "Fn" => "function",
        other => other.rsplit("::").next().unwrap_or(other),
    }
}

/// Name and types of a signature of [`rhai::EvalAltResult::ErrorFunctionNotFound`], such as `- (&str | ImmutableString | String, i64)`.
pub fn signature_parts(signature: &str) -> (&str, Vec<&str>) {
    let (name, types) = signature.split_once(" (").unwrap_or((signature, ")"));
    let types = types.trim_end_matches(')').split(", ").filter(|t| !t.is_empty());
    (name, types.map(|t| if t.starts_with("&str |") { "text" } else { t }).collect())
}

/// The message `cannot compute text - int` if the signature is that of an operator.
pub fn operator_error(signature: &str) -> Option<String> {
    let (name, types) = signature_parts(signature);
    if name.starts_with(|c: char| c.is_alphabetic() || c == '_') {
        return None;
    }
    Some(match types.as_slice() {
        [a] => format!("cannot compute {name} {}", type_word(a)),
        [a, b] => {
            let (a, b) = (type_word(a), type_word(b));
            let hint = match matches!(name, "&" | "|" | "^") && (a == "bool") != (b == "bool") {
                true => format!("; comparisons bind closer than {name}: put parentheses around a {name} b"),
                false => String::new(),
            };
            format!("cannot compute {a} {name} {b}{hint}")
        }
        _ => format!("cannot compute {signature}"),
    })
}

/// Variables and parameters that the lines up to `line` declare. The text is read roughly, for suggestions only.
pub fn declared_names(text: &str, line: usize) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for row in text.lines().take(line) {
        let code = row.split("//").next().unwrap_or("");
        let words: Vec<&str> = code.split(|c: char| !(c.is_alphanumeric() || c == '_')).collect();
        let words: Vec<&str> = words.into_iter().filter(|w| !w.is_empty()).collect();
        for pair in words.windows(2) {
            if matches!(pair[0], "let" | "const" | "for" | "as") {
                names.insert(pair[1].to_string());
            }
        }
        if let Some((_, parameters)) = code.split_once("fn ").and_then(|(_, f)| f.split_once('(')) {
            let parameters = parameters.split(')').next().unwrap_or("");
            names.extend(parameters.split(',').map(|p| p.trim().to_string()).filter(|p| !p.is_empty()));
        }
    }
    names
}
