//! Code actions: edits that resolve a diagnostic with one keystroke.

use crate::diagnostics::suggestion;
use crate::source::{is_string, is_word};
use crate::view::View;
use choreo_script::describe;
use serde_json::{Value, json};

/// Code actions for the diagnostics that the client sends.
pub(crate) fn actions(view: &View, uri: &str, diagnostics: &[Value]) -> Value {
    let mut found = Vec::new();
    for diagnostic in diagnostics.iter().filter(|d| d["source"] == "choreo") {
        let message = diagnostic["message"].as_str().unwrap_or_default();
        let mut add = |title: String, preferred: bool, edits: Vec<Value>| {
            found.push(json!({
                "title": title, "kind": "quickfix", "isPreferred": preferred, "diagnostics": [diagnostic],
                "edit": { "changes": { uri: edits } },
            }));
        };
        if let Some((title, edit)) =
            suggestion(message).and_then(|name| replace_with_suggestion(view, diagnostic, name))
        {
            add(title, true, vec![edit]);
        }
        for (title, edits) in import_actions(view, diagnostic, message) {
            add(title, true, edits);
        }
        if let Some(rule) = diagnostic["code"].as_str() {
            add(format!("Allow {rule} here"), false, vec![allow_finding(view, diagnostic, rule)]);
        }
    }
    found.into()
}

/// Edit that replaces a range of the protocol by a text.
fn edit(range: Value, text: String) -> Value {
    json!({ "range": range, "newText": text })
}

/// Action that replaces the wrong name by the suggested one.
fn replace_with_suggestion(view: &View, diagnostic: &Value, name: &str) -> Option<(String, Value)> {
    let source = view.source;
    let bytes = source.lines.bytes_of_range(&source.text, &diagnostic["range"]);
    let token = source.token_at(bytes.start).filter(|t| source.tokens[*t].start >= bytes.start)?;
    let title = format!("Change to \"{name}\"");
    if is_string(source.get(token)) {
        let literal = choreo_script::quoted(name);
        let content = literal[1..literal.len() - 1].to_string();
        return Some((title, edit(source.range(&source.string_content_range(token)), content)));
    }
    let plain = name.chars().all(|c| c.is_alphanumeric() || c == '_');
    (plain && is_word(source.get(token)))
        .then(|| (title, edit(source.range(&source.tokens[token]), name.to_string())))
}

/// Action that marks a finding as intended: extends an `// allow:` comment on its line or the line above, or adds one above.
fn allow_finding(view: &View, diagnostic: &Value, rule: &str) -> Value {
    let source = view.source;
    let line = diagnostic["range"]["start"]["line"].as_u64().unwrap_or(0) as usize;
    let comment = describe::allow_comment(rule);
    let above = line.checked_sub(1).map(|line| source.lines.bytes_of_line(&source.text, line));
    for bytes in [Some(source.lines.bytes_of_line(&source.text, line)), above].into_iter().flatten() {
        if source.text[bytes.clone()].contains("// allow:") {
            let end = bytes.start + source.text[bytes].trim_end().len();
            return edit(source.range(&(end..end)), format!(", {rule}"));
        }
    }
    let bytes = source.lines.bytes_of_line(&source.text, line);
    let text = &source.text[bytes.clone()];
    let indentation = &text[..text.len() - text.trim_start().len()];
    let line_break = if source.text.contains("\r\n") { "\r\n" } else { "\n" };
    edit(source.range(&(bytes.start..bytes.start)), format!("{indentation}{comment}{line_break}"))
}

/// Actions that import a missing module: the module whose name is used, or modules that have the called function.
fn import_actions(view: &View, diagnostic: &Value, message: &str) -> Vec<(String, Vec<Value>)> {
    let quoted =
        |mark: &str| message.strip_prefix(mark).and_then(|rest| rest.split('"').next()).map(str::to_string);
    let source = view.source;
    let names = view.files_named(&["rhai".into()]);
    let modules = names.iter().filter_map(|name| name.strip_suffix(".rhai"));
    if let Some(wanted) = quoted("unknown module \"") {
        let fits = modules.filter(|module| module.rsplit('/').next() == Some(&wanted));
        return fits
            .take(3)
            .map(|module| add_import(view, module, &wanted))
            .map(|(title, edit)| (title, vec![edit]))
            .collect();
    }
    let Some(wanted) = quoted("unknown function \"") else { return Vec::new() };
    /// Largest number of modules that are searched for a function.
    const MAX_MODULES: usize = 40;
    let mut found = Vec::new();
    for module in modules.take(MAX_MODULES) {
        let Some(text) = view.types().modules.module(module) else { continue };
        let alias = module.rsplit('/').next().unwrap_or(module);
        if text.function_named(&wanted).is_none() || !alias.chars().all(|c| c.is_alphanumeric() || c == '_') {
            continue;
        }
        let start = source.lines.bytes_of_range(&source.text, &diagnostic["range"]).start;
        let (title, first) = add_import(view, module, alias);
        let qualified = edit(source.range(&(start..start)), format!("{alias}::"));
        found.push((title, vec![first, qualified]));
    }
    found
}

/// Edit that adds an import after the existing ones, or before the first statement.
fn add_import(view: &View, module: &str, alias: &str) -> (String, Value) {
    let source = view.source;
    let tokens = 0..source.tokens.len();
    let last = tokens.rev().find(|i| source.get(*i) == "import" && source.enclosing_bracket(*i).is_none());
    let line = match last {
        Some(token) => source.lines.line_of(source.tokens[token].start) + 1,
        None => source.tokens.first().map_or(0, |token| source.lines.line_of(token.start)),
    };
    let line_break = if source.text.contains("\r\n") { "\r\n" } else { "\n" };
    let statement = format!("import \"{module}\" as {alias};{line_break}");
    let at = json!({ "line": line, "character": 0 });
    (format!("Import \"{module}\""), edit(json!({ "start": at, "end": at }), statement))
}
