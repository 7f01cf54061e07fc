//! Bars of clips that are moved or deleted as a whole.

use super::EditError;
use crate::app::Viewer;
use crate::state::selection::Selected;
use crate::state::timeline::Bar;
use choreo_motion::Time;
use choreo_session::edit::{CueChange, CueTime, delete_cue, follows, has_end, set_times};

impl Viewer {
    /// Moves a clip to another start, with its end. Where it follows another clip, that one's end moves, too. `ripple`: all later clips of
    /// its layer move by the same time.
    ///
    /// # Errors
    /// Why not, for the user; nothing has changed.
    pub fn move_cue(&mut self, what: &Selected, secs: f64, ripple: bool) -> Result<(), EditError> {
        let layer = self.layer_of(what);
        let at = layer.iter().position(|bar| bar.what == *what).ok_or(EditError::Gone)?;
        let by = Time::from_secs(secs.max(0.0)) - layer[at].start;
        let known = self.known().ok_or(EditError::NothingShown)?;
        let mut changes = Vec::new();
        let mut set = |bar: &Bar, part, time: Time| {
            let time = self.edit_time((time + by).as_secs());
            changes.push(CueChange { line: bar.place.line, column: bar.place.column, part, time });
        };
        let moved = if ripple { &layer[at..] } else { &layer[at..=at] };
        for (number, bar) in moved.iter().enumerate() {
            match (follows(&known, bar.place.line, bar.place.column), number, at) {
                // It begins where the clip before it ends, and that has been moved.
                (true, 1.., _) => {}
                (true, 0, 1..) => set(&layer[at - 1], CueTime::End, layer[at].start),
                _ => set(bar, CueTime::Start, bar.start),
            }
            if has_end(&known, bar.place.line, bar.place.column) {
                set(bar, CueTime::End, bar.until);
            }
        }
        let place = layer[at].place.clone();
        let siblings = moved.iter().map(|bar| self.siblings(bar)).max().unwrap_or(1);
        self.change(&place, siblings, |text| set_times(text, &changes))
    }

    /// Deletes a clip from the script.
    ///
    /// # Errors
    /// Why not, for the user; nothing has changed.
    pub fn delete_cue(&mut self, what: &Selected) -> Result<(), EditError> {
        let layer = self.layer_of(what);
        let at = layer.iter().position(|bar| bar.what == *what).ok_or(EditError::Gone)?;
        let next = layer.get(at + 1).map(|bar| self.edit_time(bar.start.as_secs()));
        let (place, siblings) = (layer[at].place.clone(), self.siblings(&layer[at]));
        self.change(&place, siblings, |text| delete_cue(text, place.line, place.column, next))?;
        self.selection = None;
        Ok(())
    }

    /// The bars of a clip's layer, in order; none for what is no clip.
    fn layer_of(&self, what: &Selected) -> Vec<Bar> {
        let Selected::Cue { actor, layer, .. } = what else { return Vec::new() };
        let is_in = |bar: &&Bar| matches!(&bar.what, Selected::Cue { actor: a, layer: l, .. } if a == actor && l == layer);
        self.timeline.rows.iter().flat_map(|row| &row.bars).filter(is_in).cloned().collect()
    }

    /// How many bars the line of this one makes.
    fn siblings(&self, bar: &Bar) -> usize {
        self.timeline.rows.iter().flat_map(|row| &row.bars).filter(|other| other.place == bar.place).count()
    }
}
