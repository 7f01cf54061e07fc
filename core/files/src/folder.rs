//! An open folder, and the files in it.

use crate::{FileError, WriteError};
use cap_fs_ext::{DirExt, FollowSymlinks, OpenOptionsFollowExt, OpenOptionsSyncExt};
use cap_std::ambient_authority;
use cap_std::fs::{Dir, OpenOptions};
use std::ffi::OsString;
use std::fs::{File, FileType};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// An open folder. It stays the same folder when its path is renamed or replaced.
#[derive(Debug)]
pub struct Folder {
    dir: Dir,
    path: PathBuf,
}

impl Folder {
    /// Opens a folder by a path that the user chose: links in it are followed. An empty path is the current folder.
    pub fn open(path: &Path) -> io::Result<Folder> {
        let here = if path.as_os_str().is_empty() { Path::new(".") } else { path };
        Ok(Folder { dir: Dir::open_ambient_dir(here, ambient_authority())?, path: path.to_path_buf() })
    }

    /// Path by which the folder was opened, for messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Opens a regular file beneath the folder for reading. Links are followed to places beneath the folder.
    pub fn open_file(&self, name: &Path) -> Result<File, FileError> {
        let mut options = OpenOptions::new();
        options.read(true).nonblock(true);
        require_regular(self.dir.open_with(name, &options).map_err(error_beneath)?.into_std())
    }

    /// Opens a folder beneath this one. Links are followed to places beneath the folder.
    pub fn folder(&self, name: &Path) -> Result<Folder, FileError> {
        let dir = self.dir.open_dir(name).map_err(error_beneath)?;
        Ok(Folder { dir, path: self.path.join(name) })
    }

    /// The path relative to the folder, with every link on the way followed to a place beneath the folder.
    pub fn resolve(&self, name: &Path) -> Result<PathBuf, FileError> {
        self.dir.canonicalize(name).map_err(error_beneath)
    }

    /// Sorted names of at most `most` entries of the folder.
    pub fn names(&self, most: usize) -> io::Result<Vec<OsString>> {
        let entries = self.dir.entries()?.take(most);
        let mut names = entries.map(|entry| Ok(entry?.file_name())).collect::<io::Result<Vec<_>>>()?;
        names.sort();
        Ok(names)
    }

    /// Reads a regular file beneath the folder, of at most `most` bytes.
    pub fn read(&self, name: &Path, most: u64) -> Result<Vec<u8>, FileError> {
        read_at_most(self.open_file(name)?, most)
    }

    /// Creates a file for reading and writing; fails if the name exists. `name` must be a single path component, as in all
    /// functions that write.
    pub fn create_new(&self, name: &Path) -> Result<File, FileError> {
        let mut options = OpenOptions::new();
        options.read(true).write(true).create_new(true).follow(FollowSymlinks::No);
        let file = self.dir.open_with(name, &options).map_err(|e| self.reason(name, e))?;
        Ok(file.into_std())
    }

    /// Opens an existing regular file for reading and writing. Refuses symbolic links.
    pub fn open_existing(&self, name: &Path) -> Result<File, FileError> {
        let mut options = OpenOptions::new();
        options.read(true).write(true).nonblock(true).follow(FollowSymlinks::No);
        let file = self.dir.open_with(name, &options).map_err(|e| self.reason(name, e))?;
        require_regular(file.into_std())
    }

    /// Opens an existing file, device or pipe for writing. Refuses symbolic links, and does not block while a pipe has no reader.
    pub(crate) fn open_for_writing(&self, name: &Path) -> Result<File, FileError> {
        let mut options = OpenOptions::new();
        options.write(true).nonblock(true).follow(FollowSymlinks::No);
        // The system's error is kept as it is: it identifies a pipe without a reader.
        Ok(self.dir.open_with(name, &options)?.into_std())
    }

    /// Opens a folder in this one. Refuses a symbolic link.
    pub(crate) fn subfolder(&self, name: &Path) -> Result<Folder, FileError> {
        let dir = self.dir.open_dir_nofollow(name).map_err(|e| self.reason(name, e))?;
        Ok(Folder { dir, path: self.path.join(name) })
    }

    /// Opens a folder in this one, and creates it if nothing has that name. Refuses a symbolic link.
    pub fn create_subfolder(&self, name: &Path) -> Result<Folder, FileError> {
        match self.dir.create_dir(name) {
            Err(e) if e.kind() != io::ErrorKind::AlreadyExists => Err(e.into()),
            _ => self.subfolder(name),
        }
    }

    /// Opens the folder at `path` beneath this one and creates missing folders. Refuses symbolic links on the way.
    pub fn create_folders(self, path: &Path) -> Result<Folder, WriteError> {
        path.components().try_fold(self, |folder, component| {
            let name = Path::new(component.as_os_str());
            folder.create_subfolder(name).map_err(|e| WriteError::at(folder.path.join(name), e))
        })
    }

