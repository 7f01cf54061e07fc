//! Runs unsaved scripts on its own thread, as `check` does. If several texts of one script are waiting, only the latest is run.

use crate::{Host, Project};
use choreo_plugin::{ImportScope, PluginPanic};
use choreo_script::testing::{TestOptions, check_sections, has_sections};
use choreo_script::{AssetCache, Diagnostic, Places, ScriptOptions, run_file_with_dependencies};
use choreo_stage::Stage;
use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Time limit for the sections of tests. Later sections are left to `choreo test`.
const TEST_SECTIONS_TIME_LIMIT: Duration = Duration::from_secs(5);

/// Unsaved texts by canonical path.
pub(crate) type UnsavedTexts = Arc<BTreeMap<PathBuf, Arc<str>>>;

/// A script to be run.
pub(crate) struct Job {
    pub uri: String,
    pub version: i64,
    /// Path of the script, even if it was never saved; `None` for a text without a path.
    pub path: Option<PathBuf>,
    pub text: Arc<str>,
    pub unsaved_texts: UnsavedTexts,
    /// Folder that is open in the editor, in which a text without a path looks for files.
    pub folder: PathBuf,
}

/// The result of a run.
pub(crate) struct CheckResult {
    pub uri: String,
    pub version: i64,
    pub diagnostics: Vec<Diagnostic>,
    /// Messages about assets, each with the name by which the script loads the asset.
    pub asset_warnings: Vec<(String, String)>,
    /// The stage and the places in the script that created it; `None` if the script has errors.
    pub stage: Option<(Arc<Stage>, Arc<Places>)>,
    /// Files that were read, including the script and its modules.
    pub read_files: BTreeSet<PathBuf>,
    /// Name of the script in its diagnostics.
    pub script_name: String,
}

#[derive(Default)]
struct Queue {
    jobs: Vec<Job>,
    closed: bool,
}

/// The thread that runs scripts.
pub(crate) struct Checker {
    queue: Arc<(Mutex<Queue>, Condvar)>,
}

fn lock_queue(queue: &Mutex<Queue>) -> MutexGuard<'_, Queue> {
    queue.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Checker {
    /// Starts the thread, which calls `send_result` with each result.
    pub(crate) fn start(
        host: Arc<dyn Host>,
        assets: AssetCache,
        send_result: impl Fn(CheckResult) + Send + 'static,
    ) -> Checker {
        let queue: Arc<(Mutex<Queue>, Condvar)> = Arc::default();
        let own = queue.clone();
        let work = move || {
            loop {
                let mut waiting = lock_queue(&own.0);
                // The script that was submitted last is run first.
                let job = loop {
                    if waiting.closed {
                        return;
                    }
                    match waiting.jobs.pop() {
                        Some(job) => break job,
                        None => waiting = own.1.wait(waiting).unwrap_or_else(PoisonError::into_inner),
                    }
                };
                drop(waiting);
                let is_outdated = || lock_queue(&own.0).jobs.iter().any(|other| other.uri == job.uri);
                let run = || check(&job, &*host, &assets, &is_outdated);
                match catch_unwind(AssertUnwindSafe(run)) {
                    Ok(Some(checked)) => send_result(checked),
                    Ok(None) => {}
                    Err(panic) => send_result(panic_result(&job, &*panic)),
                }
            }
        };
        // If the thread cannot be started, there are no diagnostics; everything else works.
        let _ = std::thread::Builder::new().name("checker".into()).spawn(work);
        Checker { queue }
    }

    pub(crate) fn submit(&self, job: Job) {
        let mut queue = lock_queue(&self.queue.0);
        queue.jobs.retain(|other| other.uri != job.uri);
        queue.jobs.push(job);
        self.queue.1.notify_all();
    }
}

impl Drop for Checker {
    fn drop(&mut self) {
        lock_queue(&self.queue.0).closed = true;
        self.queue.1.notify_all();
    }
}

fn empty_result(job: &Job) -> CheckResult {
    CheckResult {
        uri: job.uri.clone(),
        version: job.version,
        diagnostics: Vec::new(),
        asset_warnings: Vec::new(),
        stage: None,
        read_files: BTreeSet::new(),
        script_name: script_path(job).display().to_string(),
    }
}

