//! What is drawn at once.

use crate::plan::PipelineKey;

/// Copies of one primitive with one material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Draw {
    pub pipeline: PipelineKey,
    /// Catalogue ids.
    pub primitive: u32,
    pub material: u32,
    /// Index into `Plan::materials` where the material is not as in the catalogue.
    pub changed: Option<u32>,
    /// So many indices, of those that [`crate::scene_resources::watertight`] puts first, belong to bodies whose back faces are not seen.
    pub closed: u32,
    /// Drawn without light, and lit with all others where [`crate::Plan::deferred`] is some.
    pub deferred: bool,
    /// Range of `Plan::instances`.
    pub first_instance: u32,
    pub instance_count: u32,
}
