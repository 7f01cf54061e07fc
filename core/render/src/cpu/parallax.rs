//! Parallax mapping: a height map shifts the texture coordinates of a surface. CPU reference of `read_parallax` in scene.wgsl.

use super::shade::{Fragment, Quad};
use crate::lanes::{F4, V3};
use choreo_asset::TextureSlot;
use glam::Vec3;

impl Fragment<'_> {
    /// Shift of the texture coordinates (Premecz, "Iterative Parallax Mapping with Slope Information", CESCG 2006): four steps towards
    /// the point in which the view ray meets the height map, which is the alpha of the normal map.
    pub(super) fn parallax_shift(&self, quad: &Quad) -> Option<[F4; 2]> {
        let material = &self.material.factors;
        let (map, texture) = (
            material.texture(TextureSlot::Normal)?,
            self.material.textures[TextureSlot::Normal as usize].as_deref()?,
        );
        let (relative, normal) = (quad.interpolate_vec3(|v| v.relative), quad.interpolate_vec3(|v| v.normal));
        let (tangent, sign) =
            (quad.interpolate_vec3(|v| v.tangent.truncate()), quad.interpolate_scalar(|v| v.tangent.w));
        let eye = self.plan.view.eye;
        let relief_depth = material.material.relief;
        let mut direction = [F4::ZERO; 2];
        for i in 0..4 {
            let lane = |v: &V3| Vec3::new(v.x.0[i], v.y.0[i], v.z.0[i]);
            let (n, t) = (lane(&normal), lane(&tangent));
            let v = eye.truncate() - lane(&relative) * eye.w;
            let b = n.cross(t) * sign.0[i];
            // Rows of a texture run downwards, the bitangent upwards.
            let scale = v.dot(n).abs().max(0.3 * v.length());
            direction[0].0[i] = v.dot(t) / scale;
            direction[1].0[i] = -v.dot(b) / scale;
        }
        let mut shift = [F4::ZERO; 2];
        let mut depth = F4::ZERO;
        for _ in 0..4 {
            let quad = Quad { parallax: Some(shift), ..*quad };
            let [_, _, z, a] = self.sample_material_texture(&quad, Some(&map), Some(texture))?;
            let below = (a - F4::ONE) * relief_depth;
            depth += (below - depth) * (z * 2.0 - F4::ONE).clamp(0.0, 1.0);
            shift = [direction[0] * depth, direction[1] * depth];
        }
        Some(shift)
    }
}
