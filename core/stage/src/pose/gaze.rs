//! Gaze: turns the eyes to a direction relative to the head (VRM 1.0, "lookAt.md").

use crate::pose::expressions::ExpressionWeights;
use crate::pose::joints::{PosedSkeleton, rotation_of};
use crate::properties::materials as material_changes;
use crate::snapshot::ActorState;
use crate::stage::actor::Actor;
use choreo_asset::eyes::requested;
use choreo_asset::{Asset, Expression, Eyes, EyesMovedBy};
use choreo_motion::math::rotation::rotation_fraction;
use choreo_motion::{HumanBone, Time};
use glam::{Affine3A, DQuat};

/// Turns the eyes of a posed actor as the gaze expressions request (see [`GAZE`](choreo_asset::eyes::GAZE)). `expression_weights` are those
/// of this actor.
pub(crate) fn apply_requested_gaze(
    actor: &Actor,
    time: Time,
    state: &mut ActorState,
    expression_weights: &mut ExpressionWeights,
) {
    let asset = &*actor.asset;
    let Some(eyes) = &asset.eyes else { return };
    // Eyes that are moved by expressions use the requested weights: other expressions suppress their gaze only when the weights are
    // resolved.
    let weights = if eyes.moved_by == EyesMovedBy::Bones {
        &expression_weights.resolved
    } else {
        &expression_weights.requested
    };
    let Some((yaw, pitch)) = requested(&asset.expressions, weights) else { return };
    let head = asset.skeleton.humanoid().and_then(|h| h.joint(HumanBone::Head));
    let Some(head) = head.map(|joint| joint as usize) else { return };
    let turned = turned_since_rest(asset, head, &state.model_from_joint[head]);
    let mut is_descendant = std::mem::take(&mut expression_weights.is_descendant);
    EyeTurn { actor, eyes, turned, yaw, pitch, share: 1.0, time }.apply(
        |_| false,
        state,
        &mut is_descendant,
        expression_weights,
    );
    expression_weights.is_descendant = is_descendant;
}

/// Model-space rotation of a head since rest, applied after the rotation that brings +Z to the model's front.
pub(crate) fn turned_since_rest(asset: &Asset, head: usize, model_from_head: &Affine3A) -> DQuat {
    let rest = rotation_of(&asset.rest_model_from_joint()[head]);
    (rotation_of(model_from_head) * rest.inverse()).normalize() * asset.front().rotation()
}

/// A turn of the eyes to a direction relative to the head: yaw and pitch in radians, and the share of the turn.
pub(crate) struct EyeTurn<'a> {
    pub actor: &'a Actor,
    pub eyes: &'a Eyes,
    /// See [`turned_since_rest`].
    pub turned: DQuat,
    pub yaw: f64,
    pub pitch: f64,
    pub share: f64,
    pub time: Time,
}

impl EyeTurn<'_> {
    pub(crate) fn apply(
        &self,
        aimed: impl Fn(u32) -> bool,
        state: &mut ActorState,
        is_descendant: &mut Vec<bool>,
        expression_weights: &mut ExpressionWeights,
    ) {
        let EyeTurn { actor, eyes, turned, yaw, pitch, share, .. } = *self;
        let asset = &*actor.asset;
        match eyes.moved_by {
            EyesMovedBy::Bones => {
                let Some(humanoid) = asset.skeleton.humanoid() else { return };
                let mut body = PosedSkeleton {
                    skeleton: &asset.skeleton,
                    model_from_joint: &mut state.model_from_joint,
                    is_descendant,
                };
                for (bone, left) in [(HumanBone::LeftEye, true), (HumanBone::RightEye, false)] {
                    let there = |eye: &u32| (*eye as usize) < body.model_from_joint.len() && !aimed(*eye);
                    let Some(eye) = humanoid.joint(bone).filter(there) else { continue };
                    let (yaw, pitch) = eyes.turn_by(left, yaw, pitch);
                    let turn = DQuat::from_rotation_y(yaw) * DQuat::from_rotation_x(-pitch);
                    body.turn(eye, rotation_fraction(turned * turn * turned.inverse(), share));
                }
            }
            EyesMovedBy::Expressions => {
                for (requested, expression) in expression_weights.requested.iter_mut().zip(&asset.expressions)
                {
                    *requested += (gaze_expression_weight(eyes, &expression.name, yaw, pitch) * share) as f32;
                }
                let painted = |e: &Expression| !e.colors.is_empty() || !e.uvs.is_empty();
                if expression_weights.resolve_again(&asset.expressions, &mut state.morph_weights)
                    && asset.expressions.iter().any(painted)
                {
                    material_changes::find_changed_materials(
                        actor,
                        &expression_weights.resolved,
                        self.time,
                        &mut state.materials,
                    );
                }
            }
        }
    }
}

/// Weight of a gaze expression, 0..=1; 0 for any other.
fn gaze_expression_weight(eyes: &Eyes, name: &str, yaw: f64, pitch: f64) -> f64 {
    match name {
        "lookLeft" => eyes.outer.map(yaw.max(0.0)),
        "lookRight" => eyes.outer.map((-yaw).max(0.0)),
        "lookDown" => eyes.down.map((-pitch).max(0.0)),
        "lookUp" => eyes.up.map(pitch.max(0.0)),
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_asset::RangeMap;

    fn range_map(most: f32, scale: f32) -> RangeMap {
        RangeMap { input_max: most.to_radians(), output_scale: scale }
    }

    #[test]
    fn gaze_expression_weights_rise_only_on_their_side() {
        let eyes = Eyes {
            offset_from_head: glam::Vec3::ZERO,
            moved_by: EyesMovedBy::Expressions,
            inner: range_map(90.0, 1.0),
            outer: range_map(90.0, 1.0),
            down: range_map(90.0, 1.0),
            up: range_map(45.0, 0.5),
        };
        let of = |name: &str| gaze_expression_weight(&eyes, name, 45f64.to_radians(), 90f64.to_radians());
        assert!((of("lookLeft") - 0.5).abs() < 1e-6 && of("lookRight") == 0.0);
        assert!(of("lookUp") == 0.5 && of("lookDown") == 0.0 && of("happy") == 0.0);
        assert!((gaze_expression_weight(&eyes, "lookDown", 0.0, -90f64.to_radians()) - 1.0).abs() < 1e-6);
    }
}
