//! Clip editing: cut, reverse, change speed, join, offset, smooth, bake and reduce. Each edit changes keys and returns a new
//! clip.
//!
//! Equations hold at every tick, to the rounding of f32: `clip.cut(a, b)` at t is the clip at a + t, `reversed` at t is
//! the clip at its end − t, and so on (`tests/motion/edit.rs`).

pub mod bake;
mod difference;
mod join;
mod offset;
pub mod reduce;
mod smooth;

use crate::clip::key_search::{Interval, find_interval};
use crate::clip::sample::Sample;
use crate::clip::{Clip, Curve, Interpolation, Path};
use crate::pose::Pose;
use crate::time::Time;

pub use offset::{Offset, offset_in_parent};

/// The reason why a clip cannot be edited; the message has the numbers.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum EditError {
    Cut { clip: String, from: f64, until: f64, duration: f64 },
    Speed { clip: String, factor: f64 },
    KeysMeet { clip: String, factor: f64 },
    Joints { first: String, second: String, joints: usize, expected: usize },
    Weights { first: String, second: String, joint: u32 },
    Joint { joint: u32, joints: usize },
    Window { seconds: f64 },
}

crate::error_texts! { EditError:
    Self::Cut { clip, from, until, duration } => "from {from} s to {until} s is not a part of the clip \"{clip}\", which runs from 0 s to {duration} s";
    Self::Speed { clip, factor } => "the clip \"{clip}\" at {factor} times its speed: the speed must be from 0.001 to 1000";
    Self::KeysMeet { clip, factor } => "the clip \"{clip}\" at {factor} times its speed has keys less than a tick apart";
    Self::Joints { first, second, joints, expected } => "the numbers of joints differ: {joints} in the clip \"{second}\", {expected} in the skeleton \"{first}\"";
    Self::Weights { first, second, joint } => "the clips \"{first}\" and \"{second}\" drive different numbers of morph weights at joint {joint}";
    Self::Joint { joint, joints } => "joint {joint} does not exist; number of the clip's joints: {joints}";
    Self::Window { seconds } => "the window of {seconds} s must be above 0 s and at most 10 s";
}

impl Clip {
    /// The part of the clip between two times, moved to begin at 0. Keys are inserted at both ends if there are none, so that
    /// slerp and cubics between keys are unchanged.
    pub fn cut(&self, from: Time, until: Time) -> Result<Clip, EditError> {
        if from < Time::ZERO || until > self.duration || from >= until {
            return Err(EditError::Cut {
                clip: self.name.clone(),
                from: from.as_secs(),
                until: until.as_secs(),
                duration: self.duration.as_secs(),
            });
        }
        let mut values = CurveValues::new(self);
        Ok(self
            .try_map_curves(|curve| Ok(cut_curve(curve, from, until, &mut values)))?
            .with_duration(until - from))
    }

    /// The clip backwards: at t it equals the clip at its end − t, steps included.
    pub fn reversed(&self) -> Clip {
        let end = self.duration;
        let backwards = |curve: &Curve| {
            let keys = curve.times.len();
            let step = curve.interpolation == Interpolation::Step;
            let time = |new: usize| match (step, new) {
                (false, _) => end - curve.times[keys - 1 - new],
                (true, 0) => Time::ZERO.min(end - curve.times[keys - 1]),
                // A step lasts until the tick before the next.
                (true, _) => end - curve.times[keys - new] + Time(1),
            };
            let width = curve.path.width();
            let mut values = Vec::with_capacity(curve.values.len());
            for key in curve.values.chunks_exact(curve.stride()).rev() {
                if curve.interpolation == Interpolation::CubicSpline {
                    values.extend(key[2 * width..].iter().map(|v| -v));
                    values.extend(&key[width..2 * width]);
                    values.extend(key[..width].iter().map(|v| -v));
                } else {
                    values.extend(key);
                }
            }
            let times = (0..keys).map(time).collect();
            Ok::<_, std::convert::Infallible>(Curve { times, values: values.into(), ..curve.clone() })
        };
        let Ok(clip) = self.try_map_curves(backwards);
        clip
    }

    /// The clip at another speed: at t it equals the clip at t · factor, to the nearest tick.
    pub fn at_speed(&self, factor: f64) -> Result<Clip, EditError> {
        if !(0.001..=1000.0).contains(&factor) {
            return Err(EditError::Speed { clip: self.name.clone(), factor });
        }
        let with_scaled_times = |curve: &Curve| {
            let times: Vec<Time> = curve.times.iter().map(|t| t.scaled(1.0 / factor)).collect();
            if times.windows(2).any(|pair| pair[0] >= pair[1]) {
                return Err(EditError::KeysMeet { clip: self.name.clone(), factor });
            }
            let mut values = curve.values.to_vec();
            if curve.interpolation == Interpolation::CubicSpline {
                let width = curve.path.width();
                for (part, value) in values.chunks_exact_mut(width.max(1)).enumerate() {
                    if part % 3 != 1 {
                        value.iter_mut().for_each(|v| *v = (f64::from(*v) * factor) as f32);
                    }
                }
            }
            Ok(Curve { times: times.into(), values: values.into(), ..curve.clone() })
        };
        Ok(self.try_map_curves(with_scaled_times)?.with_duration(self.duration.scaled(1.0 / factor)))
    }
}

