//! Waiting for files to change.
//!
//! The watch is on folders and not on files, because an editor that saves by renaming over a file would silence a watch on the file itself. For a
//! folder that does not exist, the nearest existing ancestor is watched. Contents are compared: a file rewritten with the same bytes has not
//! changed.

use notify::event::{AccessKind, AccessMode, ModifyKind, RenameMode};
use notify::{Event, EventKind, RecommendedWatcher, RecursiveMode, Watcher};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Quiet time after a file was closed or moved into place: it is complete, and other files of the same save follow within this time.
const QUIET_AFTER_COMPLETE: Duration = Duration::from_millis(3);
/// Quiet time after a file was opened, written or removed: its writer continues within this time.
const QUIET_AFTER_UNFINISHED: Duration = Duration::from_millis(60);
/// Changes are reported after this time even if events keep coming.
const MAX_DELAY: Duration = Duration::from_secs(2);

/// Limit of watched folders, since the system limits the watches of each user.
const MAX_FOLDERS: usize = 2000;

#[derive(Debug, Error)]
pub enum WatchError {
    #[error("cannot watch files: {0}")]
    System(#[from] notify::Error),
    #[error("the system no longer reports changes")]
    Gone,
}

/// Files and folders whose changes end a wait.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WatchedPaths {
    /// Absolute paths, with the BLAKE3 hash of the content that was read; `None` if the file could not be read.
    pub files: BTreeMap<PathBuf, Option<[u8; 32]>>,
    /// Files directly in a folder whose names have this ending.
    pub folders: BTreeSet<(PathBuf, String)>,
    /// Files anywhere below a folder whose names have this ending, also in folders that are created later. Hidden folders and folders named
    /// `target` are skipped, and symbolic links are not followed.
    pub trees: BTreeSet<(PathBuf, String)>,
}

#[derive(Clone, Debug, PartialEq)]
pub enum WatchEvent {
    /// Files whose content differs from the known one.
    Changed(BTreeSet<PathBuf>),
    /// A [`Waker`] ended the wait.
    Woken,
    TimedOut,
}

/// Ends a wait from another thread.
#[derive(Clone, Debug)]
pub struct Waker(Sender<Signal>);

impl Waker {
    pub fn wake(&self) {
        // Sending fails only if the watch no longer exists.
        let _ = self.0.send(Signal::Wake);
    }
}

#[derive(Debug)]
enum Signal {
    Event(Event),
    /// Files that were read before they were watched.
    Compare(BTreeSet<PathBuf>),
    /// Events were lost, so all files are compared again.
    Lost,
    Wake,
}

/// Filter of the system's events: changes of other files in watched folders are dropped at once and wake no thread.
#[derive(Default)]
struct EventFilter {
    interest: WatchedPaths,
    /// All ancestor folders of watched files and folders.
    ancestor_folders: BTreeSet<PathBuf>,
}

impl EventFilter {
    fn concerns(&self, event: &Event) -> bool {
        if matches!(event.kind, EventKind::Access(kind) if kind != AccessKind::Close(AccessMode::Write)) {
            return false;
        }
        let in_tree = |path: &Path| self.interest.trees.iter().any(|(root, _)| path.starts_with(root));
        event.paths.iter().any(|path| {
            self.ancestor_folders.contains(path) || self.interest.contains_file(path) || in_tree(path)
        })
    }
}

impl WatchedPaths {
    fn contains_file(&self, path: &Path) -> bool {
        self.files.contains_key(path) || self.folders.iter().any(|folder| is_file_of_folder(path, folder))
    }

    /// All ancestor folders of watched files and folders.
    fn ancestor_folders(&self) -> BTreeSet<PathBuf> {
        let folders = self.files.keys().filter_map(|file| file.parent());
        let folders = folders.chain(self.folders.iter().map(|(folder, _)| folder.as_path()));
        let folders: BTreeSet<&Path> = folders.collect();
        folders.iter().flat_map(|folder| folder.ancestors()).map(Path::to_path_buf).collect()
    }
}

