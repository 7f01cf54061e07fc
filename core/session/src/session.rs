//! Session: rebuilds a scene whenever its files change.

use crate::edit::ScriptText;
use crate::package::FILE_ENDINGS;
use crate::plugin_files::{self, Listing};
use crate::{SceneSource, Waker, Watch, WatchError, WatchEvent, WatchedPaths, model};
use choreo_asset::Asset;
use choreo_files::containing_folder;
use choreo_plugin::{PluginPanic, Registry};
use choreo_render::SceneResources;
use choreo_script::{
    AssetCache, Diagnostic, Folders, Imports, Loader, Parameter, Place, Places, RunDependencies,
    ScriptOptions, Severity, content_of, run_file_with_dependencies,
};
use choreo_stage::{Evaluator, Stage, StageError};
use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// One version of a scene: everything needed to draw its frames, and its sources.
pub struct Scene {
    /// Number of the version.
    pub number: u64,
    pub stage: Arc<Stage>,
    pub resources: Arc<SceneResources>,
    /// Evaluator to be cloned: clones share cached results.
    pub evaluator: Evaluator,
    /// Registry with the plugin files that this version uses.
    pub registry: Registry,
    /// Registry with all plugin files; test sections of the script may use more than the scene does.
    pub all_plugins: Registry,
    /// Positions in the script of what is on stage; empty for a model.
    pub places: Places,
    pub parameters: Vec<Parameter>,
    pub printed: Vec<String>,
    /// Cache of the assets of all versions.
    pub assets: AssetCache,
    /// Cache of [`Scene::script_text`].
    pub text: OnceLock<Option<ScriptText>>,
}

impl Scene {
    /// Text of the script, split into tokens on the first call. `None` for a model.
    pub fn script_text(&self) -> Option<&ScriptText> {
        let read = || Some(ScriptText::new(self.places.sources.get(&self.places.main)?.clone()));
        self.text.get_or_init(read).as_ref()
    }

    /// Variable that holds the object created at a position in the script.
    pub fn variable(&self, place: &Place) -> Option<String> {
        let is_own = place.line > 0 && place.file == self.places.main;
        self.script_text().filter(|_| is_own)?.object(place.line, place.column).ok()?.variable
    }
}

/// An error or a warning.
pub type Problem = Diagnostic;

/// Counts of work done since the start, for all versions together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    pub builds: u64,
    /// Number of assets read by an importer.
    pub imports: u64,
    /// Number of compiled plugin files.
    pub plugins: u64,
}

/// Result of one build.
#[derive(Clone)]
pub struct SceneVersion {
    /// Number of the version, from 1.
    pub number: u64,
    /// The scene; `None` if the build failed, so that the previous version stays.
    pub scene: Option<Arc<Scene>>,
    /// Errors of a failed build, else warnings.
    pub problems: Vec<Problem>,
    /// Canonical paths of the files that the build read.
    pub read_files: Vec<PathBuf>,
    /// Files whose change caused the build.
    pub changed_files: BTreeSet<PathBuf>,
    /// Whether a file of the shader folder changed.
    pub shaders_changed: bool,
    pub work: Work,
    pub build_time: Duration,
}

pub struct Session {
    source: SceneSource,
    /// The program's own plugins.
    plugins: Registry,
    assets: AssetCache,
    imports: Imports,
    watch: Option<Watch>,
    /// Plugin files found by the last build, including the compiled ones.
    plugin_listing: Option<Listing>,
    work: Work,
    last_scene: Option<Arc<Scene>>,
    /// Number of imports when unused assets were dropped last.
    imports_at_last_drop: u64,
}

/// Number of imports after which unused assets are dropped.
const IMPORTS_BETWEEN_DROPS: u64 = 64;

/// Result of a build, before it becomes a version.
struct BuildResult {
    stage: Stage,
    places: Places,
    parameters: Vec<Parameter>,
    printed: Vec<String>,
    warnings: Vec<Problem>,
}

