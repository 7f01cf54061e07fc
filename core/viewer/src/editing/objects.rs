//! Whole objects: actors, cameras, lights, effects and titles are duplicated or deleted.

use super::EditError;
use crate::app::Viewer;
use crate::geometry::picking;
use crate::state::selection::{Selected, actor};
use choreo_script::Place;
use choreo_session::edit::{delete_object, duplicate_object};
use glam::DVec3;

impl Viewer {
    /// Duplicates an object with the statements about it. The copy of an actor stands next to it, offset by its width, if numbers state its
    /// position, its targets of `.walk_to` or the keys of its position, and it is not attached to another actor.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub fn duplicate_object(&mut self, what: &Selected) -> Result<(), EditError> {
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let (place, siblings) = self.place_of(what).ok_or(EditError::Gone)?;
        let (by, offset) = (self.named_by(what), self.copy_offset(what));
        let (mut name, mut line, mut left, mut stays) = (None, 0, Vec::new(), None);
        self.change(&place, siblings, |text| {
            let made = duplicate_object(text, (place.line, place.column), by, offset)?;
            line = text[..made.edit.range.start].matches('\n').count() + 1;
            (name, left, stays) = (made.name, made.uncopied_lines, made.computed_position_line);
            Ok(made.edit)
        })?;
        let left: Vec<String> = left.iter().map(usize::to_string).collect();
        let lines = if left.len() == 1 { "line" } else { "lines" };
        let lacks = (!left.is_empty()).then(|| {
            format!("the copy lacks the effect of other statements, in {lines} {}", left.join(", "))
        });
        let stays = stays.map(|line| {
            format!("the copy is at the same place as the original: line {line} computes its place")
        });
        let carried = self.attached_to(what).map(|parent| {
            format!("the copy is at the same place as the original: both are attached to {parent}")
        });
        let notes: Vec<String> = lacks.into_iter().chain(stays).chain(carried).collect();
        self.note = (!notes.is_empty()).then(|| notes.join("; "));
        let before = |places: &[Place]| places.iter().filter(|place| place.line <= line).count();
        self.selection = match (what, name) {
            (Selected::Actor(_), Some(name)) => Some(Selected::Actor(name)),
            (Selected::Camera(_), Some(name)) => Some(Selected::Camera(name)),
            (Selected::Light(_), _) => Some(Selected::Light(before(&scene.places.lights))),
            (Selected::Effect(_), _) => Some(Selected::Effect(before(&scene.places.effects))),
            (Selected::Title(_), _) => Some(Selected::Title(before(&scene.places.layers_2d))),
            _ => None,
        };
        Ok(())
    }

    /// Name of the actor that an actor is attached to.
    fn attached_to(&self, what: &Selected) -> Option<String> {
        let Selected::Actor(name) = what else { return None };
        let stage = &self.scene.as_ref()?.stage;
        let parents = &stage.actors[actor(stage, name)?].parents;
        let to = parents.iter().find_map(|parent| parent.to)?;
        Some(stage.actors.get(to.actor)?.name.clone())
    }

    /// Offset of an actor's copy in world space, metres. `None` if it is attached to another actor.
    fn copy_offset(&self, what: &Selected) -> Option<DVec3> {
        let Selected::Actor(name) = what else { return None };
        let stage = &self.scene.as_ref()?.stage;
        let index = actor(stage, name)?;
        let own = &stage.actors[index];
        if !own.parents.is_empty() {
            return None;
        }
        let snapshot = stage.at(self.playhead.time()).ok()?;
        let (low, high) = picking::bounds(&own.asset, snapshot.actors.get(index)?)?;
        Some(DVec3::X * ((high.x - low.x) * 10.0).ceil().max(1.0) / 10.0)
    }

    /// Deletes an actor, a camera, a light, an effect or a title: the statement that creates it, and the statements that are only about it.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub fn delete_object(&mut self, what: &Selected) -> Result<(), EditError> {
        let (place, siblings) = self.place_of(what).ok_or(EditError::Gone)?;
        self.change(&place, siblings, |text| delete_object(text, place.line, place.column))?;
        self.selection = None;
        Ok(())
    }
}
