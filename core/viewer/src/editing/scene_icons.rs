//! Dragged icons of lights, cameras and IK targets.

use super::EditError;
use super::placing::ScriptCamera;
use crate::app::Viewer;
use crate::geometry::{picking, rig};
use crate::state::dragged_icon::{DraggedIcon, IconObject};
use crate::state::selection::{Selected, actor};
use choreo_asset::LightKind;
use choreo_motion::Time;
use choreo_session::PlacementOverride;
use choreo_session::edit::{Edit, EditRefused, KeyValue, NewValueSyntax, ScriptObject, format_number};
use choreo_stage::{ConstraintKind, Property, Rig, Stage, Target};
use glam::DVec3;

impl Viewer {
    /// The placement that a dragged icon gives to its object.
    pub(crate) fn icon_placement(
        &self,
        stage: &Stage,
        DraggedIcon { what, to, .. }: &DraggedIcon,
    ) -> Option<PlacementOverride> {
        let to = *to;
        Some(match what {
            IconObject::Light(light) => match stage.lights.get(*light)?.light.kind {
                LightKind::Directional => {
                    PlacementOverride::Sun { light: *light, direction: self.sun_direction_from(to).as_vec3() }
                }
                LightKind::Point | LightKind::Spot { .. } => PlacementOverride::Light { light: *light, to },
            },
            IconObject::Camera(name) => {
                let camera = stage.cameras.iter().position(|camera| camera.name == *name)?;
                let rig = rig::move_rig(stage, &self.shown()?.snapshot, &stage.cameras[camera].rig, to)?;
                PlacementOverride::Camera { camera, rig }
            }
            IconObject::Reach(name, constraint) => {
                PlacementOverride::Target { actor: actor(stage, name)?, constraint: *constraint, to }
            }
        })
    }

    /// Direction of a sun whose icon is at a position; unit vector, world space.
    pub(crate) fn sun_direction_from(&self, at: DVec3) -> DVec3 {
        (self.sun_target() - at).normalize_or(DVec3::NEG_Y)
    }

    /// The point that the icons of suns shine on, world space: the center of the actors at the start of the scene, so that the icons do not move
    /// with the actors.
    pub(crate) fn sun_target(&self) -> DVec3 {
        let find = || {
            let scene = self.scene.as_ref()?;
            picking::bounds_center_of_all(&scene.stage, &scene.evaluator.clone().at(Time::ZERO).ok()?)
        };
        let place = self.sunlit.get().or_else(find).unwrap_or(DVec3::ZERO);
        self.sunlit.set(Some(place));
        place
    }

    /// Moves a camera at the playhead: its position (`.at`), its offset from what it follows, or the distance and angles of its orbit; if the
    /// position has keys, the key there. The camera keeps its target. `at`: world space.
    ///
    /// # Errors
    /// Fails as [`Viewer::change_actor`] does.
    pub(crate) fn move_camera(&mut self, name: &str, at: DVec3) -> Result<(), EditError> {
        let ScriptCamera { camera, place, siblings } = self.script_camera(name)?;
        let by_itself = || {
            EditError::refused_at(&place, "the camera moves by itself (orbit, follow, …); change that there")
        };
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let snapshot = &self.shown().ok_or(EditError::NothingShown)?.snapshot;
        let rig = rig::move_rig(&scene.stage, snapshot, &camera.rig, at).ok_or_else(by_itself)?;
        let (keyed, call) = match &rig {
            Rig::Fixed { position, .. } => (*position, None),
            Rig::Follow { offset, .. } => (*offset, Some("follow")),
            _ => (DVec3::ZERO, Some("orbit")),
        };
        let when = self.edit_time(self.playhead.time().as_secs());
        if camera.channels.iter().any(|c| c.property == Property::Translation) {
            return self.edit_call(&place, siblings, |text| {
                let object = ScriptObject::at(text, place.line, place.column)?;
                object.set_key("position", when, KeyValue::Point(rounded(keyed)))
            });
        }
        let place = match call {
            Some(call) => {
                let stated = self.stated_calls(&Selected::Camera(name.to_string()), &[call]);
                stated.last().ok_or_else(by_itself)?.place.clone()
            }
            None => place,
        };
        self.edit_call(&place, siblings, |text| {
            let object = ScriptObject::at(text, place.line, place.column)?;
            match (&camera.rig, &rig) {
                (from, to @ Rig::Orbit { .. }) => orbit_edit(text, &object, [from, to]),
                (_, Rig::Follow { offset, .. }) => match object.argument(1) {
                    Some(list) if list.starts_with('[') => object.set_argument(1, &point_text(*offset)),
                    _ => Err(EditRefused::at(
                        place.line,
                        "the offset of the camera is computed; change it there",
                    )),
                },
                _ => object.set("at", &rounded(keyed).to_array()),
            }
        })
    }

    /// Moves the target point of a reach constraint, which the script states as numbers. `constraint`: index among the constraints of the actor.
    ///
    /// # Errors
    /// Fails as [`Viewer::change_actor`] does.
    pub(crate) fn move_target(&mut self, name: &str, constraint: usize, to: DVec3) -> Result<(), EditError> {
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let index = actor(&scene.stage, name).ok_or(EditError::ObjectGone)?;
        let constraint =
            scene.stage.actors[index].constraints.get(constraint).ok_or(EditError::ObjectGone)?;
        let ConstraintKind::Reach(reach) = &constraint.kind else { return Err(EditError::ObjectGone) };
        let Target::Point(from) = reach.target else {
            return Err(EditError::refused(
                "the target of the constraint is another object; move that object",
            ));
        };
        let to = to - reach.offset.unwrap_or(DVec3::ZERO);
        let place = scene.places.actors.get(index).cloned().unwrap_or_default();
        let siblings = scene.places.actors.iter().filter(|p| **p == place).count();
        self.edit_call(&place, siblings, |text| {
            ScriptObject::at(text, place.line, place.column)?.set_reach(from, to)
        })
    }
}

/// Rounds to the millimetre, the finest step that a drag writes.
fn rounded(at: DVec3) -> DVec3 {
    (at * 1e3).round() / 1e3
}

fn point_text(at: DVec3) -> String {
    let numbers = rounded(at).to_array().map(format_number);
    format!("[{}]", numbers.join(", "))
}

/// The edit of the numbers of an orbit that changed: distance to the millimetre, angles to a tenth of a degree.
fn orbit_edit(text: &str, object: &ScriptObject, [from, to]: [&Rig; 2]) -> Result<Edit, EditRefused> {
    let numbers = |rig: &Rig| match rig {
        Rig::Orbit { distance, elevation, azimuth, .. } => [
            ("distance", (distance * 1e3).round() / 1e3),
            ("elevation", (elevation.to_degrees() * 10.0).round() / 10.0),
            ("azimuth", (azimuth.to_degrees() * 10.0).round() / 10.0),
        ],
        _ => [("", 0.0); 3],
    };
    let (line, column) = object.place();
    let (mut after, mut steps) = (text.to_string(), Vec::new());
    for ((name, old), (_, new)) in numbers(from).into_iter().zip(numbers(to)) {
        if old == new {
            continue;
        }
        let object = ScriptObject::at(&after, line, column)?;
        let step = object.set_value(name, &format_number(new), NewValueSyntax::Option);
        let step = step.map_err(|refused| refused.before(text, &steps))?;
        after = step.apply(&after);
        steps.push(step);
    }
    Ok(Edit::between(text, &after))
}
