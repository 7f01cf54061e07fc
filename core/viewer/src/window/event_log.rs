//! Event log for tests and measurements: what the window did and when, as one line of JSON per event on standard output. The option `--event-log`
//! is hidden, since users of the viewer do not need it.

use choreo_render::DeviceUsage;
use choreo_session::{FrameInfo, SceneVersion};
use serde_json::{Value, json};
use std::io::Write;
use std::time::{Duration, Instant};

/// Log that prints nothing unless it is switched on.
#[derive(Clone, Copy)]
pub(crate) struct EventLog {
    since: Option<Instant>,
}

impl EventLog {
    pub(super) fn new(on: bool) -> EventLog {
        EventLog { since: on.then(Instant::now) }
    }

    /// Reports a step of the program's start.
    pub(super) fn log_step(&self, what: &str) {
        self.write_line(|| json!({ "event": what }));
    }

    /// Reports a version; its problems are errors if it is faulty, else warnings.
    pub(super) fn log_version(&self, version: &SceneVersion) {
        let (number, faulty) = (version.number, version.scene.is_none());
        self.write_line(|| {
            json!({ "event": "scene", "version": number, "faulty": faulty, "problems": version.problems.len() })
        });
    }

    /// Reports that the messages of `check` about a version have arrived.
    pub(super) fn log_check(&self, version: u64, message_count: usize) {
        self.write_line(|| json!({ "event": "checked", "version": version, "messages": message_count }));
    }

    /// Reports an image on the screen, with the durations of its frame and the objects that the renderer holds.
    pub(super) fn log_shown_frame(&self, view: usize, shown: &FrameInfo, usage: &DeviceUsage) {
        let frame = shown.evaluated_in + shown.planned_in + shown.drawn_in;
        self.write_line(|| {
            json!({
                "event": "shown",
                "view": view,
                "version": shown.number,
                "frame_ms": frame.as_secs_f64() * 1e3,
                "pipelines": usage.pipelines,
                "objects": usage.memory_objects,
                "blocks": usage.memory_blocks,
                "bytes": usage.bytes,
                "device": shown.device.name,
            })
        });
    }

    /// Reports a frame of the window: CPU time of its panels, and total time including drawing.
    pub(super) fn log_window_frame(&self, panels: Duration, whole: Duration) {
        self.write_line(|| {
            json!({
                "event": "painted",
                "panels_ms": panels.as_secs_f64() * 1e3,
                "whole_ms": whole.as_secs_f64() * 1e3,
            })
        });
    }

    fn write_line(&self, line: impl FnOnce() -> Value) {
        let Some(since) = self.since else { return };
        let mut line = line();
        line["ms"] = json!(since.elapsed().as_secs_f64() * 1e3);
        let mut out = std::io::stdout().lock();
        // Fails if the reader is gone, when nobody needs the report.
        let _ = writeln!(out, "{line}").and_then(|()| out.flush());
    }
}
