//! The text of a BVH file; an asset that imports without error is played and drawn.
#![no_main]

use choreo_fuzz::{NoFiles, import};
use import_bvh::BvhImporter;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| import(&BvhImporter, "fuzz.bvh", bytes, &NoFiles));
