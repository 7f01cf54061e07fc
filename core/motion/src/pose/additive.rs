//! Additive and subtractive layers: the difference of a pose from a reference pose, applied to another pose.
//!
//! The difference of a joint consists of the rotation q_ref⁻¹ q in the joint's own space as a rotation vector (axis times angle,
//! the logarithm of the quaternion: F. S. Grassia, "Practical Parameterization of Rotations Using the Exponential Map", 1998),
//! the difference of translations, and the ratio of scales. A weight w multiplies the rotation vector, which is slerp from the
//! identity, and the translation; it takes the ratio to 1 + w (ratio − 1). Layers are summed (ratios multiplied) before they are
//! applied, so that their order does not matter, and a subtracted layer takes away exactly what it adds. Products of quaternions
//! would depend on the order: for two deltas of 30° about crossed axes by 7.6°.

use crate::math::rotation::{from_rotation_vector, rotation_vector};
use crate::pose::Pose;
use glam::{DVec3, Vec3};

/// Accumulates additive layers; its memory is reused by the next sum.
#[derive(Clone, Debug, Default)]
pub struct AdditiveLayers {
    joints: Vec<JointDelta>,
}

#[derive(Clone, Copy, Debug)]
struct JointDelta {
    /// Axis times angle, radians.
    rotation: DVec3,
    translation: DVec3,
    scale: DVec3,
}

const IDENTITY_DELTA: JointDelta =
    JointDelta { rotation: DVec3::ZERO, translation: DVec3::ZERO, scale: DVec3::ONE };

impl AdditiveLayers {
    /// Begins a frame of `joints` joints without layers.
    pub fn start(&mut self, joints: usize) {
        self.joints.clear();
        self.joints.resize(joints, IDENTITY_DELTA);
    }

    /// Adds the difference of `pose` from `reference`. A negative `weight` subtracts; it is multiplied by the mask's weight of
    /// each joint (`None` = 1). Joints that a pose lacks are unchanged.
    pub fn add(&mut self, reference: &Pose, pose: &Pose, weight: f32, mask: Option<&[f32]>) {
        let count = self.joints.len().min(reference.len()).min(pose.len());
        for (joint, delta) in self.joints.iter_mut().enumerate().take(count) {
            let masked = mask.map_or(1.0, |mask| mask.get(joint).copied().unwrap_or(0.0));
            let w = f64::from(weight) * f64::from(masked);
            if w == 0.0 {
                continue;
            }
            let (from, to) = (reference.get(joint), pose.get(joint));
            if from == to {
                continue;
            }
            delta.rotation +=
                rotation_vector(from.rotation.as_dquat().conjugate() * to.rotation.as_dquat()) * w;
            delta.translation += (to.translation.as_dvec3() - from.translation.as_dvec3()) * w;
            let ratio = scale_ratio(from.scale, to.scale);
            let factor = DVec3::ONE + (ratio - DVec3::ONE) * w.abs();
            delta.scale *= if w < 0.0 { reciprocal_or_one(factor) } else { factor };
        }
    }

    /// Applies the sum of the layers to a pose of as many joints.
    pub fn apply(&self, pose: &mut Pose) {
        for (joint, delta) in self.joints.iter().enumerate().take(pose.len()) {
            if delta.rotation == DVec3::ZERO && delta.translation == DVec3::ZERO && delta.scale == DVec3::ONE
            {
                continue;
            }
            let mut local = pose.get(joint);
            if delta.rotation != DVec3::ZERO {
                let turned = local.rotation.as_dquat() * from_rotation_vector(delta.rotation);
                local.rotation = turned.normalize().as_quat();
            }
            local.translation = (local.translation.as_dvec3() + delta.translation).as_vec3();
            local.scale = (local.scale.as_dvec3() * delta.scale).as_vec3();
            if local.is_finite() {
                pose.set(joint, local);
            }
        }
    }
}

/// Ratio of scales; 1 where the reference's scale is zero.
fn scale_ratio(from: Vec3, to: Vec3) -> DVec3 {
    let component_ratio =
        |from: f32, to: f32| if from.abs() < 1e-12 { 1.0 } else { f64::from(to) / f64::from(from) };
    DVec3::new(component_ratio(from.x, to.x), component_ratio(from.y, to.y), component_ratio(from.z, to.z))
}

fn reciprocal_or_one(v: DVec3) -> DVec3 {
    DVec3::from_array(v.to_array().map(|v| if v.abs() < 1e-12 { 1.0 } else { 1.0 / v }))
}
