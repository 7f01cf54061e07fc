//! Lines that create several objects, for example in a loop. An edit of one object is offered for all of them, or after the loop is unrolled.

use super::{EditError, difference, read_script};
use crate::app::Viewer;
use crate::state::history::{Alternative, Offer};
use crate::state::selection::Selected;
use choreo_script::Place;
use choreo_session::edit::{Edit, EditRefused, ScriptObject, unroll};

/// Label of the button that unrolls a loop.
pub(super) const UNROLL_LABEL: &str = "Write the loop out";

impl Viewer {
    /// Keeps a refused edit of one of several objects of a loop, to be made after the user accepts to unroll the loop. `done`: result of the edit.
    pub(super) fn retry_after_unroll(
        &mut self,
        done: Result<(), EditError>,
        change: impl FnOnce(&mut Viewer) -> Result<(), EditError> + 'static,
    ) -> Result<(), EditError> {
        if matches!(done, Err(EditError::SharedLine { .. })) {
            self.pending_edit_after_unroll = Some((Box::new(move |viewer| viewer.edit(change)), false));
        }
        done
    }

    /// Offers two alternatives for an edit of a shared line: change all its objects, or unroll the loop, or else add a line for one object. Returns
    /// the error. `made`: the edit of the displayed text.
    pub(super) fn offer_shared_edit(
        &mut self,
        error: EditError,
        place: &Place,
        made: Option<Result<Edit, EditRefused>>,
        alone: Option<Edit>,
    ) -> EditError {
        let EditError::SharedLine { objects, .. } = &error else { return error };
        let objects = *objects;
        let (Some(known), Some(path)) = (self.displayed_text(), self.path.clone()) else { return error };
        // Positions refer to the displayed text.
        let Some(text) = read_script(&path).ok().filter(|text| **text == *known && !self.is_faulty) else {
            return error;
        };
        let all = made.and_then(Result::ok).filter(|edit| edit.apply(&text) != *text);
        let unrolled = unroll(&text, place.line, place.column).ok();
        let lines = |edit: &Edit| difference::diff_lines(&text, &edit.apply(&text));
        let line = place.line;
        let offer = |why: String, label: String, edit: Edit, other| Offer {
            why,
            label,
            difference: lines(&edit),
            edit,
            other,
            text: text.clone(),
            ..Offer::default()
        };
        let single_edit = unrolled
            .map(|edit| (UNROLL_LABEL, "With the loop written out, each can be changed alone:", edit))
            .or_else(|| {
                alone.map(|edit| ("Add the line", "An added line would change only this one:", edit))
            });
        let makes = format!("line {line} makes {objects} objects");
        self.offer = match (all, single_edit) {
            (Some(all), single_edit) => {
                let other = single_edit.map(|(label, _, edit)| Alternative {
                    label: label.into(),
                    difference: lines(&edit),
                    edit,
                });
                let why = format!("{makes}. This would change all of them:");
                Some(offer(why, format!("Change all {objects}"), all, other))
            }
            (None, Some((label, about, edit))) => {
                Some(offer(format!("{makes}. {about}"), label.into(), edit, None))
            }
            (None, None) => None,
        };
        error
    }

    /// Offers two edits of an asset that several actors share: for all of them, or for one actor, which gets an asset of its own. Returns the
    /// reason why neither is made at once. `None` if no other actor uses the asset.
    pub(super) fn offer_asset_edit(
        &mut self,
        what: &Selected,
        place: &Place,
        change: impl Fn(&ScriptObject, &str) -> Result<Edit, EditRefused>,
    ) -> Option<EditError> {
        let (known, path, actor) = (self.displayed_text()?, self.path.clone()?, what.actor()?);
        let text = read_script(&path).ok().filter(|text| **text == *known && !self.is_faulty)?;
        let object = ScriptObject::at(&text, place.line, place.column).ok()?;
        let (variable, actors) = object.asset_variable().filter(|(_, actors)| *actors > 1)?;
        let all = change(&object, &text).ok()?;
        let own = object.own_asset(&all).ok()?;
        let lines = |edit: &Edit| difference::diff_lines(&text, &edit.apply(&text));
        let why = format!("{actors} actors share the asset {variable}");
        let (of_own, of_all) = (lines(&own), lines(&all));
        self.offer = Some(Offer {
            why: format!("{why}. {actor} alone would get an asset of its own:"),
            label: format!("Change {actor} alone"),
            difference: of_own,
            edit: own,
            other: Some(Alternative { label: format!("Change all {actors}"), difference: of_all, edit: all }),
            text: text.clone(),
            ..Offer::default()
        });
        Some(EditError::refused_at(place, &why))
    }
}
