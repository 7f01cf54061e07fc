//! Deferred shading: the cause, and the features of its lighting pass.

use crate::plan::Features;

/// Opaque surfaces are drawn into a G-buffer (shaders/deferred.wgsl), then every pixel is lit once. Surfaces that the G-buffer
/// cannot describe are shaded forward afterwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deferred {
    pub cause: DeferredCause,
    /// Features of the lighting pass, for all deferred surfaces together.
    pub features: Features,
    /// Bits of the effects in `Plan::scene_effects` that all deferred surfaces have in common.
    pub surface: u8,
}

/// Why shading is deferred.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DeferredCause {
    /// The stage requests deferred shading.
    Requested,
    /// Deferred shading is estimated to be faster. Means over the covered part of the frame: light evaluations per shaded
    /// surface, overlapping surfaces, and light evaluations per pixel that forward shading would waste on hidden surfaces.
    Pays { lights: f32, surfaces: f32, wasted: f32 },
}
