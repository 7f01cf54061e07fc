//! Waiting for files to change.
//!
//! Folders are watched and not files: an editor that saves by renaming over a file would silence a watch on the file itself.
//! A folder that is not there is waited for in the nearest one above it that is. Contents are compared: a file written anew
//! with the same bytes has not changed.

use notify::event::{AccessKind, AccessMode, ModifyKind, RenameMode};
use notify::{Event, EventKind, RecommendedWatcher, RecursiveMode, Watcher};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};
use thiserror::Error;

/// After a file was closed or moved into its place it is whole: what else belongs to the same save comes within this time.
const WHOLE: Duration = Duration::from_millis(3);
/// After a file was opened, written or taken away: its writer goes on within this time.
const UNFINISHED: Duration = Duration::from_millis(60);
/// However busy the folder is, changes are reported after this time.
const LONGEST: Duration = Duration::from_secs(2);

/// The system has a limited number of watches for each user.
const MOST_FOLDERS: usize = 2000;

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
    /// Absolute paths, with the BLAKE3 of what was read there; `None` where nothing was.
    pub files: BTreeMap<PathBuf, Option<[u8; 32]>>,
    /// Any file directly in this folder whose name ends so.
    pub folders: BTreeSet<(PathBuf, String)>,
    /// Any file below this folder whose name ends so, in folders that come later, too. Hidden folders and those named `target` are
    /// passed over, links are not followed.
    pub trees: BTreeSet<(PathBuf, String)>,
}

#[derive(Clone, Debug, PartialEq)]
pub enum WatchEvent {
    /// These files are others than they were.
    Changed(BTreeSet<PathBuf>),
    /// A [`Waker`] woke it.
    Woken,
    TimedOut,
}

/// Ends a wait from another thread.
#[derive(Clone, Debug)]
pub struct Waker(Sender<Signal>);

impl Waker {
    pub fn wake(&self) {
        // A watch that has gone waits for nothing.
        let _ = self.0.send(Signal::Wake);
    }
}

#[derive(Debug)]
enum Signal {
    Event(Event),
    /// Files that were read before they were of interest.
    Look(BTreeSet<PathBuf>),
    /// Events were lost: everything is looked at again.
    Lost,
    Wake,
}

/// Filter of the system's events: changes of other names in watched folders are dropped at once, and wake nobody.
#[derive(Default)]
struct EventFilter {
    interest: WatchedPaths,
    /// Every folder that leads to something of interest.
    ways: BTreeSet<PathBuf>,
}

impl EventFilter {
    fn concerns(&self, event: &Event) -> bool {
        if matches!(event.kind, EventKind::Access(kind) if kind != AccessKind::Close(AccessMode::Write)) {
            return false;
        }
        let in_tree = |path: &Path| self.interest.trees.iter().any(|(root, _)| path.starts_with(root));
        event.paths.iter().any(|path| self.ways.contains(path) || self.interest.has(path) || in_tree(path))
    }
}

impl WatchedPaths {
    fn has(&self, path: &Path) -> bool {
        self.files.contains_key(path) || self.folders.iter().any(|folder| is_in(path, folder))
    }

    /// Every folder that leads to something of interest.
    fn ways(&self) -> BTreeSet<PathBuf> {
        let folders = self.files.keys().filter_map(|file| file.parent());
        let folders = folders.chain(self.folders.iter().map(|(folder, _)| folder.as_path()));
        let folders: BTreeSet<&Path> = folders.collect();
        folders.iter().flat_map(|folder| folder.ancestors()).map(Path::to_path_buf).collect()
    }
}

pub struct Watch {
    watcher: RecommendedWatcher,
    signals: Receiver<Signal>,
    to: Sender<Signal>,
    interest: WatchedPaths,
    watched: BTreeSet<PathBuf>,
    /// The filter, shared with the thread that receives the system's events.
    event_filter: Arc<Mutex<EventFilter>>,
    /// Touched when a wait ended, and not yet looked at.
    pending: Candidates,
}

