//! Opens the script or model of the command line as a stage.

pub(crate) mod inputs;
pub(crate) mod model;
pub(crate) mod opening;
pub(crate) mod pack;
pub(crate) mod rows;

use crate::args::SceneArgs;
use crate::args::values;
use crate::failure::{Failure, Problem};
use crate::plugins::plugin_files;
use crate::process::memory;
use crate::process::threads::too_few_threads;
use crate::terminal::import_bar::ImportBar;
use choreo_plugin::{ImportScope, Registry};
use choreo_script::{
    Diagnostic, ImportChoice, Limits, NO_THREAD, Places, PlayedClips, RunDependencies, ScriptOptions,
    Severity, run_file_with_dependencies,
};
use choreo_stage::Stage;
use inputs::Inputs;
use opening::OpenOptions;
use std::path::Path;
use std::sync::Arc;

/// Text of the warning about a model without clips; the name of the model comes before it.
pub(crate) const NO_CLIPS_WARNING: &str = "no clips: one frame";

/// A scene that is ready to be evaluated, with its warnings and the files that it was made from.
pub(crate) struct OpenedScene {
    /// File name without folders.
    pub name: String,
    pub stage: Arc<Stage>,
    /// The given plugins, and those of the plugin files that the scene uses.
    pub registry: Registry,
    pub is_script: bool,
    /// Warnings about guesses and about parts that were left out; each text includes its place.
    pub warnings: Vec<String>,
    /// The same warnings by origin: those of assets, and those of the script.
    pub asset_warnings: Vec<String>,
    pub script_warnings: Vec<Diagnostic>,
    /// Places in the script that created the elements on stage; empty for a model.
    pub places: Places,
    pub limits: Limits,
    /// Lines that the script printed.
    pub printed: Vec<String>,
    /// Name and version of the program, for provenance.
    pub software: String,
    /// Parameters that change the image, for provenance, such as `--set` and `--clip`.
    pub arguments: Vec<String>,
    /// Hash of the content of the script or model and of every file that it read.
    pub input_hash: [u8; 32],
    pub inputs: Inputs,
    /// Files that were read, and places where files were looked for.
    pub dependencies: RunDependencies,
}

/// Registry with the given plugins, and those of plugin files beside the input or in folders named on the command line.
pub(crate) fn registry_with_plugin_files(args: &SceneArgs, plugins: &Registry) -> Result<Registry, Failure> {
    plugin_files::registry_with_files(plugins, &args.import.plugins, &[&args.input])
}

/// Opens the script, or the model, of the command line.
pub(crate) fn open(
    args: &SceneArgs,
    registry: &Registry,
    opening: OpenOptions,
) -> Result<OpenedScene, Failure> {
    let limits = values::parse_limits(&args.limit)?;
    memory::start_guard(limits.memory);
    let set = args.set.iter().map(|text| values::split_name_value("--set", text));
    let set: Vec<(&str, &str)> = set.collect::<Result<_, _>>()?;
    let opened = if args.input.extension().is_some_and(|e| e.eq_ignore_ascii_case("rhai")) {
        open_script(args, &set, limits, registry, opening)
    } else {
        open_model(args, limits, registry, opening)
    };
    let mut scene = opened?;
    // The scene that is drawn must equal the one that was packed. Commands that draw nothing read fewer parts, and cannot compare.
    if let Some(packed) = args.packed_stage.as_ref().filter(|_| opening.requested_parts == ImportScope::ALL) {
        scene.warnings.extend(pack::check_packed_stage(packed, &scene)?);
    }
    Ok(scene)
}

fn open_script(
    args: &SceneArgs,
    set: &[(&str, &str)],
    limits: Limits,
    registry: &Registry,
    opening: OpenOptions,
) -> Result<OpenedScene, Failure> {
    if args.clip.is_some() {
        return Err(Failure::Usage(
            "--clip is for model files; in a script, actor.play(…) chooses the clip".into(),
        ));
    }
    if args.import.importer.is_some() || !args.import.import.is_empty() {
        let what =
            "--importer and --import are for model files; in a script, write load(…, #{ importer: …, … })";
        return Err(Failure::Usage(what.into()));
    }
    model::check_is_file(&args.input)?;
    let options = ScriptOptions {
        assets: opening.reopen_state.map(|reopen_state| reopen_state.assets.clone()).unwrap_or_default(),
        set_parameters: set.iter().map(|(name, value)| (name.to_string(), value.to_string())).collect(),
        search_paths: args.search.clone(),
        limits: limits.clone(),
        requested_parts: opening.requested_parts,
        root: opening.root.map(Path::to_path_buf),
        // A scene that is opened repeatedly may play another clip the next time.
        played_clips_only: opening.reopen_state.is_none(),
        ..ScriptOptions::default()
    };
    let bar = ImportBar::for_imports(&options.imports, opening.quiet);
    let (script, dependencies) = run_file_with_dependencies(&args.input, registry, &options);
    drop(bar);
    let inputs = Inputs::new(dependencies.read.keys().cloned()).with_scene_folder(&args.input);
    if let Some(reopen_state) = opening.reopen_state {
        reopen_state.set_dependencies(dependencies.clone());
    }
    let script = script.map_err(script_failure)?;
    let asset_warnings = asset_warnings(&script.stage);
    let warnings = script.warnings.iter().map(ToString::to_string);
    Ok(OpenedScene {
        name: input_name(args),
        registry: registry.settled_for([&script.stage]),
        stage: Arc::new(script.stage),
        is_script: true,
        warnings: warnings.chain(asset_warnings.iter().cloned()).collect(),
        asset_warnings,
        script_warnings: script.warnings,
        places: script.places,
        limits,
        printed: script.printed,
        software: args.software.clone(),
        arguments: set.iter().map(|(n, v)| format!("--set {n}={v}")).collect(),
        input_hash: script.script_hash,
        inputs,
        dependencies,
    })
}

