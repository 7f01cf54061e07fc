//! Commands that the program executes in a separate process, with progress, while the server continues to answer. The response is sent when
//! the process has ended; the client can cancel it.

use crate::document::uri_of;
use crate::transport::{Client, ResponseError};
use crate::{Host, Task};
use serde_json::{Value, json};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

pub(crate) const RENDER: &str = "choreo.renderFrame";
pub(crate) const TEST: &str = "choreo.runTest";
pub(crate) const VIEW: &str = "choreo.openViewer";
pub(crate) const NAMES: [&str; 3] = [RENDER, TEST, VIEW];

/// Time that a viewer may take to fail; one that runs longer is assumed to show the script.
const VIEWER_START_TIME: Duration = Duration::from_secs(2);
/// Interval between checks of a process.
const POLL: Duration = Duration::from_millis(15);

/// A command of the client, with the resolved file and time.
pub(crate) struct CommandRequest {
    pub id: Value,
    pub name: String,
    pub script: PathBuf,
    pub secs: f64,
    /// The test to run; `None` runs all tests of the file.
    pub section: Option<String>,
    /// Folder of the project.
    pub root: PathBuf,
    /// Whether the client shows the result itself.
    pub is_silent: bool,
    /// Token for progress, from the client or from the server.
    pub progress: Option<Value>,
}

/// Running commands, and the folder for their output.
#[derive(Default)]
pub(crate) struct RunningCommands {
    jobs: Vec<Job>,
    folder: Option<PathBuf>,
}

struct Job {
    id: Value,
    progress: Option<Value>,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl RunningCommands {
    /// Starts a command on its own thread, which sends the response.
    pub(crate) fn start(
        &mut self,
        request: CommandRequest,
        host: &dyn Host,
        client: Client,
    ) -> Result<(), ResponseError> {
        let failed = |why: String| ResponseError::new(ResponseError::FAILED, why);
        let folder = self.folder().map_err(|e| failed(format!("cannot create a folder for results: {e}")))?;
        self.jobs.retain(|job| !job.thread.is_finished());
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let stem = request.script.file_stem().map_or("frame".into(), |stem| stem.to_string_lossy());
        let output = folder.join(format!("{stem}-{:.3}-{number}.png", request.secs));
        let task = match request.name.as_str() {
            RENDER => Task::Frame { script: &request.script, secs: request.secs, output: &output },
            TEST => Task::Test {
                script: &request.script,
                section: request.section.as_deref(),
                root: &request.root,
            },
            _ => Task::View { script: &request.script, secs: request.secs },
        };
        let command = host.command(&task).map_err(|e| failed(e.to_string()))?;
        let output_files = ["out", "err"].map(|name| folder.join(format!("{number}.{name}")));
        let stop = Arc::new(AtomicBool::new(false));
        let (id, progress, stopped) = (request.id.clone(), request.progress.clone(), stop.clone());
        let work = move || {
            let progress = Progress::begin(&client, &request);
            let answer =
                CommandRun { request: &request, output, output_files, stop: &stopped, client: &client }
                    .run(command);
            progress.end();
            match answer {
                Ok(result) => client.send_result(&request.id, result),
                Err(error) => client.send_error(&request.id, &error),
            }
        };
        let thread = std::thread::Builder::new().name("command".into()).spawn(work);
        let thread = thread.map_err(|e| failed(format!("cannot start a thread for the command: {e}")))?;
        self.jobs.push(Job { id, progress, stop, thread });
        Ok(())
    }

    /// Cancels the command with this request id or progress token.
    pub(crate) fn cancel(&self, id: &Value) {
        let is_meant = |job: &&Job| job.id == *id || job.progress.as_ref() == Some(id);
        self.jobs.iter().filter(is_meant).for_each(|job| job.stop.store(true, Ordering::Relaxed));
    }

    /// Folder for the output of commands, created when it is first needed.
    fn folder(&mut self) -> io::Result<PathBuf> {
        if let Some(folder) = &self.folder {
            return Ok(folder.clone());
        }
        let mut number = 0;
        let folder = loop {
            let folder = std::env::temp_dir().join(format!("choreo-lsp-{}-{number}", std::process::id()));
            match std::fs::create_dir(&folder) {
                Ok(()) => break folder,
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists && number < 100 => number += 1,
                Err(e) => return Err(e),
            }
        };
        Ok(self.folder.insert(folder).clone())
    }
}

impl Drop for RunningCommands {
    fn drop(&mut self) {
        self.jobs.iter().for_each(|job| job.stop.store(true, Ordering::Relaxed));
        self.jobs.drain(..).for_each(|job| drop(job.thread.join()));
        self.folder.iter().for_each(|folder| drop(std::fs::remove_dir_all(folder)));
    }
}

/// One command on its thread.
struct CommandRun<'w> {
    request: &'w CommandRequest,
    /// Path of the image to be drawn.
    output: PathBuf,
    /// Files for the standard output and standard error of the process.
    output_files: [PathBuf; 2],
    stop: &'w AtomicBool,
    client: &'w Client,
}

