//! Bars that are moved, faded over each other or deleted as a whole.

use super::{EditError, Step};
use crate::app::Viewer;
use crate::state::selection::Selected;
use crate::state::timeline::Bar;
use choreo_motion::Time;
use choreo_script::Place;
use choreo_session::edit::{
    CueTime, EditTime, cues_before, delete_cue, follows, has_end, set_number, set_time, shift_keys,
};
use std::collections::BTreeSet;

impl Viewer {
    /// Moves a clip to another start, with its end. Where it follows another clip, that one's end moves, too. `ripple`: all later clips of
    /// its layer move by the same time.
    ///
    /// # Errors
    /// Why not, for the user; nothing has changed.
    pub fn move_cue(&mut self, what: &Selected, secs: f64, ripple: bool) -> Result<(), EditError> {
        let layer = self.layer_of(what);
        let at = layer.iter().position(|bar| bar.what == *what).ok_or(EditError::Gone)?;
        let by = secs.max(0.0) - layer[at].start.as_secs();
        self.check_begins(&layer[at].place, &layer[at].label, secs)?;
        let steps = self.move_steps(&layer, &|index| index == at || ripple && index > at, by)?;
        let note = self.pushed_out(&layer[at + 1..], by).filter(|_| ripple);
        let note = note.or_else(|| self.moved_end(what, std::slice::from_ref(what), by));
        self.change_all(steps)?;
        self.note = note;
        Ok(())
    }

    /// Refuses what would begin where the scene is over, and never be seen.
    pub(super) fn check_begins(&self, place: &Place, label: &str, secs: f64) -> Result<(), EditError> {
        let (begins, length) = (Time::from_secs(secs), self.timeline.length);
        if begins < length {
            return Ok(());
        }
        let (begins, ends) = (self.shown_time(begins), self.shown_time(length));
        let why =
            format!("{label} would begin at {begins}, and the scene ends at {ends}: make the stage longer");
        Err(EditError::refused_at(place, &why))
    }

    /// The clip at whose end a bar begins.
    pub(super) fn followed_bar(&self, what: &Selected) -> Option<Bar> {
        let layer = self.layer_of(what);
        let at = layer.iter().position(|bar| bar.what == *what)?;
        let before = self.followed(&layer)[at]?;
        layer.into_iter().nth(before)
    }

    /// The end that moves with the start of a bar which follows another one, in words, where that is none of `all`, which move, too.
    pub(crate) fn moved_end(&self, what: &Selected, all: &[Selected], by: f64) -> Option<String> {
        let before = self.followed_bar(what).filter(|before| !all.contains(&before.what))?;
        let ends = self.shown_time(self.bar(what).ok()?.start + Time::from_secs(by));
        Some(format!("{}, which it follows, now ends at {ends}", before.label))
    }

    /// The ends that move with these bars, in words.
    fn moved_ends(&self, all: &[Selected], by: f64) -> Option<String> {
        let ends: Vec<String> = all.iter().filter_map(|what| self.moved_end(what, all, by)).collect();
        (!ends.is_empty()).then(|| ends.join("; "))
    }

    /// Bars that are no longer seen since they begin later by a time, in words.
    pub(super) fn pushed_out(&self, later: &[Bar], by: f64) -> Option<String> {
        let length = self.timeline.length;
        let is_out = |bar: &&Bar| bar.start < length && bar.start + Time::from_secs(by) >= length;
        let labels: Vec<&str> = later.iter().filter(is_out).map(|bar| bar.label.as_str()).collect();
        let ends = self.shown_time(length);
        let begin = if labels.len() == 1 { "begins" } else { "begin" };
        (!labels.is_empty()).then(|| {
            format!(
                "{} now {begin} after the end of the scene at {ends}: make the stage longer",
                labels.join(", ")
            )
        })
    }

    /// Moves bars by a time, as one change.
    ///
    /// # Errors
    /// Why not, for the user; nothing has changed.
    pub fn move_bars(&mut self, all: &[Selected], by: f64) -> Result<(), EditError> {
        let (steps, note) = (self.bar_move_steps(all, by)?, self.moved_ends(all, by));
        self.change_all(steps)?;
        self.note = note;
        Ok(())
    }