impl Watch {
    pub fn new() -> Result<Watch, WatchError> {
        let (to, signals) = channel();
        let event_filter = Arc::new(Mutex::new(EventFilter::default()));
        let (events, hears) = (to.clone(), event_filter.clone());
        let watcher = notify::recommended_watcher(move |event: notify::Result<Event>| {
            let signal = match event {
                Ok(event) if event.need_rescan() => Signal::Lost,
                Ok(event) if !lock(&hears).concerns(&event) => return,
                Ok(event) => Signal::Event(event),
                Err(_) => Signal::Lost,
            };
            // After the watch has gone nobody listens.
            let _ = events.send(signal);
        })?;
        let (interest, pending) = (WatchedPaths::default(), Candidates::default());
        Ok(Watch { watcher, signals, to, interest, watched: BTreeSet::new(), event_filter, pending })
    }

    pub fn waker(&self) -> Waker {
        Waker(self.to.clone())
    }

    /// How many folders are watched.
    pub fn folders(&self) -> usize {
        self.watched.len()
    }

    /// Waits for these from now on. A new one that has changed since it was read is reported by the next
    /// [`Watch::wait`].
    pub fn set(&mut self, interest: WatchedPaths) {
        let before = std::mem::replace(&mut self.interest, interest);
        self.grow();
        let new = self.arrange();
        let fresh = self.interest.files.keys().filter(|file| !before.has(file));
        let fresh: BTreeSet<PathBuf> = fresh.cloned().collect();
        let signal = match new.is_empty() && self.interest.folders.is_subset(&before.folders) {
            true if fresh.is_empty() => return,
            true => Signal::Look(fresh),
            false => Signal::Lost,
        };
        let _ = self.to.send(signal);
    }

    /// The files in the folders and trees of interest.
    pub fn there(&self) -> BTreeSet<PathBuf> {
        self.in_folders()
    }

    /// Notes the content of a file: it has changed as soon as its content differs.
    pub fn knows(&mut self, path: PathBuf, content: Option<[u8; 32]>) {
        let mut event_filter = lock(&self.event_filter);
        event_filter.ways.extend(path.ancestors().skip(1).map(Path::to_path_buf));
        event_filter.interest.files.insert(path.clone(), content);
        self.interest.files.insert(path, content);
    }

