//! Durations of the last frames, and the limit of the frame rate.

use std::collections::VecDeque;
use std::time::Duration;

/// Number of frames that are remembered.
pub const MAX_FRAMES: usize = 240;

/// Durations of one frame, milliseconds: evaluation of poses, planning, drawing.
pub(crate) type Millis = [f32; 3];

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Performance {
    pub frames: VecDeque<Millis>,
    /// Limit of frames per second while playing. `None`: the rate of the scene.
    pub max_fps: Option<u32>,
}

impl Performance {
    pub fn add(&mut self, poses: Duration, plan: Duration, drawing: Duration) {
        if self.frames.len() >= MAX_FRAMES {
            self.frames.pop_front();
        }
        self.frames.push_back([poses, plan, drawing].map(|d| d.as_secs_f32() * 1e3));
    }

    /// Median and 95th percentile of total frame times, milliseconds.
    pub fn median_and_p95(&self) -> Option<[f32; 2]> {
        let mut all: Vec<f32> = self.frames.iter().map(|f| f.iter().sum()).collect();
        all.sort_by(f32::total_cmp);
        let last = all.len().checked_sub(1)?;
        Some([50, 95].map(|part| all[last * part / 100]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_last_frame_times_are_kept() {
        let mut p = Performance::default();
        assert_eq!(p.median_and_p95(), None);
        for n in 0..1000u64 {
            p.add(Duration::from_millis(n), Duration::from_millis(1), Duration::ZERO);
        }
        assert_eq!(p.frames.len(), MAX_FRAMES);
        let [median, high] = p.median_and_p95().unwrap();
        assert!((median - 880.0).abs() < 1.0 && (high - 988.0).abs() < 1.5, "{median} {high}");
    }
}