/// Values of a clip's curves at any time.
struct CurveValues<'a> {
    clip: &'a Clip,
    pose: Pose,
    at: Option<Time>,
}

impl<'a> CurveValues<'a> {
    fn new(clip: &'a Clip) -> CurveValues<'a> {
        CurveValues { clip, pose: Pose::identity(clip.joint_count()), at: None }
    }

    /// Value of a curve at a time, as sampling the clip gives it.
    fn at(&mut self, curve: &Curve, time: Time) -> Vec<f32> {
        if let Path::Weights(n) = curve.path {
            let mut out = vec![0.0; n as usize];
            crate::clip::sample::interpolate_curve(curve, find_interval(&curve.times, time), &mut out);
            return out;
        }
        if self.at != Some(time) {
            Sample { clip: self.clip, time, pose: &mut self.pose }.run();
            self.at = Some(time);
        }
        let joint = self.pose.get(curve.joint as usize);
        match curve.path {
            Path::Rotation => joint.rotation.to_array().to_vec(),
            Path::Scale => joint.scale.to_array().to_vec(),
            _ => joint.translation.to_array().to_vec(),
        }
    }
}

/// The part of a curve between two times, moved to begin at 0.
fn cut_curve(curve: &Curve, from: Time, until: Time, values: &mut CurveValues) -> Curve {
    let inside: Vec<usize> =
        (0..curve.times.len()).filter(|i| from <= curve.times[*i] && curve.times[*i] <= until).collect();
    let (mut times, mut keys) = (Vec::new(), Vec::new());
    let mut insert_key = |time: Time, times: &mut Vec<Time>, keys: &mut Vec<f32>| {
        times.push(time - from);
        keys.extend(inserted_key(curve, time, values));
    };
    if inside.first().is_none_or(|i| curve.times[*i] > from) {
        insert_key(from, &mut times, &mut keys);
    }
    for i in &inside {
        let begin = keys.len();
        times.push(curve.times[*i] - from);
        keys.extend(&curve.values[i * curve.stride()..][..curve.stride()]);
        // A curve is held before its first key, so that a cubic arrives with slope zero.
        if *i == 0 && curve.times[0] > from && curve.interpolation == Interpolation::CubicSpline {
            keys[begin..begin + curve.path.width()].fill(0.0);
        }
    }
    let ends_before = inside.last().is_none_or(|i| curve.times[*i] < until);
    // A curve is held after its last key and needs no key at the end.
    let moves_on = curve.times.last().is_some_and(|last| *last > until);
    if ends_before && moves_on {
        insert_key(until, &mut times, &mut keys);
    }
    Curve { times: times.into(), values: keys.into(), ..curve.clone() }
}

/// The curve's own key at a time if it has one, else an inserted key.
fn key_or_inserted(curve: &Curve, time: Time, values: &mut CurveValues) -> Vec<f32> {
    match curve.times.binary_search(&time) {
        Ok(key) => curve.values[key * curve.stride()..][..curve.stride()].to_vec(),
        Err(_) => inserted_key(curve, time, values),
    }
}

/// A key that can be inserted at any time and leaves the curve unchanged on both sides. The value of a cubic rotation is not
/// normalized, since the cubic continues from the unnormalized value.
fn inserted_key(curve: &Curve, time: Time, values: &mut CurveValues) -> Vec<f32> {
    if curve.interpolation != Interpolation::CubicSpline {
        return values.at(curve, time);
    }
    let width = curve.path.width();
    let Interval { key, next, fraction, span } = find_interval(&curve.times, time);
    let (a, b) = (&curve.values[key * 3 * width..], &curve.values[next * 3 * width..]);
    let mut out = vec![0.0; 3 * width];
    if key == next {
        // A curve is held beyond its ends.
        out[width..2 * width].copy_from_slice(&a[width..2 * width]);
        return out;
    }
    let (t, span) = (f64::from(fraction), span.as_secs());
    let (t2, t3) = (t * t, t * t * t);
    for i in 0..width {
        let [p, m, n, q] = [a[width + i], a[2 * width + i], b[i], b[width + i]].map(f64::from);
        let value = (2.0 * t3 - 3.0 * t2 + 1.0) * p
            + span * (t3 - 2.0 * t2 + t) * m
            + span * (t3 - t2) * n
            + (3.0 * t2 - 2.0 * t3) * q;
        // The derivative of the value, per second.
        let slope =
            (6.0 * t2 - 6.0 * t) * (p - q) / span + (3.0 * t2 - 4.0 * t + 1.0) * m + (3.0 * t2 - 2.0 * t) * n;
        (out[i], out[width + i], out[2 * width + i]) = (slope as f32, value as f32, slope as f32);
    }
    out
}