fn panic_result(job: &Job, panic: &(dyn std::any::Any + Send)) -> CheckResult {
    let own = || "the program itself failed on this text; please report it with the script".to_string();
    let what = panic.downcast_ref::<PluginPanic>().map_or_else(own, ToString::to_string);
    CheckResult { diagnostics: vec![Diagnostic::error(what)], ..empty_result(job) }
}

/// Path of a script; a text without a path is assumed to be in the open folder.
fn script_path(job: &Job) -> PathBuf {
    job.path.clone().unwrap_or_else(|| job.folder.join("untitled.rhai"))
}

/// Unsaved texts, including the script itself, which may have no file.
fn texts_with_script(job: &Job, path: &Path) -> UnsavedTexts {
    if job.unsaved_texts.contains_key(path) {
        return job.unsaved_texts.clone();
    }
    let mut unsaved_texts = BTreeMap::clone(&job.unsaved_texts);
    unsaved_texts.insert(path.to_path_buf(), job.text.clone());
    Arc::new(unsaved_texts)
}

/// Runs a script. `None` if `is_outdated` reports meanwhile that the text is no longer the latest.
fn check(
    job: &Job,
    host: &dyn Host,
    assets: &AssetCache,
    is_outdated: &dyn Fn() -> bool,
) -> Option<CheckResult> {
    let begun = Instant::now();
    let mut checked = empty_result(job);
    let path = script_path(job);
    let project = match host.project(&path) {
        Ok(project) => project,
        Err(why) => {
            checked.diagnostics.push(Diagnostic::error(why.to_string()));
            return Some(checked);
        }
    };
    let has_sections = has_sections(&job.text);
    let root = has_sections.then(|| tests_root(&path, &job.folder, &project)).flatten();
    let options = ScriptOptions {
        root: root.clone(),
        search_paths: project.search.clone(),
        limits: project.limits.clone(),
        requested_parts: ImportScope::NO_PIXELS,
        assets: assets.clone(),
        unsaved_texts: texts_with_script(job, &path),
        ..ScriptOptions::default()
    };
    let (result, dependencies) = run_file_with_dependencies(&path, &project.registry, &options);
    checked.read_files = dependencies.read.into_keys().collect();
    if is_outdated() {
        return None;
    }
    match result {
        Err(errors) => checked.diagnostics = errors,
        Ok(script) => {
            let (stage, places) = (Arc::new(script.stage), Arc::new(script.places));
            checked.diagnostics = script.warnings;
            checked.diagnostics.extend(host.survey(&stage, &places, &project));
            checked.asset_warnings = asset_warnings(&stage);
            checked.stage = Some((stage, places));
            if has_sections {
                let should_continue = || !is_outdated() && begun.elapsed() < TEST_SECTIONS_TIME_LIMIT;
                let test = TestOptions { script: options, root, ..TestOptions::default() };
                let found = check_sections(&path, &project.registry, &test, &should_continue);
                checked.diagnostics.extend(found.errors);
                checked.read_files.extend(found.read);
            }
        }
    }
    if is_outdated() {
        return None;
    }
    Some(checked)
}

/// Folder in which the tests of a script may read: that of the project, else the one that is open in the editor.
pub(crate) fn tests_root(script: &Path, open: &Path, project: &Project) -> Option<PathBuf> {
    let open = || script.starts_with(open.canonicalize().ok()?).then(|| open.to_path_buf());
    project.root.clone().or_else(open)
}

/// Warnings of the assets on stage, each once.
fn asset_warnings(stage: &Stage) -> Vec<(String, String)> {
    let mut found = Vec::new();
    for actor in &stage.actors {
        for warning in &actor.asset.warnings {
            let place = if warning.place.is_empty() { String::new() } else { format!("{}: ", warning.place) };
            found.push((actor.asset.name.clone(), format!("{place}{}", warning.text)));
        }
    }
    found.sort();
    found.dedup();
    found
}