impl Session {
    /// Creates a session without building the scene. `watching`: whether [`Session::wait`] will be called.
    pub fn new(source: SceneSource, plugins: &Registry, watching: bool) -> Result<Session, WatchError> {
        Ok(Session {
            source,
            plugins: plugins.clone(),
            assets: AssetCache::default(),
            imports: Imports::default(),
            watch: if watching { Some(Watch::new()?) } else { None },
            plugin_listing: None,
            work: Work::default(),
            last_scene: None,
            imports_at_last_drop: 0,
        })
    }

    pub fn source(&self) -> &SceneSource {
        &self.source
    }

    /// Progress of the files that are being imported.
    pub fn imports(&self) -> Imports {
        self.imports.clone()
    }

    pub fn waker(&self) -> Option<Waker> {
        self.watch.as_ref().map(Watch::waker)
    }

    /// Waits until a file changes that the last version depends on.
    pub fn wait(&mut self, timeout: Option<Duration>) -> Result<WatchEvent, WatchError> {
        self.watch.as_mut().map_or(Err(WatchError::Gone), |watch| watch.wait(timeout))
    }

    /// Builds the next version. `changed_files`: files that caused it, stored in [`SceneVersion::changed_files`].
    pub fn build(&mut self, changed_files: BTreeSet<PathBuf>) -> SceneVersion {
        let start = Instant::now();
        self.work.builds += 1;
        let number = self.work.builds;
        let mut dependencies = RunDependencies::default();
        let mut interest = WatchedPaths::default();
        let made =
            catch_unwind(AssertUnwindSafe(|| self.build_scene(number, &mut dependencies, &mut interest)));
        let made = made.unwrap_or_else(|panic| {
            let own =
                || "the program itself failed on this version; please report it with the files".to_string();
            let what = panic.downcast_ref::<PluginPanic>().map_or_else(own, ToString::to_string);
            Err(vec![Diagnostic::error(what)])
        });
        let shaders = self.source.shader_folder.as_ref().and_then(|folder| folder.canonicalize().ok());
        let of_plugins = self.plugin_listing.iter().flat_map(Listing::used_files);
        let read_files = dependencies.read.keys().cloned().chain(of_plugins).collect();
        interest.files.extend(dependencies.read.into_iter().map(|(path, hash)| (path, Some(hash))));
        for path in dependencies.missing_or_linked_paths {
            let there = content_of(&path);
            interest.files.entry(path).or_insert(there);
        }
        if let Some(folder) = &shaders {
            for path in wgsl_files(folder) {
                let there = content_of(&path);
                interest.files.insert(path, there);
            }
            interest.folders.insert((folder.clone(), effect_file_ending()));
        }
        if let Some(watch) = &mut self.watch {
            watch.set(interest);
        }
        let (scene, problems) = match made {
            Ok((scene, warnings)) => (Some(Arc::new(scene)), warnings),
            Err(errors) => (None, errors),
        };
        if let Some(scene) = &scene {
            self.last_scene = Some(scene.clone());
            // Dropping is rare: the cache is the only owner of a file loaded for its clips alone, which would then be imported again. If the new
            // version is faulty, the assets of the last good one stay.
            if self.assets.imports() >= self.imports_at_last_drop + IMPORTS_BETWEEN_DROPS {
                self.assets.drop_unused();
                self.imports_at_last_drop = self.assets.imports();
            }
        }
        self.work.imports = self.assets.imports();
        self.work.plugins = self.plugin_listing.as_ref().map_or(0, Listing::compiled_count);
        let shaders_changed =
            shaders.is_some_and(|folder| changed_files.iter().any(|c| c.starts_with(&folder)));
        let (work, build_time) = (self.work, start.elapsed());
        SceneVersion { number, scene, problems, read_files, changed_files, shaders_changed, work, build_time }
    }

