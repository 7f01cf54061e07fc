//! Keys of a property, `.key("position", [[time, value], …])`: changed, moved, deleted, copied, and added in the style of the other keys. The keys
//! of a morph target or an expression are named `morph:NAME` and `expression:NAME`; keys in a method or an option of a cue are named `.NAME`.

use super::cues::whole_statement;
use super::key_list::{
    Key, arguments, insert_key, key_at, keys_in, leading_argument_count, remove_key, retime_keys,
    split_at_commas,
};
use super::key_name::{JointKey, KeyName, copied_call, is_keyed_method, property_of};
use super::key_tangents::{KeyShape, shape_of};
use super::object::{ScriptObject, euler_degrees, rotation_of};
use super::object_values::NewValueSyntax;
use super::refused::ADD_LINE_LABEL;
use super::scan::{Call, Source};
use super::times::EditTime;
use super::values::{format_number, is_plain, option_of, parse_literals, rewrite_literals};
use super::{Edit, EditRefused};
use glam::{DQuat, DVec3};
use std::ops::Range;

/// Methods that place an object or change the space of its position.
const POSITION_METHODS: [&str; 3] = ["at", "move_by", "attach"];

/// Value of a key, written in the style of its neighbors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KeyValue<'v> {
    /// `[x, y, z]`
    Point(DVec3),
    /// Numbers before and after a change; unchanged ones are not rewritten.
    Numbers { before: &'v [f64], now: &'v [f64] },
    /// Rotation, written as degrees about y, as `[x, y, z]` in degrees, or as a quaternion.
    Turn(DQuat),
    /// Scale, written as one factor or as one per axis.
    Scale(DVec3),
    /// Source text of the value.
    Text(&'v str),
    /// Linear interpolation of the neighboring keys.
    Between,
}

/// The keys of a property, parsed from the script.
#[derive(Clone, Debug, PartialEq)]
pub struct WrittenKeys {
    /// Line of the `.key(…)`, from 1.
    pub line: usize,
    /// Source text of the interpolation or the easing of all keys. `None`: linear.
    pub interpolation: Option<String>,
    pub keys: Vec<WrittenKey>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct WrittenKey {
    pub secs: f64,
    /// Frame number, if the time is written as `f(12)`.
    pub frame: Option<f64>,
    /// Numbers of the value. `None` if it is computed or not numeric.
    pub numbers: Option<Vec<f64>>,
    /// Easing into the key, and its tangents. `None` if they are computed.
    pub shape: Option<KeyShape>,
}

impl ScriptObject<'_> {
    /// Parses the keys of a property.
    ///
    /// # Errors
    /// The keys are computed, or the script does not state them with this object.
    pub fn written_keys(&self, property: &str, fps: f64) -> Result<WrittenKeys, EditRefused> {
        let (call, keys) = self.keys(property, fps)?;
        let interpolation = arguments(&self.text, &call)
            .get(leading_argument_count(property) + 1)
            .map(|interpolation| self.text.trimmed(interpolation));
        let shown = |bytes: &Range<usize>| self.text[bytes.clone()].to_string();
        let written = |key: &Key| WrittenKey {
            secs: key.secs,
            frame: key.in_frames.then(|| libm::round(key.secs * fps)),
            numbers: parse_literals(&self.text, &key.value).map(|all| all.iter().map(|(_, v)| *v).collect()),
            shape: shape_of(&self.text, key),
        };
        let keys = keys.iter().map(written).collect();
        Ok(WrittenKeys {
            line: self.line_of(call.name.start),
            interpolation: interpolation.as_ref().map(shown),
            keys,
        })
    }

    /// Changes the key of a property at a time, or adds one.
    ///
    /// # Errors
    /// The keys are computed, or the script does not state them with this object.
    pub fn set_key(&self, property: &str, when: EditTime, value: KeyValue) -> Result<Edit, EditRefused> {
        let (call, keys) = self.keys(property, when.fps)?;
        if let Some(at) = key_at(&keys, when) {
            if value == KeyValue::Between {
                return Ok(Edit { range: call.end..call.end, text: String::new() });
            }
            let changed = replaced_value(&self.text, &keys[at].value, &value);
            return changed.ok_or_else(|| self.refuse_computed_keys(property, &call));
        }
        let next = keys.iter().position(|key| key.secs > when.secs).unwrap_or(keys.len());
        let time = time_like(&keys, next, when);
        let near = interpolated_neighbors(&self.text, &keys, next, when.secs);
        if near.is_empty() && value == KeyValue::Between {
            return Err(self.refuse_computed_keys(property, &call));
        }
        let key = format!("[{time}, {}]", value_text(&near, &value));
        Ok(insert_key(&self.text, &keys, next, &key))
    }

