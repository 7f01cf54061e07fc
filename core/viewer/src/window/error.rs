//! Errors of opening or running the window, and of saving an image.

use choreo_files::WriteError;
use choreo_plugin::ExportError;
use std::io;

#[derive(Debug, thiserror::Error)]
pub(crate) enum ViewerError {
    /// The project's `choreo.toml` has an error.
    #[error(transparent)]
    Project(#[from] crate::args::ProjectError),
    /// The window cannot be opened; the text has a hint if a package is missing.
    #[error("{0}")]
    NoWindow(String),
    #[error("cannot start a thread: {0}")]
    Thread(io::Error),
    #[error(transparent)]
    Watch(#[from] choreo_session::WatchError),
    #[error("the window system failed: {0}")]
    WindowSystem(#[from] winit::error::EventLoopError),
    #[error("the connection to the window system was lost: {0}")]
    WindowSystemGone(String),
    #[error("the window can no longer be drawn: {first}; {second}")]
    NotDrawn { first: String, second: String },
}

impl ViewerError {
    /// Exit code of the program.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            ViewerError::Project(_) => 1,
            _ => 4,
        }
    }
}

/// Reason why an image was not saved; no incomplete file is left.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SaveError {
    #[error("no installed exporter writes files with this extension")]
    NoExporter,
    #[error("cannot write: {0}")]
    Write(#[from] WriteError),
    #[error("cannot write: {0}")]
    Open(#[from] io::Error),
    #[error("cannot write: {0}")]
    Export(#[from] ExportError),
}
