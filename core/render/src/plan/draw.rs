//! Draw calls of a plan.

use crate::plan::PipelineKey;

/// Instances of one primitive with one material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Draw {
    pub pipeline: PipelineKey,
    /// Index into `SceneResources::primitives`.
    pub primitive: u32,
    /// Index into `SceneResources::materials`.
    pub material: u32,
    /// Index into `Plan::material_overrides`, if the material is overridden in this frame.
    pub material_override: Option<u32>,
    /// Number of indices of watertight surfaces (sorted first by `crate::scene_resources::watertight`), whose back faces are
    /// culled although the material is double-sided.
    pub watertight: u32,
    /// Whether the draw goes into the G-buffer if [`crate::plan::Plan::deferred`] is set.
    pub deferred: bool,
    /// Range of `Plan::instances`.
    pub first_instance: u32,
    pub instance_count: u32,
}
