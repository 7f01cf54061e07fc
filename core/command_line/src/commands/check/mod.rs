//! `choreo check`: everything that can be checked without drawing: the script, its assets, its callbacks at every frame, and elements of
//! the stage that are never visible.

mod callbacks;
mod sheet;
mod survey;

pub use survey::{SceneToSurvey, survey_scene};

use crate::args::CheckArgs;
use crate::failure::{Failure, Problem, print, print_json, print_message};
use crate::output::svg;
use crate::project_file;
use crate::scene::{self, OpenedScene, opening::OpenOptions};
use crate::terminal::counted;
use choreo_plugin::{Effect, Registry, SurfaceSample};
use choreo_render::plan::light_clusters::MAX_LIGHTS;
use choreo_script::testing::{TestOptions, check_sections, has_sections};
use choreo_script::{Diagnostic, Limits, Places, ScriptOptions, Severity};
use choreo_stage::{EffectUse, Finding, Stage, Subject};
use choreo_test_runner::collect;
use glam::{Vec2, Vec3, Vec4};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub(crate) fn run(args: CheckArgs, no_project_file: bool, plugins: &Registry) -> Result<(), Failure> {
    svg::check_plot_path(args.plot.as_deref())?;
    let registry = scene::registry_with_plugin_files(&args.scene, plugins)?;
    let text = std::fs::read_to_string(&args.scene.input).unwrap_or_default();
    let root = has_sections(&text).then(|| tests_root(&args.scene.input, no_project_file)).flatten();
    let scene = scene::open(
        &args.scene,
        &registry,
        OpenOptions { root: root.as_deref(), ..OpenOptions::TO_INSPECT },
    )?;
    if !args.json {
        scene.printed.iter().flat_map(|text| text.lines()).for_each(print_message);
    }
    let (mut problems, on_stage) =
        check_stage(&scene.stage, &scene.registry, &scene.places, &scene.limits, &|| true);
    if has_sections(&text) {
        let script = ScriptOptions {
            search_paths: args.scene.search.clone(),
            limits: scene.limits.clone(),
            requested_parts: OpenOptions::TO_INSPECT.requested_parts,
            ..ScriptOptions::default()
        };
        problems.extend(section_problems(&args.scene.input, root, script, &registry, &|| true));
    }
    let findings = scene.places.findings(&on_stage);
    if let Some(path) = &args.plot {
        let sheet = sheet::cue_sheet(&scene.name, &scene.stage, &scene.places.marks(&on_stage));
        svg::write_plot(path, &sheet.svg(), &scene.inputs)?;
    }
    let count = |severity| findings.iter().filter(|f| f.severity == severity).count();
    let (warnings, notes) = (scene.warnings.len() + count(Severity::Warning), count(Severity::Note));
    let shown = |d: &&Diagnostic| args.notes || d.severity != Severity::Note;
    if !problems.is_empty() || (args.strict && warnings > 0) {
        return Err(Failure::Input(all_problems(
            &args,
            &scene,
            problems,
            findings.iter().filter(shown),
            warnings,
        )));
    }
    let frames = scene.stage.settings.fps.frames_in(scene.stage.settings.length);
    if args.json {
        let texts = findings.iter().filter(|f| f.severity == Severity::Warning).map(ToString::to_string);
        let texts: Vec<String> = scene.warnings.iter().cloned().chain(texts).collect();
        let of_assets = scene.asset_warnings.iter().map(|w| json!({ "severity": "warning", "message": w }));
        let all = scene.script_warnings.iter().chain(&findings).map(|d| Problem::Script(d.clone()).json());
        let all: Vec<serde_json::Value> = of_assets.chain(all).collect();
        return print_json(&json!({ "ok": true, "frames": frames, "warnings": texts, "findings": all }));
    }
    scene.warnings.iter().for_each(print_message);
    findings.iter().filter(shown).for_each(print_message);
    let warned = if warnings == 0 { "no warnings".to_string() } else { counted(warnings as u64, "warning") };
    let noted = match (notes, args.notes) {
        (0, _) => String::new(),
        (n, true) => format!(", {}", counted(n as u64, "note")),
        (n, false) => {
            format!(", {} (--notes shows {})", counted(n as u64, "note"), if n == 1 { "it" } else { "them" })
        }
    };
    let frames = counted(frames.unsigned_abs(), "frame");
    print(&format!("{}: good, {frames}, {warned}{noted}\n", args.scene.input.display()))
}

