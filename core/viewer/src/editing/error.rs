//! Reasons why an edit of the script is refused.

use crate::commands::external_editor::EditorError;
use choreo_files::{FileError, WriteError};
use choreo_script::Place;
use std::io;
use std::path::PathBuf;

/// An edit that was refused; the script has not changed. Each text is for the user.
#[derive(Debug, thiserror::Error)]
pub enum EditError {
    #[error("no scene is loaded yet, so that nothing can be changed")]
    NothingShown,
    /// The edited object is no longer in the scene.
    #[error("the edited object no longer exists")]
    ObjectGone,
    /// A model file is open, not a script.
    #[error("there is no script")]
    NoScript,
    #[error("the object is not created by a script line, so that there is no text to change")]
    NotFromScript,
    #[error("{file}:{line}: the object is created in this module; change it there")]
    CreatedInModule { file: String, line: usize },
    #[error("{file}:{line}: this line makes {objects} objects; change it there")]
    SharedLine { file: String, line: usize, objects: usize },
    #[error("the file has changed on disk; wait until it is shown, and try again")]
    ChangedOnDisk,
    #[error("the script has errors: undo the last change, or fix them in the editor")]
    FaultyScript,
    /// The text around the edit has changed since it was offered or made.
    #[error("{0}")]
    TextChanged(&'static str),
    #[error("there is nothing to undo")]
    NothingToUndo,
    #[error("there is nothing to redo")]
    NothingToRedo,
    /// The script computes the value, or something else determines it.
    #[error("{why}")]
    Refused { why: String, line: Option<usize> },
    /// A file cannot be copied into the script's folder.
    #[error("{}: cannot be copied: {source}", path.display())]
    Copy { path: PathBuf, source: io::Error },
    #[error("{}: cannot read: {source}", path.display())]
    Read { path: PathBuf, source: FileError },
    #[error("{}: cannot read: it is not UTF-8 text", .0.display())]
    NotText(PathBuf),
    #[error("{}: cannot write: {source}", path.display())]
    Write { path: PathBuf, source: WriteError },
    #[error("{}: cannot write: it is a symbolic link to {}, outside its folder; open that file itself", path.display(), target.display())]
    LinkOutside { path: PathBuf, target: PathBuf },
    #[error(transparent)]
    Editor(#[from] EditorError),
}

/// File name without its folder, which the user knows.
pub(crate) fn file_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}

impl EditError {
    pub(crate) fn refused(why: impl Into<String>) -> EditError {
        EditError::Refused { why: why.into(), line: None }
    }

    /// A refusal because of a line of the script.
    pub(crate) fn refused_at(place: &Place, why: &str) -> EditError {
        EditError::Refused {
            why: format!("{}:{}: {why}", file_name(&place.file), place.line),
            line: Some(place.line).filter(|line| *line > 0),
        }
    }

    /// Line of the script that caused the refusal, from 1.
    pub(crate) fn line(&self) -> Option<usize> {
        match self {
            EditError::SharedLine { line, .. } => Some(*line),
            EditError::Refused { line, .. } => *line,
            _ => None,
        }
    }
}