/// How the process ended.
enum ProcessOutcome {
    Ended(ExitStatus),
    Cancelled,
    /// The viewer is open.
    ViewerOpen,
}

impl CommandRun<'_> {
    fn run(&self, mut command: Command) -> Result<Value, ResponseError> {
        let failed = |why: String| ResponseError::new(ResponseError::FAILED, why);
        let outcome = self
            .run_process(&mut command)
            .map_err(|e| failed(format!("the program cannot be started: {e}")))?;
        let text =
            |file: &Path| String::from_utf8_lossy(&std::fs::read(file).unwrap_or_default()).into_owned();
        let [out, err] = self.output_files.each_ref().map(|file| text(file));
        let done = match outcome {
            ProcessOutcome::Cancelled => {
                return Err(ResponseError::new(ResponseError::CANCELLED, "the command was cancelled"));
            }
            ProcessOutcome::ViewerOpen => true,
            ProcessOutcome::Ended(status) => status.success(),
        };
        match self.request.name.as_str() {
            // Failed tests are a result.
            TEST => {
                match serde_json::from_str::<Value>(&out).ok().filter(|report| report["sections"].is_array())
                {
                    Some(report) => {
                        self.show_message(if done { 3 } else { 2 }, &test_summary(&report));
                        Ok(report)
                    }
                    None => Err(failed(err.trim().to_string())),
                }
            }
            _ if !done => Err(failed(err.trim().to_string())),
            RENDER => {
                let path = self.output.display().to_string();
                self.show_message(3, &format!("The frame at {:.2} s: {path}", self.request.secs));
                Ok(json!({ "path": path, "uri": uri_of(&self.output), "time": self.request.secs }))
            }
            _ => Ok(Value::Null),
        }
    }

    fn run_process(&self, command: &mut Command) -> io::Result<ProcessOutcome> {
        let [out, err] = [&self.output_files[0], &self.output_files[1]].map(File::create);
        let mut process = command.stdin(Stdio::null()).stdout(out?).stderr(err?).spawn()?;
        let begun = Instant::now();
        loop {
            if let Some(status) = process.try_wait()? {
                return Ok(ProcessOutcome::Ended(status));
            }
            if self.stop.load(Ordering::Relaxed) {
                process.kill()?;
                process.wait()?;
                return Ok(ProcessOutcome::Cancelled);
            }
            if self.request.name == VIEW && begun.elapsed() > VIEWER_START_TIME {
                // The viewer stays open when the editor is closed.
                let _ = std::thread::Builder::new().name("viewer".into()).spawn(move || process.wait());
                return Ok(ProcessOutcome::ViewerOpen);
            }
            std::thread::sleep(POLL);
        }
    }

    /// Shows a message, unless the client shows the result itself. `kind` is the message type of the protocol: 2 (warning) or 3 (information).
    fn show_message(&self, kind: u8, message: &str) {
        if !self.request.is_silent {
            self.client.notify("window/showMessage", json!({ "type": kind, "message": message }));
        }
    }
}

/// Summary of a test report: "3 passed", or the names of the failed tests.
fn test_summary(report: &Value) -> String {
    let sections = report["sections"].as_array().map_or(&[][..], Vec::as_slice);
    let is_bad = |section: &&Value| matches!(section["status"].as_str(), Some("failed" | "error"));
    let bad: Vec<&str> =
        sections.iter().filter(is_bad).filter_map(|section| section["section"].as_str()).collect();
    let passed = report["passed"].as_u64().unwrap_or(0);
    match bad.is_empty() {
        true => format!("{passed} passed"),
        false => format!("{passed} passed, {} failed: {}", bad.len(), bad.join(", ")),
    }
}

/// Progress that the client shows while a command runs.
struct Progress<'p> {
    client: &'p Client,
    token: Option<&'p Value>,
}

impl Progress<'_> {
    fn begin<'p>(client: &'p Client, request: &'p CommandRequest) -> Progress<'p> {
        let progress = Progress { client, token: request.progress.as_ref() };
        let title = match request.name.as_str() {
            RENDER => format!("Rendering the frame at {:.2} s", request.secs),
            TEST => "Running tests".to_string(),
            _ => "Opening the viewer".to_string(),
        };
        progress.send(json!({ "kind": "begin", "title": title, "cancellable": true }));
        progress
    }

    fn send(&self, value: Value) {
        if let Some(token) = self.token {
            self.client.notify("$/progress", json!({ "token": token, "value": value }));
        }
    }

    fn end(&self) {
        self.send(json!({ "kind": "end" }));
    }
}
