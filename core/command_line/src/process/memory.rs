//! Memory guard: a thread that ends the program before it takes more memory than it may use. The interpreter reports the limit with the line of
//! a script; importers and renderers have only this guard.

use crate::failure::{Failure, print_message};
use crate::process::kept_frames;
use choreo_sandbox::memory::in_use;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::Thread;
use std::time::{Duration, Instant};

/// Time that the interpreter has to report the limit with a better message.
const MAX_WAIT_FOR_INTERPRETER: Duration = Duration::from_secs(2);
const CHECK_INTERVAL: Duration = Duration::from_millis(10);

/// One thread for the whole program, which sleeps while no command works: `render --watch` runs for days.
static GUARD_THREAD: OnceLock<Option<Thread>> = OnceLock::new();
static LIMIT: AtomicU64 = AtomicU64::new(u64::MAX);
static IS_GUARDING: AtomicBool = AtomicBool::new(false);

/// Ends the program with a message as soon as it holds more than `limit` bytes.
pub(crate) fn start_guard(limit: u64) {
    if in_use() == 0 {
        return;
    }
    LIMIT.store(limit, Ordering::SeqCst);
    IS_GUARDING.store(true, Ordering::SeqCst);
    let guard = GUARD_THREAD.get_or_init(|| {
        // If no thread can be started, the interpreter's own check remains.
        let started =
            std::thread::Builder::new().name("memory guard".into()).stack_size(256 << 10).spawn(watch_memory);
        started.ok().map(|handle| handle.thread().clone())
    });
    guard.iter().for_each(Thread::unpark);
}

/// Stops the guard until the next [`start_guard`].
pub(crate) fn stop_guard() {
    IS_GUARDING.store(false, Ordering::SeqCst);
}

fn watch_memory() {
    let mut since = None;
    loop {
        if !IS_GUARDING.load(Ordering::SeqCst) {
            since = None;
            std::thread::park();
            continue;
        }
        std::thread::sleep(CHECK_INTERVAL);
        let (now, limit) = (in_use(), LIMIT.load(Ordering::SeqCst));
        if now <= limit {
            since = None;
            continue;
        }
        let since = *since.get_or_insert_with(Instant::now);
        if since.elapsed() > MAX_WAIT_FOR_INTERPRETER || now / 3 * 2 > limit {
            end_program(now, limit);
        }
    }
}

fn end_program(now: u64, limit: u64) -> ! {
    choreo_files::remove_unfinished();
    let failure = Failure::input(format!(
        "the program would need more memory than it may use: it holds {} MB\n    hint: smaller images, textures and models \
         need less; the limit is {limit} bytes; raise it with --limit memory=NUMBER if the scene needs it",
        now / 1_000_000
    ));
    failure.message_lines().iter().chain(&kept_frames::take_message()).for_each(print_message);
    std::process::exit(i32::from(failure.exit_code()))
}
