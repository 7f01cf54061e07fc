//! Gaze: the eyes turn by the angle that remains between head and target (VRM 1.0, "lookAt.md").

use crate::pose::expressions::ExpressionWeights;
use crate::pose::gaze::{EyeTurn, turned_since_rest};
use crate::snapshot::ActorState;
use crate::stage::actor::Actor;
use choreo_asset::eyes::angles_of;
use choreo_motion::{HumanBone, Time};
use glam::DVec3;

/// A target towards which a joint has been turned. The eyes make up for the rest of the angle.
pub(super) struct Gaze<'a> {
    pub actor: &'a Actor,
    /// The joint that was turned. The eyes follow it only if it is the head.
    pub joint: u32,
    /// Target in model space.
    pub target: DVec3,
    pub share: f64,
    pub time: Time,
}

impl Gaze<'_> {
    /// Turns the eyes if the file states how far they turn: by their bones, or by the expressions lookLeft, lookRight, lookUp and lookDown,
    /// which other expressions may suppress. `aimed`: whether an eye joint has a look-at of its own and is left alone.
    pub(super) fn turn_eyes(
        &self,
        aimed: impl Fn(u32) -> bool,
        state: &mut ActorState,
        is_descendant: &mut Vec<bool>,
        expression_weights: &mut ExpressionWeights,
    ) {
        let Gaze { actor, joint, share, .. } = *self;
        let asset = &*actor.asset;
        let human = |bone: HumanBone| asset.skeleton.humanoid().and_then(|h| h.joint(bone));
        let Some(eyes) = asset.eyes.as_ref().filter(|_| human(HumanBone::Head) == Some(joint)) else {
            return;
        };
        let head = &state.model_from_joint[joint as usize];
        let turned = turned_since_rest(asset, joint as usize, head);
        let origin = head.transform_point3(eyes.offset_from_head).as_dvec3();
        let way = turned.inverse() * (self.target - origin);
        if !way.is_finite() || way.length_squared() == 0.0 {
            return;
        }
        let (yaw, pitch) = angles_of(way);
        EyeTurn { actor, eyes, turned, yaw, pitch, share, time: self.time }.apply(
            aimed,
            state,
            is_descendant,
            expression_weights,
        );
    }
}
