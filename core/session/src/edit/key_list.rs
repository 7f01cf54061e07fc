//! The list of keys of a `.key(…)` in the text, `[[time, value], [time, value, easing or tangents], …]`: parses it, and inserts, removes and moves
//! keys. Comments and whitespace between keys stay; a comment after a key on the same line belongs to that key.

use super::Edit;
use super::key_name::KeyName;
use super::number_style::in_number_style;
use super::scan::{Call, Source};
use super::times::{EditTime, TimeLiteral};
use std::ops::Range;

/// One of the keys in the text.
#[derive(Clone)]
pub(super) struct Key {
    pub all: Range<usize>,
    pub secs: f64,
    pub time: Range<usize>,
    /// The time is written as `f(12)`.
    pub in_frames: bool,
    pub value: Range<usize>,
    /// The easing into the key or the map of its tangents, without whitespace.
    pub shape: Option<Range<usize>>,
}

/// Number of arguments before the list of keys.
pub(super) fn leading_argument_count(property: &str) -> usize {
    KeyName::of(property).leading_argument_count()
}

/// Bytes of each argument of a call.
pub(super) fn arguments(text: &Source, call: &Call) -> Vec<Range<usize>> {
    split_at_commas(text, call.inside.start, call.inside.end).collect()
}

/// Parses a list of keys. `None` if anything but the values is computed.
pub(super) fn keys_in(text: &Source, bytes: Range<usize>, fps: f64) -> Option<Vec<Key>> {
    let array = text.trimmed(&bytes);
    let inside = text[array.clone()].strip_prefix('[')?.strip_suffix(']')?;
    let mut keys: Vec<Key> = Vec::new();
    for part in split_at_commas(text, array.start + 1, array.start + 1 + inside.len()) {
        let all = text.trimmed(&part);
        let pair = text[all.clone()].strip_prefix('[')?.strip_suffix(']')?;
        let parts: Vec<Range<usize>> =
            split_at_commas(text, all.start + 1, all.start + 1 + pair.len()).collect();
        let [time, value, rest @ ..] = parts.as_slice() else { return None };
        let literal = TimeLiteral::of(text, time)?;
        let secs = literal.secs(fps);
        let TimeLiteral { in_frames, range, .. } = literal;
        // Two keys at the same time make the value jump, so only a decreasing time is an error.
        if keys.last().is_some_and(|before| before.secs > secs) {
            return None;
        }
        let shape = rest.first().map(|shape| text.trimmed(shape));
        keys.push(Key { all, secs, time: range, in_frames, value: text.trimmed(value), shape });
    }
    (!keys.is_empty()).then_some(keys)
}

/// Index of the nearest key within half a frame of a time. Of two keys at the same time, an earlier `time` selects the first and any other the
/// second.
pub(super) fn key_at(keys: &[Key], time: EditTime) -> Option<usize> {
    let distance = |index: &usize| (keys[*index].secs - time.secs).abs();
    let near = (0..keys.len()).filter(|index| distance(index) < 0.5 / time.fps);
    let nearest = near.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    let repeated = keys.get(nearest + 1).is_some_and(|next| next.secs == keys[nearest].secs);
    Some(nearest + usize::from(repeated && time.secs >= keys[nearest].secs))
}

/// Splits a list at its commas; a trailing comma adds no empty part.
pub(super) fn split_at_commas(text: &Source, start: usize, end: usize) -> impl Iterator<Item = Range<usize>> {
    let mut at = start;
    std::iter::from_fn(move || {
        if text.next_token_start(at) >= end {
            return None;
        }
        let to = text.value_end(at, end);
        let part = at..to;
        at = to + 1;
        Some(part)
    })
}

/// Removes a key with its comma, and with its line if it has one of its own.
pub(super) fn remove_key(text: &str, keys: &[Key], at: usize) -> Edit {
    let key = &keys[at].all;
    let line = text[..key.start].rfind('\n').map_or(0, |n| n + 1);
    let behind = text[key.end..].find('\n').map_or(text.len(), |n| key.end + n + 1);
    let rest = text[key.end..behind].trim();
    let rest = rest.strip_prefix(',').unwrap_or(rest).trim_start();
    let alone = text[line..key.start].trim().is_empty() && (rest.is_empty() || rest.starts_with("//"));
    let range = match (alone, keys.get(at + 1), at.checked_sub(1)) {
        (true, ..) => line..behind,
        (false, Some(next), _) => key.start..next.all.start,
        (false, None, Some(before)) => keys[before].all.end..key.end,
        (false, None, None) => key.clone(),
    };
    Edit { range, text: String::new() }
}

