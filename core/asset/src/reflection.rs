//! The classic reflection map of polished surfaces with Blinn–Phong and Phong shading.

use crate::texture::{Sampler, TextureRef, Wrap};
use glam::Vec3;

/// Reflection of a surface's surroundings.
#[derive(Clone, Debug, PartialEq)]
pub struct Reflection {
    /// Linear share that is mirrored, 0 to 1 each; the diffuse color keeps the rest.
    pub color: Vec3,
    /// Texture multiplied with the color; sRGB, as the specular map of these materials is.
    pub texture: Option<TextureRef>,
    /// Mirrored in place of the sky: an equirectangular panorama, sRGB, looked up by the direction in the world (−Z in the
    /// image's middle, +Y at its top) rather than by texture coordinates.
    pub environment: Option<TextureRef>,
}

impl Reflection {
    /// How the ends of a panorama meet: its sides are one line, its top and bottom are not.
    pub fn panorama_sampler() -> Sampler {
        Sampler { wrap_u: Wrap::Repeat, wrap_v: Wrap::ClampToEdge, ..Sampler::default() }
    }
}
