//! The playhead: playing, looping, scrubbing, stepping. Time passes by the clock of the caller.

use choreo_motion::{FrameRate, Time};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Playhead {
    /// Start of the displayed frame.
    time: Time,
    fps: FrameRate,
    length: Time,
    pub looping: bool,
    /// Range of playback: start and end. `None`: the whole scene.
    range: Option<(Time, Time)>,
    /// Clock when playback began, seconds, and the time on stage then. `None`: paused.
    playback_start: Option<(f64, Time)>,
    /// Stage seconds per second of the clock.
    speed: f64,
}

/// Playback speeds that are offered.
pub(crate) const SPEEDS: [f64; 5] = [0.1, 0.25, 0.5, 1.0, 2.0];

impl Default for Playhead {
    fn default() -> Playhead {
        let fps = FrameRate { num: 30, den: 1 };
        let (time, length) = (Time::ZERO, fps.time_of(1));
        Playhead { time, fps, length, looping: true, range: None, playback_start: None, speed: 1.0 }
    }
}

impl Playhead {
    pub fn time(&self) -> Time {
        self.time
    }

    pub fn fps(&self) -> FrameRate {
        self.fps
    }

    pub fn length(&self) -> Time {
        self.length
    }

    pub fn frames(&self) -> i64 {
        self.fps.frames_in(self.length).max(1)
    }

    pub fn frame(&self) -> i64 {
        self.frame_at(self.time)
    }

    /// Number of the frame displayed at a time, clamped to the scene.
    pub(crate) fn frame_at(&self, time: Time) -> i64 {
        let (mut low, mut high) = (0, self.frames() - 1);
        while low < high {
            let middle = low + (high - low + 1) / 2;
            match self.fps.time_of(middle) <= time {
                true => low = middle,
                false => high = middle - 1,
            }
        }
        low
    }

    /// Takes the frame rate and length of another version; the time is kept if it still exists.
    pub fn set_scene(&mut self, fps: FrameRate, length: Time) {
        if (self.fps, self.length) != (fps, length) {
            (self.fps, self.length) = (fps, length);
            let (time, range) = (self.time, self.range.take());
            self.seek(time);
            // A range beyond the new end is dropped.
            self.set_range(range.filter(|(from, _)| *from < length).map(|(a, b)| (a, b - Time(1))));
        }
    }

    pub fn range(&self) -> Option<(Time, Time)> {
        self.range
    }

    /// Limits playback to whole frames, at least one, within the scene.
    pub(crate) fn set_range(&mut self, range: Option<(Time, Time)>) {
        self.range = range.map(|(a, b)| {
            let first = self.frame_at(a.min(b));
            let last = self.frame_at(a.max(b)).max(first);
            (self.fps.time_of(first), self.fps.time_of(last + 1))
        });
    }

    /// Start and end of playback.
    fn playback_bounds(&self) -> (Time, Time) {
        self.range.unwrap_or((Time::ZERO, self.fps.time_of(self.frames())))
    }

    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// Sets the playback speed; playback continues from the present frame.
    pub(crate) fn set_speed(&mut self, speed: f64) {
        self.speed = speed;
        self.seek(self.time);
    }

    pub fn is_playing(&self) -> bool {
        self.playback_start.is_some()
    }

    /// Starts playback. `now`: clock of the caller, seconds.
    pub fn play(&mut self, now: f64) {
        // Playback starts again from the beginning if the playhead is at the end.
        let (first, end) = self.playback_bounds();
        if self.time < first || self.fps.time_of(self.frame() + 1) >= end {
            self.time = first;
        }
        self.playback_start = Some((now, self.time));
    }

    pub fn pause(&mut self) {
        self.playback_start = None;
    }

    pub(crate) fn toggle_playback(&mut self, now: f64) {
        match self.is_playing() {
            true => self.pause(),
            false => self.play(now),
        }
    }

    /// Moves to the frame at a time; playback continues from there at the next tick.
    pub fn seek(&mut self, time: Time) {
        self.time = self.fps.time_of(self.frame_at(time));
        if self.is_playing() {
            // The clock is only known at the next tick; NaN stands for that.
            self.playback_start = Some((f64::NAN, self.time));
        }
    }

    /// Pauses, and moves by a number of frames.
    pub fn step(&mut self, frames: i64) {
        self.pause();
        let frame = (self.frame() + frames).clamp(0, self.frames() - 1);
        self.time = self.fps.time_of(frame);
    }

