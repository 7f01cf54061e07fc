//! Files appear whole or not at all: each is written beside its place as `NAME.part`, a file or for videos a folder, and
//! renamed when complete. What is being written is locked, so that two renders cannot mix; the system gives the lock of a
//! dead process back. Parts are removed on errors and signals, unless they are kept to go on with.

use crate::failure::{Failure, output_error};
use std::collections::BTreeSet;
use std::fs::{File, TryLockError};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Part files and folders to remove when the program is ended. Locked while one is made, renamed or removed, and for ever by
/// `remove_parts`.
static PARTS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

pub fn parts() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    PARTS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What a part folder can hold: nothing else is ever removed from one.
pub const FOLDER_FILES: [&str; 4] = ["frames", "body", "result", "journal"];

/// Removes every part and keeps others from making or finishing more; the program ends next.
pub fn remove_parts() {
    let parts = parts();
    for part in parts.iter() {
        if std::fs::remove_file(part).is_err() {
            remove_folder(part);
        }
    }
    std::mem::forget(parts);
}

pub fn remove_folder(folder: &Path) {
    for name in FOLDER_FILES {
        let _ = std::fs::remove_file(folder.join(name));
    }
    let _ = std::fs::remove_dir(folder);
}

/// `o.png` → `o.png.part`.
pub fn part_of(place: &Path) -> PathBuf {
    let mut name = place.file_name().unwrap_or_default().to_os_string();
    name.push(".part");
    place.with_file_name(name)
}

/// Where a result can be put.
pub enum Place {
    /// Beside it and then renamed.
    File(PathBuf),
    /// No plain file is there, but a pipe or device: written as it comes.
    Direct(File),
}

/// Follows links, so that what a link names is replaced and not the link, and says what can be said before anything is made.
pub fn place(path: &Path) -> Result<Place, Failure> {
    let shown = path.display();
    let path = &target(path);
    match std::fs::metadata(path) {
        Ok(there) if there.is_dir() => Err(Failure::Output(format!("{shown}: cannot write: it is a folder"))),
        Ok(there) if !there.is_file() => {
            let file = File::options().write(true).open(path);
            file.map(Place::Direct).map_err(|e| output_error(&shown.to_string(), &e))
        }
        Ok(there) if there.permissions().readonly() => {
            Err(Failure::Output(format!("{shown}: cannot write: the file there is read-only")))
        }
        _ => Ok(Place::File(path.clone())),
    }
}

/// The end of a chain of links, which need not exist.
fn target(path: &Path) -> PathBuf {
    if let Ok(there) = std::fs::canonicalize(path) {
        return there;
    }
    let mut path = path.to_path_buf();
    // As many as Linux follows; a circle is an error when the file is made.
    for _ in 0..40 {
        let Ok(next) = std::fs::read_link(&path) else { break };
        path = path.parent().unwrap_or(Path::new("")).join(next);
    }
    path
}

/// Opens a file, making it where it is missing, for this process alone; `None` where another process has it.
pub fn lock(path: &Path) -> std::io::Result<Option<File>> {
    loop {
        let file = File::options().read(true).write(true).create(true).truncate(false).open(path)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Ok(None),
            // A file system without locks: as good as it gets.
            Err(TryLockError::Error(e)) if e.kind() == ErrorKind::Unsupported => {}
            Err(TryLockError::Error(e)) => return Err(e),
        }
        // Who had it may have renamed or removed it between the opening and the lock.
        if is_at(&file, path) {
            return Ok(Some(file));
        }
    }
}

/// Whether the open file is still the one of that name.
#[cfg(unix)]
pub fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (file.metadata(), std::fs::metadata(path)) {
        (Ok(a), Ok(b)) => (a.dev(), a.ino()) == (b.dev(), b.ino()),
        _ => false,
    }
}

/// An open file cannot be renamed or removed there.
#[cfg(not(unix))]
pub fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

pub fn busy(shown: &str) -> Failure {
    Failure::Output(format!(
        "{shown}: cannot write: another choreo is rendering to it; wait until it is done, or give -o another name"
    ))
}

/// One file on its way to its place.
#[derive(Debug)]
pub struct Part {
    /// Where it is written; `None` where the place is no plain file and is written directly.
    part: Option<PathBuf>,
    place: PathBuf,
    shown: String,
    file: File,
}

impl Part {
    pub fn create(path: &Path) -> Result<Part, Failure> {
        let shown = path.display().to_string();
        let place = match place(path)? {
            Place::File(place) => place,
            Place::Direct(file) => return Ok(Part { part: None, place: path.to_path_buf(), shown, file }),
        };
        let part = part_of(&place);
        let mut parts = parts();
        let failed = |e: std::io::Error| output_error(&shown, &e);
        let file = lock(&part).map_err(failed)?.ok_or_else(|| busy(&shown))?;
        parts.insert(part.clone());
        drop(parts);
        let part = Part { part: Some(part), place, shown: shown.clone(), file };
        // What a killed render left of it.
        part.file.set_len(0).map_err(failed)?;
        Ok(part)
    }

    pub fn writer(&self) -> Result<Box<dyn Write + Send>, Failure> {
        let file = self.file.try_clone().map_err(|e| output_error(&self.shown, &e))?;
        Ok(Box::new(BufWriter::with_capacity(1 << 16, file)))
    }

    /// Moves the finished file to its place.
    pub fn commit(mut self) -> Result<(), Failure> {
        let Some(part) = self.part.take() else { return Ok(()) };
        let mut parts = parts();
        let renamed = std::fs::rename(&part, &self.place);
        if renamed.is_err() {
            let _ = std::fs::remove_file(&part);
        }
        parts.remove(&part);
        renamed.map_err(|e| output_error(&self.shown, &e))
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        if let Some(part) = self.part.take() {
            let mut parts = parts();
            let _ = std::fs::remove_file(&part);
            parts.remove(&part);
        }
    }
}
