//! The folder `NAME.part` of an output that several files are made for, and that a later run can go on with.

use crate::leftovers::{Leftover, leftovers};
use crate::part::{Lock, lock, part_of, part_of_machine, take};
use crate::write_error::WriteError;
use crate::{FileError, Folder};
use std::fs::{File, TryLockError};
use std::hash::{BuildHasher, Hasher, RandomState};
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
    /// Whether the file system locks.
    locks: Lock,
    /// Whether machines have part folders of their own for the output.
    shared: bool,
    /// Its number among the leftovers, unless it is to be kept.
    number: Option<u64>,
    /// Dropped behind the lock.
    emptied: Emptied,
}

/// A folder whose files were removed. NFS and FUSE keep a removed file under another name in it until it is closed, so that the folder itself goes
/// last.
#[derive(Debug, Default)]
struct Emptied(Option<(Arc<Folder>, PathBuf)>);

impl Drop for Emptied {
    fn drop(&mut self) {
        if let Some((parent, part)) = self.0.take() {
            let _ = parent.remove_subfolder(&part);
        }
    }
}

/// Names read of a folder to find part folders of other machines.
const MOST_NAMES: usize = 1_000_000;

impl PartFolder {
    /// Opens the part folder of the output `name`, or makes it. `files`: all that it can hold; nothing else is ever removed from
    /// it. The last of them is the lock.
    pub fn open(
        parent: Arc<Folder>,
        name: &Path,
        files: &'static [&'static str],
    ) -> Result<PartFolder, WriteError> {
        PartFolder::open_as(parent, name, part_of(name), files)
    }

    /// Opens or makes the folder `NAME.MACHINE.part` of an output that several machines may make at once. `machine`: a name that no other
    /// machine has. Locks save work there and nothing depends on them: machines that they do not reach have folders of their own, and so has each
    /// process where the file system refuses them.
    ///
    /// # Errors
    /// [`WriteError::Busy`] while another process is seen to make the output.
    pub fn open_shared(
        parent: Arc<Folder>,
        name: &Path,
        machine: &str,
        files: &'static [&'static str],
    ) -> Result<PartFolder, WriteError> {
        let own = |owner: &str| part_of_machine(name, owner);
        let mut opened = PartFolder::open_as(parent.clone(), name, own(machine), files)?;
        if opened.locks == Lock::Refused {
            let number = RandomState::new().build_hasher().finish() as u32;
            opened =
                PartFolder::open_as(parent.clone(), name, own(&format!("{machine}-{number:08x}")), files)?;
        }
        opened.shared = true;
        // They are looked at while the own lock is held: of two that begin at once, one sees the other and gives way.
        if opened.others().iter().any(|part| PartFolder::is_held(&parent, part, files)) {
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
            // All of them before any is written: a link that is found late costs the work until then.
            for name in files {
                folder.no_link(Path::new(name))?;
            }
            let lock_name = lock_name(files);
            let opened = match folder.open_existing(lock_name) {
                Err(e) if e.is_missing() => take(&folder, lock_name),
                Err(e) => return Err(WriteError::at(folder.path().join(lock_name), e)),
                Ok(file) => lock(&file).map(|locks| (file, locks)),
            };
            let (lock, locks) = match opened {
                // Another process has just ended and taken the folder away.
                Err(WriteError::Io(e)) if e.kind() == ErrorKind::NotFound => continue,
                opened => opened?,
            };
            if !folder.contains(lock_name, &lock) {
                continue;
            }
            let folder = Arc::new(folder);
            let (name, emptied) = (name.to_path_buf(), Emptied::default());
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
                emptied,
            };
            opened.number = Some(leftovers.add(opened.leftover()));
            return Ok(opened);
        }
    }

    /// Whether a process is seen to hold the part folder of this name. A process that opens it at this very moment gets
    /// [`WriteError::Busy`].
    pub fn is_held(parent: &Folder, part: &Path, files: &'static [&'static str]) -> bool {
        let lock = parent.subfolder(part).and_then(|folder| folder.open_existing(lock_name(files)));
        lock.is_ok_and(|lock| matches!(lock.try_lock_shared(), Err(TryLockError::WouldBlock)))
    }

    /// Names of the part folders that other machines have for the output, or processes where locks are refused.
    fn others(&self) -> Vec<PathBuf> {
        if !self.shared {
            return Vec::new();
        }
        let start = format!("{}.", self.name.to_string_lossy());
        let is_other = |part: &PathBuf| {
            let rest = part.to_str().and_then(|part| part.strip_prefix(&start));
            *part != self.part && rest.is_some_and(|rest| rest.ends_with(".part"))
        };
        let names = self.parent.names(MOST_NAMES).unwrap_or_default();
        names.into_iter().map(PathBuf::from).filter(is_other).collect()
    }

    /// The part folders that others have for the output, to read what they finished. Their processes have ended, or cannot be seen.
    pub fn folders_of_others(&self) -> Vec<Folder> {
        self.others().iter().filter_map(|part| self.parent.subfolder(part).ok()).collect()
    }

    /// Removes the part folders of others once the output is in its place. A process that makes it there without being seen notices that, and finds the
    /// output.
    pub fn remove_others(&self) {
        for part in self.others() {
            drop(PartFolder::open_as(self.parent.clone(), &self.name, part, self.files));
        }
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
        (self.lock, self.locks) = take(&self.folder, name)?;
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
    /// The lock is given back after the files are gone.
    fn drop(&mut self) {
        let mut leftovers = leftovers();
        if let Some(number) = self.number.take() {
            self.leftover().remove();
            leftovers.forget(number);
            self.emptied = Emptied(Some((self.parent.clone(), self.part.clone())));
        }
    }
}

fn lock_name(files: &'static [&'static str]) -> &'static Path {
    Path::new(files.last().copied().unwrap_or_default())
}
