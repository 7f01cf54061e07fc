//! Shadow maps of a frame: all lie in one depth image.

use crate::plan::Draw;
use glam::Mat4;

/// The widest penumbra in texels; shaders/shadow.wgsl has the same constant.
pub(crate) const MAX_PENUMBRA: f32 = 12.0;

#[derive(Clone, Debug, PartialEq)]
pub struct ShadowMaps {
    /// Size in texels of the image that all maps share: powers of two, so that it rarely changes.
    pub image: [u32; 2],
    /// Used part of the image, in texels.
    pub size: [u32; 2],
    /// Views, those of one light adjacent; the cascades of a directional light are sorted from fine to coarse.
    pub views: Vec<ShadowView>,
}

/// One shadow map: its view and its draws.
#[derive(Clone, Debug, PartialEq)]
pub struct ShadowView {
    /// Index into `Plan::lights`.
    pub light: u32,
    /// First texel in the image.
    pub at: [u32; 2],
    /// Texels.
    pub size: [u32; 2],
    /// Light's clip space with reversed Z, as the camera's: greater is nearer to the light.
    pub clip_from_relative: Mat4,
    /// Size of a texel in metres where clip w is 1.
    pub texel: f32,
    /// Penumbra width in texels per unit of depth between caster and receiver; 0: fixed width.
    pub penumbra: f32,
    pub draws: Vec<Draw>,
}
