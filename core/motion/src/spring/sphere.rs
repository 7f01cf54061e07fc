//! Directions as points of the unit sphere: logarithm, exponential map and parallel transport.

use glam::DVec3;
use std::f64::consts::PI;

/// Logarithm: the tangent vector at `from` along the great circle to `to`, as long as the angle, 0..=π. Opposite directions have
/// many great circles; the result is always the same one.
pub fn log(from: DVec3, to: DVec3) -> DVec3 {
    let cross = from.cross(to);
    let sin = cross.length();
    let cos = from.dot(to);
    if sin < 1e-150 {
        return if cos >= 0.0 { DVec3::ZERO } else { from.any_orthonormal_vector() * PI };
    }
    cross.cross(from) * (libm::atan2(sin, cos) / sin)
}

/// Exponential map: moves a direction along a tangent vector by its length in radians. Returns the new direction, and another
/// tangent vector after parallel transport to it.
pub fn exp(from: DVec3, way: DVec3, carried: DVec3) -> (DVec3, DVec3) {
    let angle = way.length();
    if angle == 0.0 {
        return (from, carried);
    }
    let along = way / angle;
    let (sin, cos) = libm::sincos(angle);
    let to = (from * cos + along * sin).normalize();
    let share = carried.dot(along);
    let carried = carried - along * share + (along * cos - from * sin) * share;
    (to, tangent(to, carried))
}

/// The component of a vector that is perpendicular to a direction.
pub fn tangent(direction: DVec3, v: DVec3) -> DVec3 {
    v - direction * direction.dot(v)
}

/// sin x / x
pub fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-4 { 1.0 - x * x / 6.0 } else { libm::sin(x) / x }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_inverts_log_and_transports_a_vector_along_the_great_circle() {
        let a = DVec3::new(0.36, 0.48, 0.8);
        for b in
            [DVec3::X, DVec3::NEG_Z, DVec3::new(0.6, 0.0, -0.8), a, (a + DVec3::X * 1e-9).normalize(), -a]
        {
            let arc = log(a, b);
            assert!(arc.dot(a).abs() < 1e-12 && arc.length() <= PI + 1e-12);
            let (there, carried) = exp(a, arc, arc);
            assert!((there - b).length() < 1e-12, "{b}: {there}");
            // A vector along the great circle stays along it, with the same length.
            assert!((carried.length() - arc.length()).abs() < 1e-12 && carried.dot(there).abs() < 1e-12);
        }
    }
}
