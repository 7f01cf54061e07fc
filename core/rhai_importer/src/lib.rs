//! Importers and exporters in one file: `NAME.importer.rhai` reads a format of your own without a compiler, and
//! `NAME.exporter.rhai` writes scenes.
//!
//! ```text
//! file's bytes ─► importer.rhai (sandbox: bytes, numbers, budget) ─► fields ─► AssetBuilder ─► Asset
//! scene ─► exporter.rhai (sandbox: posed) ─► SceneFiles
//! ```
//! The script can read its input and files beside the source, and nothing else; steps, seconds and memory are limited.

mod budget;
mod bytes;
mod engine;
mod exporter;
mod fields;
mod importer;
mod lazy_importer;
mod lines;
mod manifest;
mod numbers;
mod posed;
mod quaternions;
mod scene;
mod script_error;

pub use exporter::{EXPORTER_ENDING, RhaiExporter};
pub use importer::{IMPORTER_ENDING, RhaiImporter};
pub use lazy_importer::LazyImporter;
pub use script_error::ScriptError;

/// The README of this crate, which is the user documentation.
pub const README: &str = include_str!("../README.md");
