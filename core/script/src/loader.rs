//! The loader behind `load(…)`: finds a file by its name and imports it by a plugin, each pair of file and options once.

use crate::cache::{AssetCache, CachedImport, FileStamp, Key, Remembered, SideFile};
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

/// How a file is to be imported. The importer's options are checked later, when the importer is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportChoice {
    pub importer: Option<String>,
    pub options: ImportOptions,
    /// Requested parts of the file, a restriction of the loader's own: a file used for its clips only decodes no mesh and no
    /// image.
    pub needs: Option<ImportScope>,
    /// Clips of the file that are played. An importer may return other clips by name only.
    pub clips: PlayedClips,
    /// Tolerance in metres within which clips are compressed by [`choreo_motion::Clip::compressed`].
    pub compress: Option<f64>,
    /// The front of the model, in place of the one found from its skeleton and clips.
    pub front: Option<Front>,
    /// Options as typed on the command line.
    pub texts: Vec<(String, String)>,
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
    fn complete(&self, manifest: &Manifest) -> Result<ImportOptions, OptionError> {
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
        for (name, text) in &self.texts {
            options.0.insert(name.clone(), manifest.parse_option(name, text)?);
        }
        manifest.complete(&options)
    }
}

/// Loads assets for one script, or one model file without a script.
pub struct Loader {
    registry: Registry,
    folders: Folders,
    needs: ImportScope,
    cache: AssetCache,
    imports: Imports,
    /// Workers begin an import at once. Otherwise it begins when a caller waits.
    at_once: bool,
    state: Mutex<LoaderState>,
}

#[derive(Default)]
struct LoaderState {
    /// Imports by path and choice.
    imports: BTreeMap<(PathBuf, String), Arc<Import>>,
    /// Canonical paths and hashes of all files read.
    used: BTreeMap<PathBuf, [u8; 32]>,
    /// Paths that were not found or are links.
    looked_for: BTreeSet<PathBuf>,
}

impl Loader {
    /// A loader with an empty cache. `needs`: the parts of files that the caller will use.
    pub fn new(registry: &Registry, folders: Folders, needs: ImportScope) -> Loader {
        Loader {
            registry: registry.clone(),
            folders,
            needs,
            cache: AssetCache::default(),
            imports: Imports::default(),
            at_once: true,
            state: Mutex::default(),
        }
    }

    /// Adds the imports of this loader to `imports`, whose clones show the progress and can cancel it.
    pub fn watched_by(mut self, imports: &Imports) -> Loader {
        self.imports = imports.clone();
        self
    }

    /// Makes the loader begin an import only when a caller waits for it.
    pub(crate) fn when_waited_for(mut self) -> Loader {
        self.at_once = false;
        self
    }

    /// Reuses assets that other runs have put into `cache`, while their files are the same.
    pub fn with_cache(mut self, cache: &AssetCache) -> Loader {
        self.cache = cache.clone();
        self
    }

