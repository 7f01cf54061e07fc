//! Rotations in f64: slerp, rotation vectors (logarithm and exponential), the arc between two directions.

use glam::{DQuat, DVec3, DVec4};

/// Interpolates between two unit quaternions along the shorter arc; exact to f64 at every angle (glam's falls back to lerp below
/// 2.6°).
pub fn slerp(a: DQuat, b: DQuat, t: f64) -> DQuat {
    DQuat::from_vec4(slerp_sum(a.into(), b.into(), t)).normalize()
}

/// [`slerp`] before its result is normalized.
pub(crate) fn slerp_sum(a: DVec4, b: DVec4, t: f64) -> DVec4 {
    let b = if a.dot(b) < 0.0 { -b } else { b };
    // Kahan's angle between vectors: no cancellation for small ones.
    let angle = 2.0 * libm::atan2((a - b).length(), (a + b).length());
    let sin = libm::sin(angle);
    if sin > 1e-12 {
        a * (libm::sin((1.0 - t) * angle) / sin) + b * (libm::sin(t * angle) / sin)
    } else {
        a + (b - a) * t
    }
}

/// The shortest rotation from one direction to another; the identity where one of them is zero. Opposite directions give half
/// a turn about an axis that is always the same.
pub fn rotation_between(from: DVec3, to: DVec3) -> DQuat {
    match (from.try_normalize(), to.try_normalize()) {
        (Some(a), Some(b)) => DQuat::from_rotation_arc(a, b),
        _ => DQuat::IDENTITY,
    }
}

/// A fraction of a rotation, 0..=1, about its own axis, the shorter way round.
pub fn rotation_fraction(rotation: DQuat, share: f64) -> DQuat {
    if share >= 1.0 {
        return rotation;
    }
    let q = if rotation.w < 0.0 { -rotation } else { rotation };
    let sin = q.xyz().length();
    if sin == 0.0 || share <= 0.0 {
        return DQuat::IDENTITY;
    }
    let half = libm::atan2(sin, q.w) * share;
    let axis = q.xyz() * (libm::sin(half) / sin);
    DQuat::from_xyzw(axis.x, axis.y, axis.z, libm::cos(half))
}

/// Logarithm: axis times angle of a rotation, the shorter way round, so that the angle is from 0 to π. `q` need not have unit
/// length.
pub fn rotation_vector(q: DQuat) -> DVec3 {
    let v = DVec3::new(q.x, q.y, q.z);
    let sine = v.length();
    // −q is the same rotation; the one with w ≥ 0 has the smaller angle.
    let (v, w) = if q.w < 0.0 { (-v, -q.w) } else { (v, q.w) };
    if sine < 1e-300 || !sine.is_finite() {
        return DVec3::ZERO;
    }
    v * (2.0 * libm::atan2(sine, w) / sine)
}

/// Exponential: the rotation by `v.length()` radians about `v`.
pub fn from_rotation_vector(v: DVec3) -> DQuat {
    let angle = v.length();
    if angle < 1e-300 || !angle.is_finite() {
        return DQuat::IDENTITY;
    }
    let v = v * (libm::sin(angle / 2.0) / angle);
    DQuat::from_xyzw(v.x, v.y, v.z, libm::cos(angle / 2.0))
}

/// Normalizes a quaternion; the identity where its length is zero.
pub(crate) fn normalize_or_identity(q: DQuat) -> DQuat {
    let square = q.length_squared();
    if square > 1e-60 && square.is_finite() { q * (1.0 / square.sqrt()) } else { DQuat::IDENTITY }
}
