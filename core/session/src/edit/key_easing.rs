//! Easings of keys: `[time, value, "in_quad"]` for the span before one key, `.key(…, "smooth")` for all keys of a property.

use super::key_list::{Key, arguments, leading_argument_count};
use super::key_name::KeyName;
use super::key_tangents::{KeyShape, replace_shape, shape_of};
use super::keys::keys_of;
use super::object::ScriptObject;
use super::scan::{Call, Source};
use super::times::EditTime;
use super::{Edit, EditRefused, key_list};
use std::ops::Range;

impl ScriptObject<'_> {
    /// Sets the easing of the span before a key, as source text. `None`: the easing of all keys of the property.
    ///
    /// # Errors
    /// The keys are computed or stated elsewhere, no key is at that time, or the interpolation of all keys does not allow an easing of one key;
    /// then an edit is offered that makes the others linear.
    pub fn set_key_ease(
        &self,
        property: &str,
        at: EditTime,
        ease: Option<&str>,
    ) -> Result<Edit, EditRefused> {
        let (call, keys) = self.keys(property, at.fps)?;
        let line = self.line_of(call.name.start);
        let index = key_list::key_at(&keys, at).ok_or_else(|| self.refuse_missing_key(property, line))?;
        if index == 0 {
            return Err(EditRefused::at(
                line,
                "an easing leads from one key to the next; no key comes before the first",
            ));
        }
        let interpolation = self.interpolation(property, &call);
        let of_all =
            interpolation.as_ref().map_or("\"linear\"", |interpolation| &self.text[interpolation.clone()]);
        let with_ease = |index: usize| replace_easing(&self.text, &keys[index], ease);
        if ease.is_none() || of_all == "\"linear\"" || is_easing(of_all) {
            return Ok(with_ease(index));
        }
        // An easing of one key requires linear keys. "smooth" can also be an easing of one key, so that the other keys keep it.
        let keep = (of_all == "\"smooth\"").then_some("\"smooth\"");
        let others = |other: usize| match shape_of(&self.text, &keys[other]) {
            // A span with tangents keeps them.
            Some(shape) if shape.incoming.is_given() => replace_easing(&self.text, &keys[other], None),
            _ => replace_easing(&self.text, &keys[other], keep),
        };
        let mut edits: Vec<Edit> =
            (1..keys.len()).map(|n| if n == index { with_ease(n) } else { others(n) }).collect();
        edits.extend(interpolation.map(|interpolation| self.without_interpolation(interpolation)));
        let edit = Edit::combine(&self.text, edits);
        if keep.is_some() {
            return Ok(edit);
        }
        let shown = KeyName::of(property).display_name();
        let why =
            format!("all keys of its {shown} are {of_all}; an easing of one key makes the others linear");
        let alternative_label = "Make the others linear";
        Err(EditRefused { alternative: Some(edit), alternative_label, ..EditRefused::at(line, &why) })
    }

    /// Sets the interpolation or the easing of all keys of a property, as source text. `None`: linear.
    ///
    /// # Errors
    /// The keys are computed or stated elsewhere, or have easings or tangents of their own; then an edit is offered that removes these.
    pub fn set_key_interpolation(
        &self,
        property: &str,
        fps: f64,
        interpolation: Option<&str>,
    ) -> Result<Edit, EditRefused> {
        let (call, keys) = self.keys(property, fps)?;
        let old = self.interpolation(property, &call);
        let mut at = call.name.start;
        let edit = match (old, interpolation) {
            (None, Some(interpolation)) if call.is_option() => {
                let (edit, method) = self.option_to_method(&call, interpolation);
                at = method;
                edit
            }
            (Some(old), Some(interpolation)) => Edit::in_old_style(&self.text, old, interpolation),
            (Some(old), None) => self.without_interpolation(old),
            (None, interpolation) => {
                let list = arguments(&self.text, &call)[leading_argument_count(property)].clone();
                let end = self.text.trimmed(&list).end;
                let text = interpolation.map_or(String::new(), |interpolation| format!(", {interpolation}"));
                Edit { range: end..end, text }
            }
        };
        let shapes: Vec<KeyShape> =
            keys.iter().map(|key| shape_of(&self.text, key).unwrap_or_default()).collect();
        let has_eases = shapes.iter().any(|shape| shape.ease.is_some());
        let holds = interpolation == Some("\"step\"") && shapes.iter().any(KeyShape::has_tangents);
        if !holds
            && (!has_eases
                || interpolation
                    .is_none_or(|interpolation| interpolation == "\"linear\"" || is_easing(interpolation)))
        {
            return Ok(edit);
        }
        let mut after = edit.apply(&self.text);
        for index in (0..keys.len()).rev() {
            let text = Source::new(&after);
            if let Some((_, keys)) = keys_of(&text, at, property, fps) {
                let kept = KeyShape { ease: None, ..shapes[index].clone() };
                let kept = if holds { KeyShape::default() } else { kept };
                after = replace_shape(&text, &keys[index], &kept).apply(&text);
            }
        }
        let own = if holds { "tangents" } else { "easings" };
        let shown = KeyName::of(property).display_name();
        let why = format!("keys of its {shown} have {own} of their own, which this would replace");
        let alternative = Some(Edit::between(&self.text, &after));
        let line = self.line_of(call.name.start);
        Err(EditRefused { alternative, alternative_label: "Drop them", ..EditRefused::at(line, &why) })
    }

    /// Rewrites keys in an option of a cue as a method, since only a method can state an interpolation. Also returns the first byte of the method.
    fn option_to_method(&self, option: &Call, interpolation: &str) -> (Edit, usize) {
        let [name, list] = [&option.name, &option.inside].map(|bytes| &self.text[bytes.clone()]);
        let method = format!("{name}({list}, {interpolation})");
        let added = self.add_method(&method);
        let start = added.range.start + added.text.find(&method).unwrap_or_default();
        let with = added.apply(&self.text);
        // Removing the option moves the method, which comes after it.
        let after = self.remove_values(&[name]).apply(&with);
        (Edit::between(&self.text, &after), start + after.len() - with.len())
    }

    /// Bytes of the argument after the list of keys, the interpolation or easing of all.
    pub(super) fn interpolation(&self, property: &str, call: &Call) -> Option<Range<usize>> {
        let interpolation = arguments(&self.text, call).get(leading_argument_count(property) + 1)?.clone();
        Some(self.text.trimmed(&interpolation))
    }

    /// Removes the argument after the list of keys, with its comma.
    pub(super) fn without_interpolation(&self, interpolation: Range<usize>) -> Edit {
        let comma = self.text[..interpolation.start].rfind(',').unwrap_or(interpolation.start);
        Edit { range: comma..interpolation.end, text: String::new() }
    }
}

/// Whether the interpolation of all keys is an easing, which a key may override.
fn is_easing(interpolation: &str) -> bool {
    interpolation.starts_with('[')
        || interpolation.starts_with("\"in_")
        || interpolation.starts_with("\"out_")
}

/// Replaces or removes the easing of the span before a key. An easing replaces an incoming tangent.
fn replace_easing(text: &Source, key: &Key, ease: Option<&str>) -> Edit {
    let start = key.value.end;
    let old = shape_of(text, key).unwrap_or_default();
    if old.has_tangents() {
        return replace_shape(text, key, &KeyShape { ease: ease.map(str::to_string), ..old });
    }
    match (&key.shape, ease) {
        (Some(old), Some(ease)) => Edit::in_old_style(text, old.clone(), ease),
        (Some(old), None) => Edit { range: start..old.end, text: String::new() },
        (None, Some(ease)) => Edit { range: start..start, text: format!(", {ease}") },
        (None, None) => Edit { range: start..start, text: String::new() },
    }
}
