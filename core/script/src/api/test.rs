//! `test`, and what a test can use: other scripts, stages, render plans, golden images.

use super::stage::read_size;
use crate::build::{RunMode, ScriptContext, check_limit};
use crate::call::{ApiError, Call, Options, Place, Reply, api, describe, texts, unknown};
use crate::compile::{compile, scope_with_constants};
use crate::diagnostic::Severity;
use crate::errors;
use crate::frame_callback::with_copied_captures;
use crate::modules::read_text;
use crate::resolve::resolve_test_stage;
use crate::suggest::{did_you_mean, list};
use crate::test_data::{Claim, ImageExpectation, PendingExpect, PlanOptions, RunningScript, SectionInfo};
use crate::value::{ActorRef, CameraRef, ExpectRef, HandleKind, LightRef, PlanRef, SceneRef, StageRef};
use choreo_image_diff::{ImageMetric, METRICS};
use choreo_motion::Time;
use choreo_stage::Stage;
use rhai::{Dynamic, EvalAltResult, FnPtr, ImmutableString, Map};
use std::sync::{Arc, PoisonError};

api! {
    /// Declares a test: || { … } builds a stage and states what is expected of it. `choreo test` runs each test by
    /// itself; other commands skip them. Options: skip (the reason), needs (a file or an array of files, without
    /// which the test is skipped), fails (a known bug: the reason), tags (a text or an array of texts).
    test("name, section | name, options, section") -> () = test;
    /// Runs another script; its stage is then the stage of the test. Options: set (an object map of its
    /// parameters).
    scene("file, options?") -> Scene = scene, in_tests;
    /// Returns an actor of the other script, by name.
    Scene.actor("name") -> Actor = actor, in_tests;
    /// Returns a camera of the other script, by name.
    Scene.camera("name") -> Camera = camera, in_tests;
    /// Returns a light of the other script, by index from 0.
    Scene.light("number") -> Light = light, in_tests;
    /// Returns another stage beside the one of the test. || { … } builds it. Expectations inside apply to that
    /// stage.
    stage_of("build") -> Stage = stage_of, in_tests;
    /// Returns the render plan of a frame, for `expect`: what is needed to draw it. Options: size ([width, height]
    /// in pixels, default that of the stage), samples (per pixel, 1 or 4, default those of the stage).
    plan("options?") -> Plan = plan, in_tests;
    /// Compares a frame with its golden image (reference image), which is stored beside the test.
    /// - Frame: at (time in seconds, default 0), size ([width, height]; default: the shape of the stage with at
    ///   most 256 pixels a side), samples (per pixel, default those of the stage, else 4), device ("cpu", the
    ///   default, or "vulkan").
    /// - Allowed difference: tolerance (per channel, in steps of 255, default 4), {}.
    /// - `large: true` allows a golden image of more than 40 KiB.
    expect_image("name, options?") -> () = expect_image, in_tests, options(document_metrics);
}

fn test(c: &mut Call) -> Reply {
    let reply = run_or_list_section(c);
    if reply.is_err() {
        c.context.test().has_failed_test_call = true;
    }
    reply
}

fn run_or_list_section(c: &mut Call) -> Reply {
    if belongs_to_other_section(c) {
        return Ok(Dynamic::UNIT);
    }
    let name = c.text(0)?;
    let last = c.len() - 1;
    let Some(section) = c.value(last).try_cast::<FnPtr>() else {
        return Err(c.wrong(last, "a function, || { … }"));
    };
    if name.trim().is_empty() {
        return Err(ApiError::new("test: name must not be empty"));
    }
    let info = section_info(c, name, &section)?;
    {
        let mut test = c.context.test();
        if test.is_running {
            return Err(ApiError::new("a section cannot hold another one"));
        }
        // Sections of a script that `scene` runs are not sections of this file.
        if test.scene.is_some() {
            return Ok(Dynamic::UNIT);
        }
        if let Some(before) = test.sections.iter().find(|s| s.name == info.name) {
            let error = ApiError::new(format!(
                "test: the name \"{}\" is already taken by the section in line {}",
                info.name, before.line
            ));
            return Err(error.focus(info.name));
        }
        check_limit(test.sections.len(), "sections", &c.context.limits)?;
        let index = test.wanted_section.as_ref().map_or(info.index, |wanted| wanted.index);
        test.sections.push(info);
        test.calls.push((c.place.line, c.place.column));
        if c.context.mode != RunMode::RunTest(index) {
            return Ok(Dynamic::UNIT);
        }
        test.is_running = true;
        test.has_started = true;
    }
    let result = section.call_within_context::<Dynamic>(c.native_context, ());
    end_section(c.context);
    c.context.test().is_running = false;
    match result {
        Err(e) => report_failure(c, *e),
        Ok(_) => Ok(Dynamic::UNIT),
    }
}

