//! Importers and scene exporters in one Rhai file.

mod exporters;
mod importers;
