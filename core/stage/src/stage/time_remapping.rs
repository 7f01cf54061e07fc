//! Keyed speed and keyed clip time of a cue.

use crate::stage::channel::Channel;
use choreo_motion::{Interpolation, Time};

/// Time remapping of a clip, keyed over stage time. Integrals have closed forms; nothing is integrated in steps.
#[derive(Clone, Debug, PartialEq)]
pub enum TimeRemapping {
    /// Keyed speed (`Property::Speed`): clip seconds per stage second; negative runs backwards.
    Speed(SpeedCurve),
    /// Keyed clip time in seconds (`Property::ClipTime`).
    ClipTime(Channel),
}

/// A keyed speed and its integral up to each key.
#[derive(Clone, Debug, PartialEq)]
pub struct SpeedCurve {
    /// Keys of the speed.
    pub keys: Channel,
    /// Clip ticks from the first key to each key.
    integrals: Vec<f64>,
}

impl SpeedCurve {
    /// A speed curve with these keys, whose lists must match each other; see [`Channel::at`].
    pub fn new(keys: Channel) -> SpeedCurve {
        let mut integrals = vec![0.0];
        for i in 1..keys.times.len() {
            let before = integrals[i - 1];
            integrals.push(before + speed_integral(&keys, i - 1, 1.0));
        }
        SpeedCurve { keys, integrals }
    }

    /// Clip ticks from the first key to a time. Outside the keys the speeds of the end keys hold, so that the result is negative before the
    /// first key if its speed is positive.
    pub fn played(&self, time: Time) -> f64 {
        let times = &self.keys.times;
        let (Some(first), Some(last)) = (times.first(), times.last()) else { return 0.0 };
        let speed = |at: Time| self.keys.at(at).map_or(0.0, |v| v[0]);
        if time <= *first {
            return (time - *first).0 as f64 * speed(*first);
        }
        let end = self.integrals.last().copied().unwrap_or(0.0);
        if time >= *last {
            return end + (time - *last).0 as f64 * speed(*last);
        }
        let key = times.partition_point(|t| *t <= time) - 1;
        let share = (time - times[key]).0 as f64 / (times[key + 1] - times[key]).0 as f64;
        self.integrals[key] + speed_integral(&self.keys, key, share)
    }
}

/// Integral of the speed over one key interval, from its start to a share of it, in clip ticks.
pub(crate) fn speed_integral(keys: &Channel, key: usize, s: f64) -> f64 {
    let span = (keys.times[key + 1] - keys.times[key]).0 as f64;
    let cubic = keys.interpolation == Interpolation::CubicSpline;
    let number = |key: usize, part: usize| {
        keys.values.get(if cubic { key * 3 + part } else { key }).copied().unwrap_or(0.0)
    };
    let (a, b) = (number(key, 1), number(key + 1, 1));
    let mean = match keys.interpolation {
        Interpolation::Step => a * s,
        Interpolation::Linear => a * s + (b - a) * (s * s / 2.0),
        Interpolation::CubicSpline => {
            let secs = (keys.times[key + 1] - keys.times[key]).as_secs();
            let (out, into) = (number(key, 2), number(key + 1, 0));
            let (s2, s3, s4) = (s * s, s * s * s, s * s * s * s);
            a * (s - s3 + s4 / 2.0)
                + secs * out * (s2 / 2.0 - 2.0 * s3 / 3.0 + s4 / 4.0)
                + b * (s3 - s4 / 2.0)
                + secs * into * (s4 / 4.0 - s3 / 3.0)
        }
    };
    mean * span
}