/// Notes errors about `expect` calls of a section without a comparison, and about modifiers without effect.
fn end_section(context: &ScriptContext) {
    let pending_expects = std::mem::take(&mut context.test().pending_expects);
    for PendingExpect { place, comparisons, unused_modifier } in pending_expects {
        if comparisons == 0 {
            let error = ApiError::new("this expect has no comparison")
                .hint("end it with a comparison, as .near(…), .below(…), .equals(…) or .in_frame()");
            context.add_diagnostic(Severity::Error, &place, &error);
        } else if let Some((name, place)) = unused_modifier {
            let error = ApiError::new(format!("{name} has no effect: no comparison comes after it"))
                .hint(format!("write .{name}(…) before the comparison"));
            context.add_diagnostic(Severity::Error, &place, &error);
        }
    }
}

/// Whether a call of `test` is skipped, because the sections of the file are known and another one is run.
fn belongs_to_other_section(c: &Call) -> bool {
    let test = c.context.test();
    let Some(wanted) = test.wanted_section.as_ref().filter(|_| !test.is_running) else { return false };
    c.value(0).read_lock::<ImmutableString>().is_some_and(|name| *name != wanted.name)
}

/// Notes the error that ended a function of the script, and returns normally. An exceeded limit ends the script.
pub(super) fn report_failure(c: &Call, error: EvalAltResult) -> Reply {
    let (mut place, explained) = errors::explain_error(&error, &c.place.file, c.context);
    if place.line == 0 {
        place = c.place.clone();
    }
    c.context.add_diagnostic(Severity::Error, &place, &explained);
    if ends_script(&error) {
        return Err(ApiError { fatal: true, ..ApiError::silent() });
    }
    Ok(Dynamic::UNIT)
}

fn ends_script(error: &EvalAltResult) -> bool {
    match error {
        EvalAltResult::ErrorTerminated(..) => true,
        EvalAltResult::ErrorInFunctionCall(_, _, inner, _) | EvalAltResult::ErrorInModule(_, inner, _) => {
            ends_script(inner)
        }
        _ => false,
    }
}

fn section_info(c: &Call, name: String, section: &FnPtr) -> Result<SectionInfo, ApiError> {
    let o = match c.len() {
        2 => Options { function: "test".into(), map: Map::new() },
        _ => c.options(1, &["skip", "needs", "fails", "tags"])?,
    };
    let reason = |name: &str| -> Result<Option<String>, ApiError> {
        let reason = o.text(name)?;
        if reason.as_ref().is_some_and(|r| r.trim().is_empty()) {
            return Err(ApiError::new(format!("test: {name} must give a reason")).focus(name));
        }
        Ok(reason)
    };
    let mut skip = reason("skip")?;
    for file in o.read("needs", texts)?.unwrap_or_default() {
        let missing = c.context.loader.folders().find(None, &file).err();
        skip = skip.or(missing.map(|_| format!("needs {file}, which does not exist here")));
    }
    let test = c.context.test();
    Ok(SectionInfo {
        index: test.sections.len(),
        name,
        file: c.place.file.clone(),
        line: c.place.line,
        end_line: test.function_ends.get(section.fn_name()).copied().unwrap_or(0).max(c.place.line),
        skip,
        fails: reason("fails")?,
        tags: o.read("tags", texts)?.unwrap_or_default(),
    })
}