/// Folder in which the tests of a file may read, by the rules of `choreo test`.
fn tests_root(input: &Path, no_project_file: bool) -> Option<PathBuf> {
    let project = project_file::project_root(input).filter(|_| !no_project_file);
    let here = || std::env::current_dir().ok().filter(|here| collect::contains_file(here, input));
    project.or_else(here)
}

/// Errors in the sections of a file with tests.
fn section_problems(
    input: &Path,
    root: Option<PathBuf>,
    script: ScriptOptions,
    registry: &Registry,
    should_continue: &dyn Fn() -> bool,
) -> Vec<Problem> {
    let options = TestOptions { script, root, ..TestOptions::default() };
    let found = check_sections(input, registry, &options, should_continue);
    found.errors.into_iter().map(Problem::Script).collect()
}

/// Errors of the stage, and findings that are probably not intended. The findings are incomplete once `should_continue` returns false.
pub(crate) fn check_stage(
    stage: &Arc<Stage>,
    registry: &Registry,
    places: &Places,
    limits: &Limits,
    should_continue: &(dyn Fn() -> bool + Sync),
) -> (Vec<Problem>, Vec<Finding>) {
    let mut problems: Vec<Problem> = stage.check().iter().map(|e| Problem::Text(e.to_string())).collect();
    problems.extend(unknown_effects(stage, registry));
    problems.extend(callbacks::callback_problems(stage, limits, should_continue));
    let mut on_stage = Vec::new();
    if !problems.is_empty() {
        // Findings about a stage with errors would mislead, and would take the time of its callbacks.
        return (problems, on_stage);
    }
    match stage.survey_while(should_continue) {
        Ok(found) => on_stage = found,
        Err(error) => problems.push(Problem::Text(error.to_string())),
    }
    if let Some(finding) = too_many_lights_finding(stage) {
        let found = places.findings(&[finding]).into_iter();
        problems.extend(found.map(|d| Problem::Script(Diagnostic { severity: Severity::Error, ..d })));
    }
    for (index, used) in stage.effects.iter().enumerate() {
        if let Some(effect) = registry.effect(&used.plugin)
            && let Some(text) = overlay_left_out(effect, used, stage)
        {
            let text = format!("effect \"{}\": {text}", used.plugin);
            let subject = Subject::Effect(index);
            on_stage.push(Finding { rule: "effect_leaves_out", note: false, subject, text, hint: None });
        }
        if let Some(effect) = registry.effect(&used.effect_name())
            && used.keys.is_empty()
            && stage.frame_callbacks.is_empty()
            && changes_nothing(effect, used)
        {
            let text = format!("effect \"{}\" changes no pixel with these parameters", used.plugin);
            let subject = Subject::Effect(index);
            on_stage.push(Finding { rule: "effect_changes_nothing", note: false, subject, text, hint: None });
        }
        if let Some(effect) = registry.effect(&used.effect_name())
            && used.on.is_empty()
            && used.keys.is_empty()
            && hides_surfaces(effect, used)
        {
            let text = format!(
                "effect \"{}\" is on every actor and hides all surfaces outside of shadows",
                used.plugin
            );
            let hint = Some("name the surfaces that it is for: .on(floor)".to_string());
            let subject = Subject::Effect(index);
            on_stage.push(Finding { rule: "effect_hides_all", note: false, subject, text, hint });
        }
    }
    (problems, on_stage)
}

fn all_problems<'a>(
    args: &CheckArgs,
    scene: &'a OpenedScene,
    problems: Vec<Problem>,
    findings: impl Iterator<Item = &'a Diagnostic>,
    warnings: usize,
) -> Vec<Problem> {
    let error_count = problems.len();
    let warned = scene.asset_warnings.iter().cloned().map(Problem::Text);
    let mut all: Vec<Problem> = warned.collect();
    all.extend(scene.script_warnings.iter().chain(findings).cloned().map(Problem::Script));
    // Errors come last, so that they are just above the prompt.
    all.extend(problems);
    if error_count == 0 {
        let count = counted(warnings as u64, "warning");
        let input = args.scene.input.display();
        all.push(Problem::Text(format!("{input}: {count}, and --strict allows none")));
    }
    all
}

