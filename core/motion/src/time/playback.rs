//! Maps stage time to clip time: speed, trim, repeat. Exact in ticks however long it plays.

use crate::input_error::InputError;
use crate::time::Time;

/// The continuation after the end of a clip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Repeat {
    /// The clip is played once, then the last pose is held.
    Once,
    /// The clip starts again.
    #[default]
    Loop,
    /// The clip is played forwards and backwards in turn, forever.
    PingPong,
}

/// How a clip is played.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Playback {
    /// Clip seconds per stage second; negative plays backwards from `trim.1`. Finite.
    pub speed: f64,
    /// The part of the clip that is played. Empty or reversed: its start is held.
    pub trim: (Time, Time),
    /// The continuation after the end.
    pub repeat: Repeat,
}

impl Playback {
    /// The whole clip, looped, at speed 1.
    pub fn whole(duration: Time) -> Playback {
        Playback { speed: 1.0, trim: (Time::ZERO, duration), repeat: Repeat::Loop }
    }

    /// Names the first field that does not fit.
    pub fn check(&self) -> Result<(), InputError> {
        InputError::check_value(self.speed.is_finite(), "Playback.speed", self.speed, "finite")?;
        let (start, end) = self.trim;
        let trim = format!("{} s to {} s", start.as_secs(), end.as_secs());
        InputError::check_value(start <= end, "Playback.trim", trim, "in order (use a negative speed)")
    }

    /// The time in the clip after `elapsed` of playing. Before the start (`elapsed < 0`) the first pose is held.
    ///
    /// A loop of period p shows its start, not its end, at p; ping-pong turns exactly at the ends.
    pub fn clip_time(&self, elapsed: Time) -> Time {
        self.clip_time_at(self.played(elapsed))
    }

    /// Clip ticks that have been played after `elapsed`, whole cycles included, forwards or backwards.
    pub fn played(&self, elapsed: Time) -> i128 {
        scaled_ticks(elapsed.0.max(0), self.speed.abs())
    }

    /// Clip time after a number of played ticks; a negative number goes back from the start.
    pub fn clip_time_at(&self, played: i128) -> Time {
        let (start, end) = self.trim;
        let length = (i128::from(end.0) - i128::from(start.0)).max(0);
        let offset = match self.repeat {
            _ if length == 0 => 0,
            Repeat::Once => played.clamp(0, length),
            Repeat::Loop => played.rem_euclid(length),
            Repeat::PingPong => {
                let phase = played.rem_euclid(2 * length);
                if phase > length { 2 * length - phase } else { phase }
            }
        };
        let at = if self.speed < 0.0 {
            i128::from(start.0) + length - offset
        } else {
            i128::from(start.0) + offset
        };
        // The time lies between the two ends of the trim, which are i64.
        Time(at as i64)
    }
}

/// `ticks * factor` to the nearest tick of the exact product (ties up), from the factor's own bits: a float product
/// would lose ticks after 148 days of stage time. Both are ≥ 0; NaN gives 0, too large a product saturates.
fn scaled_ticks(ticks: i64, factor: f64) -> i128 {
    if factor == 1.0 {
        return i128::from(ticks);
    }
    if ticks <= 0 || factor.is_nan() || factor <= 0.0 {
        return 0;
    }
    const SATURATED_TICKS: i128 = i128::MAX / 8;
    if factor.is_infinite() {
        return SATURATED_TICKS;
    }
    let bits = factor.to_bits();
    let exponent_bits = (bits >> 52) as i32;
    let fraction = (bits & ((1 << 52) - 1)) as i128;
    let (mantissa, exponent) =
        if exponent_bits == 0 { (fraction, -1074) } else { (fraction | 1 << 52, exponent_bits - 1075) };
    // The product has at most 63 + 53 bits.
    let product = i128::from(ticks) * mantissa;
    if exponent >= 0 {
        let shift = exponent as u32;
        if shift >= product.leading_zeros().saturating_sub(4) { SATURATED_TICKS } else { product << shift }
    } else if exponent < -120 {
        0
    } else {
        let shift = exponent.unsigned_abs();
        (product + (1 << (shift - 1))) >> shift
    }
}
