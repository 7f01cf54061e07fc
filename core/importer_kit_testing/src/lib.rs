//! Helpers for tests of importers and exporters: sample files, companion files that are counted, rules for every asset, damaged files,
//! tests in a process of their own, crates outside the workspace, packages from npm and PyPI, and assimp's command line as a second
//! opinion. Only tests depend on this crate.

pub mod asset_rules;
pub mod assimp;
pub mod damage;
pub mod export;
pub mod external_crates;
pub mod npm;
pub mod own_process;
pub mod pose;
pub mod pypi;
pub mod wasm;

use choreo_asset::Asset;
use choreo_plugin::{Files, ImportError, ImportOptions, ImportScope, Importer, OptionValue, Source};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The folder of sample files: `$CHOREO_ASSETS`, or `../shared/assets` beside the workspace. `None` if it is missing, with a printed line
/// that says so.
pub fn assets(cases: usize) -> Option<PathBuf> {
    let folder = match std::env::var_os("CHOREO_ASSETS") {
        Some(folder) => PathBuf::from(folder),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/assets"),
    };
    if folder.is_dir() {
        return Some(folder);
    }
    println!("SKIP {cases}: no sample files at {} ($CHOREO_ASSETS)", folder.display());
    None
}

/// Files beside the source, as the program would hand them over; counts the reads.
#[derive(Debug, Default)]
pub struct Companions {
    pub folder: Option<PathBuf>,
    /// Files in memory, by name.
    pub files: Vec<(String, Vec<u8>)>,
    pub reads: AtomicUsize,
    /// The only clip that is played; `None`: all.
    pub played: Option<&'static str>,
}

impl Companions {
    pub fn none() -> Companions {
        Companions::default()
    }

    pub fn in_folder(folder: impl Into<PathBuf>) -> Companions {
        Companions { folder: Some(folder.into()), ..Companions::default() }
    }

    pub fn of<N: Into<String>>(files: Vec<(N, Vec<u8>)>) -> Companions {
        let files = files.into_iter().map(|(name, bytes)| (name.into(), bytes)).collect();
        Companions { files, ..Companions::default() }
    }

    pub fn playing(clip: &'static str) -> Companions {
        Companions { played: Some(clip), ..Companions::default() }
    }

    pub fn reads(&self) -> usize {
        self.reads.load(Ordering::Relaxed)
    }
}

impl Files for Companions {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        self.reads.fetch_add(1, Ordering::Relaxed);
        if let Some((_, bytes)) = self.files.iter().find(|(name, _)| *name == relative) {
            return Ok(Arc::new(bytes.clone()));
        }
        match &self.folder {
            Some(folder) => std::fs::read(folder.join(relative)).map(Arc::new).map_err(|e| e.to_string()),
            None => Err(format!("\"{relative}\": file not found")),
        }
    }

    fn wants_clip(&self, _: usize, name: &str) -> bool {
        self.played.is_none_or(|played| played == name)
    }
}

pub fn source(name: &str, bytes: impl Into<Vec<u8>>) -> Source {
    Source { name: name.to_string(), bytes: Arc::new(bytes.into()) }
}

/// The options given and the manifest's defaults for the rest. Panics if the manifest refuses one.
pub fn options(importer: &dyn Importer, given: &[(&str, OptionValue)]) -> ImportOptions {
    let given = ImportOptions(given.iter().map(|(name, value)| (name.to_string(), value.clone())).collect());
    importer.manifest().complete(&given).unwrap_or_else(|e| panic!("{e}"))
}

/// Imports with default options.
pub fn import(
    importer: &dyn Importer,
    source: &Source,
    files: &dyn Files,
    needs: ImportScope,
) -> Result<Asset, ImportError> {
    importer.import(source, files, needs, &options(importer, &[]))
}

/// Imports a file without companions.
pub fn import_bytes(
    importer: &dyn Importer,
    name: &str,
    bytes: impl Into<Vec<u8>>,
) -> Result<Asset, ImportError> {
    import(importer, &source(name, bytes), &Companions::none(), ImportScope::ALL)
}

/// Imports a file, with the files beside it as companions.
pub fn import_path(importer: &dyn Importer, path: &Path) -> Result<Asset, ImportError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let bytes = std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let folder = path.parent().unwrap_or(Path::new("."));
    import(importer, &source(&name, bytes), &Companions::in_folder(folder), ImportScope::ALL)
}

pub fn error_text(result: Result<Asset, ImportError>) -> String {
    match result {
        Ok(_) => "no error".to_string(),
        Err(e) => e.to_string(),
    }
}

/// `place: text` of every warning.
pub fn warnings(asset: &Asset) -> Vec<String> {
    asset.warnings.iter().map(|w| format!("{}: {}", w.place, w.text)).collect()
}
