//! Key reduction: LINEAR keys that follow from the others are left out, within a stated distance of any joint in model space.
//!
//! A key of a joint moves all that hangs below it, so that what it may be off is the tolerance over the distance to the farthest joint
//! below, shared out over the joints above each other. Then the whole clip is compared with its source in model space, at all keys
//! and halfway between, and done again with less where that is not within the tolerance. The result's error is what was measured.

use crate::clip::sample::Sample;
use crate::clip::{Clip, Curve, Interpolation, Path};
use crate::pose::Pose;
use crate::skeleton::Skeleton;
use crate::skeleton::model_rest_pose::ModelRestPose;
use crate::time::Time;
use glam::{DAffine3, DQuat, DVec3};
use std::sync::Arc;

/// Whether curves that share key times keep sharing them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum KeptTimes {
    /// Whatever takes the fewest bytes: each curve keeps keys at times of its own, or shared ones, or all.
    #[default]
    Fewest,
    /// Curves that share their key times keep the same ones: sampled fastest.
    Shared,
    /// Each curve keeps keys at times of its own.
    Own,
}

/// Result of a reduction. Errors are in metres of the model, of any joint's position and of a point 10 cm from it along each axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReductionReport {
    pub keys: [usize; 2],
    /// Bytes of key times and values, before and after; times that curves share count once.
    pub bytes: [usize; 2],
    pub worst_m: f64,
}

#[derive(Clone, Debug, PartialEq)]
pub enum ReduceError {
    Tolerance(f64),
    Joints { clip: String, joints: usize, expected: usize },
}

impl std::fmt::Display for ReduceError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            ReduceError::Tolerance(tolerance) => {
                write!(f, "the tolerance of {tolerance} m must be from 0 m to 1 m")
            }
            ReduceError::Joints { clip, joints, expected } => {
                write!(f, "the clip \"{clip}\" is of {joints} joints, the skeleton of {expected}")
            }
        }
    }
}

impl std::error::Error for ReduceError {}

/// A point that turns with a joint is at least this far from it, metres: fingertips and a hat also turn.
const SHELL: f64 = 0.1;

/// How often the tolerances of single curves are lowered.
const ROUNDS: usize = 12;

impl Clip {
    /// The clip with fewer keys. STEP, CUBICSPLINE and morph weights stay as authored.
    pub fn reduced(
        &self,
        skeleton: &Skeleton,
        tolerance_m: f64,
        keep: KeptTimes,
    ) -> Result<(Clip, ReductionReport), ReduceError> {
        if !(0.0..=1.0).contains(&tolerance_m) {
            return Err(ReduceError::Tolerance(tolerance_m));
        }
        if self.joint_count() != skeleton.len() {
            let (joints, expected) = (self.joint_count(), skeleton.len());
            return Err(ReduceError::Joints { clip: self.name.clone(), joints, expected });
        }
        let reach = Reach::of(skeleton);
        let ways: &[bool] = match keep {
            KeptTimes::Shared => &[true],
            KeptTimes::Own => &[false],
            KeptTimes::Fewest => &[false, true],
        };
        let reduced =
            ways.iter().filter_map(|shared| self.reduced_by(skeleton, &reach, tolerance_m, *shared));
        let all = ReductionReport { keys: [self.keys(); 2], bytes: [bytes(self); 2], worst_m: 0.0 };
        // Times of a curve's own take as many bytes as three numbers; where few keys go, all of them take less.
        let smaller = reduced.filter(|(_, report)| report.bytes[1] < report.bytes[0]);
        Ok(smaller.min_by_key(|(_, report)| report.bytes[1]).unwrap_or_else(|| (self.clone(), all)))
    }

    /// `shared`: curves of equal key times keep the same keys.
    fn reduced_by(
        &self,
        skeleton: &Skeleton,
        reach: &Reach,
        tolerance_m: f64,
        shared: bool,
    ) -> Option<(Clip, ReductionReport)> {
        let mut share = 0.5;
        for _ in 0..ROUNDS {
            let clip = self.without_keys(reach, tolerance_m * share, shared);
            let worst_m = distance(skeleton, self, &clip, usize::MAX);
            if worst_m <= tolerance_m {
                let (keys, bytes) = ([self.keys(), clip.keys()], [bytes(self), bytes(&clip)]);
                return Some((clip, ReductionReport { keys, bytes, worst_m }));
            }
            share *= 0.5;
        }
        None
    }

    /// Keys of all curves.
    pub fn keys(&self) -> usize {
        self.curves().iter().map(|c| c.times.len()).sum()
    }

