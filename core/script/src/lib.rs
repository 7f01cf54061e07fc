//! The script API in Rhai: a script runs once and makes a [`choreo_stage::Stage`]. Errors state the place, the problem and what
//! to do.
//!
//! ```text
//! script.rhai ─► engine (sandbox) ─► api (tables of functions) ─► build (drafts) ─► resolve ─► Stage
//!                                     └ loader ─► importer plugins                    └ check ─► warnings
//! ```
//! No other crate runs scene scripts. All script functions are listed in `API.md`, which is generated from the tables in `api`.

mod api;
mod api_error;
mod build;
mod cache;
mod call;
mod check;
mod clip_analysis;
mod clips_only;
mod color;
mod compile;
mod content;
mod cue_times;
mod def;
pub mod describe;
mod diagnostic;
mod earlier_cause;
mod engine;
mod errors;
mod folders;
mod folding;
mod fonts;
pub mod format;
mod frame_callback;
pub mod help;
mod hidden_parts;
mod import;
mod legs;
mod limits;
mod lint;
mod load;
mod loader;

mod modules;
mod parsed;
mod procedural;
mod recover;
mod reference;
mod resolve;
mod run;
mod synonyms;
mod test_data;
pub mod testing;
mod tokens;
mod totals;
mod value;
mod walk;

pub use api_error::Place;
pub use build::Parameter;
pub use cache::AssetCache;
pub use color::KELVIN_RANGE;
pub use content::{add_to_hash, content_of, hex};
pub use diagnostic::{Diagnostic, Severity, printable, printable_line, steers_terminal};
pub use folders::{Folders, LoadError};
pub use folding::constant_expressions;
pub use import::{Import, ImportProgress, Imports, Phase};
pub use limits::{LimitError, Limits, raise_hint};
pub use lint::{ClipMarkers, Places};
pub use loader::{BUILT_IN, ImportChoice, Loader, PlayedClips, built_in_assets};
pub use reference::reference;
pub use run::{
    NO_THREAD, RunDependencies, Script, ScriptOptions, run_file, run_file_with_dependencies, run_text,
};
pub use tokens::{
    InterpolatedCode, comments, is_closing_bracket, is_name, is_opening_bracket, quoted, token_ranges,
    tokens_and_interpolations,
};
// Misspellings get suggestions in the same words everywhere.
pub use api::clip::{NoMatchingJoints, mapping_lines};
pub use api::cue::mask_problem;
pub use api::easing::easing_names;
pub use api::keys::INTERPOLATIONS as KEY_INTERPOLATIONS;
pub(crate) use choreo_plugin::suggest;
pub use choreo_plugin::suggest::{closest, did_you_mean};

/// The reference of everything that a script can call, as Markdown.
pub const API: &str = include_str!("../API.md");
