//! Changes of a script's text at one place: a bar that was dragged rewrites the number that it came from. All else of the text
//! stays, comments and spaces too. What a number was computed from is never guessed: then the change is refused, with the line.

use std::ops::Range;

/// Of a cue: what was dragged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// `.from(…)`
    Start,
    /// `.until(…)`
    End,
    /// `#{ fade: … }`
    FadeIn,
}

/// These bytes of the text become this.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Edit {
    pub range: Range<usize>,
    pub text: String,
}

impl Edit {
    pub fn apply(&self, text: &str) -> String {
        format!("{}{}{}", &text[..self.range.start], self.text, &text[self.range.end..])
    }

    /// What takes it back, of the text before it.
    pub fn inverse(&self, before: &str) -> Edit {
        let range = self.range.start..self.range.start + self.text.len();
        Edit { range, text: before[self.range.clone()].to_string() }
    }

    /// The same change where the text has since been changed elsewhere: found by the line that it is in. `then`: the text that it
    /// was made for. `None` where that line is no longer there, or is there more than once.
    pub fn carried_over(&self, then: &str, now: &str) -> Option<Edit> {
        let line = line_around(then, self.range.start);
        let text = then.get(line.clone())?;
        if self.range.end > line.end || text.trim().is_empty() {
            return None;
        }
        let mut at = 0;
        let mut found = None;
        for candidate in now.split('\n') {
            if candidate == text && found.replace(at).is_some() {
                return None;
            }
            at += candidate.len() + 1;
        }
        let start = found? + (self.range.start - line.start);
        Some(Edit { range: start..start + self.range.len(), text: self.text.clone() })
    }
}

/// Bytes of the line that holds a byte, without its end.
fn line_around(text: &str, at: usize) -> Range<usize> {
    let start = text[..at].rfind('\n').map_or(0, |n| n + 1);
    let end = text[at..].find('\n').map_or(text.len(), |n| at + n);
    start..end
}

/// Sets a time of the cue that the call at a place makes (`play` or `then`; line and column in characters, from 1), in seconds.
///
/// # Errors
/// Why it cannot be set, for the user: the number is computed, or the call is not there.
pub fn set_time(text: &str, line: usize, column: usize, part: Part, secs: f64) -> Result<Edit, String> {
    let refuse = |why: &str| Err(format!("line {line}: {why}"));
    let Some(at) = byte_at(text, line, column) else { return refuse("the script has no such line") };
    let Some(call) = call_from(text, at) else { return refuse("there is no play or then to be changed") };
    let chain = chain_after(text, call.end);
    let (name, argument) = match part {
        Part::Start => ("from", find(&chain, text, "from")),
        Part::End => ("until", find(&chain, text, "until")),
        Part::FadeIn => return set_option(text, &call, line, "fade", secs),
    };
    if let Some(argument) = argument {
        return match number(text, &argument, secs) {
            Some(edit) => Ok(edit),
            None => refuse(&format!(
                "the time in .{name}({}) is computed; change it there",
                text[argument].trim()
            )),
        };
    }
    if part == Part::Start && text[call.name.clone()] == *"then" {
        return refuse("it begins where the clip before it ends; change that one's end");
    }
    Ok(Edit { range: call.end..call.end, text: format!(".{name}({})", seconds(secs)) })
}

/// A call's name, the inside of its parentheses, and the byte after them.
#[derive(Clone, Debug, PartialEq)]
struct Call {
    name: Range<usize>,
    inside: Range<usize>,
    end: usize,
}