    /// Advances to the time of the clock. Returns the seconds until the next frame is due, or `None` if paused.
    pub fn tick(&mut self, now: f64) -> Option<f64> {
        let (playback_start, from) = self.playback_start?;
        let playback_start = if playback_start.is_nan() { now } else { playback_start };
        self.playback_start = Some((playback_start, from));
        let (first, end) = self.playback_bounds();
        let mut to = from + Time::from_secs((now - playback_start).max(0.0) * self.speed);
        if to >= end {
            if !self.looping {
                self.time = self.fps.time_of(self.frame_at(end - Time(1)));
                self.playback_start = None;
                return None;
            }
            to = first + (to - first).wrapped(end - first);
            self.playback_start = Some((now, to));
        }
        let frame = self.frame_at(to);
        self.time = self.fps.time_of(frame);
        Some((self.fps.time_of(frame + 1) - to).as_secs().max(0.0) / self.speed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn playhead() -> Playhead {
        let mut p = Playhead::default();
        p.set_scene(FrameRate { num: 25, den: 1 }, Time::from_secs(2.0));
        p
    }

    #[test]
    fn the_frame_at_a_time_is_the_last_started_one() {
        let mut p = playhead();
        p.seek(Time::from_secs(0.999));
        assert_eq!((p.frame(), p.time()), (24, Time::from_secs(0.96)));
        p.seek(Time::from_secs(99.0));
        assert_eq!(p.frame(), 49);
        p.seek(Time::from_secs(-1.0));
        assert_eq!(p.frame(), 0);
    }

    #[test]
    fn playback_follows_the_clock_and_skips_frames() {
        let mut p = playhead();
        p.play(100.0);
        assert_eq!(p.tick(100.0), Some(0.04));
        assert!((p.tick(100.09).unwrap() - 0.03).abs() < 1e-9);
        assert_eq!(p.frame(), 2);
        // Looping: 2.05 s of playback end at 0.05 s.
        p.tick(102.05);
        assert_eq!(p.frame(), 1);
        p.looping = false;
        p.tick(105.0);
        assert_eq!((p.frame(), p.is_playing()), (49, false));
        p.play(200.0);
        assert_eq!(p.frame(), 0, "playback at the end starts again at the beginning");
    }

    #[test]
    fn playback_continues_from_the_scrubbed_time() {
        let mut p = playhead();
        p.play(0.0);
        p.tick(0.5);
        p.seek(Time::from_secs(1.0));
        assert!(p.is_playing());
        p.tick(7.0);
        assert_eq!(p.frame(), 25, "playback time counts from the seek");
        p.tick(7.08);
        assert_eq!(p.frame(), 27);
    }

    #[test]
    fn playback_speed_scales_time() {
        let mut p = playhead();
        p.set_speed(0.5);
        p.play(0.0);
        // Half a second of the clock is a quarter on stage: frame 6, which ends at 0.28 s.
        assert!((p.tick(0.5).unwrap() - 0.06).abs() < 1e-9);
        assert_eq!(p.frame(), 6);
        p.set_speed(2.0);
        p.tick(0.5);
        assert_eq!(p.frame(), 6, "a new speed applies from the current frame");
        p.tick(0.71);
        assert_eq!(p.frame(), 16);
        p.set_scene(FrameRate { num: 25, den: 1 }, Time::from_secs(4.0));
        assert_eq!(p.speed(), 2.0);
    }

    #[test]
    fn a_step_pauses_playback_and_stays_within_the_scene() {
        let mut p = playhead();
        p.play(0.0);
        p.step(1);
        assert_eq!((p.frame(), p.is_playing()), (1, false));
        p.step(-5);
        assert_eq!(p.frame(), 0);
        p.step(1000);
        assert_eq!(p.frame(), 49);
    }

    #[test]
    fn a_playback_range_loops() {
        let mut p = playhead();
        p.set_range(Some((Time::from_secs(1.01), Time::from_secs(0.5))));
        assert_eq!(p.range(), Some((Time::from_secs(0.48), Time::from_secs(1.04))), "whole frames, in order");
        p.play(0.0);
        assert_eq!(p.frame(), 12);
        p.tick(0.57);
        assert_eq!(p.frame(), 12, "0.56 s long");
        p.looping = false;
        p.tick(5.0);
        assert_eq!((p.frame(), p.is_playing()), (25, false));
        p.set_scene(FrameRate { num: 25, den: 1 }, Time::from_secs(1.0));
        assert_eq!(p.range(), Some((Time::from_secs(0.48), Time::from_secs(1.0))));
        p.set_scene(FrameRate { num: 25, den: 1 }, Time::from_secs(0.4));
        assert_eq!(p.range(), None);
    }

    #[test]
    fn a_reload_keeps_the_time_and_whether_it_plays() {
        let mut p = playhead();
        p.seek(Time::from_secs(1.6));
        p.play(0.0);
        p.set_scene(FrameRate { num: 50, den: 1 }, Time::from_secs(4.0));
        assert_eq!((p.time(), p.is_playing()), (Time::from_secs(1.6), true));
        p.set_scene(FrameRate { num: 50, den: 1 }, Time::from_secs(1.0));
        assert_eq!(p.frame(), 49, "a time after the new end becomes the last frame");
    }

    #[test]
    fn frame_rates_with_fractions_reach_every_frame() {
        let mut p = Playhead::default();
        p.set_scene(FrameRate { num: 30000, den: 1001 }, Time::from_secs(10.0));
        for frame in 0..p.frames() {
            p.seek(p.fps().time_of(frame));
            assert_eq!(p.frame(), frame);
        }
    }
}
