//! Writing the archive: each file that the scene read, beneath the folder in which it was found.

use super::{MANIFEST_FILE, Manifest, PackedFile, hash_hex};
use crate::args::SceneArgs;
use crate::failure::Failure;
use crate::scene::OpenedScene;
use choreo_files::{WriteError, containing_folder, write_whole_beneath};
use choreo_session::package::DESCRIPTION;
use choreo_session::plugin_files;
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

/// Writes the archive of an open scene. `options`: text of the project's `choreo.toml`. Returns the manifest and the writer.
pub(crate) fn write_archive<W: Write>(
    scene: &OpenedScene,
    args: &SceneArgs,
    options: String,
    to: W,
) -> Result<(Manifest, W), Failure> {
    let roots = ReadableFolders::from_args(args)?;
    let sources = files_to_pack(scene, args, &roots)?;
    let names = link_names(scene, &roots, &sources);
    let mut files = Vec::new();
    let mut contents = Vec::new();
    for (path, source) in &sources {
        let shown = source.display();
        let bytes = choreo_files::read(source, scene.limits.file)
            .map_err(|e| Failure::input(format!("{shown}: cannot read: {e}")))?;
        let hash = *blake3::hash(&bytes).as_bytes();
        // Package descriptions are read while plugins are listed, and have no recorded hash.
        let read = source.canonicalize().ok().and_then(|path| scene.dependencies.read.get(&path));
        if read.is_some_and(|read| *read != hash) {
            return Err(Failure::input(format!("{shown}: it was changed while it was packed; pack again")));
        }
        files.push(PackedFile { path: path.clone(), bytes: bytes.len() as u64, blake3: hash_hex(&hash) });
        contents.push(bytes);
    }
    let manifest = Manifest {
        software: args.software.clone(),
        input: roots.input.clone(),
        search: roots.archive_paths(&args.search)?,
        plugins: roots.archive_paths(&roots.plugins)?,
        set: args.set.clone(),
        import: args.import.import.clone(),
        clip: args.clip.clone(),
        importer: args.import.importer.clone(),
        options,
        input_hash: hash_hex(&scene.input_hash),
        stage: hash_hex(&scene.stage.content_hash()),
        files,
        names,
    };
    let mut archive = tar::Builder::new(to);
    let text = crate::terminal::json::pretty(&manifest.json()) + "\n";
    let failed = |e: std::io::Error| {
        Failure::Output(format!("the archive: cannot write: {}", choreo_files::describe_error(&e)))
    };
    append_file(&mut archive, MANIFEST_FILE, text.as_bytes()).map_err(failed)?;
    for (file, bytes) in manifest.files.iter().zip(contents) {
        append_file(&mut archive, &file.path, &bytes).map_err(failed)?;
    }
    let to = archive.into_inner().map_err(failed)?;
    Ok((manifest, to))
}

/// Writes the entries of an archive made by `write_archive` as files of a folder.
pub(crate) fn write_folder(archive: impl Read, folder: &Path) -> Result<(), WriteError> {
    let mut archive = tar::Archive::new(archive);
    for entry in archive.entries()? {
        let mut entry = entry?;
        let name = entry.path()?.into_owned();
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes)?;
        write_whole_beneath(folder, &name, &bytes)?;
    }
    Ok(())
}

/// Adds a file without times, owner and permissions: the archive depends on the contents alone.
fn append_file<W: Write>(archive: &mut tar::Builder<W>, path: &str, bytes: &[u8]) -> std::io::Result<()> {
    let mut header = tar::Header::new_gnu();
    header.set_size(bytes.len() as u64);
    header.set_mode(0o644);
    header.set_mtime(0);
    header.set_entry_type(tar::EntryType::Regular);
    archive.append_data(&mut header, path, bytes)
}

/// The folders that the scene could read, and their places in the archive.
struct ReadableFolders {
    /// Canonical folders that lie in none of the others, with their paths in the archive.
    outermost: Vec<(PathBuf, String)>,
    /// Plugin folders that were searched; those of the command line come first.
    plugins: Vec<PathBuf>,
    /// Path of the script or model in the archive, and its canonical path on disk. They differ if the input is a link.
    input: String,
    input_path: Option<PathBuf>,
}

