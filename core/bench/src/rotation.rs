//! Ways to find a rotation between two, in f32, one at a time: to compare, and to time against each other.

use glam::Quat;

/// A way to interpolate: `b` lies in the hemisphere of `a`.
pub type Interpolate = fn(Quat, Quat, f32) -> Quat;

/// Name and way.
pub const WAYS: [(&str, Interpolate); 4] = [
    ("slerp, trigonometry", slerp),
    ("slerp, power series", slerp_series),
    ("nlerp, corrected", nlerp_corrected),
    ("nlerp", nlerp),
];

/// The textbook: sin((1 − t) θ) / sin θ, with a straight line where sin θ says nothing.
pub fn slerp(a: Quat, b: Quat, t: f32) -> Quat {
    let cos = a.dot(b);
    if cos > 0.9995 {
        return nlerp(a, b, t);
    }
    let angle = libm::acosf(cos.min(1.0));
    let s = 1.0 / libm::sinf(angle);
    (a * (libm::sinf((1.0 - t) * angle) * s) + b * (libm::sinf(t * angle) * s)).normalize()
}

/// Eberly's series in d = 1 − cos θ ("A Fast and Accurate Algorithm for Computing SLERP", 2011, eq. 8), as long as f32 needs
/// for this d: what `choreo_motion::Sample` does for eight joints at once.
pub fn slerp_series(a: Quat, b: Quat, t: f32) -> Quat {
    // Computed from the difference instead of the product, because small angles then keep their digits.
    let d = 0.5 * (a - b).length_squared();
    let u = 1.0 - t;
    let (uu, tt) = (u * u, t * t);
    let (mut term_a, mut term_b) = (u, t);
    let (mut weight_a, mut weight_b) = (u, t);
    for i in 1..=26 {
        let n = i as f32;
        let k = d / (n * (2.0 * n + 1.0));
        term_a *= (n * n - uu) * k;
        term_b *= (n * n - tt) * k;
        weight_a += term_a;
        weight_b += term_b;
        // The sum of all further terms is at most twice this term for d ≤ 1.
        if term_a.max(term_b) < 3e-8 {
            break;
        }
    }
    a * weight_a + b * weight_b
}

/// The straight line, back at unit length.
pub fn nlerp(a: Quat, b: Quat, t: f32) -> Quat {
    (a * (1.0 - t) + b * t).normalize()
}

/// nlerp at a time bent by a cubic, so that it keeps slerp's speed (A. Kapoulkine, "Approximating slerp", 2015, the
/// coefficients of its `onlerp`, fitted for arcs of up to 180°).
pub(crate) fn nlerp_corrected(a: Quat, b: Quat, t: f32) -> Quat {
    let d = a.dot(b).abs();
    let fit_a = 1.0904 + d * (-3.2452 + d * (3.55645 - d * 1.43519));
    let fit_b = 0.848013 + d * (-1.06021 + d * 0.215638);
    let k = fit_a * (t - 0.5) * (t - 0.5) + fit_b;
    nlerp(a, b, t + t * (t - 0.5) * (t - 1.0) * k)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::truth;
    use glam::Vec3;

    /// Worst error in degrees at one distance of two rotations.
    fn worst(way: Interpolate, degrees: f32) -> f64 {
        let mut worst = 0.0f64;
        for axis in [Vec3::X, Vec3::new(0.6, 0.0, 0.8), Vec3::splat(0.57735026)] {
            let a = Quat::from_rotation_z(0.7);
            let b = Quat::from_axis_angle(axis.normalize(), degrees.to_radians()) * a;
            for i in 0..=32 {
                let t = i as f32 / 32.0;
                let exact = truth::slerp(a.as_dquat().normalize(), b.as_dquat().normalize(), f64::from(t));
                worst = worst.max(truth::angle_between(way(a, b, t).as_dquat(), exact).to_degrees());
            }
        }
        worst
    }

    #[test]
    fn each_way_is_as_exact_as_it_is_said_to_be() {
        for degrees in [1.0, 20.0, 90.0, 150.0, 179.0] {
            assert!(worst(slerp, degrees) < 2e-3, "{degrees}°");
            assert!(worst(slerp_series, degrees) < 5e-5, "{degrees}°: {}", worst(slerp_series, degrees));
            assert!(worst(nlerp_corrected, degrees) < 0.1, "{degrees}°: {}", worst(nlerp_corrected, degrees));
        }
        assert!((0.8..1.0).contains(&worst(nlerp, 90.0)));
    }
}
