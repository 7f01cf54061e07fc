//! Rhai's text as far as edits need it: calls, brackets, comments and text literals.

use std::ops::Range;

/// A call's name, the inside of its parentheses, and the byte after them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Call {
    pub name: Range<usize>,
    pub inside: Range<usize>,
    pub end: usize,
}

/// `.from(x).until(y)` behind a call, up to the next `play` or `then`.
pub(super) fn chain_after(text: &str, mut at: usize) -> Vec<Call> {
    let mut chain = Vec::new();
    loop {
        at = skip(text, at);
        if !text[at..].starts_with('.') {
            return chain;
        }
        let Some(call) = call_from(text, at + 1) else { return chain };
        if matches!(&text[call.name.clone()], "then" | "play" | "then_at") {
            return chain;
        }
        at = call.end;
        chain.push(call);
    }
}

/// Every call of a variable's methods that stands as deep in brackets as the byte `like`: `name.a(…).b(…)`, as chains in
/// order, each with where it begins. Deeper ones hold for one round of a loop, or one frame.
pub(super) fn chains_of(text: &str, name: &str, like: usize) -> Vec<(usize, Vec<Call>)> {
    let depth_at = |end: usize| depth_to(text, end);
    let wanted = depth_at(like);
    let mut chains = Vec::new();
    let mut at = 0;
    while at < text.len() {
        let past = past_quiet(text, at);
        if past > at {
            at = past;
            continue;
        }
        let length = text[at..].find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len() - at);
        if length == 0 {
            at += text[at..].chars().next().map_or(1, char::len_utf8);
            continue;
        }
        let after = at + length;
        let is_field = text[..at].trim_end().ends_with('.');
        if &text[at..after] == name
            && !is_field
            && text[skip(text, after)..].starts_with('.')
            && depth_at(at) == wanted
        {
            chains.push((at, chain_after(text, after)));
        }
        at = after;
    }
    chains
}