fn unknown_effects(stage: &Stage, registry: &Registry) -> Vec<Problem> {
    let unknown = stage.effects.iter().filter(|used| registry.effect(&used.plugin).is_none());
    let names = || registry.effect_names();
    unknown
        .map(|used| {
            let near = choreo_script::did_you_mean(&used.plugin, names());
            Problem::Text(format!("unknown effect \"{}\"{near}", used.plugin))
        })
        .collect()
}

/// Finding that more lights are on than can be drawn, at the first of 32 times from 0 on at which that happens.
fn too_many_lights_finding(stage: &Stage) -> Option<Finding> {
    /// Number of times at which lights are counted; takes a few milliseconds.
    const TIMES: i64 = 32;
    if stage.lights.len() <= MAX_LIGHTS {
        return None;
    }
    (0..TIMES).find_map(|i| {
        let time = stage.settings.length.scaled(i as f64 / TIMES as f64);
        let snapshot = stage.at(time).ok()?;
        let on = snapshot.lights.iter().enumerate();
        let on = on.filter(|(_, l)| l.light.color * l.light.intensity != glam::Vec3::ZERO);
        let on: Vec<usize> = on.map(|(index, _)| index).collect();
        let first = *on.get(MAX_LIGHTS)?;
        let text =
            format!("{} lights shine at {} s; {MAX_LIGHTS} are drawn at most", on.len(), time.as_secs());
        let hint = Some("those whose intensity is 0 do not count".to_string());
        Some(Finding { rule: "too_many_lights", note: false, subject: Subject::Light(first), text, hint })
    })
}

/// Overlay that an effect leaves out at the beginning or in the middle of its duration, if any.
fn overlay_left_out(effect: &Effect, used: &EffectUse, stage: &Stage) -> Option<String> {
    let Effect::Overlay(drawing) = effect else { return None };
    let end = used.end.unwrap_or(stage.settings.length).max(used.start);
    let middle = used.start + (end - used.start).scaled(0.5);
    [used.start, middle].into_iter().find_map(|time| {
        let snapshot = stage.at(time).ok()?;
        let parameters = choreo_render::effect_parameters(effect, &used.parameters_at(time));
        let scene = choreo_plugin::EffectScene { stage, snapshot: &snapshot, before: &[], on: &used.on };
        drawing.overlay(&scene, &parameters).left_out.into_iter().next()
    })
}

/// Whether the effect makes every surface fully transparent: tried without shadow, at several distances, colors and viewing angles.
fn hides_surfaces(effect: &Effect, used: &EffectUse) -> bool {
    let Effect::Surface(function) = effect else { return false };
    let parameters = choreo_render::effect_parameters(effect, &used.parameters);
    let inputs = function.surface_inputs(&parameters);
    if !inputs.see_through || effect.reads_frame() {
        return false;
    }
    [0.0f32, 0.5, 1.0].into_iter().all(|facing| {
        let sample =
            |distance| SurfaceSample { normal: Vec3::Z, facing, distance, ..SurfaceSample::default() };
        let mut colors = [Vec4::new(0.0, 0.0, 0.0, 1.0), Vec4::new(0.8, 0.4, 0.1, 1.0), Vec4::ONE];
        function.surfaces(&mut colors, &[1.0, 10.0, 100.0].map(sample), &parameters);
        colors.iter().all(|color| color.w == 0.0)
    })
}

/// Whether a pixel effect returns its input, tried with some colors at points all over the image.
fn changes_nothing(effect: &Effect, used: &EffectUse) -> bool {
    let Effect::Pixel(function) = effect else { return false };
    if effect.reads_frame() {
        // The result depends on the time.
        return false;
    }
    let parameters = choreo_render::effect_parameters(effect, &used.parameters);
    let colors = [Vec4::new(0.0, 0.0, 0.0, 1.0), Vec4::new(0.8, 0.4, 0.1, 1.0), Vec4::ONE];
    (0..81).all(|i| {
        let uv = Vec2::new((i % 9) as f32, (i / 9) as f32) / 8.0;
        let mut changed = colors;
        function.pixels(&mut changed, &[uv; 3], &parameters);
        changed == colors
    })
}
