//! Poses: the local transforms of all joints of a skeleton at one time, structure-of-arrays.

pub(crate) mod additive;
pub(crate) mod blend;
pub(crate) mod inertialization;
pub(crate) mod local_to_model;
pub(crate) mod weighted_blend;

use crate::math::transform::Transform;
use crate::simd::lane::{LANES, Lane};
use crate::skeleton::Skeleton;
use glam::{Quat, Vec3};

/// Local transforms (parent-from-joint) of eight consecutive joints.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub(crate) struct PoseBlock {
    /// x y z, metres.
    pub translation: [Lane; 3],
    /// x y z w, unit.
    pub rotation: [Lane; 4],
    /// x y z.
    pub scale: [Lane; 3],
}

impl PoseBlock {
    pub(crate) const IDENTITY: PoseBlock = PoseBlock {
        translation: [Lane::splat(0.0); 3],
        rotation: [Lane::splat(0.0), Lane::splat(0.0), Lane::splat(0.0), Lane::splat(1.0)],
        scale: [Lane::splat(1.0); 3],
    };
}

/// Local transforms of a skeleton's joints, in its order, in blocks of eight. Lanes after the last joint are the identity.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    blocks: Vec<PoseBlock>,
    len: usize,
}

impl Pose {
    /// All joints at the identity.
    pub fn identity(len: usize) -> Pose {
        Pose { blocks: vec![PoseBlock::IDENTITY; len.div_ceil(LANES)], len }
    }

    /// The skeleton's rest pose.
    pub fn rest(skeleton: &Skeleton) -> Pose {
        let mut pose = Pose::identity(skeleton.len());
        for (joint, transform) in skeleton.rest().iter().enumerate() {
            pose.set(joint, *transform);
        }
        pose
    }

    /// Number of joints.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether the pose has no joints.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    pub(crate) fn blocks(&self) -> &[PoseBlock] {
        &self.blocks
    }

    pub(crate) fn blocks_mut(&mut self) -> &mut [PoseBlock] {
        &mut self.blocks
    }

    /// Transform of a joint. Panics where `joint >= len()`, as a slice does.
    pub fn get(&self, joint: usize) -> Transform {
        assert!(joint < self.len, "joint {joint} of a pose of {} joints", self.len);
        let (block, lane) = (&self.blocks[joint / LANES], joint % LANES);
        let t = &block.translation;
        let r = &block.rotation;
        let s = &block.scale;
        Transform {
            translation: Vec3::new(t[0].0[lane], t[1].0[lane], t[2].0[lane]),
            rotation: Quat::from_xyzw(r[0].0[lane], r[1].0[lane], r[2].0[lane], r[3].0[lane]),
            scale: Vec3::new(s[0].0[lane], s[1].0[lane], s[2].0[lane]),
        }
    }

    /// Sets the transform of a joint. Panics where `joint >= len()`, as a slice does.
    pub fn set(&mut self, joint: usize, transform: Transform) {
        assert!(joint < self.len, "joint {joint} of a pose of {} joints", self.len);
        let (block, lane) = (&mut self.blocks[joint / LANES], joint % LANES);
        for (row, value) in block.translation.iter_mut().zip(transform.translation.to_array()) {
            row.0[lane] = value;
        }
        for (row, value) in block.rotation.iter_mut().zip(transform.rotation.to_array()) {
            row.0[lane] = value;
        }
        for (row, value) in block.scale.iter_mut().zip(transform.scale.to_array()) {
            row.0[lane] = value;
        }
    }

    /// Copies another pose; allocates only if this one has held fewer joints so far.
    pub fn copy_from(&mut self, other: &Pose) {
        self.blocks.clear();
        self.blocks.extend_from_slice(&other.blocks);
        self.len = other.len;
    }

    /// Copies the requested channels (translations, rotations, scales) of a pose of as many joints.
    pub(crate) fn copy_channels(&mut self, other: &Pose, channels: [bool; 3]) {
        if channels == [false; 3] {
            return;
        }
        for (to, from) in self.blocks.iter_mut().zip(&other.blocks) {
            if channels[0] {
                to.translation = from.translation;
            }
            if channels[1] {
                to.rotation = from.rotation;
            }
            if channels[2] {
                to.scale = from.scale;
            }
        }
    }

    /// Whether all scales are exactly 1.
    pub(crate) fn has_unit_scale(&self) -> bool {
        // The fold has no early exit, so that it is vectorized.
        let odd = |lane: &Lane| lane.0.iter().fold(false, |odd, v| odd | (*v != 1.0));
        !self.blocks.iter().flat_map(|block| &block.scale).fold(false, |any, lane| any | odd(lane))
    }

    /// The joints' transforms in order.
    pub fn iter(&self) -> impl Iterator<Item = Transform> + '_ {
        (0..self.len).map(|joint| self.get(joint))
    }
}
