//! Evaluation time of a stage as a ratio to that of another stage, since absolute times mean little on a busy machine.

use super::judge_error::JudgeError;
use super::snapshot_cache::SnapshotCache;
use super::{Judgment, text_format};
use choreo_motion::Time;
use choreo_script::testing::Expectation;
use choreo_stage::{Evaluator, Snapshot, Stage};
use std::sync::Arc;
use std::time::Instant;

/// Number of frames that are evaluated in one run, spread over the length of the stage.
const FRAMES_PER_RUN: i64 = 120;
/// Shortest run in seconds; shorter runs are repeated, since clock and scheduler are too coarse for them.
const MIN_RUN_SECS: f64 = 2e-3;
const ROUNDS_PER_BLOCK: usize = 7;
const MAX_BLOCKS: usize = 3;

/// Evaluates the two stages alternately, so that other load on the machine slows both down. The result of a block is the median ratio of its
/// rounds. The smallest result of up to three blocks counts, since other load is unlikely to raise all three.
pub(super) fn judge(snapshots: &[SnapshotCache], e: &Expectation, other: usize, factor: f64) -> Judgment {
    let not = if e.negated { "not " } else { "" };
    let expected = format!("{not}at most {} times the time of the other stage", text_format::number(factor));
    let Some(other) = snapshots.get(other) else {
        return Judgment::impossible(expected, "the other stage does not exist");
    };
    let mut timers = [StageTimer::new(&snapshots[e.stage].stage), StageTimer::new(&other.stage)];
    let repeats = match timers
        .iter_mut()
        .map(StageTimer::secs_per_run_after_warm_up)
        .collect::<Result<Vec<_>, JudgeError>>()
    {
        Ok(secs) => {
            let shortest = secs.into_iter().fold(f64::INFINITY, f64::min);
            (MIN_RUN_SECS / shortest.max(1e-9)).ceil().clamp(1.0, 1e5) as usize
        }
        Err(why) => return Judgment::impossible(expected, why),
    };
    let mut smallest_ratio = f64::INFINITY;
    for _ in 0..MAX_BLOCKS {
        let mut ratios: Vec<f64> = Vec::with_capacity(ROUNDS_PER_BLOCK);
        for round in 0..ROUNDS_PER_BLOCK {
            if let Err(why) = snapshots[e.stage].check_deadline() {
                return Judgment::impossible(expected, why);
            }
            let [a, b] = &mut timers;
            // The order alternates, because the second stage finds warmer caches.
            let (own_secs, other_secs) = match round % 2 {
                0 => {
                    let own_secs = a.secs_per_frame(repeats);
                    (own_secs, b.secs_per_frame(repeats))
                }
                _ => {
                    let other_secs = b.secs_per_frame(repeats);
                    (a.secs_per_frame(repeats), other_secs)
                }
            };
            match (own_secs, other_secs) {
                (Ok(own_secs), Ok(other_secs)) => ratios.push(own_secs / other_secs.max(1e-12)),
                (Err(why), _) | (_, Err(why)) => return Judgment::impossible(expected, why),
            }
        }
        ratios.sort_by(f64::total_cmp);
        smallest_ratio = smallest_ratio.min(ratios[ROUNDS_PER_BLOCK / 2]);
        if smallest_ratio <= factor {
            break;
        }
    }
    let times = |factor: f64| format!("{} times", text_format::number((factor * 100.0).round() / 100.0));
    Judgment::new((smallest_ratio <= factor) != e.negated, expected, times(smallest_ratio))
        .with_error(times((smallest_ratio - factor).abs()))
}

struct StageTimer {
    evaluator: Evaluator,
    snapshot: Snapshot,
    times: Vec<Time>,
}

impl StageTimer {
    fn new(stage: &Arc<Stage>) -> StageTimer {
        let settings = &stage.settings;
        let frames = settings.fps.frames_in(settings.length).max(1);
        let count = frames.min(FRAMES_PER_RUN);
        let times = (0..count).map(|k| settings.fps.time_of(k * frames / count)).collect();
        StageTimer { evaluator: Evaluator::new(stage.clone()), snapshot: Snapshot::default(), times }
    }

    /// Seconds of one run, which evaluates each frame once, after a warm-up run that is not counted.
    fn secs_per_run_after_warm_up(&mut self) -> Result<f64, JudgeError> {
        self.secs_per_frame(1)?;
        Ok(self.secs_per_frame(1)? * self.times.len() as f64)
    }

    /// Seconds per frame, so that stages of different length can be compared.
    fn secs_per_frame(&mut self, repeats: usize) -> Result<f64, JudgeError> {
        let start = Instant::now();
        for _ in 0..repeats {
            for time in &self.times {
                self.evaluator.at_into(*time, &mut self.snapshot)?;
                std::hint::black_box(&self.snapshot);
            }
        }
        Ok(start.elapsed().as_secs_f64() / (repeats * self.times.len()) as f64)
    }
}
