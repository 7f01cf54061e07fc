//! Wall-clock time of the CPU renderer's stages, summed over frames.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// A stage of a frame. All threads work on one stage before the next begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    ShadowMaps,
    Vertices,
    Pixels,
    ImageEffects,
    Layers2d,
}

const STAGE_NAMES: [(Stage, &str); 5] = [
    (Stage::ShadowMaps, "shadow maps"),
    (Stage::Vertices, "vertices"),
    (Stage::Pixels, "pixels"),
    (Stage::ImageEffects, "image effects"),
    (Stage::Layers2d, "2D layers"),
];

#[derive(Debug, Default)]
pub struct StageTimes {
    nanoseconds: [AtomicU64; STAGE_NAMES.len()],
    frames: AtomicU64,
    shadow_maps: AtomicU64,
}

impl StageTimes {
    /// Runs a function and adds its time to a stage.
    pub(super) fn measure<T>(&self, stage: Stage, run: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = run();
        let elapsed = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.nanoseconds[stage as usize].fetch_add(elapsed, Ordering::Relaxed);
        result
    }

    pub(super) fn count_frame(&self) {
        self.frames.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn count_shadow_map(&self) {
        self.shadow_maps.fetch_add(1, Ordering::Relaxed);
    }

    /// Number of shadow maps drawn so far, without the maps kept from the previous frame.
    pub fn shadow_maps(&self) -> u64 {
        self.shadow_maps.load(Ordering::Relaxed)
    }

    /// Frames drawn so far, and name and seconds of each stage.
    pub fn total(&self) -> (u64, [(&'static str, f64); STAGE_NAMES.len()]) {
        let secs = |stage: Stage| self.nanoseconds[stage as usize].load(Ordering::Relaxed) as f64 * 1e-9;
        (self.frames.load(Ordering::Relaxed), STAGE_NAMES.map(|(stage, name)| (name, secs(stage))))
    }
}
