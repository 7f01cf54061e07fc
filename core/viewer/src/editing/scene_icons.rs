//! Places that are dragged in a viewport, other than those of actors.

use super::EditError;
use super::placing::ScriptCamera;
use crate::app::Viewer;
use crate::geometry::picking;
use crate::state::dragged_icon::{DraggedIcon, IconOf};
use crate::state::selection::actor;
use choreo_asset::LightKind;
use choreo_motion::Time;
use choreo_session::Placed;
use choreo_session::edit::{KeyValue, ScriptObject};
use choreo_stage::{ConstraintKind, Property, Stage, Target};
use glam::DVec3;

impl Viewer {
    /// The place that a icon which is dragged gives to what it stands for.
    pub(crate) fn place_of_icon(
        &self,
        stage: &Stage,
        DraggedIcon { what, to, .. }: &DraggedIcon,
    ) -> Option<Placed> {
        let to = *to;
        Some(match what {
            IconOf::Light(light) => match stage.lights.get(*light)?.light.kind {
                LightKind::Directional => {
                    Placed::Sun { light: *light, direction: self.direction_from(to).as_vec3() }
                }
                LightKind::Point | LightKind::Spot { .. } => Placed::Light { light: *light, to },
            },
            IconOf::Camera(name) => {
                Placed::Camera { camera: stage.cameras.iter().position(|camera| camera.name == *name)?, to }
            }
            IconOf::Reach(name, constraint) => {
                Placed::Target { actor: actor(stage, name)?, constraint: *constraint, to }
            }
        })
    }

    /// The direction in which a sun shines whose icon stands at a place.
    pub(crate) fn direction_from(&self, at: DVec3) -> DVec3 {
        (self.sunlit() - at).normalize_or(DVec3::NEG_Y)
    }

    /// The place on which the icons of suns shine: the middle of the actors at the start of the scene, so that the icons stand still
    /// while actors move.
    pub(crate) fn sunlit(&self) -> DVec3 {
        let find = || {
            let scene = self.scene.as_ref()?;
            picking::middle_of_all(&scene.stage, &scene.evaluator.clone().at(Time::ZERO).ok()?)
        };
        let place = self.sunlit.get().or_else(find).unwrap_or(DVec3::ZERO);
        self.sunlit.set(Some(place));
        place
    }

    /// Lets a camera stand elsewhere: `.at`, or its key at the playhead. It goes on looking at what it looked at.
    ///
    /// # Errors
    /// Fails as [`Viewer::change_actor`] does.
    pub(crate) fn move_camera(&mut self, name: &str, at: DVec3) -> Result<(), EditError> {
        let ScriptCamera { camera, place, siblings } = self.camera_that_stands(name)?;
        let keyed = camera.channels.iter().any(|c| c.property == Property::Translation);
        let when = self.edit_time(self.playhead.time().as_secs());
        self.change(&place, siblings, |text| {
            let object = ScriptObject::at(text, place.line, place.column)?;
            match keyed {
                true => object.set_key("position", when, KeyValue::Point(at)),
                false => object.set("at", &at.to_array()),
            }
        })
    }

    /// Lets a hand or foot reach for another point, which stands in the script as numbers. `constraint`: by number, of the actor.
    ///
    /// # Errors
    /// Fails as [`Viewer::change_actor`] does.
    pub(crate) fn move_target(&mut self, name: &str, constraint: usize, to: DVec3) -> Result<(), EditError> {
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let index = actor(&scene.stage, name).ok_or(EditError::Gone)?;
        let constraint = scene.stage.actors[index].constraints.get(constraint).ok_or(EditError::Gone)?;
        let ConstraintKind::Reach(reach) = &constraint.kind else { return Err(EditError::Gone) };
        let Target::Point(from) = reach.target else {
            return Err(EditError::refused("it reaches for something that moves; move that"));
        };
        let to = to - reach.offset.unwrap_or(DVec3::ZERO);
        let place = scene.places.actors.get(index).cloned().unwrap_or_default();
        let siblings = scene.places.actors.iter().filter(|p| **p == place).count();
        self.change(&place, siblings, |text| {
            ScriptObject::at(text, place.line, place.column)?.set_reach(from, to)
        })
    }
}
