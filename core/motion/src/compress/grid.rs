//! Evenly spaced key times that contain those of a clip.

use crate::clip::sample_f64::curve_at;
use crate::clip::{Clip, Curve, Interpolation, Path};
use crate::time::Time;

/// `frames` times, `step` ticks apart.
pub(super) struct Grid {
    pub start: Time,
    pub step: i64,
    pub frames: usize,
}

/// Key rates to try, per second: those at which files are usually made, from low to high.
const CANDIDATE_RATES: [i64; 9] = [24, 25, 30, 48, 50, 60, 100, 120, 240];
/// Largest distance of a key time from the grid, ticks: files store times as f32 seconds.
const MAX_GRID_OFFSET: i64 = Time::TICKS_PER_SECOND / 50_000;
/// Largest number of frames of a grid: about two hours at 120 Hz.
const MAX_FRAMES: i64 = 1 << 20;

/// Whether a curve can be packed: LINEAR, and not of morph weights.
pub(super) fn is_packable(curve: &Curve) -> bool {
    !matches!(curve.path, Path::Weights(_)) && curve.interpolation == Interpolation::Linear
}

impl Grid {
    /// Grids to try, the coarsest first.
    pub(super) fn candidates(clip: &Clip) -> Vec<Grid> {
        let times = || clip.curves().iter().filter(|c| is_packable(c)).flat_map(|c| c.times.iter().copied());
        let (Some(start), Some(end)) = (times().min(), times().max()) else { return Vec::new() };
        let length = (end - start).0;
        let contains_all_keys = |rate: i64| {
            let step = Time::TICKS_PER_SECOND / rate;
            times().all(|t| {
                let rest = (t - start).0.rem_euclid(step);
                rest.min(step - rest) <= MAX_GRID_OFFSET
            })
        };
        let clip_rate = CANDIDATE_RATES.into_iter().find(|rate| contains_all_keys(*rate));
        let rates = clip_rate
            .into_iter()
            .chain([60, 120, 240].into_iter().filter(|r| clip_rate.is_none_or(|clip_rate| *r > clip_rate)));
        rates
            .map(|rate| Time::TICKS_PER_SECOND / rate)
            .map(|step| (step, length.saturating_add(step - 1 - MAX_GRID_OFFSET).max(0) / step + 1))
            .filter(|(_, frames)| (2..=MAX_FRAMES).contains(frames))
            .map(|(step, frames)| Grid { start, step, frames: frames as usize })
            .collect()
    }

    pub(super) fn times(&self) -> impl Iterator<Item = Time> + '_ {
        (0..self.frames).map(|frame| Time(self.start.0.saturating_add(frame as i64 * self.step)))
    }

    /// Values of a curve at all times of the grid, in f64; each rotation is in the hemisphere of the one before.
    pub(super) fn values(&self, curve: &Curve) -> Vec<[f64; 4]> {
        let mut values: Vec<[f64; 4]> =
            self.times().map(|t| curve_at(curve, nearest_key(curve, t))).collect();
        if curve.path == Path::Rotation {
            for i in 1..values.len() {
                let before = values[i - 1];
                if before.iter().zip(values[i]).map(|(a, b)| a * b).sum::<f64>() < 0.0 {
                    values[i] = values[i].map(|c| -c);
                }
            }
        }
        values
    }
}

/// The key time that coincides with a time of the grid up to rounding, if any, else the time itself.
fn nearest_key(curve: &Curve, time: Time) -> Time {
    let at = curve.times.partition_point(|t| *t < time);
    let key_within_offset =
        |i: usize| curve.times.get(i).copied().filter(|t| (*t - time).0.abs() <= MAX_GRID_OFFSET);
    key_within_offset(at).or_else(|| at.checked_sub(1).and_then(key_within_offset)).unwrap_or(time)
}