    fn without_keys(&self, reach: &Reach, tolerance_m: f64, shared: bool) -> Clip {
        let allowed = |curve: &Curve| {
            let joint = curve.joint as usize;
            match curve.path {
                Path::Rotation => tolerance_m / reach.distance[joint],
                Path::Scale => tolerance_m / reach.distance[joint],
                _ => tolerance_m / reach.unit[joint],
            }
        };
        let linear = |curve: &Curve| {
            curve.interpolation == Interpolation::Linear && !matches!(curve.path, Path::Weights(_))
        };
        let mut curves = self.curves().to_vec();
        if !shared {
            for curve in curves.iter_mut().filter(|c| linear(c)) {
                let kept = kept(&[(curve, allowed(curve))]);
                *curve = with_keys(curve, &kept, None);
            }
        } else {
            let mut done = vec![false; curves.len()];
            for first in 0..curves.len() {
                if done[first] || !linear(&curves[first]) {
                    continue;
                }
                let times = curves[first].times.clone();
                let group: Vec<usize> = (first..curves.len())
                    .filter(|i| linear(&curves[*i]) && curves[*i].times == times)
                    .collect();
                let members: Vec<(&Curve, f64)> =
                    group.iter().map(|i| (&curves[*i], allowed(&curves[*i]))).collect();
                let kept = kept(&members);
                let times: Arc<[Time]> = kept.iter().map(|k| times[*k]).collect();
                let reduced: Vec<Curve> =
                    group.iter().map(|i| with_keys(&curves[*i], &kept, Some(times.clone()))).collect();
                for (i, curve) in group.into_iter().zip(reduced) {
                    curves[i] = curve;
                    done[i] = true;
                }
            }
        }
        self.with_curves(self.joint_count(), curves).with_duration(self.duration)
    }
}

/// The effect of a joint's error on positions in the model.
pub(crate) struct Reach {
    /// Metres to the farthest joint below it, at rest, and [`SHELL`].
    pub distance: Vec<f64>,
    /// Metres of its parent's unit.
    pub unit: Vec<f64>,
}

impl Reach {
    pub fn of(skeleton: &Skeleton) -> Reach {
        let rest = ModelRestPose::of(skeleton);
        let mut distance = vec![0.0f64; skeleton.len()];
        for joint in (0..skeleton.len()).rev() {
            if let Some(parent) = skeleton.parents()[joint] {
                let bone = (rest.positions[joint] - rest.positions[parent as usize]).length();
                let far = bone + distance[joint];
                let above = &mut distance[parent as usize];
                *above = above.max(far);
            }
        }
        distance.iter_mut().for_each(|d| *d += SHELL);
        let unit = |parent: &Option<u32>| parent.map_or(1.0, |p| rest.scales[p as usize]).max(1e-9);
        Reach { distance, unit: skeleton.parents().iter().map(unit).collect() }
    }
}

/// Indices of the keys that stay: greedily the longest way to the next that keeps all between within each curve's tolerance.
fn kept(curves: &[(&Curve, f64)]) -> Vec<usize> {
    let Some((first, _)) = curves.first() else { return Vec::new() };
    let last = first.times.len() - 1;
    if curves.iter().all(|(curve, allowed)| fits(curve, 0, last, *allowed) && rests(curve, *allowed)) {
        return vec![0];
    }
    let all_fit =
        |from: usize, to: usize| curves.iter().all(|(curve, allowed)| fits(curve, from, to, *allowed));
    let mut kept = vec![0];
    let mut at = 0;
    while at < last {
        // Doubling, then halving: few looks along a long way.
        let mut good = at + 1;
        let mut step = 2;
        while at + step <= last && all_fit(at, at + step) {
            good = at + step;
            step *= 2;
        }
        let mut bad = (at + step).min(last + 1);
        while bad - good > 1 {
            let middle = good + (bad - good) / 2;
            if all_fit(at, middle) { good = middle } else { bad = middle }
        }
        kept.push(good);
        at = good;
    }
    kept
}

/// Whether the first key alone determines the curve.
fn rests(curve: &Curve, allowed: f64) -> bool {
    (0..curve.times.len()).all(|key| apart(curve, &value(curve, 0), key) <= allowed)
}

/// Whether all keys between two are within the tolerance of what lies between these.
fn fits(curve: &Curve, from: usize, to: usize, allowed: f64) -> bool {
    let (a, b) = (value(curve, from), value(curve, to));
    let (start, span) = (curve.times[from], (curve.times[to] - curve.times[from]).0 as f64);
    (from + 1..to).all(|key| {
        let t = (curve.times[key] - start).0 as f64 / span;
        apart(curve, &between(curve.path, &a, &b, t), key) <= allowed
    })
}

