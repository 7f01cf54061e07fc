//! Unfinished files, which are removed when a signal ends the program.

use crate::Folder;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// An unfinished file in a folder, or an unfinished folder that holds files of the given names.
#[derive(Clone, Debug)]
pub(crate) enum Leftover {
    File(Arc<Folder>, PathBuf),
    Folder { parent: Arc<Folder>, name: PathBuf, folder: Arc<Folder>, files: &'static [&'static str] },
}

impl Leftover {
    /// Removes the file or folder through the open folders, because another folder may have the path by now.
    pub(crate) fn remove(&self) {
        match self {
            Leftover::File(folder, name) => drop(folder.remove_file(name)),
            Leftover::Folder { parent, name, folder, files } => {
                for file in *files {
                    let _ = folder.remove_file(Path::new(file));
                }
                let _ = parent.remove_subfolder(name);
            }
        }
    }
}

/// All unfinished files of this process. The lock is held while one is created, renamed or removed; [`remove_unfinished`] never
/// releases it.
#[derive(Debug, Default)]
pub(crate) struct Leftovers {
    next: u64,
    all: BTreeMap<u64, Leftover>,
}

static LEFTOVERS: Mutex<Leftovers> = Mutex::new(Leftovers { next: 0, all: BTreeMap::new() });

pub(crate) fn leftovers() -> MutexGuard<'static, Leftovers> {
    LEFTOVERS.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Leftovers {
    /// Registers an unfinished file or folder and returns its number.
    pub(crate) fn add(&mut self, leftover: Leftover) -> u64 {
        self.next += 1;
        self.all.insert(self.next, leftover);
        self.next
    }

    pub(crate) fn forget(&mut self, number: u64) {
        self.all.remove(&number);
    }
}

/// Removes every unfinished file, and blocks other threads that would create or finish one: the program must exit next.
pub fn remove_unfinished() {
    let leftovers = leftovers();
    leftovers.all.values().for_each(Leftover::remove);
    std::mem::forget(leftovers);
}
