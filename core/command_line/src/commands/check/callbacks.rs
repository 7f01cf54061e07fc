//! Test runs of `on_frame` callbacks at every frame.

use crate::failure::Problem;
use choreo_script::{Diagnostic, Limits, raise_hint};
use choreo_stage::{FrameEdits, Stage, StageError};
use rayon::prelude::*;
use std::time::Instant;

/// Largest number of frames that are checked; in longer videos they are spread evenly.
const MAX_CHECKED_FRAMES: i64 = 20_000;
/// Largest number of different problems that are reported.
const MAX_PROBLEMS: usize = 20;

/// Result of one frame: its problem with the time in seconds, if any. The outer `None` means that the frame was not checked.
type FrameResult = Option<Option<(Problem, f64)>>;

/// Runs the callbacks, and returns each different problem once, with its first time and the number of frames. Callbacks cannot read the
/// stage, so they run without posing it. No further frame is tried once `should_continue` returns false.
pub(super) fn callback_problems(
    stage: &Stage,
    limits: &Limits,
    should_continue: &(dyn Fn() -> bool + Sync),
) -> Vec<Problem> {
    if stage.frame_callbacks.is_empty() {
        return Vec::new();
    }
    let rate = stage.settings.fps;
    let frames = rate.frames_in(stage.settings.length).max(1);
    let step = (frames + MAX_CHECKED_FRAMES - 1) / MAX_CHECKED_FRAMES;
    let checked_frames: Vec<i64> = (0..frames).step_by(step.max(1) as usize).collect();
    // The results are in the order of the frames, regardless of the threads.
    let started = Instant::now();
    let is_late = || started.elapsed().as_secs_f64() > limits.check_seconds || !should_continue();
    let results: Vec<FrameResult> = checked_frames
        .par_iter()
        .map(|f| if is_late() { None } else { Some(run_callbacks_at(stage, *f)) })
        .collect();
    let done = results.iter().flatten().count();
    // Problems that are equal except for the time: (problem, first time, number of frames).
    let mut failed: Vec<(Problem, f64, u64)> = Vec::new();
    for (problem, secs) in results.into_iter().flatten().flatten() {
        match failed.iter().position(|(p, ..)| *p == problem) {
            Some(known) => failed[known].2 += 1,
            None if failed.len() < MAX_PROBLEMS => failed.push((problem, secs, 1)),
            None => {}
        }
    }
    let with_frames = |(mut problem, secs, count): (Problem, f64, u64)| {
        let more = match count {
            1 => String::new(),
            2 => " and in 1 more frame".to_string(),
            n => format!(" and in {} more frames", n - 1),
        };
        match &mut problem {
            Problem::Text(text) => *text = format!("{text}\n    at {secs} s{more}"),
            Problem::Script(d) => d.message = format!("{} (at {secs} s{more})", d.message),
        }
        problem
    };
    let mut problems: Vec<Problem> = failed.into_iter().map(with_frames).collect();
    if done < checked_frames.len() {
        problems.push(Problem::Text(format!(
            "not all frames could be checked in {} s: {done} of {} were checked\n    hint: {}",
            limits.check_seconds,
            checked_frames.len(),
            raise_hint("check_seconds", format!("{} s", limits.check_seconds))
        )));
    }
    problems
}

fn run_callbacks_at(stage: &Stage, frame: i64) -> Option<(Problem, f64)> {
    let time = stage.settings.fps.time_of(frame);
    let mut edits = FrameEdits::default();
    stage.frame_callbacks.iter().find_map(|callback| callback.run(time, &mut edits).err()).map(|error| {
        match &error {
            StageError::Callback { error, time } => (callback_problem(error.as_ref()), time.as_secs()),
            _ => (Problem::Text(error.to_string()), time.as_secs()),
        }
    })
}

/// Turns an error into a problem, with file, line and column if it is an error of a script.
fn callback_problem(error: &(dyn std::error::Error + Send + Sync + 'static)) -> Problem {
    match (error as &(dyn std::error::Error + 'static)).downcast_ref::<Diagnostic>() {
        Some(diagnostic) => Problem::Script(diagnostic.clone()),
        None => Problem::Text(error.to_string()),
    }
}