fn scene(c: &mut Call) -> Reply {
    let name = c.text(0)?;
    let o = c.options(1, &["set"])?;
    let set = match o.get("set") {
        None => Vec::new(),
        Some(given) => {
            let Some(map) = given.read_lock::<Map>() else {
                return Err(crate::call::wrong(&given, "scene: set", "an object map like #{ name: value }"));
            };
            map.iter().map(|(k, v)| (k.to_string(), super::stage::display_value(v))).collect()
        }
    };
    if let Some(before) = c.context.test().scene_at.clone() {
        return Err(ApiError::new(format!("scene: already called in line {}", before.line))
            .hint("a stage can take one script; stage_of(|| scene(…)) makes another stage"));
    }
    let folders = c.context.loader.folders();
    let found = folders.find(None, &name).map_err(|e| ApiError::from(e).focus(name.clone()))?;
    let text = read_text(c.context, &found, &name)?;
    let own = c.context.sources.lock().unwrap_or_else(PoisonError::into_inner).get(&c.place.file).cloned();
    if own.as_deref() == Some(&*text) {
        let error =
            ApiError::new(format!("scene: \"{name}\" is the file that contains this test")).focus(&*name);
        return Err(error.hint(
            "the statements of this file outside its tests have run already: leave scene(…) out, or move the tests to a file of their own",
        ));
    }
    let folder = found.path.parent().map(std::path::Path::to_path_buf).unwrap_or_default();
    {
        let mut test = c.context.test();
        test.scene_at = Some(c.place.clone());
        test.scenes.push((name.clone(), c.place.clone()));
        test.scene = Some(RunningScript { folder, set_parameters: set.clone() });
        test.is_running = false;
    }
    // The parameters of the other script are kept apart.
    let own = std::mem::take(&mut c.stage_draft().parameters);
    let result = run_scene(c, &name, &text);
    let scene_parameters = std::mem::replace(&mut c.stage_draft().parameters, own);
    {
        let mut test = c.context.test();
        test.scene = None;
        test.is_running = true;
    }
    if let Err(e) = result {
        let (place, explained) = errors::explain_error(&e, &name, c.context);
        c.context.add_diagnostic(Severity::Error, &place, &explained);
        if ends_script(&e) {
            return Err(ApiError { fatal: true, ..ApiError::silent() });
        }
    }
    let known = || scene_parameters.iter().map(|p| p.name.as_str());
    if let Some((wrong, _)) = set.iter().find(|(n, _)| !known().any(|k| k == n)) {
        return Err(ApiError::new(format!(
            "scene: \"{name}\" has no parameter \"{wrong}\"{}",
            did_you_mean(wrong, known())
        ))
        .focus(wrong.clone())
        .hint(match scene_parameters.as_slice() {
            [] => "the scene declares no parameters; param(\"name\", default) declares one".to_string(),
            _ => format!("parameters: {}", list(known(), 30)),
        }));
    }
    Ok(Dynamic::from(SceneRef(c.context.test().current_stage)))
}

fn run_scene(c: &Call, name: &str, text: &str) -> Result<(), Box<EvalAltResult>> {
    c.context.sources.lock().unwrap_or_else(PoisonError::into_inner).insert(name.to_string(), text.into());
    let engine = c.native_context.engine();
    let mut ast = compile(engine, c.context, text)?;
    ast.set_source(name);
    c.context.add_loads_of_clips_only(&ast, name);
    engine.run_ast_with_scope(&mut scope_with_constants(), &ast)
}

/// Refuses a scene handle of another stage than the one being built.
fn check_scene_stage(c: &Call) -> Result<(), ApiError> {
    let scene: SceneRef = c.this()?;
    if scene.0 == c.context.test().current_stage {
        return Ok(());
    }
    Err(ApiError::new(format!("{}: this scene is on another stage", c.def.name)))
}

fn actor(c: &mut Call) -> Reply {
    check_scene_stage(c)?;
    let name = c.text(0)?;
    let stage_draft = c.stage_draft();
    match stage_draft.actors.iter().position(|d| d.actor.name == name) {
        Some(id) => Ok(Dynamic::from(ActorRef { id, asset: stage_draft.actors[id].actor.asset.clone() })),
        None => {
            let names: Vec<&str> = stage_draft.actors.iter().map(|d| d.actor.name.as_str()).collect();
            Err(unknown("actor", &name, "", names))
        }
    }
}

