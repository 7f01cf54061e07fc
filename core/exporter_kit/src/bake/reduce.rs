//! Key reduction: rows of samples become curves of a rig, without the keys that follow from the others.

use crate::bake::rig::{self, STRIDE};
use crate::bake::sample::{Row, SampledActor};
use crate::bake::signals::Signal;
use crate::bake::tracks::{Track, TrackSet, Values};
use choreo_plugin::glam;
use choreo_plugin::motion::edit::reduce::KeptTimes;
use choreo_plugin::motion::{Clip, Curve, Interpolation, Path, Skeleton, Time};
use choreo_plugin::stage::Actor;
use std::sync::Arc;

/// Reduced curves of an actor, each with its own key times. `tolerance`: metres in the world.
pub(crate) fn actor_tracks(
    actor: &Actor,
    sampled: &SampledActor,
    rows: &[Row],
    tolerance: f64,
) -> TrackSet<'static> {
    let rows: Vec<&Row> = rows.iter().collect();
    let mut out = empty_track_set();
    let curves = rig_curves(sampled, &rows, 0.0, &mut out.still);
    let world = rig::transform(&rows[0].values[sampled.offset..]);
    let Some(skeleton) = skeleton(actor, sampled, world) else { return out };
    let Ok(clip) = Clip::new(String::new(), skeleton.len(), curves) else { return out };
    let reduced = clip.reduced(&skeleton, tolerance, KeptTimes::Own).map(|(clip, _)| clip).unwrap_or(clip);
    let reaches = chain_lengths(&skeleton);
    let limit = |joint: u32| max_rotation_step(tolerance / reaches[joint as usize]);
    let curves: Vec<Curve> =
        reduced.curves().iter().map(|curve| subdivide_rotation(curve, limit(curve.joint))).collect();
    add_curves(&curves, &mut out);
    out
}

/// Reduced curves of an actor that all have the same key times: whole rows are removed where all joints stay within the tolerance in the
/// world.
pub(crate) fn common_tracks(
    actor: &Actor,
    sampled: &SampledActor,
    rows: &[Row],
    tolerance: f64,
) -> TrackSet<'static> {
    let row = |index: usize| &rows[index].values[sampled.offset..][..sampled.joints * STRIDE];
    let parents = actor.asset.skeleton.parents();
    let mut spaces = rig::Spaces::default();
    let mut out = empty_track_set();
    let kept = match (1..rows.len()).all(|index| row(index) == row(0)) {
        true => vec![0],
        false => reduce_greedy(rows.len(), |from, to| {
            (from + 1..to).all(|between| {
                let t = rows[between].time.fraction(rows[from].time, rows[to].time);
                let far = row(between)[..3].iter().fold(0.0f32, |most, v| most.max(v.abs()));
                let allowed = (tolerance as f32).max(far * 4.0 * f32::EPSILON);
                let three = [row(from), row(to), row(between)];
                rig::max_distance(parents, three, t, sampled.reach, &mut spaces) <= allowed
            })
        }),
    };
    let kept: Vec<&Row> = kept.into_iter().map(|index| &rows[index]).collect();
    let curves = rig_curves(sampled, &kept, ROUNDING, &mut out.still);
    add_curves(&curves, &mut out);
    out
}

/// Largest difference of numbers that differ only by the rounding of a pose.
const ROUNDING: f32 = 1e-6;

fn empty_track_set() -> TrackSet<'static> {
    let (times, tracks, still) = (Vec::new(), Vec::new(), Vec::new());
    TrackSet { times, tracks, still, values: Values::Lists(Vec::new()) }
}

