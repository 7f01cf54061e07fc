//! `choreo check`: everything that can be found without drawing: the script, its assets, and every frame's evaluation.

use crate::args::CheckArgs;
use crate::failure::{Failure, Problem, print, print_json};
use crate::{registry, scene};
use choreo_plugin::Registry;
use choreo_stage::{Evaluator, Stage};
use serde_json::json;
use std::sync::Arc;

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
    let problems = problems(&scene.stage, &registry);
    if !problems.is_empty() {
        if !args.json {
            scene.warnings.iter().for_each(|w| eprintln!("{w}"));
        }
        return Err(Failure::Input(problems.into_iter().map(Problem::Text).collect()));
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
    print(&format!("{}: good, {frames} frames, {warnings}\n", args.scene.input.display()))
}

fn problems(stage: &Arc<Stage>, registry: &Registry) -> Vec<String> {
    let mut problems: Vec<String> = stage.check().iter().map(ToString::to_string).collect();
    for used in &stage.effects {
        if registry.effect(&used.plugin).is_none() {
            let names = || registry.effects().iter().map(|e| e.manifest().name);
            problems.push(format!(
                "unknown effect \"{}\"{}",
                used.plugin,
                choreo_script::did_you_mean(&used.plugin, names())
            ));
        }
    }
    let settings = &stage.settings;
    let frames = settings.fps.frames_in(settings.length).max(1);
    let step = (frames + MOST_FRAMES - 1) / MOST_FRAMES;
    let mut evaluator = Evaluator::new(stage.clone());
    // By text: (first frame, how many).
    let mut failed: Vec<(String, i64, u64)> = Vec::new();
    for frame in (0..frames).step_by(step.max(1) as usize) {
        let Err(error) = evaluator.at(settings.fps.time_of(frame)) else { continue };
        let text = error.to_string();
        match failed.iter().position(|(t, ..)| *t == text) {
            Some(known) => failed[known].2 += 1,
            None if failed.len() < MOST_PROBLEMS => failed.push((text, frame, 1)),
            None => {}
        }
    }
    for (text, frame, count) in failed {
        let more = if count > 1 { format!(" and {} more", count - 1) } else { String::new() };
        let line = format!("{text}\n    at frame {frame}{more}");
        if !problems.contains(&text) {
            problems.push(line);
        }
    }
    problems
}