fn camera(c: &mut Call) -> Reply {
    check_scene_stage(c)?;
    let name = c.text(0)?;
    let stage_draft = c.stage_draft();
    match stage_draft.cameras.iter().position(|d| d.camera.name == name) {
        Some(id) => Ok(Dynamic::from(CameraRef(id))),
        None => {
            let names: Vec<&str> = stage_draft.cameras.iter().map(|d| d.camera.name.as_str()).collect();
            Err(unknown("camera", &name, "", names))
        }
    }
}

fn light(c: &mut Call) -> Reply {
    check_scene_stage(c)?;
    let index = c.value(0).as_int().map_err(|_| c.wrong(0, "the number of a light, from 0"))?;
    let count = c.stage_draft().lights.len();
    match usize::try_from(index).ok().filter(|i| *i < count) {
        Some(index) => Ok(Dynamic::from(LightRef(index))),
        None => Err(ApiError::new(format!(
            "there is no light {index}: the scene has {}, numbered from 0",
            errors::format_count(count, "light")
        ))),
    }
}

fn stage_of(c: &mut Call) -> Reply {
    let Some(make_stage) = c.value(0).try_cast::<FnPtr>() else {
        return Err(c.wrong(0, "a function that builds a stage, || { … }"));
    };
    // Captured values are copied and must not contain handles, which belong to the outer stage.
    let make_stage = with_copied_captures(&make_stage)?;
    for value in make_stage.curry() {
        check_no_handles(value)?;
    }
    let Some(engine) = c.context.engine.lock().unwrap_or_else(PoisonError::into_inner).upgrade() else {
        return Err(ApiError::new("stage_of: the script has ended"));
    };
    let (index, before) = {
        let mut test = c.context.test();
        check_limit(test.stages.len(), "stages", &c.context.limits)?;
        test.stages.push(Arc::new(Stage::default()));
        let index = test.stages.len();
        let before = (std::mem::replace(&mut test.current_stage, index), test.scene_at.take());
        (index, before)
    };
    let outer = std::mem::take(&mut *c.stage_draft());
    let result = make_stage.call_within_context::<Dynamic>(c.native_context, ());
    let ended = match result {
        Ok(_) => Ok(()),
        Err(e) => report_failure(c, *e).map(|_| ()),
    };
    let (mut stage, stage_errors) = resolve_test_stage(c.context, &engine);
    let inner = std::mem::replace(&mut *c.stage_draft(), outer);
    {
        let mut stage_draft = c.stage_draft();
        let warnings = inner.diagnostics.iter().filter(|d| d.severity == Severity::Warning);
        stage.warnings.extend(warnings.map(ToString::to_string));
        inner.diagnostics.into_iter().for_each(|d| stage_draft.add_diagnostic(d));
        stage_draft.diagnostics_beyond_limit += inner.diagnostics_beyond_limit;
        stage_draft.printed.extend(inner.printed);
        stage_draft.printed_bytes += inner.printed_bytes;
        stage_draft.lines_beyond_limit += inner.lines_beyond_limit;
    }
    {
        let mut test = c.context.test();
        test.stages[index - 1] = Arc::new(stage);
        (test.current_stage, test.scene_at) = before;
    }
    ended?;
    match stage_errors.first() {
        Some(problem) => Err(ApiError::new(format!("stage_of: {}", problem.message))),
        None => Ok(Dynamic::from(StageRef(index))),
    }
}

/// Refuses values that contain handles of a stage, because a handle is an index into the stage that it was made for.
fn check_no_handles(value: &Dynamic) -> Result<(), ApiError> {
    let kind = crate::value::kind_of(value);
    if !matches!(
        kind,
        HandleKind::None
            | HandleKind::Asset
            | HandleKind::Image
            | HandleKind::Clip
            | HandleKind::Stage
            | HandleKind::Plan
    ) {
        return Err(ApiError::new(format!(
            "stage_of: the function uses {} of the stage around it",
            describe(value)
        ))
        .hint("inside, cast actors of its own; assets and clips can be shared"));
    }
    if let Some(array) = value.read_lock::<rhai::Array>() {
        return array.iter().try_for_each(check_no_handles);
    }
    if let Some(map) = value.read_lock::<Map>() {
        return map.values().try_for_each(check_no_handles);
    }
    if let Some(pointer) = value.read_lock::<FnPtr>() {
        return pointer.curry().iter().try_for_each(check_no_handles);
    }
    Ok(())
}

