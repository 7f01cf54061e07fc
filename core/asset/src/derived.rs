//! Data computed from an asset once, when first requested, and then shared by every actor cast from it.

use crate::bounds::{Aabb, AffineRange, InstanceBounds};
use crate::hash::ContentHash;
use choreo_motion::{Facing, Pose};
use glam::Affine3A;
use std::sync::OnceLock;

/// Caches of one `Asset`. A clone starts empty, so an asset changed through `Arc::make_mut` never shows stale values; code that
/// changes an asset in place after requesting its bounds must reset this field.
#[derive(Default)]
pub struct Derived {
    pub(crate) rest_pose: OnceLock<Pose>,
    pub(crate) rest_model_from_joint: OnceLock<Vec<Affine3A>>,
    pub(crate) instance_bounds: OnceLock<Vec<InstanceBounds>>,
    pub(crate) rest_bounds: OnceLock<Aabb>,
    pub(crate) range_of_placements: OnceLock<Option<AffineRange>>,
    pub(crate) facing: OnceLock<Facing>,
    pub(crate) content_hash: OnceLock<ContentHash>,
}

impl Clone for Derived {
    fn clone(&self) -> Self {
        Derived::default()
    }
}

impl std::fmt::Debug for Derived {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Derived")
    }
}