/// The curves of a rig in some rows. Curves whose numbers differ by at most `rounding` are constant and go to `still`.
fn rig_curves(
    sampled: &SampledActor,
    rows: &[&Row],
    rounding: f32,
    still: &mut Vec<(u32, Path, Vec<f32>)>,
) -> Vec<Curve> {
    let times: Arc<[Time]> = rows.iter().map(|row| row.time).collect();
    let mut curves = Vec::new();
    for joint in 0..sampled.joints {
        let paths = [(Path::Translation, 0, 3), (Path::Rotation, 3, 4), (Path::Scale, 7, 3)];
        for (path, from, width) in paths {
            let at = sampled.offset + joint * STRIDE + from;
            let first = &rows[0].values[at..at + width];
            let is_first = |row: &&Row| {
                let values = &row.values[at..at + width];
                values.iter().zip(first).all(|(v, first)| (v - first).abs() <= rounding)
            };
            if rows.iter().all(is_first) {
                still.push((joint as u32, path, first.to_vec()));
                continue;
            }
            let values = rows.iter().flat_map(|row| row.values[at..at + width].iter().copied()).collect();
            let (times, interpolation) = (times.clone(), Interpolation::Linear);
            curves.push(Curve { joint: joint as u32, path, interpolation, times, values });
        }
    }
    curves
}

/// The largest angle between two rotation keys for which nlerp, as in Blender, stays within `allowed` radians of slerp. Their largest
/// difference is 0.032 · h³, where h is the distance of the quaternions, which is half of the angle.
fn max_rotation_step(allowed: f64) -> f64 {
    // Only a quarter of the error is allowed, because the errors of joints above each other add up.
    2.0 * libm::cbrt(0.25 * allowed / 0.032)
}

/// Length of the longest chain of bones below each joint at rest, plus 10 cm, in metres.
fn chain_lengths(skeleton: &Skeleton) -> Vec<f64> {
    let places = rig::world_from_joints(skeleton, skeleton.rest().iter().copied());
    let mut out = vec![0.0f64; skeleton.len()];
    for (joint, parent) in skeleton.parents().iter().enumerate().rev() {
        if let Some(parent) = parent {
            let bone = (places[joint].translation - places[*parent as usize].translation).length();
            out[*parent as usize] = out[*parent as usize].max(bone + out[joint]);
        }
    }
    out.iter_mut().for_each(|reach| *reach += 0.1);
    out
}

/// A rotation curve with additional keys on the arc between keys that are more than `most` radians apart. Other curves stay as they are.
fn subdivide_rotation(curve: &Curve, most: f64) -> Curve {
    if curve.path != Path::Rotation || curve.times.len() < 2 {
        return curve.clone();
    }
    let rotation = |key: usize| glam::Quat::from_slice(&curve.values[4 * key..][..4]);
    let mut times = vec![curve.times[0]];
    let mut values = curve.values[..4].to_vec();
    for key in 1..curve.times.len() {
        let (from, to) = (curve.times[key - 1], curve.times[key]);
        let (a, b) = (rotation(key - 1), rotation(key));
        let chord = f64::from((a - b).length().min((a + b).length()));
        let angle = 4.0 * libm::asin((chord / 2.0).min(1.0));
        let ticks = (to - from).0;
        // A jump gets no additional keys.
        let parts = ((angle / most).ceil() as i64).clamp(1, (ticks / MIN_TICKS).max(1));
        for part in 1..parts {
            let time = from + Time(ticks / parts * part);
            times.push(time);
            values.extend(a.slerp(b, time.fraction(from, to)).normalize().to_array());
        }
        times.push(to);
        values.extend(b.to_array());
    }
    Curve { times: times.into(), values: values.into(), ..curve.clone() }
}

/// Smallest distance of additional keys: a millisecond.
const MIN_TICKS: i64 = Time::TICKS_PER_SECOND / 1000;

