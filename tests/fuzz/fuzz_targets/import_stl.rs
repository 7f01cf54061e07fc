//! STL bytes, binary and text; an asset that imports without error is played and drawn.
#![no_main]

use choreo_fuzz::{NoFiles, import};
use import_stl::StlImporter;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| import(&StlImporter, "fuzz.stl", bytes, &NoFiles));
