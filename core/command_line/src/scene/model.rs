//! A model file as the input: it is found, imported, and placed on a stage of its own.

use crate::args::ImportArgs;
use crate::args::values;
use crate::failure::Failure;
use crate::scene::opening::OpenOptions;
use crate::terminal::import_bar::ImportBar;
use choreo_asset::Asset;
use choreo_files::{FileError, containing_folder};
use choreo_plugin::Registry;
use choreo_script::{ImportChoice, Imports, Limits, LoadError, Loader, RunDependencies, did_you_mean};
pub(crate) use choreo_session::model::{is_built_in, list};
use choreo_stage::Stage;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Fails if the file does not exist or is a folder, with the same message for scripts and models.
pub(crate) fn check_is_file(path: &Path) -> Result<(), Failure> {
    let shown = path.display();
    if is_built_in(path) {
        return Ok(());
    }
    match std::fs::metadata(path) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Err(Failure::input(missing_file_message(path))),
        Err(e) => Err(Failure::input(format!("{shown}: cannot read: {}", FileError::Io(e)))),
        Ok(m) if m.is_dir() => Err(Failure::input(format!(
            "{shown}: cannot read: it is a folder, not a file{}",
            folder_contents_hint(path)
        ))),
        Ok(m) if !m.is_file() => {
            Err(Failure::input(format!("{shown}: cannot read: it is not a regular file")))
        }
        Ok(_) => Ok(()),
    }
}

fn missing_file_message(path: &Path) -> String {
    let folder = containing_folder(path);
    if !folder.is_dir() {
        return format!("{}: no such file; the folder {} does not exist", path.display(), folder.display());
    }
    let names = sorted_file_names(folder);
    let wanted = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
    let near = did_you_mean(wanted, names.iter().map(String::as_str));
    format!("{}: no such file{near}", path.display())
}

fn folder_contents_hint(folder: &Path) -> String {
    match sorted_file_names(folder) {
        names if names.is_empty() => String::new(),
        names => format!("; it holds {}", list(names.iter().map(String::as_str), 8)),
    }
}

fn sorted_file_names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> =
        entries.filter_map(|e| e.file_name().into_string().ok()).take(10_000).collect();
    names.sort();
    names
}

/// Reads the first bytes of the file: enough for its importer to recognize it, and for the index of a video.
pub(crate) fn read_first_bytes(path: &Path) -> Result<Vec<u8>, Failure> {
    let mut head = Vec::new();
    if is_built_in(path) {
        return Ok(head);
    }
    let failed = |e: FileError| Failure::input(format!("{}: cannot read: {e}", path.display()));
    let file = choreo_files::open_file(path).map_err(failed)?;
    file.take(16 << 20).read_to_end(&mut head).map_err(|e| failed(e.into()))?;
    Ok(head)
}

/// An imported model, and the files that were read for it.
pub(crate) struct Imported {
    pub asset: Arc<Asset>,
    /// Hash of all files read, regardless of their paths.
    pub hash: [u8; 32],
    pub dependencies: RunDependencies,
}

/// Options of an import from the command line.
pub(crate) fn import_choice(args: &ImportArgs) -> Result<ImportChoice, Failure> {
    let mut choice = ImportChoice { importer: args.importer.clone(), ..ImportChoice::default() };
    for text in &args.import {
        let (name, value) = values::split_name_value("--import", text)?;
        choice.command_line_options.push((name.to_string(), value.to_string()));
    }
    Ok(choice)
}

/// Imports a model under the same restrictions as a script's `load(…)`: it may read its own folder and the search folders.
pub(crate) fn import(
    path: &Path,
    search: &[PathBuf],
    choice: &ImportChoice,
    registry: &Registry,
    limits: &Limits,
    opening: OpenOptions,
) -> Result<Imported, Failure> {
    check_is_file(path)?;
    // The loader knows the file by its name; messages use the path that the user typed.
    let name = match path.to_str() {
        Some(built_in) if is_built_in(path) => built_in,
        _ => path.file_name().and_then(|n| n.to_str()).unwrap_or_default(),
    };
    let shown = path.display().to_string();
    let problem = |e: LoadError| {
        let text = match e.message.strip_prefix(name) {
            Some(rest) => format!("{shown}{rest}"),
            None => format!("{shown}: {}", e.message),
        };
        let hint = e.hint.map(|h| format!("\n    hint: {h}")).unwrap_or_default();
        Failure::input(format!("{text}{hint}"))
    };
    let base = if is_built_in(path) { Path::new("choreo.rhai") } else { path };
    let loader =
        Loader::for_file(base, search, registry, opening.requested_parts, limits.file).map_err(problem)?;
    let imports = Imports::default();
    let loader = match opening.reopen_state {
        Some(reopen_state) => loader.with_cache(&reopen_state.assets),
        None => loader,
    };
    let loader = Arc::new(loader.watched_by(&imports));
    let _bar = ImportBar::for_imports(&imports, opening.quiet);
    let asset = loader.load(name, choice);
    let dependencies = RunDependencies::of(&loader);
    if let Some(reopen_state) = opening.reopen_state {
        reopen_state.set_dependencies(dependencies.clone());
    }
    let asset = asset.map_err(problem)?;
    let mut hashes: Vec<[u8; 32]> = dependencies.read.values().copied().collect();
    hashes.sort_unstable();
    Ok(Imported { asset, hash: *blake3::hash(hashes.as_flattened()).as_bytes(), dependencies })
}

/// Places a model on a stage of its own, as [`choreo_session::model::stage`] does.
pub(crate) fn stage_with_model(asset: Arc<Asset>, clip: Option<&str>) -> Result<Stage, Failure> {
    choreo_session::model::stage(asset, clip).map_err(|e| Failure::input(e.to_string()))
}
