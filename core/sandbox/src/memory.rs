//! The memory that the program has in use, measured by a thread of its own, so that looking costs two loads. The thread sleeps
//! while nobody looks: a viewer that shows a still image costs nothing.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::Thread;
use std::time::Duration;

static IN_USE: AtomicU64 = AtomicU64::new(0);
/// Somebody has looked since the thread last asked.
static LOOKED: AtomicBool = AtomicBool::new(false);
static ASLEEP: AtomicBool = AtomicBool::new(false);

/// Time between two measurements: a program writes a few megabytes in it at most.
const EVERY: Duration = Duration::from_millis(5);
/// Number of times in a row without a look: the thread goes to sleep.
const UNWATCHED: u32 = 20;

/// Bytes in use a few milliseconds ago; 0 where the system does not tell.
pub fn in_use() -> u64 {
    static WATCHER: OnceLock<Option<Thread>> = OnceLock::new();
    let watcher = WATCHER.get_or_init(|| {
        IN_USE.store(ask()?, Ordering::Relaxed);
        // If the thread cannot start, the first answer stays: better no limit than no script.
        let started = std::thread::Builder::new().name("memory".into()).stack_size(64 << 10).spawn(watch);
        started.ok().map(|handle| handle.thread().clone())
    });
    // Loaded first: a line that is only read stays in every core's cache.
    if !LOOKED.load(Ordering::Relaxed) {
        LOOKED.store(true, Ordering::SeqCst);
        if ASLEEP.swap(false, Ordering::SeqCst) {
            // The watcher's last number is outdated.
            IN_USE.store(ask().unwrap_or(0), Ordering::Relaxed);
            watcher.iter().for_each(Thread::unpark);
        }
    }
    IN_USE.load(Ordering::Relaxed)
}

fn watch() {
    let mut unwatched = 0;
    while let Some(now) = ask() {
        IN_USE.store(now, Ordering::Relaxed);
        std::thread::sleep(EVERY);
        unwatched = if LOOKED.swap(false, Ordering::SeqCst) { 0 } else { unwatched + 1 };
        if unwatched < UNWATCHED {
            continue;
        }
        ASLEEP.store(true, Ordering::SeqCst);
        // A thread that looked between the two has not seen that it sleeps.
        while ASLEEP.load(Ordering::SeqCst) && !LOOKED.load(Ordering::SeqCst) {
            std::thread::park();
        }
        ASLEEP.store(false, Ordering::SeqCst);
        unwatched = 0;
    }
}

/// Asks the system for the memory in use, where that costs little (Linux).
fn ask() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    let pages: u64 = text.split(' ').nth(1)?.parse().ok()?;
    // 4 KiB is the smallest page: where pages are larger, the limit comes late rather than early.
    Some(pages * 4096)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_that_is_taken_is_seen_also_after_a_sleep() {
        if in_use() == 0 {
            println!("SKIP 1: this system does not tell how much memory is in use");
            return;
        }
        // Compared with nothing that other tests of this process hold: with these bytes in memory it is never less.
        const TAKEN: u64 = 200 << 20;
        for _ in 0..2 {
            std::thread::sleep(EVERY * (UNWATCHED + 20));
            let taken = vec![1u8; TAKEN as usize];
            while in_use() < TAKEN {
                std::thread::sleep(EVERY);
            }
            assert_eq!(taken[taken.len() - 1], 1);
            drop(taken);
            while in_use() >= TAKEN {
                std::thread::sleep(EVERY);
            }
        }
    }
}
