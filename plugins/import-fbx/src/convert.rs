//! Converts ufbx's types to ours.

use choreo_importer_kit::{Problem, Result};
use choreo_motion::Transform;
use glam::{DAffine3, DMat4, DQuat, DVec3, Mat4, Quat, Vec3};

pub(crate) fn vec3(v: &ufbx::Vec3) -> Vec3 {
    Vec3::new(v.x as f32, v.y as f32, v.z as f32)
}

/// A normalized quaternion; the identity where its length is zero or not finite.
pub(crate) fn quat(q: &ufbx::Quat) -> Quat {
    let q = DQuat::from_xyzw(q.x, q.y, q.z, q.w);
    let length = q.length();
    if length.is_finite() && length > 1e-9 { (q * (1.0 / length)).as_quat() } else { Quat::IDENTITY }
}

pub(crate) const NOT_FINITE: &str = "its translation, rotation or scale is not finite";

pub(crate) fn transform(t: &ufbx::Transform, place: impl FnOnce() -> String) -> Result<Transform> {
    let out =
        Transform { translation: vec3(&t.translation), rotation: quat(&t.rotation), scale: vec3(&t.scale) };
    match out.is_finite() {
        true => Ok(out),
        false => Err(Problem::new(place(), NOT_FINITE)),
    }
}

pub(crate) fn affine(m: &ufbx::Matrix) -> DAffine3 {
    let column = DVec3::new;
    DAffine3::from_cols(
        column(m.m00, m.m10, m.m20),
        column(m.m01, m.m11, m.m21),
        column(m.m02, m.m12, m.m22),
        column(m.m03, m.m13, m.m23),
    )
}

pub(crate) fn matrix(m: &DAffine3, place: impl FnOnce() -> String) -> Result<Mat4> {
    let out = DMat4::from(*m).as_mat4();
    match out.is_finite() {
        true => Ok(out),
        false => Err(Problem::new(place(), "a matrix is not finite")),
    }
}
