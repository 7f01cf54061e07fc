//! The loader behind `load(…)`: finds a file by its name and imports it by a plugin, each pair of file and options once.

use crate::cache::{AssetCache, CacheKey, CachedImport, FileStamp, SideFile, StampedAsset};
use crate::folders::{Folders, FoundFile, LoadError};
use crate::import::{Import, Imports, submit};
use crate::suggest::{did_you_mean, list};
use choreo_asset::Asset;
use choreo_motion::{Facing, Front};
use choreo_plugin::{
    Claim, Files, ImportError, ImportOptions, ImportScope, Importer, Manifest, OptionError, OptionKind,
    OptionSpec, OptionValue, Registry, Source,
};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Prefix of built-in assets: the importer "mannequin" makes `choreo:mannequin`.
pub const BUILT_IN: &str = "choreo:";

/// Importer, options and requested parts for the import of a file. Options are checked later, when the importer is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportChoice {
    pub importer: Option<String>,
    pub options: ImportOptions,
    /// Requested parts of the file; parts that the loader itself does not request are left out in any case. No mesh or image is
    /// decoded of a file that is used for its clips only.
    pub requested_parts: Option<ImportScope>,
    /// Clips of the file that are played. An importer may return other clips by name only.
    pub clips: PlayedClips,
    /// Tolerance in metres within which clips are compressed by [`choreo_motion::Clip::compressed`].
    pub compress: Option<f64>,
    /// Direction of the model's front, in place of the one found from its skeleton and clips.
    pub front: Option<Front>,
    /// Options as typed on the command line.
    pub command_line_options: Vec<(String, String)>,
}

/// Clips of a file that the caller plays.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum PlayedClips {
    #[default]
    All,
    /// The first clip, for a model without a script.
    First,
    /// The clip of this name, for a model without a script.
    One(String),
    /// The clips of these names, in a script.
    Named(BTreeSet<String>),
}

impl ImportChoice {
    /// All options of an importer: the given ones, checked, and the defaults of the others.
    fn complete_options(&self, manifest: &Manifest) -> Result<ImportOptions, OptionError> {
        let mut options = self.options.clone();
        for (name, value) in &mut options.0 {
            let is_color = |o: &OptionSpec| o.name == *name && matches!(o.kind, OptionKind::Color { .. });
            // Scripts write colors in sRGB; importers expect linear ones.
            if let OptionValue::Numbers(numbers) = value
                && manifest.options.iter().any(is_color)
            {
                numbers.iter_mut().for_each(|n| *n = choreo_asset::linear_from_srgb(*n));
            }
        }
        for (name, text) in &self.command_line_options {
            options.0.insert(name.clone(), manifest.parse_option(name, text)?);
        }
        manifest.complete(&options)
    }
}

/// Loads assets for one script, or one model file without a script.
pub struct Loader {
    registry: Registry,
    folders: Folders,
    requested_parts: ImportScope,
    cache: AssetCache,
    imports: Imports,
    /// Workers begin an import at once. Otherwise it begins when a caller waits.
    imports_at_once: bool,
    state: Mutex<LoaderState>,
}

#[derive(Default)]
struct LoaderState {
    /// Imports by path and [`ImportChoice`], the latter as text.
    imports: BTreeMap<(PathBuf, String), Arc<Import>>,
    /// Canonical paths and hashes of all files read.
    files_read: BTreeMap<PathBuf, [u8; 32]>,
    /// Paths that do not exist or are links.
    missing_or_linked_paths: BTreeSet<PathBuf>,
}

impl Loader {
    /// A loader with an empty cache. `requested_parts`: the parts of files that the caller will use.
    pub fn new(registry: &Registry, folders: Folders, requested_parts: ImportScope) -> Loader {
        Loader {
            registry: registry.clone(),
            folders,
            requested_parts,
            cache: AssetCache::default(),
            imports: Imports::default(),
            imports_at_once: true,
            state: Mutex::default(),
        }
    }

    /// Adds the imports of this loader to `imports`, whose clones show the progress and can cancel it.
    pub fn watched_by(mut self, imports: &Imports) -> Loader {
        self.imports = imports.clone();
        self
    }

