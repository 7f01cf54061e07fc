//! The truth of a blend of two poses, and how far others are from it.

use crate::truth::{self, Local, Spread};
use choreo_motion::{Pose, Skeleton, Transform};
use glam::{Affine3A, DAffine3, DVec3, Vec3};

/// Two poses blended in f64, rotations by slerp, to model space.
pub(crate) fn exact(skeleton: &Skeleton, from: &Pose, to: &Pose, weight: f64) -> Vec<DAffine3> {
    let local = |t: Transform| Local {
        translation: t.translation.as_dvec3(),
        rotation: t.rotation.as_dquat().normalize(),
        scale: t.scale.as_dvec3(),
    };
    let mixed: Vec<Local> =
        from.iter().zip(to.iter()).map(|(a, b)| local(a).mixed(&local(b), weight)).collect();
    truth::model_from_joint(skeleton, &mixed)
}

/// How far each joint is from where it should be, millimetres of the model; true where one is the worst so far.
pub(crate) fn add_errors(errors: &mut Spread, got: &[Affine3A], exact: &[DAffine3]) -> Option<usize> {
    let mut worst = None;
    for (joint, (got, exact)) in got.iter().zip(exact).enumerate() {
        let at: DVec3 = Vec3::from(got.translation).as_dvec3();
        if errors.add((at - exact.translation).length() * 1e3) {
            worst = Some(joint);
        }
    }
    worst
}