/// `.from(x).until(y)` behind a call, up to the next `play` or `then`.
fn chain_after(text: &str, mut at: usize) -> Vec<Call> {
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

fn find(chain: &[Call], text: &str, name: &str) -> Option<Range<usize>> {
    chain.iter().rev().find(|call| text[call.name.clone()] == *name).map(|call| call.inside.clone())
}

/// `name(…)` at a byte, or behind the dot there.
fn call_from(text: &str, at: usize) -> Option<Call> {
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
fn matching(text: &str, open: usize) -> Option<usize> {
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
fn past_quiet(text: &str, at: usize) -> usize {
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
fn skip(text: &str, mut at: usize) -> usize {
    loop {
        let blank: usize = text[at..].chars().take_while(|c| c.is_whitespace()).map(char::len_utf8).sum();
        at += blank;
        if !text[at..].starts_with("//") && !text[at..].starts_with("/*") {
            return at;
        }
        at = past_quiet(text, at);
    }
}

/// Rewrites a number literal, or `f(literal)` — frames, at a rate that the script knows and this does not: then it is refused
/// as computed.
fn number(text: &str, argument: &Range<usize>, secs: f64) -> Option<Edit> {
    let inside = &text[argument.clone()];
    let literal = inside.trim();
    let is_number = literal.starts_with(|c: char| c.is_ascii_digit())
        && literal.chars().all(|c| c.is_ascii_digit() || c == '.' || c == '_')
        && literal.replace('_', "").parse::<f64>().is_ok();
    if !is_number {
        return None;
    }
    let start = argument.start + (inside.len() - inside.trim_start().len());
    Some(Edit { range: start..start + literal.len(), text: seconds(secs) })
}

/// In the options of a call, `#{ name: number }`.
fn set_option(text: &str, call: &Call, line: usize, name: &str, secs: f64) -> Result<Edit, String> {
    let inside = &text[call.inside.clone()];
    let new = format!("{name}: {}", seconds(secs));
    let Some(map) = map_in(text, &call.inside) else {
        if inside.contains("#{") || top_level_arguments(text, &call.inside) != 1 {
            return Err(format!("line {line}: the options of this call are computed; change them there"));
        }
        return Ok(Edit { range: call.inside.end..call.inside.end, text: format!(", #{{ {new} }}") });
    };
    let mut at = map.start;
    while at < map.end {
        at = skip(text, at).min(map.end);
        let length = text[at..map.end].find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(0);
        let colon = skip(text, at + length);
        if length == 0 || colon >= map.end || !text[colon..].starts_with(':') {
            break;
        }
        let end = value_end(text, colon + 1, map.end);
        if &text[at..at + length] == name {
            let value = colon + 1..end;
            return number(text, &value, secs).ok_or_else(|| {
                format!("line {line}: {name}: {} is computed; change it there", text[value].trim())
            });
        }
        at = end + 1;
    }
    let comma = if text[map.clone()].trim().is_empty() { " " } else { ", " };
    let last = map.start + text[map.clone()].trim_end().len();
    let blank = if last == map.end { " " } else { "" };
    Ok(Edit { range: last..last, text: format!("{comma}{new}{blank}") })
}

/// The inside of the `#{ … }` that is the last argument.
fn map_in(text: &str, inside: &Range<usize>) -> Option<Range<usize>> {
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

fn value_end(text: &str, mut at: usize, end: usize) -> usize {
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

fn top_level_arguments(text: &str, inside: &Range<usize>) -> usize {
    let (mut at, mut count) = (inside.start, 0);
    while at < inside.end {
        count += 1;
        at = value_end(text, at, inside.end) + 1;
    }
    count
}

/// To the millisecond, as a person would write it; always with a point, so that it stays a float.
fn seconds(secs: f64) -> String {
    let text = format!("{:.3}", secs.max(0.0));
    let text = text.trim_end_matches('0');
    if text.ends_with('.') { format!("{text}0") } else { text.to_string() }
}

fn byte_at(text: &str, line: usize, column: usize) -> Option<usize> {
    let start: usize = text.split_inclusive('\n').take(line.checked_sub(1)?).map(str::len).sum();
    let rest = text.get(start..).filter(|rest| !rest.is_empty())?;
    let within: usize = rest.chars().take(column.saturating_sub(1)).map(char::len_utf8).sum();
    Some(start + within)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The place is where `|` stands.
    fn set(text: &str, part: Part, secs: f64) -> Result<String, String> {
        let at = text.find('|').unwrap();
        let before = &text[..at];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap().chars().count() + 1;
        let text = text.replacen('|', "", 1);
        set_time(&text, line, column, part, secs).map(|edit| {
            let after = edit.apply(&text);
            // And back again.
            assert_eq!(edit.inverse(&text).apply(&after), text);
            after
        })
    }

    #[test]
    fn the_literal_is_rewritten_and_nothing_else() {
        let text = "// a walk\nada.|play(moves.clip(\"Walk (1)\")) /* from( */ .from( 0.5 ) // why\n    .until(2.0);\n";
        assert_eq!(
            set(text, Part::Start, 0.75).unwrap(),
            "// a walk\nada.play(moves.clip(\"Walk (1)\")) /* from( */ .from( 0.75 ) // why\n    .until(2.0);\n"
        );
        assert!(set(text, Part::End, 3.0).unwrap().ends_with(".until(3.0);\n"));
    }

    #[test]
    fn what_is_not_said_is_added_behind_the_call() {
        assert_eq!(set("a|.play(c);", Part::Start, 1.5).unwrap(), "a.play(c).from(1.5);");
        assert_eq!(set("a.|play(c).on(\"x\");", Part::End, 2.0).unwrap(), "a.play(c).until(2.0).on(\"x\");");
        assert_eq!(set("a.|play(c);", Part::FadeIn, 0.25).unwrap(), "a.play(c, #{ fade: 0.25 });");
        let text = "a.|play(c, #{ speed: 1.2 });";
        assert_eq!(set(text, Part::FadeIn, 0.25).unwrap(), "a.play(c, #{ speed: 1.2, fade: 0.25 });");
        assert_eq!(set("a.|play(c, #{});", Part::FadeIn, 0.5).unwrap(), "a.play(c, #{ fade: 0.5 });");
    }

    #[test]
    fn each_cue_of_a_chain_is_its_own() {
        let text = "a.play(c).until(2.0)\n  .|then(d, #{ trim: [1.0, 2.0], fade: 0.4, speed: f(1) }).until(4.0).then(e).until(5.0);";
        assert!(set(text, Part::End, 4.5).unwrap().contains(".until(2.0)\n"));
        assert!(set(text, Part::End, 4.5).unwrap().contains("}).until(4.5).then(e).until(5.0)"));
        assert!(set(text, Part::FadeIn, 0.6).unwrap().contains("[1.0, 2.0], fade: 0.6, speed: f(1) }"));
        let why = set(text, Part::Start, 1.0).unwrap_err();
        assert_eq!(why, "line 2: it begins where the clip before it ends; change that one's end");
    }

    #[test]
    fn what_is_computed_is_refused_with_its_line() {
        let why = set("let x = 1;\na.|play(c).from(x + 1.0);", Part::Start, 2.0).unwrap_err();
        assert_eq!(why, "line 2: the time in .from(x + 1.0) is computed; change it there");
        assert!(set("a.|play(c).from(f(12));", Part::Start, 2.0).unwrap_err().contains("f(12)"));
        assert!(set("a.|play(c, #{ fade: fast });", Part::FadeIn, 2.0).unwrap_err().contains("fade: fast"));
        assert!(set("a.|play(c, options);", Part::FadeIn, 2.0).unwrap_err().contains("computed"));
        assert!(set("|let x = 1;", Part::Start, 2.0).unwrap_err().contains("no play"));
        assert!(set_time("a", 9, 1, Part::Start, 1.0).is_err());
    }

    #[test]
    fn a_change_finds_its_line_again() {
        let then = "let a = 1;\na.play(c).from(0.5);\n";
        let edit = set_time(then, 2, 3, Part::Start, 0.75).unwrap();
        let after = edit.apply(then);
        let back = edit.inverse(then);
        // The editor has saved something else above it.
        let now = after.replace("let a = 1;", "let a = 1;\nlet b = 2;");
        let carried = back.carried_over(&after, &now).unwrap();
        assert_eq!(carried.apply(&now), "let a = 1;\nlet b = 2;\na.play(c).from(0.5);\n");
        assert_eq!(back.carried_over(&after, "something else"), None);
        assert_eq!(back.carried_over(&after, &format!("{after}{after}")), None, "there are two of it");
    }

    #[test]
    fn no_text_makes_it_panic() {
        let text = "a.play(\"ü(\", #{ x: `}` }).from(1.0) /* /* */ é */ .until('\\'');";
        let ends: Vec<usize> = text.char_indices().map(|(i, _)| i).collect();
        for from in &ends {
            for to in ends.iter().filter(|to| *to >= from) {
                for part in [Part::Start, Part::End, Part::FadeIn] {
                    let _ = set_time(&text[*from..*to], 1, 1, part, 1.0);
                }
            }
        }
    }
}
