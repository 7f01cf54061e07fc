//! Models that were dropped on the image.

use glam::DVec3;
use std::path::PathBuf;

/// Model files that were dropped on a viewport, and where, until they have been read.
#[derive(Clone, Debug, PartialEq)]
pub struct DroppedModels {
    pub files: Vec<PathBuf>,
    /// World, metres.
    pub at: DVec3,
}
