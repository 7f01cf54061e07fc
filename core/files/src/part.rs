//! Files appear whole or not at all: each is written beside its place and renamed when it is complete.

use crate::leftovers::{Leftover, leftovers};
use crate::write_error::WriteError;
use crate::{Destination, Folder};
use std::fs::{File, TryLockError};
use std::io::{self, BufWriter, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Name of the part file: `o.png` → `o.png.part`.
pub fn part_name(name: &Path) -> PathBuf {
    let mut part = name.file_name().unwrap_or_default().to_os_string();
    part.push(".part");
    name.with_file_name(part)
}

/// Name of one machine's part file: `o.png` → `o.png.MACHINE.part`.
pub(crate) fn machine_part_name(name: &Path, machine: &str) -> PathBuf {
    let mut named = name.as_os_str().to_os_string();
    named.push(format!(".{machine}"));
    part_name(Path::new(&named))
}

/// An output file while it is written. Dropping it without [`PartFile::commit`] removes it.
#[derive(Debug)]
pub struct PartFile {
    file: File,
    /// `None` for a pipe or device, which is written directly.
    pending: Option<PendingFile>,
}

#[derive(Debug)]
struct PendingFile {
    folder: Arc<Folder>,
    part: PathBuf,
    name: PathBuf,
    number: u64,
}

impl PartFile {
    /// Creates `NAME.part` and locks it; a second writer gets [`WriteError::Busy`]. If the file system refuses locks, each writer
    /// gets a part file with a unique name, and the last to commit wins. The user chose `path`, see [`Destination::of`].
    pub fn create(path: &Path) -> Result<PartFile, WriteError> {
        PartFile::create_as(path, part_name)
    }

    /// Creates `NAME.MACHINE.part`, because locks may not reach from one machine to another. If several machines write at the
    /// same time, the last to commit wins.
    pub fn create_shared(path: &Path, machine: &str) -> Result<PartFile, WriteError> {
        PartFile::create_as(path, |name| machine_part_name(name, machine))
    }

    fn create_as(path: &Path, part: impl Fn(&Path) -> PathBuf) -> Result<PartFile, WriteError> {
        let (folder, name) = match Destination::of(path)? {
            Destination::File { folder, name } => (folder, name),
            Destination::Direct(file) => return Ok(PartFile { file, pending: None }),
        };
        let part = part(&name);
        match PartFile::create_locked(folder.clone(), part, name.clone())? {
            (part, Lock::Held) => Ok(part),
            (part, Lock::Refused) => {
                drop(part);
                PartFile::unlocked(Destination::File { folder, name })
            }
        }
    }

    /// Creates and locks a file under its final name, as a sign that a process holds it.
    pub fn claim(folder: Arc<Folder>, name: PathBuf) -> Result<PartFile, WriteError> {
        PartFile::create_locked(folder, name.clone(), name).map(|(part, _)| part)
    }

    fn create_locked(
        folder: Arc<Folder>,
        part: PathBuf,
        name: PathBuf,
    ) -> Result<(PartFile, Lock), WriteError> {
        let mut leftovers = leftovers();
        let (file, lock) = create_locked(&folder, &part)?;
        let number = leftovers.add(Leftover::File(folder.clone(), part.clone()));
        Ok((PartFile { file, pending: Some(PendingFile { folder, part, name, number }) }, lock))
    }

    /// Creates a part file with a unique name and without a lock: of several writers, the last to commit wins.
    fn unlocked(place: Destination) -> Result<PartFile, WriteError> {
        let (folder, name) = match place {
            Destination::File { folder, name } => (folder, name),
            Destination::Direct(file) => return Ok(PartFile { file, pending: None }),
        };
        let mut leftovers = leftovers();
        static COUNT: AtomicU64 = AtomicU64::new(0);
        // A name that is taken, by a killed process or on purpose, costs one number.
        for _ in 0..100 {
            let number = COUNT.fetch_add(1, Ordering::Relaxed);
            let process = std::process::id();
            let part = PathBuf::from(format!(".{}.{process}.{number}.part", name.to_string_lossy()));
            match folder.create_new(&part) {
                Err(crate::FileError::Link(_)) => {}
                Err(crate::FileError::Io(e)) if e.kind() == ErrorKind::AlreadyExists => {}
                Err(e) => return Err(WriteError::at(folder.path().join(part), e)),
                Ok(file) => {
                    let number = leftovers.add(Leftover::File(folder.clone(), part.clone()));
                    return Ok(PartFile { file, pending: Some(PendingFile { folder, part, name, number }) });
                }
            }
        }
        Err(io::Error::from(ErrorKind::AlreadyExists).into())
    }

    /// A buffered writer at the end of the file. Flush and drop it before [`PartFile::commit`].
    pub fn writer(&self) -> io::Result<BufWriter<File>> {
        Ok(BufWriter::with_capacity(1 << 16, self.file.try_clone()?))
    }

    /// Overwrites bytes at an offset from the start of the file. Flush every [`PartFile::writer`] first.
    ///
    /// # Errors
    /// Fails for a pipe or device, and for a range that reaches beyond the end of the file.
    pub fn replace(&self, at: u64, bytes: &[u8]) -> io::Result<()> {
        if self.pending.is_none() {
            return Err(ErrorKind::NotSeekable.into());
        }
        let mut file = &self.file;
        let end = file.seek(SeekFrom::End(0))?;
        if at.saturating_add(bytes.len() as u64) > end {
            return Err(ErrorKind::InvalidInput.into());
        }
        file.seek(SeekFrom::Start(at))?;
        file.write_all(bytes)?;
        file.seek(SeekFrom::Start(end)).map(|_| ())
    }

    /// Moves the finished file to its place.
    pub fn commit(mut self) -> Result<(), WriteError> {
        let Some(pending) = &self.pending else { return Ok(()) };
        let mut leftovers = leftovers();
        // After an error, `drop` removes the part file and takes this lock again.
        pending.folder.rename(&pending.part, &pending.folder, &pending.name)?;
        leftovers.forget(pending.number);
        self.pending = None;
        Ok(())
    }
}

impl Drop for PartFile {
    fn drop(&mut self) {
        if let Some(pending) = self.pending.take() {
            let mut leftovers = leftovers();
            let _ = pending.folder.remove_file(&pending.part);
            leftovers.forget(pending.number);
        }
    }
}

/// Writes a file whole or not at all, by a path that the user chose ([`Destination::of`]). An existing file's permissions are
/// kept. If there are several writers, the last one wins.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    write(Destination::of(path)?, bytes)
}

