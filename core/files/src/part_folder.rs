//! Part folders: `NAME.part` holds the unfinished files of one output, so that a later run can resume.

use crate::leftovers::{Leftover, leftovers};
use crate::part::{Lock, create_locked, lock, machine_part_name, part_name};
use crate::write_error::WriteError;
use crate::{FileError, Folder};
use std::fs::{File, TryLockError};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A locked part folder. Dropping it removes it with its files, unless [`PartFolder::keep`] was set.
#[derive(Debug)]
pub struct PartFolder {
    parent: Arc<Folder>,
    /// The output's name.
    name: PathBuf,
    part: PathBuf,
    folder: Arc<Folder>,
    files: &'static [&'static str],
    /// The last of `files`, open and locked.
    lock: File,
    /// Whether the file system granted the lock.
    locks: Lock,
    /// Whether each machine has its own part folder for the output.
    shared: bool,
    /// Number among the leftovers; `None` if the folder is to be kept.
    number: Option<u64>,
    /// The last field, so that it is dropped after the lock file is closed.
    empty_folder: EmptyFolderGuard,
}

/// A part folder whose files were removed; dropping this removes the folder itself. NFS and FUSE keep a removed file in it under
/// another name until the file is closed, so the lock file must be closed first.
#[derive(Debug, Default)]
struct EmptyFolderGuard(Option<(Arc<Folder>, PathBuf)>);

impl Drop for EmptyFolderGuard {
    fn drop(&mut self) {
        if let Some((parent, part)) = self.0.take() {
            let _ = parent.remove_subfolder(&part);
        }
    }
}

/// Most names that are read from a folder to find part folders of other machines.
const MAX_LISTED_NAMES: usize = 1_000_000;

