//! Reference blend of two poses in f64, and the error of other blends against it.

use crate::reference::{self, ErrorStats, Local};
use choreo_motion::{Pose, Skeleton, Transform};
use glam::{Affine3A, DAffine3, DVec3, Vec3};

/// Blends two poses in f64, rotations by slerp. Model-from-joint transforms.
pub(crate) fn exact(skeleton: &Skeleton, from: &Pose, to: &Pose, weight: f64) -> Vec<DAffine3> {
    let local = |t: Transform| Local {
        translation: t.translation.as_dvec3(),
        rotation: t.rotation.as_dquat().normalize(),
        scale: t.scale.as_dvec3(),
    };
    let mixed: Vec<Local> =
        from.iter().zip(to.iter()).map(|(a, b)| local(a).mixed(&local(b), weight)).collect();
    reference::model_from_joint(skeleton, &mixed)
}

/// Adds the distance of each joint from its exact position, in millimetres of model space. Returns the joint with the worst error so far,
/// `None` if no joint exceeds earlier errors.
pub(crate) fn add_errors(errors: &mut ErrorStats, got: &[Affine3A], exact: &[DAffine3]) -> Option<usize> {
    let mut worst = None;
    for (joint, (got, exact)) in got.iter().zip(exact).enumerate() {
        let at: DVec3 = Vec3::from(got.translation).as_dvec3();
        if errors.add((at - exact.translation).length() * 1e3) {
            worst = Some(joint);
        }
    }
    worst
}
