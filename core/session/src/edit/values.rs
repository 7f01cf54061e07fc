//! Values in a text: number literals, lists of them, and options of calls.

use super::expression::evaluate_literals;
use super::number_style::in_number_style;
use super::scan::{Call, Source};
use super::times::TimeLiteral;
use super::{Edit, EditRefused};
use std::ops::Range;

/// Decimal places that a person writes.
pub(super) const USUAL_DIGITS: usize = 3;
/// Decimal places with which every time is read back as the same tick.
const MAX_DIGITS: usize = 9;

/// Writes a number as a person would: with 3 decimal places, small ones with 6; always with a decimal point, so that it stays a float.
pub fn format_number(value: f64) -> String {
    let digits = if value != 0.0 && value.abs() < 0.01 { 6 } else { USUAL_DIGITS };
    let text = trimmed(&format!("{value:.digits$}"));
    if text == "-0.0" { "0.0".into() } else { text }
}

/// Writes a number with 3 to 9 decimal places: the fewest whose parsed value `is_meant` accepts.
pub fn format_as_meant(value: f64, is_meant: impl Fn(f64) -> bool) -> String {
    let reads = |text: &String| text.parse::<f64>().is_ok_and(&is_meant);
    let text = (USUAL_DIGITS..MAX_DIGITS).map(|digits| format!("{value:.digits$}")).find(reads);
    trimmed(&text.unwrap_or_else(|| format!("{value:.MAX_DIGITS$}")))
}

/// The digits of a number without trailing zeros, always with a decimal point.
pub(super) fn trimmed(digits: &str) -> String {
    let text = digits.trim_end_matches('0');
    if text.ends_with('.') { format!("{text}0") } else { text.to_string() }
}

/// The literal or the calculation with literals alone at these bytes: its bytes without whitespace, and its value. `None` if it is computed, and
/// for frames, `f(12)`, since the frame rate is not known here.
pub(super) fn parse_literal(text: &str, bytes: &Range<usize>) -> Option<(Range<usize>, f64)> {
    let inside = &text[bytes.clone()];
    let literal = inside.trim();
    let digits = literal.strip_prefix('-').unwrap_or(literal);
    let is_number = digits.starts_with(|c: char| c.is_ascii_digit())
        && digits.chars().all(|c| c.is_ascii_digit() || c == '.' || c == '_');
    let number = is_number.then(|| literal.replace('_', "").parse::<f64>().ok()).flatten();
    let value = number.or_else(|| evaluate_literals(literal))?;
    let start = bytes.start + (inside.len() - inside.trim_start().len());
    Some((start..start + literal.len(), value))
}

/// The numbers of `a, b, c` or `[a, b, c]` with their bytes. `None` if one is not a literal.
pub(super) fn parse_literals(text: &Source, bytes: &Range<usize>) -> Option<Vec<(Range<usize>, f64)>> {
    parse_components(text, bytes).into_iter().map(|(range, number)| Some((range, number?))).collect()
}

/// Bytes of one value of a list, and its number; `None` if it is not a literal.
type Component = (Range<usize>, Option<f64>);

/// Components of `a, b, c` or `[a, b, c]`.
pub(super) fn parse_components(text: &Source, bytes: &Range<usize>) -> Vec<Component> {
    let inside = &text[bytes.clone()];
    let array = inside.trim().strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
    let (mut at, end) = match array {
        Some(array) => {
            let start = bytes.end - inside.trim_start().len() + 1;
            (start, start + array.len())
        }
        None => (bytes.start, bytes.end),
    };
    let mut found = Vec::new();
    while at < end {
        let to = text.value_end(at, end);
        if !text[at..to].trim().is_empty() {
            found.push(match parse_literal(text, &(at..to)) {
                Some((range, number)) => (range, Some(number)),
                None => (text.trimmed(&(at..to)), None),
            });
        }
        at = to + 1;
    }
    found
}

/// Rewrites some literals and keeps the text between them. The edit reaches from the first changed number to the last, including numbers whose
/// digits stay the same.
pub(super) fn rewrite_literals(text: &str, old: &[(Range<usize>, f64)], new: &[f64]) -> Option<Edit> {
    let is_alone = old.len() == 1;
    let part = |((range, old), new): (&(Range<usize>, f64), &f64)| {
        (range.clone(), new_number_text(&text[range.clone()], *old, *new, is_alone))
    };
    replace_parts(text, &old.iter().zip(new).map(part).collect::<Vec<_>>())
}

