//! Whole bars: moved, crossfaded or deleted.

use super::{EditError, Step};
use crate::app::Viewer;
use crate::state::selection::Selected;
use crate::state::timeline::Bar;
use choreo_motion::Time;
use choreo_script::Place;
use choreo_session::edit::{
    CueTime, EditTime, cues_before, delete_cue, follows_previous_cue, has_end, set_number, set_time,
    shift_keys,
};
use std::collections::BTreeSet;

impl Viewer {
    /// Moves a clip to another start, together with its end. If it begins at the end of another clip, that end moves, too. `ripple`: all later
    /// clips of its layer move by the same time.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub fn move_cue(&mut self, what: &Selected, secs: f64, ripple: bool) -> Result<(), EditError> {
        let layer = self.layer_bars(what);
        let at = layer.iter().position(|bar| bar.what == *what).ok_or(EditError::ObjectGone)?;
        let by = secs.max(0.0) - layer[at].start.as_secs();
        self.check_start(&layer[at].place, &layer[at].label, secs)?;
        let steps = self.move_steps(&layer, &|index| index == at || ripple && index > at, by)?;
        let note = self.hidden_bars_note(&layer[at + 1..], by).filter(|_| ripple);
        let note = note.or_else(|| self.moved_end_note(what, std::slice::from_ref(what), by));
        self.apply_steps(steps)?;
        self.note = note;
        Ok(())
    }

    /// Fails if a bar would begin after the end of the scene, where it is never visible.
    pub(super) fn check_start(&self, place: &Place, label: &str, secs: f64) -> Result<(), EditError> {
        let (begins, length) = (Time::from_secs(secs), self.timeline.length);
        if begins < length {
            return Ok(());
        }
        let (begins, ends) = (self.time_text(begins), self.time_text(length));
        let why =
            format!("{label} would begin at {begins}, and the scene ends at {ends}: make the stage longer");
        Err(EditError::refused_at(place, &why))
    }

    /// The clip whose end is the start of a bar.
    pub(super) fn followed_bar(&self, what: &Selected) -> Option<Bar> {
        let layer = self.layer_bars(what);
        let at = layer.iter().position(|bar| bar.what == *what)?;
        let before = self.followed_bars(&layer)[at]?;
        layer.into_iter().nth(before)
    }

    /// Note that the end of the previous clip moves with the start of a bar that begins there. `None` if there is no such clip, or it is one of
    /// `all`, which move, too.
    pub(crate) fn moved_end_note(&self, what: &Selected, all: &[Selected], by: f64) -> Option<String> {
        let before = self.followed_bar(what).filter(|before| !all.contains(&before.what))?;
        let ends = self.time_text(self.find_bar(what).ok()?.start + Time::from_secs(by));
        Some(format!("{}, the clip before it, now ends at {ends}", before.label))
    }

    /// Note about all ends that move with the starts of these bars.
    fn moved_ends_note(&self, all: &[Selected], by: f64) -> Option<String> {
        let ends: Vec<String> = all.iter().filter_map(|what| self.moved_end_note(what, all, by)).collect();
        (!ends.is_empty()).then(|| ends.join("; "))
    }

    /// Note about bars that are no longer visible if they begin later by `by` seconds.
    pub(super) fn hidden_bars_note(&self, later: &[Bar], by: f64) -> Option<String> {
        let length = self.timeline.length;
        let is_out = |bar: &&Bar| bar.start < length && bar.start + Time::from_secs(by) >= length;
        let labels: Vec<&str> = later.iter().filter(is_out).map(|bar| bar.label.as_str()).collect();
        let ends = self.time_text(length);
        let begin = if labels.len() == 1 { "begins" } else { "begin" };
        (!labels.is_empty()).then(|| {
            format!(
                "{} now {begin} after the end of the scene at {ends}: make the stage longer",
                labels.join(", ")
            )
        })
    }

    /// Moves bars by a time in seconds, as one edit.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub fn move_bars(&mut self, all: &[Selected], by: f64) -> Result<(), EditError> {
        let (steps, note) = (self.bar_move_steps(all, by)?, self.moved_ends_note(all, by));
        self.apply_steps(steps)?;
        self.note = note;
        Ok(())
    }

    /// Moves the selected bars and keys by a time in seconds, as one edit.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub(crate) fn move_selected(&mut self, by: f64) -> Result<(), EditError> {
        let (bars, keys) = (self.selected_bars(), self.selected_keys().to_vec());
        let mut steps = self.key_drag_steps(&keys, by, None)?;
        steps.extend(self.bar_move_steps(&bars, by)?);
        let note = self.moved_ends_note(&bars, by);
        self.apply_steps(steps)?;
        self.note = note;
        self.move_key_selection(&keys, by);
        Ok(())
    }

    fn bar_move_steps(&self, all: &[Selected], by: f64) -> Result<Vec<Step<'static>>, EditError> {
        let mut steps = Vec::new();
        let mut layers: BTreeSet<Vec<Selected>> = BTreeSet::new();
        for what in all {
            let bar = self.find_bar(what)?;
            self.check_start(&bar.place, &bar.label, bar.start.as_secs() + by)?;
            if matches!(what, Selected::Cue { .. }) {
                layers.insert(self.layer_bars(what).into_iter().map(|bar| bar.what).collect());
                continue;
            }
            for (part, time) in [(CueTime::Start, bar.start), (CueTime::End, bar.draggable_end)] {
                // A cue without an end stays without one.
                if part == CueTime::Start || time < self.timeline.length {
                    steps.push(self.object_time_step(&bar, part, time.as_secs() + by));
                }
            }
        }
        for layer in layers {
            let layer: Vec<Bar> = layer.iter().map(|what| self.find_bar(what)).collect::<Result<_, _>>()?;
            steps.extend(self.move_steps(&layer, &|index| all.contains(&layer[index].what), by)?);
        }
        Ok(steps)
    }

    /// Steps that move some bars of a layer. `moves`: whether the bar with an index moves.
    pub(super) fn move_steps(
        &self,
        layer: &[Bar],
        moves: &dyn Fn(usize) -> bool,
        by: f64,
    ) -> Result<Vec<Step<'static>>, EditError> {
        let known = self.displayed_text().ok_or(EditError::NothingShown)?;
        let (mut steps, followed) = (Vec::new(), self.followed_bars(layer));
        let shifted_secs = |time: Time| (time.as_secs() + by).max(0.0);
        for (index, bar) in layer.iter().enumerate().filter(|(index, _)| moves(*index)) {
            let (line, column) = (bar.place.line, bar.place.column);
            match followed[index] {
                // The bar begins at the end of the previous clip, which moves, too.
                Some(before) if moves(before) => {}
                Some(before) => {
                    self.check_boundary(
                        Some(&layer[before]),
                        bar,
                        shifted_secs(bar.start).min(bar.start.as_secs()),
                    )?;
                    steps.push(self.bar_time_step(&layer[before], CueTime::End, shifted_secs(bar.start)));
                }
                None => steps.push(self.bar_time_step(bar, CueTime::Start, shifted_secs(bar.start))),
            }
            if has_end(&known, line, column) {
                steps.push(self.bar_time_step(bar, CueTime::End, shifted_secs(bar.draggable_end)));
            }
            if bar.strip.is_some_and(|strip| strip.is_keyed) {
                let by = EditTime { secs: by, ..self.edit_time(0.0) };
                steps.push(self.bar_step(bar, move |text, line, column| shift_keys(text, line, column, by)));
            }
        }
        Ok(steps)
    }

    /// Moves the start of a clip before the end of the previous one, which does not move: they crossfade where they overlap.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub fn overlap_cue(&mut self, what: &Selected, secs: f64) -> Result<(), EditError> {
        let layer = self.layer_bars(what);
        let at = layer.iter().position(|bar| bar.what == *what).ok_or(EditError::ObjectGone)?;
        let before = at.checked_sub(1).map(|before| &layer[before]);
        let overlap = before.map_or(0.0, |before| before.end.as_secs() - secs);
        if !before.is_some_and(|before| overlap > 0.0 && secs > before.start.as_secs()) {
            let why = "the start must be within the previous clip: the clips crossfade where they overlap";
            return Err(EditError::refused_at(&layer[at].place, why));
        }
        // The fade is at most as long as the visible part of the clip.
        let overlap = overlap.min((layer[at].end - layer[at].start).as_secs());
        let bar = &layer[at];
        let by = secs - bar.start.as_secs();
        let mut steps = self.move_steps(&layer, &|index| index == at, by)?;
        steps.push(self.bar_time_step(bar, CueTime::FadeIn, overlap));
        // A fade on an upper layer also sets the fade-out, so the former fade-out is stated.
        let hands_over = layer.get(at + 1).is_some_and(|next| next.start <= bar.end);
        let is_upper = matches!(what, Selected::Cue { layer: 1.., .. });
        if is_upper && !hands_over && self.written_value(what, "fade_out").is_none() {
            let fade_out = bar.fade_out.as_secs();
            steps.push(self.bar_step(bar, move |text, line, column| {
                set_number(text, line, column, "fade_out", fade_out)
            }));
        }
        self.apply_steps(steps)
    }

    /// Deletes the cues of bars from the script, as one edit.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub(crate) fn delete_cues(&mut self, all: &[Selected]) -> Result<(), EditError> {
        let steps = self.cue_delete_steps(all)?;
        self.apply_steps(steps)?;
        self.selection = None;
        Ok(())
    }

    pub(super) fn cue_delete_steps(&self, all: &[Selected]) -> Result<Vec<Step<'static>>, EditError> {
        let mut steps = Vec::new();
        for what in all {
            let layer = self.layer_bars(what);
            let at = layer.iter().position(|bar| bar.what == *what);
            let at = at.ok_or_else(|| {
                EditError::refused(
                    "only clips can be deleted here; delete the line of the object in the script",
                )
            })?;
            let before = self.previous_in_chain(&layer);
            let next = |at| before.iter().position(|before| *before == Some(at));
            let mut later = std::iter::successors(next(at), |at| next(*at)).map(|at| &layer[at]);
            let next = later.find(|bar| !all.contains(&bar.what));
            let next = next.map(|bar| self.edit_time(bar.start.as_secs()));
            steps.push(
                self.bar_step(&layer[at], move |text, line, column| delete_cue(text, line, column, next)),
            );
        }
        Ok(steps)
    }

    /// Deletes a cue from the script.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub fn delete_cue(&mut self, what: &Selected) -> Result<(), EditError> {
        self.delete_cues(std::slice::from_ref(what))
    }

    /// Bars of the layer of a clip, in order. Empty for other objects.
    pub(super) fn layer_bars(&self, what: &Selected) -> Vec<Bar> {
        let Selected::Cue { actor, layer, .. } = what else { return Vec::new() };
        let is_in = |bar: &&Bar| matches!(&bar.what, Selected::Cue { actor: a, layer: l, .. } if a == actor && l == layer);
        self.bars().filter(is_in).cloned().collect()
    }

    /// Index of the bar that precedes each bar in its chain of the script, which may differ from the previous one in the row.
    pub(super) fn previous_in_chain(&self, layer: &[Bar]) -> Vec<Option<usize>> {
        let places: Vec<_> = layer.iter().map(|bar| (bar.place.line, bar.place.column)).collect();
        self.displayed_text().map_or_else(|| vec![None; layer.len()], |text| cues_before(&text, &places))
    }

    /// Index of the bar whose end is the start of each bar of a layer.
    pub(super) fn followed_bars(&self, layer: &[Bar]) -> Vec<Option<usize>> {
        let (before, known) = (self.previous_in_chain(layer), self.displayed_text().unwrap_or_default());
        let begins_there = |bar: &Bar| follows_previous_cue(&known, bar.place.line, bar.place.column);
        let all = before.into_iter().zip(layer);
        all.map(|(before, bar)| before.filter(|_| begins_there(bar))).collect()
    }

    pub(crate) fn bars(&self) -> impl Iterator<Item = &Bar> {
        self.timeline.rows.iter().flat_map(|row| &row.bars)
    }

    pub(super) fn find_bar(&self, what: &Selected) -> Result<Bar, EditError> {
        self.bars().find(|bar| bar.what == *what).cloned().ok_or(EditError::ObjectGone)
    }

    /// A step that edits the call of a bar.
    pub(super) fn bar_step<'m>(
        &self,
        bar: &Bar,
        make: impl Fn(&str, usize, usize) -> Result<choreo_session::edit::Edit, choreo_session::edit::EditRefused>
        + 'm,
    ) -> Step<'m> {
        let siblings = self.bars().filter(|other| other.place == bar.place).count();
        Step::new(bar.place.clone(), siblings, make)
    }

    pub(super) fn bar_time_step(&self, bar: &Bar, part: CueTime, secs: f64) -> Step<'static> {
        let time = self.edit_time(secs);
        self.bar_step(bar, move |text, line, column| set_time(text, line, column, part, time))
    }
}
