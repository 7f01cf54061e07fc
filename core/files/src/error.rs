//! Why a file was not opened.

use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// The reason, without the file's name, which the caller's message starts with.
#[derive(Debug, Error)]
pub enum FileError {
    #[error("it is a symbolic link to {}", .0.display())]
    Link(PathBuf),
    #[error("it leads out of the folder")]
    Outside,
    #[error("it is {0}, not a regular file")]
    NotRegular(&'static str),
    /// The limit in bytes.
    #[error("it has more than {0} bytes")]
    TooLarge(u64),
    #[error("{}", words(.0))]
    Io(#[from] io::Error),
}

impl FileError {
    /// Whether nothing is there under that name.
    pub fn is_missing(&self) -> bool {
        matches!(self, FileError::Io(e) if e.kind() == io::ErrorKind::NotFound)
    }
}

/// The system's words without "(os error 2)".
fn words(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => "no such file or folder".to_string(),
        io::ErrorKind::PermissionDenied => "permission denied".to_string(),
        io::ErrorKind::NotADirectory => "a part of the path is a file, not a folder".to_string(),
        io::ErrorKind::AlreadyExists => "it exists already".to_string(),
        _ => {
            let text = error.to_string();
            text.split_once(" (os error").map_or(text.clone(), |(words, _)| words.to_string())
        }
    }
}
