//! What is drawn, before it is sorted into draws.

use crate::catalog::PrimitiveEntry;
use crate::plan::{Instance, PipelineKey};

/// One copy of one primitive before sorting.
pub(crate) struct Item {
    pub phase: Phase,
    pub pipeline: PipelineKey,
    pub entry: PrimitiveEntry,
    /// Of the plan's changed materials.
    pub changed: Option<u32>,
    /// Metres in front of the camera.
    pub depth: f32,
    /// The smallest depth among the copies that share its draw.
    pub nearest: f32,
    /// As [`crate::plan::Draw::closed`].
    pub closed: u32,
    pub instance: Instance,
    pub actor: u32,
    /// Of what is seen through: place among the planner's boxes.
    pub seen_through: Option<u32>,
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Phase {
    Opaque,
    Mask,
    Blend,
}
