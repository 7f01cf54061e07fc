//! `--watch`: after each run, waits until the content of a read file changes or a test file appears, and runs the affected sections. It
//! uses the same mechanism as hot reload ([`choreo_session::Watch`]).

use super::{TestJob, run_once};
use crate::args::TestArgs;
use crate::failure::{Failure, print, print_message};
use crate::terminal::counted;
use choreo_files::containing_folder;
use choreo_plugin::Registry;
use choreo_script::content_of;
use choreo_session::plugin_files::Listing;
use choreo_session::{Watch, WatchError, WatchEvent, WatchedPaths};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::time::SystemTime;

/// Extension of test files.
const TEST_FILE_ENDING: &str = ".rhai";

/// BLAKE3 hash of each file; `None` if the file does not exist.
type KnownContents = BTreeMap<PathBuf, Option<[u8; 32]>>;

pub(super) fn run(args: &TestArgs, job: &TestJob, plugins: &Registry) -> Result<(), Failure> {
    let failed = |e: WatchError| Failure::input(format!("--watch: {e}"));
    let mut watch = Watch::new().map_err(failed)?;
    let mut known = KnownContents::new();
    loop {
        // A file that is saved while the tests run differs from the content that they have read.
        known.iter_mut().for_each(|(path, content)| *content = content_of(path));
        let begun = SystemTime::now();
        let mut read: BTreeSet<PathBuf> = BTreeSet::new();
        // The next save may correct an error: only a closed pipe ends the loop.
        let ran = job.list_plugins(args, plugins).and_then(|Listing { registry, .. }| {
            let cases = job.select_cases(&registry)?;
            read.extend(cases.iter().filter_map(|c| c.path.canonicalize().ok()));
            run_once(args, job, &cases, &registry)
        });
        match ran {
            Ok(report) => read.extend(report.files),
            Err(Failure::ClosedPipe) => return Err(Failure::ClosedPipe),
            Err(failure) => failure.message_lines().iter().for_each(print_message),
        }
        for path in read {
            if let Entry::Vacant(unknown) = known.entry(path) {
                let is_new = unknown.key().metadata().and_then(|m| m.modified()).is_ok_and(|at| at >= begun);
                let content = if is_new { None } else { content_of(unknown.key()) };
                unknown.insert(content);
            }
        }
        let mut watched_paths = WatchedPaths { files: known.clone(), ..WatchedPaths::default() };
        for path in &job.paths {
            let folder = if path.is_dir() { path.as_path() } else { containing_folder(path) };
            let Ok(folder) = folder.canonicalize() else { continue };
            let all = (folder, TEST_FILE_ENDING.to_string());
            let set = if path.is_dir() { &mut watched_paths.trees } else { &mut watched_paths.folders };
            set.insert(all);
        }
        watch.set(watched_paths);
        for path in watch.existing_files() {
            // The file existed before, and belongs to no test of this run.
            if !known.contains_key(&path) {
                let content = content_of(&path);
                known.insert(path.clone(), content);
                watch.set_known_content(path, content);
            }
        }
        if watch.folder_count() == 0 {
            return Err(Failure::input("--watch: there is no folder to watch"));
        }
        let folders = counted(watch.folder_count() as u64, "folder");
        print(&format!("watching {folders}; Ctrl-C ends\n"))?;
        let changed = loop {
            if let WatchEvent::Changed(files) = watch.wait(None).map_err(failed)?
                && let Some(first) = files.into_iter().next()
            {
                break first;
            }
        };
        let here = std::env::current_dir().and_then(|d| d.canonicalize()).unwrap_or_default();
        let shown = changed.strip_prefix(&here).unwrap_or(&changed);
        print(&format!("\nchanged: {}\n", choreo_test_runner::collect::display_path(shown)))?;
    }
}