impl PartFolder {
    /// Opens the part folder of the output `name`, or creates it. `files`: names of all files that it can hold, the lock file
    /// last; nothing else is ever removed from it.
    pub fn open(
        parent: Arc<Folder>,
        name: &Path,
        files: &'static [&'static str],
    ) -> Result<PartFolder, WriteError> {
        PartFolder::open_as(parent, name, part_name(name), files)
    }

    /// Opens or creates the folder `NAME.MACHINE.part` of an output that several machines may make at once. `machine`: a name
    /// that no other machine has. Locks only save duplicate work here, the result does not depend on them: each machine has its
    /// own folder, and so has each process if the file system refuses locks.
    ///
    /// # Errors
    /// [`WriteError::Busy`] if another process is seen making the output.
    pub fn open_shared(
        parent: Arc<Folder>,
        name: &Path,
        machine: &str,
        files: &'static [&'static str],
    ) -> Result<PartFolder, WriteError> {
        let own = |owner: &str| machine_part_name(name, owner);
        let mut opened = PartFolder::open_as(parent.clone(), name, own(machine), files)?;
        if opened.locks == Lock::Refused {
            let number = RandomState::new().build_hasher().finish() as u32;
            opened =
                PartFolder::open_as(parent.clone(), name, own(&format!("{machine}-{number:08x}")), files)?;
        }
        opened.shared = true;
        // The other folders are checked while this process holds its own lock: of two processes that begin at once, at least one
        // sees the other and gives way.
        if opened.other_parts().iter().any(|part| PartFolder::is_held(&parent, part, files)) {
            let kept = opened.lock.metadata()?.len() > 0;
            opened.keep(kept);
            return Err(WriteError::Busy);
        }
        Ok(opened)
    }

    fn open_as(
        parent: Arc<Folder>,
        name: &Path,
        part: PathBuf,
        files: &'static [&'static str],
    ) -> Result<PartFolder, WriteError> {
        let mut leftovers = leftovers();
        loop {
            let folder = parent.create_subfolder(&part);
            let folder = folder.map_err(|e| WriteError::at(parent.path().join(&part), e))?;
            // All names are checked before any file is written: a link that is found late costs the work done until then.
            for name in files {
                folder.refuse_link(Path::new(name))?;
            }
            let lock_name = lock_name(files);
            let opened = match folder.open_existing(lock_name) {
                Err(e) if e.is_missing() => create_locked(&folder, lock_name),
                Err(e) => return Err(WriteError::at(folder.path().join(lock_name), e)),
                Ok(file) => lock(&file).map(|locks| (file, locks)),
            };
            let (lock, locks) = match opened {
                // Another process has just ended and removed the folder.
                Err(WriteError::Io(e)) if e.kind() == ErrorKind::NotFound => continue,
                opened => opened?,
            };
            if !folder.contains(lock_name, &lock) {
                continue;
            }
            let folder = Arc::new(folder);
            let (name, empty_folder) = (name.to_path_buf(), EmptyFolderGuard::default());
            let mut opened = PartFolder {
                parent,
                name,
                part,
                folder,
                files,
                lock,
                locks,
                shared: false,
                number: None,
                empty_folder,
            };
            opened.number = Some(leftovers.add(opened.leftover()));
            return Ok(opened);
        }
    }

    /// Whether a process holds the lock of the part folder `part`. A process that opens the folder during this check gets
    /// [`WriteError::Busy`].
    pub fn is_held(parent: &Folder, part: &Path, files: &'static [&'static str]) -> bool {
        let lock = parent.subfolder(part).and_then(|folder| folder.open_existing(lock_name(files)));
        lock.is_ok_and(|lock| matches!(lock.try_lock_shared(), Err(TryLockError::WouldBlock)))
    }

    /// Names of the output's other part folders: those of other machines, or of other processes if locks are refused.
    fn other_parts(&self) -> Vec<PathBuf> {
        if !self.shared {
            return Vec::new();
        }
        let start = format!("{}.", self.name.to_string_lossy());
        let is_other = |part: &PathBuf| {
            let rest = part.to_str().and_then(|part| part.strip_prefix(&start));
            *part != self.part && rest.is_some_and(|rest| rest.ends_with(".part"))
        };
        let names = self.parent.names(MAX_LISTED_NAMES).unwrap_or_default();
        names.into_iter().map(PathBuf::from).filter(is_other).collect()
    }

    /// The output's other part folders, opened to read their finished files. Their processes have ended or cannot be seen from
    /// here.
    pub fn other_part_folders(&self) -> Vec<Folder> {
        self.other_parts().iter().filter_map(|part| self.parent.subfolder(part).ok()).collect()
    }

    /// Removes the output's other part folders once the output is in its place. A process that is making the output unseen
    /// notices the removal and finds the output.
    pub fn remove_other_part_folders(&self) {
        for part in self.other_parts() {
            drop(PartFolder::open_as(self.parent.clone(), &self.name, part, self.files));
        }
    }

    /// Path of the part folder, for messages.
    pub fn path(&self) -> PathBuf {
        self.parent.path().join(&self.part)
    }

    /// The lock file.
    pub fn lock_file(&self) -> &File {
        &self.lock
    }

    /// Replaces the lock file by an empty one of the same name.
    pub fn renew_lock(&mut self) -> Result<(), WriteError> {
        let name = lock_name(self.files);
        self.folder.remove_file(name)?;
        // The old lock is held until the new one is taken.
        (self.lock, self.locks) = create_locked(&self.folder, name)?;
        Ok(())
    }

    /// Creates one of the files and replaces an existing one. Refuses a symbolic link.
    pub fn create(&self, name: &str) -> Result<File, WriteError> {
        self.folder.refuse_link(Path::new(name))?;
        match self.folder.remove_file(Path::new(name)) {
            Err(e) if e.kind() != ErrorKind::NotFound => return Err(e.into()),
            _ => {}
        }
        let file = self.folder.create_new(Path::new(name));
        file.map_err(|e| WriteError::at(self.folder.path().join(name), e))
    }

    /// Opens one of the files to continue writing it. `None` if it does not exist. Refuses a symbolic link and a file with other
    /// hard links.
    pub fn reopen(&self, name: &str) -> Result<Option<File>, WriteError> {
        let file = match self.folder.open_existing(Path::new(name)) {
            Err(e) if e.is_missing() => return Ok(None),
            file => file.map_err(|e| WriteError::at(self.folder.path().join(name), e))?,
        };
        self.check_single_link(name, &file)?;
        Ok(Some(file))
    }

    /// Fails if the lock file has other hard links.
    pub fn check_lock(&self) -> Result<(), WriteError> {
        self.check_single_link(self.files.last().copied().unwrap_or_default(), &self.lock)
    }

    fn check_single_link(&self, name: &str, file: &File) -> Result<(), WriteError> {
        match Folder::hard_link_count(file)? {
            0 | 1 => Ok(()),
            _ => Err(WriteError::HardLink(self.folder.path().join(name))),
        }
    }

    /// Whether the folder is still at its path, with the lock file in it.
    pub fn is_in_place(&self) -> bool {
        let now =
            Folder::open(self.parent.path()).map_err(FileError::Io).and_then(|p| p.subfolder(&self.part));
        now.is_ok_and(|folder| folder.contains(lock_name(self.files), &self.lock))
    }

    /// Moves one of the files to the output's place; `drop` removes the rest.
    pub fn finish(&mut self, name: &str) -> io::Result<()> {
        let leftovers = leftovers();
        self.folder.rename(Path::new(name), &self.parent, &self.name)?;
        drop(leftovers);
        self.keep(false);
        Ok(())
    }

    /// Sets whether the folder stays when it is dropped, or when a signal ends the program.
    pub fn keep(&mut self, keep: bool) {
        let mut leftovers = leftovers();
        match self.number.take() {
            Some(number) if keep => leftovers.forget(number),
            None if !keep => self.number = Some(leftovers.add(self.leftover())),
            number => self.number = number,
        }
    }

    fn leftover(&self) -> Leftover {
        Leftover::Folder {
            parent: self.parent.clone(),
            name: self.part.clone(),
            folder: self.folder.clone(),
            files: self.files,
        }
    }
}

impl Drop for PartFolder {
    /// Removes the files before the lock is released.
    fn drop(&mut self) {
        let mut leftovers = leftovers();
        if let Some(number) = self.number.take() {
            self.leftover().remove();
            leftovers.forget(number);
            self.empty_folder = EmptyFolderGuard(Some((self.parent.clone(), self.part.clone())));
        }
    }
}

fn lock_name(files: &'static [&'static str]) -> &'static Path {
    Path::new(files.last().copied().unwrap_or_default())
}
