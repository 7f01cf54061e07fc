//! The memory that the process has in use. A watcher thread measures it, so that a query costs two atomic loads. The thread
//! sleeps while nobody queries, so that a viewer of a still image costs nothing.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::Thread;
use std::time::Duration;

static IN_USE: AtomicU64 = AtomicU64::new(0);
/// Set by a query since the last measurement.
static QUERIED: AtomicBool = AtomicBool::new(false);
static ASLEEP: AtomicBool = AtomicBool::new(false);

/// Interval between two measurements: short enough that a program writes only a few megabytes in it.
const MEASUREMENT_INTERVAL: Duration = Duration::from_millis(5);
/// Number of measurements without a query after which the thread goes to sleep.
const MAX_IDLE_MEASUREMENTS: u32 = 20;

/// Resident bytes of the process a few milliseconds ago; 0 where the system does not report them.
pub fn in_use() -> u64 {
    static WATCHER: OnceLock<Option<Thread>> = OnceLock::new();
    let watcher = WATCHER.get_or_init(|| {
        IN_USE.store(resident_bytes()?, Ordering::Relaxed);
        // If the thread cannot start, the first measurement is kept: a script without this limit is better than none.
        let started = std::thread::Builder::new().name("memory".into()).stack_size(64 << 10).spawn(watch);
        started.ok().map(|handle| handle.thread().clone())
    });
    // The flag is loaded before it is stored: a cache line that is only read stays in the cache of every core.
    if !QUERIED.load(Ordering::Relaxed) {
        QUERIED.store(true, Ordering::SeqCst);
        if ASLEEP.swap(false, Ordering::SeqCst) {
            // The watcher's last number is outdated.
            IN_USE.store(resident_bytes().unwrap_or(0), Ordering::Relaxed);
            watcher.iter().for_each(Thread::unpark);
        }
    }
    IN_USE.load(Ordering::Relaxed)
}

fn watch() {
    let mut idle = 0;
    while let Some(now) = resident_bytes() {
        IN_USE.store(now, Ordering::Relaxed);
        std::thread::sleep(MEASUREMENT_INTERVAL);
        idle = if QUERIED.swap(false, Ordering::SeqCst) { 0 } else { idle + 1 };
        if idle < MAX_IDLE_MEASUREMENTS {
            continue;
        }
        ASLEEP.store(true, Ordering::SeqCst);
        // A query before the store of `ASLEEP` does not wake this thread, so `QUERIED` is checked as well.
        while ASLEEP.load(Ordering::SeqCst) && !QUERIED.load(Ordering::SeqCst) {
            std::thread::park();
        }
        ASLEEP.store(false, Ordering::SeqCst);
        idle = 0;
    }
}

/// Reads the resident memory from the system, in bytes. `None` where that is not possible at little cost (all but Linux).
fn resident_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    let pages: u64 = text.split(' ').nth(1)?.parse().ok()?;
    // 4 KiB is the smallest page size. Where pages are larger, the result is too low, so that a limit is noticed late rather than
    // early.
    Some(pages * 4096)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn allocated_memory_is_measured_before_and_after_a_sleep() {
        if in_use() == 0 {
            println!("SKIP 1: this system does not report how much memory is in use");
            return;
        }
        // Other tests of this process may hold memory, too; with these bytes in memory the total is never less.
        const ALLOCATED_BYTES: u64 = 200 << 20;
        for _ in 0..2 {
            std::thread::sleep(MEASUREMENT_INTERVAL * (MAX_IDLE_MEASUREMENTS + 20));
            let taken = vec![1u8; ALLOCATED_BYTES as usize];
            while in_use() < ALLOCATED_BYTES {
                std::thread::sleep(MEASUREMENT_INTERVAL);
            }
            assert_eq!(taken[taken.len() - 1], 1);
            drop(taken);
            while in_use() >= ALLOCATED_BYTES {
                std::thread::sleep(MEASUREMENT_INTERVAL);
            }
        }
    }
}
