//! A running command: its output lines as they arrive, its results, and its termination.

use std::ffi::OsString;
use std::io::{self, BufRead, BufReader, Read};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A started command. Clones refer to the same process.
#[derive(Clone)]
pub(super) struct Process(Arc<Mutex<ChildState>>);

struct ChildState {
    child: Child,
    interrupted: bool,
}

/// Output streams of a finished command.
pub(super) struct CommandOutput {
    pub stdout: String,
    pub stderr: String,
    pub interrupted: bool,
}

/// Limit of each output stream, bytes; the rest is dropped.
const MAX_STREAM_BYTES: u64 = 64 << 20;

impl Process {
    pub(super) fn start(words: &[OsString]) -> io::Result<Process> {
        let (program, args) = words.split_first().ok_or(io::ErrorKind::NotFound)?;
        let mut command = Command::new(program);
        command.args(args).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        Ok(Process(Arc::new(Mutex::new(ChildState { child: command.spawn()?, interrupted: false }))))
    }

    fn lock_state(&self) -> MutexGuard<'_, ChildState> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the end. `line`: called with each line of standard error; lines for which it returns `true` are not kept.
    pub(super) fn wait_for_end(&self, mut line: impl FnMut(&str) -> bool) -> io::Result<CommandOutput> {
        let (stdout, stderr) = {
            let child = &mut self.lock_state().child;
            (child.stdout.take(), child.stderr.take())
        };
        let reader = std::thread::Builder::new().name("output of a command".into()).spawn(move || {
            let mut text = Vec::new();
            // An incomplete text is detected when it is parsed.
            let _ = stdout.map(|out| out.take(MAX_STREAM_BYTES).read_to_end(&mut text));
            String::from_utf8_lossy(&text).into_owned()
        })?;
        let mut kept = String::new();
        let mut lines = stderr.map(|err| BufReader::new(err.take(MAX_STREAM_BYTES)));
        let mut bytes = Vec::new();
        while let Some(from) = &mut lines {
            bytes.clear();
            if from.read_until(b'\n', &mut bytes)? == 0 {
                break;
            }
            let text = String::from_utf8_lossy(&bytes);
            if !line(text.trim_end()) {
                kept.push_str(&text);
            }
        }
        let stdout = reader.join().unwrap_or_default();
        let mut started = self.lock_state();
        started.child.wait()?;
        Ok(CommandOutput { stdout, stderr: kept, interrupted: started.interrupted })
    }

    /// Interrupts the process like Ctrl-C, so that it removes incomplete files; the second call kills it.
    pub(super) fn interrupt(&self) {
        let mut started = self.lock_state();
        let again = std::mem::replace(&mut started.interrupted, true);
        #[cfg(unix)]
        if !again {
            // A process that has already ended is not signaled.
            let process = rustix::process::Pid::from_child(&started.child);
            if let Ok(None) = started.child.try_wait() {
                let _ = rustix::process::kill_process(process, rustix::process::Signal::INT);
            }
            return;
        }
        let _ = again;
        // Fails if the process has already ended.
        let _ = started.child.kill();
    }
}