pub struct Watch {
    watcher: RecommendedWatcher,
    signals: Receiver<Signal>,
    sender: Sender<Signal>,
    interest: WatchedPaths,
    watched: BTreeSet<PathBuf>,
    /// The filter, shared with the thread that receives the system's events.
    event_filter: Arc<Mutex<EventFilter>>,
    /// Files that were touched before the last wait ended, and not compared yet.
    pending: Candidates,
}

impl Watch {
    pub fn new() -> Result<Watch, WatchError> {
        let (sender, signals) = channel();
        let event_filter = Arc::new(Mutex::new(EventFilter::default()));
        let (events, filter) = (sender.clone(), event_filter.clone());
        let watcher = notify::recommended_watcher(move |event: notify::Result<Event>| {
            let signal = match event {
                Ok(event) if event.need_rescan() => Signal::Lost,
                Ok(event) if !lock(&filter).concerns(&event) => return,
                Ok(event) => Signal::Event(event),
                Err(_) => Signal::Lost,
            };
            // Sending fails only if the watch no longer exists.
            let _ = events.send(signal);
        })?;
        let (interest, pending) = (WatchedPaths::default(), Candidates::default());
        Ok(Watch { watcher, signals, sender, interest, watched: BTreeSet::new(), event_filter, pending })
    }

    pub fn waker(&self) -> Waker {
        Waker(self.sender.clone())
    }

    /// How many folders are watched.
    pub fn folder_count(&self) -> usize {
        self.watched.len()
    }

    /// Replaces the watched paths. A new one that has changed since it was read is reported by the next [`Watch::wait`].
    pub fn set(&mut self, interest: WatchedPaths) {
        let before = std::mem::replace(&mut self.interest, interest);
        self.add_tree_folders();
        let new = self.update_watches();
        let fresh = self.interest.files.keys().filter(|file| !before.contains_file(file));
        let fresh: BTreeSet<PathBuf> = fresh.cloned().collect();
        let signal = match new.is_empty() && self.interest.folders.is_subset(&before.folders) {
            true if fresh.is_empty() => return,
            true => Signal::Compare(fresh),
            false => Signal::Lost,
        };
        let _ = self.sender.send(signal);
    }

    /// Existing files in the watched folders and trees.
    pub fn existing_files(&self) -> BTreeSet<PathBuf> {
        self.existing_files_in_folders()
    }

    /// Sets the known content of a file; another content counts as a change.
    pub fn set_known_content(&mut self, path: PathBuf, content: Option<[u8; 32]>) {
        let mut event_filter = lock(&self.event_filter);
        event_filter.ancestor_folders.extend(path.ancestors().skip(1).map(Path::to_path_buf));
        event_filter.interest.files.insert(path.clone(), content);
        self.interest.files.insert(path, content);
    }

    /// Waits until a watched file has changed and its writer has finished, at most for `timeout`. Files touched but not compared before the timeout
    /// are reported by the next wait.
    pub fn wait(&mut self, timeout: Option<Duration>) -> Result<WatchEvent, WatchError> {
        let until = timeout.map(|timeout| Instant::now() + timeout);
        let mut candidates = std::mem::take(&mut self.pending);
        loop {
            let deadline = [until, candidates.due()].into_iter().flatten().min();
            let signal = match deadline {
                None => self.signals.recv().map_err(|_| WatchError::Gone)?,
                Some(at) => match self.signals.recv_timeout(at.saturating_duration_since(Instant::now())) {
                    Ok(signal) => signal,
                    Err(RecvTimeoutError::Disconnected) => return Err(WatchError::Gone),
                    Err(RecvTimeoutError::Timeout) => {
                        if candidates.due().is_some_and(|due| due <= Instant::now()) {
                            let changed = self.take_changed(&candidates.take_paths());
                            if !changed.is_empty() {
                                return Ok(WatchEvent::Changed(changed));
                            }
                        }
                        if until.is_some_and(|until| until <= Instant::now()) {
                            self.pending = candidates;
                            return Ok(WatchEvent::TimedOut);
                        }
                        continue;
                    }
                },
            };
            match signal {
                Signal::Wake => {
                    self.pending = candidates;
                    return Ok(WatchEvent::Woken);
                }
                Signal::Lost => {
                    let all: BTreeSet<PathBuf> = self.watched_files();
                    candidates.add(all, QUIET_AFTER_COMPLETE);
                }
                Signal::Compare(files) => candidates.add(files, QUIET_AFTER_COMPLETE),
                Signal::Event(event) => {
                    let touched = self.watched_files_of(&event);
                    if !touched.is_empty() {
                        candidates.add(touched, quiet_after(event.kind));
                    }
                }
            }
        }
    }

