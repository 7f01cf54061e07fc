//! Keys of a property, `.key("position", [[time, value], …])`: the one at a time is changed, or one is added there as the others
//! are written.

use super::Edit;
use super::object::{EditRefused, ScriptObject, euler_degrees, quoted, rotation};
use super::scan::{Call, Source};
use super::times::{EditTime, TimeLiteral};
use super::values::{format_number, is_plain, literals, rewritten};
use glam::{DQuat, DVec3};
use std::ops::Range;

/// A value of a key, to be written as its neighbours are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KeyValue<'v> {
    /// `[x, y, z]`
    Point(DVec3),
    /// Degrees about y, `[x, y, z]` in degrees, or a quaternion.
    Turn(DQuat),
    /// A factor, or one an axis.
    Scale(DVec3),
    /// Source text of the value.
    Text(&'v str),
}

/// One of the keys in the text.
struct Key {
    all: Range<usize>,
    secs: f64,
    /// Its time is written as `f(12)`.
    in_frames: bool,
    value: Range<usize>,
}

impl ScriptObject<'_> {
    /// Changes the key of a property at a time, or adds one.
    ///
    /// # Errors
    /// The keys are computed, or stand elsewhere.
    pub fn set_key(&self, property: &str, when: EditTime, value: KeyValue) -> Result<Edit, EditRefused> {
        let name = quoted(property);
        let is_it = |call: &&Call| {
            self.text[call.name.clone()] == *"key"
                && self.text[call.inside.clone()].trim_start().starts_with(&name)
        };
        let Some(call) = self.calls.iter().rev().find(is_it) else {
            let why = format!(
                "line {}: its {property} has keys that are not written with it; change them there",
                self.line
            );
            return Err(why.into());
        };
        let line = self.line_of(call.name.start);
        let computed = || {
            EditRefused::from(format!(
                "line {line}: its {property} has keys that are computed; change them there"
            ))
        };
        let start = (self.text.value_end(call.inside.start, call.inside.end) + 1).min(call.inside.end);
        let keys = keys_in(&self.text, start..self.text.value_end(start, call.inside.end), when.fps);
        let keys = keys.ok_or_else(computed)?;
        if let Some(key) = keys.iter().find(|key| (key.secs - when.secs).abs() < 0.5 / when.fps) {
            let range = self.text.trimmed(&key.value);
            return over(&self.text, &range, &value).ok_or_else(computed);
        }
        let next = keys.iter().position(|key| key.secs > when.secs).unwrap_or(keys.len());
        let time = when.text(keys.iter().all(|key| key.in_frames));
        let near = near(&self.text, &keys, next, when.secs);
        let key = format!("[{time}, {}]", written_like(&near, &value));
        Ok(inserted(&self.text, &keys, next, &key))
    }
}

/// `None` where anything of them but the values is computed.
fn keys_in(text: &Source, bytes: Range<usize>, fps: f64) -> Option<Vec<Key>> {
    let array = text.trimmed(&bytes);
    let inside = text[array.clone()].strip_prefix('[')?.strip_suffix(']')?;
    let mut keys: Vec<Key> = Vec::new();
    for part in parts(text, array.start + 1, array.start + 1 + inside.len()) {
        let all = text.trimmed(&part);
        let pair = text[all.clone()].strip_prefix('[')?.strip_suffix(']')?;
        let parts: Vec<Range<usize>> = parts(text, all.start + 1, all.start + 1 + pair.len()).collect();
        let [time, value, ..] = parts.as_slice() else { return None };
        let TimeLiteral { number, in_frames, .. } = TimeLiteral::of(text, time)?;
        let secs = if in_frames { number / fps } else { number };
        if keys.last().is_some_and(|before| before.secs >= secs) {
            return None;
        }
        keys.push(Key { all, secs, in_frames, value: value.clone() });
    }
    (!keys.is_empty()).then_some(keys)
}

/// The parts between commas; nothing after a trailing one.
fn parts(text: &Source, start: usize, end: usize) -> impl Iterator<Item = Range<usize>> {
    let mut at = start;
    std::iter::from_fn(move || {
        if text.skip(at) >= end {
            return None;
        }
        let to = text.value_end(at, end);
        let part = at..to;
        at = to + 1;
        Some(part)
    })
}

