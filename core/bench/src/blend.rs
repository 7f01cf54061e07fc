//! Ways to blend two poses, joint by joint, to model space.

use crate::rotation::Interpolate;
use crate::truth::{self, Local, Spread};
use choreo_motion::{Pose, Skeleton, Transform};
use glam::{Affine3A, DAffine3, DVec3, Vec3};

/// A pose blended from two by one way of rotations, translation and scale by a line.
pub fn blended(from: &Pose, to: &Pose, weight: f32, way: Interpolate, out: &mut Pose) {
    for joint in 0..from.len().min(to.len()).min(out.len()) {
        let (a, b) = (from.get(joint), to.get(joint));
        let near = if a.rotation.dot(b.rotation) < 0.0 { -b.rotation } else { b.rotation };
        let transform = Transform {
            translation: a.translation.lerp(b.translation, weight),
            rotation: way(a.rotation, near, weight),
            scale: a.scale.lerp(b.scale, weight),
        };
        out.set(joint, transform);
    }
}

/// The same in f64 from the same two poses, to model space.
pub fn exact(skeleton: &Skeleton, from: &Pose, to: &Pose, weight: f64) -> Vec<DAffine3> {
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
