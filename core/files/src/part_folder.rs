//! The folder `NAME.part` of an output that several files are made for, and that a later run can go on with.

use crate::leftovers::{Leftover, leftovers};
use crate::part::{lock, part_of, take};
use crate::write_error::WriteError;
use crate::{FileError, Folder};
use std::fs::{File, TryLockError};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A locked part folder. Dropped, it is removed with its files unless it is to be kept.
#[derive(Debug)]
pub struct PartFolder {
    parent: Arc<Folder>,
    /// The output's name.
    name: PathBuf,
    part: PathBuf,
    folder: Arc<Folder>,
    files: &'static [&'static str],
    /// The last of the files, which is locked while it is open.
    lock: File,
    /// Its number among the leftovers, unless it is to be kept.
    number: Option<u64>,
}

impl PartFolder {
    /// Opens the part folder of the output `name`, or makes it. `files`: all that it can hold; nothing else is ever removed from
    /// it. The last of them is the lock.
    pub fn open(
        parent: Arc<Folder>,
        name: &Path,
        files: &'static [&'static str],
    ) -> Result<PartFolder, WriteError> {
        let part = part_of(name);
        let mut leftovers = leftovers();
        loop {
            let folder = parent.create_subfolder(&part);
            let folder = folder.map_err(|e| WriteError::at(parent.path().join(&part), e))?;
            // All of them before any is written: a link that is found late costs the work until then.
            for name in files {
                folder.no_link(Path::new(name))?;
            }
            let lock_name = lock_name(files);
            let opened = match folder.open_existing(lock_name) {
                Err(e) if e.is_missing() => take(&folder, lock_name),
                Err(e) => return Err(WriteError::at(folder.path().join(lock_name), e)),
                Ok(file) => lock(&file).map(|()| file),
            };
            let lock = match opened {
                // Another process has just ended and taken the folder away.
                Err(WriteError::Io(e)) if e.kind() == ErrorKind::NotFound => continue,
                opened => opened?,
            };
            if !folder.contains(lock_name, &lock) {
                continue;
            }
            let folder = Arc::new(folder);
            let mut opened =
                PartFolder { parent, name: name.to_path_buf(), part, folder, files, lock, number: None };
            opened.number = Some(leftovers.add(opened.leftover()));
            return Ok(opened);
        }
    }

    /// Whether a process holds the part folder of the output `name`; none seems to on a file system without locks. A process that
    /// opens it at this very moment gets [`WriteError::Busy`].
    pub fn is_held(parent: &Folder, name: &Path, files: &'static [&'static str]) -> bool {
        let lock = parent.subfolder(&part_of(name)).and_then(|folder| folder.open_existing(lock_name(files)));
        lock.is_ok_and(|lock| matches!(lock.try_lock_shared(), Err(TryLockError::WouldBlock)))
    }

    /// Name in messages.
    pub fn path(&self) -> PathBuf {
        self.parent.path().join(&self.part)
    }

    /// The locked file.
    pub fn lock_file(&self) -> &File {
        &self.lock
    }

    /// Replaces the locked file by an empty one of its name.
    pub fn renew_lock(&mut self) -> Result<(), WriteError> {
        let name = lock_name(self.files);
        self.folder.remove_file(name)?;
        // The old lock is held until the new one is.
        self.lock = take(&self.folder, name)?;
        Ok(())
    }

    /// Creates one of the files in place of one that has its name.
    pub fn create(&self, name: &str) -> Result<File, WriteError> {
        self.folder.no_link(Path::new(name))?;
        match self.folder.remove_file(Path::new(name)) {
            Err(e) if e.kind() != ErrorKind::NotFound => return Err(e.into()),
            _ => {}
        }
        let file = self.folder.create_new(Path::new(name));
        file.map_err(|e| WriteError::at(self.folder.path().join(name), e))
    }

    /// Opens one of the files to go on with it, where it is there: no link, and a file without another name.
    pub fn reopen(&self, name: &str) -> Result<Option<File>, WriteError> {
        let file = match self.folder.open_existing(Path::new(name)) {
            Err(e) if e.is_missing() => return Ok(None),
            file => file.map_err(|e| WriteError::at(self.folder.path().join(name), e))?,
        };
        self.only_name(name, &file)?;
        Ok(Some(file))
    }

    /// Refuses the locked file where it has another name.
    pub fn check_lock(&self) -> Result<(), WriteError> {
        self.only_name(self.files.last().copied().unwrap_or_default(), &self.lock)
    }

    fn only_name(&self, name: &str, file: &File) -> Result<(), WriteError> {
        match Folder::names_of(file)? {
            0 | 1 => Ok(()),
            _ => Err(WriteError::HardLink(self.folder.path().join(name))),
        }
    }

    /// Whether the folder still has its path and the locked file its name.
    pub fn is_there(&self) -> bool {
        let now =
            Folder::open(self.parent.path()).map_err(FileError::Io).and_then(|p| p.subfolder(&self.part));
        now.is_ok_and(|folder| folder.contains(lock_name(self.files), &self.lock))
    }

    /// Moves one of the files to the output's place. What is left is removed by `drop`.
    pub fn finish(&mut self, name: &str) -> io::Result<()> {
        let leftovers = leftovers();
        self.folder.rename(Path::new(name), &self.parent, &self.name)?;
        drop(leftovers);
        self.keep(false);
        Ok(())
    }

    /// Whether the folder stays where it is when it is dropped, or when a signal ends the program.
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
    /// The lock is given back after the folder is gone.
    fn drop(&mut self) {
        let mut leftovers = leftovers();
        if let Some(number) = self.number.take() {
            self.leftover().remove();
            leftovers.forget(number);
        }
    }
}

fn lock_name(files: &'static [&'static str]) -> &'static Path {
    Path::new(files.last().copied().unwrap_or_default())
}
