//! Baked keys to the keys of a curve: times from the start of the clip, steps kept as steps, constants as one key.

use choreo_motion::{Interpolation, Time};
use glam::DQuat;
use std::collections::BTreeMap;
use std::sync::Arc;

/// How values are interpolated between two keys.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Blend {
    Numbers,
    /// Four numbers: the shorter arc.
    Rotation,
}

/// A key as ufbx bakes it.
pub struct Baked<const N: usize> {
    pub secs: f64,
    /// The value just before a step at this time.
    pub before_step: bool,
    /// The value just after a step at this time.
    pub after_step: bool,
    pub value: [f64; N],
}

/// Strictly increasing times from the start of the clip; straight lines between.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Track<const N: usize> {
    pub keys: Vec<(Time, [f64; N])>,
}

impl<const N: usize> Track<N> {
    /// Keys at the same time are a step: it takes one tick, 1.4 ns.
    pub fn new(baked: impl Iterator<Item = Baked<N>>, begin: Time) -> Track<N> {
        let mut keys: Vec<(Time, [f64; N])> = Vec::with_capacity(baked.size_hint().0);
        let mut last_before_step = false;
        for key in baked {
            let mut time = Time::from_secs(key.secs) - begin;
            if let Some(&(last, _)) = keys.last()
                && time <= last
            {
                if key.after_step {
                    time = Time(last.0 + 1);
                } else if last_before_step && keys.len() > 1 && keys[keys.len() - 2].0.0 < last.0 - 1 {
                    let at = keys.len() - 1;
                    keys[at].0 = Time(last.0 - 1);
                    time = last;
                } else {
                    time = last;
                    keys.pop();
                }
            }
            keys.push((time, key.value));
            last_before_step = key.before_step;
        }
        Track { keys }
    }

    pub fn at(&self, time: Time, blend: Blend) -> [f64; N] {
        let next = self.keys.partition_point(|k| k.0 <= time);
        match (next.checked_sub(1).map(|i| &self.keys[i]), self.keys.get(next)) {
            (Some((from, a)), Some((to, b))) => {
                let t = (time.0 - from.0) as f64 / (to.0 - from.0) as f64;
                mix(a, b, t, blend)
            }
            (Some((_, only)), None) | (None, Some((_, only))) => *only,
            (None, None) => [0.0; N],
        }
    }

    /// What lies in the clip, with keys at its ends where some lay outside.
    pub fn cut(mut self, end: Time, blend: Blend) -> Track<N> {
        let outside = |t: Time| t < Time::ZERO || t > end;
        if !self.keys.iter().any(|k| outside(k.0)) {
            return self;
        }
        let ends = [Time::ZERO, end].map(|t| (t, self.at(t, blend)));
        self.keys.retain(|k| k.0 > Time::ZERO && k.0 < end);
        self.keys.insert(0, ends[0]);
        if end > Time::ZERO {
            self.keys.push(ends[1]);
        }
        self
    }
}

fn mix<const N: usize>(a: &[f64; N], b: &[f64; N], t: f64, blend: Blend) -> [f64; N] {
    if blend == Blend::Rotation && N == 4 {
        let quat = |v: &[f64; N]| DQuat::from_xyzw(v[0], v[1], v[2], v[3]);
        let mixed = quat(a).slerp(quat(b), t).to_array();
        return std::array::from_fn(|i| mixed[i]);
    }
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * t)
}

/// Times and values of one curve.
pub struct Keys {
    pub interpolation: Interpolation,
    pub times: Vec<Time>,
    pub values: Vec<f32>,
}