fn open_model(
    args: &SceneArgs,
    limits: Limits,
    registry: &Registry,
    opening: OpenOptions,
) -> Result<OpenedScene, Failure> {
    let shown = args.input.display();
    if let Some(text) = args.set.first() {
        return Err(Failure::Usage(format!("--set {text} is for scripts; {shown} is a model")));
    }
    let clips = match &args.clip {
        _ if opening.reopen_state.is_some() => PlayedClips::All,
        Some(name) => PlayedClips::One(name.clone()),
        None => PlayedClips::First,
    };
    let choice = ImportChoice { clips, ..model::import_choice(&args.import)? };
    let imported = model::import(&args.input, &args.search, &choice, registry, &limits, opening)?;
    let stage = model::stage_with_model(imported.asset, args.clip.as_deref())?;
    let mut warnings = asset_warnings(&stage);
    if stage.actors.iter().all(|a| a.asset.clips.is_empty()) {
        warnings.push(format!("{shown}: {NO_CLIPS_WARNING}"));
    }
    let importer = args.import.importer.iter().map(|i| format!("--importer {i}"));
    let options = args.import.import.iter().map(|i| format!("--import {i}"));
    let clip = args.clip.iter().map(|c| format!("--clip {c}"));
    Ok(OpenedScene {
        name: input_name(args),
        stage: Arc::new(stage),
        registry: registry.settled(),
        is_script: false,
        asset_warnings: warnings.clone(),
        warnings,
        script_warnings: Vec::new(),
        places: Places::default(),
        limits,
        printed: Vec::new(),
        software: args.software.clone(),
        arguments: importer.chain(options).chain(clip).collect(),
        input_hash: imported.hash,
        inputs: Inputs::new(imported.dependencies.read.keys().cloned()).with_scene_folder(&args.input),
        dependencies: imported.dependencies,
    })
}

/// File name of the input, without folders.
fn input_name(args: &SceneArgs) -> String {
    args.input.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Turns the diagnostics of a script into a failure: an error of the script, or too few threads.
fn script_failure(diagnostics: Vec<Diagnostic>) -> Failure {
    match diagnostics.iter().find_map(|d| d.message.strip_prefix(NO_THREAD)) {
        Some(why) => too_few_threads(&format!("no thread can be started for the script ({why})")),
        None => Failure::Input(sorted_problems(diagnostics)),
    }
}

/// Converts diagnostics to problems, errors after warnings.
fn sorted_problems(mut diagnostics: Vec<Diagnostic>) -> Vec<Problem> {
    // Errors come last, so that they are just above the prompt.
    diagnostics.sort_by_key(|d| d.severity == Severity::Error);
    diagnostics.into_iter().map(Problem::Script).collect()
}

/// Warnings of all assets on stage, each once.
fn asset_warnings(stage: &Stage) -> Vec<String> {
    let mut seen = Vec::new();
    let mut warnings = Vec::new();
    for actor in &stage.actors {
        if seen.iter().any(|a| Arc::ptr_eq(a, &actor.asset)) {
            continue;
        }
        seen.push(actor.asset.clone());
        warnings.extend(warning_texts(&actor.asset));
    }
    warnings
}

/// Warnings of an asset as text, each with the place that it concerns.
pub(crate) fn warning_texts(asset: &choreo_asset::Asset) -> Vec<String> {
    let text = |w: &choreo_asset::Warning| match w.place.is_empty() {
        true => format!("{}: warning: {}", asset.name, w.text),
        false => format!("{}: {}: warning: {}", asset.name, w.place, w.text),
    };
    asset.warnings.iter().map(text).collect()
}
