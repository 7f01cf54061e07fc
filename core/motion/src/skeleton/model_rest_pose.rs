//! The rest pose in model space, in f64.

use crate::math::rotation::normalize_or_identity;
use crate::skeleton::Skeleton;
use glam::{DAffine3, DQuat, DVec3};

/// The rest pose of a skeleton in model space.
pub(crate) struct ModelRestPose {
    /// model-from-joint rotations; scales, also negative ones, are left out.
    pub rotations: Vec<DQuat>,
    /// Positions in model space, metres, with all scales applied.
    pub positions: Vec<DVec3>,
    /// Mean scale of model-from-joint: 0.01 below a node that converts centimetres.
    pub scales: Vec<f64>,
}

impl ModelRestPose {
    pub(crate) fn of(skeleton: &Skeleton) -> ModelRestPose {
        let mut rest = ModelRestPose { rotations: Vec::new(), positions: Vec::new(), scales: Vec::new() };
        let mut matrices: Vec<DAffine3> = Vec::with_capacity(skeleton.len());
        for (local, parent) in skeleton.rest().iter().zip(skeleton.parents()) {
            let (t, r, s) = (
                local.translation.as_dvec3(),
                normalize_or_identity(local.rotation.as_dquat()),
                local.scale.as_dvec3(),
            );
            let own = DAffine3::from_scale_rotation_translation(s, r, t);
            let (matrix, rotation) = match parent {
                Some(p) => {
                    (matrices[*p as usize] * own, normalize_or_identity(rest.rotations[*p as usize] * r))
                }
                None => (own, r),
            };
            rest.positions.push(matrix.translation);
            rest.rotations.push(rotation);
            rest.scales.push(libm::cbrt(matrix.matrix3.determinant().abs()));
            matrices.push(matrix);
        }
        rest
    }

    /// Height from the model's lowest joint to its highest, metres.
    pub(crate) fn height(&self) -> f64 {
        let ys = || self.positions.iter().map(|p| p.y);
        (ys().fold(f64::MIN, f64::max) - ys().fold(f64::MAX, f64::min)).max(0.0)
    }
}
