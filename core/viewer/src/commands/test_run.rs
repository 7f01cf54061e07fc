//! Runs test scripts, and keeps their last results.

use super::Commands;
use super::process::Process;
use super::queue::errors_text;
use super::test_report::Section;
use serde_json::Value;
use std::ffi::OsString;
use std::io;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

#[derive(Default)]
struct Results {
    sections: Vec<Section>,
    running: Option<Process>,
    /// Reason why there are no results.
    failure: Option<String>,
    /// Number of test runs finished so far.
    runs: u64,
}

/// Tests of a window. The display uses clones of the results.
#[derive(Default)]
pub struct TestRun(Arc<Mutex<Results>>);

/// The part of a test script to run.
#[derive(Clone, Debug, PartialEq)]
pub enum TestSelection {
    All,
    /// One section.
    Section(Section),
    /// Accepts the rendered image as the golden image with this name, in one section.
    Accept(Section, String),
}

fn lock_results(results: &Mutex<Results>) -> MutexGuard<'_, Results> {
    results.lock().unwrap_or_else(PoisonError::into_inner)
}

impl TestRun {
    pub fn sections(&self) -> Vec<Section> {
        lock_results(&self.0).sections.clone()
    }

    pub(crate) fn is_running(&self) -> bool {
        lock_results(&self.0).running.is_some()
    }

    pub fn failure(&self) -> Option<String> {
        lock_results(&self.0).failure.clone()
    }

    /// Number of results so far, which changes with each result.
    pub fn runs(&self) -> u64 {
        lock_results(&self.0).runs
    }

    pub fn stop(&self) {
        if let Some(process) = &lock_results(&self.0).running {
            process.interrupt();
        }
    }

    /// Starts tests of a script or folder, unless tests are running. `changed`: called when there are results.
    pub fn start(
        &self,
        commands: &Commands,
        path: &Path,
        choice: &TestSelection,
        changed: impl Fn() + Send + 'static,
    ) {
        let mut words: Vec<OsString> = vec![path.into(), "--json".into()];
        words.extend(commands.test_options.iter().cloned());
        if let TestSelection::Section(section) | TestSelection::Accept(section, _) = choice {
            words.extend(["--filter".into(), section.filter().into()]);
        }
        if let TestSelection::Accept(_, name) = choice {
            words.push(format!("--accept={name}").into());
        }
        let mut results = lock_results(&self.0);
        if results.running.is_some() {
            return;
        }
        let all = *choice == TestSelection::All;
        let started = Process::start(&commands.command_line("test", words)).and_then(|process| {
            let (shared, of_thread) = (self.0.clone(), process.clone());
            let thread = std::thread::Builder::new().name("tests".into());
            thread.spawn(move || {
                let ended = read_results(&of_thread);
                lock_results(&shared).store(ended, all);
                changed();
            })?;
            Ok(process)
        });
        match started {
            Ok(process) => results.running = Some(process),
            Err(error) => results.failure = Some(NoResults::NotStarted(error).to_string()),
        }
    }
}

impl Drop for TestRun {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Reason why a run has no results.
#[derive(Debug, thiserror::Error)]
enum NoResults {
    #[error("cannot be started: {0}")]
    NotStarted(io::Error),
    #[error(transparent)]
    Process(io::Error),
    #[error("stopped")]
    Stopped,
    /// Error message of the command.
    #[error("{0}")]
    Refused(String),
}

/// Waits for a run and parses its sections.
fn read_results(process: &Process) -> Result<Vec<Section>, NoResults> {
    let ended = process.wait_for_end(|_| false).map_err(NoResults::Process)?;
    if ended.interrupted {
        return Err(NoResults::Stopped);
    }
    let report: Value = serde_json::from_str(&ended.stdout)
        .map_err(|_| NoResults::Refused(ended.stderr.trim().to_string()))?;
    match report["sections"].is_array() {
        true => Ok(Section::of_report(&report)),
        false => Err(NoResults::Refused(errors_text(&report))),
    }
}

impl Results {
    /// Stores the results of a run. `all`: they replace all earlier ones; else each replaces that of the same section.
    fn store(&mut self, ended: Result<Vec<Section>, NoResults>, all: bool) {
        self.running = None;
        self.runs += 1;
        match ended {
            Err(why) => self.failure = Some(why.to_string()),
            Ok(sections) => {
                self.failure = None;
                if all {
                    self.sections = sections;
                    return;
                }
                for new in sections {
                    let same = |old: &&mut Section| old.file == new.file && old.name == new.name;
                    match self.sections.iter_mut().find(same) {
                        Some(old) => *old = new,
                        None => self.sections.push(new),
                    }
                }
            }
        }
    }
}
