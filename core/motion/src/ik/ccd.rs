//! Cyclic coordinate descent.

use super::Chain;
use super::chain::SolverScratch;
use crate::math::rotation::rotation_between;
use glam::DVec3;

/// One iteration: turns each joint once, from the end inwards.
pub(super) fn iterate(chain: &mut Chain, target: DVec3, scratch: &mut SolverScratch) {
    let SolverScratch { positions, rotations, .. } = scratch;
    let mut end = chain.frames(positions, rotations);
    for index in (0..chain.bones.len()).rev() {
        let (pivot, parent) = (positions[index], rotations[index]);
        let before = parent * chain.bones[index].rotation;
        chain.bones[index].turn(rotation_between(end - pivot, target - pivot), parent);
        let turned = parent * chain.bones[index].rotation * before.inverse();
        end = pivot + turned * (end - pivot);
    }
}
