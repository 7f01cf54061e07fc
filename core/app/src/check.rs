//! `choreo check`: everything that can be found without drawing: the script, its assets, and every frame's evaluation.

use crate::args::CheckArgs;
use crate::failure::{Failure, Problem, print, print_json};
use crate::{registry, scene};
use choreo_plugin::Registry;
use choreo_script::{Diagnostic, Limits, raise_hint};
use choreo_stage::{Evaluator, Stage, StageError};
use serde_json::json;
use std::sync::Arc;
use std::time::Instant;

/// Videos longer than this are checked at as many frames, spread evenly.
const MOST_FRAMES: i64 = 20_000;
/// Different problems named before the rest is only counted.
const MOST_PROBLEMS: usize = 20;

pub fn run(args: CheckArgs) -> Result<(), Failure> {
    let registry = registry::registry();
    let scene = scene::open(&args.scene, &registry)?;
    if !args.json {
        scene.printed.iter().for_each(|line| eprintln!("{line}"));
    }
    let problems = problems(&scene.stage, &registry, &scene.limits);
    if !problems.is_empty() {
        if !args.json {
            scene.warnings.iter().for_each(|w| eprintln!("{w}"));
        }
        return Err(Failure::Input(problems));
    }
    let frames = scene.stage.settings.fps.frames_in(scene.stage.settings.length);
    if args.json {
        return print_json(&json!({ "ok": true, "frames": frames, "warnings": scene.warnings }));
    }
    scene.warnings.iter().for_each(|w| eprintln!("{w}"));
    let warnings = match scene.warnings.len() {
        0 => "no warnings".to_string(),
        1 => "1 warning".to_string(),
        n => format!("{n} warnings"),
    };
    let plural = if frames == 1 { "" } else { "s" };
    print(&format!("{}: good, {frames} frame{plural}, {warnings}\n", args.scene.input.display()))
}

fn problems(stage: &Arc<Stage>, registry: &Registry, limits: &Limits) -> Vec<Problem> {
    let mut problems: Vec<Problem> = stage.check().iter().map(|e| Problem::Text(e.to_string())).collect();
    for used in &stage.effects {
        if registry.effect(&used.plugin).is_none() {
            let names = || registry.effects().iter().map(|e| e.manifest().name.as_str());
            problems.push(Problem::Text(format!(
                "unknown effect \"{}\"{}",
                used.plugin,
                choreo_script::did_you_mean(&used.plugin, names())
            )));
        }
    }
    let settings = &stage.settings;
    let frames = settings.fps.frames_in(settings.length).max(1);
    let step = (frames + MOST_FRAMES - 1) / MOST_FRAMES;
    let mut evaluator = Evaluator::new(stage.clone());
    // Equal but for the time: (problem, first time, how many).
    let mut failed: Vec<(Problem, f64, u64)> = Vec::new();
    let started = Instant::now();
    for (done, frame) in (0..frames).step_by(step.max(1) as usize).enumerate() {
        if started.elapsed().as_secs_f64() > limits.check_seconds {
            let all = (frames + step - 1) / step;
            problems.push(Problem::Text(format!(
                "the frames could not all be looked at in {} s: {done} of {all} were\n    hint: {}",
                limits.check_seconds,
                raise_hint("check_seconds", format!("{} s", limits.check_seconds))
            )));
            break;
        }
        let time = settings.fps.time_of(frame);
        let Err(error) = evaluator.at(time) else { continue };
        // A camera that frames the whole scene looks at other times too: a callback tells when it failed.
        let (problem, secs) = match &error {
            StageError::Hook { error, time } => (callback(error.as_ref()), time.as_secs()),
            _ => (Problem::Text(error.to_string()), time.as_secs()),
        };
        match failed.iter().position(|(p, ..)| *p == problem) {
            Some(known) => failed[known].2 += 1,
            None if failed.len() < MOST_PROBLEMS => failed.push((problem, secs, 1)),
            None => {}
        }
    }
    for (mut problem, secs, count) in failed {
        if problems.contains(&problem) {
            continue;
        }
        let more = match count {
            1 => String::new(),
            n => format!(" and in {} more frames", n - 1),
        };
        match &mut problem {
            Problem::Text(text) => *text = format!("{text}\n    at {secs} s{more}"),
            Problem::Script(d) => d.message = format!("{} (at {secs} s{more})", d.message),
        }
        problems.push(problem);
    }
    problems
}

/// With file, line and column where the script's own error is known.
fn callback(error: &(dyn std::error::Error + Send + Sync + 'static)) -> Problem {
    match (error as &(dyn std::error::Error + 'static)).downcast_ref::<Diagnostic>() {
        Some(diagnostic) => Problem::Script(diagnostic.clone()),
        None => Problem::Text(error.to_string()),
    }
}
