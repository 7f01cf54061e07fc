//! FBX bytes, binary and text; an asset that imports without error is played and drawn.
#![no_main]

use choreo_fuzz::{NoFiles, import};
use import_fbx::FbxImporter;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| import(&FbxImporter, "fuzz.fbx", bytes, &NoFiles));
