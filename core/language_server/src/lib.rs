//! The language server: what `check`, the script API and the files of a project know, for editors that speak the Language Server
//! Protocol (LSP).
//!
//! ```text
//! editor ─► transport ─► server ─┬─► completion, hover, … ◄── source (tokens) ◄── values (types of expressions)
//!                          ▲     ├─► files (contents of models, read in the background)
//!                          └─────┴── checker (its own thread): the script run on the unsaved text
//! ```
//! It knows neither the command line nor particular plugins: the [`Host`] gives it both.

mod actions;
mod calls;
mod checker;
mod colors;
mod completion;
mod context;
mod diagnostics;
mod document;
mod facts;
mod files;
mod hover;
mod names;
mod position;
mod references;
mod server;
mod signature;
mod snippets;
mod source;
mod symbols;
mod transport;
mod values;
mod view;

pub use calls::calls;
pub use server::{Ended, serve};

use choreo_plugin::Registry;
use choreo_script::{Diagnostic, Limits, Places};
use choreo_stage::Stage;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The program around the server.
pub trait Host: Send + Sync {
    /// Name and version.
    fn program(&self) -> (String, String);
    /// The settings for a script, or what is wrong with them.
    fn project(&self, script: &Path) -> Result<Project, String>;
    /// The findings of `check` about the stage of a script, beyond the messages of the run itself.
    fn survey(&self, stage: &Arc<Stage>, places: &Places, project: &Project) -> Vec<Diagnostic>;
}

/// Settings with which a script is run.
#[derive(Clone)]
pub struct Project {
    pub registry: Registry,
    /// Folders besides the script's own in which files are looked for.
    pub search: Vec<PathBuf>,
    pub limits: Limits,
}
