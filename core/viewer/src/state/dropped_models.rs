//! Models that are to be added to the scene: dropped on a viewport, or chosen in the asset browser.

use glam::DVec3;
use std::path::PathBuf;

/// Model files to be added, and their position, kept until the files have been read.
#[derive(Clone, Debug, PartialEq)]
pub struct DroppedModels {
    pub files: Vec<PathBuf>,
    /// World position, metres.
    pub at: DVec3,
    /// Whether the models stand at the nearest free positions to `at`, and not at `at` itself.
    pub beside: bool,
}
