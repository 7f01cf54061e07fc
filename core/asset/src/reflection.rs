//! The classic reflection map of polished surfaces with Blinn–Phong and Phong shading.

use crate::texture::{Sampler, TextureRef, Wrap};
use glam::Vec3;

/// Reflection of a surface's surroundings.
#[derive(Clone, Debug, PartialEq)]
pub struct Reflection {
    /// Reflected share of each color channel, linear, 0 to 1; the diffuse color keeps the rest.
    pub color: Vec3,
    /// Texture multiplied with the color; sRGB, as the specular map of these materials is.
    pub texture: Option<TextureRef>,
    /// Environment that is mirrored in place of the sky: an equirectangular panorama, sRGB, looked up by the direction in the
    /// world (−Z in the image's middle, +Y at its top) rather than by texture coordinates.
    pub environment: Option<TextureRef>,
}

impl Reflection {
    /// Sampler of a panorama: it repeats horizontally and is clamped at top and bottom.
    pub fn panorama_sampler() -> Sampler {
        Sampler { wrap_u: Wrap::Repeat, wrap_v: Wrap::ClampToEdge, ..Sampler::default() }
    }
}
