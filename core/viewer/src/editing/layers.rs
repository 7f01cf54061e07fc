//! Values of a layer, such as its mask or priority, apply to all clips of a chain. If the user types one for a single clip of several, two edits
//! are offered: take the clip out of the chain, or change the whole chain.

use super::fields::field_change_edit;
use super::{EditError, FieldChange, Step, combine_steps, difference, read_script};
use crate::app::Viewer;
use crate::state::history::{Alternative, Offer};
use crate::state::selection::Selected;
use crate::state::timeline::Bar;
use choreo_session::edit::{
    CueTime, Edit, ScriptObject, delete_cue, has_end, is_layer_call, paste_cue, set_time,
};

impl Viewer {
    /// Offers two edits for a value of a clip's layer: for the clip alone, taken out of its chain, or for the whole chain. Returns the reason why
    /// neither is made at once. `None` if the value concerns this clip alone, or the clip already states it.
    pub(super) fn offer_layer_edit(&mut self, what: &Selected, change: &FieldChange) -> Option<EditError> {
        let (FieldChange::Value(name, ..) | FieldChange::Overwrite(name, ..)) = change else { return None };
        let (place, siblings) = self.place_of(what).filter(|_| is_layer_call(name))?;
        self.check_place(&place, siblings).ok().filter(|()| self.written_value(what, name).is_none())?;
        let (known, path) = (self.displayed_text()?, self.path.clone()?);
        let text = read_script(&path).ok().filter(|text| **text == *known && !self.is_faulty)?;
        let layer = self.layer_bars(what);
        let before = self.previous_in_chain(&layer);
        let first = |at| std::iter::successors(Some(at), |at| before[*at]).last();
        let at = layer.iter().position(|bar| bar.what == *what)?;
        let chain: Vec<usize> = (0..layer.len()).filter(|other| first(*other) == first(at)).collect();
        let labels: Vec<&str> = chain.iter().map(|at| layer[*at].label.as_str()).collect();
        let (last, others) = labels.split_last().filter(|(_, others)| !others.is_empty())?;
        let value = if *name == "on" { "the mask" } else { *name };
        let why =
            format!("{value} is shared by the whole row: {} and {last} would get it", others.join(", "));
        let of_all = &layer[first(at)?].place;
        let all = ScriptObject::at(&text, of_all.line, of_all.column);
        let all = all.and_then(|object| field_change_edit(&object, &text, change)).ok();
        let all = all.map(|edit| (format!("Change all {}", chain.len()), edit));
        let neighbors =
            [before[at], before.iter().position(|before| *before == Some(at))].map(|at| Some(&layer[at?]));
        let alone = self.edit_out_of_chain(&layer[at], neighbors, change, &text);
        let alone = alone.map(|edit| (format!("Take {} out of the chain", layer[at].label), edit));
        let lines = |edit: &Edit| difference::diff_lines(&text, &edit.apply(&text));
        let mut offers = alone.into_iter().chain(all);
        if let Some((label, edit)) = offers.next() {
            let other =
                offers.next().map(|(label, edit)| Alternative { label, difference: lines(&edit), edit });
            let selects = what.actor().map(|name| Selected::Actor(name.to_string()));
            let (why, difference) = (format!("{why}. This would change:"), lines(&edit));
            self.offer =
                Some(Offer { why, label, difference, edit, other, text, selects, ..Offer::default() });
        }
        Some(EditError::refused_at(&place, &why))
    }

    /// The edit that takes a clip out of its chain into a call of its own and changes it there. The previous clip of the chain continues until its
    /// end.
    fn edit_out_of_chain(
        &self,
        bar: &Bar,
        [before, next]: [Option<&Bar>; 2],
        change: &FieldChange,
        text: &str,
    ) -> Option<Edit> {
        let (actor, siblings) = self.place_of(&Selected::Actor(bar.what.actor()?.to_string()))?;
        let [from, until] = [bar.start, bar.draggable_end].map(|time| self.edit_time(time.as_secs()));
        let is_stated = has_end(text, bar.place.line, bar.place.column);
        let mut copied = self.clip_text(bar).ok()?;
        if next.is_some() && !is_stated {
            copied = set_time(&copied, 1, 1, CueTime::End, until).ok()?.apply(&copied);
        }
        let own = ScriptObject::at(&copied, 1, 1).ok()?;
        let copied = field_change_edit(&own, &copied, change).ok()?.apply(&copied);
        let begins = next.map(|next| self.edit_time(next.start.as_secs()));
        let mut steps =
            vec![self.bar_step(bar, move |text, line, column| delete_cue(text, line, column, begins))];
        steps.extend(before.map(|before| match next.is_some() || is_stated {
            true => self.bar_time_step(before, CueTime::End, until.secs),
            false => self.bar_step(before, |text, line, column| {
                Ok(ScriptObject::at(text, line, column)?.remove_values(&["until"]))
            }),
        }));
        // Later positions come first, like in `apply_steps`.
        steps.push(Step::new(actor, siblings, move |text, line, column| {
            paste_cue(text, line, column, &copied, from)
        }));
        steps.sort_by_key(|step| std::cmp::Reverse((step.place.line, step.place.column)));
        combine_steps(&steps, text).ok()
    }
}
