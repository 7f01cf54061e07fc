//! One command that runs: its lines as they come, what it wrote, and how it is stopped.

use std::ffi::OsString;
use std::io::{self, BufRead, BufReader, Read};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A started command. Clones are the same one.
#[derive(Clone)]
pub struct Process(Arc<Mutex<Started>>);

struct Started {
    child: Child,
    interrupted: bool,
}

/// Streams and exit code of a command that has ended.
pub struct Ended {
    pub stdout: String,
    pub stderr: String,
    pub interrupted: bool,
}

/// Output beyond this is not kept.
const MOST_BYTES: u64 = 64 << 20;

impl Process {
    pub fn start(words: &[OsString]) -> io::Result<Process> {
        let (program, args) = words.split_first().ok_or(io::ErrorKind::NotFound)?;
        let mut command = Command::new(program);
        command.args(args).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        Ok(Process(Arc::new(Mutex::new(Started { child: command.spawn()?, interrupted: false }))))
    }

    fn locked(&self) -> MutexGuard<'_, Started> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the end. `line`: called with each line of standard error; those that it takes are not kept.
    pub fn finish(&self, mut line: impl FnMut(&str) -> bool) -> io::Result<Ended> {
        let (stdout, stderr) = {
            let child = &mut self.locked().child;
            (child.stdout.take(), child.stderr.take())
        };
        let reader = std::thread::Builder::new().name("output of a command".into()).spawn(move || {
            let mut text = Vec::new();
            // Text that ends early is judged by whoever reads it.
            let _ = stdout.map(|out| out.take(MOST_BYTES).read_to_end(&mut text));
            String::from_utf8_lossy(&text).into_owned()
        })?;
        let mut kept = String::new();
        let mut lines = stderr.map(|err| BufReader::new(err.take(MOST_BYTES)));
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
        let mut started = self.locked();
        started.child.wait()?;
        Ok(Ended { stdout, stderr: kept, interrupted: started.interrupted })
    }

    /// Asks it to end, as Ctrl-C does, so that it takes away what is not complete; the second time it is ended.
    pub fn interrupt(&self) {
        let mut started = self.locked();
        let again = std::mem::replace(&mut started.interrupted, true);
        #[cfg(unix)]
        if !again {
            // One that has ended already needs no word.
            let process = rustix::process::Pid::from_child(&started.child);
            if let Ok(None) = started.child.try_wait() {
                let _ = rustix::process::kill_process(process, rustix::process::Signal::INT);
            }
            return;
        }
        let _ = again;
        // As above.
        let _ = started.child.kill();
    }
}
