//! Why an output was not written.

use crate::FileError;
use crate::error::{describe_error, shown};
use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// The reason alone: the caller's message begins with the output's name. A file or link that is in the way is named.
#[derive(Debug, Error)]
pub enum WriteError {
    #[error("{} is a symbolic link to {}; remove it", shown(at), shown(to))]
    Link { at: PathBuf, to: PathBuf },
    /// A hard link: writing to it would change the file under its other names, too.
    #[error("{} is a hard link to a file that has other names; remove it", shown(.0))]
    HardLink(PathBuf),
    #[error("{} is in the way; remove it", shown(.0))]
    InTheWay(PathBuf),
    #[error("it is a folder")]
    IsFolder,
    #[error("the file there is read-only")]
    ReadOnly,
    #[error("nobody reads from this pipe; start its reader first")]
    NoReader,
    /// Another process holds the lock of the part file.
    #[error("another program is writing it")]
    Busy,
    #[error("{}", describe_error(.0))]
    Io(#[from] io::Error),
}

impl WriteError {
    /// Converts the error of an attempt to open or create `at`.
    pub fn at(at: PathBuf, error: FileError) -> WriteError {
        match error {
            FileError::Link(to) => WriteError::Link { at, to },
            FileError::Io(e) => WriteError::Io(e),
            _ => WriteError::InTheWay(at),
        }
    }
}
