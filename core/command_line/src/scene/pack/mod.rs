//! Packed scenes: a script or model with all files that it reads, in one archive. `choreo pack` writes the archive, and commands that open
//! a scene once take it in place of the script.
//!
//! The archive is an uncompressed tar file, so that the unpacked files are never larger than the archive. Its first entry is [`MANIFEST_FILE`]:
//! input and arguments of the scene, and the hash of every file. The files follow in the order of the manifest. They lie beneath
//! `files/N/`, with one number N for each folder that the script could read.

mod read;
mod write;

pub(crate) use read::{Unpacked, is_packed, read_project_file_text};
pub(crate) use write::{write_archive, write_folder};

use crate::args::PackedStage;
use crate::failure::Failure;
use crate::scene::OpenedScene;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::{Component, Path};

/// Extension of the archives.
pub(crate) const PACK_EXTENSION: &str = "choreo";

/// Name of the first entry, which describes the packed scene.
const MANIFEST_FILE: &str = "choreo.json";

/// The description of a packed scene: the contents of its first entry.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Manifest {
    /// Name and version of the program that packed the scene; the same version renders the same bytes.
    pub software: String,
    /// Path of the script or model. All paths are relative to the root of the archive, with slashes.
    pub input: String,
    /// Search folders and plugin folders.
    pub search: Vec<String>,
    pub plugins: Vec<String>,
    /// Arguments of the scene, NAME=VALUE: parameters of the script, and options of the importer.
    pub set: Vec<String>,
    pub import: Vec<String>,
    pub clip: Option<String>,
    pub importer: Option<String>,
    /// Text of the project's `choreo.toml` with default options of commands; empty if there is none.
    pub options: String,
    /// Hashes of all files read, and of the stage.
    pub input_hash: String,
    pub stage: String,
    pub files: Vec<PackedFile>,
    /// Symbolic links by which files were found, each as (name, path of its file). The archive itself contains no links.
    pub names: Vec<(String, String)>,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct PackedFile {
    pub path: String,
    pub bytes: u64,
    /// BLAKE3 hash in hexadecimal digits.
    pub blake3: String,
}

impl Manifest {
    fn json(&self) -> Value {
        let mut value = json!(self);
        value["pack"] = json!(1);
        value
    }

    /// Parses a manifest; `None` if a field is missing, or if a path leads out of the archive.
    fn read(value: &Value) -> Option<Manifest> {
        (value["pack"] == 1).then_some(())?;
        let manifest = Manifest::deserialize(value).ok()?;
        let Manifest { input, search, plugins, files, names, .. } = &manifest;
        let paths = search.iter().chain(plugins).chain(files.iter().map(|file| &file.path));
        let is_file = |path: &str| files.iter().any(|file| file.path == path);
        let is_valid = paths.chain([input]).all(|path| is_inside(path))
            && names.iter().all(|(name, of)| is_inside(name) && is_file(of) && !is_file(name));
        is_valid.then_some(manifest)
    }
}

/// Compares the scene opened from the archive with the scene that was packed. Returns a warning if another version of the program packed it,
/// since images may then differ.
///
/// # Errors
/// The same version of the program gets another scene. Every file has its hash, so a plugin of this machine must have changed the scene.
pub(super) fn check_packed_stage(
    packed: &PackedStage,
    scene: &OpenedScene,
) -> Result<Option<String>, Failure> {
    let name = &scene.name;
    if packed.software != scene.software {
        let (there, here) = (&packed.software, &scene.software);
        return Ok(Some(format!(
            "{name}: warning: {there} packed it, but this program is {here}: its images may differ"
        )));
    }
    let same = packed.input_hash == hash_hex(&scene.input_hash)
        && packed.stage == hash_hex(&scene.stage.content_hash());
    match same {
        true => Ok(None),
        false => Err(Failure::input(format!(
            "{name}: the scene differs from the one that was packed\n    hint: a plugin of this \
             machine changes it; CHOREO_PLUGINS= in the environment disables the user's plugins"
        ))),
    }
}

/// Whether a path consists of plain names: no root, no `..`, and nothing that another system would read as one of them.
fn is_inside(path: &str) -> bool {
    let plain = |part: Component| matches!(part, Component::Normal(_));
    !path.is_empty()
        && !path.contains(['\\', '\0'])
        && path.split('/').all(|part| !part.is_empty() && part != "." && part != "..")
        && Path::new(path).components().all(plain)
}

/// Formats a hash in hexadecimal digits.
fn hash_hex(hash: &[u8; 32]) -> String {
    blake3::Hash::from_bytes(*hash).to_hex().to_string()
}
