//! Anisotropy: stretched highlights, as on brushed metal. CPU reference of `ANISOTROPY` in scene.wgsl.

use super::brdf::Anisotropy;
use super::shade::{Fragment, Quad};
use crate::lanes::{F4, V3};
use crate::plan::Features;
use choreo_asset::MaterialLayers;

impl Fragment<'_> {
    /// KHR_materials_anisotropy: the directions in which highlights are stretched, the GGX alphas, and the direction in which the
    /// sky is reflected (section "Bent normal" of the extension).
    pub(super) fn anisotropy(
        &self,
        quad: &Quad,
        layers: &MaterialLayers,
        roughness: F4,
        (n, v): (V3, V3),
    ) -> (Anisotropy, V3) {
        let [tangent, bitangent, _] = quad.tangent_frame();
        let (mut x, mut y, mut strength) = (F4::ONE, F4::ZERO, F4::splat(layers.anisotropy));
        if let Some([r, g, b, _]) = self.sample_feature_texture(quad, Features::ANISOTROPY_TEXTURE) {
            (x, y) = (r * 2.0 - F4::ONE, g * 2.0 - F4::ONE);
            strength *= b;
        }
        let (c, s) = (libm::cosf(layers.anisotropy_rotation), libm::sinf(layers.anisotropy_rotation));
        let (x, y) = (x * c - y * s, x * s + y * c);
        let along = (tangent * x + bitangent * y).unit();
        let across = n.cross(along).unit();
        let alpha_across = roughness * roughness;
        let alpha_along = alpha_across.mix(F4::ONE, strength * strength);
        let anisotropic_n = across.cross(v).cross(across).unit();
        let isotropy = F4::ONE - strength * (F4::ONE - roughness);
        let isotropy2 = isotropy * isotropy;
        let bent_n = anisotropic_n.mix(n, isotropy2 * isotropy2).unit();
        let sky_direction = bent_n * (bent_n.dot(v) * 2.0) - v;
        (Anisotropy { along, across, alpha_along, alpha_across }, sky_direction)
    }
}
