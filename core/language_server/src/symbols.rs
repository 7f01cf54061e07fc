//! Document symbols: variables, functions, modules, tests, actors, cameras and markers, by name.

use crate::values::DeclarationKind;
use crate::view::View;
use serde_json::{Value, json};
use std::ops::Range;

/// Kinds of symbols, as the protocol numbers them.
const MODULE: u8 = 2;
const METHOD: u8 = 6;
const FUNCTION: u8 = 12;
const VARIABLE: u8 = 13;
const OBJECT: u8 = 19;

pub(crate) fn symbols(view: &View) -> Value {
    let source = view.source;
    let types = view.types();
    let mut found: Vec<(Range<usize>, Value)> = Vec::new();
    for token in 0..source.tokens.len() {
        let bytes = source.tokens[token].clone();
        let name = source.get(token);
        let named = |name: &str, kind: u8, detail: String, whole: Range<usize>| {
            let value = json!({
                "name": name, "kind": kind, "detail": detail,
                "range": source.range(&whole), "selectionRange": source.range(&bytes),
            });
            (whole, value)
        };
        // Tests, actors, cameras and markers are listed by the name in their call, even without a variable.
        let on_stage = matches!(name, "test" | "cast" | "camera" | "marker") && source.get(token + 1) == "(";
        if on_stage
            && source.token_before(token, 1) != "."
            && let Some(text) = source.string_value(token + 2)
        {
            let end = source.matching_bracket(token + 1).map_or(bytes.end, |close| source.tokens[close].end);
            let kind = if name == "test" { METHOD } else { OBJECT };
            found.push(named(&text, kind, name.to_string(), bytes.start..end));
            continue;
        }
        let Some(declaration) = types.declaration_at(token) else { continue };
        match declaration.kind {
            DeclarationKind::Function => {
                let body = source.matching_bracket(token + 1).map(|close| close + 1);
                let end = body
                    .and_then(|open| source.matching_bracket(open))
                    .map_or(bytes.end, |close| source.tokens[close].end);
                let parameters = source
                    .matching_bracket(token + 1)
                    .map_or("", |close| &source.text[bytes.end..source.tokens[close].end]);
                found.push(named(
                    name,
                    FUNCTION,
                    parameters.to_string(),
                    source.tokens[token - 1].start..end,
                ));
            }
            DeclarationKind::Variable => {
                let last = types.statement_end(token).saturating_sub(1).max(token);
                let detail = crate::completion::describe_value(&types.declared_value(&declaration));
                found.push(named(
                    name,
                    VARIABLE,
                    detail,
                    source.tokens[token - 1].start..source.tokens[last].end,
                ));
            }
            DeclarationKind::Module => {
                found.push(named(name, MODULE, String::new(), source.tokens[token - 3].start..bytes.end))
            }
            _ => {}
        }
    }
    nest_symbols(found).into()
}

/// Nests symbols: a symbol inside another becomes its child.
fn nest_symbols(found: Vec<(Range<usize>, Value)>) -> Vec<Value> {
    let mut open: Vec<(Range<usize>, Value)> = Vec::new();
    let mut roots: Vec<Value> = Vec::new();
    let mut sorted = found;
    sorted.sort_by_key(|(bytes, _)| (bytes.start, std::cmp::Reverse(bytes.end)));
    let close = |open: &mut Vec<(Range<usize>, Value)>, roots: &mut Vec<Value>| {
        let Some((_, value)) = open.pop() else { return };
        match open.last_mut() {
            Some((_, parent)) => match parent["children"].as_array_mut() {
                Some(children) => children.push(value),
                None => parent["children"] = json!([value]),
            },
            None => roots.push(value),
        }
    };
    for (bytes, value) in sorted {
        while open.last().is_some_and(|(outer, _)| outer.end < bytes.end) {
            close(&mut open, &mut roots);
        }
        open.push((bytes, value));
    }
    while !open.is_empty() {
        close(&mut open, &mut roots);
    }
    roots
}

/// Folding ranges: brackets, and comments that span several lines.
pub(crate) fn folding_ranges(view: &View) -> Value {
    let source = view.source;
    let mut found = Vec::new();
    for token in 0..source.tokens.len() {
        let Some(close) = source.matching_bracket(token).filter(|close| *close > token) else { continue };
        let start = source.lines.line_of(source.tokens[token].start);
        let end = source.lines.line_of(source.tokens[close].start);
        // The line with the closing bracket stays visible.
        if end > start + 1 {
            found.push(json!({ "startLine": start, "endLine": end - 1 }));
        }
    }
    let is_comment = |line: usize| {
        source.text[source.lines.bytes_of_line(&source.text, line)].trim_start().starts_with("//")
    };
    let mut line = 0;
    while line < source.lines.count() {
        let first = line;
        while line < source.lines.count() && is_comment(line) {
            line += 1;
        }
        if line > first + 1 {
            found.push(json!({ "startLine": first, "endLine": line - 1, "kind": "comment" }));
        }
        line = line.max(first + 1);
    }
    found.into()
}
