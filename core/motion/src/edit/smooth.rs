//! Removes jitter from a clip.

use super::{EditError, Values};
use crate::clip::{Clip, Curve, Interpolation, Path};
use crate::time::Time;

/// Samples on each side of a key.
const SIDE: i64 = 4;

/// exp(−x²/2) at x = 2 i / SIDE: the window ends at two standard deviations.
const WEIGHTS: [f64; SIDE as usize + 1] =
    [1.0, 0.882496902584595, 0.606530659712633, 0.32465246735835, 0.135335283236613];

impl Clip {
    /// Gaussian smoothing: each LINEAR key becomes the weighted mean of the clip within a window around it. Jitter disappears;
    /// straight, even motion stays. The window shrinks towards the ends, which are unchanged. STEP and CUBICSPLINE curves are
    /// intended, and stay.
    pub fn smoothed(&self, window: Time) -> Result<Clip, EditError> {
        if window <= Time::ZERO || window > Time::from_secs(10.0) {
            return Err(EditError::Window { seconds: window.as_secs() });
        }
        let mut values = Values::new(self);
        self.try_map_curves(|curve| {
            if curve.interpolation != Interpolation::Linear || curve.times.len() < 3 {
                return Ok(curve.clone());
            }
            let keys = curve.times.iter().flat_map(|time| mean(curve, *time, window, &mut values));
            Ok(Curve { values: keys.collect(), ..curve.clone() })
        })
    }
}

fn mean(curve: &Curve, time: Time, window: Time, values: &mut Values) -> Vec<f32> {
    let (first, last) = (curve.times[0], curve.times[curve.times.len() - 1]);
    let half = Time(window.0 / 2).min(time - first).min(last - time);
    let center = values.at(curve, time);
    if half <= Time::ZERO {
        return center;
    }
    let mut sum: Vec<f64> = center.iter().map(|v| f64::from(*v)).collect();
    let mut weights = WEIGHTS[0];
    for i in 1..=SIDE {
        let weight = WEIGHTS[i as usize];
        for sign in [-1, 1] {
            let value = values.at(curve, time + Time(half.0 * i / SIDE * sign));
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
