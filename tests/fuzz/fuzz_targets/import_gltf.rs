//! glTF and GLB bytes; an asset that imports without error is played and drawn.
#![no_main]

use choreo_fuzz::{NoFiles, import};
use import_gltf::GltfImporter;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| import(&GltfImporter::new(), "fuzz.glb", bytes, &NoFiles));
