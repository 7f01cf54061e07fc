//! The keys of a curve: steps stay steps, constants become one key, equal key times are stored once.

use choreo_motion::{Interpolation, Time};
use std::collections::BTreeMap;
use std::sync::Arc;

/// How values are interpolated between two keys.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Blend {
    Numbers,
    /// Quaternions, along the shorter arc.
    Rotation,
}

/// Times and values of one curve.
pub(crate) struct Keys {
    pub interpolation: Interpolation,
    pub times: Vec<Time>,
    pub values: Vec<f32>,
}

/// Simplifies rows of `width` numbers at strictly increasing times: to one key where nothing changes, and to STEP where all
/// changes are jumps.
pub(crate) fn simplify_keys(times: Vec<Time>, values: Vec<f32>, width: usize, blend: Blend) -> Keys {
    let row = |i: usize| &values[i * width..(i + 1) * width];
    let same =
        |a: &[f32], b: &[f32]| a == b || blend == Blend::Rotation && a.iter().zip(b).all(|(a, b)| *a == -*b);
    let count = times.len();
    if (1..count).all(|i| same(row(i), row(0))) {
        let values = row(0).to_vec();
        return Keys { interpolation: Interpolation::Linear, times: vec![times[0].max(Time::ZERO)], values };
    }
    // A step is two keys one tick apart, with nothing changing between steps.
    let is_step = |i: usize| times[i + 1].0 - times[i].0 == 1;
    if (0..count - 1).all(|i| is_step(i) || same(row(i), row(i + 1))) {
        let kept: Vec<usize> = (0..count).filter(|&i| i == 0 || is_step(i - 1)).collect();
        let values = kept.iter().flat_map(|&i| row(i)).copied().collect();
        let times = kept.iter().map(|&i| times[i]).collect();
        return Keys { interpolation: Interpolation::Step, times, values };
    }
    Keys { interpolation: Interpolation::Linear, times, values }
}

/// Stores equal lists of key times once.
#[derive(Default)]
pub(crate) struct SharedTimes(BTreeMap<Vec<Time>, Arc<[Time]>>);

impl SharedTimes {
    pub(crate) fn share(&mut self, times: Vec<Time>) -> Arc<[Time]> {
        if let Some(known) = self.0.get(&times) {
            return known.clone();
        }
        let shared: Arc<[Time]> = times.as_slice().into();
        self.0.insert(times, shared.clone());
        shared
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: i64 = Time::TICKS_PER_SECOND;

    fn numbers(keys: &[(i64, f32)]) -> Keys {
        let (times, values) = keys.iter().map(|k| (Time(k.0), k.1)).unzip();
        simplify_keys(times, values, 1, Blend::Numbers)
    }

    #[test]
    fn stepped_keys_are_kept() {
        let two = 2 * SECOND;
        let keys = numbers(&[
            (0, 1.0),
            (SECOND - 1, 1.0),
            (SECOND, 5.0),
            (two - 1, 5.0),
            (two, 3.0),
            (two + 9, 3.0),
        ]);
        assert_eq!(keys.interpolation, Interpolation::Step);
        assert_eq!(keys.times, [Time(0), Time(SECOND), Time(2 * SECOND)]);
        assert_eq!(keys.values, [1.0, 5.0, 3.0]);
        let among_lines = numbers(&[(0, 1.0), (SECOND - 1, 2.0), (SECOND, 5.0)]);
        assert_eq!((among_lines.interpolation, among_lines.times.len()), (Interpolation::Linear, 3));
    }

    #[test]
    fn constant_tracks_become_one_key() {
        let keys = numbers(&[(0, 4.0), (SECOND, 4.0)]);
        assert_eq!((keys.times, keys.values), (vec![Time::ZERO], vec![4.0]));
        let turned = simplify_keys(
            vec![Time(0), Time(1)],
            vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0],
            4,
            Blend::Rotation,
        );
        assert_eq!(turned.times.len(), 1);
    }
}
