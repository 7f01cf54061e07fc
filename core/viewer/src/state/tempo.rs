//! Beats of a scene's music, which dragged times snap to.

use serde_json::{Value, json};

/// Tempo in beats per minute; 0 without music.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tempo {
    pub beats_per_minute: f64,
    /// Time of the first beat on stage, seconds.
    pub first_beat_secs: f64,
}

impl Tempo {
    /// Largest number of beats per minute.
    pub const MAX_BEATS_PER_MINUTE: f64 = 1000.0;

    /// Latest time of the first beat, seconds.
    pub const MAX_FIRST_BEAT_SECS: f64 = 1e4;

    /// Parses the output of [`Tempo::to_json`]. `None` without beats.
    pub fn from_json(value: &Value) -> Option<Tempo> {
        let number = |name: &str, most: f64| value[name].as_f64().filter(|n| (0.0..=most).contains(n));
        let tempo = Tempo {
            beats_per_minute: number("bpm", Tempo::MAX_BEATS_PER_MINUTE)?,
            first_beat_secs: number("first", Tempo::MAX_FIRST_BEAT_SECS)?,
        };
        tempo.beat_secs().map(|_| tempo)
    }

    pub fn to_json(&self) -> Value {
        json!({ "bpm": self.beats_per_minute, "first": self.first_beat_secs })
    }

    /// Duration of a beat, seconds. `None` without beats.
    pub fn beat_secs(&self) -> Option<f64> {
        (self.beats_per_minute > 0.0).then(|| 60.0 / self.beats_per_minute)
    }

    /// Time of the beat nearest to a time, seconds.
    pub fn nearest_beat(&self, secs: f64) -> Option<f64> {
        let beat = self.beat_secs()?;
        Some(self.first_beat_secs + ((secs - self.first_beat_secs) / beat).round().max(0.0) * beat)
    }

    /// Times of the beats between two times, seconds. None if the beats are closer together than `min_gap`.
    pub fn beats_between(&self, from: f64, to: f64, min_gap: f64) -> impl Iterator<Item = f64> {
        let beat = self.beat_secs().filter(|beat| *beat >= min_gap);
        let (first, step) = (self.first_beat_secs, beat.unwrap_or(1.0));
        let (low, high) = (((from - first) / step).ceil().max(0.0), ((to - first) / step).floor());
        let count = beat.map_or(0, |_| (high - low + 1.0).max(0.0) as usize);
        (0..count).map(move |number| first + (low + number as f64) * step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beats_count_from_the_first() {
        let tempo = Tempo { beats_per_minute: 120.0, first_beat_secs: 0.2 };
        assert_eq!([0.0, 0.4, 0.5, 9.9].map(|secs| tempo.nearest_beat(secs)), [0.2, 0.2, 0.7, 9.7].map(Some));
        assert_eq!(tempo.beats_between(0.0, 1.5, 0.1).collect::<Vec<_>>(), [0.2, 0.7, 1.2]);
        assert_eq!(tempo.beats_between(0.0, 1.5, 0.6).count(), 0);
        assert_eq!(Tempo::default().nearest_beat(1.0), None);
        assert_eq!(Tempo::default().beats_between(0.0, 9.0, 0.0).count(), 0);
    }
}
