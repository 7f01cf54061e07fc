//! Unpacking an archive that is not trusted: regular files with the names of the manifest are written to a new folder, each with the stated
//! length and hash. Links, `..` and all other entries are refused.

use super::{MANIFEST_FILE, Manifest, PACK_EXTENSION, PackedFile};
use crate::args::values;
use crate::args::{PackedStage, SceneArgs};
use crate::failure::Failure;
use choreo_files::{Folder, write_whole_beneath};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Limits on the size of the manifest in bytes, and on the number of files.
const MAX_MANIFEST_BYTES: u64 = 64 << 20;
const MAX_FILES: usize = 100_000;

/// Whether the input of a command is an archive, or an unpacked archive in a folder.
pub(crate) fn is_packed(input: &Path) -> bool {
    input.extension().is_some_and(|e| e.eq_ignore_ascii_case(PACK_EXTENSION))
        || input.join(MANIFEST_FILE).is_file()
}

/// Text of the `choreo.toml` in an archive; `None` if it cannot be read, which is reported when the archive is opened.
pub(crate) fn read_project_file_text(input: &Path) -> Option<String> {
    if input.is_dir() {
        return Some(read_manifest_file(&Folder::open(input).ok()?).ok()?.options);
    }
    let mut archive = open_tar(choreo_files::open_file(input).ok()?);
    let manifest = read_manifest_entry(&mut archive.entries().ok()?).ok()?;
    Some(manifest.options)
}

fn open_tar(file: File) -> tar::Archive<BufReader<File>> {
    tar::Archive::new(BufReader::with_capacity(1 << 16, file))
}

/// An archive unpacked into a temporary folder, which is removed when this value is dropped.
#[derive(Debug)]
pub(crate) struct Unpacked {
    pub manifest: Manifest,
    folder: TempDir,
}

impl Unpacked {
    /// Unpacks an archive. `shown`: name of the archive in messages.
    pub(crate) fn from_archive(file: File, shown: &str, max_file_bytes: u64) -> Result<Unpacked, Failure> {
        let damaged = |what: &str| Failure::input(format!("{shown}: it is damaged: {what}"));
        let mut archive = open_tar(file);
        let mut entries = archive.entries().map_err(|e| damaged(&choreo_files::describe_error(&e)))?;
        let manifest = read_manifest_entry(&mut entries).map_err(|what| not_a_pack_failure(shown, what))?;
        let unpacked = Unpacked::write_files(manifest, shown, max_file_bytes, |file| {
            let name = &file.path;
            let entry = entries.next().and_then(Result::ok);
            let mut entry = entry.ok_or_else(|| damaged(&format!("{name} is missing")))?;
            if !is_regular_file_named(&entry, name) || entry.size() != file.bytes {
                return Err(damaged(&format!("a different file is in the place of {name}")));
            }
            let mut bytes = Vec::new();
            let read = entry.read_to_end(&mut bytes);
            Ok(if read.is_ok() { bytes } else { Vec::new() })
        })?;
        match entries.next() {
            Some(_) => Err(damaged("it contains more than its manifest lists")),
            None => Ok(unpacked),
        }
    }

    /// Copies an archive in folder form under the rules of the archive: links are refused, even if they stay inside the folder.
    pub(crate) fn from_folder(folder: &Path, max_file_bytes: u64) -> Result<Unpacked, Failure> {
        let shown = folder.display().to_string();
        let damaged = |what: &str| Failure::input(format!("{shown}: it is damaged: {what}"));
        let open = Folder::open(folder).map_err(|e| damaged(&choreo_files::describe_error(&e)))?;
        let manifest = read_manifest_file(&open).map_err(|what| not_a_pack_failure(&shown, what))?;
        Unpacked::write_files(manifest, &shown, max_file_bytes, |file| {
            let name = Path::new(&file.path);
            if open.resolve(name).is_ok_and(|place| place != name) {
                return Err(damaged(&format!("a different file is in the place of {}", file.path)));
            }
            open.read(name, file.bytes).map_err(|e| damaged(&format!("{}: {e}", file.path)))
        })
    }

    /// Writes the files of a manifest to a new folder. `read` returns the bytes of the next file.
    fn write_files(
        manifest: Manifest,
        shown: &str,
        max_file_bytes: u64,
        mut read: impl FnMut(&PackedFile) -> Result<Vec<u8>, Failure>,
    ) -> Result<Unpacked, Failure> {
        let damaged = |what: &str| Failure::input(format!("{shown}: it is damaged: {what}"));
        if manifest.files.len() > MAX_FILES {
            return Err(damaged(&format!("it has more than {MAX_FILES} files")));
        }
        let folder = tempfile::Builder::new().prefix("choreo-").tempdir().map_err(|e| {
            Failure::Output(format!("{shown}: cannot unpack it: {}", choreo_files::describe_error(&e)))
        })?;
        let written = |name: &str, e| Failure::Output(format!("{shown}: cannot unpack {name}: {e}"));
        for file in &manifest.files {
            let name = &file.path;
            if file.bytes > max_file_bytes {
                let hint = choreo_script::raise_hint("file", format!("{max_file_bytes} bytes"));
                return Err(Failure::input(format!("{shown}: {name} is too large\n    hint: {hint}")));
            }
            let bytes = read(file)?;
            if blake3::hash(&bytes).to_hex().as_str() != file.blake3 {
                return Err(damaged(&format!("{name} does not match its hash")));
            }
            write_whole_beneath(folder.path(), Path::new(name), &bytes).map_err(|e| written(name, e))?;
        }
        let folders = manifest.search.iter().chain(&manifest.plugins).map(Path::new);
        let above = manifest.names.iter().filter_map(|(name, _)| Path::new(name).parent());
        for below in folders.chain(above) {
            let shown = below.to_string_lossy();
            let root = Folder::open(folder.path()).map_err(|e| written(&shown, e.into()))?;
            root.create_folders(below).map_err(|e| written(&shown, e))?;
        }
        // Links are made last, so that no file is written through them.
        for (name, of) in &manifest.names {
            create_link(&folder.path().join(of), &folder.path().join(name))
                .map_err(|e| written(name, e.into()))?;
        }
        Ok(Unpacked { manifest, folder })
    }

