//! Texture coordinates of a surface. CPU reference of `texture_uv` in scene.wgsl.

use super::lanes::{F4, Weights};
use super::shade::{Fragment, Quad};
use super::texture::Texture;
use crate::plan::Features;
use crate::scene_resources::material::MaterialTexture;
use crate::scene_resources::material::TOON_SLOT;
use glam::{Affine2, Vec2};

impl Fragment<'_> {
    pub fn quad<'a>(&self, ids: [u32; 3], weights: &'a Weights) -> Quad<'a> {
        let mut uvs = [[F4::ZERO; 2]; 2];
        for (set, bit) in [Features::UV0, Features::UV1].into_iter().enumerate() {
            let list = &self.primitive.uvs[set];
            if self.features.has(bit) && !list.is_empty() {
                uvs[set] = weights.vec2(ids.map(|i| list[i as usize]));
            }
        }
        let mut quad = Quad { weights, uvs, uv_mask: None, relief: None, planes: self.planes(ids, weights) };
        if self.features.has(Features::UV_MASK) {
            let (mask, texture) =
                (&self.material.factors.textures[TOON_SLOT + 1], &self.material.textures[TOON_SLOT + 1]);
            let texel = self.sample(&quad, mask.as_ref(), texture.as_deref());
            quad.uv_mask = texel.map(|[_, _, b, _]| b);
        }
        quad
    }

    /// `None` where the material has no such texture: white.
    pub fn sample(
        &self,
        quad: &Quad,
        reference: Option<&MaterialTexture>,
        texture: Option<&Texture>,
    ) -> Option<[F4; 4]> {
        let (r, texture) = (reference?, texture?);
        if let Some(planes) = &quad.planes {
            return Some(self.sample_planes(planes, r, texture));
        }
        let mut uv = quad.uvs[r.uv_set as usize & 1];
        if self.features.has(Features::UV_TRANSFORM) && r.uv_transform != Affine2::IDENTITY {
            let Affine2 { matrix2: m, translation: Vec2 { x, y } } = r.uv_transform;
            let [u, v] = uv;
            uv = [u * m.x_axis.x + v * m.y_axis.x + x, u * m.x_axis.y + v * m.y_axis.y + y];
        }
        if let Some([u, v]) = quad.relief {
            uv = [uv[0] + u, uv[1] + v];
        }
        if let (Some(mask), Some(toon)) = (quad.uv_mask, &self.material.factors.material.toon) {
            // Turned about the middle, then moved, each place as much as the mask says.
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
