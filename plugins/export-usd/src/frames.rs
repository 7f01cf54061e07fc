//! Times of the stage as time codes: frames since the start of the export.

use choreo_plugin::motion::{FrameRate, Time};
use std::rc::Rc;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Frames {
    pub start: Time,
    pub rate: FrameRate,
}

impl Frames {
    pub(crate) fn per_second(&self) -> f64 {
        f64::from(self.rate.num) / f64::from(self.rate.den)
    }

    /// A duration in frames.
    pub(crate) fn duration_in_frames(&self, duration: Time) -> f64 {
        duration.0 as f64 * f64::from(self.rate.num)
            / (f64::from(self.rate.den) * Time::TICKS_PER_SECOND as f64)
    }

    /// The time code of a time. A frame's time gives a whole number, although ticks are rounded.
    pub(crate) fn time_code(&self, time: Time) -> f64 {
        let frames = self.duration_in_frames(time - self.start);
        let whole = frames.round();
        if (frames - whole).abs() < 0.49 * self.duration_in_frames(Time(1)) { whole } else { frames }
    }

    pub(crate) fn time_codes(&self, times: &[Time]) -> Rc<[f64]> {
        times.iter().map(|time| self.time_code(*time)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_whole_and_the_tick_before_is_not() {
        let rate = FrameRate { num: 30_000, den: 1001 };
        let frames = Frames { start: Time::ZERO, rate };
        for frame in [0, 1, 77, 1_000_003] {
            let time = rate.time_of(frame);
            assert_eq!(frames.time_code(time), frame as f64);
            assert!(frame == 0 || frames.time_code(time - Time(1)) < frame as f64);
        }
    }
}
