//! `load(…)`: from a name to an asset, through the importer plugins, each file once.

use crate::cache::{AssetCache, Key, SideFile};
use crate::folders::{Folders, Found, LoadError};
use crate::suggest::{did_you_mean, list};
use choreo_plugin::{
    Claim, Files, ImportError, ImportOptions, Importer, Manifest, Needs, OptionError, Registry, Source,
};
use choreo_stage::Asset;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Names that begin so are made by the program: `choreo:mannequin` is made by the importer "mannequin".
pub const BUILT_IN: &str = "choreo:";

/// Which importer is to read a file whatever its bytes look like, and with which options. Which options there are
/// is known only once the importer is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportChoice {
    pub importer: Option<String>,
    pub options: ImportOptions,
    /// Less than the loader's own needs: a file for its clips alone decodes no mesh and no image.
    pub needs: Option<Needs>,
    /// Options as typed on the command line.
    pub texts: Vec<(String, String)>,
}

impl ImportChoice {
    fn complete(&self, manifest: &Manifest) -> Result<ImportOptions, OptionError> {
        let mut options = self.options.clone();
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
    needs: Needs,
    cache: AssetCache,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// By place and choice.
    assets: BTreeMap<(PathBuf, String), Arc<Asset>>,
    /// Canonical path and hash of everything read.
    used: BTreeMap<PathBuf, [u8; 32]>,
}

impl Loader {
    pub fn new(registry: &Registry, folders: Folders, needs: Needs) -> Loader {
        Loader {
            registry: registry.clone(),
            folders,
            needs,
            cache: AssetCache::default(),
            state: Mutex::default(),
        }
    }

    /// Assets that other runs have made are taken from there, where their files are still the same.
    pub fn with_cache(mut self, cache: &AssetCache) -> Loader {
        self.cache = cache.clone();
        self
    }

    /// A loader for a model file in place of a script: its own folder and the search paths.
    pub fn for_file(
        path: &Path,
        search: &[PathBuf],
        registry: &Registry,
        needs: Needs,
        max_bytes: u64,
    ) -> Result<Loader, LoadError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        Ok(Loader::new(registry, Folders::new(folder, search, max_bytes)?, needs))
    }

    pub fn folders(&self) -> &Folders {
        &self.folders
    }

    pub fn registry(&self) -> &Registry {
        &self.registry
    }