    /// Adds the folders that now exist below the trees.
    fn add_tree_folders(&mut self) {
        for (root, ending) in self.interest.trees.clone() {
            let mut open = vec![root];
            while let Some(folder) = open.pop() {
                if self.interest.folders.len() >= MAX_FOLDERS {
                    return;
                }
                for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
                    if entry.file_type().is_ok_and(|t| t.is_dir()) && !is_skipped(&entry.path()) {
                        open.push(entry.path());
                    }
                }
                self.interest.folders.insert((folder, ending.clone()));
            }
        }
    }

    /// Watched files that an event may concern.
    fn watched_files_of(&mut self, event: &Event) -> BTreeSet<PathBuf> {
        let mut touched = BTreeSet::new();
        for path in &event.paths {
            if self.interest.contains_file(path) {
                touched.insert(path.clone());
            }
            let in_tree = self.interest.trees.iter().any(|(root, _)| path.starts_with(root));
            if in_tree && !is_skipped(path) && path.is_dir() {
                self.add_tree_folders();
                self.update_watches();
                // The new folder may already contain files.
                touched.extend(
                    self.existing_files_in_folders().into_iter().filter(|file| file.starts_with(path)),
                );
            }
            // An ancestor folder was created, removed or replaced.
            if lock(&self.event_filter).ancestor_folders.contains(path) {
                let below = self.watched_files().into_iter().filter(|f| f != path && f.starts_with(path));
                let below: Vec<PathBuf> = below.collect();
                let gone: Vec<PathBuf> =
                    self.watched.iter().filter(|w| w.starts_with(path)).cloned().collect();
                for folder in gone {
                    // The system may have removed the watch together with the folder.
                    let _ = self.watcher.unwatch(&folder);
                    self.watched.remove(&folder);
                }
                self.update_watches();
                touched.extend(below);
                touched.extend(self.existing_files_in_folders());
            }
        }
        touched
    }

    /// All watched files, including those found in watched folders.
    fn watched_files(&self) -> BTreeSet<PathBuf> {
        self.interest.files.keys().cloned().chain(self.existing_files_in_folders()).collect()
    }

    /// Existing files in the watched folders.
    fn existing_files_in_folders(&self) -> BTreeSet<PathBuf> {
        let mut found = BTreeSet::new();
        for folder in &self.interest.folders {
            let entries = std::fs::read_dir(&folder.0).into_iter().flatten().flatten();
            found.extend(entries.map(|e| e.path()).filter(|path| is_file_of_folder(path, folder)));
        }
        found
    }

    fn take_changed(&mut self, candidates: &BTreeSet<PathBuf>) -> BTreeSet<PathBuf> {
        let mut changed = BTreeSet::new();
        for path in candidates {
            let now = choreo_script::content_of(path);
            if self.interest.files.get(path).copied().flatten() != now {
                // Each change is reported once.
                self.interest.files.insert(path.clone(), now);
                changed.insert(path.clone());
            }
        }
        changed
    }

    /// Watches the folder of each watched path and that folder's parent, where it could be replaced. Returns the folders that were not watched
    /// before.
    fn update_watches(&mut self) -> Vec<PathBuf> {
        let folders = self.interest.files.keys().filter_map(|f| f.parent());
        let folders = folders.chain(self.interest.folders.iter().map(|(folder, _)| folder.as_path()));
        // The filter is set first, so that no event is missed.
        *lock(&self.event_filter) = EventFilter {
            interest: self.interest.clone(),
            ancestor_folders: self.interest.ancestor_folders(),
        };
        let mut wanted = BTreeSet::new();
        for folder in folders {
            let Some(there) = folder.ancestors().find(|f| f.is_dir()) else { continue };
            wanted.insert(there.to_path_buf());
            wanted.extend(there.parent().map(Path::to_path_buf));
        }
        for gone in self.watched.difference(&wanted).cloned().collect::<Vec<_>>() {
            let _ = self.watcher.unwatch(&gone);
            self.watched.remove(&gone);
        }
        let mut new = Vec::new();
        for folder in wanted {
            // A folder that was removed meanwhile or cannot be read is skipped.
            if self.watched.len() < MAX_FOLDERS
                && !self.watched.contains(&folder)
                && self.watcher.watch(&folder, RecursiveMode::NonRecursive).is_ok()
            {
                self.watched.insert(folder.clone());
                new.push(folder);
            }
        }
        new
    }
}