    /// Moves the selected bars and keys by a time, as one change.
    ///
    /// # Errors
    /// Why not, for the user; nothing has changed.
    pub(crate) fn move_selected(&mut self, by: f64) -> Result<(), EditError> {
        let (bars, keys) = (self.selected_bars(), self.selected_keys().to_vec());
        let mut steps = self.key_drag_steps(&keys, by, None)?;
        steps.extend(self.bar_move_steps(&bars, by)?);
        let note = self.moved_ends(&bars, by);
        self.change_all(steps)?;
        self.note = note;
        self.keys_have_moved(&keys, by);
        Ok(())
    }

    fn bar_move_steps(&self, all: &[Selected], by: f64) -> Result<Vec<Step<'static>>, EditError> {
        let mut steps = Vec::new();
        let mut layers: BTreeSet<Vec<Selected>> = BTreeSet::new();
        for what in all {
            let bar = self.bar(what)?;
            self.check_begins(&bar.place, &bar.label, bar.start.as_secs() + by)?;
            if matches!(what, Selected::Cue { .. }) {
                layers.insert(self.layer_of(what).into_iter().map(|bar| bar.what).collect());
                continue;
            }
            for (part, time) in [(CueTime::Start, bar.start), (CueTime::End, bar.until)] {
                // A cue that never ends keeps no end.
                if part == CueTime::Start || time < self.timeline.length {
                    steps.push(self.object_time_step(&bar, part, time.as_secs() + by));
                }
            }
        }
        for layer in layers {
            let layer: Vec<Bar> = layer.iter().map(|what| self.bar(what)).collect::<Result<_, _>>()?;
            steps.extend(self.move_steps(&layer, &|index| all.contains(&layer[index].what), by)?);
        }
        Ok(steps)
    }

    /// The changes that move some bars of a layer.
    pub(super) fn move_steps(
        &self,
        layer: &[Bar],
        moves: &dyn Fn(usize) -> bool,
        by: f64,
    ) -> Result<Vec<Step<'static>>, EditError> {
        let known = self.known().ok_or(EditError::NothingShown)?;
        let (mut steps, followed) = (Vec::new(), self.followed(layer));
        let later = |time: Time| (time.as_secs() + by).max(0.0);
        for (index, bar) in layer.iter().enumerate().filter(|(index, _)| moves(*index)) {
            let (line, column) = (bar.place.line, bar.place.column);
            match followed[index] {
                // It begins where the clip before it ends, and that has been moved.
                Some(before) if moves(before) => {}
                Some(before) => {
                    self.check_boundary(
                        Some(&layer[before]),
                        bar,
                        later(bar.start).min(bar.start.as_secs()),
                    )?;
                    steps.push(self.time_step(&layer[before], CueTime::End, later(bar.start)));
                }
                None => steps.push(self.time_step(bar, CueTime::Start, later(bar.start))),
            }
            if has_end(&known, line, column) {
                steps.push(self.time_step(bar, CueTime::End, later(bar.until)));
            }
            if bar.strip.is_some_and(|strip| strip.is_keyed) {
                let by = EditTime { secs: by, ..self.edit_time(0.0) };
                steps.push(self.step(bar, move |text, line, column| shift_keys(text, line, column, by)));
            }
        }
        Ok(steps)
    }

    /// Moves a clip over the one before it, which keeps its place: they crossfade where they overlap.
    ///
    /// # Errors
    /// Why not, for the user; nothing has changed.
    pub fn overlap_cue(&mut self, what: &Selected, secs: f64) -> Result<(), EditError> {
        let layer = self.layer_of(what);
        let at = layer.iter().position(|bar| bar.what == *what).ok_or(EditError::Gone)?;
        let before = at.checked_sub(1).map(|before| &layer[before]);
        let overlap = before.map_or(0.0, |before| before.end.as_secs() - secs);
        if !before.is_some_and(|before| overlap > 0.0 && secs > before.start.as_secs()) {
            let why = "it crossfades where it lies over the end of the clip before it";
            return Err(EditError::refused_at(&layer[at].place, why));
        }
        // A fade no longer than what is there of the clip.
        let overlap = overlap.min((layer[at].end - layer[at].start).as_secs());
        let bar = &layer[at];
        let by = secs - bar.start.as_secs();
        let mut steps = self.move_steps(&layer, &|index| index == at, by)?;
        steps.push(self.time_step(bar, CueTime::FadeIn, overlap));
        // On an upper layer a fade is that of both ends: the far one stays as it was.
        let hands_over = layer.get(at + 1).is_some_and(|next| next.start <= bar.end);
        let is_upper = matches!(what, Selected::Cue { layer: 1.., .. });
        if is_upper && !hands_over && self.written(what, "fade_out").is_none() {
            let fade_out = bar.fade_out.as_secs();
            steps.push(
                self.step(bar, move |text, line, column| {
                    set_number(text, line, column, "fade_out", fade_out)
                }),
            );
        }
        self.change_all(steps)
    }

    /// Deletes bars from the script, as one change.
    ///
    /// # Errors
    /// Why not, for the user; nothing has changed.
    pub(crate) fn delete_cues(&mut self, all: &[Selected]) -> Result<(), EditError> {
        let steps = self.cue_delete_steps(all)?;
        self.change_all(steps)?;
        self.selection = None;
        Ok(())
    }

    pub(super) fn cue_delete_steps(&self, all: &[Selected]) -> Result<Vec<Step<'static>>, EditError> {
        let mut steps = Vec::new();
        for what in all {
            let layer = self.layer_of(what);
            let at = layer.iter().position(|bar| bar.what == *what);
            let at = at.ok_or_else(|| EditError::refused("only clips are deleted here; delete its line"))?;
            let before = self.cues_before(&layer);
            let next = |at| before.iter().position(|before| *before == Some(at));
            let mut later = std::iter::successors(next(at), |at| next(*at)).map(|at| &layer[at]);
            let next = later.find(|bar| !all.contains(&bar.what));
            let next = next.map(|bar| self.edit_time(bar.start.as_secs()));
            steps.push(self.step(&layer[at], move |text, line, column| delete_cue(text, line, column, next)));
        }
        Ok(steps)
    }

    /// Deletes a clip from the script.
    ///
    /// # Errors
    /// Why not, for the user; nothing has changed.
    pub fn delete_cue(&mut self, what: &Selected) -> Result<(), EditError> {
        self.delete_cues(std::slice::from_ref(what))
    }

    /// The bars of a clip's layer, in order; none for what is no clip.
    pub(super) fn layer_of(&self, what: &Selected) -> Vec<Bar> {
        let Selected::Cue { actor, layer, .. } = what else { return Vec::new() };
        let is_in = |bar: &&Bar| matches!(&bar.what, Selected::Cue { actor: a, layer: l, .. } if a == actor && l == layer);
        self.bars().filter(is_in).cloned().collect()
    }

    /// Number of the bar before each one of a layer in its chain of the script, which need not be the one before it in the row.
    pub(super) fn cues_before(&self, layer: &[Bar]) -> Vec<Option<usize>> {
        let places: Vec<_> = layer.iter().map(|bar| (bar.place.line, bar.place.column)).collect();
        self.known().map_or_else(|| vec![None; layer.len()], |text| cues_before(&text, &places))
    }

    /// Number of the bar at whose end each one of a layer begins.
    pub(super) fn followed(&self, layer: &[Bar]) -> Vec<Option<usize>> {
        let (before, known) = (self.cues_before(layer), self.known().unwrap_or_default());
        let begins_there = |bar: &Bar| follows(&known, bar.place.line, bar.place.column);
        let all = before.into_iter().zip(layer);
        all.map(|(before, bar)| before.filter(|_| begins_there(bar))).collect()
    }

    pub(crate) fn bars(&self) -> impl Iterator<Item = &Bar> {
        self.timeline.rows.iter().flat_map(|row| &row.bars)
    }

    pub(super) fn bar(&self, what: &Selected) -> Result<Bar, EditError> {
        self.bars().find(|bar| bar.what == *what).cloned().ok_or(EditError::Gone)
    }

    /// A change of what a bar's place makes.
    pub(super) fn step<'m>(
        &self,
        bar: &Bar,
        make: impl Fn(&str, usize, usize) -> Result<choreo_session::edit::Edit, choreo_session::edit::EditRefused>
        + 'm,
    ) -> Step<'m> {
        let siblings = self.bars().filter(|other| other.place == bar.place).count();
        Step::new(bar.place.clone(), siblings, make)
    }

    pub(super) fn time_step(&self, bar: &Bar, part: CueTime, secs: f64) -> Step<'static> {
        let time = self.edit_time(secs);
        self.step(bar, move |text, line, column| set_time(text, line, column, part, time))
    }
}
