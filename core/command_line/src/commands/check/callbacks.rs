//! `on_frame` callbacks, tried at every frame.

use crate::failure::Problem;
use choreo_script::{Diagnostic, Limits, raise_hint};
use choreo_stage::{FrameEdits, Stage, StageError};
use rayon::prelude::*;
use std::time::Instant;

/// Videos longer than this are checked at as many frames, spread evenly.
const MOST_FRAMES: i64 = 20_000;
/// Different problems named before the rest is only counted.
const MOST_PROBLEMS: usize = 20;

/// The failure in one frame, if any; `None` where the time limit was reached.
type Looked = Option<Option<(Problem, f64)>>;

/// Each different failure once, with the first time and how often. Callbacks see nothing of the stage, so that they can be
/// run without posing it. No further frame is tried once `goes_on` says no.
pub fn failures(stage: &Stage, limits: &Limits, goes_on: &(dyn Fn() -> bool + Sync)) -> Vec<Problem> {
    if stage.hooks.is_empty() {
        return Vec::new();
    }
    let rate = stage.settings.fps;
    let frames = rate.frames_in(stage.settings.length).max(1);
    let step = (frames + MOST_FRAMES - 1) / MOST_FRAMES;
    let wanted: Vec<i64> = (0..frames).step_by(step.max(1) as usize).collect();
    // The results are in the order of the frames, whatever thread ran them.
    let started = Instant::now();
    let late = || started.elapsed().as_secs_f64() > limits.check_seconds || !goes_on();
    let results: Vec<Looked> =
        wanted.par_iter().map(|f| if late() { None } else { Some(failure(stage, *f)) }).collect();
    let done = results.iter().flatten().count();
    // Equal but for the time: (problem, first time, how many).
    let mut failed: Vec<(Problem, f64, u64)> = Vec::new();
    for (problem, secs) in results.into_iter().flatten().flatten() {
        match failed.iter().position(|(p, ..)| *p == problem) {
            Some(known) => failed[known].2 += 1,
            None if failed.len() < MOST_PROBLEMS => failed.push((problem, secs, 1)),
            None => {}
        }
    }
    let with_frames = |(mut problem, secs, count): (Problem, f64, u64)| {
        let more = match count {
            1 => String::new(),
            n => format!(" and in {} more frames", n - 1),
        };
        match &mut problem {
            Problem::Text(text) => *text = format!("{text}\n    at {secs} s{more}"),
            Problem::Script(d) => d.message = format!("{} (at {secs} s{more})", d.message),
        }
        problem
    };
    let mut problems: Vec<Problem> = failed.into_iter().map(with_frames).collect();
    if done < wanted.len() {
        problems.push(Problem::Text(format!(
            "the frames could not all be looked at in {} s: {done} of {} were\n    hint: {}",
            limits.check_seconds,
            wanted.len(),
            raise_hint("check_seconds", format!("{} s", limits.check_seconds))
        )));
    }
    problems
}

fn failure(stage: &Stage, frame: i64) -> Option<(Problem, f64)> {
    let time = stage.settings.fps.time_of(frame);
    let mut edits = FrameEdits::default();
    stage.hooks.iter().find_map(|hook| hook.run(time, &mut edits).err()).map(|error| match &error {
        StageError::Hook { error, time } => (callback(error.as_ref()), time.as_secs()),
        _ => (Problem::Text(error.to_string()), time.as_secs()),
    })
}

/// The problem with file, line and column, where the script's own error is known.
fn callback(error: &(dyn std::error::Error + Send + Sync + 'static)) -> Problem {
    match (error as &(dyn std::error::Error + 'static)).downcast_ref::<Diagnostic>() {
        Some(diagnostic) => Problem::Script(diagnostic.clone()),
        None => Problem::Text(error.to_string()),
    }
}