    /// Adds the first key of a property as a line of its own: `anna.key("position", [[2.0, [0.0, 0.0, 1.0]]]);`. A position that is stated as
    /// numbers, `.at(0.0, 0.0, 1.0)`, is removed, since the keys replace it.
    ///
    /// # Errors
    /// The object has no variable, and other calls follow its chain.
    pub fn add_keys(&self, property: &str, when: EditTime, value: KeyValue) -> Result<Edit, EditRefused> {
        let value = value_text(&[], &value);
        let list = format!("[[{}, {value}]]", when.new_text(&self.text));
        let added = self.add_key_call(KeyName::of(property), &list)?;
        let of_place = |call: &&Call| POSITION_METHODS.contains(&&self.text[call.name.clone()]);
        let mut places = self.calls.iter().filter(of_place);
        match (places.next(), places.next()) {
            (Some(at), None)
                if property == "position"
                    && self.text[at.name.clone()] == *"at"
                    && parse_literals(&self.text, &at.inside).is_some() =>
            {
                let (line, column) = self.place();
                let keyed = added.apply(&self.text);
                let after = ScriptObject::at(&keyed, line, column)?.remove_values(&["at"]).apply(&keyed);
                Ok(Edit::between(&self.text, &after))
            }
            _ => Ok(added),
        }
    }

    /// Moves the key of a property from one time to another, also past other keys.
    ///
    /// # Errors
    /// The keys are computed or stated elsewhere, no key is at `from`, or another key is at `to`.
    pub fn move_key(&self, property: &str, from: EditTime, to: EditTime) -> Result<Edit, EditRefused> {
        self.move_keys(property, &[(from, to)])
    }

    /// Moves keys of a property to other times, also past keys that stay.
    ///
    /// # Errors
    /// The errors are those of [`ScriptObject::move_key`].
    pub fn move_keys(&self, property: &str, moves: &[(EditTime, EditTime)]) -> Result<Edit, EditRefused> {
        let Some((first, _)) = moves.first() else {
            return Err(self.refuse_missing_key(property, self.line));
        };
        let (call, keys) = self.keys(property, first.fps)?;
        let line = self.line_of(call.name.start);
        let mut times = vec![None; keys.len()];
        for (from, to) in moves {
            let at = key_at(&keys, *from).ok_or_else(|| self.refuse_missing_key(property, line))?;
            times[at] = Some(*to);
        }
        let stays = |index: &usize| times[*index].is_none();
        let is_near = |time: EditTime, key: &Key| (key.secs - time.secs).abs() < 0.5 / time.fps;
        let taken = times
            .iter()
            .flatten()
            .any(|to| (0..keys.len()).filter(stays).any(|index| is_near(*to, &keys[index])));
        if taken {
            let shown = KeyName::of(property).display_name();
            return Err(EditRefused::at(line, &format!("its {shown} has a key at that time already")));
        }
        Ok(retime_keys(&self.text, &keys, &times))
    }

    /// Deletes the key of a property at a time. If it is the only key, its `.key(…)` is deleted, too.
    ///
    /// # Errors
    /// The errors are those of [`ScriptObject::move_key`].
    pub fn delete_key(&self, property: &str, at: EditTime) -> Result<Edit, EditRefused> {
        self.delete_keys(property, &[at])
    }

