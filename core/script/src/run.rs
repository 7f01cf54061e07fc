//! Runs a script file to a stage.

use crate::api::defs;
use crate::api_error::{ApiError, Place};
use crate::build::{Parameter, RunMode, ScriptContext, StageDraft};
use crate::cache::AssetCache;
use crate::content::{add_to_hash, hex};
use crate::diagnostic::{Diagnostic, Severity};
use crate::engine;
use crate::errors;
use crate::folders::{Folders, LoadError};
use crate::import::Imports;
use crate::limits::Limits;
use crate::lint::Places;
use crate::loader::Loader;
use crate::modules::read_text;
use crate::parsed::{ParseFailure, ParsedScript};
use crate::resolve::resolve;
use crate::suggest::{did_you_mean, list};
use choreo_plugin::{ImportScope, Registry};
use choreo_stage::Stage;
use rhai::{AST, Engine};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Options of a run of a script.
#[derive(Clone, Debug, PartialEq)]
pub struct ScriptOptions {
    /// Search paths: folders besides the script's own in which files are looked up, in order.
    pub search_paths: Vec<PathBuf>,
    /// Parameters given with `--set name=value`. The last of equal names counts.
    pub set_parameters: Vec<(String, String)>,
    pub limits: Limits,
    /// The parts of the assets that the caller will use.
    pub requested_parts: ImportScope,
    /// Cache of assets, shared with other runs by clones.
    pub assets: AssetCache,
    /// Decodes only the clips that the script names, if it names all that it uses. For callers that list no other clips.
    pub played_clips_only: bool,
    /// Shows the progress of the script's imports and cancels them, on any thread.
    pub imports: Imports,
    /// A folder that contains the script and that it may read completely, as tests may.
    pub root: Option<PathBuf>,
    /// Unsaved texts of scripts and modules in an editor, by canonical path. They are read in place of the files; a script among
    /// them need not exist as a file.
    pub unsaved_texts: Arc<BTreeMap<PathBuf, Arc<str>>>,
}

impl Default for ScriptOptions {
    fn default() -> Self {
        ScriptOptions {
            search_paths: Vec::new(),
            set_parameters: Vec::new(),
            limits: Limits::default(),
            requested_parts: ImportScope::ALL,
            assets: AssetCache::default(),
            played_clips_only: false,
            imports: Imports::default(),
            root: None,
            unsaved_texts: Arc::default(),
        }
    }
}

/// The result of a script.
#[derive(Clone, Debug)]
pub struct Script {
    pub stage: Stage,
    /// Canonical paths of all files read, the script included; sorted.
    pub files_used: Vec<PathBuf>,
    /// Hash of the script's text, its parameters and the content of all files used.
    pub script_hash: [u8; 32],
    pub warnings: Vec<Diagnostic>,
    /// Parameters in the order of the script.
    pub parameters: Vec<Parameter>,
    /// Lines of `print` and `debug`.
    pub printed: Vec<String>,
    /// Places of the calls that created the objects of the stage, and the findings of `check`.
    pub places: Places,
}

/// Runs a script file. Returns all errors that one run can find, in the order in which they were found.
pub fn run_file(
    path: &Path,
    registry: &Registry,
    options: &ScriptOptions,
) -> Result<Script, Vec<Diagnostic>> {
    let root = options.root.as_deref();
    let opened = open(path, root, RunMode::Stage, registry, options).map_err(|e| vec![e])?;
    on_script_thread(move || run_on_this_thread(&opened.name, &opened.text, &opened.context))
}

/// Files on which the result of a run depends, also if it failed, for callers that watch for changes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunDependencies {
    /// Canonical paths of all files read, with the BLAKE3 hash of their content.
    pub read: BTreeMap<PathBuf, [u8; 32]>,
    /// Paths that do not exist, and links on the way to files that were found.
    pub missing_or_linked_paths: BTreeSet<PathBuf>,
}

impl RunDependencies {
    /// Files that a loader has looked up or read so far.
    pub fn of(loader: &Loader) -> RunDependencies {
        RunDependencies {
            read: loader.files_read(),
            missing_or_linked_paths: loader.missing_or_linked_paths(),
        }
    }
}

/// Runs a script file as [`run_file`] does, and also returns the files on which the run depends, even if it fails.
pub fn run_file_with_dependencies(
    path: &Path,
    registry: &Registry,
    options: &ScriptOptions,
) -> (Result<Script, Vec<Diagnostic>>, RunDependencies) {
    let opened = match open(path, options.root.as_deref(), RunMode::Stage, registry, options) {
        Ok(opened) => opened,
        Err(error) => {
            let mut dependencies = RunDependencies::default();
            dependencies.missing_or_linked_paths.extend(std::path::absolute(path));
            return (Err(vec![error]), dependencies);
        }
    };
    let loader = opened.context.loader.clone();
    let result = on_script_thread(move || run_on_this_thread(&opened.name, &opened.text, &opened.context));
    let mut dependencies = RunDependencies::of(&loader);
    // A link to the script can change its target.
    let link = std::path::absolute(path).ok().filter(|link| !dependencies.read.contains_key(link));
    dependencies.missing_or_linked_paths.extend(link);
    (result, dependencies)
}