/// Like [`write_whole`], for a path beneath a folder that the user chose. Missing folders are created; symbolic links between
/// `folder` and the file are refused.
pub fn write_whole_beneath(folder: &Path, name: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    let (above, name) = (name.parent().unwrap_or(Path::new("")), name.file_name());
    if !folder.as_os_str().is_empty() {
        std::fs::create_dir_all(folder)?;
    }
    let folder = Folder::open(folder)?.create_folders(above)?;
    write(Destination::beneath(folder, name.ok_or(WriteError::IsFolder)?.as_ref())?, bytes)
}

fn write(place: Destination, bytes: &[u8]) -> Result<(), WriteError> {
    let part = PartFile::unlocked(place)?;
    let mut file = &part.file;
    file.write_all(bytes)?;
    if let Some(pending) = &part.pending {
        pending.folder.copy_permissions(&pending.name, file)?;
    }
    part.commit()
}

/// Creates a file and locks it for this process. A file that a killed process left is removed first: nothing is written into an
/// existing file.
pub(crate) fn create_locked(folder: &Folder, name: &Path) -> Result<(File, Lock), WriteError> {
    let at = || folder.path().join(name);
    loop {
        if folder.metadata(name).is_some() {
            let stale = match folder.open_existing(name) {
                // The owner has just ended and removed it.
                Err(e) if e.is_missing() => continue,
                stale => stale.map_err(|e| WriteError::at(at(), e))?,
            };
            lock(&stale)?;
            // The owner may have renamed or removed it between the opening and the lock.
            if folder.contains(name, &stale) {
                folder.remove_file(name)?;
            } else {
                continue;
            }
        }
        let file = match folder.create_new(name) {
            // Another process was faster and will soon hold the lock.
            Err(crate::FileError::Io(e)) if e.kind() == ErrorKind::AlreadyExists => continue,
            file => file.map_err(|e| WriteError::at(at(), e))?,
        };
        let locked = lock(&file)?;
        if folder.contains(name, &file) {
            return Ok((file, locked));
        }
    }
}

/// Whether the file system granted a lock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lock {
    Held,
    /// The file system has no locks, such as Lustre without `flock` or NFS without a lock manager.
    Refused,
}

/// Locks a file for this process.
pub(crate) fn lock(file: &File) -> Result<Lock, WriteError> {
    match file.try_lock() {
        Ok(()) => Ok(Lock::Held),
        Err(TryLockError::WouldBlock) => Err(WriteError::Busy),
        Err(TryLockError::Error(e)) if e.kind() == ErrorKind::Unsupported || is_without_locks(&e) => {
            Ok(Lock::Refused)
        }
        Err(TryLockError::Error(e)) => Err(e.into()),
    }
}

#[cfg(unix)]
fn is_without_locks(error: &io::Error) -> bool {
    error.raw_os_error() == Some(rustix::io::Errno::NOLCK.raw_os_error())
}

#[cfg(not(unix))]
fn is_without_locks(_: &io::Error) -> bool {
    false
}