    /// Deletes keys of a property. If no key is left, their `.key(…)` or option is deleted, too.
    ///
    /// # Errors
    /// The errors are those of [`ScriptObject::move_key`].
    pub fn delete_keys(&self, property: &str, at: &[EditTime]) -> Result<Edit, EditRefused> {
        let fps = at.first().map_or(1.0, |time| time.fps);
        let (call, keys) = self.keys(property, fps)?;
        let line = self.line_of(call.name.start);
        let found =
            at.iter().map(|time| key_at(&keys, *time).ok_or_else(|| self.refuse_missing_key(property, line)));
        let mut found: Vec<usize> = found.collect::<Result<_, _>>()?;
        found.sort_unstable();
        found.dedup();
        if found.len() == keys.len() {
            if call.is_option() {
                return Ok(self.remove_values(&[&self.text[call.name]]));
            }
            let joint = self.joint_key(property).and_then(|key| key.of.clone());
            let first = joint.as_ref().unwrap_or(&call);
            let range = whole_statement(&self.text, first, call.end).unwrap_or_else(|| {
                let dot = self.text[..call.name.start].rfind('.').unwrap_or(call.name.start);
                self.text[..dot].trim_end().len()..call.end
            });
            return Ok(Edit { range, text: String::new() });
        }
        let mut after = self.text.to_string();
        for index in found.into_iter().rev() {
            // The start of the call does not move, since only text after it was removed.
            let text = Source::new(&after);
            let (_, keys) = keys_of(&text, call.name.start, property, fps)
                .ok_or_else(|| self.refuse_computed_keys(property, &call))?;
            after = remove_key(&text, &keys, index).apply(&text);
        }
        Ok(Edit::between(&self.text, &after))
    }

    /// Keys of a property as text for the clipboard: `.key("position", [[2.0, [0.0, 0.0, 1.0]]])`.
    ///
    /// # Errors
    /// The errors are those of [`ScriptObject::move_key`].
    pub fn copy_keys(&self, property: &str, at: &[EditTime]) -> Result<String, EditRefused> {
        let fps = at.first().map_or(1.0, |time| time.fps);
        let (call, keys) = self.keys(property, fps)?;
        let line = self.line_of(call.name.start);
        let mut copied: Vec<&Key> = Vec::new();
        for time in at {
            copied.push(&keys[key_at(&keys, *time).ok_or_else(|| self.refuse_missing_key(property, line))?]);
        }
        copied.sort_by_key(|key| key.all.start);
        copied.dedup_by_key(|key| key.all.start);
        let copied: Vec<&str> = copied.iter().map(|key| &self.text[key.all.clone()]).collect();
        // The list is written on one line: each line of the clipboard is one property.
        let copied = copied.join(", ").split_whitespace().collect::<Vec<_>>().join(" ");
        Ok(format!(".{}[{copied}])", KeyName::of(property).call_opening()))
    }

    /// Adds copied keys, shifted by a time. A key that is already at such a time gets the copied value.
    ///
    /// # Errors
    /// The text does not come from [`ScriptObject::copy_keys`], or the keys of the property are computed or stated elsewhere.
    pub fn paste_keys(&self, copied: &str, by: EditTime) -> Result<Edit, EditRefused> {
        let none = || EditRefused::at(self.line, "the clipboard holds no keys");
        let source = Source::new(copied);
        let (call, property) = copied_call(&source).ok_or_else(none)?;
        let (_, pasted) = keys_of(&source, call.name.start, &property, by.fps).ok_or_else(none)?;
        let entries = pasted.iter().map(|key| {
            let when = EditTime { secs: key.secs + by.secs, ..by };
            (when, key.in_frames, &source[key.time.end..key.all.end])
        });
        if self.key_call(&property).is_none() {
            let all: Vec<String> =
                entries.map(|(when, in_frames, rest)| format!("[{}{rest}", when.text(in_frames))).collect();
            return self.add_key_call(KeyName::of(&property), &format!("[{}]", all.join(", ")));
        }
        let (call, _) = self.keys(&property, by.fps)?;
        let mut after = self.text.to_string();
        for (when, _, rest) in entries {
            let text = Source::new(&after);
            let (_, keys) = keys_of(&text, call.name.start, &property, by.fps)
                .ok_or_else(|| self.refuse_computed_keys(&property, &call))?;
            let edit = match key_at(&keys, when) {
                Some(at) => Edit { range: keys[at].time.end..keys[at].all.end, text: rest.to_string() },
                None => {
                    let next = keys.iter().position(|key| key.secs > when.secs).unwrap_or(keys.len());
                    let time = time_like(&keys, next, when);
                    insert_key(&text, &keys, next, &format!("[{time}{rest}"))
                }
            };
            after = edit.apply(&text);
        }
        Ok(Edit::between(&self.text, &after))
    }

