//! Key reduction: LINEAR keys that interpolation of the others reproduces are left out, within a tolerance: the largest distance,
//! in model space, by which any joint may be off.
//!
//! A rotation error of a joint moves all joints below it, so that the tolerance of its keys is the distance tolerance divided by
//! the distance to the farthest joint below. Curves begin with half of that. The whole clip is then compared with its source in
//! model space, at all keys, and reduced again with half the tolerance per curve if it is too far off. The reported error is the
//! measured one. Between two keys of the source, both clips interpolate linearly (slerp) between ends that are this close, so
//! that they are no farther apart there.

use crate::clip::sample::Sample;
use crate::clip::sample_f64::curve_at;
use crate::clip::{Clip, Curve, Interpolation, Path};
use crate::math::rotation::normalize_or_identity;
use crate::math::transform::Transform;
use crate::pose::Pose;
use crate::skeleton::Skeleton;
use crate::skeleton::model_rest_pose::ModelRestPose;
use crate::time::Time;
use glam::{DAffine3, DQuat, DVec3};
use std::sync::Arc;

/// Whether curves that share key times keep sharing them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum KeptTimes {
    /// The smallest of three results: separate key times per curve, shared key times, or all keys.
    #[default]
    Fewest,
    /// Curves that share their key times keep the same keys: sampled fastest.
    Shared,
    /// Each curve has its own key times.
    Own,
}

/// Result of a reduction. Errors are distances in model space, metres, of every joint and of points 10 cm from it along each
/// axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReductionReport {
    /// Keys of all curves, before and after.
    pub keys: [usize; 2],
    /// Bytes of key times and values, before and after; times that curves share count once.
    pub bytes: [usize; 2],
    /// The largest error, metres.
    pub worst_m: f64,
}

/// The reason why keys cannot be reduced; the message has the numbers.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum ReduceError {
    Tolerance(f64),
    Joints { clip: String, joints: usize, expected: usize },
}

crate::error_texts! { ReduceError:
    Self::Tolerance(tolerance) => "the tolerance of {tolerance} m must be from 0 m to 1 m";
    Self::Joints { clip, joints, expected } => "the numbers of joints differ: {joints} in the clip \"{clip}\", {expected} in the skeleton";
}

/// Distance from each joint, metres, of the points at which errors of its rotation are measured: the last joints carry
/// fingertips or a hat.
const POINT_DISTANCE_M: f64 = 0.1;

/// Largest number of attempts; each halves the tolerances of the curves.
const MAX_ROUNDS: usize = 12;

