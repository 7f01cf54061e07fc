//! `--watch`: after each run, waits until a file that it read has changed, and runs what that touches.
//!
//! Folders are watched and not files: an editor that saves by renaming over a file would silence a watch on the file itself.

use super::{Job, once};
use crate::args::TestArgs;
use crate::failure::{Failure, print};
use choreo_plugin::Registry;
use notify::RecursiveMode;
use notify_debouncer_full::{DebounceEventResult, new_debouncer};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// Editors write a file in several steps; what comes within this time is one change.
const QUIET: Duration = Duration::from_millis(150);

/// The system has only so many watches for a user.
const MOST_FOLDERS: usize = 2000;

pub fn run(args: &TestArgs, job: &Job, plugins: &Registry) -> Result<(), Failure> {
    let (to, changes) = channel();
    let failed = |e: notify::Error| Failure::input(format!("--watch: cannot watch files: {e}"));
    let mut watcher = new_debouncer(QUIET, None, to).map_err(failed)?;
    let mut watched: BTreeSet<PathBuf> = BTreeSet::new();
    let own = Own::new(args);
    loop {
        let mut read: BTreeSet<PathBuf> = BTreeSet::new();
        // What is wrong now may be right after the next save: only a reader that has gone ends this.
        let ran = job.plugins(args, plugins).and_then(|registry| {
            let cases = job.cases(&registry)?;
            read.extend(cases.iter().filter_map(|c| c.path.canonicalize().ok()));
            once(args, job, &cases, &registry)
        });
        match ran {
            Ok(report) => read.extend(report.files),
            Err(Failure::ClosedPipe) => return Err(Failure::ClosedPipe),
            Err(failure) => failure.lines().iter().for_each(|line| eprintln!("{line}")),
        }
        for folder in folders(&job.paths, &read) {
            // A folder that has gone is no reason to end; its files' test says so.
            if !watched.contains(&folder) && watcher.watch(&folder, RecursiveMode::NonRecursive).is_ok() {
                watched.insert(folder);
            }
        }
        if watched.is_empty() {
            return Err(Failure::input("--watch: there is no folder to watch"));
        }
        print(&format!("watching {} folders; Ctrl-C ends\n", watched.len()))?;
        let changed = wait(&changes, &own)?;
        print(&format!("\nchanged: {}\n", choreo_suite::collect::shown(&changed)))?;
    }
}

/// Of all files read, and all below the paths given, so that new tests are seen.
fn folders(paths: &[PathBuf], read: &BTreeSet<PathBuf>) -> BTreeSet<PathBuf> {
    let mut folders: BTreeSet<PathBuf> =
        read.iter().filter_map(|f| f.parent()).map(Path::to_path_buf).collect();
    let mut open: Vec<PathBuf> = Vec::new();
    for path in paths {
        let folder = if path.is_dir() { path.as_path() } else { folder_of(path) };
        let Ok(folder) = folder.canonicalize() else { continue };
        match path.is_dir() {
            true => open.push(folder),
            false => drop(folders.insert(folder)),
        }
    }
    while let Some(folder) = open.pop() {
        if folders.len() >= MOST_FOLDERS {
            break;
        }
        for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
            let name = entry.file_name();
            let passed_over = name.to_string_lossy().starts_with('.') || name == "target";
            // Links are not followed: they can lead in a circle.
            if !passed_over && entry.file_type().is_ok_and(|t| t.is_dir()) {
                open.push(entry.path());
            }
        }
        folders.insert(folder);
    }
    folders
}

/// The first file that really changed. What we write ourselves and files being read do not count.
fn wait(changes: &Receiver<DebounceEventResult>, own: &Own) -> Result<PathBuf, Failure> {
    loop {
        let Ok(events) = changes.recv() else {
            return Err(Failure::input("--watch: the system no longer tells of changes"));
        };
        let path = events
            .into_iter()
            .flatten()
            .filter(|e| !e.kind.is_access())
            .flat_map(|e| e.event.paths)
            .find(|p| !own.is(p));
        if let Some(path) = path {
            let here = std::env::current_dir().and_then(|d| d.canonicalize()).unwrap_or_default();
            return Ok(path.strip_prefix(&here).map_or(path.clone(), Path::to_path_buf));
        }
    }
}

/// What this run writes: it would wait for itself.
struct Own {
    reports: Vec<PathBuf>,
    /// Standard output and error, which may have been redirected into a folder that is watched.
    streams: Vec<same::File>,
}

impl Own {
    fn new(args: &TestArgs) -> Own {
        let reports = [&args.junit, &args.html].into_iter().flatten();
        // They need not be there yet.
        let reports = reports.filter_map(|p| Some(folder_of(p).canonicalize().ok()?.join(p.file_name()?)));
        Own { reports: reports.collect(), streams: same::streams() }
    }

    fn is(&self, path: &Path) -> bool {
        path.extension().is_some_and(|e| e == "part")
            || path.components().any(|c| c.as_os_str() == "choreo-test")
            || self.reports.iter().any(|r| r == path)
            || same::of(path).is_some_and(|file| self.streams.contains(&file))
    }
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Tells a file whatever its name.
#[cfg(unix)]
mod same {
    use std::os::fd::AsFd;
    use std::os::unix::fs::MetadataExt;
    use std::path::Path;

    /// Device and number on it.
    pub type File = (u64, u64);

    pub fn of(path: &Path) -> Option<File> {
        std::fs::metadata(path).ok().map(|m| (m.dev(), m.ino()))
    }

    pub fn streams() -> Vec<File> {
        let (out, err) = (std::io::stdout(), std::io::stderr());
        let files = [out.as_fd().try_clone_to_owned(), err.as_fd().try_clone_to_owned()];
        let told = files.into_iter().flatten().filter_map(|f| std::fs::File::from(f).metadata().ok());
        told.filter(|m| m.is_file()).map(|m| (m.dev(), m.ino())).collect()
    }
}

#[cfg(not(unix))]
mod same {
    pub type File = ();

    pub fn of(_: &std::path::Path) -> Option<File> {
        None
    }

    pub fn streams() -> Vec<File> {
        Vec::new()
    }
}