    /// Adds to a refusal because of computed keys the line that states all keys of the property anew: `anna.key("position", [[0.0, …], …]);`.
    pub fn offering_all_keys(
        &self,
        refused: EditRefused,
        property: &str,
        keys: &[(EditTime, KeyValue)],
    ) -> EditRefused {
        match refused.is_computed && !keys.is_empty() {
            true => EditRefused {
                alternative: self.all_keys_line(property, keys),
                alternative_label: ADD_LINE_LABEL,
                ..refused
            },
            false => refused,
        }
    }

    /// A line that states all keys of a property anew. `None` if the object has no variable, or the property no keys.
    pub fn all_keys_line(&self, property: &str, keys: &[(EditTime, KeyValue)]) -> Option<Edit> {
        let call = self.key_call(property).filter(|_| !keys.is_empty())?;
        let interpolation = arguments(&self.text, &call)
            .get(leading_argument_count(property) + 1)
            .map(|interpolation| self.text.trimmed(interpolation));
        let interpolation =
            interpolation.map_or(String::new(), |interpolation| format!(", {}", &self.text[interpolation]));
        let all = keys
            .iter()
            .map(|(time, value)| format!("[{}, {}]", time.new_text(&self.text), value_text(&[], value)));
        let all = all.collect::<Vec<_>>().join(", ");
        let line = format!("{}[{all}]{interpolation})", KeyName::of(property).call_opening());
        self.add_line(&line)
    }

    /// Line and column of the `.key(…)` of a property, from 1. Also the number of calls of the script function that it stands in, or 1 outside
    /// functions.
    pub fn key_place(&self, property: &str) -> Option<((usize, usize), usize)> {
        let call = self.key_call(property)?;
        Some((self.text.place_of(call.name.start), self.function_use_count(&call)))
    }

    /// Number of calls of the script function that a call stands in, or 1 outside functions.
    fn function_use_count(&self, call: &Call) -> usize {
        self.calls_in_functions
            .iter()
            .find(|parameter| parameter.call == *call)
            .map_or(1, |parameter| parameter.uses)
    }

    /// Whether the script states keys of a property with this object.
    pub fn has_keys(&self, property: &str) -> bool {
        self.key_call(property).is_some()
    }

    /// The last `.key(…)` of a property: one of the object's own calls, else one in a function that gets the object as an argument, else the option
    /// of a cue.
    pub(super) fn key_call(&self, property: &str) -> Option<Call> {
        let name = KeyName::of(property);
        if let KeyName::Joint { .. } = name {
            return self.joint_key(property).map(|key| key.call.clone());
        }
        let is_it = |call: &&Call| match name {
            KeyName::Method(method) => is_keyed_method(&self.text, call, method),
            _ => {
                self.text[call.name.clone()] == *"key"
                    && property_of(&self.text, call).as_deref() == Some(property)
            }
        };
        let in_functions = self.calls_in_functions.iter().rev().map(|parameter| &parameter.call);
        self.calls.iter().rev().chain(in_functions).find(is_it).cloned().or_else(|| self.keyed_option(name))
    }

    /// The option of a cue that states keys, unless a method of the same name overrides it.
    fn keyed_option(&self, name: KeyName) -> Option<Call> {
        let KeyName::Method(name) = name else { return None };
        let option =
            option_of(&self.text, &self.creating_call, name).filter(|_| self.last_call(&[name]).is_none())?;
        self.text.option_from(option.start).filter(|option| is_keyed_method(&self.text, option, name))
    }

    /// The last `.key(…)` of a joint's property.
    fn joint_key(&self, property: &str) -> Option<&JointKey> {
        let KeyName::Joint { joint, property } = KeyName::of(property) else { return None };
        let is_it = |key: &&JointKey| {
            key.joint == joint && property_of(&self.text, &key.call).as_deref() == Some(property)
        };
        self.joints.iter().rev().find(is_it)
    }

    /// Names of the joints that have keys, as in the script.
    pub fn keyed_joints(&self) -> impl Iterator<Item = &str> {
        self.joints.iter().map(|key| key.joint.as_str())
    }

