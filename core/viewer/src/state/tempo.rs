//! Beats of a scene's music, which dragged times snap to.

use serde_json::{Value, json};

/// Tempo in beats per minute; 0 without music.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tempo {
    pub per_minute: f64,
    /// Time of the first beat on stage, seconds.
    pub first: f64,
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
            per_minute: number("bpm", Tempo::MAX_BEATS_PER_MINUTE)?,
            first: number("first", Tempo::MAX_FIRST_BEAT_SECS)?,
        };
        tempo.beat().map(|_| tempo)
    }

    pub fn to_json(&self) -> Value {
        json!({ "bpm": self.per_minute, "first": self.first })
    }

    /// Duration of a beat, seconds. `None` without beats.
    pub fn beat(&self) -> Option<f64> {
        (self.per_minute > 0.0).then(|| 60.0 / self.per_minute)
    }

    /// Time of the beat nearest to a time, seconds.
    pub fn nearest(&self, secs: f64) -> Option<f64> {
        let beat = self.beat()?;
        Some(self.first + ((secs - self.first) / beat).round().max(0.0) * beat)
    }

    /// Times of the beats between two times, seconds. None if the beats are closer together than `least`.
    pub fn between(&self, from: f64, to: f64, least: f64) -> impl Iterator<Item = f64> {
        let beat = self.beat().filter(|beat| *beat >= least);
        let (first, step) = (self.first, beat.unwrap_or(1.0));
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
        let tempo = Tempo { per_minute: 120.0, first: 0.2 };
        assert_eq!([0.0, 0.4, 0.5, 9.9].map(|secs| tempo.nearest(secs)), [0.2, 0.2, 0.7, 9.7].map(Some));
        assert_eq!(tempo.between(0.0, 1.5, 0.1).collect::<Vec<_>>(), [0.2, 0.7, 1.2]);
        assert_eq!(tempo.between(0.0, 1.5, 0.6).count(), 0);
        assert_eq!(Tempo::default().nearest(1.0), None);
        assert_eq!(Tempo::default().between(0.0, 9.0, 0.0).count(), 0);
    }
}
