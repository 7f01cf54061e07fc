//! The language server: gives editors that use the Language Server Protocol (LSP) the findings of `check`, the script API and the contents
//! of a project's files.
//!
//! ```text
//! editor ─► transport ─► server ─┬─► completion, hover, … ◄── source (tokens) ◄── values (types of expressions)
//!                          ▲     ├─► files (contents of models, read in the background)
//!                          │     ├─► hints, lenses (the stage of the last run) ◄─┐
//!                          ├─────┴── checker (its own thread): the script run on the unsaved text
//!                          └──────── commands (a thread and a process each): frames, tests, the viewer
//! ```
//! The server depends neither on the command line nor on particular plugins: the [`Host`] provides both.

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
pub use server::{SessionEnd, serve};

use choreo_plugin::Registry;
use choreo_script::{Diagnostic, Limits, Places};
use choreo_stage::Stage;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use thiserror::Error;

/// The README, as a page of the documentation.
pub const README: &str = include_str!("../README.md");

/// The program that runs the server.
pub trait Host: Send + Sync {
    /// Name and version of the program.
    fn program(&self) -> (String, String);
    /// Settings with which a script is run.
    ///
    /// # Errors
    /// `choreo.toml` or a plugin is wrong.
    fn project(&self, script: &Path) -> Result<Project, HostError>;
    /// Findings of `check` about the stage of a script, beyond the messages of the run itself.
    fn survey(&self, stage: &Arc<Stage>, places: &Places, project: &Project) -> Vec<Diagnostic>;
    /// Command line of the process that does a task.
    ///
    /// # Errors
    /// The program cannot determine its own path.
    fn command(&self, task: &Task) -> Result<Command, HostError>;
}

/// Reason why the program cannot do something, as a text for the user.
#[derive(Clone, Debug, Error)]
#[error("{0}")]
pub struct HostError(pub String);

/// Work that an editor's command requests, done in a separate process.
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
    /// Folders in which files are looked for, besides that of the script.
    pub search: Vec<PathBuf>,
    /// Folder of the project, in which tests may read; `None` stands for the folder that is open in the editor.
    pub root: Option<PathBuf>,
    pub limits: Limits,
}
