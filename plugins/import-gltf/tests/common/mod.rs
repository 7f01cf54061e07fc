//! Shared by the tests: the folder of sample files, and importing from it.
#![allow(dead_code)]

mod glb;
pub(crate) mod sample;

use choreo_asset::Asset;
pub(crate) use choreo_importer_kit_testing::{Companions, assets, error_text, source};
use choreo_plugin::{ImportError, ImportOptions, ImportScope, Importer, OptionValue};
pub(crate) use glb::glb_of;
use import_gltf::GltfImporter;
use std::path::Path;

pub(crate) fn import_path(path: &Path) -> Result<Asset, ImportError> {
    import_path_with(path, &ImportOptions::default())
}

/// The same without a mesh of bones where the file has none.
pub(crate) fn import_path_without_bones(path: &Path) -> Result<Asset, ImportError> {
    let mut options = ImportOptions::default();
    options.0.insert("bones".into(), OptionValue::Bool(false));
    import_path_with(path, &options)
}

fn import_path_with(path: &Path, options: &ImportOptions) -> Result<Asset, ImportError> {
    let name = path.file_name().unwrap().to_string_lossy();
    let folder = Companions::in_folder(path.parent().unwrap());
    let source = source(&name, std::fs::read(path).unwrap());
    GltfImporter::new().import(&source, &folder, ImportScope::ALL, options)
}

/// Imports a file without companions.
pub(crate) fn import_bytes(name: &str, bytes: Vec<u8>) -> Result<Asset, ImportError> {
    choreo_importer_kit_testing::import_bytes(&GltfImporter::new(), name, bytes)
}

/// A GLB with its JSON and its binary chunk changed.
pub(crate) fn edited(glb: &[u8], edit: impl FnOnce(&mut serde_json::Value, &mut Vec<u8>)) -> Vec<u8> {
    let word = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
    let json_end = 20 + word(12);
    let mut json = serde_json::from_slice(&glb[20..json_end]).unwrap();
    let mut bin = if json_end < glb.len() { glb[json_end + 8..].to_vec() } else { Vec::new() };
    edit(&mut json, &mut bin);
    glb_of(&json, &bin)
}
