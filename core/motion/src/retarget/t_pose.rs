//! Transfers curves from one humanoid to another through their T-poses.
//!
//! VRM Animation 1.0, "how_to_transform_human_pose.md": with P and R the world rotations of a bone's parent and of the bone in
//! the T-pose, a local rotation q of one character is P·q·R⁻¹ in the axes of the world, and P'⁻¹·(P·q·R⁻¹)·R' in another one. That is
//! q between two constants, so that keys stay keys: slerp and splines give the same curve before and after.

use crate::clip::{Curve, MAX_KEY, Path};
use crate::skeleton::Skeleton;
use crate::skeleton::humanoid::{HumanBone, Humanoid};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use std::collections::BTreeMap;

/// Quaternions whose vector part is smaller than this turn nothing, and keys are then shared. About f32's resolution.
const MIN_ROTATION_COMPONENT: f64 = 3e-7;

/// Hips lower than this have no height to compare with, metres.
const MIN_HIPS_HEIGHT_M: f64 = 1e-3;

/// The bones that two skeletons have in common.
pub(crate) struct HumanoidPair {
    /// The bone and target joint of each source joint.
    bones: BTreeMap<u32, PairedBone>,
}

struct PairedBone {
    bone: HumanBone,
    to: u32,
    /// P'⁻¹·P and R⁻¹·R'.
    before: DQuat,
    after: DQuat,
    /// Maps positions of the hips from the source's parent space to the target's.
    position_map: Option<DAffine3>,
}

impl HumanoidPair {
    /// Pairs the bones of two skeletons. A skeleton without a [`Humanoid`] gets the one that its names indicate, at rest in a
    /// T-pose.
    pub(super) fn new(from: &Skeleton, to: &Skeleton) -> HumanoidPair {
        let humanoid = |s: &Skeleton| s.humanoid().cloned().unwrap_or_else(|| Humanoid::from_names(s));
        let (source, target) = (humanoid(from), humanoid(to));
        let (source_pose, target_pose) = (source.model_from_t_pose(from), target.model_from_t_pose(to));
        let mut bones = BTreeMap::new();
        for (bone, joint) in source.bones() {
            let Some(other) = target.joint(bone) else { continue };
            let above = |skeleton: &Skeleton, pose: &[DAffine3], joint: u32| {
                skeleton.parents()[joint as usize].map_or(DAffine3::IDENTITY, |p| pose[p as usize])
            };
            let (p, r) = (above(from, &source_pose, joint), source_pose[joint as usize]);
            let (p2, r2) = (above(to, &target_pose, other), target_pose[other as usize]);
            let position_map = (bone == HumanBone::Hips).then(|| hips_position_map(&p, &r, &p2, &r2));
            bones.insert(
                joint,
                PairedBone {
                    bone,
                    to: other,
                    before: (rotation(&p2).conjugate() * rotation(&p)).normalize(),
                    after: (rotation(&r).conjugate() * rotation(&r2)).normalize(),
                    position_map,
                },
            );
        }
        HumanoidPair { bones }
    }

    /// Pairs of source joint and target joint.
    pub(super) fn pairs(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        self.bones.iter().map(|(from, common)| (*from, common.to))
    }

    /// The bone of a source joint, and the target's joint for it.
    pub(super) fn bone(&self, from: u32) -> Option<(HumanBone, u32)> {
        self.bones.get(&from).map(|c| (c.bone, c.to))
    }

    /// Transfers a curve to the target's joint. `None` if it would change the length of a bone, or if a key would not be finite.
    pub(super) fn transfer(&self, curve: &Curve, bone: HumanBone) -> Option<Curve> {
        let common = self.bones.get(&curve.joint).filter(|c| c.bone == bone)?;
        let joint = common.to;
        match (curve.path, &common.position_map) {
            (Path::Rotation, _) => Some(transferred_rotation(curve, joint, common.before, common.after)),
            (Path::Translation, Some(position_map)) => transferred_translation(curve, joint, position_map),
            (Path::Translation | Path::Scale, _) => None,
            (Path::Weights(_), _) => Some(Curve { joint, ..curve.clone() }),
        }
    }
}

/// Rotation part of a map with scale. Mirroring is ignored.
fn rotation(m: &DAffine3) -> DQuat {
    let axes = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis].map(|a| a.normalize_or_zero());
    let mut turn = DMat3::from_cols(axes[0], axes[1], axes[2]);
    if turn.determinant() < 0.0 {
        turn.x_axis = -turn.x_axis;
    }
    let quat = DQuat::from_mat3(&turn).normalize();
    if quat.is_finite() { quat } else { DQuat::IDENTITY }
}

/// Map from the source's hips' parent space to the target's: positions in the model, times the ratio of the hips' heights.
fn hips_position_map(p: &DAffine3, r: &DAffine3, p2: &DAffine3, r2: &DAffine3) -> DAffine3 {
    let (height, height2) = (r.translation.y, r2.translation.y);
    let known = height > MIN_HIPS_HEIGHT_M && height2 > MIN_HIPS_HEIGHT_M;
    let ratio = if known { height2 / height } else { 1.0 };
    p2.inverse() * DAffine3::from_scale(DVec3::splat(ratio)) * *p
}

fn transferred_rotation(curve: &Curve, joint: u32, before: DQuat, after: DQuat) -> Curve {
    let turns = |q: DQuat| q.to_array()[..3].iter().any(|v| v.abs() > MIN_ROTATION_COMPONENT);
    if !turns(before) && !turns(after) {
        return Curve { joint, ..curve.clone() };
    }
    // A product of quaternions is linear in each, so that tangents are transformed like values.
    let (keys, _) = curve.values.as_chunks::<4>();
    let turned = keys.iter().flat_map(|q| {
        let q = DQuat::from_array(q.map(f64::from));
        (before * q * after).to_array().map(|v| v as f32)
    });
    Curve { joint, values: turned.collect(), ..curve.clone() }
}

fn transferred_translation(curve: &Curve, joint: u32, position_map: &DAffine3) -> Option<Curve> {
    let vectors_per_key = curve.stride() / 3;
    let (vectors, _) = curve.values.as_chunks::<3>();
    let mut values = Vec::with_capacity(curve.values.len());
    for (index, v) in vectors.iter().enumerate() {
        let v = DVec3::from_array(v.map(f64::from));
        // A spline stores each key as in-tangent, value, out-tangent.
        let is_value = vectors_per_key == 1 || index % 3 == 1;
        let moved =
            if is_value { position_map.transform_point3(v) } else { position_map.transform_vector3(v) };
        if !moved.is_finite() || moved.abs().max_element() > f64::from(MAX_KEY) {
            return None;
        }
        values.extend(moved.to_array().map(|v| v as f32));
    }
    Some(Curve { joint, values: values.into(), ..curve.clone() })
}
