//! Wall-clock time of the CPU renderer's stages, added up over frames.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// A stage of a frame; each is spread over all threads before the next begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    ShadowMaps,
    Vertices,
    Pixels,
    ImageEffects,
    Layers2d,
}

const STAGES: [(Stage, &str); 5] = [
    (Stage::ShadowMaps, "shadow maps"),
    (Stage::Vertices, "vertices"),
    (Stage::Pixels, "pixels"),
    (Stage::ImageEffects, "image effects"),
    (Stage::Layers2d, "2D layers"),
];

#[derive(Debug, Default)]
pub struct StageTimes {
    nanoseconds: [AtomicU64; STAGES.len()],
    frames: AtomicU64,
    shadow_maps: AtomicU64,
}

impl StageTimes {
    pub(super) fn measure<T>(&self, stage: Stage, run: impl FnOnce() -> T) -> T {
        let begun = Instant::now();
        let result = run();
        let took = u64::try_from(begun.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.nanoseconds[stage as usize].fetch_add(took, Ordering::Relaxed);
        result
    }

    pub(super) fn count_frame(&self) {
        self.frames.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn count_shadow_map(&self) {
        self.shadow_maps.fetch_add(1, Ordering::Relaxed);
    }

    /// Number of shadow maps drawn so far, without those kept from the frame before.
    pub fn shadow_maps(&self) -> u64 {
        self.shadow_maps.load(Ordering::Relaxed)
    }

    /// Frames drawn so far, and name and seconds of each stage.
    pub fn total(&self) -> (u64, [(&'static str, f64); STAGES.len()]) {
        let secs = |stage: Stage| self.nanoseconds[stage as usize].load(Ordering::Relaxed) as f64 * 1e-9;
        (self.frames.load(Ordering::Relaxed), STAGES.map(|(stage, name)| (name, secs(stage))))
    }
}
