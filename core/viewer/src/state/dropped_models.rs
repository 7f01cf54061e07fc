//! Models that are put on stage.

use glam::DVec3;
use std::path::PathBuf;

/// Model files that are put on stage, and where, until they have been read.
#[derive(Clone, Debug, PartialEq)]
pub struct DroppedModels {
    pub files: Vec<PathBuf>,
    /// World, metres.
    pub at: DVec3,
    /// They take the next free place beside `at`, rather than that place itself.
    pub beside: bool,
}
