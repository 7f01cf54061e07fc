//! Finds the two keys around a time without searching all of them.

use crate::time::Time;
use std::sync::Arc;

/// Key times that several tracks share.
#[derive(Debug)]
pub(crate) struct Timeline {
    times: Arc<[Time]>,
    /// Mean number of keys per tick.
    density: f64,
    /// Index for keys that are not evenly spaced: the first key in or after each of as many buckets as there are keys, and
    /// the number of keys. Empty if every key i lies in or next to bucket i.
    buckets: Box<[u32]>,
}

/// Two keys and how far a time lies between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Interval {
    pub key: usize,
    /// Equal to `key` at and beyond the ends.
    pub next: usize,
    /// 0 ≤ fraction < 1 (1 only by rounding).
    pub fraction: f32,
    /// Ticks from key to next.
    pub span: Time,
}

impl Timeline {
    /// `times`: strictly increasing, at least one.
    pub(crate) fn new(times: Arc<[Time]>) -> Timeline {
        let count = times.len();
        let span = (times[count - 1] - times[0]).0;
        if span <= 0 {
            return Timeline { times, density: 0.0, buckets: Box::default() };
        }
        let mut timeline =
            Timeline { times, density: (count - 1) as f64 / span as f64, buckets: Box::default() };
        // Times that a file states as f32 seconds are evenly spaced to some hundred ticks, not to one.
        let even = timeline.times.iter().enumerate().all(|(i, t)| timeline.bucket(*t).abs_diff(i) <= 1);
        if !even {
            let mut key = 0;
            let start_of = |bucket| {
                while key < count && timeline.bucket(timeline.times[key]) < bucket {
                    key += 1;
                }
                key as u32
            };
            timeline.buckets = (0..=count).map(start_of).collect();
        }
        timeline
    }

    /// Bucket of a time: never decreases with time, 0 at the first key, at most the last key's index.
    #[inline(always)]
    fn bucket(&self, time: Time) -> usize {
        let ticks = (time - self.times[0]).0.max(0);
        ((ticks as f64 * self.density) as usize).min(self.times.len() - 1)
    }

    /// Always inlined: as plain SSE code that is called from AVX code, it took 1.5 times as long.
    #[inline(always)]
    pub(crate) fn find(&self, time: Time) -> Interval {
        let times = &self.times;
        let last = times.len() - 1;
        if time <= times[0] {
            return Interval::at_key(0);
        }
        if time >= times[last] {
            return Interval::at_key(last);
        }
        let bucket = self.bucket(time);
        let mut key = if self.buckets.is_empty() {
            bucket.min(last - 1)
        } else {
            let (low, high) = (self.buckets[bucket] as usize, self.buckets[bucket + 1] as usize);
            (low + times[low..high].partition_point(|t| *t <= time)).min(last - 1)
        };
        // Evenly spaced keys take at most two steps; buckets, at most one step back.
        while times[key] > time {
            key -= 1;
        }
        while times[key + 1] <= time {
            key += 1;
        }
        Interval::between(times, key, time)
    }
}

impl Interval {
    #[inline(always)]
    fn at_key(key: usize) -> Interval {
        Interval { key, next: key, fraction: 0.0, span: Time::ZERO }
    }

    #[inline(always)]
    fn between(times: &[Time], key: usize, time: Time) -> Interval {
        let (from, to) = (times[key], times[key + 1]);
        Interval { key, next: key + 1, fraction: time.fraction(from, to), span: to - from }
    }
}

/// The interval of a time by bisection.
pub(crate) fn find_interval(times: &[Time], time: Time) -> Interval {
    match times.partition_point(|t| *t <= time) {
        0 => Interval::at_key(0),
        next if next == times.len() => Interval::at_key(next - 1),
        next => Interval::between(times, next - 1, time),
    }
}