impl Clip {
    /// The clip with fewer keys, or the clip itself if that saves no bytes. STEP, CUBICSPLINE and morph weights stay as authored.
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
        let reach = JointReach::of(skeleton);
        let shared_choices: &[bool] = match keep {
            KeptTimes::Shared => &[true],
            KeptTimes::Own => &[false],
            KeptTimes::Fewest => &[false, true],
        };
        let reduced = shared_choices
            .iter()
            .filter_map(|shared| self.reduced_with_times(skeleton, &reach, tolerance_m, *shared));
        let unchanged_report =
            ReductionReport { keys: [self.keys(); 2], bytes: [key_bytes(self); 2], worst_m: 0.0 };
        // Separate times take 8 bytes per key: if few keys can be left out, keeping all of them takes less.
        let smaller = reduced.filter(|(_, report)| report.bytes[1] < report.bytes[0]);
        Ok(smaller
            .min_by_key(|(_, report)| report.bytes[1])
            .unwrap_or_else(|| (self.clone(), unchanged_report)))
    }

    /// Reduces keys until the measured error is within the tolerance. `shared`: curves with equal key times keep the same keys.
    fn reduced_with_times(
        &self,
        skeleton: &Skeleton,
        reach: &JointReach,
        tolerance_m: f64,
        shared: bool,
    ) -> Option<(Clip, ReductionReport)> {
        let mut share = 0.5;
        for _ in 0..MAX_ROUNDS {
            let clip = self.without_redundant_keys(reach, tolerance_m * share, shared);
            let worst_m = largest_error(skeleton, self, &clip);
            if worst_m <= tolerance_m {
                let (keys, bytes) = ([self.keys(), clip.keys()], [key_bytes(self), key_bytes(&clip)]);
                return Some((clip, ReductionReport { keys, bytes, worst_m }));
            }
            share *= 0.5;
        }
        None
    }

    /// Number of keys of all curves.
    pub fn keys(&self) -> usize {
        self.curves().iter().map(|c| c.times.len()).sum()
    }

    fn without_redundant_keys(&self, reach: &JointReach, tolerance_m: f64, shared: bool) -> Clip {
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
                let kept = kept_keys(&[(curve, allowed(curve))]);
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
                let kept = kept_keys(&members);
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
pub(crate) struct JointReach {
    /// Distance along the bones from each joint to the farthest joint below it, at rest, plus [`POINT_DISTANCE_M`]; metres.
    pub distance: Vec<f64>,
    /// Length of one unit of the parent's space, metres, for each joint.
    pub unit: Vec<f64>,
}

impl JointReach {
    pub(crate) fn of(skeleton: &Skeleton) -> JointReach {
        let rest = ModelRestPose::of(skeleton);
        let mut distance = vec![0.0f64; skeleton.len()];
        for joint in (0..skeleton.len()).rev() {
            if let Some(parent) = skeleton.parents()[joint] {
                let bone = (rest.positions[joint] - rest.positions[parent as usize]).length();
                let reach = bone + distance[joint];
                let above = &mut distance[parent as usize];
                *above = above.max(reach);
            }
        }
        distance.iter_mut().for_each(|d| *d += POINT_DISTANCE_M);
        let unit = |parent: &Option<u32>| parent.map_or(1.0, |p| rest.scales[p as usize]).max(1e-9);
        JointReach { distance, unit: skeleton.parents().iter().map(unit).collect() }
    }
}

/// Indices of the keys that are kept. Each is, greedily, the farthest one with all keys before it within each curve's tolerance.
fn kept_keys(curves: &[(&Curve, f64)]) -> Vec<usize> {
    let Some((first, _)) = curves.first() else { return Vec::new() };
    let last = first.times.len() - 1;
    if curves
        .iter()
        .all(|(curve, allowed)| segment_fits(curve, 0, last, *allowed) && stays_at_first_key(curve, *allowed))
    {
        return vec![0];
    }
    let all_fit = |from: usize, to: usize| {
        curves.iter().all(|(curve, allowed)| segment_fits(curve, from, to, *allowed))
    };
    let mut kept = vec![0];
    let mut at = 0;
    while at < last {
        // Exponential search, then bisection.
        let mut fitting = at + 1;
        let mut step = 2;
        while at + step <= last && all_fit(at, at + step) {
            fitting = at + step;
            step *= 2;
        }
        let mut failing = (at + step).min(last + 1);
        while failing - fitting > 1 {
            let middle = fitting + (failing - fitting) / 2;
            if all_fit(at, middle) { fitting = middle } else { failing = middle }
        }
        kept.push(fitting);
        at = fitting;
    }
    kept
}

/// Whether all keys are within the tolerance of the first key.
fn stays_at_first_key(curve: &Curve, allowed: f64) -> bool {
    let limit = tolerance_distance(curve.path, allowed);
    (0..curve.times.len())
        .all(|key| squared_distance_to_key(curve, &key_value(curve, 0), key) <= limit * limit)
}

/// Whether all keys between two keys are within the tolerance of the interpolation between these.
fn segment_fits(curve: &Curve, from: usize, to: usize, allowed: f64) -> bool {
    let segment = Segment::new(curve.path, key_value(curve, from), key_value(curve, to));
    let (start, span) = (curve.times[from], (curve.times[to] - curve.times[from]).0 as f64);
    let limit = tolerance_distance(curve.path, allowed);
    (from + 1..to).all(|key| {
        let t = (curve.times[key] - start).0 as f64 / span;
        squared_distance_to_key(curve, &segment.at(t), key) <= limit * limit
    })
}

/// Interpolation between two values: linear, or slerp for rotations.
struct Segment {
    a: [f64; 4],
    b: [f64; 4],
    /// Angle between the quaternions of slerp, radians, and 1 over its sine; `None`: linear.
    arc: Option<(f64, f64)>,
}

/// Below this angle between quaternions, radians, linear interpolation is within 1.3e-7 of slerp, which is a rounding of f32.
const MIN_SLERP_ANGLE_RAD: f64 = 1e-3;

impl Segment {
    fn new(path: Path, a: [f64; 4], mut b: [f64; 4]) -> Segment {
        let mut arc = None;
        if path == Path::Rotation {
            let dot: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
            if dot < 0.0 {
                b = b.map(|v| -v);
            }
            let angle = libm::acos(dot.abs().min(1.0));
            arc = (angle > MIN_SLERP_ANGLE_RAD).then(|| (angle, 1.0 / libm::sin(angle)));
        }
        Segment { a, b, arc }
    }

    fn at(&self, t: f64) -> [f64; 4] {
        let [p, q] = match self.arc {
            Some((angle, over_sine)) => [(1.0 - t) * angle, t * angle].map(|x| libm::sin(x) * over_sine),
            None => [1.0 - t, t],
        };
        std::array::from_fn(|i| p * self.a[i] + q * self.b[i])
    }
}

fn key_value(curve: &Curve, key: usize) -> [f64; 4] {
    let width = curve.path.width().min(4);
    let mut out = [0.0; 4];
    for (out, v) in out.iter_mut().zip(&curve.values[key * curve.path.width()..][..width]) {
        *out = f64::from(*v);
    }
    out
}

/// Converts a tolerance in radians, metres or scale factors to a distance as measured by [`squared_distance_to_key`].
fn tolerance_distance(path: Path, allowed: f64) -> f64 {
    match path {
        // Unit quaternions whose rotations are an angle apart have half of that angle between them.
        Path::Rotation => 2.0 * libm::sin(0.25 * allowed.min(std::f64::consts::TAU)),
        _ => allowed,
    }
}

/// Squared distance between a value and a key; for rotations, between quaternions in the same hemisphere.
fn squared_distance_to_key(curve: &Curve, value_there: &[f64; 4], key: usize) -> f64 {
    let key_value_there = key_value(curve, key);
    let sum =
        |sign: f64| (0..4).map(|i| key_value_there[i] - sign * value_there[i]).map(|d| d * d).sum::<f64>();
    match curve.path {
        Path::Rotation => sum(1.0).min(sum(-1.0)),
        _ => sum(1.0),
    }
}

/// The curve with only the kept keys. `times`: their times, if curves share them.
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
pub(crate) fn key_bytes(clip: &Clip) -> usize {
    let mut seen = std::collections::BTreeSet::new();
    let bytes_of_curve = |curve: &Curve| {
        let is_first_use = seen.insert(curve.times.as_ptr() as usize);
        curve.values.len() * 4 + if is_first_use { curve.times.len() * 8 } else { 0 }
    };
    clip.stored_curves().iter().map(bytes_of_curve).sum()
}

/// Largest distance in model space, over all key times, of any joint and the points that turn with it, between a clip and its
/// reduction.
fn largest_error(skeleton: &Skeleton, source: &Clip, reduced: &Clip) -> f64 {
    let mut times: Vec<Time> = source.curves().iter().flat_map(|c| c.times.iter().copied()).collect();
    times.sort_unstable();
    times.dedup();
    let scales = ModelRestPose::of(skeleton).scales;
    let mut source_cursors: Vec<CurveCursor> = source.curves().iter().map(CurveCursor::new).collect();
    let mut reduced_cursors: Vec<CurveCursor> = reduced.curves().iter().map(CurveCursor::new).collect();
    let rest: Vec<JointTransform> = skeleton.rest().iter().map(JointTransform::of).collect();
    let (mut first, mut second) = (ModelPose::default(), ModelPose::default());
    let mut worst = 0.0f64;
    for time in times {
        first.set_pose(skeleton, &rest, &mut source_cursors, time);
        second.set_pose(skeleton, &rest, &mut reduced_cursors, time);
        for (joint, (first, second)) in first.matrices.iter().zip(&second.matrices).enumerate() {
            let arm = POINT_DISTANCE_M / scales[joint].max(1e-9);
            let (offset, rotation_change) =
                (first.translation - second.translation, first.matrix3 - second.matrix3);
            let points = [rotation_change.x_axis, rotation_change.y_axis, rotation_change.z_axis]
                .map(|axis| offset + axis * arm);
            let squares = points.map(DVec3::length_squared);
            worst = squares.into_iter().fold(worst.max(offset.length_squared()), f64::max);
        }
    }
    worst.sqrt()
}

/// Reads a curve at increasing times.
struct CurveCursor<'a> {
    curve: &'a Curve,
    /// First key that is not before the time that was read last.
    next: usize,
}

