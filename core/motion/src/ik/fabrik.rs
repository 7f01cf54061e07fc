//! Forward and backward reaching inverse kinematics (FABRIK).

use super::Chain;
use super::chain::SolverScratch;
use crate::math::rotation::rotation_between;
use glam::DVec3;

/// One iteration: positions from the target back to the root, then bones from the root outwards. Each bone is turned within its
/// limits towards the position found for its end, and the next bone starts where it really ends.
pub(super) fn iterate(chain: &mut Chain, target: DVec3, scratch: &mut SolverScratch) {
    let SolverScratch { positions, goals, .. } = scratch;
    chain.positions(positions);
    goals.clone_from(positions);
    let Some(last) = goals.last_mut() else { return };
    *last = target;
    for index in (0..chain.bones.len()).rev() {
        let length = chain.bones[index].offset.length();
        let direction = (goals[index] - goals[index + 1]).try_normalize().unwrap_or(DVec3::Y);
        goals[index] = goals[index + 1] + direction * length;
    }
    let (mut at, mut parent) = (chain.origin, chain.parent);
    for (index, bone) in chain.bones.iter_mut().enumerate() {
        let now = parent * bone.rotation * bone.offset;
        bone.turn(rotation_between(now, goals[index + 1] - at), parent);
        parent *= bone.rotation;
        at += parent * bone.offset;
    }
}
