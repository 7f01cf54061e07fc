//! Output for tests and measurements: what the window has done and when, a line of JSON each on standard output. Hidden behind
//! `--event-log`, since users of the viewer do not need it.

use choreo_render::DeviceUsage;
use choreo_session::{FrameInfo, SceneVersion};
use serde_json::{Value, json};
use std::io::Write;
use std::time::{Duration, Instant};

/// Prints nothing unless it is switched on.
#[derive(Clone, Copy)]
pub(crate) struct EventLog {
    since: Option<Instant>,
}

impl EventLog {
    pub fn new(on: bool) -> EventLog {
        EventLog { since: on.then(Instant::now) }
    }

    /// Reports an event that happens once, as the program starts.
    pub fn done(&self, what: &str) {
        self.say(|| json!({ "event": what }));
    }

    /// A version that is there, good or not; `problems`: errors where it is not, else warnings.
    pub fn version(&self, version: &SceneVersion) {
        let (number, faulty) = (version.number, version.scene.is_none());
        self.say(|| {
            json!({ "event": "scene", "version": number, "faulty": faulty, "problems": version.problems.len() })
        });
    }

    /// The messages of `check` about a version are there.
    pub fn checked(&self, version: u64, messages: usize) {
        self.say(|| json!({ "event": "checked", "version": version, "messages": messages }));
    }

    /// An image that has gone to the screen, with what its frame took and what the renderer holds.
    pub fn shown(&self, view: usize, shown: &FrameInfo, held: &DeviceUsage) {
        let frame = shown.evaluated_in + shown.planned_in + shown.drawn_in;
        self.say(|| {
            json!({
                "event": "shown",
                "view": view,
                "version": shown.number,
                "frame_ms": frame.as_secs_f64() * 1e3,
                "pipelines": held.pipelines,
                "objects": held.memory_objects,
                "blocks": held.memory_blocks,
                "bytes": held.bytes,
                "device": shown.device.name,
            })
        });
    }

    /// A frame of the window: what its panels took on the CPU, and the whole of it with what draws them.
    pub fn painted(&self, panels: Duration, whole: Duration) {
        self.say(|| {
            json!({
                "event": "painted",
                "panels_ms": panels.as_secs_f64() * 1e3,
                "whole_ms": whole.as_secs_f64() * 1e3,
            })
        });
    }

    fn say(&self, line: impl FnOnce() -> Value) {
        let Some(since) = self.since else { return };
        let mut line = line();
        line["ms"] = json!(since.elapsed().as_secs_f64() * 1e3);
        let mut out = std::io::stdout().lock();
        // The reader has gone: there is nobody to report to.
        let _ = writeln!(out, "{line}").and_then(|()| out.flush());
    }
}
