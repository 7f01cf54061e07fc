//! What is computed from an asset once, when first asked for, and then shared by every actor cast from it.

use crate::places::Range;
use crate::{Aabb, Asset, InstanceBounds};
use choreo_motion::{Pose, Skeleton};
use glam::Affine3A;
use std::sync::OnceLock;

/// Caches of one [`Asset`]. A clone starts empty, so an asset changed through `Arc::make_mut` never shows stale values;
/// whoever changes an asset in place after asking for its bounds must reset this field.
#[derive(Default)]
pub struct Derived {
    rest_pose: OnceLock<Pose>,
    rest_model_from_joint: OnceLock<Vec<Affine3A>>,
    instance_bounds: OnceLock<Vec<InstanceBounds>>,
    rest_bounds: OnceLock<Aabb>,
    range_of_places: OnceLock<Option<Range>>,
    content_hash: OnceLock<[u8; 32]>,
}

impl Derived {
    pub(crate) fn range_of_places(&self, find: impl FnOnce() -> Option<Range>) -> Option<Range> {
        *self.range_of_places.get_or_init(find)
    }
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

impl Asset {
    /// The skeleton's rest pose.
    pub fn rest_pose(&self) -> &Pose {
        self.derived.rest_pose.get_or_init(|| Pose::rest(&self.skeleton))
    }

    /// model-from-joint of every joint in rest pose.
    pub fn rest_model_from_joint(&self) -> &[Affine3A] {
        self.derived.rest_model_from_joint.get_or_init(|| model_from_rest(&self.skeleton))
    }

    /// How far each mesh instance reaches from the joints that move it; see [`InstanceBounds::posed`].
    pub fn instance_bounds(&self) -> &[InstanceBounds] {
        self.derived.instance_bounds.get_or_init(|| InstanceBounds::of_asset(self))
    }

    /// Tight box of all vertices in rest pose, in model space, without morphs; empty where there is no mesh.
    pub fn rest_bounds(&self) -> Aabb {
        *self.derived.rest_bounds.get_or_init(|| crate::bounds::rest_bounds(self))
    }

    /// BLAKE3 of everything an actor takes from the asset: tree, meshes, skins, materials, images, cameras, lights, clips.
    pub fn content_hash(&self) -> [u8; 32] {
        *self.derived.content_hash.get_or_init(|| crate::hash::asset_hash(self))
    }
}

fn model_from_rest(skeleton: &Skeleton) -> Vec<Affine3A> {
    let mut model_from_joint: Vec<Affine3A> = Vec::with_capacity(skeleton.len());
    for (parent, rest) in skeleton.parents().iter().zip(skeleton.rest()) {
        let local = rest.to_affine();
        model_from_joint.push(match parent {
            Some(parent) => model_from_joint[*parent as usize] * local,
            None => local,
        });
    }
    model_from_joint
}
