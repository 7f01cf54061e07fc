//! Eyes that make up for what the head leaves: VRM 1.0, "lookAt.md".

use super::body::{Body, rotation_of};
use crate::{ActorState, Asset, Eyes, EyesMovedBy, expression};
use choreo_motion::HumanBone;
use choreo_motion::ik::share_of;
use glam::{DQuat, DVec3};

/// Turns the eyes towards a target in model space, where the file says how far they turn: by their bones, or by the morph targets of
/// lookLeft, lookRight, lookUp and lookDown. Nothing where another joint than the head has been turned. `aimed`: eyes that have a look of their own.
pub(super) fn follow(
    asset: &Asset,
    joint: u32,
    target: DVec3,
    share: f64,
    aimed: impl Fn(u32) -> bool,
    state: &mut ActorState,
    below: &mut Vec<bool>,
) {
    let human = |bone: HumanBone| asset.skeleton.humanoid().and_then(|h| h.joint(bone));
    let Some(eyes) = asset.eyes.as_ref().filter(|_| human(HumanBone::Head) == Some(joint)) else { return };
    let rest = asset.rest_model_from_joint();
    let head = &state.model_from_joint[joint as usize];
    // As the head is turned since it rested, when its axes were the model's.
    let turned = (rotation_of(head) * rotation_of(&rest[joint as usize]).inverse()).normalize();
    let origin = head.transform_point3(eyes.offset_from_head).as_dvec3();
    let way = turned.inverse() * (target - origin);
    if !way.is_finite() || way.length_squared() == 0.0 {
        return;
    }
    match eyes.moved_by {
        EyesMovedBy::Bones => {
            let mut body =
                Body { skeleton: &asset.skeleton, model_from_joint: &mut state.model_from_joint, below };
            for (bone, left) in [(HumanBone::LeftEye, true), (HumanBone::RightEye, false)] {
                let Some(eye) = human(bone).filter(|eye| (*eye as usize) < rest.len() && !aimed(*eye)) else {
                    continue;
                };
                let (yaw, pitch) = eyes.turn_of(left, way);
                let turn = DQuat::from_rotation_y(yaw) * DQuat::from_rotation_x(-pitch);
                body.turn(eye, share_of(turned * turn * turned.inverse(), share));
            }
        }
        EyesMovedBy::Expressions => {
            let yaw = libm::atan2(way.x, way.z);
            let pitch = libm::atan2(way.y, libm::hypot(way.x, way.z));
            let weights: Vec<f32> = asset
                .expressions
                .iter()
                .map(|e| (weight(eyes, &e.name, yaw, pitch) * share) as f32)
                .collect();
            expression::add(&asset.expressions, &weights, &mut state.morph_weights);
        }
    }
}

/// Of an expression of the gaze, 0..=1; 0 of any other.
fn weight(eyes: &Eyes, name: &str, yaw: f64, pitch: f64) -> f64 {
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
    use crate::RangeMap;

    fn range(most: f32, scale: f32) -> RangeMap {
        RangeMap { input_max: most.to_radians(), output_scale: scale }
    }

    #[test]
    fn weights_of_the_gaze_go_up_on_their_own_side() {
        let eyes = Eyes {
            offset_from_head: glam::Vec3::ZERO,
            moved_by: EyesMovedBy::Expressions,
            inner: range(90.0, 1.0),
            outer: range(90.0, 1.0),
            down: range(90.0, 1.0),
            up: range(45.0, 0.5),
        };
        let of = |name: &str| weight(&eyes, name, 45f64.to_radians(), 90f64.to_radians());
        assert!((of("lookLeft") - 0.5).abs() < 1e-6 && of("lookRight") == 0.0);
        assert!(of("lookUp") == 0.5 && of("lookDown") == 0.0 && of("happy") == 0.0);
        assert!((weight(&eyes, "lookDown", 0.0, -90f64.to_radians()) - 1.0).abs() < 1e-6);
    }
}
