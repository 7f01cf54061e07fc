//! Why a file was not opened.

use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The reason, without the file's name, which the caller's message starts with.
#[derive(Debug, Error)]
pub enum FileError {
    #[error("it is a symbolic link to {}", shown(.0))]
    Link(PathBuf),
    #[error("it leads out of the folder")]
    Outside,
    #[error("it is {0}, not a regular file")]
    NotRegular(&'static str),
    /// The limit in bytes.
    #[error("it has more than {0} bytes")]
    TooLarge(u64),
    #[error("{}", describe_error(.0))]
    Io(#[from] io::Error),
}

impl FileError {
    /// Whether the file does not exist.
    pub fn is_missing(&self) -> bool {
        matches!(self, FileError::Io(e) if e.kind() == io::ErrorKind::NotFound)
    }
}

/// Describes a system error in words, without its number ("os error 2").
pub fn describe_error(error: &io::Error) -> String {
    use io::ErrorKind as E;
    let text = match error.kind() {
        E::NotFound => "no such file or folder".to_string(),
        E::PermissionDenied => "permission denied".to_string(),
        E::StorageFull => "the disk is full".to_string(),
        E::QuotaExceeded => "the disk quota is used up".to_string(),
        E::ReadOnlyFilesystem => "the file system is read-only".to_string(),
        E::IsADirectory => "it is a folder".to_string(),
        E::NotADirectory => "a part of the path is a file, not a folder".to_string(),
        E::AlreadyExists => "it exists already".to_string(),
        E::InvalidFilename => "the name is too long or not allowed".to_string(),
        _ => error.to_string(),
    };
    text.split_once(" (os error").map_or(text.clone(), |(words, _)| words.to_string())
}

/// The path with control characters escaped: the target of a link may contain terminal escape sequences.
pub(crate) fn shown(path: &Path) -> String {
    let text = path.to_string_lossy();
    text.chars().map(|c| if c.is_control() { c.escape_default().to_string() } else { c.into() }).collect()
}
