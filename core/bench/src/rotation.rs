//! Methods of interpolating rotations, in f32, eight pairs at once, to compare their errors and times. All are loops over eight numbers,
//! which compilers turn into vector instructions, as with [`choreo_motion::Sample`] on `Level::Portable`.

use glam::Quat;

pub type Eight = [f32; 8];
/// Eight quaternions as rows of x, y, z and w.
pub type Rotations = [Eight; 4];

/// A method that interpolates eight pairs at one time. The second quaternion of a pair lies in the hemisphere of the first.
pub type Interpolate = fn(&Rotations, &Rotations, f32) -> Rotations;

/// Name and function of each method.
pub const METHODS: [(&str, Interpolate); 4] = [
    ("slerp, sines by polynomials", slerp),
    ("slerp, power series of 26 terms", slerp_series),
    ("nlerp, corrected", nlerp_corrected),
    ("nlerp", nlerp),
];

/// The rotations as rows.
pub fn rows(quats: &[Quat; 8]) -> Rotations {
    std::array::from_fn(|row| std::array::from_fn(|lane| quats[lane].to_array()[row]))
}

/// One of the eight rotations.
pub fn lane(rows: &Rotations, lane: usize) -> Quat {
    Quat::from_array(rows.map(|row| row[lane]))
}

#[inline(always)]
fn from_lanes(of: impl Fn(usize) -> f32) -> Eight {
    std::array::from_fn(of)
}

#[inline(always)]
fn dot(a: &Rotations, b: &Rotations) -> Eight {
    from_lanes(|i| (a[0][i] * b[0][i] + a[1][i] * b[1][i]) + (a[2][i] * b[2][i] + a[3][i] * b[3][i]))
}

/// Weighted sum of two, with a weight per lane.
#[inline(always)]
fn weighted_sum(a: &Rotations, of_a: &Eight, b: &Rotations, of_b: &Eight) -> Rotations {
    std::array::from_fn(|row| from_lanes(|i| a[row][i] * of_a[i] + b[row][i] * of_b[i]))
}

/// Normalizes the quaternions.
#[inline(always)]
pub fn unit(q: &Rotations) -> Rotations {
    let squared = dot(q, q);
    let scale = from_lanes(|i| 1.0 / squared[i].sqrt());
    std::array::from_fn(|row| from_lanes(|i| q[row][i] * scale[i]))
}

/// 1 − cos θ of each pair, from the difference instead of the dot product, which keeps the digits of small angles.
#[inline(always)]
fn one_minus_cos(a: &Rotations, b: &Rotations) -> Eight {
    let difference: Rotations = std::array::from_fn(|row| from_lanes(|i| b[row][i] - a[row][i]));
    let squared = dot(&difference, &difference);
    from_lanes(|i| 0.5 * squared[i])
}

#[inline(always)]
fn polynomial(coefficients: &[f32], x: f32) -> f32 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// asin(√y) / √y for y up to ½, within 3e-9.
const ARC_SINE: [f32; 9] = [
    1.0,
    0.166_666_14,
    0.075_027_57,
    0.044_091_616,
    0.035_814_25,
    -0.007_020_624,
    0.107_400_14,
    -0.135_916_42,
    0.123_913_58,
];
/// sin(√y) / √y for y up to (π/2)², within 5e-9.
const SINE: [f32; 5] = [1.0, -0.166_666_58, 0.008_333_05, -0.000_198_090_11, 2.605_093e-6];

/// The textbook formula, sin((1 − t) θ) / sin θ, without its division of 0 by 0: θ comes from half of the chord, and all sines are divided
/// by their angles.
pub fn slerp(a: &Rotations, b: &Rotations, t: f32) -> Rotations {
    let d = one_minus_cos(a, b);
    let u = 1.0 - t;
    let squared = from_lanes(|i| {
        let y = 0.5 * d[i];
        let half = polynomial(&ARC_SINE, y);
        4.0 * y * half * half
    });
    let weight = |share: f32| {
        from_lanes(|i| share * polynomial(&SINE, share * share * squared[i]) / polynomial(&SINE, squared[i]))
    };
    unit(&weighted_sum(a, &weight(u), b, &weight(t)))
}

