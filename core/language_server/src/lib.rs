//! The language server: what `check`, the script API and the files of a project know, for editors that speak the Language Server
//! Protocol (LSP).
//!
//! ```text
//! editor ─► transport ─► server ─┬─► completion, hover, … ◄── source (tokens) ◄── values (types of expressions)
//!                          ▲     ├─► files (contents of models, read in the background)
//!                          │     ├─► hints, lenses (the stage of the last run) ◄─┐
//!                          ├─────┴── checker (its own thread): the script run on the unsaved text
//!                          └──────── commands (a thread and a process each): frames, tests, the viewer
//! ```
//! It knows neither the command line nor particular plugins: the [`Host`] gives it both.

mod actions;
mod calls;
mod checker;
mod colors;
mod commands;
mod completion;
mod context;
mod diagnostics;
mod document;
mod facts;
mod files;
mod formatting;
mod hints;
mod hover;
mod lenses;
mod names;
mod position;
mod references;
mod request;
mod semantic;
mod server;
mod settings;
mod signature;
mod snippets;
mod source;
mod symbols;
mod transport;
mod values;
mod view;

pub use calls::calls;
pub use references::{NotRenamed, variable_uses};
pub use server::{Ended, serve};

use choreo_plugin::Registry;
use choreo_script::{Diagnostic, Limits, Places};
use choreo_stage::Stage;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use thiserror::Error;

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

/// The program around the server.
pub trait Host: Send + Sync {
    /// Name and version.
    fn program(&self) -> (String, String);
    /// The settings for a script.
    ///
    /// # Errors
    /// `choreo.toml` or a plugin is wrong.
    fn project(&self, script: &Path) -> Result<Project, HostError>;
    /// The findings of `check` about the stage of a script, beyond the messages of the run itself.
    fn survey(&self, stage: &Arc<Stage>, places: &Places, project: &Project) -> Vec<Diagnostic>;
    /// The process that does a task.
    ///
    /// # Errors
    /// The program cannot tell where it lies itself.
    fn command(&self, task: &Task) -> Result<Command, HostError>;
}

/// Why the program around the server cannot do something, as a text for the user.
#[derive(Clone, Debug, Error)]
#[error("{0}")]
pub struct HostError(pub String);

/// Work that a command of the editor has the program do, in a process of its own.
pub enum Task<'t> {
    /// Draw the frame at a time as an image.
    Frame { script: &'t Path, secs: f64, output: &'t Path },
    /// Run one test of a script, or all of them; a report in JSON goes to standard output. Tests may read below the root.
    Test { script: &'t Path, section: Option<&'t str>, root: &'t Path },
    /// Open the viewer at a time.
    View { script: &'t Path, secs: f64 },
}

/// Settings with which a script is run.
#[derive(Clone)]
pub struct Project {
    pub registry: Registry,
    /// Folders besides the script's own in which files are looked for.
    pub search: Vec<PathBuf>,
    /// Folder of the project, in which tests may read; `None`: the folder that is open in the editor.
    pub root: Option<PathBuf>,
    pub limits: Limits,
}