    /// A loader for a model file without a script, which reads the folder of that file and the search paths.
    pub fn for_file(
        path: &Path,
        search: &[PathBuf],
        registry: &Registry,
        needs: ImportScope,
        max_bytes: u64,
    ) -> Result<Loader, LoadError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        Ok(Loader::new(registry, Folders::new(folder, search, max_bytes)?, needs))
    }

    pub fn folders(&self) -> &Folders {
        &self.folders
    }

    /// The parts of files that the caller will use.
    pub(crate) fn needs(&self) -> ImportScope {
        self.needs
    }

    pub fn registry(&self) -> &Registry {
        &self.registry
    }

    /// Canonical paths and hashes of the files read so far.
    pub fn used(&self) -> BTreeMap<PathBuf, [u8; 32]> {
        self.state().used.clone()
    }

    /// Paths that were not found so far, and links on the way to files that were found.
    pub fn looked_for(&self) -> BTreeSet<PathBuf> {
        self.state().looked_for.clone()
    }

    /// Adds paths to [`Loader::looked_for`] on which a failure depends.
    pub(crate) fn note_looked_for(&self, files: &[PathBuf]) {
        self.state().looked_for.extend(files.iter().cloned());
    }

    /// Calls [`Folders::find`] and adds to [`Loader::looked_for`].
    pub(crate) fn find_in(
        &self,
        folders: &Folders,
        start: Option<&Path>,
        name: &str,
    ) -> Result<FoundFile, LoadError> {
        let mut candidates = Vec::new();
        let found = folders.find_reporting(start, name, &mut |path| candidates.push(path.to_path_buf()));
        self.state().looked_for.extend(candidates);
        found
    }

    /// Number of imports begun so far. Each pair of file and options counts once.
    pub fn loaded(&self) -> usize {
        self.state().imports.len()
    }

    fn state(&self) -> MutexGuard<'_, LoaderState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn note_used(&self, path: &Path, bytes: &[u8]) {
        let hash = *blake3::hash(bytes).as_bytes();
        self.state().used.insert(path.to_path_buf(), hash);
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
                self.built_in(name)?;
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
                None => Err(LoadError::new(format!("\"{own_name}\" is no longer needed"))),
            }),
        );
        state.imports.insert(key, import.clone());
        drop(state);
        if self.at_once {
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
        let remembered = found.filter(|_| self.cache.remembers());
        let remembered = remembered.map(|f| (f.path.clone(), format!("{name} {choice:?} {:?}", self.needs)));
        if let Some(known) = remembered.as_ref().and_then(|key| self.cache.remembered(key)) {
            self.state().used.extend(known.files.iter().map(|(path, _, hash)| (path.clone(), *hash)));
            return Ok(known.asset);
        }
        let stamp = found.and_then(|f| FileStamp::of(&f.path));
        let (source, importer) = match found {
            None => (Source { name: name.to_string(), bytes: Arc::default() }, self.built_in(name)?.clone()),
            Some(found) => {
                import.set_bytes(std::fs::metadata(&found.path).map_or(0, |m| m.len()));
                let bytes = self.folders.read(found, name)?;
                import.set_bytes(bytes.len() as u64);
                self.note_used(&found.path, &bytes);
                let source = Source { name: name.to_string(), bytes: Arc::new(bytes) };
                let named = choice.importer.as_deref();
                let importer = self.registry.importer_for(&source, named).map_err(from_import)?;
                (source, importer)
            }
        };
        let options = choice.complete(importer.manifest()).map_err(from_option)?;
        let needs = choice.needs.map_or(self.needs, |n| self.needs.both(n));
        let inputs = ImportInputs {
            importer: &importer,
            options: &options,
            compress: choice.compress,
            clips: &choice.clips,
            front: choice.front,
            needs,
        };
        let (asset, beside) = self.import(&source, found, inputs, import)?;
        if let (Some(key), Some(stamp), None) = (remembered, stamp, importer.file()) {
            self.remember(key, stamp, &beside, &asset);
        }
        Ok(asset)
    }

    /// Remembers an asset by the modification times of its files, if all of them exist and have not changed meanwhile.
    fn remember(&self, key: (PathBuf, String), stamp: FileStamp, beside: &[String], asset: &Arc<Asset>) {
        let start = key.0.parent();
        let found =
            beside.iter().map(|name| self.find_in(&self.folders, start, name).map(|found| found.path));
        let Ok(mut paths) = found.collect::<Result<Vec<_>, _>>() else { return };
        paths.push(key.0.clone());
        let used = self.used();
        let stamped = |path: PathBuf| Some((path.clone(), FileStamp::of(&path)?, *used.get(&path)?));
        let files = paths.into_iter().map(stamped).collect::<Option<Vec<_>>>();
        let is_same =
            |files: &Vec<(PathBuf, FileStamp, [u8; 32])>| files.last().is_some_and(|last| last.1 == stamp);
        if let Some(files) = files.filter(is_same) {
            self.cache.remember(key, Remembered { files, asset: asset.clone() });
        }
    }

    /// Imports an asset or takes it from the cache. Two threads that need the same asset import it once. Also returns the names
    /// of the files that the importer requested beside it.
    fn import(
        &self,
        source: &Source,
        found: Option<&FoundFile>,
        inputs: ImportInputs<'_>,
        watch: &Import,
    ) -> Result<(Arc<Asset>, Vec<String>), LoadError> {
        let beside = |files: &[SideFile]| files.iter().map(|side| side.name.clone()).collect();
        let ImportInputs { importer, options, compress, clips, front, needs } = inputs;
        let start = found.and_then(|f| f.path.parent());
        let mut importer_name = importer.manifest().name.to_string();
        if let Some(file) = importer.file() {
            self.note_used(&file.path, &file.bytes);
            // A changed plugin makes another asset of the same bytes, so its hash is part of the key.
            importer_name.push_str(&blake3::hash(&file.bytes).to_hex());
        }
        let key = |needs: ImportScope| Key {
            path: found.map_or_else(|| PathBuf::from(&source.name), |f| f.path.clone()),
            // The asset contains the name that it was loaded by.
            name: source.name.clone(),
            importer: importer_name.clone(),
            options: format!("{options:?} {compress:?} {clips:?} {front:?}"),
            needs: format!("{needs:?}"),
        };
        let content = *blake3::hash(&source.bytes).as_bytes();
        let files = |clips| ImporterFiles {
            loader: self,
            start,
            clips,
            left_out: AtomicBool::default(),
            read: Mutex::default(),
            watch,
        };
        // Whether an asset was made of the same bytes, with the same files beside them.
        let same = |made: &CachedImport| {
            let files = files(clips);
            let unchanged = |side: &SideFile| {
                let now = files.read(&side.name).ok();
                now.map(|bytes| *blake3::hash(&bytes).as_bytes()) == side.content
            };
            made.source == content && made.side_files.iter().all(unchanged)
        };
        // An asset with decoded images also serves requests without them.
        if !needs.pixels
            && let Some(more) = self.cache.existing_slot(&key(ImportScope { pixels: true, ..needs }))
        {
            let more = more.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(made) = more.as_ref().filter(|made| same(made)) {
                return Ok((made.asset.clone(), beside(&made.side_files)));
            }
        }
        let slot = self.cache.slot(key(needs));
        let mut slot = slot.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(made) = slot.as_ref().filter(|made| same(made)) {
            return Ok((made.asset.clone(), beside(&made.side_files)));
        }
        let mut near = files(clips);
        self.cache.count_import();
        let mut asset = importer.import(source, &near, needs, options).map_err(from_import)?;
        let shows_front =
            |asset: &Asset| front.is_some() || !Facing::of(&asset.skeleton, &[]).evidence.is_empty();
        let in_script = matches!(clips, PlayedClips::Named(_)) && needs.geometry;
        if in_script && near.left_out.load(Ordering::Relaxed) && !shows_front(&asset) {
            // The front can be found from all clips only, so all are imported. Without a script the front is not needed.
            near = files(&PlayedClips::All);
            asset = importer.import(source, &near, needs, options).map_err(from_import)?;
        }
        asset.name = source.name.clone();
        asset.front = front;
        if let Some(tolerance) = compress {
            compress_clips(&mut asset, tolerance, watch)?;
        }
        if !needs.geometry && self.needs.geometry {
            asset.warnings.push(clips_only_warning());
        }
        let asset = Arc::new(asset);
        let side_files = near.read.into_inner().unwrap_or_else(PoisonError::into_inner);
        let names = beside(&side_files);
        *slot = Some(CachedImport { source: content, side_files, asset: asset.clone() });
        Ok((asset, names))
    }

    fn built_in(&self, name: &str) -> Result<&Arc<dyn Importer>, LoadError> {
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
    needs: ImportScope,
    front: Option<Front>,
}

