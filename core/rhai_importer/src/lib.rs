//! Importers in one file: `NAME.importer.rhai` reads a format of your own, with nothing but the program.
//!
//! ```text
//! file's bytes ─► importer.rhai (sandbox: bytes, numbers, budget) ─► fields ─► AssetBuilder ─► Asset
//! ```
//! The script sees the bytes handed over and files beside them, and nothing else; steps, seconds and memory are limited.

mod budget;
mod bytes;
mod engine;
mod fields;
mod importer;
mod lines;
mod manifest;
mod numbers;
mod on_use;
mod scene;

pub use importer::{ENDING, RhaiImporter, ScriptError};
pub use on_use::ImporterOnUse;
