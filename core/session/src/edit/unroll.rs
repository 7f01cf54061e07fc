//! A loop written out: its body once for each value, so that each of the things that it makes has a line of its own.

use super::scan::Source;
use super::{Edit, EditRefused};
use std::ops::Range;

/// Rounds that are written out at most.
const MOST_ROUNDS: usize = 64;

/// Writes the innermost loop around a place out: `for NAME in [a, b]` or `in 0..3`, with the values in place of the name. Variables of the body
/// get a number, so that they are different ones.
///
/// # Errors
/// Why not, for the user: there is no such loop, or its values or its body do not allow it.
pub fn unroll(text: &str, line: usize, column: usize) -> Result<Edit, EditRefused> {
    let source = Source::new(text);
    let refuse = |why: &str| EditRefused::at(line, why);
    let at = source.byte_at(line, column).ok_or_else(|| refuse("the script has no such line"))?;
    let found = source.loop_around(at).ok_or_else(|| refuse("no loop is around it"))?;
    let values = values(&source, &found.values)
        .ok_or_else(|| refuse("the values of the loop are computed; write it out in the script"))?;
    if values.len() > MOST_ROUNDS {
        return Err(refuse("the loop has too many rounds to be written out"));
    }
    let words = source.words_within(&found.body);
    let is_way_out = |word: &&Range<usize>| matches!(&text[(*word).clone()], "break" | "continue" | "return");
    if words.iter().any(|word| is_way_out(&word)) {
        return Err(refuse("the loop is left in its middle; write it out in the script"));
    }
    let mut made: Vec<&str> = Vec::new();
    for pair in words.windows(2).filter(|pair| &text[pair[0].clone()] == "let") {
        made.push(&text[pair[1].clone()]);
    }
    if made.contains(&found.name) {
        return Err(refuse("its body makes a variable of the loop's name; write it out in the script"));
    }
    let indent = indent_before(text, found.all.start);
    let rounds = values.iter().enumerate().map(|(number, value)| {
        let renamed = |word: &str| match word {
            word if word == found.name => Some(value.to_string()),
            word if made.contains(&word) => Some(format!("{word}_{}", number + 1)),
            _ => None,
        };
        let body = replaced(text, &found.body, &words, &renamed);
        let body = interpolated(&body, &renamed);
        dedented(&body, indent)
    });
    let rounds: Vec<String> = rounds.collect();
    Ok(Edit { range: found.all.clone(), text: rounds.join(&format!("\n{indent}")) })
}

/// The values of a loop as they are written: the items of an array, or the numbers of a range of literals.
fn values(source: &Source, range: &Range<usize>) -> Option<Vec<String>> {
    let inside = source[range.clone()].trim();
    if let Some((from, to)) = inside.split_once("..").filter(|_| !inside.starts_with('[')) {
        let (last, add) = to.strip_prefix('=').map_or((to, 0), |to| (to, 1));
        let (from, to): (i64, i64) = (from.trim().parse().ok()?, last.trim().parse().ok()?);
        return Some((from..to.checked_add(add)?).take(MOST_ROUNDS + 1).map(|n| n.to_string()).collect());
    }
    let start = range.start + source[range.clone()].find('[')?;
    let end = range.start + source[range.clone()].rfind(']')?;
    let is_array =
        source[range.start..start].trim().is_empty() && source[end + 1..range.end].trim().is_empty();
    let (mut at, mut items) = (start + 1, Vec::new());
    while is_array && at < end {
        let to = source.value_end(at, end);
        let item = &source[source.trimmed(&(at..to))];
        if !item.is_empty() {
            items.push(item.to_string());
        }
        at = to + 1;
    }
    (!items.is_empty()).then_some(items)
}

/// A part of a text with some of its words replaced.
fn replaced(
    text: &str,
    part: &Range<usize>,
    words: &[Range<usize>],
    renamed: &dyn Fn(&str) -> Option<String>,
) -> String {
    let (mut out, mut at) = (String::new(), part.start);
    for word in words {
        let before = text[..word.start].trim_end();
        let is_property = before.ends_with('.') && !before.ends_with("..");
        // The name of an option, `at: 1.0`, is none of a variable.
        let is_option = text[word.end..].trim_start().starts_with(':')
            && !text[word.end..].trim_start().starts_with("::");
        if let Some(new) = renamed(&text[word.clone()]).filter(|_| !is_property && !is_option) {
            out += &text[at..word.start];
            out += &new;
            at = word.end;
        }
    }
    out + &text[at..part.end]
}

/// Replaces words within `${…}` of texts between back-ticks.
fn interpolated(text: &str, renamed: &dyn Fn(&str) -> Option<String>) -> String {
    let (mut out, mut rest) = (String::new(), text);
    while let Some(start) = rest.find("${") {
        let end = rest[start..].find('}').map_or(rest.len(), |end| start + end);
        out += &rest[..start + 2];
        let inner = &rest[start + 2..end];
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        let mut at = 0;
        while at < inner.len() {
            let length = inner[at..].find(|c: char| !is_word(c)).unwrap_or(inner.len() - at);
            if length == 0 {
                let c = inner[at..].chars().next().unwrap_or(' ');
                out.push(c);
                at += c.len_utf8();
                continue;
            }
            let word = &inner[at..at + length];
            out += &renamed(word).unwrap_or_else(|| word.to_string());
            at += length;
        }
        rest = &rest[end..];
    }
    out + rest
}

/// The blanks at the beginning of a byte's line.
fn indent_before(text: &str, at: usize) -> &str {
    let line = text[..at].rfind('\n').map_or(0, |end| end + 1);
    let rest = &text[line..];
    &rest[..rest.len() - rest.trim_start_matches([' ', '\t']).len()]
}

/// The body with the loop's indent in place of its own.
fn dedented(body: &str, indent: &str) -> String {
    let lines: Vec<&str> = body.trim_matches(['\n', '\r']).trim_end().lines().collect();
    let blank = |line: &str| line.len() - line.trim_start().len();
    let own = lines.iter().filter(|line| !line.trim().is_empty()).map(|line| blank(line)).min().unwrap_or(0);
    let cut = lines.iter().map(|line| line.get(own.min(blank(line))..).unwrap_or_default().to_string());
    cut.collect::<Vec<_>>().join(&format!("\n{indent}"))
}
