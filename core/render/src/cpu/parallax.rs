//! Heights that shift the textures of a surface. CPU reference: `read_relief` of scene.wgsl.

use super::lanes::F4;
use super::shade::{Fragment, Quad};
use super::vertex::Vertex;
use choreo_asset::TextureSlot;
use glam::Vec3;

impl Fragment<'_> {
    /// Premecz, "Iterative Parallax Mapping with Slope Information", CESCG 2006: four steps towards where the view meets the
    /// heights in the normal map's alpha.
    pub fn relief(&self, vertices: &[Vertex], ids: [u32; 3], quad: &Quad) -> Option<[F4; 2]> {
        let material = &self.material.factors;
        let (map, texture) = (
            material.textures[TextureSlot::Normal as usize].as_ref()?,
            self.material.textures[2].as_deref()?,
        );
        let of = ids.map(|i| &vertices[i as usize]);
        let (relative, normal) =
            (quad.weights.vec3(of.map(|v| v.relative)), quad.weights.vec3(of.map(|v| v.normal)));
        let tangent = quad.weights.vec3(of.map(|v| v.tangent.truncate()));
        let signs = of.map(|v| v.tangent.w);
        let sign = quad.weights.scalar(signs[0], signs[1], signs[2]);
        let eye = self.plan.view.eye;
        let depth_of_all = material.material.relief;
        let mut way = [F4::ZERO; 2];
        for i in 0..4 {
            let lane = |v: &super::lanes::V3| Vec3::new(v.x.0[i], v.y.0[i], v.z.0[i]);
            let (n, t) = (lane(&normal), lane(&tangent));
            let v = eye.truncate() - lane(&relative) * eye.w;
            let b = n.cross(t) * sign.0[i];
            // Rows of a texture go down, the second tangent up.
            let scale = v.dot(n).abs().max(0.3 * v.length());
            way[0].0[i] = v.dot(t) / scale;
            way[1].0[i] = -v.dot(b) / scale;
        }
        let mut shift = [F4::ZERO; 2];
        let mut depth = F4::ZERO;
        for _ in 0..4 {
            let quad = Quad { relief: Some(shift), ..*quad };
            let [_, _, z, a] = self.sample(&quad, Some(map), Some(texture))?;
            let below = (a - F4::ONE) * depth_of_all;
            depth += (below - depth) * (z * 2.0 - F4::ONE).clamp(0.0, 1.0);
            shift = [way[0] * depth, way[1] * depth];
        }
        Some(shift)
    }
}
