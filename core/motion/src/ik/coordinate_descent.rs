//! Coordinate descent of a chain with limits, after a solver, to the nearest position that the limits allow.

use super::chain::SolverScratch;
use super::limit::swing_and_twist;
use super::{Chain, ChainBone, Limit};
use crate::math::rotation::{rotation_between, rotation_fraction};
use glam::{DQuat, DVec3};
use std::f64::consts::{PI, TAU};

/// One sweep: turns each joint once, from the end inwards, to where the end is nearest to the target within the joint's limit:
/// hinges and twists in closed form, swings by several attempts. The distance never grows. If no single joint can improve the
/// chain, nothing changes, which for hinges is a local optimum (coordinate descent on a smooth function in a box: D. Bertsekas,
/// "Nonlinear Programming", 1999, §2.7).
pub(super) fn sweep(chain: &mut Chain, target: DVec3, scratch: &mut SolverScratch) {
    let SolverScratch { positions, rotations, .. } = scratch;
    let mut end = chain.frames(positions, rotations);
    for index in (0..chain.bones.len()).rev() {
        let (pivot, parent) = (positions[index], rotations[index]);
        let bone = &mut chain.bones[index];
        let (arm, to_target) = (end - pivot, target - pivot);
        let mut best = (arm - to_target).length();
        let before = *bone;
        let mut keep_if_nearer = |bone: &mut ChainBone, turned: DQuat| {
            let now = parent * turned * (parent * before.rotation).inverse() * arm;
            let distance = (now - to_target).length();
            if turned.is_finite() && distance < best {
                best = distance;
                bone.rotation = turned;
                end = pivot + now;
            }
        };
        match before.limit {
            Limit::Free => {
                let turn = parent.inverse() * rotation_between(arm, to_target) * parent;
                keep_if_nearer(bone, (turn * before.rotation).normalize());
            }
            Limit::Hinge { axis, angle } => {
                let (_, now) = swing_and_twist(before.rest.inverse() * before.rotation, axis);
                let turned = now + angle_about(parent * before.rest * axis, arm, to_target);
                let allowed_angle = nearest_allowed_angle(turned, angle);
                keep_if_nearer(bone, (before.rest * DQuat::from_axis_angle(axis, allowed_angle)).normalize());
            }
            Limit::SwingTwist { axis, twist, .. } => {
                let turn = parent.inverse() * rotation_between(arm, to_target) * parent;
                // The whole swing, and parts of it in case that is beyond the cone.
                for share in [1.0, 0.5, 0.125, 0.01] {
                    let wanted = (rotation_fraction(turn, share) * before.rotation).normalize();
                    keep_if_nearer(bone, before.limit.clamp(before.rest, wanted));
                }
                let (tilt, now) = swing_and_twist(before.rest.inverse() * before.rotation, axis);
                let turned = now + angle_about(parent * before.rotation * axis, arm, to_target);
                let about = DQuat::from_axis_angle(axis, nearest_allowed_angle(turned, twist));
                keep_if_nearer(bone, (before.rest * tilt * about).normalize());
            }
        }
    }
}

/// The angle about an axis that turns one direction nearest to another, radians.
fn angle_about(axis: DVec3, from: DVec3, to: DVec3) -> f64 {
    let across = |v: DVec3| v - axis * v.dot(axis);
    let (from, to) = (across(from), across(to));
    libm::atan2(from.cross(to).dot(axis), from.dot(to))
}

/// The angle in an interval that is nearest to `angle`, around the circle.
fn nearest_allowed_angle(angle: f64, (low, high): (f64, f64)) -> f64 {
    let wrapped = |a: f64| a - TAU * libm::floor((a + PI) / TAU);
    let angle = wrapped(angle);
    if (low..=high).contains(&angle) {
        return angle;
    }
    if wrapped(angle - low).abs() < wrapped(angle - high).abs() { low } else { high }
}
