//! Imports of truncated files and of files with flipped bits: no panic, bounded memory, an error with a place or a valid asset.

use crate::{Companions, asset_rules, import, source};
use choreo_plugin::{Files, ImportScope, Importer};
use std::time::Instant;

/// Number of bit flips: 100, or `$CHOREO_FLIPS`.
pub fn flips() -> usize {
    std::env::var("CHOREO_FLIPS").ok().and_then(|n| n.parse().ok()).unwrap_or(100)
}

/// Next number of a SplitMix64 generator: the same bits are flipped in every run.
pub fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Results of the variants of one damaged file.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    pub refused: usize,
    pub read: usize,
    /// Processor time of the slowest import, seconds.
    pub slowest_secs: f64,
}

/// Damages each file, given as (name, bytes, flips), all in one separate process. Of each file, some variants must be refused and some
/// read.
pub fn run_cases(importer: &dyn Importer, cases: impl FnOnce() -> Vec<(&'static str, Vec<u8>, usize)>) {
    if crate::own_process::ran_in_own_process() {
        return;
    }
    for (name, bytes, flips) in cases() {
        let outcome = run(importer, name, &bytes, flips);
        assert!(outcome.refused > 0 && outcome.read > 0, "{name}: {outcome:?}");
    }
}

/// Runs [`run_slice`] with 50 cuts and no further files.
pub fn run(importer: &dyn Importer, name: &str, bytes: &[u8], flips: usize) -> Outcome {
    run_slice(importer, name, bytes, &Companions::none(), 50, flips)
}

/// Largest processor time of one import, seconds: far beyond that of any import, so that only an endless one reaches it, on any machine.
const MAX_SECS: f64 = 30.0;

/// Truncates the file at `cuts` places and flips `flips` pseudo-random bits, one at a time. Panics with the name and the place if an error
/// has no place, if an import computes for more than half a minute, or if all of it takes more memory at once than 16 times the file and 64
/// MiB: the test begins with [`crate::own_process::ran_in_own_process`]. The files of `beside` are not damaged.
pub fn run_slice(
    importer: &dyn Importer,
    name: &str,
    bytes: &[u8],
    beside: &dyn Files,
    cuts: usize,
    flips: usize,
) -> Outcome {
    let mut outcome = Outcome::default();
    let memory = Memory::start();
    let mut import_damaged = |how: &str, damaged: Vec<u8>| {
        let (start, computed) = (Instant::now(), thread_cpu_secs());
        let result = import(importer, &source(name, damaged), beside, ImportScope::ALL);
        let wall = start.elapsed().as_secs_f64();
        let secs = thread_cpu_secs().zip(computed).map_or(wall, |(after, before)| after - before);
        outcome.slowest_secs = outcome.slowest_secs.max(secs);
        assert!(secs < MAX_SECS, "{name} {how}: {secs:.1} s");
        match result {
            Ok(asset) => {
                asset_rules::check(&format!("{name} {how}"), &asset);
                outcome.read += 1;
            }
            Err(e) => {
                assert!(!e.what.is_empty() && !e.place.is_empty() && e.file == name, "{name} {how}: {e:?}");
                outcome.refused += 1;
            }
        }
    };
    for cut in 0..cuts {
        let length = bytes.len() * cut / cuts;
        import_damaged(&format!("cut at {length}"), bytes[..length].to_vec());
    }
    let mut state = bytes.len() as u64;
    for flip in 0..flips {
        let mut copy = bytes.to_vec();
        // Half of the flips in the head, where the structure of most formats is.
        let range = if flip % 2 == 0 { copy.len() } else { copy.len().min(4_000) } as u64;
        let bit = random(&mut state) % (range * 8);
        copy[(bit / 8) as usize] ^= 1 << (bit % 8);
        import_damaged(&format!("bit {bit}"), copy);
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

/// Processor time of this thread so far, seconds (Linux), which unlike the clock does not depend on the load.
fn thread_cpu_secs() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(text.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9)
}

/// The process's greatest resident memory since the start (Linux). Other tests of the process would count, too, so the caller begins with
/// [`crate::own_process::ran_in_own_process`].
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
