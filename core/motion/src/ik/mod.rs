//! Inverse kinematics: joints turned so that a point of the body goes where it should.
//!
//! All in f64 and in one space, usually the model's. [`TwoBone`] is a closed form; [`Chain`] holds any number of bones with
//! limits, and three ways to solve it; [`Aim`] shares a turn among several joints. Nothing is remembered between frames: the
//! answer depends on the pose before it and the goal alone, so that any frame can be had first.

mod aim;
mod ccd;
mod chain;
mod fabrik;
mod least_squares;
mod limit;
mod settle;
mod two_bone;

pub use aim::{Aim, AimJoint};
pub use chain::{Chain, ChainBone, Solved, Solver};
pub use limit::Limit;
pub use two_bone::{TwoBone, TwoBoneTurn};

use glam::{DQuat, DVec3};

/// The shortest turn from one direction to another; none where one of them has no direction. Of opposite ones, half a turn about
/// an axis that is always the same.
pub fn arc(from: DVec3, to: DVec3) -> DQuat {
    match (from.try_normalize(), to.try_normalize()) {
        (Some(a), Some(b)) => DQuat::from_rotation_arc(a, b),
        _ => DQuat::IDENTITY,
    }
}

/// A share of a rotation, 0..=1, along its own axis, the short way.
pub fn share_of(rotation: DQuat, share: f64) -> DQuat {
    if share >= 1.0 {
        return rotation;
    }
    let q = if rotation.w < 0.0 { -rotation } else { rotation };
    let sin = q.xyz().length();
    if sin == 0.0 || share <= 0.0 {
        return DQuat::IDENTITY;
    }
    let half = libm::atan2(sin, q.w) * share;
    let axis = q.xyz() * (libm::sin(half) / sin);
    DQuat::from_xyzw(axis.x, axis.y, axis.z, libm::cos(half))
}