    /// Canonical paths and hashes of the files read so far.
    pub fn used(&self) -> BTreeMap<PathBuf, [u8; 32]> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).used.clone()
    }

    /// How many assets were loaded so far, each pair of file and options once.
    pub fn loaded(&self) -> usize {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).assets.len()
    }

    pub fn note_used(&self, path: &Path, bytes: &[u8]) {
        let hash = *blake3::hash(bytes).as_bytes();
        self.state.lock().unwrap_or_else(PoisonError::into_inner).used.insert(path.to_path_buf(), hash);
    }

    pub fn load(&self, name: &str, choice: &ImportChoice) -> Result<Arc<Asset>, LoadError> {
        self.load_from(None, name, choice)
    }

    /// `start`: a canonical folder within the roots in which the name is looked for first.
    pub fn load_from(
        &self,
        start: Option<&Path>,
        name: &str,
        choice: &ImportChoice,
    ) -> Result<Arc<Asset>, LoadError> {
        let (path, found) = match name.strip_prefix(BUILT_IN) {
            Some(_) => (PathBuf::from(name), None),
            None => {
                let found = self.folders.find(start, name)?;
                (found.path.clone(), Some(found))
            }
        };
        let key = (path, format!("{choice:?}"));
        if let Some(asset) = self.state.lock().unwrap_or_else(PoisonError::into_inner).assets.get(&key) {
            return Ok(asset.clone());
        }
        let (source, importer) = match &found {
            None => (Source { name: name.to_string(), bytes: Arc::default() }, self.built_in(name)?),
            Some(found) => {
                let bytes = self.folders.read(found, name)?;
                self.note_used(&found.path, &bytes);
                let source = Source { name: name.to_string(), bytes: Arc::new(bytes) };
                let named = choice.importer.as_deref();
                let importer = self.registry.importer_for(&source, named).map_err(from_import)?;
                (source, importer)
            }
        };
        let options = choice.complete(importer.manifest()).map_err(from_option)?;
        let needs = choice.needs.map_or(self.needs, |n| self.needs.both(n));
        let asset = self.import(&source, importer, found.as_ref(), &options, needs)?;
        self.state.lock().unwrap_or_else(PoisonError::into_inner).assets.insert(key, asset.clone());
        Ok(asset)
    }

    /// From the cache where it has it; two threads that want the same asset make it once.
    fn import(
        &self,
        source: &Source,
        importer: &Arc<dyn Importer>,
        found: Option<&Found>,
        options: &ImportOptions,
        needs: Needs,
    ) -> Result<Arc<Asset>, LoadError> {
        let start = found.and_then(|f| f.path.parent());
        let mut importer_name = importer.manifest().name.to_string();
        if let Some(file) = importer.file() {
            self.note_used(&file.path, file.text.as_bytes());
            // A plugin whose text has changed makes something else of the same bytes.
            importer_name.push_str(&blake3::hash(file.text.as_bytes()).to_hex());
        }
        let slot = self.cache.slot(Key {
            path: found.map_or_else(|| PathBuf::from(&source.name), |f| f.path.clone()),
            // The asset bears the name that it was loaded by.
            name: source.name.clone(),
            importer: importer_name,
            options: format!("{options:?}"),
            needs: format!("{needs:?}"),
        });
        let mut slot = slot.lock().unwrap_or_else(PoisonError::into_inner);
        let content = *blake3::hash(&source.bytes).as_bytes();
        if let Some(made) = slot.as_ref().filter(|made| made.source == content) {
            let files = NearFiles { loader: self, start, read: Mutex::default() };
            let same = |side: &SideFile| {
                let now = files.read(&side.name).ok();
                now.map(|bytes| *blake3::hash(&bytes).as_bytes()) == side.content
            };
            if made.side_files.iter().all(same) {
                return Ok(made.asset.clone());
            }
        }
        let files = NearFiles { loader: self, start, read: Mutex::default() };
        let mut asset = importer.import(source, &files, needs, options).map_err(from_import)?;
        asset.name = source.name.clone();
        if !needs.geometry && self.needs.geometry {
            // Told where the asset is cast, and only there.
            asset.warnings.push(choreo_stage::Warning {
                place: String::new(),
                text: "it was loaded for its clips only, so nothing of it can be seen; leave only: \"clips\" out".into(),
            });
        }
        let asset = Arc::new(asset);
        let side_files = files.read.into_inner().unwrap_or_else(PoisonError::into_inner);
        *slot = Some(crate::cache::Made { source: content, side_files, asset: asset.clone() });
        Ok(asset)
    }

    fn built_in(&self, name: &str) -> Result<&Arc<dyn Importer>, LoadError> {
        let is_built_in = |i: &&Arc<dyn Importer>| {
            let name = format!("{BUILT_IN}{}", i.manifest().name);
            i.claim(&Source { name, bytes: Arc::default() }) > Claim::NotMine
        };
        let plain = name.strip_prefix(BUILT_IN).unwrap_or(name);
        let mut known = self.registry.importers().iter().filter(is_built_in);
        if let Some(importer) = known.clone().find(|i| i.manifest().name == plain) {
            return Ok(importer);
        }
        let names: Vec<String> = known.by_ref().map(|i| format!("{BUILT_IN}{}", i.manifest().name)).collect();
        let names = || names.iter().map(String::as_str);
        let error =
            LoadError::new(format!("unknown built-in asset \"{name}\"{}", did_you_mean(name, names())));
        Err(error.hint(match names().next() {
            None => "this program has no built-in assets".to_string(),
            Some(_) => format!("built-in assets: {}", list(names(), 20)),
        }))
    }
}

fn from_option(e: OptionError) -> LoadError {
    LoadError { message: format!("importer {}", e.message), hint: e.hint }
}

fn from_import(e: ImportError) -> LoadError {
    LoadError { message: e.to_string(), hint: e.hint.clone() }
}

/// The files beside a source, for its importer.
struct NearFiles<'a> {
    loader: &'a Loader,
    start: Option<&'a Path>,
    /// What was asked for, found or not.
    read: Mutex<Vec<SideFile>>,
}

impl Files for NearFiles<'_> {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        let folders = &self.loader.folders;
        let bytes = folders.find(self.start, relative).and_then(|found: Found| {
            let bytes = folders.read(&found, relative)?;
            self.loader.note_used(&found.path, &bytes);
            Ok(bytes)
        });
        let content = bytes.as_ref().ok().map(|bytes| *blake3::hash(bytes).as_bytes());
        let side = SideFile { name: relative.to_string(), content };
        self.read.lock().unwrap_or_else(PoisonError::into_inner).push(side);
        bytes.map(Arc::new).map_err(|e| e.message)
    }
}
