//! Edits of a script's text at one place, for example when a dragged bar rewrites a number. The rest of the text stays as it is, including comments
//! and whitespace. An edit of a computed value is refused with its line, since the inputs of the calculation are never guessed.

mod additions;
mod casting;
mod chain;
mod constraints;
mod copying;
mod cues;
mod deleting;
mod duplicating;
pub mod expression;
mod indenting;
mod key_easing;
mod key_list;
mod key_name;
mod key_tangents;
mod keys;
#[cfg(test)]
mod marked;
mod number_style;
mod object;
mod object_values;
mod own_asset;
mod parameter_calls;
mod refused;
mod renaming;
mod reordering;
mod scan;
mod strips;
mod times;
mod typed;
mod unroll;
mod values;

use std::ops::Range;

pub use additions::{AddedAt, Addition, SHAPES, Subject, added_lines};
pub use casting::{cast_lines, numbered_name};
pub use copying::{copied_cues, copied_start, copy_cue, paste_cue};
pub use cues::{CueChange, delete_cue, has_end, set_times};
pub use deleting::delete_object;
pub use duplicating::{Duplicate, duplicate_object};
pub use key_name::{are_keys, are_keys_of_cue};
pub use key_tangents::{KeyShape, KeySide};
pub use keys::{KeyValue, WrittenKey, WrittenKeys, copied_keys, euler_degrees_near};
pub use object::{ScriptObject, ScriptText, rotation_of, set_call_time, set_marker};
pub use object_values::NewValueSyntax;
pub use refused::EditRefused;
pub use renaming::{NamedBy, Renaming};
pub use reordering::{RowSide, reorder};
pub use strips::{
    SecondHalf, cues_before, duplicate_cue, is_layer_call, set_disabled, set_number, set_trim, shift_cue,
    shift_keys, split_cue,
};
pub use times::{CueTime, EditTime, follows_previous_cue, set_time};
pub use typed::TypedNumber;
pub use unroll::unroll;
pub use values::{format_as_meant, format_number};

/// Replacement of a range of bytes by a text.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Edit {
    pub range: Range<usize>,
    pub text: String,
}

impl Edit {
    pub fn apply(&self, text: &str) -> String {
        format!("{}{}{}", &text[..self.range.start], self.text, &text[self.range.end..])
    }

    /// The smallest edit that turns one text into another.
    pub fn between(before: &str, after: &str) -> Edit {
        let same = |a: &mut dyn Iterator<Item = (char, char)>| -> usize {
            a.take_while(|(x, y)| x == y).map(|(x, _)| x.len_utf8()).sum()
        };
        let start = same(&mut before.chars().zip(after.chars()));
        let end = same(&mut before[start..].chars().rev().zip(after[start..].chars().rev()));
        Edit { range: start..before.len() - end, text: after[start..after.len() - end].to_string() }
    }

    /// Combines several edits of different places. A single edit stays as it is, even if it rewrites text with the same text; several become the
    /// smallest edit with the same result.
    pub(crate) fn combine(text: &str, mut edits: Vec<Edit>) -> Edit {
        edits.retain(|edit| !edit.range.is_empty() || !edit.text.is_empty());
        edits.sort_by_key(|edit| std::cmp::Reverse(edit.range.start));
        match edits.as_slice() {
            [only] => only.clone(),
            all => Edit::between(text, &all.iter().fold(text.to_string(), |text, edit| edit.apply(&text))),
        }
    }

    /// The edit that undoes this one, given the text before it.
    pub fn inverse(&self, before: &str) -> Edit {
        let range = self.range.start..self.range.start + self.text.len();
        Edit { range, text: before[self.range.clone()].to_string() }
    }

    /// Converts a line of the text after the edit to the line of the text before it, both from 1. An added line maps to the line where the edit
    /// begins.
    pub(crate) fn line_before(&self, before: &str, line: usize) -> usize {
        let after = self.apply(before);
        let at: usize = after.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
        let added = self.range.start + self.text.len();
        let at = match at {
            at if at < self.range.start => at,
            at if at >= added => at - added + self.range.end,
            at => (at - self.range.start).min(self.range.len()) + self.range.start,
        };
        before.bytes().take(at).filter(|byte| *byte == b'\n').count() + 1
    }

    /// The same edit for a text that has since changed elsewhere, found by its line. `then`: the text that the edit was made for. `None` if that
    /// line no longer exists or exists more than once.
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

/// Bytes of the line that holds a byte, without the line break.
fn line_around(text: &str, at: usize) -> Range<usize> {
    let start = text[..at].rfind('\n').map_or(0, |n| n + 1);
    let end = text[at..].find('\n').map_or(text.len(), |n| at + n);
    start..end
}