    /// Waits until something of interest has changed, and whoever changed it is done. What is touched when the time is over is reported
    /// by the next wait.
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
                            let changed = self.changed(&candidates.take());
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
                    let all: BTreeSet<PathBuf> = self.all();
                    candidates.add(all, WHOLE);
                }
                Signal::Look(files) => candidates.add(files, WHOLE),
                Signal::Event(event) => {
                    let touched = self.touched(&event);
                    if !touched.is_empty() {
                        candidates.add(touched, quiet_after(event.kind));
                    }
                }
            }
        }
    }

    /// The folders that there are below the trees now.
    fn grow(&mut self) {
        for (root, ending) in self.interest.trees.clone() {
            let mut open = vec![root];
            while let Some(folder) = open.pop() {
                if self.interest.folders.len() >= MOST_FOLDERS {
                    return;
                }
                for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
                    if entry.file_type().is_ok_and(|t| t.is_dir()) && !is_passed_over(&entry.path()) {
                        open.push(entry.path());
                    }
                }
                self.interest.folders.insert((folder, ending.clone()));
            }
        }
    }

    /// The files of interest that an event may be about.
    fn touched(&mut self, event: &Event) -> BTreeSet<PathBuf> {
        let mut touched = BTreeSet::new();
        for path in &event.paths {
            if self.interest.has(path) {
                touched.insert(path.clone());
            }
            let in_tree = self.interest.trees.iter().any(|(root, _)| path.starts_with(root));
            if in_tree && !is_passed_over(path) && path.is_dir() {
                self.grow();
                self.arrange();
                // Files that came with the folder.
                touched.extend(self.in_folders().into_iter().filter(|file| file.starts_with(path)));
            }
            // A folder on the way to what is of interest has come, gone or been put in another's place.
            if lock(&self.event_filter).ways.contains(path) {
                let below = self.all().into_iter().filter(|f| f != path && f.starts_with(path));
                let below: Vec<PathBuf> = below.collect();
                let gone: Vec<PathBuf> =
                    self.watched.iter().filter(|w| w.starts_with(path)).cloned().collect();
                for folder in gone {
                    // The watch may have gone with the folder.
                    let _ = self.watcher.unwatch(&folder);
                    self.watched.remove(&folder);
                }
                self.arrange();
                touched.extend(below);
                touched.extend(self.in_folders());
            }
        }
        touched
    }

    /// Every path of interest that is known by name.
    fn all(&self) -> BTreeSet<PathBuf> {
        self.interest.files.keys().cloned().chain(self.in_folders()).collect()
    }

    /// The files in the folders of interest.
    fn in_folders(&self) -> BTreeSet<PathBuf> {
        let mut found = BTreeSet::new();
        for folder in &self.interest.folders {
            let entries = std::fs::read_dir(&folder.0).into_iter().flatten().flatten();
            found.extend(entries.map(|e| e.path()).filter(|path| is_in(path, folder)));
        }
        found
    }

    fn changed(&mut self, candidates: &BTreeSet<PathBuf>) -> BTreeSet<PathBuf> {
        let mut changed = BTreeSet::new();
        for path in candidates {
            let now = choreo_script::content_of(path);
            if self.interest.files.get(path).copied().flatten() != now {
                // Reported once.
                self.interest.files.insert(path.clone(), now);
                changed.insert(path.clone());
            }
        }
        changed
    }

    /// Watches the folders of what is of interest, and the folder above each, where it would be put in another's place. Gives
    /// those that were not watched before.
    fn arrange(&mut self) -> Vec<PathBuf> {
        let folders = self.interest.files.keys().filter_map(|f| f.parent());
        let folders = folders.chain(self.interest.folders.iter().map(|(folder, _)| folder.as_path()));
        // Before anything is watched, so that nothing is missed.
        *lock(&self.event_filter) =
            EventFilter { interest: self.interest.clone(), ways: self.interest.ways() };
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
            // One that has gone meanwhile, or may not be read, is no reason to end.
            if self.watched.len() < MOST_FOLDERS
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

/// The filter stays consistent even if a thread that held it failed.
fn lock(event_filter: &Mutex<EventFilter>) -> MutexGuard<'_, EventFilter> {
    event_filter.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

fn is_in(path: &Path, (folder, ending): &(PathBuf, String)) -> bool {
    let is_named = |name: &std::ffi::OsStr| {
        let name = name.to_string_lossy();
        name.ends_with(ending.as_str()) && !name.starts_with('.')
    };
    path.parent() == Some(folder) && path.file_name().is_some_and(is_named)
}

fn is_passed_over(folder: &Path) -> bool {
    folder.file_name().is_some_and(|name| name == "target" || name.to_string_lossy().starts_with('.'))
}

/// How long nothing more must come for the change to be whole.
fn quiet_after(kind: EventKind) -> Duration {
    match kind {
        EventKind::Access(_) => WHOLE,
        EventKind::Modify(ModifyKind::Name(RenameMode::To | RenameMode::Both)) => WHOLE,
        _ => UNFINISHED,
    }
}

/// Files that may have changed, and when to look.
#[derive(Default)]
struct Candidates {
    paths: BTreeSet<PathBuf>,
    first: Option<Instant>,
    look_at: Option<Instant>,
}

impl Candidates {
    fn add(&mut self, paths: BTreeSet<PathBuf>, quiet: Duration) {
        let now = Instant::now();
        self.paths.extend(paths);
        let first = *self.first.get_or_insert(now);
        self.look_at = Some((now + quiet).min(first + LONGEST));
    }

    fn due(&self) -> Option<Instant> {
        self.look_at
    }

    fn take(&mut self) -> BTreeSet<PathBuf> {
        std::mem::take(self).paths
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// A log in the folder above, which is watched as well: its lines must not be worked through one by one with a look at all files.
    #[test]
    fn of_much_that_happens_beside_nothing_is_passed_on() {
        let folder = tempfile::tempdir().unwrap();
        let above = folder.path().canonicalize().unwrap();
        let scene = above.join("scene");
        fs::create_dir(&scene).unwrap();
        let file = scene.join("a.wgsl");
        fs::write(&file, "0").unwrap();
        let mut watch = Watch::new().unwrap();
        let files = [(file.clone(), Some(*blake3::hash(b"0").as_bytes()))].into();
        watch.set(WatchedPaths { files, ..WatchedPaths::default() });
        // Two files are written in turns, because the system merges events of the same file.
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
        // A few signals are the watch's own, when it begins.
        assert!(passed_on <= 2, "{passed_on} signals of files that nobody waits for");
    }
}
