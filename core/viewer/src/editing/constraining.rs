//! Constraints that are added to the selected actor as a line that a person would write: `ada.reach("RightHand", [0.3, 1.2, 0.5]);`.

use super::EditError;
use crate::app::Viewer;
use crate::geometry::picking;
use crate::state::selection::{Selected, actor};
use choreo_motion::HumanoidJoints;
use choreo_script::quoted;
use choreo_session::edit::{ScriptObject, format_number};
use choreo_stage::{Actor, ActorState};
use glam::DVec3;

/// A constraint of a joint with a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConstraintCall {
    Reach,
    LookAt,
    Aim,
}

/// A constraint that the user adds to the selected actor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewConstraint {
    pub call: ConstraintCall,
    /// Name of the target actor. `None`: a point in front of the joint.
    pub target: Option<String>,
}

impl ConstraintCall {
    pub const ALL: [ConstraintCall; 3] = [ConstraintCall::Reach, ConstraintCall::LookAt, ConstraintCall::Aim];

    /// Label in menus, before the target.
    pub fn label(self) -> &'static str {
        match self {
            ConstraintCall::Reach => "Hand reaches",
            ConstraintCall::LookAt => "Look at",
            ConstraintCall::Aim => "Aim hand at",
        }
    }

    /// The bone to constrain if no joint is selected.
    fn default_bone(self) -> &'static str {
        match self {
            ConstraintCall::LookAt => "head",
            ConstraintCall::Reach | ConstraintCall::Aim => "right hand",
        }
    }

    /// Offset of the target point from the joint: forward and up, in heights of the character.
    fn target_offset(self) -> [f64; 2] {
        match self {
            // The point is within the reach of a hanging arm.
            ConstraintCall::Reach => [0.15, 0.1],
            ConstraintCall::LookAt | ConstraintCall::Aim => [0.6, 0.0],
        }
    }

    /// Source text of the call. `joint`: quoted name of the joint; `is_default_joint`: whether it is the default joint.
    fn source_text(self, joint: &str, is_default_joint: bool, target: &str) -> String {
        match self {
            ConstraintCall::Reach => format!("reach({joint}, {target})"),
            ConstraintCall::Aim => format!("aim({joint}, {target})"),
            ConstraintCall::LookAt if is_default_joint => format!("look_at({target})"),
            ConstraintCall::LookAt => format!("look_at({target}, #{{ joint: {joint} }})"),
        }
    }
}

impl Viewer {
    /// Adds a constraint to the selected actor from the playhead on: to the selected joint, else to its right hand or head.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub fn add_constraint(&mut self, new: &NewConstraint) -> Result<(), EditError> {
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let name = self.selection.as_ref().and_then(Selected::actor).map(str::to_string);
        let name = name.ok_or_else(|| EditError::refused("first select the actor for the constraint"))?;
        self.check_unlocked(&name)?;
        let index = actor(&scene.stage, &name).ok_or(EditError::ObjectGone)?;
        let found = &scene.stage.actors[index];
        let (place, siblings) = self.place_of(&Selected::Actor(name.clone())).ok_or(EditError::ObjectGone)?;
        let default_joint = HumanoidJoints::of(&found.asset.skeleton).joint(new.call.default_bone());
        let selected =
            self.selected_joint.as_ref().filter(|joint| joint.actor == name).map(|joint| joint.joint);
        let joint = selected.or(default_joint.map(|joint| joint as usize)).ok_or_else(|| {
            let why =
                format!("{name} has no {}; click on a joint of its skeleton first", new.call.default_bone());
            EditError::refused_at(&place, &why)
        })?;
        let is_default_joint = default_joint.is_some_and(|default_joint| default_joint as usize == joint);
        let of = match &new.target {
            Some(target) => {
                let (of, siblings) =
                    self.place_of(&Selected::Actor(target.clone())).ok_or(EditError::ObjectGone)?;
                self.check_place(&of, siblings)?;
                Some(of)
            }
            None => None,
        };
        let now = self.playhead.time();
        let snapshot = scene.stage.at(now).map_err(|error| EditError::refused(error.to_string()))?;
        let point = point_in_front_of(found, &snapshot.actors[index], joint, new.call.target_offset());
        let from = self.edit_time(now.as_secs());
        let joint = quoted(found.asset.skeleton.short_name(joint));
        self.edit_call(&place, siblings, |text| {
            let object = ScriptObject::at(text, place.line, place.column)?;
            let of = of.as_ref().map(|of| ScriptObject::at(text, of.line, of.column)).transpose()?;
            let target = match &of {
                Some(of) => of.required_variable()?.to_string(),
                None => format!("[{}]", point.to_array().map(format_number).join(", ")),
            };
            let from = if from.secs > 0.0 { format!(".from({})", from.written(text)) } else { String::new() };
            object.constrain(
                &format!("{}{from}", new.call.source_text(&joint, is_default_joint, &target)),
                of.as_ref(),
            )
        })
    }
}

/// A point in front of a joint in the actor's viewing direction, world space, rounded to the centimetre. `offset`: forward and up, in heights of the
/// actor.
fn point_in_front_of(found: &Actor, state: &ActorState, joint: usize, offset: [f64; 2]) -> DVec3 {
    let at = state.world_from_joint(joint).unwrap_or(state.world_from_model).translation;
    let front = state.world_from_model.transform_vector3(found.asset.front().direction());
    let up = state.world_from_model.transform_vector3(DVec3::Y);
    let [forwards, upwards] = offset.map(|part| part * up.length() * picking::largest_extent(&found.asset));
    let point = at + front.normalize_or(DVec3::Z) * forwards + up.normalize_or(DVec3::Y) * upwards;
    point.map(|v| (v * 100.0).round() / 100.0)
}