    /// A loader that begins an import only when a caller waits for it.
    pub(crate) fn importing_on_demand(mut self) -> Loader {
        self.imports_at_once = false;
        self
    }

    /// A loader that reuses the assets in `cache` whose files are unchanged.
    pub fn with_cache(mut self, cache: &AssetCache) -> Loader {
        self.cache = cache.clone();
        self
    }

    /// A loader for a model file without a script, which reads the folder of that file and the search paths.
    pub fn for_file(
        path: &Path,
        search: &[PathBuf],
        registry: &Registry,
        requested_parts: ImportScope,
        max_bytes: u64,
    ) -> Result<Loader, LoadError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        Ok(Loader::new(registry, Folders::new(folder, search, max_bytes)?, requested_parts))
    }

    pub fn folders(&self) -> &Folders {
        &self.folders
    }

    /// The parts of files that the caller will use.
    pub(crate) fn requested_parts(&self) -> ImportScope {
        self.requested_parts
    }

    pub fn registry(&self) -> &Registry {
        &self.registry
    }

    /// Canonical paths and hashes of the files read so far.
    pub fn files_read(&self) -> BTreeMap<PathBuf, [u8; 32]> {
        self.state().files_read.clone()
    }

    /// Looked-up paths that do not exist, and links on the way to files that were found.
    pub fn missing_or_linked_paths(&self) -> BTreeSet<PathBuf> {
        self.state().missing_or_linked_paths.clone()
    }

    /// Adds paths to [`Loader::missing_or_linked_paths`], because a change there may repair an error.
    pub(crate) fn note_missing_or_linked(&self, files: &[PathBuf]) {
        self.state().missing_or_linked_paths.extend(files.iter().cloned());
    }

    /// Finds a file as [`Folders::find`] does, and adds the paths looked up in vain to [`Loader::missing_or_linked_paths`].
    pub(crate) fn find_in(
        &self,
        folders: &Folders,
        start: Option<&Path>,
        name: &str,
    ) -> Result<FoundFile, LoadError> {
        let mut candidates = Vec::new();
        let found = folders.find_reporting(start, name, &mut |path| candidates.push(path.to_path_buf()));
        self.state().missing_or_linked_paths.extend(candidates);
        found
    }

    /// Number of imports begun so far. Each pair of file and options counts once.
    pub fn import_count(&self) -> usize {
        self.state().imports.len()
    }

    fn state(&self) -> MutexGuard<'_, LoaderState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Records that a file was read, with the hash of its content.
    pub(crate) fn record_file_read(&self, path: &Path, bytes: &[u8]) {
        let hash = *blake3::hash(bytes).as_bytes();
        self.state().files_read.insert(path.to_path_buf(), hash);
    }

    /// Starts an import and waits for the asset.
    ///
    /// # Errors
    /// Fails as [`Loader::start`] and [`Import::wait`] do.
    pub fn load(self: &Arc<Self>, name: &str, choice: &ImportChoice) -> Result<Arc<Asset>, LoadError> {
        self.start(None, name, choice)?.wait()
    }

    /// Starts to import a file on a worker thread, or returns the import that was started with the same choice. `start`: a
    /// canonical folder within the roots in which the name is looked up first.
    ///
    /// # Errors
    /// Fails if there is no such file or it must not be read. The handle reports all other errors.
    pub fn start(
        self: &Arc<Self>,
        start: Option<&Path>,
        name: &str,
        choice: &ImportChoice,
    ) -> Result<Arc<Import>, LoadError> {
        let (path, found) = match name.strip_prefix(BUILT_IN) {
            Some(_) => {
                self.built_in_importer(name)?;
                (PathBuf::from(name), None)
            }
            None => {
                let found = self.find_in(&self.folders, start, name)?;
                (found.path.clone(), Some(found))
            }
        };
        let key = (path, format!("{choice:?}"));
        let mut state = self.state();
        if let Some(import) = state.imports.get(&key) {
            return Ok(import.clone());
        }
        // A weak reference, because the loader keeps its imports alive.
        let (loader, choice, own_name) = (Arc::downgrade(self), choice.clone(), name.to_string());
        let import = Import::new(
            name,
            &self.imports,
            Box::new(move |import| match loader.upgrade() {
                Some(loader) => loader.read_and_import(&own_name, found.as_ref(), &choice, import),
                None => Err(LoadError::new(format!("\"{own_name}\" was not loaded: its script has ended"))),
            }),
        );
        state.imports.insert(key, import.clone());
        drop(state);
        if self.imports_at_once {
            submit(&import);
        }
        Ok(import)
    }

    fn read_and_import(
        &self,
        name: &str,
        found: Option<&FoundFile>,
        choice: &ImportChoice,
        import: &Import,
    ) -> Result<Arc<Asset>, LoadError> {
        let stamp_key = found.filter(|_| self.cache.compares_file_times());
        let stamp_key =
            stamp_key.map(|f| (f.path.clone(), format!("{name} {choice:?} {:?}", self.requested_parts)));
        if let Some(known) = stamp_key.as_ref().and_then(|key| self.cache.unchanged_asset(key)) {
            self.state().files_read.extend(known.files.iter().map(|(path, _, hash)| (path.clone(), *hash)));
            return Ok(known.asset);
        }
        let stamp = found.and_then(|f| FileStamp::of(&f.path));
        let (source, importer) = match found {
            None => {
                let source = Source { name: name.to_string(), bytes: Arc::default() };
                (source, self.built_in_importer(name)?.clone())
            }
            Some(found) => {
                import.set_bytes(std::fs::metadata(&found.path).map_or(0, |m| m.len()));
                let bytes = self.folders.read(found, name)?;
                import.set_bytes(bytes.len() as u64);
                self.record_file_read(&found.path, &bytes);
                let source = Source { name: name.to_string(), bytes: Arc::new(bytes) };
                let importer_name = choice.importer.as_deref();
                let importer =
                    self.registry.importer_for(&source, importer_name).map_err(load_error_from_import)?;
                (source, importer)
            }
        };
        let options = choice.complete_options(importer.manifest()).map_err(load_error_from_option)?;
        let requested_parts =
            choice.requested_parts.map_or(self.requested_parts, |n| self.requested_parts.both(n));
        let inputs = ImportInputs {
            importer: &importer,
            options: &options,
            compress: choice.compress,
            clips: &choice.clips,
            front: choice.front,
            requested_parts,
        };
        let (asset, side_files) = self.import(&source, found, inputs, import)?;
        if let (Some(key), Some(stamp), None) = (stamp_key, stamp, importer.file()) {
            self.cache_with_stamps(key, stamp, &side_files, &asset);
        }
        Ok(asset)
    }

    /// Caches an asset with the sizes and modification times of its files, if all of them exist and have not changed since the
    /// import began.
    fn cache_with_stamps(
        &self,
        key: (PathBuf, String),
        stamp: FileStamp,
        side_files: &[String],
        asset: &Arc<Asset>,
    ) {
        let start = key.0.parent();
        let found =
            side_files.iter().map(|name| self.find_in(&self.folders, start, name).map(|found| found.path));
        let Ok(mut paths) = found.collect::<Result<Vec<_>, _>>() else { return };
        paths.push(key.0.clone());
        let hashes = self.files_read();
        let stamped = |path: PathBuf| Some((path.clone(), FileStamp::of(&path)?, *hashes.get(&path)?));
        let files = paths.into_iter().map(stamped).collect::<Option<Vec<_>>>();
        let is_unchanged =
            |files: &Vec<(PathBuf, FileStamp, [u8; 32])>| files.last().is_some_and(|last| last.1 == stamp);
        if let Some(files) = files.filter(is_unchanged) {
            self.cache.insert_stamped(key, StampedAsset { files, asset: asset.clone() });
        }
    }

    /// Imports an asset or takes it from the cache. Two threads that need the same asset import it once. Also returns the names
    /// of the side files that the importer has requested.
    fn import(
        &self,
        source: &Source,
        found: Option<&FoundFile>,
        inputs: ImportInputs<'_>,
        watch: &Import,
    ) -> Result<(Arc<Asset>, Vec<String>), LoadError> {
        let names_of = |files: &[SideFile]| files.iter().map(|side| side.name.clone()).collect();
        let ImportInputs { importer, options, compress, clips, front, requested_parts } = inputs;
        let start = found.and_then(|f| f.path.parent());
        let mut importer_name = importer.manifest().name.to_string();
        if let Some(file) = importer.file() {
            self.record_file_read(&file.path, &file.bytes);
            // A changed plugin makes another asset of the same bytes, so its hash is part of the key.
            importer_name.push_str(&blake3::hash(&file.bytes).to_hex());
        }
        let key = |requested_parts: ImportScope| CacheKey {
            path: found.map_or_else(|| PathBuf::from(&source.name), |f| f.path.clone()),
            // The asset contains the name that it was loaded by.
            name: source.name.clone(),
            importer: importer_name.clone(),
            options: format!("{options:?} {compress:?} {clips:?} {front:?}"),
            requested_parts: format!("{requested_parts:?}"),
        };
        let content = *blake3::hash(&source.bytes).as_bytes();
        let files = |clips| ImporterFiles {
            loader: self,
            start,
            clips,
            clips_left_out: AtomicBool::default(),
            requested: Mutex::default(),
            watch,
        };
        // Whether a cached asset was made of the same bytes and of side files that are unchanged.
        let is_unchanged = |made: &CachedImport| {
            let files = files(clips);
            let is_side_unchanged = |side: &SideFile| {
                let now = files.read(&side.name).ok();
                now.map(|bytes| *blake3::hash(&bytes).as_bytes()) == side.content
            };
            made.source == content && made.side_files.iter().all(is_side_unchanged)
        };
        // An asset with decoded images also serves requests without them.
        if !requested_parts.pixels
            && let Some(with_pixels) =
                self.cache.existing_slot(&key(ImportScope { pixels: true, ..requested_parts }))
        {
            let with_pixels = with_pixels.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(made) = with_pixels.as_ref().filter(|made| is_unchanged(made)) {
                return Ok((made.asset.clone(), names_of(&made.side_files)));
            }
        }
        let slot = self.cache.slot(key(requested_parts));
        let mut slot = slot.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(made) = slot.as_ref().filter(|made| is_unchanged(made)) {
            return Ok((made.asset.clone(), names_of(&made.side_files)));
        }
        let mut importer_files = files(clips);
        self.cache.count_import();
        let import_with = |files: &ImporterFiles| {
            importer.import(source, files, requested_parts, options).map_err(load_error_from_import)
        };
        let mut asset = import_with(&importer_files)?;
        let has_known_front =
            |asset: &Asset| front.is_some() || !Facing::of(&asset.skeleton, &[]).evidence.is_empty();
        let in_script = matches!(clips, PlayedClips::Named(_)) && requested_parts.geometry;
        if in_script && importer_files.clips_left_out.load(Ordering::Relaxed) && !has_known_front(&asset) {
            // The skeleton does not show the front, so all clips are imported to find it from them. Without a script the front is
            // not needed.
            importer_files = files(&PlayedClips::All);
            asset = import_with(&importer_files)?;
        }
        asset.name = source.name.clone();
        asset.front = front;
        if let Some(tolerance) = compress {
            compress_clips(&mut asset, tolerance, watch)?;
        }
        if !requested_parts.geometry && self.requested_parts.geometry {
            asset.warnings.push(no_geometry_warning());
        }
        let asset = Arc::new(asset);
        let side_files = importer_files.requested.into_inner().unwrap_or_else(PoisonError::into_inner);
        let names = names_of(&side_files);
        *slot = Some(CachedImport { source: content, side_files, asset: asset.clone() });
        Ok((asset, names))
    }

    /// The importer that makes the built-in asset of a name.
    fn built_in_importer(&self, name: &str) -> Result<&Arc<dyn Importer>, LoadError> {
        let known: Vec<(String, &Arc<dyn Importer>)> = built_in_assets(&self.registry).collect();
        if let Some((_, importer)) = known.iter().find(|(known, _)| known == name) {
            return Ok(importer);
        }
        let names = || known.iter().map(|(name, _)| name.as_str());
        let error =
            LoadError::new(format!("unknown built-in asset \"{name}\"{}", did_you_mean(name, names())));
        Err(error.hint(match names().next() {
            None => "this program has no built-in assets".to_string(),
            Some(_) => format!("built-in assets: {}", list(names(), 20)),
        }))
    }
}

