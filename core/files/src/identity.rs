//! Identity of a file, independent of the path to it: symbolic and hard links to one file have one identity.

use std::path::Path;

/// Device and inode number of a file; on systems without them, its canonical path.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg(unix)]
pub struct Identity(u64, u64);

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg(not(unix))]
pub struct Identity(std::path::PathBuf);

impl Identity {
    /// The identity of the file that a path leads to. `None` if there is none.
    #[cfg(unix)]
    pub fn of(path: &Path) -> Option<Identity> {
        use std::os::unix::fs::MetadataExt;
        std::fs::metadata(path).ok().map(|m| Identity(m.dev(), m.ino()))
    }

    #[cfg(not(unix))]
    pub fn of(path: &Path) -> Option<Identity> {
        path.canonicalize().ok().map(Identity)
    }
}
