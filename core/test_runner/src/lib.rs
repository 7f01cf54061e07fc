//! Runs tests that are written as scripts: sections of Rhai files are run, judged and reported.
//!
//! ```text
//! paths ─► sections ─► stage + expectations ─► checks ─► outcomes ─► terminal │ HTML │ JUnit │ JSON
//! ```
//! Sections are read and run by [`choreo_script`]. This crate judges them ([`outcome::Check`]) and reports them ([`outcome::Outcome`]).

pub mod collect;
pub mod evaluate;
pub mod golden_image;
pub mod images;
pub mod outcome;
pub mod painter;
pub mod report;
pub mod results;
pub mod run;
mod section;

pub use outcome::{Check, Evidence, Measures, Outcome, Pictures, SourceLocation, Status, Trace};

/// The README, as a page of the documentation.
pub const README: &str = include_str!("../README.md");
