//! Look-at: turns joints towards targets, after all actors have been posed and placed.

use crate::snapshot::ActorState;
use crate::stage::Stage;
use crate::stage::actor::Target;
use crate::transforms::target_position;
use choreo_asset::{Asset, EyesMovedBy};
use choreo_motion::{Front, HumanBone, Time};
use glam::{Affine3A, DQuat, DVec3, Mat3, Mat3A, Vec3, Vec3A};

/// Largest turn of a joint away from its animated pose, 80°: the range of a head. Beyond it the turn fades out again until the target is
/// straight behind, so that a target that passes behind does not whip the head from one shoulder to the other.
pub(crate) const LOOK_AT_LIMIT_RAD: f64 = 80.0 * std::f64::consts::PI / 180.0;

/// An active look-at. Characters that look at each other's heads use the head positions after one trial of all turns ([`super::solve`]). A
/// target on the actor itself is updated after the actor has moved it ([`super::steps`]).
#[derive(Clone, Copy, Debug)]
pub(crate) struct ActiveLookAt {
    pub actor: usize,
    pub joint: u32,
    pub target: Target,
    pub world_target: DVec3,
    pub share: f64,
}

/// Adds the active look-ats of one actor to `aims`.
pub(crate) fn find_aims_of(
    stage: &Stage,
    time: Time,
    actors: &[ActorState],
    index: usize,
    aims: &mut Vec<ActiveLookAt>,
) {
    let (actor, state) = (&stage.actors[index], &actors[index]);
    for look in &actor.look_at {
        let share = look.weight_at(time);
        // The test of the joint also skips actors that are not posed.
        if share > 0.0
            && (look.joint as usize) < state.model_from_joint.len()
            && let Some(world_target) = target_position(stage, actors, &look.target)
        {
            let (joint, target) = (look.joint, look.target);
            aims.push(ActiveLookAt { actor: index, joint, target, world_target, share: share.into() });
        }
    }
}

/// Turns a joint, with all joints below it, about its position towards a target.
pub(crate) fn turn_joint_to_target(
    stage: &Stage,
    aim: &ActiveLookAt,
    state: &mut ActorState,
    turned: &mut Vec<bool>,
) {
    let skeleton = &stage.actors[aim.actor].asset.skeleton;
    let rest = stage.actors[aim.actor].asset.rest_model_from_joint();
    let joint = aim.joint as usize;
    let model_from_joint = state.model_from_joint[joint];
    let pivot = Vec3::from(model_from_joint.translation);
    let target = state.world_from_model.inverse().transform_point3(aim.world_target);
    let forward = forward_in_joint(&rest[joint], stage.actors[aim.actor].asset.front());
    let now = Vec3::from(model_from_joint.matrix3 * forward).as_dvec3();
    let eye = eye_turn(&stage.actors[aim.actor].asset, joint, state, target, aim.share);
    let turn = match eye {
        Some(turn) => turn,
        None => match turn_towards(now, target - pivot.as_dvec3(), aim.share) {
            Some(turn) => turn,
            None => return,
        },
    };
    let turn = Mat3A::from(Mat3::from_quat(turn.as_quat()));
    let pivot = Vec3A::from(pivot);
    // Children come after their parents.
    turned.clear();
    turned.resize(skeleton.len(), false);
    turned[joint] = true;
    for (index, parent) in skeleton.parents().iter().enumerate().skip(joint) {
        if index != joint {
            turned[index] = parent.is_some_and(|p| turned[p as usize]);
        }
        if turned[index] {
            let m = &mut state.model_from_joint[index];
            *m = Affine3A { matrix3: turn * m.matrix3, translation: pivot + turn * (m.translation - pivot) };
        }
    }
}

