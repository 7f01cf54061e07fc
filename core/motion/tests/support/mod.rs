//! Independent f64 evaluation of curves (glTF 2.0 §3.11 and Appendix C, written from the text), and random clips.
#![allow(dead_code, reason = "each test file uses a part")]

mod random;
pub(crate) mod skinned_mesh;

use choreo_motion::{Curve, Interpolation, Path, Skeleton, Time, Transform};
use glam::{DAffine3, DQuat, DVec3, Quat, Vec3};
pub(crate) use random::Random;

pub(crate) fn times(secs: &[f64]) -> std::sync::Arc<[Time]> {
    secs.iter().map(|s| Time::from_secs(*s)).collect()
}

pub(crate) fn curve(
    joint: u32,
    path: Path,
    interpolation: Interpolation,
    secs: &[f64],
    values: &[f32],
) -> Curve {
    Curve { joint, path, interpolation, times: times(secs), values: values.into() }
}

/// f64 slerp with trigonometry, along the shorter arc.
pub(crate) fn slerp(a: [f64; 4], b: [f64; 4], t: f64) -> [f64; 4] {
    let dot: f64 = (0..4).map(|i| a[i] * b[i]).sum();
    let sign = if dot < 0.0 { -1.0 } else { 1.0 };
    // Kahan's angle, exact where acos is not.
    let diff: f64 = (0..4).map(|i| (a[i] - sign * b[i]).powi(2)).sum::<f64>().sqrt();
    let sum: f64 = (0..4).map(|i| (a[i] + sign * b[i]).powi(2)).sum::<f64>().sqrt();
    let angle = 2.0 * diff.atan2(sum);
    let (wa, wb) = if angle < 1e-9 {
        (1.0 - t, t)
    } else {
        (((1.0 - t) * angle).sin() / angle.sin(), (t * angle).sin() / angle.sin())
    };
    unit([0, 1, 2, 3].map(|i| wa * a[i] + wb * sign * b[i]))
}

pub(crate) fn unit(q: [f64; 4]) -> [f64; 4] {
    let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    q.map(|c| c / length)
}

/// A curve at a time, in f64 from its keys, by linear search.
pub(crate) fn evaluate(curve: &Curve, time: Time) -> Vec<f64> {
    let width = curve.path.width();
    let cubic = curve.interpolation == Interpolation::CubicSpline;
    let stride = if cubic { 3 * width } else { width };
    let part = |key: usize, at: usize| -> Vec<f64> {
        let from = key * stride + if cubic { at * width } else { 0 };
        curve.values[from..from + width].iter().map(|v| f64::from(*v)).collect()
    };
    let last = curve.times.len() - 1;
    let value = |key: usize| part(key, 1);
    let rotation = curve.path == Path::Rotation;
    let finish = |v: Vec<f64>| if rotation { unit(v.try_into().unwrap()).to_vec() } else { v };
    if time <= curve.times[0] {
        return finish(value(0));
    }
    if time >= curve.times[last] {
        return finish(value(last));
    }
    let mut key = 0;
    while curve.times[key + 1] <= time {
        key += 1;
    }
    let span = (curve.times[key + 1].0 - curve.times[key].0) as f64;
    let t = (time.0 - curve.times[key].0) as f64 / span;
    let (a, b) = (value(key), value(key + 1));
    match curve.interpolation {
        Interpolation::Step => finish(a),
        Interpolation::Linear if rotation => {
            slerp(unit(a.try_into().unwrap()), unit(b.try_into().unwrap()), t).to_vec()
        }
        Interpolation::Linear => (0..width).map(|i| (1.0 - t) * a[i] + t * b[i]).collect(),
        Interpolation::CubicSpline => {
            let td = span / Time::TICKS_PER_SECOND as f64;
            let (out, into) = (part(key, 2), part(key + 1, 0));
            let (t2, t3) = (t.powi(2), t.powi(3));
            finish(
                (0..width)
                    .map(|i| {
                        (2.0 * t3 - 3.0 * t2 + 1.0) * a[i]
                            + td * (t3 - 2.0 * t2 + t) * out[i]
                            + (-2.0 * t3 + 3.0 * t2) * b[i]
                            + td * (t3 - t2) * into[i]
                    })
                    .collect(),
            )
        }
    }
}

/// Angle between two rotations in degrees, f64.
pub(crate) fn degrees_between(a: [f64; 4], b: [f64; 4]) -> f64 {
    let (a, b) = (unit(a), unit(b));
    let dot: f64 = (0..4).map(|i| a[i] * b[i]).sum();
    let sign = if dot < 0.0 { -1.0 } else { 1.0 };
    let diff: f64 = (0..4).map(|i| (a[i] - sign * b[i]).powi(2)).sum::<f64>().sqrt();
    let sum: f64 = (0..4).map(|i| (a[i] + sign * b[i]).powi(2)).sum::<f64>().sqrt();
    (4.0 * diff.atan2(sum)).to_degrees()
}

pub(crate) fn quat64(q: Quat) -> [f64; 4] {
    q.to_array().map(f64::from)
}

/// A chain of `joints`, or a tree where `random` picks parents.
pub(crate) fn skeleton(joints: usize, mut random: Option<&mut Random>) -> Skeleton {
    let names = (0..joints).map(|i| format!("joint{i}")).collect();
    let parents = (0..joints)
        .map(|i| match &mut random {
            _ if i == 0 => None,
            Some(random) => Some(random.below(i) as u32),
            None => Some(i as u32 - 1),
        })
        .collect();
    let rest = (0..joints)
        .map(|i| Transform {
            translation: Vec3::new(0.01 * i as f32, 0.1, -0.02),
            rotation: Quat::from_xyzw(0.0, 0.0, 0.6, 0.8),
            scale: Vec3::ONE,
        })
        .collect();
    Skeleton::new(names, parents, rest).unwrap()
}

/// Keys of any path and interpolation at given times.
pub(crate) fn random_curve(
    random: &mut Random,
    joint: u32,
    path: Path,
    interpolation: Interpolation,
    times: std::sync::Arc<[Time]>,
) -> Curve {
    let mut values = Vec::new();
    for _ in 0..times.len() {
        let cubic = interpolation == Interpolation::CubicSpline;
        for part in 0..if cubic { 3 } else { 1 } {
            if path == Path::Rotation && (part == 1 || !cubic) {
                values.extend(random.rotation());
            } else {
                values.extend((0..path.width()).map(|_| random.signed()));
            }
        }
    }
    Curve { joint, path, interpolation, times, values: values.into() }
}

/// f64 model-space matrices.
pub(crate) fn model64(skeleton: &Skeleton, locals: &[(DVec3, DQuat, DVec3)]) -> Vec<DAffine3> {
    let mut out: Vec<DAffine3> = Vec::new();
    for (joint, (t, r, s)) in locals.iter().enumerate() {
        let local = DAffine3::from_scale_rotation_translation(*s, *r, *t);
        let parent = skeleton.parents()[joint].map(|p| out[p as usize]);
        out.push(parent.map_or(local, |p| p * local));
    }
    out
}
