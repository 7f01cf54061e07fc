//! Transform parts with the same key times become curves of a clip: linear where a line is close enough, else cubic with exact slopes,
//! with added keys where a cubic is not close enough.

use crate::file::Accuracy;
use crate::joined::{RotationCache, TransformPart};
use crate::keys::{Blend, Keys, simplify_keys};
use choreo_motion::{Interpolation, Path, Time};

/// Parts of one interval between two keys of the file, at most.
const MAX_PARTS: i64 = 4096;

/// Share of the tolerance for the cubics against the file's curves, and the same for lines against the cubics. The rest is for
/// weighted tangents.
const CURVE_ERROR_SHARE: f64 = 0.4;

/// Value at a key, and slopes before and after it in units a second.
#[derive(Clone, Copy)]
struct Key {
    before: [f64; 4],
    value: [f64; 4],
    after: [f64; 4],
}

/// Number of parts into which each interval is cut, so that the member that needs most is close enough.
pub(crate) fn part_counts(members: &[TransformPart<'_>], accuracy: Accuracy) -> Vec<u32> {
    let Some(first) = members.first() else { return Vec::new() };
    let mut out = vec![1; first.curves.intervals.len()];
    for (interval, parts) in out.iter_mut().enumerate() {
        let (from, to) = first.curves.intervals[interval];
        let needed = match accuracy.rate {
            Some(rate) => (to - from).as_secs() * rate - 1e-3,
            None => {
                let errors =
                    members.iter().map(|m| m.cubic_error(interval) / path_tolerance(m.path, accuracy));
                let most = errors.fold(0.0, |a: f64, b| if b > a { b } else { a });
                // The error of a cubic falls with the fourth power of the number of parts.
                (most / CURVE_ERROR_SHARE).sqrt().sqrt()
            }
        };
        let most = (to.0 - from.0).clamp(1, MAX_PARTS) as f64;
        *parts = needed.ceil().clamp(1.0, most) as u32;
    }
    out
}

fn path_tolerance(path: Path, accuracy: Accuracy) -> f64 {
    match path {
        Path::Rotation => accuracy.radians,
        Path::Scale => accuracy.scale,
        _ => accuracy.metres,
    }
}

/// Key times of the divided intervals. No part is shorter than a tick.
pub(crate) fn key_times(intervals: &[(Time, Time)], parts: &[u32]) -> Vec<Time> {
    let mut out: Vec<Time> = Vec::with_capacity(parts.iter().map(|n| *n as usize + 1).sum());
    for ((from, to), parts) in intervals.iter().zip(parts) {
        if out.last() != Some(from) {
            out.push(*from);
        }
        out.extend((1..=*parts).map(|k| part_time(*from, *to, k, *parts)));
    }
    out
}

fn part_time(from: Time, to: Time, k: u32, parts: u32) -> Time {
    Time(from.0 + ((to.0 - from.0) as i128 * i128::from(k) / i128::from(parts)) as i64)
}

/// The keys of one member at these times.
pub(crate) fn member_keys(
    member: &TransformPart<'_>,
    parts: &[u32],
    times: &[Time],
    accuracy: Accuracy,
) -> Keys {
    let mut latest = RotationCache::default();
    let key_intervals = KeyIntervals { intervals: &member.curves.intervals, parts, times };
    let tolerance = path_tolerance(member.path, accuracy);
    spline_keys(key_intervals, member.path, tolerance, accuracy, |i, u| member.at(i, u, &mut latest))
}

/// Intervals without gaps except at jumps, the number of parts of each, and the key times that follow from both.
#[derive(Clone, Copy)]
pub(crate) struct KeyIntervals<'a> {
    pub intervals: &'a [(Time, Time)],
    pub parts: &'a [u32],
    pub times: &'a [Time],
}

/// Keys of any function that gives value and slope within each interval: lines where they stay within `tolerance`, else cubics.
pub(crate) fn spline_keys(
    key_intervals: KeyIntervals<'_>,
    path: Path,
    tolerance: f64,
    accuracy: Accuracy,
    at: impl FnMut(usize, f64) -> ([f64; 4], [f64; 4]),
) -> Keys {
    let KeyIntervals { intervals, parts, times } = key_intervals;
    let keys = evaluate_keys(intervals, parts, at);
    let width = path.width();
    let blend = if path == Path::Rotation { Blend::Rotation } else { Blend::Numbers };
    if accuracy.rate.is_some() || are_lines_close(path, &keys, times, CURVE_ERROR_SHARE * tolerance) {
        let values = keys.iter().flat_map(|k| &k.value[..width]).map(|v| *v as f32).collect();
        return simplify_keys(times.to_vec(), values, width, blend);
    }
    let mut values = Vec::with_capacity(keys.len() * 3 * width);
    for key in &keys {
        for part in [&key.before, &key.value, &key.after] {
            values.extend(part[..width].iter().map(|v| *v as f32));
        }
    }
    Keys { interpolation: Interpolation::CubicSpline, times: times.to_vec(), values }
}

fn evaluate_keys(
    intervals: &[(Time, Time)],
    parts: &[u32],
    mut at: impl FnMut(usize, f64) -> ([f64; 4], [f64; 4]),
) -> Vec<Key> {
    let mut out: Vec<Key> = Vec::with_capacity(parts.iter().map(|n| *n as usize).sum::<usize>() + 1);
    let mut reached = None;
    for (interval, ((from, to), parts)) in intervals.iter().zip(parts).enumerate() {
        let secs = (*to - *from).as_secs();
        for k in 0..=*parts {
            let (value, change) = at(interval, f64::from(k) / f64::from(*parts));
            let slope = change.map(|c| c / secs);
            match out.last_mut() {
                Some(last) if k == 0 && reached == Some(*from) => (last.value, last.after) = (value, slope),
                _ => {
                    let none = [0.0; 4];
                    let before = if k == 0 { none } else { slope };
                    out.push(Key { before, value, after: if k == *parts { none } else { slope } });
                }
            }
        }
        reached = Some(*to);
    }
    out
}

/// Whether lines (arcs for rotations) are close enough to the cubics between all keys. With tangents m, n and chord d, a cubic
/// differs from its line by at most 4/27 (|m − d| + |n − d|).
fn are_lines_close(path: Path, keys: &[Key], times: &[Time], tolerance: f64) -> bool {
    keys.windows(2).zip(times.windows(2)).all(|(k, t)| {
        let secs = (t[1] - t[0]).as_secs();
        // A jump.
        if t[1].0 - t[0].0 <= 1 {
            return true;
        }
        let d: [f64; 4] = std::array::from_fn(|i| k[1].value[i] - k[0].value[i]);
        let off = |slope: &[f64; 4]| {
            let mut e: [f64; 4] = std::array::from_fn(|i| slope[i] * secs - d[i]);
            if path == Path::Rotation {
                // The component along the radius is no error of an arc.
                let middle: [f64; 4] = std::array::from_fn(|i| k[0].value[i] + k[1].value[i]);
                let square = dot(&middle, &middle);
                let along = if square > 0.0 { dot(&e, &middle) / square } else { 0.0 };
                e = std::array::from_fn(|i| e[i] - along * middle[i]);
            }
            dot(&e, &e).sqrt()
        };
        let far = (4.0 / 27.0) * (off(&k[0].after) + off(&k[1].before));
        let far = if path == Path::Rotation { 2.0 * far } else { far };
        far <= tolerance
    })
}

fn dot(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    ((a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]) + a[3] * b[3]
}
