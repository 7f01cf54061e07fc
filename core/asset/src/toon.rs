//! Toon shading: the parameters of MToon, VRM's own look (`VRMC_materials_mtoon` 1.0; 0.x is converted to it).

use crate::texture::TextureRef;
use glam::{Vec2, Vec3};

/// Parameters of [`crate::material::Shading::Toon`] beside a material's base color, normal map, emission and alpha. Colors are linear.
/// Defaults are those of `VRMC_materials_mtoon`.
#[derive(Clone, Debug, PartialEq)]
pub struct Toon {
    /// Color where no light falls, times light all the same.
    pub shade_color: Vec3,
    /// sRGB, multiplied into it.
    pub shade_texture: Option<TextureRef>,
    /// Moves the boundary between lit and shade: added to the cosine between normal and light, −1..=1.
    pub shading_shift: f32,
    /// R, linear, times `shading_shift_scale`: added to it.
    pub shading_shift_texture: Option<TextureRef>,
    /// Factor of the shading shift texture.
    pub shading_shift_scale: f32,
    /// How sharp the boundary is, 0 (as wide as the whole ball) to 1 (a line).
    pub shading_toony: f32,
    /// 0: ambient light as elsewhere, 1: the same from all sides.
    pub gi_equalization: f32,
    /// Factor of the matcap texture; no effect without one.
    pub matcap: Vec3,
    /// sRGB, an image of a lit ball looked up by the normal as the camera sees it.
    pub matcap_texture: Option<TextureRef>,
    /// Linear color of the rim light.
    pub rim_color: Vec3,
    /// Exponent of the rim: larger is narrower.
    pub rim_fresnel_power: f32,
    /// Added to the rim before its exponent.
    pub rim_lift: f32,
    /// sRGB, multiplied into rim and matcap.
    pub rim_texture: Option<TextureRef>,
    /// How much light falls on the rim: 0, it glows by itself; 1, it is lit.
    pub rim_lighting_mix: f32,
    /// `None`: no outline.
    pub outline: Option<Outline>,
    /// Textures, the matcap aside, that move by themselves.
    pub uv_motion: Option<UvMotion>,
    /// B, linear: how much of the motion each place makes.
    pub uv_mask: Option<TextureRef>,
    /// How far a masked motion has come at the time of a frame: textures, and radians; zero at rest.
    pub uv_moved: Vec3,
}

/// Texture coordinates that move with the time, about the texture's middle (MToon, "UV animation").
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvMotion {
    /// Textures a second.
    pub scroll: Vec2,
    /// Radians a second.
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
    /// All its textures.
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

/// A hull around the surface, of which the inside is seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// Metres, or a share of the image's height.
    pub width: f32,
    /// Width is a share of the image's height, rather than metres.
    pub on_screen: bool,
    /// G, linear, times the width.
    pub width_texture: Option<TextureRef>,
    /// Linear color.
    pub color: Vec3,
    /// 0: as it is, 1: times the surface's light.
    pub lighting_mix: f32,
}