/// Replaces a value. `None` where that is computed.
fn over(text: &Source, bytes: &Range<usize>, value: &KeyValue) -> Option<Edit> {
    if let KeyValue::Text(new) = value {
        return is_plain(text, bytes).then(|| Edit { range: bytes.clone(), text: new.to_string() });
    }
    let old = literals(text, bytes).filter(|old| !old.is_empty())?;
    let values: Vec<f64> = old.iter().map(|(_, v)| *v).collect();
    let new = numbers_like(&values, value);
    match new.len() == old.len() {
        // The text between the numbers stays.
        true => rewritten(text, &old, &new),
        false => Some(Edit { range: bytes.clone(), text: list(&new) }),
    }
}

/// The numbers that keys have at a time before the key `next`: between its neighbours, as if they were linear; none where those
/// are computed.
fn near(text: &Source, keys: &[Key], next: usize, secs: f64) -> Vec<f64> {
    let of = |key: Option<&Key>| -> Option<(f64, Vec<f64>)> {
        let numbers = literals(text, &key?.value)?;
        Some((key?.secs, numbers.iter().map(|(_, v)| *v).collect()))
    };
    let before = next.checked_sub(1).and_then(|n| of(keys.get(n)));
    match (before, of(keys.get(next))) {
        (Some((from, a)), Some((to, b))) if a.len() == b.len() => {
            let part = (secs - from) / (to - from);
            a.iter().zip(&b).map(|(a, b)| a + (b - a) * part).collect()
        }
        (Some((_, values)), _) | (None, Some((_, values))) => values,
        (None, None) => Vec::new(),
    }
}

fn written_like(near: &[f64], value: &KeyValue) -> String {
    match value {
        KeyValue::Text(new) => new.to_string(),
        _ => list(&numbers_like(near, value)),
    }
}

fn list(values: &[f64]) -> String {
    let all: Vec<String> = values.iter().map(|v| format_number(*v)).collect();
    if let [one] = all.as_slice() { one.clone() } else { format!("[{}]", all.join(", ")) }
}

/// The value with as many numbers as a key near it has, if they can express it; angles as near to its as they can be.
fn numbers_like(near: &[f64], value: &KeyValue) -> Vec<f64> {
    match *value {
        KeyValue::Point(p) => p.to_array().to_vec(),
        KeyValue::Scale(s) if near.len() != 3 && (s - DVec3::splat(s.x)).abs().max_element() < 1e-9 => {
            vec![s.x]
        }
        KeyValue::Scale(s) => s.to_array().to_vec(),
        KeyValue::Turn(q) => match near {
            [x, y, z, w] => {
                let sign = if q.dot(DQuat::from_xyzw(*x, *y, *z, *w)) < 0.0 { -1.0 } else { 1.0 };
                q.to_array().map(|v| v * sign).to_vec()
            }
            [x, y, z] => nearest(q, DVec3::new(*x, *y, *z)).to_array().to_vec(),
            _ if q.x.abs() < 1e-9 && q.z.abs() < 1e-9 => {
                let degrees = 2.0 * libm::atan2(q.y, q.w).to_degrees();
                vec![turns(degrees, near.first().copied().unwrap_or(0.0))]
            }
            _ => nearest(q, DVec3::new(0.0, near.first().copied().unwrap_or(0.0), 0.0)).to_array().to_vec(),
        },
        KeyValue::Text(_) => Vec::new(),
    }
}

/// The same angle, within half a turn of another.
fn turns(degrees: f64, near: f64) -> f64 {
    degrees + 360.0 * libm::round((near - degrees) / 360.0)
}

/// The angles of a rotation that are nearest to others: keys go from angle to angle, not the shortest way.
fn nearest(q: DQuat, near: DVec3) -> DVec3 {
    let one = euler_degrees(q);
    let other = DVec3::new(one.x + 180.0, 180.0 - one.y, one.z + 180.0);
    let all = [one, other].map(|e| DVec3::new(turns(e.x, near.x), turns(e.y, near.y), turns(e.z, near.z)));
    debug_assert!(all.iter().all(|e| rotation(*e).dot(q).abs() > 1.0 - 1e-6));
    if (all[1] - near).length() < (all[0] - near).length() - 1e-6 { all[1] } else { all[0] }
}

/// Inserts a key before the key `next`, or after the last: on its own line if the others are.
fn inserted(text: &str, keys: &[Key], next: usize, key: &str) -> Edit {
    // The separator before a key: a new line with its blanks, or a space.
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
        // After the comment on the last key, which then needs a comma.
        let comma = if rest.trim_start().starts_with(',') { "" } else { "," };
        return Edit { range: at..at + rest.len(), text: format!("{comma}{rest}{gap}{key}") };
    }
    Edit { range: at..at, text: format!(",{gap}{key}") }
}
