//! Shadow maps of a frame: all lie in one depth image.

use crate::plan::Draw;
use glam::Mat4;

/// The widest penumbra in texels; shaders/shadow.wgsl has the same constant.
pub(crate) const MAX_PENUMBRA: f32 = 12.0;

#[derive(Clone, Debug, PartialEq)]
pub struct ShadowMaps {
    /// Texels of the image that all maps share: powers of two, so that it seldom changes.
    pub image: [u32; 2],
    /// Part of the image that the maps lie in.
    pub size: [u32; 2],
    /// The views of one light are adjacent; cascades of a directional light come with the finest first.
    pub views: Vec<ShadowView>,
}

/// One shadow map: what it shows and what is drawn into it.
#[derive(Clone, Debug, PartialEq)]
pub struct ShadowView {
    /// Index into `Plan::lights`.
    pub light: u32,
    /// First texel in the image.
    pub at: [u32; 2],
    /// Texels.
    pub size: [u32; 2],
    /// Reversed Z, as the camera's: greater is nearer to the light.
    pub clip_from_relative: Mat4,
    /// Size of a texel in metres where clip w is 1.
    pub texel: f32,
    /// Width of an edge in texels for each unit of depth between caster and receiver; 0: the same width everywhere.
    pub penumbra: f32,
    pub draws: Vec<Draw>,
}
