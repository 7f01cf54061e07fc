//! The XML of a COLLADA file; an asset that imports without error is played and drawn.
#![no_main]

use choreo_fuzz::{NoFiles, import};
use import_collada::ColladaImporter;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| import(&ColladaImporter, "fuzz.dae", bytes, &NoFiles));
