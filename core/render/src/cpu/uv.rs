//! Texture coordinates of a surface. CPU reference of `texture_uv` in scene.wgsl.

use super::shade::{Fragment, Quad};
use super::texture::Texture;
use super::vertex::Vertex;
use crate::lanes::{F4, Weights};
use crate::plan::Features;
use crate::scene_resources::material::MaterialTexture;
use glam::{Affine2, Vec2};

impl Fragment<'_> {
    pub(super) fn new_quad<'a>(
        &self,
        vertices: &'a [Vertex],
        ids: [u32; 3],
        front: bool,
        weights: &'a Weights,
    ) -> Quad<'a> {
        let mut uvs = [[F4::ZERO; 2]; 2];
        for (set, bit) in [Features::UV0, Features::UV1].into_iter().enumerate() {
            let list = &self.primitive.uvs[set];
            if self.features.has(bit) && !list.is_empty() {
                uvs[set] = weights.interpolate_vec2(ids.map(|i| list[i as usize]));
            }
        }
        let vertices = ids.map(|i| &vertices[i as usize]);
        let triplanar = self.triplanar_coordinates(ids, weights);
        let mut quad = Quad { vertices, ids, front, weights, uvs, uv_mask: None, parallax: None, triplanar };
        if self.features.has(Features::UV_MOTION_MASK) {
            quad.uv_mask = self.sample_feature_texture(&quad, Features::UV_MOTION_MASK).map(|[_, _, b, _]| b);
        }
        if self.features.has(Features::PARALLAX) {
            quad.parallax = self.parallax_shift(&quad);
        }
        quad
    }

    /// Samples a texture of the material; `None` if it has none.
    pub(super) fn sample_material_texture(
        &self,
        quad: &Quad,
        reference: Option<&MaterialTexture>,
        texture: Option<&Texture>,
    ) -> Option<[F4; 4]> {
        let (r, texture) = (reference?, texture?);
        if let Some(triplanar) = &quad.triplanar {
            return Some(self.sample_triplanar(triplanar, r, texture));
        }
        let mut uv = quad.uvs[r.uv_set as usize & 1];
        if self.features.has(Features::UV_TRANSFORM) && r.uv_transform != Affine2::IDENTITY {
            let Affine2 { matrix2: m, translation: Vec2 { x, y } } = r.uv_transform;
            let [u, v] = uv;
            uv = [u * m.x_axis.x + v * m.y_axis.x + x, u * m.x_axis.y + v * m.y_axis.y + y];
        }
        if let Some([u, v]) = quad.parallax {
            uv = [uv[0] + u, uv[1] + v];
        }
        if let (Some(mask), Some(toon)) = (quad.uv_mask, &self.material.factors.material.toon) {
            // UV animation of MToon: rotation about the center, then translation, both scaled by the mask.
            let angle = mask * toon.uv_moved.z;
            let (sin, cos) = (angle.map(libm::sinf), angle.map(libm::cosf));
            let [x, y] = uv.map(|v| v - F4::splat(0.5));
            uv = [
                cos * x - sin * y + F4::splat(0.5) + mask * toon.uv_moved.x,
                sin * x + cos * y + F4::splat(0.5) + mask * toon.uv_moved.y,
            ];
        }
        Some(texture.sample(&r.sampler, uv))
    }
}
