//! Toon shading: the parameters of MToon, VRM's toon shader (`VRMC_materials_mtoon` 1.0; 0.x is converted to it).

use crate::texture::TextureRef;
use glam::{Vec2, Vec3};

/// Parameters of [`crate::material::Shading::Toon`] beside a material's base color, normal map, emission and alpha. Colors are linear.
/// Defaults are those of `VRMC_materials_mtoon`.
#[derive(Clone, Debug, PartialEq)]
pub struct Toon {
    /// Color of the shaded side; it is multiplied by the light, too.
    pub shade_color: Vec3,
    /// Texture multiplied with the shade color, sRGB.
    pub shade_texture: Option<TextureRef>,
    /// Moves the boundary between lit and shade: added to the cosine between normal and light, −1..=1.
    pub shading_shift: f32,
    /// Texture whose R (linear), times `shading_shift_scale`, is added to `shading_shift`.
    pub shading_shift_texture: Option<TextureRef>,
    /// Factor of the shading shift texture.
    pub shading_shift_scale: f32,
    /// Sharpness of the boundary: 0 (a gradient over the whole sphere) to 1 (a line).
    pub shading_toony: f32,
    /// Equalization of ambient light: 0, it depends on the normal as elsewhere; 1, it is the same from all sides.
    pub gi_equalization: f32,
    /// Factor of the matcap texture; no effect without one.
    pub matcap: Vec3,
    /// Matcap, sRGB: an image of a lit sphere, looked up by the normal in view space.
    pub matcap_texture: Option<TextureRef>,
    /// Linear color of the rim light.
    pub rim_color: Vec3,
    /// Exponent of the rim: larger is narrower.
    pub rim_fresnel_power: f32,
    /// Value that is added to the rim term before the exponent is applied.
    pub rim_lift: f32,
    /// Texture multiplied with rim and matcap, sRGB.
    pub rim_texture: Option<TextureRef>,
    /// Effect of lights on the rim: 0, it glows independently of them; 1, it is lit.
    pub rim_lighting_mix: f32,
    /// Inverted-hull outline; `None`: no outline.
    pub outline: Option<Outline>,
    /// UV animation of all textures except the matcap.
    pub uv_motion: Option<UvMotion>,
    /// Mask of the UV animation: B, linear, scales the motion.
    pub uv_mask: Option<TextureRef>,
    /// Progress of a masked UV animation at the time of a frame: scroll in texture widths, then rotation in radians; zero at
    /// rest.
    pub uv_moved: Vec3,
}

/// Scrolling and rotation of texture coordinates over time, about the texture's center (MToon, "UV animation").
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvMotion {
    /// Scroll velocity, texture widths and heights per second.
    pub scroll: Vec2,
    /// Angular velocity, radians per second.
    pub rotation: f32,
}

impl Default for Toon {
    fn default() -> Self {
        Toon {
            shade_color: Vec3::ZERO,
            shade_texture: None,
            shading_shift: 0.0,
            shading_shift_texture: None,
            shading_shift_scale: 1.0,
            shading_toony: 0.9,
            gi_equalization: 0.9,
            matcap: Vec3::ONE,
            matcap_texture: None,
            rim_color: Vec3::ZERO,
            rim_fresnel_power: 5.0,
            rim_lift: 0.0,
            rim_texture: None,
            rim_lighting_mix: 1.0,
            outline: None,
            uv_motion: None,
            uv_mask: None,
            uv_moved: Vec3::ZERO,
        }
    }
}

impl Toon {
    /// All textures, with `None` for missing ones.
    pub fn textures(&self) -> [&Option<TextureRef>; 6] {
        let width = self.outline.as_ref().map_or(&None, |o| &o.width_texture);
        [
            &self.shade_texture,
            &self.shading_shift_texture,
            &self.matcap_texture,
            &self.rim_texture,
            width,
            &self.uv_mask,
        ]
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        let numbers = [
            self.shading_shift,
            self.shading_shift_scale,
            self.shading_toony,
            self.gi_equalization,
            self.rim_fresnel_power,
            self.rim_lift,
            self.rim_lighting_mix,
        ];
        let outline = self
            .outline
            .as_ref()
            .is_none_or(|o| o.width.is_finite() && o.color.is_finite() && o.lighting_mix.is_finite());
        let moves = self.uv_motion.is_none_or(|m| m.scroll.is_finite() && m.rotation.is_finite());
        moves
            && numbers.iter().all(|v| v.is_finite())
            && self.shade_color.is_finite()
            && self.matcap.is_finite()
            && self.rim_color.is_finite()
            && outline
    }
}

/// Inverted-hull outline: an expanded copy of the surface, of which only the inside is drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// Width in metres, or as a share of the image's height if `on_screen`.
    pub width: f32,
    /// Whether `width` is a share of the image's height rather than metres.
    pub on_screen: bool,
    /// Texture whose G (linear) multiplies the width.
    pub width_texture: Option<TextureRef>,
    /// Linear color.
    pub color: Vec3,
    /// Effect of light on the outline: 0, the plain color; 1, the color times the surface's light.
    pub lighting_mix: f32,
}
