//! `load(…)`: from a name to an asset, through the importer plugins, each file once.

use crate::folders::{Folders, Found, LoadError};
use crate::suggest::{did_you_mean, list};
use choreo_plugin::{
    Files, ImportError, ImportOptions, Importer, Manifest, Needs, OptionKind, OptionValue, Registry, Source,
};
use choreo_stage::Asset;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Names that begin so are made by the program: `choreo:mannequin` is made by the importer "mannequin".
pub const BUILT_IN: &str = "choreo:";

/// Loads assets for one script, or one model file without a script.
pub struct Loader {
    registry: Registry,
    folders: Folders,
    needs: Needs,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// By place, importer and options.
    assets: BTreeMap<(PathBuf, String, String), Arc<Asset>>,
    /// Canonical path and hash of everything read.
    used: BTreeMap<PathBuf, [u8; 32]>,
}

impl Loader {
    pub fn new(registry: &Registry, folders: Folders, needs: Needs) -> Loader {
        Loader { registry: registry.clone(), folders, needs, state: Mutex::default() }
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

    pub fn note_used(&self, path: &Path, bytes: &[u8]) {
        let hash = *blake3::hash(bytes).as_bytes();
        self.state.lock().unwrap_or_else(PoisonError::into_inner).used.insert(path.to_path_buf(), hash);
    }

    /// `named`: the importer to use whatever the bytes look like.
    pub fn load(
        &self,
        name: &str,
        named: Option<&str>,
        options: &ImportOptions,
    ) -> Result<Arc<Asset>, LoadError> {
        let (path, found) = match name.strip_prefix(BUILT_IN) {
            Some(_) => (PathBuf::from(name), None),
            None => {
                let found = self.folders.find(None, name)?;
                (found.path.clone(), Some(found))
            }
        };
        let key = (path, named.unwrap_or("").to_string(), format!("{options:?}"));
        if let Some(asset) = self.state.lock().unwrap_or_else(PoisonError::into_inner).assets.get(&key) {
            return Ok(asset.clone());
        }
        let (source, importer) = match &found {
            None => (Source { name: name.to_string(), bytes: Arc::default() }, self.built_in(name)?),
            Some(found) => {
                let bytes = self.folders.read(found, name)?;
                self.note_used(&found.path, &bytes);
                let source = Source { name: name.to_string(), bytes: Arc::new(bytes) };
                let importer = self.importer(&source, named)?;
                (source, importer)
            }
        };
        check_options(importer.manifest(), options)?;
        let files = NearFiles { loader: self, start: found.as_ref().and_then(|f| f.path.parent()) };
        let mut asset = importer.import(&source, &files, self.needs, options).map_err(from_import)?;
        asset.name = name.to_string();
        let asset = Arc::new(asset);
        self.state.lock().unwrap_or_else(PoisonError::into_inner).assets.insert(key, asset.clone());
        Ok(asset)
    }

    fn importer(&self, source: &Source, named: Option<&str>) -> Result<&Arc<dyn Importer>, LoadError> {
        if let Some(named) = named {
            let names = || self.registry.importers().iter().map(|i| i.manifest().name);
            if !names().any(|n| n == named) {
                return Err(LoadError::new(format!(
                    "unknown importer \"{named}\"{}",
                    did_you_mean(named, names())
                ))
                .hint(format!("importers: {}", list(names(), 30))));
            }
        }
        self.registry.importer_for(source, named).map_err(from_import)
    }

    fn built_in(&self, name: &str) -> Result<&Arc<dyn Importer>, LoadError> {
        let is_built_in = |i: &&Arc<dyn Importer>| {
            let name = format!("{BUILT_IN}{}", i.manifest().name);
            i.claim(&Source { name, bytes: Arc::default() }) > 0
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

fn from_import(e: ImportError) -> LoadError {
    LoadError { message: e.to_string(), hint: e.hint.clone() }
}

/// The files beside a source, for its importer.
struct NearFiles<'a> {
    loader: &'a Loader,
    start: Option<&'a Path>,
}

impl Files for NearFiles<'_> {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        let folders = &self.loader.folders;
        let found: Found = folders.find(self.start, relative).map_err(|e| e.message)?;
        let bytes = folders.read(&found, relative).map_err(|e| e.message)?;
        self.loader.note_used(&found.path, &bytes);
        Ok(Arc::new(bytes))
    }
}

/// Every option must be in the manifest, of its kind and in its range.
pub fn check_options(manifest: &Manifest, options: &ImportOptions) -> Result<(), LoadError> {
    let names = || manifest.options.iter().map(|o| o.name);
    for (name, value) in &options.0 {
        let Some(spec) = manifest.options.iter().find(|o| o.name == name) else {
            let error = LoadError::new(format!(
                "importer {} has no option \"{name}\"{}",
                manifest.name,
                did_you_mean(name, names())
            ));
            return Err(error.hint(match manifest.options {
                [] => format!("importer {} has no options", manifest.name),
                _ => format!("options: {}", list(names(), 30)),
            }));
        };
        let allowed = match (&spec.kind, value) {
            (OptionKind::Number { min, max, .. }, OptionValue::Number(v)) if (*min..=*max).contains(v) => {
                continue;
            }
            (OptionKind::Bool { .. }, OptionValue::Bool(_)) => continue,
            (OptionKind::Text { one_of, .. }, OptionValue::Text(v))
                if one_of.is_empty() || one_of.contains(&v.as_str()) =>
            {
                continue;
            }
            (OptionKind::Number { min, max, .. }, _) => format!("a number from {min} to {max}"),
            (OptionKind::Bool { .. }, _) => "true or false".to_string(),
            (OptionKind::Text { one_of: [], .. }, _) => "text".to_string(),
            (OptionKind::Text { one_of, .. }, _) => format!("one of {}", list(one_of.iter().copied(), 30)),
        };
        let got = match value {
            OptionValue::Number(v) => v.to_string(),
            OptionValue::Bool(v) => v.to_string(),
            OptionValue::Text(v) => format!("\"{v}\""),
        };
        return Err(LoadError::new(format!(
            "importer {}: option {name} must be {allowed}, got {got}",
            manifest.name
        ))
        .hint(spec.about));
    }
    Ok(())
}