/// Rows of `width` numbers at strictly increasing times, shortened: to one key where nothing changes, to STEP where
/// everything jumps.
pub fn finish(times: Vec<Time>, values: Vec<f32>, width: usize, blend: Blend) -> Keys {
    let row = |i: usize| &values[i * width..(i + 1) * width];
    let same =
        |a: &[f32], b: &[f32]| a == b || blend == Blend::Rotation && a.iter().zip(b).all(|(a, b)| *a == -*b);
    let count = times.len();
    if (1..count).all(|i| same(row(i), row(0))) {
        let values = row(0).to_vec();
        return Keys { interpolation: Interpolation::Linear, times: vec![times[0].max(Time::ZERO)], values };
    }
    // A step is two keys one tick apart; between steps nothing changes.
    let is_step = |i: usize| times[i + 1].0 - times[i].0 == 1;
    if (0..count - 1).all(|i| is_step(i) || same(row(i), row(i + 1))) {
        let kept: Vec<usize> = (0..count).filter(|&i| i == 0 || i + 1 == count || is_step(i - 1)).collect();
        let values = kept.iter().flat_map(|&i| row(i)).copied().collect();
        let times = kept.iter().map(|&i| times[i]).collect();
        return Keys { interpolation: Interpolation::Step, times, values };
    }
    Keys { interpolation: Interpolation::Linear, times, values }
}

/// Equal lists of times are stored once.
#[derive(Default)]
pub struct Times(BTreeMap<Vec<Time>, Arc<[Time]>>);

impl Times {
    pub fn share(&mut self, times: Vec<Time>) -> Arc<[Time]> {
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

    fn key(secs: f64, value: f64) -> Baked<1> {
        Baked { secs, before_step: false, after_step: false, value: [value] }
    }

    fn curve(track: Track<1>) -> Keys {
        let (times, values): (Vec<Time>, Vec<f32>) = track.keys.iter().map(|k| (k.0, k.1[0] as f32)).unzip();
        finish(times, values, 1, Blend::Numbers)
    }

    const SECOND: i64 = Time::TICKS_PER_SECOND;

    #[test]
    fn steps_stay_steps() {
        let before = |secs, value| Baked { before_step: true, ..key(secs, value) };
        let baked = [key(0.0, 1.0), before(1.0, 1.0), key(1.0, 5.0), before(2.0, 5.0), key(2.0, 3.0)];
        let keys = curve(Track::new(baked.into_iter(), Time::ZERO));
        assert_eq!(keys.interpolation, Interpolation::Step);
        assert_eq!(keys.times, [Time(0), Time(SECOND), Time(2 * SECOND)]);
        assert_eq!(keys.values, [1.0, 5.0, 3.0]);
    }

    #[test]
    fn a_step_among_lines_takes_one_tick() {
        let before = Baked { before_step: true, ..key(1.0, 2.0) };
        let keys = curve(Track::new([key(0.0, 1.0), before, key(1.0, 5.0)].into_iter(), Time::ZERO));
        assert_eq!(keys.interpolation, Interpolation::Linear);
        assert_eq!(keys.times, [Time(0), Time(SECOND - 1), Time(SECOND)]);
        let after = Baked { after_step: true, ..key(0.0, 7.0) };
        let keys = curve(Track::new([key(0.0, 1.0), after, key(1.0, 5.0)].into_iter(), Time::ZERO));
        assert_eq!(keys.times, [Time(0), Time(1), Time(SECOND)]);
    }

    #[test]
    fn what_does_not_change_is_one_key() {
        let keys = curve(Track::new([key(0.5, 4.0), key(1.5, 4.0)].into_iter(), Time::from_secs(0.5)));
        assert_eq!((keys.times, keys.values), (vec![Time::ZERO], vec![4.0]));
    }

    #[test]
    fn keys_outside_the_clip_are_cut_on_the_line() {
        let track = Track::new([key(-1.0, 0.0), key(1.0, 2.0), key(3.0, 4.0)].into_iter(), Time::ZERO);
        let cut = track.cut(Time::from_secs(2.0), Blend::Numbers);
        let times: Vec<f64> = cut.keys.iter().map(|k| k.0.as_secs()).collect();
        assert_eq!(times, [0.0, 1.0, 2.0]);
        assert_eq!(cut.keys.iter().map(|k| k.1[0]).collect::<Vec<_>>(), [1.0, 2.0, 3.0]);
    }

    #[test]
    fn times_that_fall_together_keep_the_later_value() {
        let track = Track::new([key(0.0, 1.0), key(1e-12, 2.0), key(1.0, 3.0)].into_iter(), Time::ZERO);
        assert_eq!(track.keys, [(Time::ZERO, [2.0]), (Time(SECOND), [3.0])]);
    }
}
