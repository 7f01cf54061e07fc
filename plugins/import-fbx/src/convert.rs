//! ufbx's numbers as ours.

use choreo_import::{Problem, Result};
use choreo_motion::Transform;
use glam::{DQuat, Mat4, Quat, Vec3, Vec4};

pub fn vec3(v: &ufbx::Vec3) -> Vec3 {
    Vec3::new(v.x as f32, v.y as f32, v.z as f32)
}

/// Unit length; the identity where it has none.
pub fn quat(q: &ufbx::Quat) -> Quat {
    let q = DQuat::from_xyzw(q.x, q.y, q.z, q.w);
    let length = q.length();
    if length.is_finite() && length > 1e-9 { (q * (1.0 / length)).as_quat() } else { Quat::IDENTITY }
}

pub const NOT_FINITE: &str = "its translation, rotation or scale is not finite";

pub fn transform(t: &ufbx::Transform, place: impl FnOnce() -> String) -> Result<Transform> {
    let out =
        Transform { translation: vec3(&t.translation), rotation: quat(&t.rotation), scale: vec3(&t.scale) };
    match out.is_finite() {
        true => Ok(out),
        false => Err(Problem::new(place(), NOT_FINITE)),
    }
}

pub fn matrix(m: &ufbx::Matrix, place: impl FnOnce() -> String) -> Result<Mat4> {
    let column = |x: f64, y: f64, z: f64, w: f32| Vec4::new(x as f32, y as f32, z as f32, w);
    let out = Mat4::from_cols(
        column(m.m00, m.m10, m.m20, 0.0),
        column(m.m01, m.m11, m.m21, 0.0),
        column(m.m02, m.m12, m.m22, 0.0),
        column(m.m03, m.m13, m.m23, 1.0),
    );
    match out.is_finite() {
        true => Ok(out),
        false => Err(Problem::new(place(), "a matrix is not finite")),
    }
}

/// One channel of an sRGB colour, linear (IEC 61966-2-1).
pub fn linear_from_srgb(v: f32) -> f32 {
    if v <= 0.04045 { v / 12.92 } else { libm::powf((v + 0.055) / 1.055, 2.4) }
}
