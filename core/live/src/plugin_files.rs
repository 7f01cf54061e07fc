//! Plugins that are files: `NAME.importer.rhai` and `NAME.wgsl` beside the script and in a folder `plugins` there, in the
//! folders given with `--plugins`, and in those that the environment variable CHOREO_PLUGINS names. No other place is read.
//! Beside a script there can be WGSL of any kind: only what begins as an effect is taken for one.

use choreo_dropin::RhaiImporter;
use choreo_import::pictures::{Encoded, Formats};
use choreo_look::{Picture, WgslEffect};
use choreo_plugin::{BesideFile, PluginFile, Registry};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;
use thiserror::Error;

/// Folders named as the system's PATH is.
pub const VARIABLE: &str = "CHOREO_PLUGINS";
/// The folder beside a script.
const BESIDE: &str = "plugins";

/// Endings of the names of plugin files.
pub const ENDINGS: [&str; 2] = [choreo_dropin::ENDING, choreo_look::ENDING];

/// Bytes of a plugin's text, and files looked at in one folder.
const MOST_BYTES: u64 = 4 << 20;
const MOST_FILES: usize = 10_000;
/// Bytes of a file that a plugin reads.
const MOST_BESIDE: u64 = 32 << 20;

/// A folder that cannot be used at all.
#[derive(Debug, Error)]
pub enum FolderError {
    #[error("{flag} {}: no such folder", folder.display())]
    Missing { flag: &'static str, folder: PathBuf },
    #[error("{}: cannot read: {error}", folder.display())]
    Unreadable { folder: PathBuf, error: std::io::Error },
}

/// What is wrong with one plugin file: what the user reads, and the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PluginProblem {
    /// Complete with its place.
    pub text: String,
    pub file: PathBuf,
}

/// What was found.
pub struct Found {
    /// The plugins given and those of the files. Later folders win over earlier ones: those of CHOREO_PLUGINS, then those named
    /// in order, then the inputs' own folders and those beside the inputs.
    pub registry: Registry,
    pub problems: Vec<PluginProblem>,
    /// The text of every plugin file.
    pub files: Vec<PluginFile>,
    /// Where a plugin file put there would be found; those beside the inputs need not be there.
    pub folders: Vec<PathBuf>,
}

/// The texts of plugin files, not yet compiled.
pub struct Listing {
    plugins: Registry,
    /// As the user named each.
    shown: Vec<String>,
    pub files: Vec<PluginFile>,
    pub problems: Vec<PluginProblem>,
    /// As in [`Found`].
    pub folders: Vec<PathBuf>,
}

pub fn found(plugins: &Registry, named: &[PathBuf], inputs: &[&Path]) -> Result<Found, FolderError> {
    read(plugins, named, inputs).map(Listing::compile)
}

/// Reads the files in the order in which they count.
pub fn read(plugins: &Registry, named: &[PathBuf], inputs: &[&Path]) -> Result<Listing, FolderError> {
    let mut folders = Vec::new();
    let variable = std::env::var_os(VARIABLE).unwrap_or_default();
    for folder in std::env::split_paths(&variable).filter(|f| !f.as_os_str().is_empty()) {
        folders.push((folder, VARIABLE));
    }
    folders.extend(named.iter().map(|f| (f.clone(), "--plugins")));
    for (folder, flag) in &folders {
        if !folder.is_dir() {
            return Err(FolderError::Missing { flag, folder: folder.clone() });
        }
    }
    let mut folders: Vec<(PathBuf, bool)> = folders.into_iter().map(|(folder, _)| (folder, false)).collect();
    for input in inputs {
        let folder = if input.is_dir() { input } else { input.parent().unwrap_or(Path::new("")) };
        let own = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        for (folder, is_own) in [(own.to_path_buf(), true), (folder.join(BESIDE), false)] {
            if !folders.iter().any(|(known, _)| is_same(known, &folder)) {
                folders.push((folder, is_own));
            }
        }
    }
    let mut listing = Listing {
        plugins: plugins.clone(),
        shown: Vec::new(),
        files: Vec::new(),
        problems: Vec::new(),
        folders: Vec::new(),
    };
    for (folder, is_own) in folders.iter().filter(|(f, _)| f.is_dir()) {
        let files = match files(folder) {
            // A script can stand in a folder that may not be listed.
            Err(_) if *is_own => continue,
            files => files.map_err(|error| FolderError::Unreadable { folder: folder.clone(), error })?,
        };
        for path in files {
            match read_one(&path) {
                Ok(file) if *is_own && !is_meant(&file) => {}
                Ok(file) => {
                    listing.shown.push(path.display().to_string());
                    listing.files.push(file);
                }
                Err(text) => {
                    let file = path.canonicalize().unwrap_or(path);
                    listing.problems.push(PluginProblem { text, file });
                }
            }
        }
    }
    listing.folders = folders.into_iter().map(|(folder, _)| folder).collect();
    Ok(listing)
}