/// How many brackets are open before a byte.
pub(super) fn depth_to(text: &str, end: usize) -> usize {
    let (mut at, mut depth) = (0, 0usize);
    while at < end {
        let past = past_quiet(text, at);
        if past > at {
            at = past;
            continue;
        }
        match text.as_bytes()[at] {
            b'(' | b'[' | b'{' => depth += 1,
            b')' | b']' | b'}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        at += text[at..].chars().next().map_or(1, char::len_utf8);
    }
    depth
}

/// Behind the `;` that ends the statement in which a byte stands; the end of the line where none does.
pub(super) fn statement_end(text: &str, mut at: usize) -> usize {
    while at < text.len() {
        let past = past_quiet(text, at);
        if past > at {
            at = past;
        } else if text[at..].starts_with(';') {
            return at + 1;
        } else if text[at..].starts_with(['(', '[', '{']) {
            at = matching(text, at).map_or(text.len(), |close| close + 1);
        } else if text[at..].starts_with([')', ']', '}']) {
            return at;
        } else {
            at += text[at..].chars().next().map_or(1, char::len_utf8);
        }
    }
    text.len()
}

pub(super) fn find(chain: &[Call], text: &str, name: &str) -> Option<Range<usize>> {
    chain.iter().rev().find(|call| text[call.name.clone()] == *name).map(|call| call.inside.clone())
}

/// `name(…)` at a byte, or behind the dot there.
pub(super) fn call_from(text: &str, at: usize) -> Option<Call> {
    let start = skip(text, at);
    let start = if text[start..].starts_with('.') { skip(text, start + 1) } else { start };
    let length = text[start..].find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(0);
    let open = skip(text, start + length);
    if length == 0 || !text[open..].starts_with('(') {
        return None;
    }
    let close = matching(text, open)?;
    Some(Call { name: start..start + length, inside: open + 1..close, end: close + 1 })
}

/// The byte of the parenthesis that closes the one at `open`.
pub(super) fn matching(text: &str, open: usize) -> Option<usize> {
    let mut depth = 0usize;
    let mut at = open;
    while at < text.len() {
        let past = past_quiet(text, at);
        if past > at {
            at = past;
            continue;
        }
        let c = text[at..].chars().next()?;
        match c {
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => {
                depth = depth.checked_sub(1)?;
                if depth == 0 {
                    return Some(at);
                }
            }
            _ => {}
        }
        at += c.len_utf8();
    }
    None
}

/// Behind the comment or text literal that begins here; the same byte where none does.
pub(super) fn past_quiet(text: &str, at: usize) -> usize {
    let rest = &text[at..];
    if rest.starts_with("//") {
        return rest.find('\n').map_or(text.len(), |n| at + n);
    }
    if rest.starts_with("/*") {
        // Rhai's block comments nest.
        let (mut depth, mut i) = (0usize, 0);
        while i < rest.len() {
            if rest[i..].starts_with("/*") {
                (depth, i) = (depth + 1, i + 2);
            } else if rest[i..].starts_with("*/") {
                (depth, i) = (depth - 1, i + 2);
                if depth == 0 {
                    return at + i;
                }
            } else {
                i += rest[i..].chars().next().map_or(1, char::len_utf8);
            }
        }
        return text.len();
    }
    let Some(quote @ ('"' | '\'' | '`')) = rest.chars().next() else { return at };
    let mut escaped = false;
    for (i, c) in rest.char_indices().skip(1) {
        match c {
            _ if escaped => escaped = false,
            '\\' if quote != '`' => escaped = true,
            c if c == quote => return at + i + 1,
            _ => {}
        }
    }
    text.len()
}

/// Behind blanks and comments.
pub(super) fn skip(text: &str, mut at: usize) -> usize {
    loop {
        let blank: usize = text[at..].chars().take_while(|c| c.is_whitespace()).map(char::len_utf8).sum();
        at += blank;
        if !text[at..].starts_with("//") && !text[at..].starts_with("/*") {
            return at;
        }
        at = past_quiet(text, at);
    }
}

/// Without the blanks and comments around it.
pub(super) fn trimmed(text: &str, bytes: &Range<usize>) -> Range<usize> {
    let start = skip(text, bytes.start).min(bytes.end);
    let (mut at, mut end) = (start, start);
    while at < bytes.end {
        let comment = text[at..].starts_with("//") || text[at..].starts_with("/*");
        let past = past_quiet(text, at);
        if past > at {
            at = past.min(bytes.end);
            end = if comment { end } else { at };
            continue;
        }
        let Some(c) = text[at..].chars().next() else { break };
        at += c.len_utf8();
        end = if c.is_whitespace() { end } else { at };
    }
    start..end
}

/// The inside of the `#{ … }` that is the last argument.
pub(super) fn map_in(text: &str, inside: &Range<usize>) -> Option<Range<usize>> {
    let mut at = inside.start;
    while at < inside.end {
        let past = past_quiet(text, at);
        if past > at {
            at = past;
        } else if text[at..].starts_with("#{") {
            let close = matching(text, at + 1)?;
            return (skip(text, close + 1) >= inside.end).then_some(at + 2..close);
        } else if text[at..].starts_with(['(', '[', '{']) {
            at = matching(text, at)? + 1;
        } else {
            at += text[at..].chars().next()?.len_utf8();
        }
    }
    None
}

pub(super) fn value_end(text: &str, mut at: usize, end: usize) -> usize {
    while at < end {
        let past = past_quiet(text, at);
        if past > at {
            at = past;
        } else if text[at..].starts_with(',') {
            return at;
        } else if text[at..].starts_with(['(', '[', '{']) {
            at = matching(text, at).map_or(end, |close| close + 1);
        } else {
            at += text[at..].chars().next().map_or(1, char::len_utf8);
        }
    }
    end
}

pub(super) fn top_level_arguments(text: &str, inside: &Range<usize>) -> usize {
    let (mut at, mut count) = (inside.start, 0);
    while at < inside.end {
        count += 1;
        at = value_end(text, at, inside.end) + 1;
    }
    count
}

pub(super) fn byte_at(text: &str, line: usize, column: usize) -> Option<usize> {
    let start: usize = text.split_inclusive('\n').take(line.checked_sub(1)?).map(str::len).sum();
    let rest = text.get(start..).filter(|rest| !rest.is_empty())?;
    let within: usize = rest.chars().take(column.saturating_sub(1)).map(char::len_utf8).sum();
    Some(start + within)
}
