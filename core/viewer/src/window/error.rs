//! Why the window cannot be opened, or ends, and why an image of it is not saved.

use choreo_files::WriteError;
use choreo_plugin::ExportError;
use std::io;

#[derive(Debug, thiserror::Error)]
pub(crate) enum ViewerError {
    /// The project's `choreo.toml` has an error.
    #[error(transparent)]
    Project(#[from] crate::args::ProjectError),
    /// The text has a hint where a package is missing.
    #[error("{0}")]
    NoWindow(String),
    #[error("cannot start a thread: {0}")]
    Thread(io::Error),
    #[error(transparent)]
    Watch(#[from] choreo_session::WatchError),
    #[error("the window system failed: {0}")]
    WindowSystem(#[from] winit::error::EventLoopError),
    #[error("the window system has gone: {0}")]
    WindowSystemGone(String),
    #[error("the window can no longer be drawn: {first}; {second}")]
    NotDrawn { first: String, second: String },
}

impl ViewerError {
    /// Exit code of the program.
    pub fn exit_code(&self) -> u8 {
        match self {
            ViewerError::Project(_) => 1,
            _ => 4,
        }
    }
}

/// Why an image is not saved; there is no incomplete file.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SaveError {
    #[error("no exporter writes such files")]
    NoExporter,
    #[error("cannot write: {0}")]
    Write(#[from] WriteError),
    #[error("cannot write: {0}")]
    Open(#[from] io::Error),
    #[error("cannot write: {0}")]
    Export(#[from] ExportError),
}
