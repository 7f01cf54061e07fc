//! Queue of renders and exports, which run one after the other.

use super::Commands;
use super::process::Process;
use serde_json::Value;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum JobState {
    Waiting,
    /// Number of finished frames, and of all frames; both are 0 while files are read.
    Running {
        done: u64,
        frames: u64,
    },
    Finished(String),
    Failed(String),
    Canceled,
}

#[derive(Clone, Debug)]
pub struct Job {
    pub number: u64,
    /// `render` or `export`.
    pub command: &'static str,
    pub output: PathBuf,
    /// Range, size and quality, for display.
    pub about: String,
    words: Vec<OsString>,
    pub state: JobState,
}

impl Job {
    /// Whether the job is not finished and writes to `output`, a file or numbered images.
    pub fn is_unfinished_writer_of(&self, output: &Path) -> bool {
        let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
        matches!(self.state, JobState::Waiting | JobState::Running { .. })
            && absolute(&self.output) == absolute(output)
    }
}

/// A render or export to be added to the queue.
#[derive(Clone, Debug)]
pub struct Request {
    /// `render` or `export`.
    pub command: &'static str,
    pub output: PathBuf,
    pub about: String,
    /// Arguments after the scene.
    pub options: Vec<OsString>,
}

#[derive(Default)]
struct Jobs {
    all: Vec<Job>,
    last_number: u64,
    running: Option<(u64, Process)>,
    /// Whether a worker thread is running.
    has_worker: bool,
    /// Whether the window was closed, so that no job is started.
    is_closed: bool,
}

/// The queue. The display uses clones of the list, while jobs continue.
#[derive(Default)]
pub struct RenderQueue(Arc<Mutex<Jobs>>);

fn lock_jobs(jobs: &Mutex<Jobs>) -> MutexGuard<'_, Jobs> {
    jobs.lock().unwrap_or_else(PoisonError::into_inner)
}

impl RenderQueue {
    pub fn jobs(&self) -> Vec<Job> {
        lock_jobs(&self.0).all.clone()
    }

    /// Adds a job. `changed`: called whenever the list changes.
    pub fn add(&self, commands: &Commands, request: Request, changed: impl Fn() + Send + 'static) {
        let scene =
            [commands.input.clone().into_os_string()].into_iter().chain(commands.scene_options.clone());
        let output = ["-o".into(), request.output.clone().into_os_string(), "--json".into()];
        let words = commands.command_line(request.command, scene.chain(output).chain(request.options));
        let mut jobs = lock_jobs(&self.0);
        jobs.last_number += 1;
        let number = jobs.last_number;
        let Request { command, output, about, .. } = request;
        jobs.all.push(Job { number, command, output, about, words, state: JobState::Waiting });
        if std::mem::replace(&mut jobs.has_worker, true) {
            return;
        }
        let shared = self.0.clone();
        let thread = std::thread::Builder::new().name("renders".into());
        if let Err(error) = thread.spawn(move || run_jobs(&shared, &changed)) {
            jobs.has_worker = false;
            set_state(&mut jobs, number, JobState::Failed(format!("cannot start a thread: {error}")));
        }
    }

    /// Cancels a running job, or removes another one from the list.
    pub fn cancel(&self, number: u64) {
        let mut jobs = lock_jobs(&self.0);
        if let Some((running, process)) = &jobs.running
            && *running == number
        {
            return process.interrupt();
        }
        jobs.all.retain(|job| job.number != number);
    }
}

/// Closing the window interrupts the running job, which removes its incomplete files.
impl Drop for RenderQueue {
    fn drop(&mut self) {
        let mut jobs = lock_jobs(&self.0);
        jobs.is_closed = true;
        if let Some((_, process)) = &jobs.running {
            process.interrupt();
        }
    }
}

fn set_state(jobs: &mut Jobs, number: u64, state: JobState) {
    if let Some(job) = jobs.all.iter_mut().find(|job| job.number == number) {
        job.state = state;
    }
}

/// Runs one job after the other until none is waiting.
fn run_jobs(shared: &Mutex<Jobs>, changed: &dyn Fn()) {
    loop {
        let (number, process) = {
            let mut jobs = lock_jobs(shared);
            let jobs = &mut *jobs;
            let next = jobs.all.iter_mut().find(|job| job.state == JobState::Waiting && !jobs.is_closed);
            let Some(job) = next else {
                jobs.has_worker = false;
                return;
            };
            let number = job.number;
            match Process::start(&job.words) {
                Ok(process) => {
                    job.state = JobState::Running { done: 0, frames: 0 };
                    jobs.running = Some((number, process.clone()));
                    (number, process)
                }
                Err(error) => {
                    job.state = JobState::Failed(format!("cannot be started: {error}"));
                    continue;
                }
            }
        };
        changed();
        let ended = process.wait_for_end(|line| {
            let Some((done, frames)) = parse_progress(line) else { return false };
            set_state(&mut lock_jobs(shared), number, JobState::Running { done, frames });
            changed();
            true
        });
        let state = match ended {
            Ok(ended) if ended.interrupted => JobState::Canceled,
            Ok(ended) => final_state(&ended.stdout, &ended.stderr),
            Err(error) => JobState::Failed(error.to_string()),
        };
        let mut jobs = lock_jobs(shared);
        jobs.running = None;
        set_state(&mut jobs, number, state);
        drop(jobs);
        changed();
    }
}

/// Parses a progress line: `{"done":3,"frames":90}`.
fn parse_progress(line: &str) -> Option<(u64, u64)> {
    let value: Value = serde_json::from_str(line).ok()?;
    Some((value["done"].as_u64()?, value["frames"].as_u64()?))
}

/// State of a job by its JSON report, with a text for display. `messages`: standard error, used if there is no report.
fn final_state(report: &str, messages: &str) -> JobState {
    let Ok(report) = serde_json::from_str::<Value>(report) else {
        let text = messages.trim();
        return JobState::Failed(if text.is_empty() {
            "it ended without a message".into()
        } else {
            text.into()
        });
    };
    if report["ok"] != true {
        return JobState::Failed(errors_text(&report));
    }
    let secs = report["seconds"].as_f64().unwrap_or(0.0);
    let frames = report["frames"].as_u64().unwrap_or(0);
    let on = report["device"].as_str().map(|device| format!(" on {device}")).unwrap_or_default();
    let plural = if frames == 1 { "frame" } else { "frames" };
    let texts = |name: &str| report[name].as_array().cloned().unwrap_or_default();
    let all: Vec<Value> = texts("warnings").into_iter().chain(texts("notes")).collect();
    let more = all.iter().filter_map(Value::as_str).map(|text| format!("\n{text}")).collect::<String>();
    JobState::Finished(format!("{frames} {plural} in {secs:.1} s{on}{more}"))
}

/// Errors of a report with their lines.
pub(super) fn errors_text(report: &Value) -> String {
    let one = |error: &Value| {
        let place = error["line"].as_u64().map(|line| format!("line {line}: ")).unwrap_or_default();
        let hint = error["hint"].as_str().map(|hint| format!("\nhint: {hint}")).unwrap_or_default();
        format!("{place}{}{hint}", error["message"].as_str().unwrap_or_default())
    };
    let all: Vec<String> = report["errors"].as_array().into_iter().flatten().map(one).collect();
    all.join("\n")
}
