//! Formatting of JSON for people and programs: indented, with each list of numbers, such as a matrix, on one line.

use serde_json::Value;

/// Formats a value as indented JSON.
pub(crate) fn pretty(value: &Value) -> String {
    let mut out = String::new();
    write_value(value, 0, &mut out);
    out
}

fn write_value(value: &Value, depth: usize, out: &mut String) {
    let new_line = |out: &mut String, depth: usize| {
        out.push('\n');
        out.push_str(&"  ".repeat(depth));
    };
    match value {
        Value::Array(items) if !items.is_empty() && items.iter().all(Value::is_number) => {
            let numbers: Vec<String> = items.iter().map(Value::to_string).collect();
            out.push_str(&format!("[{}]", numbers.join(", ")));
        }
        Value::Array(items) if !items.is_empty() => {
            out.push('[');
            for (index, item) in items.iter().enumerate() {
                out.push_str(if index > 0 { "," } else { "" });
                new_line(out, depth + 1);
                write_value(item, depth + 1, out);
            }
            new_line(out, depth);
            out.push(']');
        }
        Value::Object(members) if !members.is_empty() => {
            out.push('{');
            for (index, (name, member)) in members.iter().enumerate() {
                out.push_str(if index > 0 { "," } else { "" });
                new_line(out, depth + 1);
                out.push_str(&format!("{}: ", Value::from(name.as_str())));
                write_value(member, depth + 1, out);
            }
            new_line(out, depth);
            out.push('}');
        }
        plain => out.push_str(&plain.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::pretty;
    use serde_json::{Value, json};

    #[test]
    fn lists_of_numbers_are_written_on_one_line() {
        let value =
            json!({ "a\"b": [], "m": [1.0, 0.5, -2], "n": { "o": {}, "s": ["x", [1, 2]] }, "z": null });
        let text = pretty(&value);
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), value);
        let lines: Vec<&str> = text.lines().map(str::trim).collect();
        assert_eq!(
            lines,
            [
                "{",
                "\"a\\\"b\": [],",
                "\"m\": [1.0, 0.5, -2],",
                "\"n\": {",
                "\"o\": {},",
                "\"s\": [",
                "\"x\",",
                "[1, 2]",
                "]",
                "},",
                "\"z\": null",
                "}"
            ]
        );
    }
}
