//! Resamples linear curves with different key times at the key times of all of them.
//!
//! Added keys lie on the curve, so that sampling gives the same but for rounding (below 1e-6; a test compares with f64). One
//! search then serves all curves, and they are interpolated eight at a time.

use crate::clip::key_search::find_interval;
use crate::clip::tracks::{Channel, StrayCurves, key_value};
use crate::clip::{Curve, Interpolation};
use crate::math::rotation::slerp;
use crate::simd::lane::LANES;
use crate::time::Time;
use glam::DQuat;
use std::sync::Arc;

/// Limits of the resampled rows: this many times the bytes of the keys, or this many bytes in all. Without limits, curves with
/// hundreds of separate key times would take memory in the square of their number.
const MAX_GROWTH: usize = 16;
const ALWAYS_ALLOWED_BYTES: usize = 1 << 20;

/// Curves on common key times.
pub(crate) struct CommonTimes {
    /// Indices of the source curves, sorted.
    pub sources: Vec<usize>,
    pub curves: Vec<Curve>,
}

/// Resamples the linear curves among `stray_curves` at common times. `None` if there are none, or if the rows would be too large.
pub(crate) fn common_times(curves: &[Curve], stray_curves: &StrayCurves) -> Option<CommonTimes> {
    let columns =
        || stray_curves.iter().filter(|((interpolation, ..), _)| *interpolation == Interpolation::Linear);
    let mut sources: Vec<usize> = columns().flat_map(|(_, members)| members).copied().collect();
    sources.sort_unstable();
    let mut times: Vec<Time> = sources.iter().flat_map(|i| curves[*i].times.iter().copied()).collect();
    times.sort_unstable();
    times.dedup();
    let lanes: usize =
        columns().map(|((.., channel), _)| if *channel == Channel::Rotation { 5 } else { 3 }).sum();
    let bytes = times.len() * lanes * LANES * size_of::<f32>();
    let key_bytes: usize = sources.iter().map(|i| curves[*i].values.len() * size_of::<f32>()).sum();
    if sources.is_empty() || bytes > ALWAYS_ALLOWED_BYTES.max(key_bytes * MAX_GROWTH) {
        return None;
    }
    let times: Arc<[Time]> = times.into();
    let curves = sources.iter().map(|i| resample_linear(&curves[*i], &times)).collect();
    Some(CommonTimes { sources, curves })
}

/// Resamples a linear curve at `times`, which include all of its key times.
fn resample_linear(curve: &Curve, times: &Arc<[Time]>) -> Curve {
    let width = curve.path.width();
    let mut values = Vec::with_capacity(times.len() * width);
    for time in times.iter() {
        let at = find_interval(&curve.times, *time);
        let from = key_value(curve, at.key);
        if at.fraction == 0.0 {
            values.extend_from_slice(&from[..width]);
            continue;
        }
        let t = (*time - curve.times[at.key]).0 as f64 / at.span.0 as f64;
        let [a, b] = [from, key_value(curve, at.next)].map(|key| key.map(f64::from));
        let between = if width == 4 {
            slerp(DQuat::from_array(a).normalize(), DQuat::from_array(b).normalize(), t).to_array()
        } else {
            std::array::from_fn(|i| a[i] + (b[i] - a[i]) * t)
        };
        values.extend(between[..width].iter().map(|v| *v as f32));
    }
    Curve { times: times.clone(), values: values.into(), ..curve.clone() }
}
