//! Adaptive resolution while the view moves: a half or a quarter of each side if full images take longer than the scene's frame rate allows. Also
//! counts the frames that are dropped nevertheless.

/// Largest divisor of a side.
const MAX_DIVISOR: u32 = 4;
/// Fraction of a frame's time that larger images may take before they are tried again.
const RETRY_FRACTION: f64 = 0.7;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResolutionReduction {
    /// Divisor of the sides of the image: 1, 2 or 4.
    divisor: u32,
    /// Number of the frame displayed last during playback.
    last: Option<i64>,
    /// Number of dropped frames since playback began.
    pub dropped: i64,
}

impl Default for ResolutionReduction {
    fn default() -> ResolutionReduction {
        ResolutionReduction { divisor: 1, last: None, dropped: 0 }
    }
}

impl ResolutionReduction {
    /// Divisor of the sides; images at rest have full resolution.
    pub fn divisor(&self, moving: bool) -> u32 {
        if moving { self.divisor } else { 1 }
    }

    /// Records the duration of a moving image and the time that the frame rate allows for it, both in milliseconds.
    pub fn record_duration(&mut self, millis: f64, budget: f64) {
        if millis > budget {
            self.divisor = (self.divisor * 2).min(MAX_DIVISOR);
        } else if self.divisor > 1 && millis * 4.0 < budget * RETRY_FRACTION {
            // Images with half the divisor have four times as many pixels.
            self.divisor /= 2;
        }
    }

    /// Records a displayed frame. `playing`: whether the next one should be its successor.
    pub fn record_frame(&mut self, frame: i64, playing: bool) {
        match (self.last, playing) {
            // The difference is negative at the start of a loop.
            (Some(last), true) => self.dropped += (frame - last - 1).max(0),
            (None, true) => self.dropped = 0,
            (_, false) => {}
        }
        self.last = playing.then_some(frame);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn image_size_is_reduced_until_the_frame_rate_holds() {
        let mut r = ResolutionReduction::default();
        assert_eq!((r.divisor(true), r.divisor(false)), (1, 1));
        r.record_duration(90.0, 40.0);
        assert_eq!((r.divisor(true), r.divisor(false)), (2, 1));
        r.record_duration(22.0, 40.0);
        assert_eq!(r.divisor(true), 2, "images of full size would take 88 ms");
        r.record_duration(50.0, 40.0);
        r.record_duration(50.0, 40.0);
        assert_eq!(r.divisor(true), 4);
        r.record_duration(6.0, 40.0);
        assert_eq!(r.divisor(true), 2);
        r.record_duration(6.0, 40.0);
        assert_eq!(r.divisor(true), 1);
    }

    #[test]
    fn skipped_frames_are_counted() {
        let mut r = ResolutionReduction::default();
        for (frame, dropped) in [(10, 0), (11, 0), (14, 2), (15, 2), (2, 2), (4, 3)] {
            r.record_frame(frame, true);
            assert_eq!(r.dropped, dropped, "at {frame}");
        }
        r.record_frame(90, false);
        assert_eq!(r.dropped, 3);
        r.record_frame(5, true);
        assert_eq!(r.dropped, 0);
    }
}
