//! Scene color copy: the image as drawn so far, which refracting surfaces sample (screen-space refraction).

/// The copy for refraction, made before the first refracting surface is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneColorCopy {
    /// Number of mip levels: enough for the blur of the roughest refracting surface in view.
    pub levels: u32,
}

/// Roughness that blurs refracted light: none at an index of refraction of 1, all of it from 1.5 on (glTF-Sample-Viewer,
/// `applyIorToRoughness`). Multiplied by log₂ of the image's height it is the mip level.
pub(crate) fn blur(roughness: f32, ior: f32) -> f32 {
    roughness * (2.0 * ior - 2.0).clamp(0.0, 1.0)
}