/// The skeleton on which errors are measured; for an actor without pose, a root and one joint as far away as its farthest vertex.
fn skeleton(
    actor: &Actor,
    sampled: &SampledActor,
    world: choreo_plugin::motion::Transform,
) -> Option<Skeleton> {
    if sampled.pose {
        return rig::skeleton(actor, world);
    }
    let tip = choreo_plugin::motion::Transform {
        translation: choreo_plugin::glam::Vec3::X * sampled.reach,
        ..choreo_plugin::motion::Transform::IDENTITY
    };
    Skeleton::new(vec![String::new(); 2], vec![None, Some(0)], vec![world, tip]).ok()
}

fn add_curves(curves: &[Curve], out: &mut TrackSet<'_>) {
    let mut lists = Vec::new();
    let mut known: Vec<Arc<[Time]>> = Vec::new();
    for curve in curves {
        let Curve { joint, path, interpolation, .. } = *curve;
        if curve.times.len() == 1 {
            out.still.push((joint, path, curve.values.to_vec()));
            continue;
        }
        let times = known.iter().position(|known| *known == curve.times).unwrap_or_else(|| {
            known.push(curve.times.clone());
            out.times.push(curve.times.to_vec());
            known.len() - 1
        });
        out.tracks.push(Track { joint, path, interpolation, times });
        lists.push(curve.values.to_vec());
    }
    out.values = Values::Lists(lists);
}

/// A signal over time: LINEAR keys, a single one if the signal never changes.
#[derive(Clone, Debug, Default)]
pub struct Series {
    pub times: Vec<Time>,
    pub values: Vec<f32>,
    pub width: usize,
}

impl Series {
    pub fn first(&self) -> &[f32] {
        &self.values[..self.width]
    }

    pub fn is_still(&self) -> bool {
        self.times.len() < 2
    }

    /// The value at a time; only for signals that are not rotations.
    pub fn at(&self, time: Time) -> Vec<f32> {
        let value = |key: usize| &self.values[key * self.width..][..self.width];
        let next = self.times.partition_point(|key| *key <= time);
        if next == 0 || next == self.times.len() {
            return value(next.saturating_sub(1)).to_vec();
        }
        let t = time.fraction(self.times[next - 1], self.times[next]);
        value(next - 1).iter().zip(value(next)).map(|(a, b)| a + (b - a) * t).collect()
    }
}

/// Indices from the first to the last: from each, the farthest next one that `fits` accepts.
fn reduce_greedy(count: usize, mut fits: impl FnMut(usize, usize) -> bool) -> Vec<usize> {
    let (mut out, last, mut at) = (vec![0], count.saturating_sub(1), 0);
    while at < last {
        // Galloping search (doubling, then bisection) needs few tests for a long way.
        let (mut good, mut step) = (at + 1, 2);
        while at + step <= last && fits(at, at + step) {
            good = at + step;
            step *= 2;
        }
        let mut bad = (at + step).min(last + 1);
        while bad - good > 1 {
            let middle = good + (bad - good) / 2;
            if fits(at, middle) { good = middle } else { bad = middle }
        }
        out.push(good);
        at = good;
    }
    out
}

/// Keys of a signal in some rows: each is as far from the one before as linear interpolation between both stays near enough.
pub(super) fn series(signal: &Signal, rows: &[&Row]) -> Series {
    let value = |row: usize| &rows[row].values[signal.offset..][..signal.width];
    let mut out = Series { width: signal.width, ..Series::default() };
    let Some(last) = rows.len().checked_sub(1) else { return out };
    let mut push = |row: usize| {
        out.times.push(rows[row].time);
        out.values.extend_from_slice(value(row));
    };
    push(0);
    if (0..=last).all(|row| signal.is_near(value(row), value(0))) {
        return out;
    }
    let mut between = vec![0.0; signal.width];
    let mut fits = |from: usize, to: usize| {
        (from + 1..to).all(|row| {
            let t = rows[row].time.fraction(rows[from].time, rows[to].time);
            signal.interpolate(value(from), value(to), t, &mut between);
            signal.is_near(&between, value(row))
        })
    };
    reduce_greedy(rows.len(), &mut fits).into_iter().skip(1).for_each(push);
    out
}
