//! Removes jitter from a clip.

use super::{CurveValues, EditError};
use crate::clip::{Clip, Curve, Interpolation, Path};
use crate::time::Time;

/// Number of samples of the smoothing window on each side of a key.
const SAMPLES_PER_SIDE: i64 = 4;

/// exp(−x²/2) at x = 2 i / SAMPLES_PER_SIDE: the window ends at two standard deviations.
const GAUSSIAN_WEIGHTS: [f64; SAMPLES_PER_SIDE as usize + 1] =
    [1.0, 0.882496902584595, 0.606530659712633, 0.32465246735835, 0.135335283236613];

impl Clip {
    /// Gaussian smoothing: each LINEAR key becomes the weighted mean of the clip within a window around it. Jitter disappears;
    /// straight, even motion stays. The window shrinks towards the ends, which are unchanged. STEP and CUBICSPLINE curves
    /// stay as authored.
    pub fn smoothed(&self, window: Time) -> Result<Clip, EditError> {
        if window <= Time::ZERO || window > Time::from_secs(10.0) {
            return Err(EditError::Window { seconds: window.as_secs() });
        }
        let mut values = CurveValues::new(self);
        self.try_map_curves(|curve| {
            if curve.interpolation != Interpolation::Linear || curve.times.len() < 3 {
                return Ok(curve.clone());
            }
            let keys = curve.times.iter().flat_map(|time| gaussian_mean(curve, *time, window, &mut values));
            Ok(Curve { values: keys.collect(), ..curve.clone() })
        })
    }
}

fn gaussian_mean(curve: &Curve, time: Time, window: Time, values: &mut CurveValues) -> Vec<f32> {
    let (first, last) = (curve.times[0], curve.times[curve.times.len() - 1]);
    let half = Time(window.0 / 2).min(time - first).min(last - time);
    let center = values.at(curve, time);
    if half <= Time::ZERO {
        return center;
    }
    let mut sum: Vec<f64> = center.iter().map(|v| f64::from(*v)).collect();
    let mut weights = GAUSSIAN_WEIGHTS[0];
    for i in 1..=SAMPLES_PER_SIDE {
        let weight = GAUSSIAN_WEIGHTS[i as usize];
        for sign in [-1, 1] {
            let value = values.at(curve, time + Time(half.0 * i / SAMPLES_PER_SIDE * sign));
            let dot: f32 = value.iter().zip(&center).map(|(a, b)| a * b).sum();
            let flip = if curve.path == Path::Rotation && dot < 0.0 { -weight } else { weight };
            for (sum, v) in sum.iter_mut().zip(&value) {
                *sum += flip * f64::from(*v);
            }
            weights += weight;
        }
    }
    if curve.path == Path::Rotation {
        weights = sum.iter().map(|v| v * v).sum::<f64>().sqrt();
        if weights < 1e-6 {
            return center;
        }
    }
    sum.iter().map(|v| (v / weights) as f32).collect()
}