/// Eberly's series in d = 1 − cos θ ("A Fast and Accurate Algorithm for Computing SLERP", 2011, eq. 8), with as many terms as f32 needs for
/// turns of 180°. `choreo_motion::Sample` knows the distance of its keys, and takes fewer terms.
pub fn slerp_series(a: &Rotations, b: &Rotations, t: f32) -> Rotations {
    const TERMS: usize = 26;
    let d = one_minus_cos(a, b);
    let u = 1.0 - t;
    let mut factors = [[u, t]; TERMS + 1];
    for n in 1..=TERMS {
        let (square, scale) = ((n * n) as f32, 1.0 / (n * (2 * n + 1)) as f32);
        factors[n] =
            [(square - u * u) * scale * factors[n - 1][0], (square - t * t) * scale * factors[n - 1][1]];
    }
    let weight = |which: usize| {
        let mut sum = [factors[TERMS][which]; 8];
        for n in (0..TERMS).rev() {
            sum = from_lanes(|i| sum[i] * d[i] + factors[n][which]);
        }
        sum
    };
    weighted_sum(a, &weight(0), b, &weight(1))
}

/// Normalized linear interpolation (nlerp).
pub fn nlerp(a: &Rotations, b: &Rotations, t: f32) -> Rotations {
    unit(&weighted_sum(a, &[1.0 - t; 8], b, &[t; 8]))
}

/// Corrected nlerp: a cubic remaps `t`, so that the speed is that of slerp (A. Kapoulkine, "Approximating slerp", 2015, with the
/// coefficients of its `onlerp`, fitted for arcs of up to 180°).
pub(crate) fn nlerp_corrected(a: &Rotations, b: &Rotations, t: f32) -> Rotations {
    let d = dot(a, b);
    let bent = from_lanes(|i| {
        let d = d[i].abs();
        let fit_a = 1.0904 + d * (-3.2452 + d * (3.55645 - d * 1.43519));
        let fit_b = 0.848013 + d * (-1.06021 + d * 0.215638);
        let k = fit_a * (t - 0.5) * (t - 0.5) + fit_b;
        t + t * (t - 0.5) * (t - 1.0) * k
    });
    unit(&weighted_sum(a, &from_lanes(|i| 1.0 - bent[i]), b, &bent))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference;
    use glam::Vec3;

    /// Worst error in degrees at one distance of two rotations; the lanes have different axes.
    fn worst_error_degrees(method: Interpolate, degrees: f32) -> f64 {
        let a = [Quat::from_rotation_z(0.7); 8];
        let b = std::array::from_fn(|i| {
            let axis = [Vec3::X, Vec3::new(0.6, 0.0, 0.8), Vec3::splat(0.57735026)][i % 3];
            Quat::from_axis_angle(axis.normalize(), degrees.to_radians()) * a[i]
        });
        let mut worst = 0.0f64;
        for step in 0..=32 {
            let t = step as f32 / 32.0;
            let got = method(&rows(&a), &rows(&b), t);
            for i in 0..8 {
                let exact =
                    reference::slerp(a[i].as_dquat().normalize(), b[i].as_dquat().normalize(), f64::from(t));
                worst = worst.max(reference::angle_between(lane(&got, i).as_dquat(), exact).to_degrees());
            }
        }
        worst
    }

    #[test]
    fn each_method_is_within_its_stated_error() {
        for degrees in [0.0, 1e-4, 1.0, 20.0, 90.0, 150.0, 179.0] {
            assert!(
                worst_error_degrees(slerp, degrees) < 5e-5,
                "{degrees}°: {}",
                worst_error_degrees(slerp, degrees)
            );
            assert!(
                worst_error_degrees(slerp_series, degrees) < 5e-5,
                "{degrees}°: {}",
                worst_error_degrees(slerp_series, degrees)
            );
            assert!(
                worst_error_degrees(nlerp_corrected, degrees) < 0.1,
                "{degrees}°: {}",
                worst_error_degrees(nlerp_corrected, degrees)
            );
        }
        assert!((0.8..1.0).contains(&worst_error_degrees(nlerp, 90.0)));
    }
}