    /// Opens the archive that is the input of a command, and replaces the arguments by those of the packed scene. Arguments of the command
    /// line override packed ones.
    pub(crate) fn replace_input(args: &mut SceneArgs) -> Result<Option<Unpacked>, Failure> {
        if !is_packed(&args.input) {
            return Ok(None);
        }
        let unpacked = Unpacked::open(&args.input, values::parse_limits(&args.limit)?.file)?;
        unpacked.merge_arguments(args);
        Ok(Some(unpacked))
    }

    /// Opens an archive, packed or in folder form.
    pub(crate) fn open(input: &Path, max_file_bytes: u64) -> Result<Unpacked, Failure> {
        if input.is_dir() {
            return Unpacked::from_folder(input, max_file_bytes);
        }
        let shown = input.display().to_string();
        let file = choreo_files::open_file(input);
        let file = file.map_err(|e| Failure::input(format!("{shown}: cannot read: {e}")))?;
        Unpacked::from_archive(file, &shown, max_file_bytes)
    }

    /// Path of an unpacked file of the manifest.
    pub(crate) fn unpacked_path(&self, path: &str) -> PathBuf {
        self.folder.path().join(path)
    }

    /// Merges the packed arguments into those of a command.
    pub(crate) fn merge_arguments(&self, args: &mut SceneArgs) {
        let manifest = &self.manifest;
        let at = |place: &String| self.folder.path().join(place);
        args.packed_stage = (args.set.is_empty() && args.clip.is_none() && args.import.import.is_empty())
            .then(|| PackedStage {
                software: manifest.software.clone(),
                input_hash: manifest.input_hash.clone(),
                stage: manifest.stage.clone(),
            });
        args.input = at(&manifest.input);
        // Folders of the command line come first, as they do without an archive.
        args.search.extend(manifest.search.iter().map(at));
        args.import.plugins.extend(manifest.plugins.iter().map(at));
        for (given, packed) in [(&mut args.set, &manifest.set), (&mut args.import.import, &manifest.import)] {
            let names: Vec<String> = given.iter().map(|text| values::name_of(text).to_string()).collect();
            let is_given = |text: &str| names.iter().any(|name| name == values::name_of(text));
            let kept: Vec<String> = packed.iter().filter(|text| !is_given(text)).cloned().collect();
            given.splice(0..0, kept);
        }
        args.clip = args.clip.take().or_else(|| manifest.clip.clone());
        args.import.importer = args.import.importer.take().or_else(|| manifest.importer.clone());
    }
}

/// Creates a symbolic link `name` to an unpacked file, or a copy where the system has no such links.
fn create_link(file: &Path, name: &Path) -> std::io::Result<()> {
    #[cfg(unix)]
    return std::os::unix::fs::symlink(file, name);
    #[cfg(not(unix))]
    return std::fs::copy(file, name).map(drop);
}

/// Failure for a file that `choreo pack` did not write.
fn not_a_pack_failure(shown: &str, what: &str) -> Failure {
    Failure::input(format!("{shown}: it is not a scene that choreo pack has written: {what}"))
}

/// Reads the manifest of an archive in folder form.
fn read_manifest_file(folder: &Folder) -> Result<Manifest, &'static str> {
    let text =
        folder.read(Path::new(MANIFEST_FILE), MAX_MANIFEST_BYTES).map_err(|_| "it has no choreo.json")?;
    parse_manifest(&text)
}

/// Reads the manifest, which is the first entry.
fn read_manifest_entry<R: Read>(entries: &mut tar::Entries<'_, R>) -> Result<Manifest, &'static str> {
    let mut entry = entries.next().and_then(Result::ok).ok_or("it is not a tar archive")?;
    if !is_regular_file_named(&entry, MANIFEST_FILE) || entry.size() > MAX_MANIFEST_BYTES {
        return Err("it does not begin with choreo.json");
    }
    let mut text = Vec::new();
    entry.read_to_end(&mut text).map_err(|_| "choreo.json is truncated")?;
    parse_manifest(&text)
}

fn parse_manifest(text: &[u8]) -> Result<Manifest, &'static str> {
    let value = serde_json::from_slice(text).map_err(|_| "choreo.json is not JSON")?;
    Manifest::read(&value).ok_or("choreo.json lacks a field, or has a path that leads out of it")
}

/// Whether an entry is a regular file of this name.
fn is_regular_file_named<R: Read>(entry: &tar::Entry<'_, R>, name: &str) -> bool {
    entry.header().entry_type() == tar::EntryType::Regular && entry.path_bytes() == name.as_bytes()
}