    /// Number of hard links to the open file.
    pub(crate) fn hard_link_count(file: &File) -> io::Result<u64> {
        use cap_fs_ext::MetadataExt;
        Ok(cap_std::fs::File::from_std(file.try_clone()?).metadata()?.nlink())
    }

    /// Gives the open file `to` the permissions of the regular file `name`, if that exists.
    pub(crate) fn copy_permissions(&self, name: &Path, to: &File) -> io::Result<()> {
        let Some(there) = self.metadata(name).filter(|m| m.is_file()) else { return Ok(()) };
        cap_std::fs::File::from_std(to.try_clone()?).set_permissions(there.permissions())
    }

    /// Fails if `name` is a symbolic link.
    pub(crate) fn refuse_link(&self, name: &Path) -> Result<(), WriteError> {
        match self.metadata(name).is_some_and(|there| there.is_symlink()) {
            true => Err(WriteError::Link { at: self.path.join(name), to: self.link_target(name)? }),
            false => Ok(()),
        }
    }

    /// Target of the symbolic link `name`, as stored in the link.
    fn link_target(&self, name: &Path) -> io::Result<PathBuf> {
        self.dir.read_link_contents(name)
    }

    /// Whether `name` in this folder is, at this moment, the open file `file`.
    pub fn contains(&self, name: &Path, file: &File) -> bool {
        use cap_fs_ext::MetadataExt;
        let there = self.dir.symlink_metadata(name);
        let open = file.try_clone().and_then(|f| cap_std::fs::File::from_std(f).metadata());
        matches!((there, open), (Ok(a), Ok(b)) if (a.dev(), a.ino()) == (b.dev(), b.ino()))
    }

    /// Metadata of the file `name`, without following a link. `None` if it does not exist or cannot be inspected.
    pub fn metadata(&self, name: &Path) -> Option<cap_std::fs::Metadata> {
        self.dir.symlink_metadata(name).ok()
    }

    /// Moves the file `name` to `to_name` in the folder `to`. An existing file there is replaced; so is a link, which is not
    /// followed.
    pub fn rename(&self, name: &Path, to: &Folder, to_name: &Path) -> io::Result<()> {
        self.dir.rename(name, &to.dir, to_name)
    }

    /// Removes a file or a symbolic link, not the link's target.
    pub fn remove_file(&self, name: &Path) -> io::Result<()> {
        self.dir.remove_file(name)
    }

    /// Removes an empty folder.
    pub(crate) fn remove_subfolder(&self, name: &Path) -> io::Result<()> {
        self.dir.remove_dir(name)
    }

    /// The reason why `name` was not opened. Links, folders, pipes and devices are recognized, since the system's errors for them
    /// vary.
    fn reason(&self, name: &Path, error: io::Error) -> FileError {
        match self.dir.read_link_contents(name) {
            Ok(target) => FileError::Link(target),
            Err(_) => match self.metadata(name).map(|m| m.file_type()) {
                Some(kind) if kind.is_dir() => FileError::NotRegular("a folder"),
                // The system reports a pipe without a reader as "no such device".
                Some(kind) if !kind.is_file() => FileError::NotRegular("a pipe or device"),
                _ => FileError::Io(error),
            },
        }
    }
}

/// The folder that contains a file; `.` for a bare file name.
pub fn containing_folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Opens a regular file for reading by a path that the user chose: links in it are followed.
pub fn open_file(path: &Path) -> Result<File, FileError> {
    let mut options = OpenOptions::new();
    options.read(true).nonblock(true);
    require_regular(cap_std::fs::File::open_ambient_with(path, &options, ambient_authority())?.into_std())
}

/// Reads a regular file of at most `most` bytes by a path that the user chose.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
    read_at_most(open_file(path)?, most)
}

/// Error of opening a path beneath a folder. cap-std refuses a path that leads out of it with "permission denied", without a
/// system error number.
fn error_beneath(error: io::Error) -> FileError {
    match error.kind() == io::ErrorKind::PermissionDenied && error.raw_os_error().is_none() {
        true => FileError::Outside,
        false => FileError::Io(error),
    }
}

fn require_regular(file: File) -> Result<File, FileError> {
    let kind = file.metadata()?.file_type();
    if kind.is_file() { Ok(file) } else { Err(FileError::NotRegular(file_type_name(kind))) }
}

fn file_type_name(kind: FileType) -> &'static str {
    if kind.is_dir() { "a folder" } else { "a pipe or device" }
}

fn read_at_most(file: File, most: u64) -> Result<Vec<u8>, FileError> {
    let mut bytes = Vec::new();
    file.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most { Err(FileError::TooLarge(most)) } else { Ok(bytes) }
}
