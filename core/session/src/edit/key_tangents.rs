//! Tangents of single keys in the text: `[time, value, #{ in_tangent: …, out_tangent: … }]`.

use super::key_list::{Key, key_at, split_at_commas};
use super::key_name::KeyName;
use super::object::ScriptObject;
use super::scan::Source;
use super::times::EditTime;
use super::values::{format_number, parse_literals, rewrite_literals};
use super::{Edit, EditRefused};
use std::ops::Range;

/// Interpolation before and after a key, as the script states it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KeyShape {
    /// Source text of the easing of the span before the key.
    pub ease: Option<String>,
    pub incoming: KeySide,
    pub outgoing: KeySide,
    /// Whether the script states the incoming and the outgoing tangent separately, even if they are equal.
    pub broken: bool,
}

/// Tangent of one side of a key.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KeySide {
    /// Slope of each number, units per second; a single one holds for all numbers.
    pub tangent: Option<Vec<f64>>,
    /// Length of the handle as a fraction of the span; a single one holds for all numbers.
    pub weight: Option<Vec<f64>>,
}

impl KeySide {
    pub fn is_given(&self) -> bool {
        self.tangent.is_some() || self.weight.is_some()
    }
}

impl KeyShape {
    pub fn has_tangents(&self) -> bool {
        self.incoming.is_given() || self.outgoing.is_given()
    }

    /// The incoming side, which is empty if an easing shapes the span.
    fn incoming_side(&self) -> KeySide {
        if self.ease.is_some() { KeySide::default() } else { self.incoming.clone() }
    }

    /// Options of the key with their values, in the order in which they are written.
    fn entries(&self) -> Vec<(&'static str, EntryValue)> {
        let mut all: Vec<(&'static str, EntryValue)> = Vec::new();
        let into = self.incoming_side();
        all.extend(self.ease.clone().map(|ease| ("ease", EntryValue::Text(ease))));
        let mut add = |both: &'static str, ways: [&'static str; 2], sides: [Option<Vec<f64>>; 2]| match sides
        {
            [Some(a), Some(b)] if a == b && !self.broken => all.push((both, EntryValue::Numbers(a))),
            sides => {
                let given = ways.into_iter().zip(sides).filter_map(|(way, side)| Some((way, side?)));
                all.extend(given.map(|(way, side)| (way, EntryValue::Numbers(side))));
            }
        };
        add("tangent", ["in_tangent", "out_tangent"], [into.tangent, self.outgoing.tangent.clone()]);
        add("weight", ["in_weight", "out_weight"], [into.weight, self.outgoing.weight.clone()]);
        all
    }

    /// Text after the value of a key; empty if the key has neither easing nor tangents.
    fn text(&self) -> String {
        if !self.incoming_side().is_given() && !self.outgoing.is_given() {
            return self.ease.as_ref().map_or(String::new(), |ease| format!(", {ease}"));
        }
        let entries: Vec<String> =
            self.entries().iter().map(|(name, entry)| format!("{name}: {}", entry.text())).collect();
        format!(", #{{ {} }}", entries.join(", "))
    }
}

enum EntryValue {
    Numbers(Vec<f64>),
    Text(String),
}

impl EntryValue {
    fn text(&self) -> String {
        match self {
            EntryValue::Text(text) => text.clone(),
            EntryValue::Numbers(all) => match all.as_slice() {
                [first, rest @ ..] if rest.is_empty() || all.iter().all(|n| *n == 0.0) => {
                    format_number(*first)
                }
                _ => {
                    let all: Vec<String> = all.iter().map(|number| format_number(*number)).collect();
                    format!("[{}]", all.join(", "))
                }
            },
        }
    }
}

/// Entries of a map, `#{ name: value, … }`: names and the bytes of their values.
fn map_entries(text: &Source, bytes: &Range<usize>) -> Option<Vec<(String, Range<usize>)>> {
    let inside = text[bytes.clone()].strip_prefix("#{")?.strip_suffix('}')?;
    let start = bytes.start + 2;
    let entry = |part: Range<usize>| {
        let part = text.trimmed(&part);
        let colon = text[part.clone()].find(':')?;
        let name = text[part.start..part.start + colon].trim();
        Some((name.to_string(), text.trimmed(&(part.start + colon + 1..part.end))))
    };
    split_at_commas(text, start, start + inside.len()).map(entry).collect()
}

