//! A viewer process that reports the images that it has displayed (`--event-log`), and the system's data about it.

use super::Running;
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(600);

pub(crate) struct ViewerProcess {
    pub process: Running,
    lines: Receiver<(Instant, Value)>,
    /// Frame times of the window, separate from the other events, since every mouse move causes one.
    paints: Receiver<Value>,
}

impl ViewerProcess {
    /// `command` without `--event-log`.
    pub(crate) fn start(mut command: Command) -> ViewerProcess {
        let mut child = command.arg("--event-log").stdout(Stdio::piped()).spawn().unwrap();
        let ((to, lines), (to_paints, paints)) = (channel(), channel());
        let from = BufReader::new(child.stdout.take().unwrap());
        std::thread::spawn(move || {
            let lines = from.lines().map_while(Result::ok);
            let values = lines.filter_map(|line| serde_json::from_str::<Value>(&line).ok());
            for value in values {
                let sent = if value["event"] == "painted" {
                    to_paints.send(value).is_ok()
                } else {
                    to.send((Instant::now(), value)).is_ok()
                };
                if !sent {
                    return;
                }
            }
        });
        ViewerProcess { process: Running(child), lines, paints }
    }

    /// The next line of the event log, with its time of arrival.
    pub(crate) fn next(&self) -> (Instant, Value) {
        self.lines.recv_timeout(PATIENCE).unwrap_or_else(|e| panic!("the viewer reports nothing: {e}"))
    }

    /// The next displayed image of this version or a later one.
    pub(crate) fn shown(&self, version: u64) -> (Instant, Value) {
        loop {
            let (when, value) = self.next();
            if value["event"] == "shown" && value["version"].as_u64() >= Some(version) {
                return (when, value);
            }
        }
    }

    /// The next displayed image before a time. `None` if there is none.
    pub(crate) fn shown_before(&self, end: Instant) -> Option<(Instant, Value)> {
        loop {
            let left = end.checked_duration_since(Instant::now())?;
            let (when, value) = self.lines.recv_timeout(left).ok()?;
            if value["event"] == "shown" {
                return Some((when, value));
            }
        }
    }

    /// The next loaded version later than `after`: its number, and whether it is faulty.
    pub(crate) fn version(&self, after: u64) -> (u64, bool) {
        loop {
            let (_, value) = self.next();
            if let Some(number) =
                value["version"].as_u64().filter(|n| value["event"] == "scene" && *n > after)
            {
                return (number, value["faulty"] == true);
            }
        }
    }

    /// The last displayed image once no event has come for `quiet`. `None` if events continue for more than `most`.
    pub(crate) fn settled(&self, quiet: Duration, most: Duration) -> Option<Option<Value>> {
        let end = Instant::now() + most;
        let mut last = None;
        while Instant::now() < end {
            match self.lines.recv_timeout(quiet) {
                Ok((_, value)) => last = Some(value).filter(|v| v["event"] == "shown").or(last),
                Err(_) => return Some(last),
            }
        }
        None
    }

    /// Waits for five more frames, which shows that playback runs: its rate depends on the machine.
    pub(crate) fn plays(&self) {
        self.meanwhile();
        let mut shown = 0;
        while shown < 5 {
            shown += usize::from(self.next().1["event"] == "shown");
        }
    }

    /// Processor time of all threads, seconds (`man proc_pid_stat`, fields 14 and 15).
    pub(crate) fn processor_secs(&self) -> f64 {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.process.0.id())).unwrap();
        // The name can contain blanks; it ends at the last parenthesis.
        // 100 ticks a second, on every Linux machine that runs this: `getconf CLK_TCK`.
        ticks(stat.rsplit(')').next().unwrap()) / 100.0
    }

    /// Lines of the event log since the last call.
    pub(crate) fn meanwhile(&self) -> Vec<Value> {
        self.lines.try_iter().map(|(_, value)| value).collect()
    }

    /// Frame times of the window since the last call.
    pub(crate) fn painted(&self) -> Vec<Value> {
        self.paints.try_iter().collect()
    }

    /// Name and processor time in seconds of each thread.
    pub(crate) fn threads(&self) -> Vec<(String, f64)> {
        let tasks = std::fs::read_dir(format!("/proc/{}/task", self.process.0.id())).unwrap();
        let stats = tasks.flatten().filter_map(|task| std::fs::read_to_string(task.path().join("stat")).ok());
        stats
            .map(|stat| {
                let (name, fields) = stat.rsplit_once(')').unwrap();
                let name = name.split_once('(').unwrap().1.to_string();
                (name, ticks(fields) / 100.0)
            })
            .collect()
    }

    /// A value of `/proc/PID/status`: kB, or a count.
    pub(crate) fn status(&self, name: &str) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.process.0.id())).unwrap();
        let line = status.lines().find_map(|l| l.strip_prefix(name)?.strip_prefix(':'));
        line.and_then(|l| l.split_whitespace().next()?.parse().ok()).unwrap_or_else(|| panic!("no {name}"))
    }

    /// Number of open files, sockets and pipes.
    pub(crate) fn files(&self) -> usize {
        std::fs::read_dir(format!("/proc/{}/fd", self.process.0.id())).unwrap().count()
    }
}

/// Processor time in ticks, from the fields after the name.
fn ticks(fields: &str) -> f64 {
    fields.split_whitespace().skip(11).take(2).map(|f| f.parse().unwrap_or(0.0)).sum()
}
