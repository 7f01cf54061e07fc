//! How much memory the program has in use, asked for by a thread of its own, so that looking costs one load.

use std::sync::Once;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

static IN_USE: AtomicU64 = AtomicU64::new(0);

/// Between two looks a program writes a few megabytes at most.
const EVERY: Duration = Duration::from_millis(5);

/// Bytes in use a few milliseconds ago; 0 where the system does not tell.
pub fn in_use() -> u64 {
    static WATCHER: Once = Once::new();
    WATCHER.call_once(|| {
        let Some(now) = ask() else { return };
        IN_USE.store(now, Ordering::Relaxed);
        // Without the thread the first answer stays: no limit is better than no script.
        let _ = std::thread::Builder::new().name("memory".into()).stack_size(64 << 10).spawn(|| {
            while let Some(now) = ask() {
                IN_USE.store(now, Ordering::Relaxed);
                std::thread::sleep(EVERY);
            }
        });
    });
    IN_USE.load(Ordering::Relaxed)
}

/// Where the system tells at little cost (Linux).
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
    fn memory_that_is_taken_is_seen() {
        let before = in_use();
        if before == 0 {
            println!("SKIP 1: this system does not tell how much memory is in use");
            return;
        }
        let taken = vec![1u8; 200 << 20];
        while in_use() < before + (100 << 20) {
            std::thread::sleep(EVERY);
        }
        assert_eq!(taken[taken.len() - 1], 1);
    }
}
