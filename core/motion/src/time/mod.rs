//! Integer time. One tick is 1/705 600 000 s, so that every common frame rate (24, 25, 30, 50, 60,
//! 90, 100, 120, 144 Hz and the NTSC rates n·1000/1001) and audio rate has a whole number of ticks.

pub(crate) mod ease;
pub(crate) mod playback;

use std::ops::{Add, AddAssign, Neg, Sub, SubAssign};

/// A point in time or a duration, in ticks. Arithmetic saturates: ±414 000 years is the end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Time(pub i64);

impl Time {
    /// A multiple of all usual frame and sample rates.
    pub const TICKS_PER_SECOND: i64 = 705_600_000;
    /// Time zero.
    pub const ZERO: Time = Time(0);
    /// The earliest time.
    pub const MIN: Time = Time(i64::MIN);
    /// The latest time.
    pub const MAX: Time = Time(i64::MAX);

    /// Time of `secs`, to the nearest tick; NaN gives zero and infinities saturate (callers that must refuse them check first).
    pub fn from_secs(secs: f64) -> Time {
        Time((secs * Self::TICKS_PER_SECOND as f64).round() as i64)
    }

    /// Time in seconds.
    #[inline(always)]
    pub fn as_secs(self) -> f64 {
        self.0 as f64 / Self::TICKS_PER_SECOND as f64
    }

    /// `(self - from) / (to - from)` as f32, computed from exact integer differences; 0 where the span is empty.
    #[inline(always)]
    pub fn fraction(self, from: Time, to: Time) -> f32 {
        let span = to.0.saturating_sub(from.0);
        if span <= 0 {
            return 0.0;
        }
        (self.0.saturating_sub(from.0) as f64 / span as f64) as f32
    }

    /// Scaled by a speed factor, rounded to the nearest tick (f64 is exact to a tick up to 148 days).
    pub fn scaled(self, factor: f64) -> Time {
        if factor == 1.0 {
            return self;
        }
        if factor == -1.0 {
            return -self;
        }
        Time((self.0 as f64 * factor).round() as i64)
    }

    /// The time in the middle between two, whatever their signs; rounded down.
    pub fn middle(self, other: Time) -> Time {
        Time(((i128::from(self.0) + i128::from(other.0)) >> 1) as i64)
    }

    /// Remainder in `[0, period)`; zero where the period is not positive.
    pub fn wrapped(self, period: Time) -> Time {
        if period.0 <= 0 { Time::ZERO } else { Time(self.0.rem_euclid(period.0)) }
    }
}

impl Add for Time {
    type Output = Time;
    fn add(self, other: Time) -> Time {
        Time(self.0.saturating_add(other.0))
    }
}
impl Sub for Time {
    type Output = Time;
    fn sub(self, other: Time) -> Time {
        Time(self.0.saturating_sub(other.0))
    }
}
impl AddAssign for Time {
    fn add_assign(&mut self, other: Time) {
        *self = *self + other;
    }
}
impl SubAssign for Time {
    fn sub_assign(&mut self, other: Time) {
        *self = *self - other;
    }
}
impl Neg for Time {
    type Output = Time;
    fn neg(self) -> Time {
        Time(self.0.saturating_neg())
    }
}

/// The ratio that equals a number exactly: the first such convergent of its continued fraction.
fn exact_ratio(number: f64) -> Option<FrameRate> {
    const MAX_TERM: f64 = i32::MAX as f64;
    let (mut before, mut last, mut rest) = ([0.0, 1.0], [1.0, 0.0], number);
    loop {
        let whole = libm::floor(rest);
        let next = [whole * last[0] + before[0], whole * last[1] + before[1]];
        if !(next[0] <= MAX_TERM && next[1] <= MAX_TERM) {
            return None;
        }
        if next[0] / next[1] == number {
            return Some(FrameRate { num: next[0] as u32, den: next[1] as u32 });
        }
        (before, last, rest) = (last, next, 1.0 / (rest - whole));
    }
}

/// The reason why a number is not a frame rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameRateError {
    /// The number is outside of 0.001 to 1000.
    Range,
    /// The number is no ratio of whole numbers below 2³¹, which video files require.
    Ratio,
}

crate::error_texts! { FrameRateError:
    Self::Range => "must be from 0.001 to 1000";
    Self::Ratio => "must be a ratio of whole numbers below 2147483648, such as any number of up to 6 decimal places";
}

/// Frames per second as a ratio: 30 is 30/1, 29.97 is 30000/1001.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FrameRate {
    /// Numerator.
    pub num: u32,
    /// Denominator.
    pub den: u32,
}

impl FrameRate {
    /// A rate in frames per second, 1/1000 ≤ fps ≤ 1000, as the smallest ratio that equals this `f64`. 23.976, 23.98, 29.97,
    /// 59.94 and 119.88 mean the NTSC ratios.
    pub fn from_fps(fps: f64) -> Result<FrameRate, FrameRateError> {
        if !(fps.is_finite() && (0.001..=1000.0).contains(&fps)) {
            return Err(FrameRateError::Range);
        }
        if fps.fract() == 0.0 {
            return Ok(FrameRate { num: fps as u32, den: 1 });
        }
        for base in [24u32, 30, 60, 120] {
            let ntsc = f64::from(base) * 1000.0 / 1001.0;
            let rounded =
                [100.0, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9].map(|digits| (ntsc * digits).round() / digits);
            if fps == ntsc || rounded.contains(&fps) {
                return Ok(FrameRate { num: base * 1000, den: 1001 });
            }
        }
        exact_ratio(fps).ok_or(FrameRateError::Ratio)
    }

    /// Frames per second.
    pub fn as_fps(self) -> f64 {
        f64::from(self.num) / f64::from(self.den)
    }

    /// Start of a frame, to the nearest tick (exact for the common rates).
    pub fn time_of(self, frame: i64) -> Time {
        let ticks = i128::from(frame) * i128::from(Time::TICKS_PER_SECOND) * i128::from(self.den);
        let num = i128::from(self.num);
        Time((2 * ticks + num).div_euclid(2 * num).clamp(i64::MIN.into(), i64::MAX.into()) as i64)
    }

    /// Number of frames whose start lies in `[0, length)`.
    pub fn frames_in(self, length: Time) -> i64 {
        let num = i128::from(length.0) * i128::from(self.num);
        let den = i128::from(Time::TICKS_PER_SECOND) * i128::from(self.den);
        ((num + den - 1).div_euclid(den)).clamp(0, i64::MAX.into()) as i64
    }
}