    /// Adds a call that states a list of keys: to the chain of a cue, else like [`ScriptObject::add_call`]. The list replaces a number that the cue
    /// states.
    fn add_key_call(&self, name: KeyName, list: &str) -> Result<Edit, EditRefused> {
        let call = format!("{}{list})", name.call_opening());
        match name {
            KeyName::Method(method) if self.written(method).is_some() => {
                self.set_value(method, list, NewValueSyntax::Method)
            }
            KeyName::Method(_) if self.variable.is_none() => Ok(self.add_method(&call)),
            _ => self.add_call(&call, None),
        }
    }

    /// The last `.key(…)` of a property, and its parsed keys.
    pub(super) fn keys(&self, property: &str, fps: f64) -> Result<(Call, Vec<Key>), EditRefused> {
        let Some(call) = self.key_call(property) else {
            let shown = KeyName::of(property).display_name();
            let why =
                format!("its {shown} has keys that are written elsewhere in the script; change them there");
            return Err(EditRefused::at(self.line, &why));
        };
        let uses = self.function_use_count(&call);
        if uses > 1 && !self.allows_shared_edits {
            let why = format!("this line makes {uses} objects; change it there");
            return Err(EditRefused::at(self.line_of(call.name.start), &why));
        }
        let keys = keys_of(&self.text, call.name.start, property, fps);
        keys.ok_or_else(|| self.refuse_computed_keys(property, &call))
    }

    pub(super) fn refuse_computed_keys(&self, property: &str, call: &Call) -> EditRefused {
        let line = self.line_of(call.name.start);
        let shown = KeyName::of(property).display_name();
        let why = format!("its {shown} has keys that are computed; change them there");
        EditRefused { is_computed: true, ..EditRefused::at(line, &why) }
    }

    pub(super) fn refuse_missing_key(&self, property: &str, line: usize) -> EditRefused {
        let shown = KeyName::of(property).display_name();
        let why = format!("its {shown} has no key written there; the key shown comes from an easing");
        EditRefused::at(line, &why)
    }
}

/// The property whose keys a copied text holds, and the time of the first key, seconds.
pub fn copied_keys(copied: &str, fps: f64) -> Option<(String, f64)> {
    let source = Source::new(copied);
    let (call, property) = copied_call(&source)?;
    let (_, keys) = keys_of(&source, call.name.start, &property, fps)?;
    Some((property, keys.first()?.secs))
}

/// The `.key(…)` or option at a byte, and its parsed keys. `None` if they are computed.
pub(super) fn keys_of(text: &Source, at: usize, property: &str, fps: f64) -> Option<(Call, Vec<Key>)> {
    let call = text.call_from(at).or_else(|| text.option_from(at))?;
    let list = arguments(text, &call).get(leading_argument_count(property))?.clone();
    Some((call, keys_in(text, list, fps)?))
}

/// Shifts the times of keys `[[time, value], …]`. `None` if a time is computed.
pub(super) fn shifted_keys(text: &Source, bytes: Range<usize>, by: EditTime) -> Option<Edit> {
    let keys = keys_in(text, bytes, by.fps)?;
    let later = |key: &Key| Some(EditTime { secs: key.secs + by.secs, fps: by.fps });
    Some(retime_keys(text, &keys, &keys.iter().map(later).collect::<Vec<_>>()))
}

/// Replaces a value. `None` if it is computed.
fn replaced_value(text: &Source, bytes: &Range<usize>, value: &KeyValue) -> Option<Edit> {
    if let KeyValue::Text(new) = value {
        return is_plain(text, bytes).then(|| Edit::in_old_style(text, bytes.clone(), new));
    }
    if let KeyValue::Numbers { before, now } = value {
        let written = numbers_in(text, bytes);
        if written.len() == now.len() {
            return changed_numbers(text, &written, before, now);
        }
    }
    let old = parse_literals(text, bytes).filter(|old| !old.is_empty())?;
    let values: Vec<f64> = old.iter().map(|(_, v)| *v).collect();
    let new = numbers_like(&values, value);
    match new.len() == old.len() {
        // The text between the numbers stays as it is.
        true => rewrite_literals(text, &old, &new),
        false => Some(Edit::in_old_style(text, bytes.clone(), &list_text(&new))),
    }
}

