//! From SCRIPT|MODEL on the command line to a stage.

use crate::args::SceneArgs;
use crate::failure::{Failure, Problem};
use crate::importing::Bar;
use crate::inputs::Inputs;
use crate::threads::too_few;
use crate::{memory, model, ranges};
use choreo_plugin::{Needs, Registry};
use choreo_script::{
    AssetCache, Diagnostic, Limits, NO_THREAD, Places, ScriptOptions, Severity, Touched, run_file_touching,
};
use choreo_stage::Stage;
use std::sync::{Arc, Mutex, PoisonError};

pub struct Scene {
    /// The file's name without folders.
    pub name: String,
    pub stage: Arc<Stage>,
    /// The plugins, with those of the plugin files that the scene uses.
    pub registry: Registry,
    pub is_script: bool,
    /// What was guessed or left; each complete with its place.
    pub warnings: Vec<String>,
    /// The same, apart: of the assets, and of the script.
    pub asset_warnings: Vec<String>,
    pub script_warnings: Vec<Diagnostic>,
    /// Where the script made what is on stage; empty for a model.
    pub places: Places,
    pub limits: Limits,
    /// What the script printed.
    pub printed: Vec<String>,
    /// Parameters that change the picture, for provenance: `set`, `clip`.
    pub arguments: Vec<String>,
    /// Of the content of the script, or model, and of every file that it read.
    pub input_hash: [u8; 32],
    pub inputs: Inputs,
}

/// How a scene is opened: what will be used of its assets, and whether a bar may be shown.
#[derive(Clone, Copy, Debug)]
pub struct Opening<'a> {
    pub needs: Needs,
    pub quiet: bool,
    pub keep: Option<&'a Keep>,
}

impl Opening<'_> {
    pub const TO_DRAW: Opening<'static> = Opening { needs: Needs::ALL, quiet: false, keep: None };
    /// No picture is decoded.
    pub const TO_TELL: Opening<'static> = Opening { needs: Needs::NO_PIXELS, quiet: false, keep: None };
}

/// For who opens the same again and again: the assets, and which files the last time was about, also where it failed.
#[derive(Debug, Default)]
pub struct Keep {
    pub assets: AssetCache,
    touched: Mutex<Touched>,
}

impl Keep {
    pub fn touched(&self) -> Touched {
        self.touched.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    pub fn set_touched(&self, touched: Touched) {
        *self.touched.lock().unwrap_or_else(PoisonError::into_inner) = touched;
    }
}

pub fn open(args: &SceneArgs, registry: &Registry, opening: Opening) -> Result<Scene, Failure> {
    let mut limits = Limits::default();
    for limit in &args.limit {
        limits.set(limit).map_err(|e| Failure::Usage(format!("--limit {limit}: {e}")))?;
    }
    memory::guard(limits.memory);
    let name = args.input.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let mut set = Vec::new();
    for text in &args.set {
        let (name, value) = ranges::name_value("--set", text)?;
        set.push((name.to_string(), value.to_string()));
    }
    let is_script = args.input.extension().is_some_and(|e| e.eq_ignore_ascii_case("rhai"));
    let mut arguments: Vec<String> = set.iter().map(|(n, v)| format!("--set {n}={v}")).collect();
    if is_script {
        if args.clip.is_some() {
            return Err(Failure::Usage("--clip is for model files; a script says what is played".into()));
        }
        if args.import.importer.is_some() || !args.import.import.is_empty() {
            let what =
                "--importer and --import are for model files; a script says load(…, #{ importer: …, … })";
            return Err(Failure::Usage(what.into()));
        }
        model::must_be_file(&args.input)?;
        let options = ScriptOptions {
            assets: opening.keep.map(|keep| keep.assets.clone()).unwrap_or_default(),
            set,
            search_paths: args.search.clone(),
            limits: limits.clone(),
            needs: opening.needs,
            ..ScriptOptions::default()
        };
        let bar = Bar::over(&options.imports, opening.quiet);
        let (script, touched) = run_file_touching(&args.input, registry, &options);
        drop(bar);
        let inputs = Inputs::new(touched.read.keys().cloned()).in_folder_of(&args.input);
        if let Some(keep) = opening.keep {
            keep.set_touched(touched);
        }
        let script = script.map_err(failure)?;
        let mut warnings: Vec<String> = script.warnings.iter().map(ToString::to_string).collect();
        let asset_warnings = asset_warnings(&script.stage);
        warnings.extend(asset_warnings.iter().cloned());
        return Ok(Scene {
            name,
            stage: Arc::new(script.stage),
            registry: registry.settled(),
            is_script,
            warnings,
            asset_warnings,
            script_warnings: script.warnings,
            places: script.places,
            limits,
            printed: script.printed,
            arguments,
            input_hash: script.script_hash,
            inputs,
        });
    }
    if let Some(text) = args.set.first() {
        return Err(Failure::Usage(format!(
            "--set {text} is for scripts; {} is a model",
            args.input.display()
        )));
    }
    let model::Imported { asset, hash: input_hash, files } =
        model::import_with_files(&args.input, &args.search, &args.import, registry, &limits, opening)?;
    arguments.extend(args.import.importer.iter().map(|i| format!("--importer {i}")));
    arguments.extend(args.import.import.iter().map(|i| format!("--import {i}")));
    arguments.extend(args.clip.iter().map(|c| format!("--clip {c}")));
    let stage = model::stage(asset, args.clip.as_deref())?;
    let mut warnings = asset_warnings(&stage);
    if stage.actors.iter().all(|a| a.asset.clips.is_empty()) {
        warnings.push(format!("{}: no clips: one frame", args.input.display()));
    }
    Ok(Scene {
        name,
        stage: Arc::new(stage),
        registry: registry.settled(),
        is_script,
        asset_warnings: warnings.clone(),
        warnings,
        script_warnings: Vec::new(),
        places: Places::default(),
        limits,
        printed: Vec::new(),
        arguments,
        input_hash,
        inputs: Inputs::new(files).in_folder_of(&args.input),
    })
}

/// The failure that a script's diagnostics mean: an error of the script, or too few threads.
fn failure(diagnostics: Vec<Diagnostic>) -> Failure {
    match diagnostics.iter().find_map(|d| d.message.strip_prefix(NO_THREAD)) {
        Some(why) => too_few(&format!("none can be started for the script ({why})")),
        None => Failure::Input(errors(diagnostics)),
    }
}

fn errors(mut diagnostics: Vec<Diagnostic>) -> Vec<Problem> {
    // Errors last, next to the prompt.
    diagnostics.sort_by_key(|d| d.severity == Severity::Error);
    diagnostics.into_iter().map(Problem::Script).collect()
}

/// Of every asset on stage, once.
fn asset_warnings(stage: &Stage) -> Vec<String> {
    let mut seen = Vec::new();
    let mut warnings = Vec::new();
    for actor in &stage.actors {
        if seen.iter().any(|a| Arc::ptr_eq(a, &actor.asset)) {
            continue;
        }
        seen.push(actor.asset.clone());
        warnings.extend(texts(&actor.asset));
    }
    warnings
}

pub fn texts(asset: &choreo_asset::Asset) -> Vec<String> {
    let text = |w: &choreo_asset::Warning| match w.place.is_empty() {
        true => format!("{}: warning: {}", asset.name, w.text),
        false => format!("{}: {}: warning: {}", asset.name, w.place, w.text),
    };
    asset.warnings.iter().map(text).collect()
}
