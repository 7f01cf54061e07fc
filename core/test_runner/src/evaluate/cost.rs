//! Evaluation time of a stage as a ratio to that of another stage, since absolute times mean little on a busy machine.

use super::snapshot_cache::SnapshotCache;
use super::unjudged::Unjudged;
use super::{Judged, words};
use choreo_motion::Time;
use choreo_script::testing::Expectation;
use choreo_stage::{Evaluator, Snapshot, Stage};
use std::sync::Arc;
use std::time::Instant;

/// Number of frames that are evaluated in one run, spread over the length of the stage.
const FRAMES: i64 = 120;
/// Shortest run in seconds; shorter runs are repeated, since clock and scheduler are too coarse for them.
const SHORTEST_SECS: f64 = 2e-3;
const ROUNDS: usize = 7;
const BLOCKS: usize = 3;

/// Runs the two stages in turns, so that other load on the machine slows both down. The result of a block is the median ratio of its
/// rounds. The smallest of three blocks counts, since other load is unlikely to raise all three.
pub fn judge(snapshots: &[SnapshotCache], e: &Expectation, other: usize, factor: f64) -> Judged {
    let not = if e.negated { "not " } else { "" };
    let expected = format!("{not}at most {} times the time of the other stage", words::number(factor));
    let Some(other) = snapshots.get(other) else {
        return Judged::impossible(expected, "the other stage does not exist");
    };
    let mut runs = [Run::new(&snapshots[e.stage].stage), Run::new(&other.stage)];
    let repeats = match runs.iter_mut().map(Run::secs_after_warm_up).collect::<Result<Vec<_>, Unjudged>>() {
        Ok(secs) => {
            let shortest = secs.into_iter().fold(f64::INFINITY, f64::min);
            (SHORTEST_SECS / shortest.max(1e-9)).ceil().clamp(1.0, 1e5) as usize
        }
        Err(why) => return Judged::impossible(expected, why),
    };
    let mut least = f64::INFINITY;
    for _ in 0..BLOCKS {
        let mut ratios: Vec<f64> = Vec::with_capacity(ROUNDS);
        for round in 0..ROUNDS {
            if let Err(why) = snapshots[e.stage].check_deadline() {
                return Judged::impossible(expected, why);
            }
            let [a, b] = &mut runs;
            // The order alternates, because the second stage finds warmer caches.
            let (own, others) = match round % 2 {
                0 => {
                    let own = a.secs(repeats);
                    (own, b.secs(repeats))
                }
                _ => {
                    let others = b.secs(repeats);
                    (a.secs(repeats), others)
                }
            };
            match (own, others) {
                (Ok(own), Ok(others)) => ratios.push(own / others.max(1e-12)),
                (Err(why), _) | (_, Err(why)) => return Judged::impossible(expected, why),
            }
        }
        ratios.sort_by(f64::total_cmp);
        least = least.min(ratios[ROUNDS / 2]);
        if least <= factor {
            break;
        }
    }
    let times = |factor: f64| format!("{} times", words::number((factor * 100.0).round() / 100.0));
    Judged::new((least <= factor) != e.negated, expected, times(least)).by(times((least - factor).abs()))
}

struct Run {
    evaluator: Evaluator,
    snapshot: Snapshot,
    times: Vec<Time>,
}

impl Run {
    fn new(stage: &Arc<Stage>) -> Run {
        let settings = &stage.settings;
        let frames = settings.fps.frames_in(settings.length).max(1);
        let count = frames.min(FRAMES);
        let times = (0..count).map(|k| settings.fps.time_of(k * frames / count)).collect();
        Run { evaluator: Evaluator::new(stage.clone()), snapshot: Snapshot::default(), times }
    }

    /// Seconds for all frames once, after a warm-up run that is not counted.
    fn secs_after_warm_up(&mut self) -> Result<f64, Unjudged> {
        self.secs(1)?;
        Ok(self.secs(1)? * self.times.len() as f64)
    }

    fn secs(&mut self, repeats: usize) -> Result<f64, Unjudged> {
        let start = Instant::now();
        for _ in 0..repeats {
            for time in &self.times {
                self.evaluator.at_into(*time, &mut self.snapshot)?;
                std::hint::black_box(&self.snapshot);
            }
        }
        // Seconds per frame, so that stages of different length can be compared.
        Ok(start.elapsed().as_secs_f64() / (repeats * self.times.len()) as f64)
    }
}