/// Easing and tangents of a key. `None` if they are computed.
pub(super) fn shape_of(text: &Source, key: &Key) -> Option<KeyShape> {
    let Some(bytes) = &key.shape else { return Some(KeyShape::default()) };
    if !text[bytes.clone()].starts_with("#{") {
        return Some(KeyShape { ease: Some(text[bytes.clone()].to_string()), ..KeyShape::default() });
    }
    let mut shape = KeyShape::default();
    let entries = map_entries(text, bytes)?;
    let numbers = |name: &str| -> Option<Option<Vec<f64>>> {
        let Some((_, value)) = entries.iter().find(|(known, _)| known == name) else { return Some(None) };
        let all = parse_literals(text, value).filter(|all| !all.is_empty())?;
        Some(Some(all.iter().map(|(_, number)| *number).collect()))
    };
    for (side, way) in [(&mut shape.incoming, "in"), (&mut shape.outgoing, "out")] {
        side.tangent = numbers(&format!("{way}_tangent"))?.or(numbers("tangent")?);
        side.weight = numbers(&format!("{way}_weight"))?.or(numbers("weight")?);
    }
    shape.broken = entries.iter().any(|(name, _)| name.ends_with("_tangent"));
    let ease = entries.iter().find(|(name, _)| name == "ease");
    shape.ease = ease.map(|(_, value)| text[value.clone()].to_string());
    if shape.ease.is_some() {
        shape.incoming = KeySide::default();
    }
    Some(shape)
}

/// Replaces the easing and the tangents of a key. If it already has the same options, only the changed values are rewritten.
pub(super) fn replace_shape(text: &Source, key: &Key, shape: &KeyShape) -> Edit {
    let end = key.value.end;
    let Some(bytes) = &key.shape else { return Edit { range: end..end, text: shape.text() } };
    // A comment before the easing is kept if an easing or tangent is written in its place.
    let new = shape.text();
    let whole = match new.strip_prefix(", ") {
        Some(new) => Edit::in_old_style(text, bytes.clone(), new),
        None => Edit { range: end..bytes.end, text: new },
    };
    let (Some(old), new) = (map_entries(text, bytes), shape.entries()) else { return whole };
    let names = |a: &str| old.iter().any(|(name, _)| name == a);
    if old.len() != new.len() || !new.iter().all(|(name, _)| names(name)) {
        return whole;
    }
    let changed = old.iter().filter_map(|(name, value)| {
        let (_, entry) = new.iter().find(|(known, _)| known == name)?;
        let kept = match entry {
            EntryValue::Numbers(new) => {
                let old = parse_literals(text, value).filter(|old| old.len() == new.len());
                old.and_then(|old| rewrite_literals(text, &old, new))
            }
            EntryValue::Text(new) if *new == text[value.clone()] => return None,
            EntryValue::Text(_) => None,
        };
        Some(kept.unwrap_or_else(|| Edit::in_old_style(text, value.clone(), &entry.text())))
    });
    Edit::combine(text, changed.collect())
}

impl ScriptObject<'_> {
    /// Sets tangents and easings of keys of a property.
    ///
    /// # Errors
    /// The keys are computed or stated elsewhere, no key is at that time, or all keys are stepped; then an edit is offered that makes the others
    /// linear.
    pub fn set_key_shapes(
        &self,
        property: &str,
        shapes: &[(EditTime, KeyShape)],
    ) -> Result<Edit, EditRefused> {
        let fps = shapes.first().map_or(1.0, |(at, _)| at.fps);
        let (call, keys) = self.keys(property, fps)?;
        let (line, shown) = (self.line_of(call.name.start), KeyName::of(property).display_name());
        let mut edits = Vec::new();
        for (at, shape) in shapes {
            let index = key_at(&keys, *at).ok_or_else(|| self.refuse_missing_key(property, line))?;
            if shape_of(&self.text, &keys[index]).is_none() {
                return Err(EditRefused::at(
                    line,
                    &format!("a key of its {shown} has tangents that are computed; change them there"),
                ));
            }
            edits.push(replace_shape(&self.text, &keys[index], shape));
        }
        let interpolation = self.interpolation(property, &call);
        let holds = interpolation
            .as_ref()
            .filter(|interpolation| self.text[(*interpolation).clone()] == *"\"step\"")
            .cloned();
        let holds = holds.filter(|_| shapes.iter().any(|(_, shape)| shape.has_tangents()));
        edits.extend(holds.clone().map(|interpolation| self.without_interpolation(interpolation)));
        let edit = Edit::combine(&self.text, edits);
        if holds.is_none() {
            return Ok(edit);
        }
        let why = format!("all keys of its {shown} hold their values; a tangent makes all of them linear");
        let alternative_label = "Make the keys linear";
        Err(EditRefused { alternative: Some(edit), alternative_label, ..EditRefused::at(line, &why) })
    }
}