impl Listing {
    pub fn compile(self) -> Found {
        let Listing { plugins, shown, files, problems, folders } = self;
        let mut found = Found { registry: plugins, problems, files, folders };
        for (shown, file) in shown.iter().zip(&found.files) {
            if let Err(text) = compile(&mut found.registry, shown, file) {
                found.problems.push(PluginProblem { text, file: file.path.clone() });
            }
        }
        found
    }
}

fn is_same(a: &Path, b: &Path) -> bool {
    a == b || matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// An importer by its name, an effect by its head: `// effect: NAME`.
fn is_meant(file: &PluginFile) -> bool {
    let is_comment = |l: &&str| l.trim().is_empty() || l.trim_start().starts_with("//");
    let names_effect = |l: &str| l.trim().trim_start_matches('/').trim_start().starts_with("effect:");
    let wgsl = file.path.to_string_lossy().ends_with(choreo_look::ENDING);
    !wgsl || file.text.lines().take_while(is_comment).any(names_effect)
}

/// Plugin files of a folder, by name, so that the order is the same on every machine.
fn files(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder)?.take(MOST_FILES) {
        let path = entry?.path();
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let is_plugin = ENDINGS.iter().any(|ending| name.ends_with(ending));
        if is_plugin && !name.starts_with('.') && path.is_file() {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

fn read_one(path: &Path) -> Result<PluginFile, String> {
    let shown = path.display();
    let failed = |e: std::io::Error| format!("{shown}: cannot read: {}", reason(&e));
    let length = std::fs::metadata(path).map_err(failed)?.len();
    if length > MOST_BYTES {
        return Err(format!("{shown}: a plugin of {length} bytes, at most {MOST_BYTES}"));
    }
    let bytes = std::fs::read(path).map_err(failed)?;
    let text = String::from_utf8(bytes)
        .map_err(|e| format!("{shown}: byte {} is no UTF-8 text", e.utf8_error().valid_up_to()))?;
    let path = path.canonicalize().map_err(failed)?;
    let named = if path.to_string_lossy().ends_with(choreo_look::ENDING) {
        choreo_look::files(&text)
    } else {
        Vec::new()
    };
    let beside = named.into_iter().map(|name| beside(&path, name)).collect();
    Ok(PluginFile { path, text, beside })
}

/// A file in the folder of a plugin's own or below it.
fn beside(plugin: &Path, name: String) -> BesideFile {
    let folder = plugin.parent().unwrap_or(Path::new(""));
    let path = folder.join(&name);
    let bytes = (|| {
        let inside = Path::new(&name).components().all(|c| matches!(c, Component::Normal(_)));
        if !inside {
            return Err("a plugin reads files of its own folder only".to_string());
        }
        let found = path.canonicalize().map_err(|e| reason(&e))?;
        if !found.starts_with(folder) {
            return Err("a plugin reads files of its own folder only".to_string());
        }
        let length = std::fs::metadata(&found).map_err(|e| reason(&e))?.len();
        if length > MOST_BESIDE {
            return Err(format!("{length} bytes, at most {MOST_BESIDE}"));
        }
        std::fs::read(&found).map(Arc::from).map_err(|e| reason(&e))
    })();
    BesideFile { name, path, bytes }
}

/// Pixels of a file that an effect names.
fn picture(file: &PluginFile, name: &str) -> Result<Picture, String> {
    let found = file.beside.iter().find(|b| b.name == name);
    let found = found.ok_or_else(|| "it was not read".to_string())?;
    let bytes = found.bytes.clone()?;
    let place = found.path.display().to_string();
    let decoded = Encoded::examine(place, name.to_string(), bytes, Formats::All)
        .and_then(|encoded| encoded.decode())
        .map_err(|problem| problem.what)?;
    Ok(Picture {
        size: [decoded.width, decoded.height],
        rgba: decoded.rgba.clone(),
        file: Some(found.path.clone()),
    })
}

fn compile(registry: &mut Registry, shown: &str, file: &PluginFile) -> Result<(), String> {
    if shown.ends_with(choreo_look::ENDING) {
        let effect = WgslEffect::with_pictures(shown, &file.text, |name| picture(file, name))
            .map_err(|e| e.to_string())?;
        registry.add_effect(effect.with_file(file.clone()));
    } else {
        let importer = RhaiImporter::from_text(shown, &file.text).map_err(|e| e.to_string())?;
        registry.add_importer(importer.with_file(file.clone()));
    }
    Ok(())
}

/// The system's words without "(os error 2)".
fn reason(error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound => "no such file or folder".to_string(),
        std::io::ErrorKind::PermissionDenied => "permission denied".to_string(),
        _ => {
            let text = error.to_string();
            text.split_once(" (os error").map_or(text.clone(), |(words, _)| words.to_string())
        }
    }
}