    fn build_scene(
        &mut self,
        number: u64,
        dependencies: &mut RunDependencies,
        interest: &mut WatchedPaths,
    ) -> Result<(Scene, Vec<Problem>), Vec<Problem>> {
        let registry = self.registry(interest)?;
        let built = match self.source.is_script() {
            true => self.run_script(&registry, dependencies)?,
            false => self.load_models(&registry, dependencies)?,
        };
        let BuildResult { mut stage, places, parameters, printed, mut warnings } = built;
        stage.settings.size = self.source.size.unwrap_or(stage.settings.size);
        for used in stage.effects.iter().filter(|used| registry.effect(&used.plugin).is_none()) {
            warnings.push(Diagnostic::warning(format!("unknown effect \"{}\"; it is left out", used.plugin)));
        }
        let stage = Arc::new(stage);
        let nothing = SceneResources::default();
        let before = self.last_scene.as_ref().map_or(&nothing, |scene| &scene.resources);
        let resources = Arc::new(SceneResources::new_reusing(before, &stage));
        let mut evaluator = Evaluator::new(stage.clone());
        // An error at time 0 makes the version faulty; an error at a later time is reported when that frame is shown.
        let zero = choreo_motion::Time::ZERO;
        evaluator.at(zero).map_err(|error| vec![stage_problem(&error)])?;
        let (all_plugins, registry) = (registry.clone(), registry.settled_for([&*stage]));
        let scene = Scene {
            number,
            stage,
            resources,
            evaluator,
            registry,
            all_plugins,
            places,
            parameters,
            printed,
            assets: self.assets.clone(),
            text: OnceLock::new(),
        };
        Ok((scene, warnings))
    }

    /// Registry of the program's plugins and the plugin files. Changed files are compiled again.
    fn registry(&mut self, interest: &mut WatchedPaths) -> Result<Registry, Vec<Problem>> {
        let inputs = [self.source.input.as_path()];
        let found = plugin_files::list_plugin_files(
            &self.plugins,
            &self.source.plugin_folders,
            &inputs,
            self.plugin_listing.as_ref(),
        );
        let listing = found.map_err(|error| vec![Diagnostic::error(error.to_string())])?;
        for folder in &listing.folders {
            // The path of a folder that does not exist yet is derived from its parent.
            let folder = folder
                .canonicalize()
                .ok()
                .or_else(|| canonical_new_folder(folder))
                .unwrap_or_else(|| folder.clone());
            interest.folders.extend(FILE_ENDINGS.iter().map(|ending| (folder.clone(), ending.to_string())));
        }
        if self.watch.is_some() {
            // Unused plugin files are watched, too: an edit can give one of them the name that the script requests.
            interest.files.extend(listing.files().map(|file| (file.to_path_buf(), content_of(file))));
        }
        let registry = listing.registry.clone();
        self.plugin_listing = Some(listing);
        Ok(registry)
    }

    fn run_script(
        &self,
        registry: &Registry,
        dependencies: &mut RunDependencies,
    ) -> Result<BuildResult, Vec<Problem>> {
        let options =
            ScriptOptions { imports: self.imports.clone(), ..self.source.script_options(&self.assets) };
        let (result, files) = run_file_with_dependencies(&self.source.input, registry, &options);
        *dependencies = files;
        let script = result?;
        let mut warnings = script.warnings;
        warnings.extend(asset_warnings(&script.stage));
        Ok(BuildResult {
            stage: script.stage,
            places: script.places,
            parameters: script.parameters,
            printed: script.printed,
            warnings,
        })
    }

