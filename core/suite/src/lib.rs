//! Scenes tested by scripts: sections of Rhai files, each run, judged and reported.
//!
//! ```text
//! paths ─► sections ─► stage + expectations ─► checks ─► outcomes ─► terminal │ HTML │ JUnit │ JSON
//! ```
//! Sections are read and run by [`choreo_script`]; here they are judged ([`outcome::Check`]) and told ([`outcome::Outcome`]).

pub mod evaluate;
pub mod outcome;

pub use outcome::{Check, Evidence, Measures, Outcome, Pictures, Place, Status, Trace};
