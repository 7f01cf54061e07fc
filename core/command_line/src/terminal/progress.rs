//! Progress of a render: a bar with the remaining time on a terminal, lines of JSON for a program that shows its own bar, nothing
//! elsewhere.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use std::io::Write;
use std::sync::atomic::{AtomicU64, Ordering};

/// Progress of a render, as a bar or as lines of JSON.
pub(crate) struct Progress(Option<ProgressBar>, Option<JsonLines>);

struct JsonLines {
    frames: u64,
    done: AtomicU64,
}

impl Progress {
    /// Writes a line such as `{"done":1,"frames":90}` to standard error for each frame.
    pub(crate) fn json_lines(frames: u64) -> Progress {
        Progress(None, Some(JsonLines { frames, done: AtomicU64::new(0) }))
    }

    pub(crate) fn new(frames: u64, quiet: bool) -> Progress {
        use std::io::IsTerminal;
        if quiet || frames < 2 || !std::io::stderr().is_terminal() {
            return Progress(None, None);
        }
        let bar = ProgressBar::with_draw_target(Some(frames), ProgressDrawTarget::stderr_with_hz(10));
        let template = "{bar:32} {pos}/{len} frames, {rate}/s, {eta} left";
        if let Ok(style) = ProgressStyle::with_template(template) {
            let rate = |state: &ProgressState, w: &mut dyn std::fmt::Write| {
                let _ = write!(w, "{:.0}", state.per_sec());
            };
            bar.set_style(style.with_key("rate", rate).progress_chars("█▌·"));
        }
        Progress(Some(bar), None)
    }

    pub(crate) fn step(&self) {
        if let Some(bar) = &self.0 {
            bar.inc(1);
        }
        if let Some(JsonLines { frames, done }) = &self.1 {
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            // If the reader has gone, the render continues.
            let _ = writeln!(std::io::stderr(), "{{\"done\":{done},\"frames\":{frames}}}");
        }
    }

    /// Clears the bar, so that the next output starts on an empty line.
    pub(crate) fn clear(&self) {
        if let Some(bar) = &self.0 {
            bar.finish_and_clear();
        }
    }
}