/// A script file that has been read.
pub(crate) struct Opened {
    /// The path as the caller named it, for messages.
    pub name: String,
    pub text: String,
    pub context: Arc<ScriptContext>,
}

/// Finds and reads a script file. `root`: see [`Folders::with_root`].
pub(crate) fn open(
    path: &Path,
    root: Option<&Path>,
    mode: RunMode,
    registry: &Registry,
    options: &ScriptOptions,
) -> Result<Opened, Diagnostic> {
    let shown = path.display().to_string();
    let fail = |e: LoadError| Diagnostic::from(ApiError::from(e));
    let Some(name) = path.file_name().map(|n| n.to_string_lossy().into_owned()) else {
        return Err(Diagnostic::error(format!(
            "\"{shown}\" is not a script file: the path has no file name"
        )));
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut folders = Folders::new(folder, &options.search_paths, options.limits.file).map_err(fail)?;
    if let Some(root) = root {
        folders = folders.with_root(root).map_err(fail)?;
    }
    let canonical = match path.canonicalize() {
        // The script itself may be a link to any place, because the user named it; files that it loads may not.
        Ok(canonical) if canonical.is_file() => canonical,
        Ok(_) => return Err(Diagnostic::error(format!("cannot read script \"{shown}\": it is not a file"))),
        // A text that was never saved has a path but no file.
        Err(_) if options.unsaved_texts.contains_key(path) => path.to_path_buf(),
        Err(e) => return Err(Diagnostic::error(format!("cannot read script \"{shown}\": {e}"))),
    };
    let context = new_script_context(folders, mode, registry, options);
    let found = crate::folders::FoundFile { path: canonical };
    let text = read_text(&context, &found, &name)?;
    Ok(Opened { name: shown, text, context })
}

/// Runs a script given as text. Its files are looked up in `base_dir`.
pub fn run_text(
    name: &str,
    text: &str,
    base_dir: &Path,
    registry: &Registry,
    options: &ScriptOptions,
) -> Result<Script, Vec<Diagnostic>> {
    let folders = Folders::new(base_dir, &options.search_paths, options.limits.file)
        .map_err(|e| vec![ApiError::from(e).into()])?;
    let context = new_script_context(folders, RunMode::Stage, registry, options);
    let (name, text) = (name.to_string(), text.to_string());
    on_script_thread(move || run_on_this_thread(&name, &text, &context))
}

fn new_script_context(
    folders: Folders,
    mode: RunMode,
    registry: &Registry,
    options: &ScriptOptions,
) -> Arc<ScriptContext> {
    let mut loader = Loader::new(registry, folders, options.requested_parts).with_cache(&options.assets);
    loader = loader.watched_by(&options.imports);
    if mode == RunMode::ListTests {
        loader = loader.importing_on_demand();
    }
    Arc::new(ScriptContext {
        stage_draft: Mutex::new(StageDraft::default()),
        defs: defs(),
        loader: Arc::new(loader),
        clips_only: Mutex::default(),
        played_clips_only: options.played_clips_only,
        played_clips: OnceLock::new(),
        limits: options.limits.clone(),
        set_parameters: options.set_parameters.clone(),
        unsaved_texts: options.unsaved_texts.clone(),
        sources: Mutex::default(),
        functions: Mutex::default(),
        reported_variables: Mutex::default(),
        last_token: Mutex::default(),
        deadline: Mutex::default(),
        engine: Mutex::default(),
        mode,
        timeout: None,
        test: Mutex::default(),
    })
}

/// Beginning of the error that the system cannot start a thread for a script.
pub const NO_THREAD: &str = "cannot start a thread for the script: ";

/// Runs `work` on a new thread, whose stack is large enough for the deepest calls and expressions that the limits allow.
pub(crate) fn on_script_thread<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Vec<Diagnostic>> + Send + 'static,
) -> Result<T, Vec<Diagnostic>> {
    const STACK_BYTES: usize = 64 << 20;
    let worker = std::thread::Builder::new().name("script".into()).stack_size(STACK_BYTES);
    match worker.spawn(work).map(std::thread::JoinHandle::join) {
        Ok(Ok(result)) => result,
        Ok(Err(panic)) => std::panic::resume_unwind(panic),
        Err(e) => Err(vec![Diagnostic::error(format!("{NO_THREAD}{e}"))]),
    }
}

/// Makes the engine of a run and starts its time limit.
pub(crate) fn begin(name: &str, text: &str, context: &Arc<ScriptContext>) -> Arc<Engine> {
    context.sources.lock().unwrap_or_else(PoisonError::into_inner).insert(name.to_string(), text.into());
    let engine = Arc::new(engine::make_engine(context));
    *context.engine.lock().unwrap_or_else(PoisonError::into_inner) = Arc::downgrade(&engine);
    let limit = Duration::try_from_secs_f64(context.limits.seconds).unwrap_or(Duration::MAX);
    *context.deadline.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now().checked_add(limit);
    engine
}