/// The built-in assets: names for `load`, and the importers that make them.
pub fn built_in_assets(registry: &Registry) -> impl Iterator<Item = (String, &Arc<dyn Importer>)> {
    registry.importers().iter().filter_map(|importer| {
        let name = format!("{BUILT_IN}{}", importer.manifest().name);
        let source = Source { name, bytes: Arc::default() };
        (importer.claim(&source) > Claim::NotMine).then_some((source.name, importer))
    })
}

/// Inputs that determine the asset made of a file.
#[derive(Clone, Copy)]
struct ImportInputs<'a> {
    importer: &'a Arc<dyn Importer>,
    options: &'a ImportOptions,
    compress: Option<f64>,
    clips: &'a PlayedClips,
    requested_parts: ImportScope,
    front: Option<Front>,
}

/// The warning about an asset that was imported without its geometry. It is reported only if the asset is cast.
fn no_geometry_warning() -> choreo_asset::Warning {
    choreo_asset::Warning {
        place: String::new(),
        text: "it was loaded for its clips only, so it has nothing to show; leave only: \"clips\" out".into(),
    }
}

/// Compresses all clips of an asset within a tolerance in metres. Stops if the import is cancelled.
fn compress_clips(asset: &mut Asset, tolerance: f64, watch: &Import) -> Result<(), LoadError> {
    for clip in &mut asset.clips {
        if watch.is_cancelled() {
            break;
        }
        let (compressed, _) = clip
            .compressed(&asset.skeleton, tolerance)
            .map_err(|e| LoadError::new(format!("cannot compress clip \"{}\": {e}", clip.name)))?;
        *clip = Arc::new(compressed);
    }
    Ok(())
}

