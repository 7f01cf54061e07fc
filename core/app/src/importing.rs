//! A bar while files are read and imported, on a terminal, for what takes longer than a moment.

use choreo_script::Imports;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// Nobody needs a bar for less.
const MOMENT: Duration = Duration::from_millis(300);
const EVERY: Duration = Duration::from_millis(100);

/// While it lives, the bar may be shown; when it is dropped, its line is clean again.
pub struct Bar(Option<(Sender<()>, JoinHandle<()>)>);

impl Bar {
    pub fn over(imports: &Imports, quiet: bool) -> Bar {
        if quiet || !std::io::stderr().is_terminal() {
            return Bar(None);
        }
        let (end, ended) = channel();
        let imports = imports.clone();
        let watcher = std::thread::Builder::new().name("progress".into()).spawn(move || {
            let mut shown: Option<ProgressBar> = None;
            let mut wait = MOMENT;
            while ended.recv_timeout(wait) == Err(RecvTimeoutError::Timeout) {
                wait = EVERY;
                let now = imports.progress();
                if now.done == now.files {
                    continue;
                }
                let bar = shown.get_or_insert_with(bar);
                bar.set_length(now.bytes.max(1));
                bar.set_position(now.bytes_done);
                bar.set_message(format!(
                    "{} of {} files: {}",
                    now.done,
                    now.files,
                    choreo_plugin::suggest::list(now.names.iter().map(String::as_str), 2)
                ));
            }
            if let Some(bar) = shown {
                bar.finish_and_clear();
            }
        });
        // Without a thread there is no bar.
        Bar(watcher.ok().map(|watcher| (end, watcher)))
    }
}

fn bar() -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(1), ProgressDrawTarget::stderr_with_hz(10));
    if let Ok(style) = ProgressStyle::with_template("{bar:32} importing {msg} ({bytes} of {total_bytes})") {
        bar.set_style(style.progress_chars("█▌·"));
    }
    bar
}

impl Drop for Bar {
    fn drop(&mut self) {
        if let Some((end, watcher)) = self.0.take() {
            drop(end);
            let _ = watcher.join();
        }
    }
}
