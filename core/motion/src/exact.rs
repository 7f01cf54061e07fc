//! One curve at a time in f64, by the formulas of glTF 2.0 (Appendix C): for what is accumulated, where f32 would drift.

use crate::timeline::find_interval;
use crate::{Curve, Interpolation, Path, Time};
use glam::{DQuat, DVec4};

/// The first components of a curve at a time, four at most; rotations at unit length.
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
    let mixed = match curve.interpolation {
        _ if at.next == at.key => a,
        Interpolation::Step => a,
        Interpolation::Linear if curve.path == Path::Rotation => return slerp(a, b, s),
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
    if curve.path == Path::Rotation { unit(mixed) } else { mixed }
}

fn unit(q: [f64; 4]) -> [f64; 4] {
    let q = DVec4::from_array(q);
    if q.length_squared() > 0.0 { (q / q.length()).to_array() } else { DQuat::IDENTITY.to_array() }
}

/// Shortest-arc slerp, exact to f64 at every angle.
fn slerp(a: [f64; 4], b: [f64; 4], s: f64) -> [f64; 4] {
    let (a, mut b) = (DVec4::from_array(unit(a)), DVec4::from_array(unit(b)));
    if a.dot(b) < 0.0 {
        b = -b;
    }
    let angle = 2.0 * libm::atan2((a - b).length(), (a + b).length());
    let sin = libm::sin(angle);
    let mixed = if sin > 1e-12 {
        a * (libm::sin((1.0 - s) * angle) / sin) + b * (libm::sin(s * angle) / sin)
    } else {
        a + (b - a) * s
    };
    unit(mixed.to_array())
}
