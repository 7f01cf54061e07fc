//! Content of a folder for file lists and the asset browser.

use choreo_plugin::Registry;
use choreo_script::built_in_assets;
use choreo_session::package;
use std::path::{Path, PathBuf};

/// Largest number of entries that are listed.
const MAX_ENTRIES: usize = 2000;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FileKind {
    Folder,
    Script,
    /// A file that an importer reads, or a built-in asset, with a model or clips.
    Model,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    pub path: PathBuf,
    pub name: String,
    pub kind: FileKind,
}

/// File name extensions that importers read, in lowercase.
pub fn model_extensions(registry: &Registry) -> Vec<String> {
    let endings = registry.importers().iter().flat_map(|importer| importer.manifest().extensions.clone());
    let mut endings: Vec<String> = endings.map(|ending| ending.to_lowercase()).collect();
    endings.sort();
    endings.dedup();
    endings
}

/// Built-in assets, as entries of a list.
pub fn built_in(registry: &Registry) -> Vec<Entry> {
    let made = built_in_assets(registry);
    made.map(|(name, _)| Entry { path: PathBuf::from(&name), name, kind: FileKind::Model }).collect()
}

/// Folders, scripts and models of a folder, in this order and sorted by name. Hidden files and plugin files are left out.
///
/// # Errors
/// The folder cannot be read.
pub fn list_folder(folder: &Path, model_extensions: &[String]) -> std::io::Result<Vec<Entry>> {
    let mut entries = Vec::new();
    for entry in std::fs::read_dir(folder)?.flatten().take(MAX_ENTRIES) {
        let (path, name) = (entry.path(), entry.file_name().to_string_lossy().into_owned());
        let is_plugin = package::FILE_ENDINGS.iter().any(|ending| name.ends_with(ending));
        if name.starts_with('.') || is_plugin {
            continue;
        }
        if let Some(kind) = kind_of(&path, model_extensions) {
            entries.push(Entry { path, name, kind });
        }
    }
    entries.sort_by_cached_key(|entry| (entry.kind, entry.name.to_lowercase()));
    Ok(entries)
}

fn kind_of(path: &Path, model_extensions: &[String]) -> Option<FileKind> {
    if path.is_dir() {
        return Some(FileKind::Folder);
    }
    let ending = path.extension()?.to_string_lossy().to_lowercase();
    match ending.as_str() {
        "rhai" => Some(FileKind::Script),
        ending => model_extensions.iter().any(|extension| extension == ending).then_some(FileKind::Model),
    }
}
