//! Files cut off and with single bits turned over: no panic, bounded memory, an error with a place or a valid asset.

use crate::{import_bytes, sound};
use choreo_plugin::Importer;
use std::time::Instant;

/// Flips of an everyday run; `$CHOREO_FLIPS` asks for more.
pub fn flips() -> usize {
    std::env::var("CHOREO_FLIPS").ok().and_then(|n| n.parse().ok()).unwrap_or(100)
}

/// SplitMix64: the same places in every run.
pub fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// What came of one damaged file.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    pub refused: usize,
    pub read: usize,
    /// Seconds of the slowest import, for the table; no test depends on it.
    pub slowest_secs: f64,
}

/// Cuts the file at 50 places and turns over `flips` seeded bits, one at a time. Panics with the name and the place where an
/// error has none, or where the whole took more memory at once than 16 times the file and 64 MiB.
pub fn run(importer: &dyn Importer, name: &str, bytes: &[u8], flips: usize) -> Outcome {
    let mut outcome = Outcome::default();
    let memory = Memory::start();
    let mut one = |how: &str, damaged: Vec<u8>| {
        let start = Instant::now();
        let result = import_bytes(importer, name, damaged);
        outcome.slowest_secs = outcome.slowest_secs.max(start.elapsed().as_secs_f64());
        match result {
            Ok(asset) => {
                sound::check(&format!("{name} {how}"), &asset);
                outcome.read += 1;
            }
            Err(e) => {
                assert!(!e.what.is_empty() && !e.place.is_empty() && e.file == name, "{name} {how}: {e:?}");
                outcome.refused += 1;
            }
        }
    };
    for cut in 0..50 {
        let length = bytes.len() * cut / 50;
        one(&format!("cut at {length}"), bytes[..length].to_vec());
    }
    let mut state = bytes.len() as u64;
    for flip in 0..flips {
        let mut copy = bytes.to_vec();
        // Half of the flips in the head, where the structure of most formats is.
        let range = if flip % 2 == 0 { copy.len() } else { copy.len().min(4_000) } as u64;
        let bit = random(&mut state) % (range * 8);
        copy[(bit / 8) as usize] ^= 1 << (bit % 8);
        one(&format!("bit {bit}"), copy);
    }
    let allowed = 16 * bytes.len() as u64 + (64 << 20);
    if let Some(used) = memory.used() {
        println!(
            "{name}: {} refused, {} read, slowest {:.3} s, at most {} KiB",
            outcome.refused,
            outcome.read,
            outcome.slowest_secs,
            used >> 10
        );
        assert!(used <= allowed, "{name}: {used} bytes at once, {allowed} are allowed");
    }
    outcome
}

/// The process's greatest resident memory since the start (Linux; other tests of the same process count too).
struct Memory {
    before: Option<u64>,
}

impl Memory {
    fn start() -> Memory {
        // "5" resets the high-water mark (proc(5)).
        let _ = std::fs::write("/proc/self/clear_refs", "5");
        Memory { before: high_water() }
    }

    fn used(&self) -> Option<u64> {
        Some(high_water()?.saturating_sub(self.before?))
    }
}

fn high_water() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? << 10)
}
