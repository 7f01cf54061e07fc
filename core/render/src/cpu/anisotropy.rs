//! Anisotropy: stretched highlights, as of brushed metal. CPU reference of `ANISOTROPY` in scene.wgsl.

use super::brdf::Anisotropy;
use super::shade::{Fragment, Quad};
use crate::lanes::{F4, V3};
use crate::plan::Features;
use choreo_asset::MaterialLayers;

impl Fragment<'_> {
    /// KHR_materials_anisotropy: stretch directions, alphas, and the direction of the sky's reflection ("Bent normal" of its
    /// notes).
    pub fn anisotropy(
        &self,
        quad: &Quad,
        layers: &MaterialLayers,
        roughness: F4,
        (n, v): (V3, V3),
    ) -> (Anisotropy, V3) {
        let [tangent, bitangent, _] = quad.frame();
        let (mut x, mut y, mut strength) = (F4::ONE, F4::ZERO, F4::splat(layers.anisotropy));
        if let Some([r, g, b, _]) = self.texel(quad, Features::ANISOTROPY_TEXTURE) {
            (x, y) = (r * 2.0 - F4::ONE, g * 2.0 - F4::ONE);
            strength *= b;
        }
        let (c, s) = (libm::cosf(layers.anisotropy_rotation), libm::sinf(layers.anisotropy_rotation));
        let (x, y) = (x * c - y * s, x * s + y * c);
        let along = (tangent * x + bitangent * y).unit();
        let across = n.cross(along).unit();
        let alpha_across = roughness * roughness;
        let alpha_along = alpha_across.mix(F4::ONE, strength * strength);
        let fan = across.cross(v).cross(across).unit();
        let straight = F4::ONE - strength * (F4::ONE - roughness);
        let straight2 = straight * straight;
        let bent = fan.mix(n, straight2 * straight2).unit();
        let mirror = bent * (bent.dot(v) * 2.0) - v;
        (Anisotropy { along, across, alpha_along, alpha_across }, mirror)
    }
}
