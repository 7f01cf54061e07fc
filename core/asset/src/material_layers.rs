//! Layers over, in or behind a metallic-roughness surface (KHR_materials_clearcoat, _sheen, _transmission, _volume,
//! _ior, _dispersion).

use crate::texture::TextureRef;
use glam::Vec3;

/// Layers of a metallic-roughness material. Every layer is neutral by default: it changes nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialLayers {
    /// Share of the surface under a clear coat with index of refraction 1.5; multiplied by R of its texture.
    pub clearcoat: f32,
    /// Strength of the clear coat in red.
    pub clearcoat_texture: Option<TextureRef>,
    /// Roughness of the clear coat, multiplied by G of its texture.
    pub clearcoat_roughness: f32,
    /// Roughness of the clear coat in green.
    pub clearcoat_roughness_texture: Option<TextureRef>,
    /// The normal map of the coat alone; without it the coat is as smooth as the mesh, whatever normal map the surface below
    /// has.
    pub clearcoat_normal_texture: Option<TextureRef>,
    /// Factor of the clear coat's normal map.
    pub clearcoat_normal_scale: f32,
    /// Linear color of the fibers' sheen; black: none. Multiplied by RGB of its texture, sRGB.
    pub sheen_color: Vec3,
    /// Color of the sheen.
    pub sheen_color_texture: Option<TextureRef>,
    /// Roughness of the sheen, multiplied by A of its texture.
    pub sheen_roughness: f32,
    /// Roughness of the sheen in alpha.
    pub sheen_roughness_texture: Option<TextureRef>,
    /// Share of the light that is let through instead of scattered back; multiplied by R of its texture.
    pub transmission: f32,
    /// Share of transmitted light in red.
    pub transmission_texture: Option<TextureRef>,
    /// Thickness of the volume below the surface, metres in mesh space; 0: a thin wall. Multiplied by G of its texture.
    pub thickness: f32,
    /// Thickness in green.
    pub thickness_texture: Option<TextureRef>,
    /// Index of refraction. It displaces the background if there is a volume (`thickness` above 0); 1 refracts nothing.
    pub ior: f32,
    /// Dispersion, 20 ÷ Abbe number; 0: the colors of refracted light do not separate.
    pub dispersion: f32,
    /// Distance in metres after which white light has the attenuation color; infinite: clear.
    pub attenuation_distance: f32,
    /// Color that white light has after the attenuation distance, linear.
    pub attenuation_color: Vec3,
    /// Share of the surface under a thin film; multiplied by R of its texture.
    pub iridescence: f32,
    /// Strength of the iridescence in red.
    pub iridescence_texture: Option<TextureRef>,
    /// Index of refraction of the film.
    pub iridescence_ior: f32,
    /// Thickness of the film in nanometres where the texture's G is 0 and where it is 1; without a texture, the second applies.
    pub iridescence_thickness: [f32; 2],
    /// Thickness of the film in green.
    pub iridescence_thickness_texture: Option<TextureRef>,
    /// Strength of anisotropy, 0 to 1: highlights are stretched along a direction. RG of its texture is that direction, B
    /// multiplies the strength.
    pub anisotropy: f32,
    /// Rotation of that direction, radians from the tangent towards the bitangent.
    pub anisotropy_rotation: f32,
    /// Direction in red and green, strength in blue.
    pub anisotropy_texture: Option<TextureRef>,
    /// Share of the diffuse light that comes out on the other side; multiplied by A of its texture.
    pub diffuse_transmission: f32,
    /// Share of diffusely transmitted light in alpha.
    pub diffuse_transmission_texture: Option<TextureRef>,
    /// Color of diffusely transmitted light, linear; its texture is sRGB.
    pub diffuse_transmission_color: Vec3,
    /// Color of diffusely transmitted light.
    pub diffuse_transmission_color_texture: Option<TextureRef>,
}

impl Default for MaterialLayers {
    fn default() -> MaterialLayers {
        MaterialLayers {
            clearcoat: 0.0,
            clearcoat_texture: None,
            clearcoat_roughness: 0.0,
            clearcoat_roughness_texture: None,
            clearcoat_normal_texture: None,
            clearcoat_normal_scale: 1.0,
            sheen_color: Vec3::ZERO,
            sheen_color_texture: None,
            sheen_roughness: 0.0,
            sheen_roughness_texture: None,
            transmission: 0.0,
            transmission_texture: None,
            thickness: 0.0,
            thickness_texture: None,
            ior: 1.5,
            dispersion: 0.0,
            attenuation_distance: f32::INFINITY,
            attenuation_color: Vec3::ONE,
            iridescence: 0.0,
            iridescence_texture: None,
            iridescence_ior: 1.3,
            iridescence_thickness: [100.0, 400.0],
            iridescence_thickness_texture: None,
            anisotropy: 0.0,
            anisotropy_rotation: 0.0,
            anisotropy_texture: None,
            diffuse_transmission: 0.0,
            diffuse_transmission_texture: None,
            diffuse_transmission_color: Vec3::ONE,
            diffuse_transmission_color_texture: None,
        }
    }
}

impl MaterialLayers {
    /// All textures in the order of the fields.
    pub fn textures(&self) -> [&Option<TextureRef>; 12] {
        [
            &self.clearcoat_texture,
            &self.clearcoat_roughness_texture,
            &self.clearcoat_normal_texture,
            &self.sheen_color_texture,
            &self.sheen_roughness_texture,
            &self.transmission_texture,
            &self.thickness_texture,
            &self.iridescence_texture,
            &self.iridescence_thickness_texture,
            &self.anisotropy_texture,
            &self.diffuse_transmission_texture,
            &self.diffuse_transmission_color_texture,
        ]
    }

    /// Extinction coefficients per metre (Beer–Lambert law): −ln(color) ÷ distance. A color channel counts as at least 1e-6.
    pub fn extinction(&self) -> Vec3 {
        if !(self.attenuation_distance > 0.0 && self.attenuation_distance.is_finite()) {
            return Vec3::ZERO;
        }
        let lost = |c: f32| -libm::logf(c.clamp(1e-6, 1.0)) / self.attenuation_distance;
        let Vec3 { x, y, z } = self.attenuation_color;
        Vec3::new(lost(x), lost(y), lost(z)).min(Vec3::splat(1e6))
    }

    /// Whether the background is looked up where the refracted ray leaves the volume, rather than straight through.
    pub fn refracts(&self) -> bool {
        self.transmission > 0.0 && self.thickness > 0.0 && self.ior > 0.0 && self.ior != 1.0
    }

    /// Indices of refraction of red, green and blue (KHR_materials_dispersion, "Implementation"): blue is bent most.
    pub fn iors(&self) -> Vec3 {
        let half = (self.ior - 1.0) * 0.025 * self.dispersion;
        Vec3::new(self.ior - half, self.ior, self.ior + half).max(Vec3::splat(1e-3))
    }

    /// Whether the volume absorbs light.
    pub fn absorbs(&self) -> bool {
        (self.transmission > 0.0 || self.diffuse_transmission > 0.0)
            && self.thickness > 0.0
            && self.extinction() != Vec3::ZERO
    }
}
