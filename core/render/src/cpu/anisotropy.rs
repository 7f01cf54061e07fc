//! Brushed metal: along which direction highlights are drawn out. CPU reference of the part of scene.wgsl.

use super::brdf::Brushed;
use super::lanes::{F4, V3};
use super::shade::{Fragment, Quad};
use super::vertex::Vertex;
use choreo_asset::MaterialLayers;

impl Fragment<'_> {
    /// KHR_materials_anisotropy: directions and alphas, and where the sky is seen mirrored ("Bent normal" of its notes).
    pub fn brushed(
        &self,
        vertices: &[Vertex],
        ids: [u32; 3],
        quad: &Quad,
        layers: &MaterialLayers,
        (texel, roughness): (Option<[F4; 4]>, F4),
        (n, v): (V3, V3),
    ) -> (Brushed, V3) {
        let interpolated = quad.weights.vec3(ids.map(|i| vertices[i as usize].normal));
        let t = ids.map(|i| vertices[i as usize].tangent);
        let tangent = quad.weights.vec3(t.map(|t| t.truncate()));
        let bitangent = interpolated.cross(tangent) * quad.weights.scalar(t[0].w, t[1].w, t[2].w);
        let (mut x, mut y, mut strength) = (F4::ONE, F4::ZERO, F4::splat(layers.anisotropy));
        if let Some([r, g, b, _]) = texel {
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
        (Brushed { along, across, alpha_along, alpha_across }, mirror)
    }
}