/// Runs the statements of a parsed script. Errors, those of parsing included, are added to the diagnostics of the draft.
pub(crate) fn execute(
    engine: &Engine,
    name: &str,
    context: &ScriptContext,
    script: Result<(&ParsedScript, &AST), ParseFailure>,
) {
    match script {
        Err(ParseFailure { error, unknown }) => {
            errors::report_unknown_variables(&unknown, name, context);
            let (place, error) = errors::explain_error(&error.into(), name, context);
            context.add_diagnostic(Severity::Error, &place, &error);
        }
        Ok((parsed, ast)) => {
            errors::mark_as_reported(&parsed.unknown, context);
            // A run of one section reports only the unknown variables in it.
            if !matches!(context.mode, RunMode::RunTest(_)) {
                errors::report_unknown_variables(&parsed.unknown, name, context);
            }
            context
                .clips_only
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .extend(parsed.clips_only.iter().cloned());
            *context.functions.lock().unwrap_or_else(PoisonError::into_inner) = parsed.functions.clone();
            context.test().function_ends = parsed.function_ends.clone();
            if crate::recover::run_statements(engine, name, context, ast, &parsed.unknown) {
                check_set_names(context);
            }
        }
    }
    *context.deadline.lock().unwrap_or_else(PoisonError::into_inner) = None;
}

/// Runs a script on the current thread.
fn run_on_this_thread(
    name: &str,
    text: &str,
    context: &Arc<ScriptContext>,
) -> Result<Script, Vec<Diagnostic>> {
    let engine = begin(name, text, context);
    let parsed = ParsedScript::new(&engine, context, name, text);
    if let Ok(parsed) = &parsed {
        if context.played_clips_only {
            // The value is set only here.
            let _ = context.played_clips.set(crate::clips_only::played_clips(&parsed.ast));
        }
        let unused = crate::lint::unused_variables(&parsed.ast, name, text, context.defs);
        context.stage_draft.lock().unwrap_or_else(PoisonError::into_inner).unused_variables = unused;
    }
    execute(&engine, name, context, parsed.as_ref().map(|p| (p, &p.ast)).map_err(Clone::clone));
    let script_hash = hash_script(text, context);
    let identity = hex(&script_hash);
    let (stage, mut places) = resolve(context, &engine, &|_| identity.clone());
    // A file that only has tests puts nothing on stage.
    if stage.actors.is_empty() && context.test().sections.is_empty() {
        let error = ApiError::new("nothing is on stage: no actor is cast")
            .hint("let hero = cast(\"hero\", load(\"hero.glb\")); puts one there");
        context.add_diagnostic(
            Severity::Warning,
            &Place { file: name.to_string(), ..Place::default() },
            &error,
        );
    }
    let mut stage_draft = context.stage_draft.lock().unwrap_or_else(PoisonError::into_inner);
    places.main = name.to_string();
    let diagnostics = std::mem::take(&mut stage_draft.diagnostics);
    if diagnostics.iter().any(|d| d.severity == Severity::Error) {
        let mut errors: Vec<Diagnostic> =
            diagnostics.into_iter().filter(|d| d.severity == Severity::Error).collect();
        errors.extend(stage_draft.error_about_limit());
        return Err(errors);
    }
    let mut stage = stage;
    stage.warnings.extend(diagnostics.iter().map(ToString::to_string));
    Ok(Script {
        stage,
        files_used: context.loader.files_read().into_keys().collect(),
        script_hash,
        warnings: diagnostics,
        parameters: std::mem::take(&mut stage_draft.parameters),
        printed: stage_draft.take_printed(context.limits.printed),
        places,
    })
}

/// Reports names given with `--set` that no `param` declares.
fn check_set_names(context: &ScriptContext) {
    let known: Vec<String> = {
        let stage_draft = context.stage_draft.lock().unwrap_or_else(PoisonError::into_inner);
        stage_draft.parameters.iter().map(|p| p.name.clone()).collect()
    };
    let names = || known.iter().map(String::as_str);
    for (name, _) in &context.set_parameters {
        if known.contains(name) {
            continue;
        }
        let error = ApiError::new(format!(
            "--set: this script has no parameter \"{name}\"{}",
            did_you_mean(name, names())
        ))
        .hint(match known.as_slice() {
            [] => "the script declares no parameters; param(\"name\", default) declares one".to_string(),
            _ => format!("parameters: {}", list(names(), 30)),
        });
        context.add_diagnostic(Severity::Error, &Place::default(), &error);
    }
}

/// Hash of the script's text, its parameters and the content of all files used.
fn hash_script(text: &str, context: &ScriptContext) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    let mut add = |bytes: &[u8]| add_to_hash(&mut hasher, bytes);
    add(text.as_bytes());
    {
        let stage_draft = context.stage_draft.lock().unwrap_or_else(PoisonError::into_inner);
        for p in &stage_draft.parameters {
            add(p.name.as_bytes());
            add(p.value.as_bytes());
        }
    }
    // Sorted by hash, so that the paths of the files do not matter.
    let mut files: Vec<[u8; 32]> = context.loader.files_read().into_values().collect();
    files.sort_unstable();
    for file in files {
        add(&file);
    }
    *hasher.finalize().as_bytes()
}