    /// Loads the models that can be read, and reports the others as warnings. Fails if none can be read.
    fn load_models(
        &self,
        registry: &Registry,
        dependencies: &mut RunDependencies,
    ) -> Result<BuildResult, Vec<Problem>> {
        let paths = || std::iter::once(&self.source.input).chain(&self.source.more_models);
        let (mut assets, mut failed) = (Vec::new(), Vec::new());
        for path in paths() {
            match self.load_asset(registry, path, dependencies) {
                Ok(asset) => assets.push((model::name(path), asset)),
                Err(problem) => failed.push(problem),
            }
        }
        if assets.is_empty() {
            return Err(failed);
        }
        let stage = match (&assets[..], paths().count()) {
            ([(_, asset)], 1) => model::stage(asset.clone(), self.source.clip.as_deref())
                .map_err(|e| vec![file_error(&self.source.input, e.to_string(), None)])?,
            _ => model::side_by_side(&assets),
        };
        let mut warnings = asset_warnings(&stage);
        warnings.extend(failed.into_iter().map(|p| Problem { severity: Severity::Warning, ..p }));
        let (places, parameters, printed) = Default::default();
        Ok(BuildResult { stage, places, parameters, printed, warnings })
    }

    fn load_asset(
        &self,
        registry: &Registry,
        path: &Path,
        dependencies: &mut RunDependencies,
    ) -> Result<Arc<Asset>, Problem> {
        let built_in = path.to_str().filter(|_| model::is_built_in(path));
        let base = if built_in.is_some() { Path::new("choreo.rhai") } else { path };
        let folder = base.parent().unwrap_or(Path::new(""));
        let folders = Folders::new(folder, &self.source.search_folders, self.source.limits.file);
        let folders = folders.map_err(|e| file_error(path, e.message, e.hint))?;
        let loader = Loader::new(registry, folders, self.source.requested_parts);
        let loader = Arc::new(loader.with_cache(&self.assets).watched_by(&self.imports));
        let name = built_in.or_else(|| path.file_name().and_then(|n| n.to_str())).unwrap_or_default();
        let loaded = loader.load(name, &self.source.import);
        let RunDependencies { read, missing_or_linked_paths } = RunDependencies::of(&loader);
        dependencies.read.extend(read);
        dependencies.missing_or_linked_paths.extend(missing_or_linked_paths);
        loaded.map_err(|e| file_error(path, e.message, e.hint))
    }
}

fn file_error(path: &Path, message: String, hint: Option<String>) -> Problem {
    Problem { hint, ..Diagnostic::error(message).in_file(path.display().to_string()) }
}

/// Diagnostic of a stage error, with its position in the script if a callback failed.
fn stage_problem(error: &StageError) -> Problem {
    if let StageError::Callback { error: cause, time } = error
        && let Some(own) = (&**cause as &(dyn std::error::Error + 'static)).downcast_ref::<Diagnostic>()
    {
        return Problem { message: format!("{} (at {} s)", own.message, time.as_secs()), ..own.clone() };
    }
    Diagnostic::error(error.to_string())
}

/// Canonical path of a folder that does not exist yet: its canonical parent with its name.
fn canonical_new_folder(folder: &Path) -> Option<PathBuf> {
    Some(containing_folder(folder).canonicalize().ok()?.join(folder.file_name()?))
}

fn effect_file_ending() -> String {
    choreo_wgsl_effect::FILE_ENDING.to_string()
}

fn wgsl_files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let files = entries.map(|e| e.path());
    files.filter(|p| p.to_string_lossy().ends_with(choreo_wgsl_effect::FILE_ENDING)).collect()
}

/// Warnings of all assets on stage, each asset once.
fn asset_warnings(stage: &Stage) -> Vec<Problem> {
    let mut seen: Vec<&Arc<Asset>> = Vec::new();
    let mut warnings = Vec::new();
    for actor in &stage.actors {
        if seen.iter().any(|a| Arc::ptr_eq(a, &actor.asset)) {
            continue;
        }
        seen.push(&actor.asset);
        for w in &actor.asset.warnings {
            let text = if w.place.is_empty() { w.text.clone() } else { format!("{}: {}", w.place, w.text) };
            warnings.push(Diagnostic::warning(text).in_file(actor.asset.name.clone()));
        }
    }
    warnings
}