fn value(curve: &Curve, key: usize) -> [f64; 4] {
    let width = curve.path.width().min(4);
    let mut out = [0.0; 4];
    for (out, v) in out.iter_mut().zip(&curve.values[key * curve.path.width()..][..width]) {
        *out = f64::from(*v);
    }
    out
}

fn between(path: Path, a: &[f64; 4], b: &[f64; 4], t: f64) -> [f64; 4] {
    match path {
        Path::Rotation => DQuat::from_array(*a).slerp(DQuat::from_array(*b), t).to_array(),
        _ => [0, 1, 2, 3].map(|i| a[i] + (b[i] - a[i]) * t),
    }
}

/// Radians, metres or factors between a value and a key.
fn apart(curve: &Curve, value_there: &[f64; 4], key: usize) -> f64 {
    let own = value(curve, key);
    let sum = |sign: f64| (0..4).map(|i| own[i] - sign * value_there[i]).map(|d| d * d).sum::<f64>().sqrt();
    match curve.path {
        Path::Rotation => 4.0 * libm::asin((sum(1.0).min(sum(-1.0)) / 2.0).min(1.0)),
        _ => sum(1.0),
    }
}

fn with_keys(curve: &Curve, kept: &[usize], times: Option<Arc<[Time]>>) -> Curve {
    if kept.len() == curve.times.len() {
        return curve.clone();
    }
    let times = times.unwrap_or_else(|| kept.iter().map(|k| curve.times[*k]).collect());
    let width = curve.path.width();
    let values = kept.iter().flat_map(|k| curve.values[k * width..][..width].iter().copied()).collect();
    Curve { times, values, ..curve.clone() }
}

/// Bytes of the key times and values that are stored uncompressed.
pub(crate) fn bytes(clip: &Clip) -> usize {
    let mut seen = std::collections::BTreeSet::new();
    let of = |curve: &Curve| {
        let own = seen.insert(curve.times.as_ptr() as usize);
        curve.values.len() * 4 + if own { curve.times.len() * 8 } else { 0 }
    };
    clip.stored_curves().iter().map(of).sum()
}

/// The farthest of [`distances`].
fn distance(skeleton: &Skeleton, a: &Clip, b: &Clip, most: usize) -> f64 {
    distances(skeleton, a, b, most).into_iter().fold(0.0, f64::max)
}

/// Farthest that each joint, or a point that turns with it, is apart in two clips: at all keys of the first and halfway between, evenly
/// chosen where that is more often than `most`.
pub(crate) fn distances(skeleton: &Skeleton, a: &Clip, b: &Clip, most: usize) -> Vec<f64> {
    let mut times: Vec<Time> = a.curves().iter().flat_map(|c| c.times.iter().copied()).collect();
    times.sort_unstable();
    times.dedup();
    let middles: Vec<Time> = times.windows(2).map(|w| Time(w[0].0 + (w[1].0 - w[0].0) / 2)).collect();
    times.extend(middles);
    times.sort_unstable();
    let every = times.len().div_ceil(most.max(1)).max(1);
    let mut pose = Pose::rest(skeleton);
    let mut model = |clip: &Clip, time: Time| -> Vec<DAffine3> {
        for (joint, rest) in skeleton.rest().iter().enumerate() {
            pose.set(joint, *rest);
        }
        Sample { clip, time, pose: &mut pose }.run();
        let mut matrices: Vec<DAffine3> = Vec::with_capacity(skeleton.len());
        for (joint, local) in pose.iter().enumerate() {
            let (s, r, t) = (
                local.scale.as_dvec3(),
                crate::math::rotation::unit(local.rotation.as_dquat()),
                local.translation.as_dvec3(),
            );
            let own = DAffine3::from_scale_rotation_translation(s, r, t);
            matrices.push(skeleton.parents()[joint].map_or(own, |p| matrices[p as usize] * own));
        }
        matrices
    };
    let rest = ModelRestPose::of(skeleton);
    let mut worst = vec![0.0f64; skeleton.len()];
    for time in times.into_iter().step_by(every) {
        let (one, other) = (model(a, time), model(b, time));
        for (joint, (one, other)) in one.iter().zip(&other).enumerate() {
            let arm = SHELL / rest.scales[joint].max(1e-9);
            for point in [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z] {
                let at = |m: &DAffine3| m.transform_point3(point * arm);
                worst[joint] = worst[joint].max((at(one) - at(other)).length());
            }
        }
    }
    worst
}