impl ReadableFolders {
    fn from_args(args: &SceneArgs) -> Result<ReadableFolders, Failure> {
        let built_in = super::super::model::is_built_in(&args.input);
        if built_in {
            let what = format!("{}: it is built into choreo; there is nothing to pack", args.input.display());
            return Err(Failure::input(what));
        }
        let folder = containing_folder(&args.input);
        let plugins = plugin_files::named_folders(&args.import.plugins);
        let mut folders = Vec::new();
        for folder in std::iter::once(folder).chain(args.search.iter().chain(&plugins).map(PathBuf::as_path))
        {
            let canonical = folder.canonicalize().map_err(|e| {
                Failure::input(format!(
                    "{}: cannot read: {}",
                    folder.display(),
                    choreo_files::describe_error(&e)
                ))
            })?;
            if !folders.contains(&canonical) {
                folders.push(canonical);
            }
        }
        let is_inner = |folder: &PathBuf| folders.iter().any(|o| o != folder && folder.starts_with(o));
        let outermost = folders.iter().filter(|folder| !is_inner(folder)).cloned().enumerate();
        let outermost = outermost.map(|(i, folder)| (folder, format!("files/{i}"))).collect();
        let mut roots = ReadableFolders {
            outermost,
            plugins,
            input: String::new(),
            input_path: args.input.canonicalize().ok(),
        };
        let name = args.input.file_name().unwrap_or_default();
        roots.input = roots.archive_path(&folders[0].join(name))?;
        Ok(roots)
    }

    /// Path in the archive for a canonical path on disk; an error if it lies in none of the folders.
    fn archive_path(&self, path: &Path) -> Result<String, Failure> {
        let inside =
            self.outermost.iter().find_map(|(folder, place)| Some((path.strip_prefix(folder).ok()?, place)));
        let (below, place) = inside.ok_or_else(|| {
            Failure::input(format!("{}: it lies outside the folders that the scene may read", path.display()))
        })?;
        let mut packed = place.clone();
        for part in below.components() {
            let part = part.as_os_str().to_str().filter(|part| super::is_inside(part)).ok_or_else(|| {
                Failure::input(format!("{}: other systems do not allow this name; rename it", path.display()))
            })?;
            packed = format!("{packed}/{part}");
        }
        Ok(packed)
    }

    fn archive_paths(&self, folders: &[PathBuf]) -> Result<Vec<String>, Failure> {
        let canonical = folders.iter().map(|folder| folder.canonicalize().unwrap_or_else(|_| folder.clone()));
        canonical.map(|folder| self.archive_path(&folder)).collect()
    }
}

/// Symbolic links to packed files, by which the scene found them, as (link, file).
fn link_names(
    scene: &OpenedScene,
    roots: &ReadableFolders,
    sources: &BTreeMap<String, PathBuf>,
) -> Vec<(String, String)> {
    let links = scene
        .dependencies
        .missing_or_linked_paths
        .iter()
        .filter_map(|link| Some((link, link.canonicalize().ok()?)));
    let read = links.filter(|(_, target)| scene.dependencies.read.contains_key(target));
    let places = read.filter_map(|(link, target)| {
        Some((roots.archive_path(link).ok()?, roots.archive_path(&target).ok()?))
    });
    places.filter(|(name, of)| sources.contains_key(of) && !sources.contains_key(name)).collect()
}

/// All files to be packed, by path in the archive: the files that were read, and the descriptions of packages whose plugins were used.
fn files_to_pack(
    scene: &OpenedScene,
    args: &SceneArgs,
    roots: &ReadableFolders,
) -> Result<BTreeMap<String, PathBuf>, Failure> {
    let read = &scene.dependencies.read;
    let mut sources = BTreeMap::from([(roots.input.clone(), args.input.clone())]);
    for path in read.keys().filter(|path| Some(*path) != roots.input_path.as_ref()) {
        sources.insert(roots.archive_path(path)?, path.clone());
    }
    for folder in read.keys().filter_map(|path| path.parent()) {
        let description = folder.join(DESCRIPTION);
        if description.is_file()
            && let Ok(place) = roots.archive_path(&description)
        {
            sources.insert(place, description);
        }
    }
    Ok(sources)
}
