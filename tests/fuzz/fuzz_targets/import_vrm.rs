//! VRM characters and VRM animations; an asset that imports without error is played and drawn.
#![no_main]

use choreo_fuzz::{NoFiles, import};
use import_vrm::VrmImporter;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| import(&VrmImporter, "fuzz.vrm", bytes, &NoFiles));
