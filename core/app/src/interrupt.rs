//! Ctrl-C, SIGTERM and SIGHUP: the render stops between two frames, part files are removed, the exit code is 130.

use crate::{failure::Failure, part};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

static INTERRUPTED: AtomicBool = AtomicBool::new(false);
/// Whether somebody looks at `INTERRUPTED` and will end the program in order.
static WATCHED: AtomicBool = AtomicBool::new(false);

/// How long a render has to finish its frame before it is ended anyway.
const PATIENCE: Duration = Duration::from_secs(3);

pub fn install() {
    // Fails only where a handler is installed already; without one, the system's own ends the program.
    let _ = ctrlc::set_handler(|| {
        INTERRUPTED.store(true, Ordering::SeqCst);
        let start = Instant::now();
        while WATCHED.load(Ordering::SeqCst) && start.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_millis(20));
        }
        part::remove_parts();
        eprintln!("interrupted");
        std::process::exit(i32::from(Failure::Interrupted.code()));
    });
}

/// True while a render looks at [`interrupted`] between frames.
pub fn watch(on: bool) {
    WATCHED.store(on, Ordering::SeqCst);
}

pub fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}