impl<'a> CurveCursor<'a> {
    fn new(curve: &'a Curve) -> CurveCursor<'a> {
        CurveCursor { curve, next: 0 }
    }

    fn at(&mut self, time: Time) -> [f64; 4] {
        let times = &self.curve.times;
        self.next += times[self.next..].iter().take_while(|key| **key < time).count();
        let is_key = times.get(self.next) == Some(&time);
        match self.curve.interpolation {
            Interpolation::Linear if is_key => key_value(self.curve, self.next),
            _ => curve_at(self.curve, time),
        }
    }
}

#[derive(Clone, Copy)]
struct JointTransform {
    translation: DVec3,
    rotation: DQuat,
    scale: DVec3,
}

impl JointTransform {
    fn of(t: &Transform) -> JointTransform {
        let (translation, scale) = (t.translation.as_dvec3(), t.scale.as_dvec3());
        JointTransform { translation, rotation: t.rotation.as_dquat(), scale }
    }
}

/// Matrices model-from-joint of a pose, in reused buffers.
#[derive(Default)]
struct ModelPose {
    locals: Vec<JointTransform>,
    matrices: Vec<DAffine3>,
}

impl ModelPose {
    fn set_pose(
        &mut self,
        skeleton: &Skeleton,
        rest: &[JointTransform],
        cursors: &mut [CurveCursor<'_>],
        time: Time,
    ) {
        self.locals.clear();
        self.locals.extend_from_slice(rest);
        for cursor in cursors {
            let local = &mut self.locals[cursor.curve.joint as usize];
            match cursor.curve.path {
                Path::Translation => local.translation = DVec3::from_slice(&cursor.at(time)),
                Path::Rotation => local.rotation = DQuat::from_array(cursor.at(time)),
                Path::Scale => local.scale = DVec3::from_slice(&cursor.at(time)),
                Path::Weights(_) => {}
            }
        }
        set_model_matrices(&mut self.matrices, skeleton, self.locals.iter().copied());
    }
}

/// Replaces `matrices` by the matrices model-from-joint of a pose.
fn set_model_matrices(
    matrices: &mut Vec<DAffine3>,
    skeleton: &Skeleton,
    locals: impl Iterator<Item = JointTransform>,
) {
    matrices.clear();
    for (local, parent) in locals.zip(skeleton.parents()) {
        let rotation = normalize_or_identity(local.rotation);
        let own = DAffine3::from_scale_rotation_translation(local.scale, rotation, local.translation);
        matrices.push(parent.map_or(own, |p| matrices[p as usize] * own));
    }
}

/// Largest distance in model space of each joint, and of points that turn with it, between two clips: at all keys of `a` and
/// halfway between them, or at about `max_times` of these times, evenly chosen.
pub(crate) fn joint_errors(skeleton: &Skeleton, a: &Clip, b: &Clip, max_times: usize) -> Vec<f64> {
    let mut times: Vec<Time> = a.curves().iter().flat_map(|c| c.times.iter().copied()).collect();
    times.sort_unstable();
    times.dedup();
    let middles: Vec<Time> = times.windows(2).map(|w| Time(w[0].0 + (w[1].0 - w[0].0) / 2)).collect();
    times.extend(middles);
    times.sort_unstable();
    let every = times.len().div_ceil(max_times.max(1)).max(1);
    let mut pose = Pose::rest(skeleton);
    let mut model = |clip: &Clip, time: Time| -> Vec<DAffine3> {
        for (joint, rest) in skeleton.rest().iter().enumerate() {
            pose.set(joint, *rest);
        }
        Sample { clip, time, pose: &mut pose }.run();
        let mut matrices: Vec<DAffine3> = Vec::with_capacity(skeleton.len());
        set_model_matrices(&mut matrices, skeleton, pose.iter().map(|local| JointTransform::of(&local)));
        matrices
    };
    let rest = ModelRestPose::of(skeleton);
    let mut worst = vec![0.0f64; skeleton.len()];
    for time in times.into_iter().step_by(every) {
        let (first, second) = (model(a, time), model(b, time));
        for (joint, (first, second)) in first.iter().zip(&second).enumerate() {
            let arm = POINT_DISTANCE_M / rest.scales[joint].max(1e-9);
            for point in [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z] {
                let at = |m: &DAffine3| m.transform_point3(point * arm);
                worst[joint] = worst[joint].max((at(first) - at(second)).length());
            }
        }
    }
    worst
}