fn load_error_from_option(e: OptionError) -> LoadError {
    LoadError { message: format!("importer {}", e.message), hint: e.hint }
}

fn load_error_from_import(e: ImportError) -> LoadError {
    LoadError { message: e.to_string(), hint: e.hint.clone() }
}

/// Access of an importer to the files beside its source.
struct ImporterFiles<'a> {
    loader: &'a Loader,
    start: Option<&'a Path>,
    clips: &'a PlayedClips,
    /// Set once `wants_clip` has refused a clip.
    clips_left_out: AtomicBool,
    watch: &'a Import,
    /// Files that the importer has requested, found or not.
    requested: Mutex<Vec<SideFile>>,
}

impl Files for ImporterFiles<'_> {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        if self.watch.is_cancelled() {
            return Err(format!("cannot read \"{relative}\": the import was cancelled"));
        }
        let folders = &self.loader.folders;
        let bytes = self.loader.find_in(folders, self.start, relative).and_then(|found: FoundFile| {
            let bytes = folders.read(&found, relative)?;
            self.loader.record_file_read(&found.path, &bytes);
            Ok(bytes)
        });
        let content = bytes.as_ref().ok().map(|bytes| *blake3::hash(bytes).as_bytes());
        let side = SideFile { name: relative.to_string(), content };
        self.requested.lock().unwrap_or_else(PoisonError::into_inner).push(side);
        bytes.map(Arc::new).map_err(|e| e.message)
    }

    fn progress(&self, part: f32) -> bool {
        self.watch.raise_progress(part);
        !self.watch.is_cancelled()
    }

    fn wants_clip(&self, index: usize, name: &str) -> bool {
        let wanted = match self.clips {
            PlayedClips::All => true,
            PlayedClips::First => index == 0,
            PlayedClips::One(played) => name == played,
            PlayedClips::Named(names) => names.contains(name),
        };
        self.clips_left_out.fetch_or(!wanted, Ordering::Relaxed);
        wanted
    }
}
