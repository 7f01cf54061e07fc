//! Clip time of a cue: a function of the stage time alone, in whole ticks, so that long playback does not drift.

use crate::stage::clips::{Cue, Layer};
use crate::stage::time_remapping::TimeRemapping;
use choreo_motion::{Playback, Repeat, Time};

impl Cue {
    /// Speed, trim and repeat of its clip.
    pub fn playback(&self) -> Playback {
        Playback { speed: self.speed, trim: self.trim, repeat: self.repeat }
    }

    /// Whether the clip plays at one speed from its start on: there is no time remapping and no freeze.
    pub fn plays_at_constant_speed(&self) -> bool {
        self.time_remapping.is_none() && self.freezes.is_empty()
    }

    /// Ticks of the clip that have been played at a stage time, whole loops included; 0 before the start, negative if a speed curve runs
    /// backwards.
    pub fn played_ticks(&self, time: Time) -> i128 {
        let time = time.max(self.start);
        let mut played = self.ticks_without_freezes(time);
        for (from, to) in &self.freezes {
            let (from, to) = ((*from).max(self.start), (*to).max(self.start));
            if from < time {
                played -= self.ticks_without_freezes(to.min(time)) - self.ticks_without_freezes(from);
            }
        }
        played
    }

    fn ticks_without_freezes(&self, time: Time) -> i128 {
        let [into, out] = &self.phase_matched_fades;
        if let Some(out) = out
            && time >= out.start()
        {
            return out.played(time.min(out.end()))[0];
        }
        if let Some(into) = into {
            return if time < into.end() {
                into.played(time)[1]
            } else {
                into.played(into.end())[1] + self.playback().played(time - into.end())
            };
        }
        match &self.time_remapping {
            None => self.playback().played(time - self.start),
            Some(time_remapping) => match &**time_remapping {
                TimeRemapping::Speed(curve) => rounded_ticks(curve.played(time) - curve.played(self.start)),
                TimeRemapping::ClipTime(keys) => {
                    let at = keys.at(time).map_or(0.0, |v| v[0]) * Time::TICKS_PER_SECOND as f64;
                    let (start, end) = (self.trim.0.0 as f64, self.trim.1.0 as f64);
                    rounded_ticks(if self.speed < 0.0 { end - at } else { at - start })
                }
            },
        }
    }

    /// Stage time at which the trimmed part has been played once, to the tick; `None` if it never is.
    pub fn first_play_end(&self) -> Option<Time> {
        self.time_of_played(i128::from((self.trim.1 - self.trim.0).0.max(0)))
    }

    /// Stage time at which this number of ticks of the clip has been played; `None` if it never is. A speed curve that reverses is tested
    /// at its keys only.
    pub fn time_of_played(&self, ticks: i128) -> Option<Time> {
        if ticks <= 0 {
            return Some(self.start);
        }
        let has_played = |time: Time| self.played_ticks(time) >= ticks;
        // After the end of a curve or a freeze, playback goes on at its last speed.
        let keys = match self.time_remapping.as_deref() {
            Some(TimeRemapping::Speed(curve)) => &curve.keys.times[..],
            Some(TimeRemapping::ClipTime(keys)) => &keys.times[..],
            None => &[],
        };
        let mut boundaries: Vec<Time> =
            keys.iter().copied().chain(self.freezes.iter().map(|f| f.1)).collect();
        boundaries.retain(|t| *t > self.start);
        boundaries.sort_unstable();
        const SEARCH_LIMIT: Time = Time(Time::TICKS_PER_SECOND * 4_000_000);
        boundaries.push(boundaries.last().copied().unwrap_or(self.start) + SEARCH_LIMIT);
        let mut low = self.start;
        for boundary in boundaries {
            if !has_played(boundary) {
                low = boundary;
                continue;
            }
            let mut high = boundary;
            while (high - low).0 > 1 {
                let middle = low.middle(high);
                if has_played(middle) { high = middle } else { low = middle }
            }
            return Some(high);
        }
        None
    }

    /// Clip time at a stage time. `held`: the pose is held from there on, so the end of a loop shows its last pose instead of the first
    /// pose of the next loop.
    pub(crate) fn clip_time(&self, time: Time, held: bool) -> Time {
        let played = self.played_ticks(time);
        let at = self.playback().clip_time_at(played);
        let (first, last) = if self.speed < 0.0 { (self.trim.1, self.trim.0) } else { self.trim };
        if held && at == first && played > 0 && self.repeat == Repeat::Loop { last } else { at }
    }
}

/// Stage time up to which a cue of a base layer has played, and whether its pose is held since then.
pub(crate) fn plays_until(layer: &Layer, index: usize, time: Time) -> (Time, bool) {
    let cue = &layer.cues[index];
    // A cue that follows at once takes over a playing clip, not a frozen one.
    let held_from = cue.end.filter(|end| layer.cues.get(index + 1).is_none_or(|next| next.start > *end));
    (held_from.map_or(time, |end| end.min(time)), held_from.is_some_and(|end| time >= end))
}

fn rounded_ticks(ticks: f64) -> i128 {
    libm::round(ticks.clamp(-1e30, 1e30)) as i128
}
