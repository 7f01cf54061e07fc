//! Scenes tested by scripts: sections of Rhai files, each run, judged and reported.
//!
//! ```text
//! paths ─► sections ─► stage + expectations ─► checks ─► outcomes ─► terminal │ HTML │ JUnit │ JSON
//! ```
//! Sections are read and run by [`choreo_script`]; here they are judged ([`outcome::Check`]) and reported ([`outcome::Outcome`]).

pub mod collect;
pub mod evaluate;
pub mod images;
pub mod outcome;
pub mod painter;
pub mod report;
pub mod results;
pub mod run;
mod section;
pub mod stored;

pub use outcome::{Check, Evidence, Measures, Outcome, Pictures, SourceLocation, Status, Trace};

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");