/// Bytes of each number of a value: of the components of a list, or of the single number.
fn numbers_in(text: &Source, bytes: &Range<usize>) -> Vec<Range<usize>> {
    let value = text.trimmed(bytes);
    match text[value.clone()].strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
        Some(_) => split_at_commas(text, value.start + 1, value.end - 1).collect(),
        None => vec![value],
    }
}

/// Rewrites the numbers that changed. `None` if one of these is computed.
fn changed_numbers(text: &Source, written: &[Range<usize>], before: &[f64], now: &[f64]) -> Option<Edit> {
    /// Rounding error of calculations.
    const TOLERANCE: f64 = 1e-9;
    let (mut old, mut new) = (Vec::new(), Vec::new());
    for (bytes, (before, now)) in written.iter().zip(before.iter().zip(now)) {
        if (before - now).abs() > TOLERANCE {
            old.push((text.trimmed(bytes), *before));
            new.push(*now);
        }
    }
    let are_plain = old.iter().all(|(bytes, _)| is_plain(text, bytes));
    are_plain.then(|| rewrite_literals(text, &old, &new).unwrap_or_default())
}

/// Numbers of a new key before the key `next`: linear interpolation of its neighbors, or those of the only neighbor. Empty if the neighbors are
/// computed.
fn interpolated_neighbors(text: &Source, keys: &[Key], next: usize, secs: f64) -> Vec<f64> {
    let of = |key: Option<&Key>| -> Option<(f64, Vec<f64>)> {
        let numbers = parse_literals(text, &key?.value)?;
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

/// Text of a time for a key before the key `next`, in frames or seconds like the previous key.
fn time_like(keys: &[Key], next: usize, when: EditTime) -> String {
    when.text(keys.get(next.saturating_sub(1)).is_some_and(|key| key.in_frames))
}

fn value_text(near: &[f64], value: &KeyValue) -> String {
    match value {
        KeyValue::Text(new) => new.to_string(),
        _ => list_text(&numbers_like(near, value)),
    }
}

fn list_text(values: &[f64]) -> String {
    let all: Vec<String> = values.iter().map(|v| format_number(*v)).collect();
    if let [one] = all.as_slice() { one.clone() } else { format!("[{}]", all.join(", ")) }
}

/// Numbers of a value in the format of a neighboring key (factor or one per axis, angle, Euler angles or quaternion), if that can express it.
/// Angles are chosen as near to the neighbor's as possible.
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
            [x, y, z] => euler_degrees_near(q, DVec3::new(*x, *y, *z)).to_array().to_vec(),
            _ if q.x.abs() < 1e-9 && q.z.abs() < 1e-9 => {
                let degrees = 2.0 * libm::atan2(q.y, q.w).to_degrees();
                vec![nearest_equivalent_angle(degrees, near.first().copied().unwrap_or(0.0))]
            }
            _ => {
                let upright = DVec3::new(0.0, near.first().copied().unwrap_or(0.0), 0.0);
                euler_degrees_near(q, upright).to_array().to_vec()
            }
        },
        KeyValue::Numbers { now, .. } => now.to_vec(),
        KeyValue::Between => near.to_vec(),
        KeyValue::Text(_) => Vec::new(),
    }
}

/// The equivalent angle within half a turn of `near`, degrees; the greater one at exactly half a turn.
fn nearest_equivalent_angle(degrees: f64, near: f64) -> f64 {
    degrees + 360.0 * libm::floor((near - degrees) / 360.0 + 0.5 + 1e-6)
}

/// Euler angles of a rotation nearest to others, degrees: keys interpolate the angles, not the rotation along the shortest arc.
pub fn euler_degrees_near(q: DQuat, near: DVec3) -> DVec3 {
    let one = euler_degrees(q);
    let other = DVec3::new(one.x + 180.0, 180.0 - one.y, one.z + 180.0);
    let all = [one, other].map(|e| {
        DVec3::new(
            nearest_equivalent_angle(e.x, near.x),
            nearest_equivalent_angle(e.y, near.y),
            nearest_equivalent_angle(e.z, near.z),
        )
    });
    debug_assert!(all.iter().all(|e| rotation_of(*e).dot(q).abs() > 1.0 - 1e-6));
    if (all[1] - near).length() < (all[0] - near).length() - 1e-6 { all[1] } else { all[0] }
}
