//! Keys of a property, `.key("position", [[time, value], …])`: the one at a time is changed, or one is added there as the others
//! are written.

use super::cues::whole_statement;
use super::object::{ScriptObject, euler_degrees, quoted, rotation};
use super::scan::{Call, Source};
use super::times::{EditTime, TimeLiteral};
use super::values::{format_number, is_plain, literals, rewritten};
use super::{Edit, EditRefused};
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
    time: Range<usize>,
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
        let (call, keys) = self.keys(property, when.fps)?;
        if let Some(key) = keys.iter().find(|key| key.is_at(when)) {
            let range = self.text.trimmed(&key.value);
            let changed = over(&self.text, &range, &value);
            return changed.ok_or_else(|| self.computed_keys(property, &call));
        }
        let next = keys.iter().position(|key| key.secs > when.secs).unwrap_or(keys.len());
        let time = when.text(keys.iter().all(|key| key.in_frames));
        let near = near(&self.text, &keys, next, when.secs);
        let key = format!("[{time}, {}]", written_like(&near, &value));
        Ok(inserted(&self.text, &keys, next, &key))
    }

    /// Keys a property that has no keys yet: `anna.key("position", [[2.0, [0.0, 0.0, 1.0]]]);` as a line of its own.
    ///
    /// # Errors
    /// The object has no name in the script, and something else follows it.
    pub fn add_keys(&self, property: &str, when: EditTime, value: KeyValue) -> Result<Edit, EditRefused> {
        let value = written_like(&[], &value);
        let call = format!("key({}, [[{}, {value}]])", quoted(property), when.text(false));
        self.add_call(&call, self.last_at())
    }

    /// Moves the key of a property from a time to another, also past its neighbours.
    ///
    /// # Errors
    /// The keys are computed or stand elsewhere, there is none at that time, or there is one at the other.
    pub fn move_key(&self, property: &str, from: EditTime, to: EditTime) -> Result<Edit, EditRefused> {
        let (call, keys) = self.keys(property, from.fps)?;
        let line = self.line_of(call.name.start);
        let at = keys.iter().position(|key| key.is_at(from)).ok_or_else(|| self.no_key(property, line))?;
        let others = || keys.iter().enumerate().filter(|(index, _)| *index != at);
        if others().any(|(_, key)| key.is_at(to)) {
            return Err(EditRefused::at(line, &format!("its {property} has a key at that time already")));
        }
        let key = &keys[at];
        let time = to.text(key.in_frames);
        let next = others().find(|(_, key)| key.secs > to.secs).map_or(keys.len(), |(index, _)| index);
        if next == at || next == at + 1 {
            return Ok(Edit { range: key.time.clone(), text: time });
        }
        let (before, behind) = (key.all.start..key.time.start, key.time.end..key.all.end);
        let moved = format!("{}{time}{}", &self.text[before], &self.text[behind]);
        let (add, take) = (inserted(&self.text, &keys, next, &moved), removed(&self.text, &keys, at));
        // The one further behind first, so that it moves no byte of the other.
        let (first, second) = if add.range.start > take.range.start { (add, take) } else { (take, add) };
        let after = second.apply(&first.apply(&self.text));
        Ok(Edit::between(&self.text, &after))
    }

    /// Deletes the key of a property at a time. The only one goes with its `.key(…)`.
    ///
    /// # Errors
    /// The errors are those of [`ScriptObject::move_key`].
    pub fn delete_key(&self, property: &str, at: EditTime) -> Result<Edit, EditRefused> {
        let (call, keys) = self.keys(property, at.fps)?;
        let line = self.line_of(call.name.start);
        let index = keys.iter().position(|key| key.is_at(at)).ok_or_else(|| self.no_key(property, line))?;
        if keys.len() > 1 {
            return Ok(removed(&self.text, &keys, index));
        }
        let range = whole_statement(&self.text, &call, call.end).unwrap_or_else(|| {
            let dot = self.text[..call.name.start].rfind('.').unwrap_or(call.name.start);
            self.text[..dot].trim_end().len()..call.end
        });
        Ok(Edit { range, text: String::new() })
    }

    /// The last `.key(…)` of a property, and its keys.
    fn keys(&self, property: &str, fps: f64) -> Result<(Call, Vec<Key>), EditRefused> {
        let name = quoted(property);
        let is_it = |call: &&Call| {
            self.text[call.name.clone()] == *"key"
                && self.text[call.inside.clone()].trim_start().starts_with(&name)
        };
        let Some(call) = self.calls.iter().rev().find(is_it) else {
            let why = format!("its {property} has keys that are not written with it; change them there");
            return Err(EditRefused::at(self.line, &why));
        };
        let start = (self.text.value_end(call.inside.start, call.inside.end) + 1).min(call.inside.end);
        let keys = keys_in(&self.text, start..self.text.value_end(start, call.inside.end), fps);
        let keys = keys.ok_or_else(|| self.computed_keys(property, call))?;
        Ok((call.clone(), keys))
    }

    fn computed_keys(&self, property: &str, call: &Call) -> EditRefused {
        let line = self.line_of(call.name.start);
        EditRefused::at(line, &format!("its {property} has keys that are computed; change them there"))
    }

    fn no_key(&self, property: &str, line: usize) -> EditRefused {
        let why = format!("its {property} has no key of its own there; what is seen comes from an easing");
        EditRefused::at(line, &why)
    }
}

impl Key {
    /// Whether it is at a time, to half a frame.
    fn is_at(&self, time: EditTime) -> bool {
        (self.secs - time.secs).abs() < 0.5 / time.fps
    }
}

/// Takes a key away with its comma, and with its line if it has one of its own.
fn removed(text: &str, keys: &[Key], at: usize) -> Edit {
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
        let literal = TimeLiteral::of(text, time)?;
        let secs = literal.secs(fps);
        let TimeLiteral { in_frames, range, .. } = literal;
        if keys.last().is_some_and(|before| before.secs >= secs) {
            return None;
        }
        keys.push(Key { all, secs, time: range, in_frames, value: value.clone() });
    }
    (!keys.is_empty()).then_some(keys)
}

/// Keys `[[time, value], …]` at later times. `None` where a time is computed.
pub(super) fn shifted_keys(text: &Source, bytes: Range<usize>, by: EditTime) -> Option<Edit> {
    let keys = keys_in(text, bytes, by.fps)?;
    let (first, last) = (keys.first()?, keys.last()?);
    let (mut out, mut at) = (String::new(), first.time.start);
    for key in &keys {
        out += &text[at..key.time.start];
        out += &EditTime { secs: key.secs + by.secs, fps: by.fps }.text(key.in_frames);
        at = key.time.end;
    }
    Some(Edit { range: first.time.start..last.time.end, text: out })
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