fn plan(c: &mut Call) -> Reply {
    let o = c.options(0, &["size", "samples"])?;
    let options = PlanOptions { size: o.read("size", read_size)?, samples: samples_option(&o)? };
    Ok(Dynamic::from(PlanRef { options, dead: false }))
}

fn samples_option(o: &Options) -> Result<Option<u32>, ApiError> {
    match o.number("samples")? {
        Some(samples) if samples != 1.0 && samples != 4.0 => {
            Err(ApiError::new(format!("{} must be 1 or 4, got {samples}", o.label("samples"))))
        }
        samples => Ok(samples.map(|s| s as u32)),
    }
}

/// Documentation of the image metrics and their limits, for the reference.
fn document_metrics() -> String {
    let one = |m: ImageMetric| format!("{} ({}, 0 to 1, default {})", m.name, m.doc, m.limit);
    METRICS.map(one).join(", ")
}

fn expect_image(c: &mut Call) -> Reply {
    let name = c.text(0)?;
    let valid = !name.is_empty()
        && name.len() <= 80
        && name.chars().all(|ch| ch.is_ascii_alphanumeric() || ch == '_' || ch == '-');
    if !valid {
        return Err(ApiError::new(format!(
            "expect_image: name must be letters, digits, _ or -, 80 at most: it is a file's name; got \"{name}\""
        ))
        .focus(name));
    }
    let of_frame = ["at", "size", "samples", "device", "tolerance", "large"];
    let o = c.options(1, &[&of_frame[..], &METRICS.map(|metric| metric.name)].concat())?;
    let tolerance = o.number_in("tolerance", 0.0, 255.0)?;
    if let Some(t) = tolerance.filter(|t| t.fract() != 0.0) {
        return Err(ApiError::new(format!("expect_image: tolerance must be a whole number, got {t}")));
    }
    let default = ImageExpectation::new(&name);
    let mut limits = default.limits;
    for (limit, metric) in limits.iter_mut().zip(METRICS) {
        *limit = o.number_in(metric.name, 0.0, 1.0)?.unwrap_or(*limit);
    }
    let expectation = ImageExpectation {
        at: o.get("at").map(|v| crate::call::time(&v, &o.label("at"))).transpose()?.unwrap_or(Time::ZERO),
        size: o.read("size", read_size)?,
        samples: samples_option(&o)?,
        device: o.one_of("device", &["cpu", "vulkan"])?.map(str::to_string),
        tolerance: tolerance.map_or(default.tolerance, |t| t as u8),
        limits,
        large: o.flag("large")?.unwrap_or(false),
        ..default
    };
    let same = |claim: &Claim| matches!(claim, Claim::Image(p) if p.name == name);
    if let Some(before) = c.context.test().expectations.iter().find(|e| same(&e.claim)) {
        return Err(ApiError::new(format!(
            "expect_image: the name \"{name}\" is already taken in line {}",
            before.place.line
        ))
        .focus(name.clone()));
    }
    let stage = c.context.test().current_stage;
    let expect = ExpectRef { stage, ..ExpectRef::dead() };
    record_expectation(c, &expect, Claim::Image(expectation))?;
    Ok(Dynamic::UNIT)
}

/// Records a comparison, to be judged when the stage is finished.
pub(crate) fn record_expectation(c: &Call, expect: &ExpectRef, claim: Claim) -> Result<(), ApiError> {
    let place: Place = c.place.clone();
    let source = c.context.source_line(&place.file, place.line).trim().to_string();
    let mut test = c.context.test();
    check_limit(test.expectations.len(), "expectations", &c.context.limits)?;
    test.count_comparison(expect.id);
    test.expectations.push(expect.expectation(claim, place, source));
    Ok(())
}