/// Writes numbers over those in a range. Numbers that do not change stay as they are written, and a calculation with literals alone becomes a
/// number. `None` if the counts differ or a number is computed.
pub(super) fn overwrite_numbers(text: &Source, bytes: &Range<usize>, new: &[f64]) -> Option<Edit> {
    let old = parse_components(text, bytes);
    let (is_alike, is_alone) = (old.len() == new.len(), old.len() == 1);
    let part = |((range, old), new): (Component, &f64)| {
        let written = &text[range.clone()];
        let new = match old {
            Some(old) => new_number_text(written, old, *new, is_alone),
            None => {
                Some(is_calculation(text, &range).then(|| in_number_style(written, &format_number(*new)))?)
            }
        };
        Some((range, new))
    };
    let parts: Option<Vec<_>> = old.into_iter().zip(new).map(part).collect();
    replace_parts(text, &parts.filter(|_| is_alike)?)
}

/// Adds to the numbers in a range. `None` if the counts differ or a number that changes is computed.
pub(super) fn add_to_numbers(text: &Source, bytes: &Range<usize>, by: &[f64]) -> Option<Edit> {
    let old = parse_components(text, bytes);
    let (is_alike, is_alone) = (old.len() == by.len(), old.len() == 1);
    let part = |((range, old), by): (Component, &f64)| match old {
        Some(old) => {
            let new = new_number_text(&text[range.clone()], old, old + by, is_alone);
            Some((range, new))
        }
        None => (format_number(*by) == format_number(0.0)).then_some((range, None)),
    };
    let parts: Option<Vec<_>> = old.into_iter().zip(by).map(part).collect();
    replace_parts(text, &parts.filter(|_| is_alike)?)
}

/// Text of a new number in place of `written`; `written` itself if the digits are the same. `None` if the number did not change. A number that is
/// alone is always written, so that an expression can take its place.
fn new_number_text(written: &str, old: f64, new: f64, is_alone: bool) -> Option<String> {
    /// Rounding error of single precision.
    const TOLERANCE: f64 = 2e-5;
    let digits = format_number(new);
    match format_number(old) == digits {
        true => ((old - new).abs() >= TOLERANCE || is_alone).then(|| written.to_string()),
        false => Some(in_number_style(written, &digits)),
    }
}

/// Replaces the parts that have a new text; the edit reaches from the first of them to the last and keeps the text between them.
fn replace_parts(text: &str, parts: &[(Range<usize>, Option<String>)]) -> Option<Edit> {
    let start = parts.first()?.0.start;
    let mut edit: Option<Edit> = None;
    for (range, new) in parts {
        let Some(new) = new else { continue };
        let edit = edit.get_or_insert_with(|| Edit { range: range.start..range.start, text: String::new() });
        edit.text += &text[edit.range.end..range.start];
        edit.text += new;
        edit.range.end = range.end;
    }
    Some(edit.unwrap_or(Edit { range: start..start, text: String::new() }))
}

/// Whether a value may be overwritten: a number, a time in frames, a calculation with numbers alone, a list of numbers, a string literal, or a map
/// of these.
pub(super) fn is_plain(text: &Source, bytes: &Range<usize>) -> bool {
    let inside = text[bytes.clone()].trim();
    let quoted =
        inside.len() >= 2 && inside.starts_with('"') && inside[1..].find('"') == Some(inside.len() - 2);
    quoted
        || is_calculation(text, bytes)
        || TimeLiteral::of(text, bytes).is_some()
        || parse_literals(text, bytes).is_some_and(|l| !l.is_empty())
        || is_plain_map(text, bytes)
}

/// Whether writing `value` over a list of numbers leaves the computed ones unchanged.
pub(super) fn keeps_computed(text: &Source, bytes: &Range<usize>, value: &str) -> bool {
    let (old, source) = (parse_components(text, bytes), Source::new(value));
    let new = parse_components(&source, &(0..value.len()));
    let stays = |(old, new): (&Component, &Component)| {
        old.1.is_some() || text[old.0.clone()] == value[new.0.clone()] || is_calculation(text, &old.0)
    };
    old.len() > 1 && old.len() == new.len() && old.iter().zip(&new).all(stays)
}

/// Whether these bytes are a calculation with literals alone, `1.0 / 3.0`, which a person typed in place of a number.
pub(super) fn is_calculation(text: &Source, bytes: &Range<usize>) -> bool {
    let is_number = |token: &str| token.trim_start_matches('-').starts_with(|c: char| c.is_ascii_digit());
    let is_part = |token: &str| is_number(token) || matches!(token, "+" | "-" | "*" | "/" | "(" | ")");
    text.tokens_within(bytes).any(is_number) && text.tokens_within(bytes).all(is_part)
}

/// Methods of a cue that are also options of `play` and `then`, or that set how it repeats.
const OPTION_METHODS: [&str; 11] =
    ["fade", "fade_out", "ease", "speed", "trim", "reverse", "weight", "once", "loop", "ping_pong", "hold"];

