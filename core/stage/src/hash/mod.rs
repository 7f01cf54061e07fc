//! Content hashes (BLAKE3): equal content, equal hash, on every machine. Floats count by their bits, lists by length and content.
//!
//! They answer two questions: did a script give the same stage again, and are two meshes, materials or images the same thing.

mod asset;
mod character;
mod cues;
mod flat;
mod goals;
mod stage;
mod writer;

pub(crate) use asset::asset_hash;
pub use asset::{clip_hash, skeleton_hash};

pub type ContentHash = [u8; 32];
