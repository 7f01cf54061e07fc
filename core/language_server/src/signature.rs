//! Signature help: the forms of the call around the cursor.

use crate::context::call_around;
use crate::facts;
use crate::view::View;
use serde_json::{Value, json};

pub(crate) fn signature(view: &View, byte: usize) -> Value {
    let source = view.source;
    let Some(site) = call_around(view.types(), byte) else { return Value::Null };
    let script_function = script_function_signature(view, source.get(site.name), site.argument);
    let Some(entry) = site.entry(source).filter(|_| script_function.is_null() || site.receiver.is_some())
    else {
        return script_function;
    };
    let given = source.arguments(site.open).len().max(site.argument + 1);
    let mut active = None;
    let signatures: Vec<Value> = entry
        .usages
        .iter()
        .enumerate()
        .map(|(index, usage)| {
            let parameters = parameter_ranges(usage);
            if active.is_none() && parameters.len() >= given {
                active = Some(index);
            }
            let about = facts::describe_entry(entry);
            json!({
                "label": usage, "parameters": parameters, "activeParameter": site.argument,
                "documentation": { "kind": "markdown", "value": about },
            })
        })
        .collect();
    json!({ "signatures": signatures, "activeSignature": active.unwrap_or(0), "activeParameter": site.argument })
}

/// Signature of a function that the script defines.
fn script_function_signature(view: &View, name: &str, argument: usize) -> Value {
    let source = view.source;
    let function = source.function_named(name);
    let Some((function, end)) = function.and_then(|f| Some((f, source.matching_bracket(f + 1)?))) else {
        return Value::Null;
    };
    let label = &source.text[source.tokens[function].start..source.tokens[end].end];
    json!({
        "signatures": [{ "label": label, "parameters": parameter_ranges(label), "activeParameter": argument }],
        "activeSignature": 0, "activeParameter": argument,
    })
}

/// Ranges of the parameters in a label, in UTF-16.
fn parameter_ranges(label: &str) -> Vec<Value> {
    let Some(open) = label.find('(') else { return Vec::new() };
    let inside = label[open + 1..].trim_end_matches(')');
    let utf16 = |text: &str| text.encode_utf16().count();
    let mut at = open + 1;
    let mut found = Vec::new();
    for part in inside.split(',').filter(|part| !part.trim().is_empty()) {
        let start = at + part.len() - part.trim_start().len();
        let end = start + part.trim().len();
        found.push(json!({ "label": [utf16(&label[..start]), utf16(&label[..end])] }));
        at += part.len() + 1;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::parameter_ranges;
    use serde_json::json;

    #[test]
    fn parameter_ranges_cover_the_parameter_names_of_a_label() {
        let found = parameter_ranges("Actor.at(x, yy)");
        assert_eq!(found, [json!({ "label": [9, 10] }), json!({ "label": [12, 14] })]);
        assert!(parameter_ranges("Cue.loop()").is_empty());
    }
}
