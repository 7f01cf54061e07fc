//! Samples one curve in f64, by the formulas of glTF 2.0 (Appendix C): for accumulated values, which would drift in f32.

use crate::clip::key_search::find_interval;
use crate::clip::{Curve, Interpolation, Path};
use crate::math::rotation::slerp_sum;
use crate::time::Time;
use glam::{DQuat, DVec4};

/// The first four components, at most, of a curve at a time; rotations are normalized.
pub(crate) fn curve_at(curve: &Curve, time: Time) -> [f64; 4] {
    let at = find_interval(&curve.times, time);
    let (width, stride) = (curve.path.width(), curve.stride());
    let cubic = curve.interpolation == Interpolation::CubicSpline;
    let part = |key: usize, part: usize| -> [f64; 4] {
        let from = key * stride + part * width;
        std::array::from_fn(|i| if i < width { f64::from(curve.values[from + i]) } else { 0.0 })
    };
    let value = |key: usize| part(key, usize::from(cubic));
    let (a, b) = (value(at.key), value(at.next));
    // The fraction in f64, from the exact times: `at` holds it as f32.
    let span = curve.times[at.next] - curve.times[at.key];
    let s = if span > Time::ZERO { (time - curve.times[at.key]).0 as f64 / span.0 as f64 } else { 0.0 };
    let interpolated = match curve.interpolation {
        _ if at.next == at.key => a,
        Interpolation::Step => a,
        Interpolation::Linear if curve.path == Path::Rotation => {
            slerp_sum(normalize_or_identity(a).into(), normalize_or_identity(b).into(), s).to_array()
        }
        Interpolation::Linear => std::array::from_fn(|i| a[i] + (b[i] - a[i]) * s),
        Interpolation::CubicSpline => {
            let (out, into, secs) = (part(at.key, 2), part(at.next, 0), span.as_secs());
            let (s2, s3) = (s * s, s * s * s);
            std::array::from_fn(|i| {
                (2.0 * s3 - 3.0 * s2 + 1.0) * a[i]
                    + secs * (s3 - 2.0 * s2 + s) * out[i]
                    + (3.0 * s2 - 2.0 * s3) * b[i]
                    + secs * (s3 - s2) * into[i]
            })
        }
    };
    if curve.path == Path::Rotation { normalize_or_identity(interpolated) } else { interpolated }
}

fn normalize_or_identity(q: [f64; 4]) -> [f64; 4] {
    let q = DVec4::from_array(q);
    if q.length_squared() > 0.0 { (q / q.length()).to_array() } else { DQuat::IDENTITY.to_array() }
}
