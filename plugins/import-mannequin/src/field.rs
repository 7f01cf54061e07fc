//! Signed distance fields of the body parts: negative inside, metres.
//!
//! Blends follow Quilez, "Smooth minimum" (polynomial, quadratic): exact away from the seam, rounded over about `k` metres at it.

use glam::{Vec3, vec3};

pub(crate) fn sphere(p: Vec3, at: Vec3, radius: f32) -> f32 {
    (p - at).length() - radius
}

/// First-order distance to an ellipsoid, `k0 (k0 − 1) / k1` (Quilez, "Ellipsoid SDF"): the sign is right everywhere, and the
/// value is accurate to second order near the surface.
pub(crate) fn ellipsoid(p: Vec3, at: Vec3, radii: Vec3) -> f32 {
    let q = p - at;
    let k0 = (q / radii).length();
    let k1 = (q / (radii * radii)).length();
    if k1 < 1e-6 { -radii.min_element() } else { k0 * (k0 - 1.0) / k1 }
}

/// Convex hull of two balls, approximated by the distance to the nearest ball between them: exact where the radii are equal, a
/// bound elsewhere.
pub(crate) fn taper(p: Vec3, a: Vec3, ra: f32, b: Vec3, rb: f32) -> f32 {
    let ab = b - a;
    let h = ((p - a).dot(ab) / ab.length_squared()).clamp(0.0, 1.0);
    (p - a - ab * h).length() - (ra + (rb - ra) * h)
}

/// A rounded box; `half` includes the rounding.
pub(crate) fn rounded_box(p: Vec3, at: Vec3, half: Vec3, rounding: f32) -> f32 {
    let q = (p - at).abs() - (half - rounding);
    q.max(Vec3::ZERO).length() + q.max_element().min(0.0) - rounding
}

/// The half-space below the plane through `at` with normal `up`.
pub(crate) fn below(p: Vec3, at: Vec3, up: Vec3) -> f32 {
    (p - at).dot(up)
}

pub(crate) fn smooth_union(a: f32, b: f32, k: f32) -> f32 {
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - h * h * k * 0.25
}

pub(crate) fn smooth_difference(a: f32, b: f32, k: f32) -> f32 {
    smooth_intersection(a, -b, k)
}

pub(crate) fn smooth_intersection(a: f32, b: f32, k: f32) -> f32 {
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.max(b) + h * h * k * 0.25
}

/// The normalized gradient of a field, by central differences over 0.2 mm.
pub(crate) fn gradient(field: &dyn Fn(Vec3) -> f32, p: Vec3) -> Vec3 {
    const H: f32 = 2e-4;
    let d = |e: Vec3| field(p + e) - field(p - e);
    let g = vec3(d(Vec3::X * H), d(Vec3::Y * H), d(Vec3::Z * H));
    g.try_normalize().unwrap_or(Vec3::Y)
}
