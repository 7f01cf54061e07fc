//! Shared by the tests: the folder of sample files, and importing from it.
#![allow(dead_code)]

pub mod sample;

use choreo_asset::Asset;
use choreo_plugin::{Files, ImportError, ImportOptions, ImportScope, Importer, OptionValue, Source};
use import_gltf::GltfImporter;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// `$CHOREO_ASSETS`, or `../shared/assets` beside the workspace; `None` (and a line that says so) where missing.
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

pub struct Folder(pub PathBuf);

impl Files for Folder {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        std::fs::read(self.0.join(relative)).map(Arc::new).map_err(|e| e.to_string())
    }
}

/// No further files.
pub struct Nothing;

impl Files for Nothing {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        Err(format!("\"{relative}\": file not found"))
    }
}

pub fn source(name: &str, bytes: Vec<u8>) -> Source {
    Source { name: name.to_string(), bytes: Arc::new(bytes) }
}

pub fn import_path(path: &Path) -> Result<Asset, ImportError> {
    import_path_with(path, &ImportOptions::default())
}

/// The same without a mesh of bones where the file has none.
pub fn import_path_without_bones(path: &Path) -> Result<Asset, ImportError> {
    let mut options = ImportOptions::default();
    options.0.insert("bones".into(), OptionValue::Bool(false));
    import_path_with(path, &options)
}

fn import_path_with(path: &Path, options: &ImportOptions) -> Result<Asset, ImportError> {
    let name = path.file_name().unwrap().to_string_lossy();
    let folder = Folder(path.parent().unwrap().to_path_buf());
    let source = source(&name, std::fs::read(path).unwrap());
    GltfImporter::new().import(&source, &folder, ImportScope::ALL, options)
}

/// Imports a file without companions.
pub fn import_bytes(name: &str, bytes: Vec<u8>) -> Result<Asset, ImportError> {
    GltfImporter::new().import(&source(name, bytes), &Nothing, ImportScope::ALL, &ImportOptions::default())
}

pub fn error_text(result: Result<Asset, ImportError>) -> String {
    match result {
        Ok(_) => "no error".to_string(),
        Err(e) => e.to_string(),
    }
}

/// A GLB with its JSON and its binary chunk changed.
pub fn edited(glb: &[u8], edit: impl FnOnce(&mut serde_json::Value, &mut Vec<u8>)) -> Vec<u8> {
    let word = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
    let json_end = 20 + word(12);
    let mut json = serde_json::from_slice(&glb[20..json_end]).unwrap();
    let mut bin = if json_end < glb.len() { glb[json_end + 8..].to_vec() } else { Vec::new() };
    edit(&mut json, &mut bin);
    glb_of(&json, &bin)
}

pub fn glb_of(json: &serde_json::Value, bin: &[u8]) -> Vec<u8> {
    let mut text = serde_json::to_vec(json).unwrap();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut out = b"glTF".to_vec();
    let total = 12 + 8 + text.len() + 8 + bin.len();
    for word in [2, total as u32, text.len() as u32, 0x4E4F_534A] {
        out.extend(word.to_le_bytes());
    }
    out.extend(&text);
    out.extend((bin.len() as u32).to_le_bytes());
    out.extend(0x004E_4942u32.to_le_bytes());
    out.extend(bin);
    out
}
