//! Renames actors, cameras, lights and titles everywhere in the script.

use super::{EditError, FieldChange};
use crate::app::Viewer;
use crate::state::selection::Selected;
use crate::state::view::ViewCamera;
use choreo_language_server::variable_uses;
use choreo_script::Place;
use choreo_session::edit::{Edit, EditRefused, NamedBy, ScriptObject};
use choreo_stage::Layer2dContent;
use std::collections::BTreeSet;

impl Viewer {
    /// Name of an object as the user edits it. `None` if it has no name of its own.
    pub(crate) fn name_of(&self, what: &Selected) -> Option<String> {
        match what {
            Selected::Actor(name) | Selected::Camera(name) => Some(name.clone()),
            Selected::Light(index) => Some(self.light_name(*index)),
            Selected::Title(index) => match self.title_words(*index) {
                Some(words) => Some(words),
                None => self.read_selected(what, |object| object.name(NamedBy::Variable)),
            },
            Selected::Cue { .. } | Selected::Effect(_) | Selected::Sky => None,
        }
    }

    /// The words of a title.
    fn title_words(&self, index: usize) -> Option<String> {
        match &self.scene.as_ref()?.stage.layers_2d.get(index)?.content {
            Layer2dContent::Text { words, .. } => Some(words.clone()),
            _ => None,
        }
    }

    /// Syntax in which the script states the name of an object.
    pub(super) fn name_syntax(&self, what: &Selected) -> NamedBy {
        match what {
            Selected::Actor(_) | Selected::Camera(_) => NamedBy::Argument,
            Selected::Light(_) => NamedBy::Option,
            _ => NamedBy::Variable,
        }
    }

    /// Renames an object: the text that states its name, and the variable with the same name with all its uses. For a title, changes the words.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user and the line that caused it; the script does not change.
    pub fn rename(&mut self, what: &Selected, to: &str) -> Result<(), EditError> {
        let to = to.trim();
        if self.name_of(what).as_deref() == Some(to) {
            return Ok(());
        }
        if matches!(what, Selected::Title(index) if self.title_words(*index).is_some()) {
            return self.change_field(what, &FieldChange::TitleText(to.to_string()));
        }
        let by = self.name_syntax(what);
        let (place, siblings) = self.place_of(what).ok_or(EditError::ObjectGone)?;
        self.edit_call(&place, siblings, |text| rename_edit(text, &place, by, to))?;
        self.update_name(what, to);
        Ok(())
    }

    /// Replaces the name in the selection, the views and the toggles of the window.
    fn update_name(&mut self, what: &Selected, to: &str) {
        let new = match what {
            Selected::Actor(name) => {
                let rename = |set: &mut BTreeSet<String>| {
                    if set.remove(name) {
                        set.insert(to.to_string());
                    }
                };
                let toggles = &mut self.toggles;
                [&mut toggles.hidden, &mut toggles.solo, &mut toggles.locked, &mut toggles.collapsed]
                    .into_iter()
                    .for_each(rename);
                let muted = std::mem::take(&mut toggles.muted).into_iter();
                let muted = muted.map(|(of, layer)| (if of == *name { to.to_string() } else { of }, layer));
                toggles.muted = muted.collect();
                let expanded = std::mem::take(&mut toggles.expanded).into_iter();
                let is_of_it = |(of, layer): &(String, Option<usize>)| layer.is_some() && of == name;
                let renamed = expanded.map(|row| if is_of_it(&row) { (to.to_string(), row.1) } else { row });
                toggles.expanded = renamed.collect();
                Selected::Actor(to.to_string())
            }
            Selected::Camera(_) => Selected::Camera(to.to_string()),
            _ => return,
        };
        for view in &mut self.views {
            match (&mut view.camera, what) {
                (ViewCamera::Named(name), Selected::Camera(old)) if name == old => *name = to.to_string(),
                (ViewCamera::Follow { actor, .. }, Selected::Actor(old)) if actor == old => {
                    *actor = to.to_string();
                }
                _ => {}
            }
        }
        if self.selection.as_ref() == Some(what) {
            self.selection = Some(new);
        }
    }
}

fn rename_edit(text: &str, place: &Place, by: NamedBy, to: &str) -> Result<Edit, EditRefused> {
    let renaming = ScriptObject::at(text, place.line, place.column)?.rename(by, to)?;
    let mut changes: Vec<Edit> = renaming.stated.into_iter().collect();
    if let Some((at, name)) = renaming.variable {
        let uses = variable_uses(text, at, &name)
            .map_err(|not| EditRefused { line: not.line, ..EditRefused::from(not.why) })?;
        changes.extend(uses.into_iter().map(|range| Edit { range, text: name.clone() }));
    }
    // Edits go from the end of the text to its start, so that none moves one that is still to be made.
    changes.sort_by_key(|edit| std::cmp::Reverse(edit.range.start));
    let after = changes.iter().fold(text.to_string(), |after, edit| edit.apply(&after));
    Ok(Edit::between(text, &after))
}
