//! Cyclic coordinate descent.

use super::chain::Scratch;
use super::{Chain, arc};
use glam::DVec3;

/// Each joint once, from the end inwards.
pub(super) fn iterate(chain: &mut Chain, target: DVec3, scratch: &mut Scratch) {
    let Scratch { positions, rotations, .. } = scratch;
    chain.positions(positions);
    rotations.clear();
    let mut rotation = chain.parent;
    for bone in &chain.bones {
        rotations.push(rotation);
        rotation *= bone.rotation;
    }
    let mut end = *positions.last().unwrap_or(&chain.origin);
    for index in (0..chain.bones.len()).rev() {
        let (pivot, parent) = (positions[index], rotations[index]);
        let before = parent * chain.bones[index].rotation;
        chain.bones[index].turn(arc(end - pivot, target - pivot), parent);
        let turned = parent * chain.bones[index].rotation * before.inverse();
        end = pivot + turned * (end - pivot);
    }
}
