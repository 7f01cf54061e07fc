//! What polished surfaces of Blinn–Phong and Phong shading mirror: the classic reflection map.

use crate::{Material, Sampler, Shading, TextureRef, Wrap};
use glam::Vec3;

/// What a surface mirrors of its surroundings.
#[derive(Clone, Debug, PartialEq)]
pub struct Reflection {
    /// Linear share that is mirrored, 0 to 1 each; the diffuse colour keeps the rest.
    pub color: Vec3,
    /// Multiplied with it; sRGB, as the specular map of these materials is.
    pub texture: Option<TextureRef>,
    /// Mirrored in place of the sky: an equirectangular panorama, sRGB, looked up by the direction in the world (−Z in the
    /// picture's middle, +Y at its top) rather than by texture coordinates.
    pub environment: Option<TextureRef>,
}

impl Reflection {
    /// How the ends of a panorama meet: its sides are one line, its top and bottom are not.
    pub fn panorama_sampler() -> Sampler {
        Sampler { wrap_u: Wrap::Repeat, wrap_v: Wrap::ClampToEdge, ..Sampler::default() }
    }
}

impl Material {
    /// What it mirrors, where its shading has that at all and something is seen of it.
    pub fn mirrors(&self) -> Option<&Reflection> {
        let phong = matches!(self.shading, Shading::BlinnPhong | Shading::Phong);
        self.reflection.as_deref().filter(|r| phong && r.color.max_element() > 0.0)
    }

    /// Roughness (the square root of GGX's α) of a mirror as sharp as its highlight is. Of Blinn–Phong α² = 2 / (s + 2) (Walter
    /// et al. 2007, "Microfacet Models for Refraction through Rough Surfaces", 5.2); Phong's lobe is as wide as Blinn's with four
    /// times the exponent (Fisher & Woo 1994, "R.E versus N.H Specular Highlights", Graphics Gems IV).
    pub fn mirror_roughness(&self) -> f32 {
        let times = if self.shading == Shading::Phong { 4.0 } else { 1.0 };
        (2.0 / (self.shininess.max(0.0) * times + 2.0)).sqrt().sqrt()
    }
}