/// The warning of an asset without its geometry; it is reported only if the asset is cast.
fn clips_only_warning() -> choreo_asset::Warning {
    choreo_asset::Warning {
        place: String::new(),
        text: "it was loaded for its clips only, so it has nothing to show; leave only: \"clips\" out".into(),
    }
}

fn compress_clips(asset: &mut Asset, tolerance: f64, watch: &Import) -> Result<(), LoadError> {
    for clip in &mut asset.clips {
        if watch.is_cancelled() {
            break;
        }
        let (small, _) = clip
            .compressed(&asset.skeleton, tolerance)
            .map_err(|e| LoadError::new(format!("compress: {e}")))?;
        *clip = Arc::new(small);
    }
    Ok(())
}

fn from_option(e: OptionError) -> LoadError {
    LoadError { message: format!("importer {}", e.message), hint: e.hint }
}

fn from_import(e: ImportError) -> LoadError {
    LoadError { message: e.to_string(), hint: e.hint.clone() }
}

/// Access of an importer to the files beside its source.
struct ImporterFiles<'a> {
    loader: &'a Loader,
    start: Option<&'a Path>,
    clips: &'a PlayedClips,
    /// Set once a clip was refused by `wants_clip`.
    left_out: AtomicBool,
    watch: &'a Import,
    /// The files that the importer requested, found or not.
    read: Mutex<Vec<SideFile>>,
}

impl Files for ImporterFiles<'_> {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        if self.watch.is_cancelled() {
            return Err(format!("cannot read \"{relative}\": cancelled"));
        }
        let folders = &self.loader.folders;
        let bytes = self.loader.find_in(folders, self.start, relative).and_then(|found: FoundFile| {
            let bytes = folders.read(&found, relative)?;
            self.loader.note_used(&found.path, &bytes);
            Ok(bytes)
        });
        let content = bytes.as_ref().ok().map(|bytes| *blake3::hash(bytes).as_bytes());
        let side = SideFile { name: relative.to_string(), content };
        self.read.lock().unwrap_or_else(PoisonError::into_inner).push(side);
        bytes.map(Arc::new).map_err(|e| e.message)
    }

    fn progress(&self, part: f32) -> bool {
        self.watch.set_progress(part);
        !self.watch.is_cancelled()
    }

    fn wants_clip(&self, index: usize, name: &str) -> bool {
        let wanted = match self.clips {
            PlayedClips::All => true,
            PlayedClips::First => index == 0,
            PlayedClips::One(played) => name == played,
            PlayedClips::Named(names) => names.contains(name),
        };
        self.left_out.fetch_or(!wanted, Ordering::Relaxed);
        wanted
    }
}
