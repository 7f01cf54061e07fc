//! Plugins that are files: `NAME.importer.rhai` and `NAME.wgsl` in a folder `plugins` beside the script, in the folders
//! given with `--plugins`, and in those that the environment variable CHOREO_PLUGINS names. No other place is read.

use crate::failure::{Failure, Problem, reason};
use choreo_dropin::RhaiImporter;
use choreo_look::WgslEffect;
use choreo_plugin::{PluginFile, Registry};
use std::path::{Path, PathBuf};

/// Folders named as the system's PATH is.
pub const VARIABLE: &str = "CHOREO_PLUGINS";
/// The folder beside a script.
const BESIDE: &str = "plugins";

/// Bytes of a plugin's text, and files looked at in one folder.
const MOST_BYTES: u64 = 4 << 20;
const MOST_FILES: usize = 10_000;

/// The plugins given and those of the files found. Later folders win over earlier ones: those of CHOREO_PLUGINS,
/// then `--plugins` in order, then the folders beside the scripts.
pub fn registry(plugins: &Registry, named: &[PathBuf], inputs: &[&Path]) -> Result<Registry, Failure> {
    let (registry, problems) = found(plugins, named, inputs)?;
    match problems.is_empty() {
        true => Ok(registry),
        false => Err(Failure::Input(problems)),
    }
}

/// The same, with what is wrong with single files beside it.
pub fn found(
    plugins: &Registry,
    named: &[PathBuf],
    inputs: &[&Path],
) -> Result<(Registry, Vec<Problem>), Failure> {
    let mut folders = Vec::new();
    let variable = std::env::var_os(VARIABLE).unwrap_or_default();
    for folder in std::env::split_paths(&variable).filter(|f| !f.as_os_str().is_empty()) {
        folders.push((folder, VARIABLE));
    }
    folders.extend(named.iter().map(|f| (f.clone(), "--plugins")));
    for (folder, flag) in &folders {
        if !folder.is_dir() {
            return Err(Failure::Usage(format!("{flag} {}: no such folder", folder.display())));
        }
    }
    for input in inputs {
        let folder = if input.is_dir() { input } else { input.parent().unwrap_or(Path::new("")) };
        let beside = folder.join(BESIDE);
        if beside.is_dir() && !folders.iter().any(|(f, _)| *f == beside) {
            folders.push((beside, BESIDE));
        }
    }
    let mut registry = plugins.clone();
    let mut problems = Vec::new();
    for (folder, _) in folders {
        for path in files(&folder)? {
            if let Err(text) = add(&mut registry, &path) {
                problems.push(Problem::Text(text));
            }
        }
    }
    Ok((registry, problems))
}

/// Plugin files of a folder, by name, so that the order is the same on every machine.
fn files(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let failed = |e| Failure::input(format!("{}: cannot read: {}", folder.display(), reason(&e)));
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)?.take(MOST_FILES) {
        let path = entry.map_err(failed)?.path();
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let is_plugin = name.ends_with(choreo_dropin::ENDING) || name.ends_with(choreo_look::ENDING);
        if is_plugin && !name.starts_with('.') && path.is_file() {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

fn add(registry: &mut Registry, path: &Path) -> Result<(), String> {
    let shown = path.display().to_string();
    let failed = |e: std::io::Error| format!("{shown}: cannot read: {}", reason(&e));
    let length = std::fs::metadata(path).map_err(failed)?.len();
    if length > MOST_BYTES {
        return Err(format!("{shown}: a plugin of {length} bytes, at most {MOST_BYTES}"));
    }
    let bytes = std::fs::read(path).map_err(failed)?;
    let text = String::from_utf8(bytes)
        .map_err(|e| format!("{shown}: byte {} is no UTF-8 text", e.utf8_error().valid_up_to()))?;
    let file = PluginFile { path: path.canonicalize().map_err(failed)?, text };
    if shown.ends_with(choreo_look::ENDING) {
        let effect = WgslEffect::from_text(&shown, &file.text).map_err(|e| e.to_string())?;
        registry.add_effect(effect.with_file(file));
    } else {
        let importer = RhaiImporter::from_text(&shown, &file.text).map_err(|e| e.to_string())?;
        registry.add_importer(importer.with_file(file));
    }
    Ok(())
}