/// Whether a value that a cue does not state yet is written as a method, not as an option: if the cue has other such methods and no options.
/// Without either it becomes an option, as in the lessons.
pub(super) fn becomes_method(text: &Source, call: &Call, chain: &[Call], name: &str) -> bool {
    // A `fade` method after the option would set the fade-out again.
    let is_fade = |other: &Call| name == "fade_out" && text[other.name.clone()] == *"fade";
    let is_option_method = |other: &Call| OPTION_METHODS.contains(&&text[other.name.clone()]);
    let has_options = text.options_map(&call.inside).is_some();
    chain.iter().any(|other| is_fade(other) || is_option_method(other) && !has_options)
}

fn is_plain_map(text: &Source, bytes: &Range<usize>) -> bool {
    let bytes = text.trimmed(bytes);
    let Some(map) = text.options_map(&bytes).filter(|_| text[bytes].starts_with("#{")) else { return false };
    let mut at = map.start;
    while at < map.end {
        let end = text.value_end(at, map.end);
        let entry = text.trimmed(&(at..end));
        let value = text[entry.clone()].find(':').map(|colon| entry.start + colon + 1..entry.end);
        if !value.is_some_and(|value| is_plain(text, &value)) {
            return entry.is_empty() && end == map.end;
        }
        at = end + 1;
    }
    true
}

/// Sets an option in the map of a call, `#{ name: value }`. `line`: line for messages.
pub(crate) fn set_option(
    text: &Source,
    call: &Call,
    line: usize,
    name: &str,
    value: &str,
) -> Result<Edit, EditRefused> {
    let inside = &text[call.inside.clone()];
    let new = format!("{name}: {value}");
    let Some(map) = text.options_map(&call.inside) else {
        let arguments = if inside.trim().is_empty() { 0 } else { text.count_arguments(&call.inside) };
        // `reach` and `aim` take a joint and a target before the options.
        let usual = if matches!(&text[call.name.clone()], "reach" | "aim") { 2 } else { 1 };
        if inside.contains("#{") || arguments > usual {
            return Err(EditRefused::at(line, "the options of this call are computed; change them there"));
        }
        let comma = if arguments == 0 { "" } else { ", " };
        return Ok(Edit { range: call.inside.end..call.inside.end, text: format!("{comma}#{{ {new} }}") });
    };
    if let Some(bytes) = option_in(text, &map, name) {
        if !is_plain(text, &bytes) && !keeps_computed(text, &bytes, value) {
            let shown = text[bytes].trim();
            return Err(EditRefused::at(line, &format!("{name}: {shown} is computed; change it there")));
        }
        let inside = &text[bytes.clone()];
        let start = bytes.start + (inside.len() - inside.trim_start().len());
        return Ok(Edit::in_old_style(text, start..start + inside.trim().len(), value));
    }
    let comma = if text[map.clone()].trim().is_empty() { " " } else { ", " };
    let last = map.start + text[map.clone()].trim_end().len();
    let blank = if last == map.end { " " } else { "" };
    Ok(Edit { range: last..last, text: format!("{comma}{new}{blank}") })
}

/// Bytes of the value of an option.
pub(crate) fn option_value(text: &Source, call: &Call, name: &str) -> Option<Range<usize>> {
    option_in(text, &text.options_map(&call.inside)?, name)
}

/// All `name: value` of the options of a call.
pub(crate) fn options_of<'a>(text: &'a Source, call: &Call) -> Vec<&'a str> {
    let Some(map) = text.options_map(&call.inside) else { return Vec::new() };
    let (mut at, mut all) = (map.start, Vec::new());
    while at < map.end {
        let end = text.value_end(at, map.end);
        let option = &text[text.trimmed(&(at..end))];
        if !option.is_empty() {
            all.push(option);
        }
        at = end + 1;
    }
    all
}

/// Bytes of one `name: value` of the options of a call.
pub(crate) fn option_of(text: &Source, call: &Call, name: &str) -> Option<Range<usize>> {
    let value = option_value(text, call, name)?;
    let start = text[..value.start].rfind(name)?;
    Some(start..text.trimmed(&value).end)
}

/// Bytes of the value of an option, given the inside of a `#{ … }`.
fn option_in(text: &Source, map: &Range<usize>, name: &str) -> Option<Range<usize>> {
    let mut at = map.start;
    while at < map.end {
        at = text.next_token_start(at).min(map.end);
        let length = text[at..map.end].find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(0);
        let colon = text.next_token_start(at + length);
        if length == 0 || colon >= map.end || !text[colon..].starts_with(':') {
            return None;
        }
        let end = text.value_end(colon + 1, map.end);
        if &text[at..at + length] == name {
            return Some(colon + 1..end);
        }
        at = end + 1;
    }
    None
}
