//! Progress bar on a terminal while files are read and imported, if that takes longer than a moment.

use choreo_script::{ImportProgress, Imports, printable_line};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// Time after which a bar is shown.
const SHOW_DELAY: Duration = Duration::from_millis(300);
const UPDATE_INTERVAL: Duration = Duration::from_millis(100);

/// Shows the bar while this value lives, and clears its line on drop.
pub(crate) struct ImportBar(Option<(Sender<()>, JoinHandle<()>)>);

impl ImportBar {
    pub(crate) fn for_imports(imports: &Imports, quiet: bool) -> ImportBar {
        if quiet || !std::io::stderr().is_terminal() {
            return ImportBar(None);
        }
        let (end, ended) = channel();
        let imports = imports.clone();
        let watcher = std::thread::Builder::new().name("progress".into()).spawn(move || {
            let mut shown: Option<ProgressBar> = None;
            let mut wait = SHOW_DELAY;
            while ended.recv_timeout(wait) == Err(RecvTimeoutError::Timeout) {
                wait = UPDATE_INTERVAL;
                let now = imports.progress();
                if now.done == now.files {
                    continue;
                }
                let target = || ProgressDrawTarget::stderr_with_hz(10);
                update_bar(shown.get_or_insert_with(|| new_bar(target())), &now);
            }
            if let Some(bar) = shown {
                bar.finish_and_clear();
            }
        });
        // If the thread cannot be started, no bar is shown.
        ImportBar(watcher.ok().map(|watcher| (end, watcher)))
    }
}

fn update_bar(bar: &ProgressBar, now: &ImportProgress) {
    let names = choreo_plugin::suggest::list(now.names.iter().map(String::as_str), 2);
    bar.set_message(printable_line(&format!("{} of {} files: {names}", now.done, now.files)));
    bar.set_length(now.bytes.max(1));
    bar.set_position(now.bytes_done);
}

/// A bar that fits on one line at any width: names that do not fit are truncated.
fn new_bar(target: ProgressDrawTarget) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(1), target);
    if let Ok(style) = ProgressStyle::with_template("{bar:24} importing {bytes} of {total_bytes}, {wide_msg}")
    {
        bar.set_style(style.progress_chars("█▌·"));
    }
    bar
}

impl Drop for ImportBar {
    fn drop(&mut self) {
        if let Some((end, watcher)) = self.0.take() {
            drop(end);
            let _ = watcher.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use indicatif::TermLike;
    use std::io::Result;
    use std::sync::{Arc, Mutex};

    /// A terminal of one line that keeps what is written.
    #[derive(Clone, Debug, Default)]
    struct OneLineTerminal(Arc<Mutex<String>>);

    impl TermLike for OneLineTerminal {
        fn width(&self) -> u16 {
            100
        }
        fn move_cursor_up(&self, _: usize) -> Result<()> {
            Ok(())
        }
        fn move_cursor_down(&self, _: usize) -> Result<()> {
            Ok(())
        }
        fn move_cursor_right(&self, _: usize) -> Result<()> {
            Ok(())
        }
        fn move_cursor_left(&self, _: usize) -> Result<()> {
            Ok(())
        }
        fn write_line(&self, text: &str) -> Result<()> {
            self.write_str(text)
        }
        fn write_str(&self, text: &str) -> Result<()> {
            self.0.lock().unwrap().push_str(text);
            Ok(())
        }
        fn clear_line(&self) -> Result<()> {
            self.0.lock().unwrap().clear();
            Ok(())
        }
        fn flush(&self) -> Result<()> {
            Ok(())
        }
    }

    #[test]
    fn bar_shows_the_bytes_and_files_read() {
        let line = OneLineTerminal::default();
        let drawn = new_bar(ProgressDrawTarget::term_like(Box::new(line.clone())));
        let names = vec!["knight.glb".to_string()];
        update_bar(&drawn, &ImportProgress { files: 2, done: 1, bytes: 4 << 20, bytes_done: 2 << 20, names });
        drawn.force_draw();
        let text = line.0.lock().unwrap().clone();
        let wanted = "████████████▌··········· ";
        assert!(text.contains(wanted), "{text}");
        assert!(text.contains("importing 2.00 MiB of 4.00 MiB, 1 of 2 files: knight.glb"), "{text}");
        drawn.finish_and_clear();
        assert_eq!(line.0.lock().unwrap().trim(), "", "the line is cleared at the end");
    }
}
