//! Handling of Ctrl-C, SIGTERM and SIGHUP: the render stops between two frames, unfinished files are removed, the finished frames of a
//! video are kept, and the exit code is 130.

use crate::failure::{Failure, print_message};
use crate::process::{kept_frames, scratch};
use choreo_test_runner::collect::shell_quote;
use std::ffi::OsString;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

static INTERRUPTED: AtomicBool = AtomicBool::new(false);
/// Whether a command polls `INTERRUPTED`, and will end the program itself.
static IS_POLLED: AtomicBool = AtomicBool::new(false);

/// Time that a render has to finish its frame before the program is ended anyway.
const MAX_WAIT: Duration = Duration::from_secs(3);

/// Installs the handler of signals for the rest of the process.
pub(crate) fn install() {
    // Fails only if a handler is installed already. Without a handler, the default action of the system ends the program.
    let _ = ctrlc::set_handler(|| {
        INTERRUPTED.store(true, Ordering::SeqCst);
        let start = Instant::now();
        while IS_POLLED.load(Ordering::SeqCst) && start.elapsed() < MAX_WAIT {
            std::thread::sleep(Duration::from_millis(20));
        }
        choreo_files::remove_unfinished();
        scratch::remove_folder();
        kept_frames::take_message().iter().for_each(print_message);
        print_message("interrupted");
        std::process::exit(i32::from(Failure::Interrupted.exit_code()));
    });
}

/// States whether a render polls [`is_interrupted`] between frames.
pub(crate) fn set_polled(on: bool) {
    IS_POLLED.store(on, Ordering::SeqCst);
}

pub(crate) fn is_interrupted() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}

/// Command line that resumes a render: `choreo render …` with `--resume`, quoted for a shell. `--resume` follows "render" directly, where no
/// option can take it for its value.
pub(crate) fn resume_command(args: &[OsString]) -> String {
    let mut words: Vec<String> = args.iter().map(|a| a.to_string_lossy().into_owned()).collect();
    words.retain(|w| !matches!(w.as_str(), "--resume" | "--discard" | "--watch"));
    words.insert(words.len().min(2), "--resume".into());
    words.iter().map(|w| shell_quote(w)).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::resume_command;

    #[test]
    fn resume_command_is_quoted_for_a_shell() {
        let command = |line: &[&str]| resume_command(&line.iter().map(Into::into).collect::<Vec<_>>());
        for (line, expected) in [
            (
                &["choreo", "render", "a b.rhai", "-o", "o.mp4"][..],
                "choreo render --resume 'a b.rhai' -o o.mp4",
            ),
            (
                &["choreo", "render", "-o", "o.mp4", "--", "-s.rhai"],
                "choreo render --resume -o o.mp4 -- -s.rhai",
            ),
            (&["choreo", "render", "--resume", "s.rhai", "-oo.gif"], "choreo render --resume s.rhai -oo.gif"),
            (
                &["./choreo", "render", "s.rhai", "--watch", "-o", "o.mp4", "--set", "who=Ann's"],
                "./choreo render --resume s.rhai -o o.mp4 --set 'who=Ann'\\''s'",
            ),
        ] {
            assert_eq!(command(line), expected);
        }
    }
}
