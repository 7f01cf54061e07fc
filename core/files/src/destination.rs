//! The place of an output: a name in a folder, or a pipe or device of that name.

use crate::write_error::WriteError;
use crate::{Folder, pipe};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The place of an output, found before anything is written.
#[derive(Debug)]
pub enum Destination {
    /// A file of this name in this folder, which may exist already.
    File { folder: Arc<Folder>, name: PathBuf },
    /// A pipe or device, open for writing.
    Direct(File),
}

impl Destination {
    /// Inspects a path that the user chose. Links on the way to its folder are followed; a link as the last component is refused,
    /// except for those that the system itself keeps in `/dev` and `/proc` (`/dev/stdout`, `/proc/self/fd/3`).
    pub fn of(path: &Path) -> Result<Destination, WriteError> {
        let parent = path.parent().unwrap_or(Path::new(""));
        let name = path.file_name().ok_or(WriteError::IsFolder)?;
        if let Some(stream) = system_link(parent, name.as_ref()) {
            return stream.map(Destination::Direct);
        }
        Destination::beneath(Folder::open(parent)?, name.as_ref())
    }

    /// Like [`Destination::of`], for a name in an open folder. Links of the system are refused, too.
    pub fn beneath(folder: Folder, name: &Path) -> Result<Destination, WriteError> {
        folder.refuse_link(name)?;
        match folder.metadata(name) {
            Some(there) if there.is_dir() => Err(WriteError::IsFolder),
            Some(there) if !there.is_file() => pipe::open(&folder, name).map(Destination::Direct),
            Some(there) if there.permissions().readonly() => Err(WriteError::ReadOnly),
            _ => Ok(Destination::File { folder: Arc::new(folder), name: name.to_path_buf() }),
        }
    }
}

/// Opens the target of a link of the system; `None` if `name` is no such link. Only the system creates links in `/proc`; in
/// `/dev`, which has folders that all users may write to, only links owned by root count.
#[cfg(unix)]
fn system_link(parent: &Path, name: &Path) -> Option<Result<File, WriteError>> {
    use std::os::fd::AsFd;
    use std::os::unix::fs::MetadataExt;
    let parent = parent.canonicalize().ok().filter(|p| p.starts_with("/proc") || p.starts_with("/dev"))?;
    let link = std::fs::symlink_metadata(parent.join(name)).ok().filter(|m| m.is_symlink())?;
    if !parent.starts_with("/proc") && link.uid() != 0 {
        return None;
    }
    // The program's own streams are shared, not opened again: a second open file would have its own write position.
    let wanted = std::fs::metadata(parent.join(name)).ok()?;
    for stream in [std::io::stdout().as_fd(), std::io::stderr().as_fd()] {
        let Ok(stream) = stream.try_clone_to_owned().map(File::from) else { continue };
        if stream.metadata().is_ok_and(|m| (m.dev(), m.ino()) == (wanted.dev(), wanted.ino())) {
            return Some(Ok(stream));
        }
    }
    Some(pipe::open_through(&parent.join(name)))
}

#[cfg(not(unix))]
fn system_link(_: &Path, _: &Path) -> Option<Result<File, WriteError>> {
    None
}