/// Model-space rotation of an eye joint whose file states how far the eyes turn: the direction from the head, mapped by the file's own
/// ranges (VRM 1.0, "lookAt.md"). `None` for any other joint.
fn eye_turn(asset: &Asset, joint: usize, state: &ActorState, target: DVec3, share: f64) -> Option<DQuat> {
    let eyes = asset.eyes.as_ref().filter(|eyes| eyes.moved_by == EyesMovedBy::Bones)?;
    let humanoid = asset.skeleton.humanoid()?;
    let is = |bone| humanoid.joint(bone) == Some(joint as u32);
    let left = is(HumanBone::LeftEye);
    if !left && !is(HumanBone::RightEye) {
        return None;
    }
    let head = humanoid.joint(HumanBone::Head)? as usize;
    let now = state.model_from_joint.get(head)?;
    let origin = now.transform_point3(eyes.offset_from_head).as_dvec3();
    // The direction is taken from the current head to the head at rest, which faces the model's front.
    let rotation = |m: &Affine3A| m.to_scale_rotation_translation().1.as_dquat();
    let rest = rotation(asset.rest_model_from_joint().get(head)?);
    let turned = (rotation(now) * rest.inverse()).normalize() * asset.front().rotation();
    let way = (turned.inverse() * (target - origin)).try_normalize()?;
    let (yaw, pitch) = eyes.turn_of(left, way);
    let own = DQuat::from_rotation_y(yaw * share) * DQuat::from_rotation_x(-pitch * share);
    let turn = turned * own * turned.inverse();
    turn.is_finite().then_some(turn)
}

/// The direction in a joint's space that is the model's front at rest; +Z if the rest matrix is singular.
pub(crate) fn forward_in_joint(rest_model_from_joint: &Affine3A, front: Front) -> Vec3A {
    let forward = rest_model_from_joint.matrix3.inverse() * Vec3A::from(front.direction().as_vec3());
    if forward.is_finite() { forward.normalize_or(Vec3A::Z) } else { Vec3A::Z }
}

/// Rotation from one direction towards another, limited as by [`LOOK_AT_LIMIT_RAD`], times a share. `None` if there is nothing to turn: the
/// target is in the joint, straight ahead or straight behind, or not finite.
fn turn_towards(now: DVec3, way: DVec3, share: f64) -> Option<DQuat> {
    let (now, way) = (now.try_normalize()?, way.try_normalize()?);
    let cross = now.cross(way);
    let axis = cross.try_normalize()?;
    let angle = libm::atan2(cross.length(), now.dot(way));
    let limited = if angle <= LOOK_AT_LIMIT_RAD {
        angle
    } else {
        LOOK_AT_LIMIT_RAD * (std::f64::consts::PI - angle) / (std::f64::consts::PI - LOOK_AT_LIMIT_RAD)
    };
    let turn = DQuat::from_axis_angle(axis, limited * share);
    turn.is_finite().then_some(turn)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn yaw_towards(degrees: f64) -> f64 {
        let way = DVec3::new(libm::sin(degrees.to_radians()), 0.0, libm::cos(degrees.to_radians()));
        let turn = turn_towards(DVec3::Z, way * 3.0, 1.0).unwrap_or(DQuat::IDENTITY);
        let after = turn * DVec3::Z;
        libm::atan2(after.x, after.z).to_degrees()
    }

    #[test]
    fn look_at_reaches_targets_up_to_the_limit_and_fades_out_behind() {
        for degrees in [0.0, 1e-6, 10.0, -45.0, 80.0] {
            assert!((yaw_towards(degrees) - degrees).abs() < 1e-9, "{degrees}: {}", yaw_towards(degrees));
        }
        assert!((yaw_towards(130.0) - 40.0).abs() < 1e-9);
        assert!(yaw_towards(179.999).abs() < 0.01 && yaw_towards(-179.999).abs() < 0.01);
        assert!(yaw_towards(180.0).abs() < 1e-9);
    }

    #[test]
    fn degenerate_look_at_targets_give_no_rotation() {
        assert!(turn_towards(DVec3::Z, DVec3::ZERO, 1.0).is_none());
        assert!(turn_towards(DVec3::ZERO, DVec3::X, 1.0).is_none());
        assert!(turn_towards(DVec3::Z, DVec3::NAN, 1.0).is_none());
        assert!(turn_towards(DVec3::Z, DVec3::splat(f64::INFINITY), 1.0).is_none());
    }
}