/// Inserts a key before the key `next`, or after the last; on a line of its own if the other keys are.
pub(super) fn insert_key(text: &str, keys: &[Key], next: usize, key: &str) -> Edit {
    // The separator before a key is a line break with indentation, or a space.
    let before = |at: usize| {
        let line = text[..at].rfind('\n').map_or(0, |n| n + 1);
        let blanks = &text[line..at];
        let alone = line > 0 && blanks.chars().all(char::is_whitespace);
        if alone { format!("\n{blanks}") } else { " ".to_string() }
    };
    if let Some(after) = keys.get(next) {
        let at = after.all.start;
        return Edit { range: at..at, text: format!("{key},{}", before(at)) };
    }
    let last = &keys[keys.len() - 1];
    let at = last.all.end;
    let gap = before(last.all.start);
    let rest = &text[at..text[at..].find('\n').map_or(text.len(), |n| at + n)];
    let has_comment = rest.trim_start().trim_start_matches(',').trim_start().starts_with("//");
    if gap.starts_with('\n') && has_comment {
        // The new key goes after the comment of the last key, which then needs a comma.
        let comma = if rest.trim_start().starts_with(',') { "" } else { "," };
        return Edit { range: at..at + rest.len(), text: format!("{comma}{rest}{gap}{key}") };
    }
    Edit { range: at..at, text: format!(",{gap}{key}") }
}

/// Moves keys to new times (`None`: unchanged) and sorts the list by time.
pub(super) fn retime_keys(text: &str, keys: &[Key], times: &[Option<EditTime>]) -> Edit {
    let secs = |index: &usize| times[*index].map_or(keys[*index].secs, |time| time.secs);
    let mut order: Vec<usize> = (0..keys.len()).collect();
    order.sort_by(|a, b| secs(a).total_cmp(&secs(b)));
    if order.is_sorted() {
        let moved = keys.iter().zip(times).filter_map(|(key, time)| Some((key, (*time)?)));
        let moved =
            moved.map(|(key, time)| Edit::in_old_style(text, key.time.clone(), &time.text(key.in_frames)));
        return Edit::combine(text, moved.collect());
    }
    let tails: Vec<LineEnd> = keys.iter().map(|key| LineEnd::of(text, key)).collect();
    let lines = tails.iter().all(|tail| tail.has_line);
    let (mut out, mut at) = (String::new(), keys[0].all.start);
    for (slot, index) in order.iter().enumerate() {
        let key = &keys[*index];
        out += &text[at..keys[slot].all.start];
        let old = &text[key.time.clone()];
        let time = times[*index].map(|time| in_number_style(old, &time.text(key.in_frames)));
        out += &text[key.all.start..key.time.start];
        out += time.as_deref().unwrap_or(old);
        out += &text[key.time.end..key.all.end];
        at = keys[slot].all.end;
        if lines {
            out += if tails[slot].has_comma { "," } else { "" };
            let comment = &text[tails[*index].comment.clone()];
            out += if comment.is_empty() { "" } else { " " };
            out += comment;
            at = tails[slot].comment.end;
        }
    }
    Edit { range: keys[0].all.start..at, text: out }
}

/// The comma and the comment after a key on its line.
struct LineEnd {
    /// The key begins its line, and only a comma and a comment follow it.
    has_line: bool,
    has_comma: bool,
    /// Bytes of a comment up to the end of the line; empty if there is none.
    comment: Range<usize>,
}

impl LineEnd {
    fn of(text: &str, key: &Key) -> LineEnd {
        let line = text[..key.all.start].rfind('\n').map_or(0, |n| n + 1);
        let begins = line > 0 && text[line..key.all.start].trim().is_empty();
        let end = text[key.all.end..].find('\n').map_or(text.len(), |n| key.all.end + n);
        let rest = &text[key.all.end..end];
        let comment = rest.find("//").map_or(rest.trim_end().len(), |at| at);
        let between = rest[..comment].trim();
        let comment = key.all.end + comment..key.all.end + rest.trim_end().len();
        LineEnd {
            has_line: begins && matches!(between, "" | ","),
            has_comma: between == ",",
            comment: comment.start.min(comment.end)..comment.end,
        }
    }
}