/// Locks the filter, which stays consistent even if another thread panicked while holding it.
fn lock(event_filter: &Mutex<EventFilter>) -> MutexGuard<'_, EventFilter> {
    event_filter.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

fn is_file_of_folder(path: &Path, (folder, ending): &(PathBuf, String)) -> bool {
    let is_named = |name: &std::ffi::OsStr| {
        let name = name.to_string_lossy();
        name.ends_with(ending.as_str()) && !name.starts_with('.')
    };
    path.parent() == Some(folder) && path.file_name().is_some_and(is_named)
}

fn is_skipped(folder: &Path) -> bool {
    folder.file_name().is_some_and(|name| name == "target" || name.to_string_lossy().starts_with('.'))
}

/// Quiet time after an event until the change counts as complete.
fn quiet_after(kind: EventKind) -> Duration {
    match kind {
        EventKind::Access(_) => QUIET_AFTER_COMPLETE,
        EventKind::Modify(ModifyKind::Name(RenameMode::To | RenameMode::Both)) => QUIET_AFTER_COMPLETE,
        _ => QUIET_AFTER_UNFINISHED,
    }
}

/// Files that may have changed, and the time to compare them.
#[derive(Default)]
struct Candidates {
    paths: BTreeSet<PathBuf>,
    first: Option<Instant>,
    due_at: Option<Instant>,
}

impl Candidates {
    fn add(&mut self, paths: BTreeSet<PathBuf>, quiet: Duration) {
        let now = Instant::now();
        self.paths.extend(paths);
        let first = *self.first.get_or_insert(now);
        self.due_at = Some((now + quiet).min(first + MAX_DELAY));
    }

    fn due(&self) -> Option<Instant> {
        self.due_at
    }

    fn take_paths(&mut self) -> BTreeSet<PathBuf> {
        std::mem::take(self).paths
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// A log file in the parent folder, which is watched, too: its lines must not each cause a comparison of all files.
    #[test]
    fn events_of_unwatched_files_wake_no_thread() {
        let folder = tempfile::tempdir().unwrap();
        let above = folder.path().canonicalize().unwrap();
        let scene = above.join("scene");
        fs::create_dir(&scene).unwrap();
        let file = scene.join("a.wgsl");
        fs::write(&file, "0").unwrap();
        let mut watch = Watch::new().unwrap();
        let files = [(file.clone(), Some(*blake3::hash(b"0").as_bytes()))].into();
        watch.set(WatchedPaths { files, ..WatchedPaths::default() });
        // Two files are written alternately, because the system merges consecutive events of one file.
        for n in 0..1500 {
            for log in ["one.log", "two.log"] {
                fs::write(above.join(log), n.to_string()).unwrap();
            }
        }
        fs::write(&file, "1").unwrap();
        let of_file = |signal: &Signal| matches!(signal, Signal::Event(event) if event.paths.contains(&file));
        let mut passed_on = 0;
        while !of_file(&watch.signals.recv_timeout(Duration::from_secs(300)).unwrap()) {
            passed_on += 1;
        }
        // The watch itself causes a few signals when it starts.
        assert!(passed_on <= 2, "{passed_on} signals of files that are not watched");
    }
}
