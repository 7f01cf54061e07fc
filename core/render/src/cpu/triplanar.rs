//! Triplanar mapping: textures from three sides, mixed by where the surface faces. CPU reference of triplanar.wgsl.

use super::shade::{Fragment, Quad};
use super::texture::Texture;
use crate::lanes::{F4, V3, Weights};
use crate::plan::Features;
use crate::scene_resources::material::MaterialTexture;
use choreo_asset::TextureSlot;
use glam::{Affine2, Vec2};

/// Triplanar coordinates of a quad, in the space of its mesh.
#[derive(Clone, Copy, Debug)]
pub struct Planes {
    /// Offset from the center, in widths of the image.
    at: V3,
    /// Unit normal in mesh space.
    normal: V3,
    /// Sign of each component of the normal; 1 for zero.
    signs: V3,
    /// Weights of the three sides, with the sum 1.
    weights: V3,
}

impl Planes {
    /// Coordinates on the sides that look along x, y and z: u to the right as seen from there, v down.
    fn uvs(&self) -> [[F4; 2]; 3] {
        let Planes { at, signs, .. } = self;
        let half = F4::splat(0.5);
        [
            [half - at.z * signs.x, half - at.y],
            [half + at.x, half + at.z * signs.y],
            [half + at.x * signs.z, half - at.y],
        ]
    }
}

impl Fragment<'_> {
    pub fn planes(&self, ids: [u32; 3], weights: &Weights) -> Option<Planes> {
        let how =
            self.material.factors.material.triplanar.filter(|_| self.features.has(Features::TRIPLANAR))?;
        let p = self.primitive;
        let normal = weights.vec3(ids.map(|i| p.normals[i as usize])).unit();
        let at = weights.vec3(ids.map(|i| p.positions[i as usize])) - V3::splat(how.middle);
        let map = |v: V3, f: fn(f32) -> f32| V3 { x: v.x.map(f), y: v.y.map(f), z: v.z.map(f) };
        // The weights are powers of the normal (Golus, "Normal Mapping for a Triplanar Shader", 2017): the higher, the narrower the seams.
        let away = map(normal, f32::abs);
        let scale = F4::ONE / away.max_component().max(F4::splat(1e-6));
        let shares = (away * scale).power(how.sharpness);
        let sum = F4::ONE / (shares.x + shares.y + shares.z);
        Some(Planes {
            at: at * F4::splat(1.0 / how.size),
            normal,
            signs: map(normal, |v| if v < 0.0 { -1.0 } else { 1.0 }),
            weights: shares * sum,
        })
    }

    /// Samples a texture on all three sides and mixes the texels.
    pub(crate) fn sample_planes(&self, planes: &Planes, r: &MaterialTexture, texture: &Texture) -> [F4; 4] {
        let [x, y, z] = self.sides(planes, r, texture);
        let w = &planes.weights;
        std::array::from_fn(|c| w.x * x[c] + w.y * y[c] + w.z * z[c])
    }

    fn sides(&self, planes: &Planes, r: &MaterialTexture, texture: &Texture) -> [[F4; 4]; 3] {
        let Affine2 { matrix2: m, translation: Vec2 { x, y } } = r.uv_transform;
        planes.uvs().map(|[u, v]| {
            let u_placed = u * m.x_axis.x + v * m.y_axis.x + F4::splat(x);
            let v_placed = u * m.x_axis.y + v * m.y_axis.y + F4::splat(y);
            texture.sample(&r.sampler, [u_placed, v_placed])
        })
    }

    /// The normal map from three sides, each bending the surface's own normal ("Whiteout Blend" of the same article), then
    /// from the mesh's space to the world by the surface's frame, which is known in both. `None` without a map.
    pub(crate) fn triplanar_normal(&self, quad: &Quad) -> Option<V3> {
        let planes = quad.planes.as_ref().filter(|_| self.features.has(Features::NORMAL_TEXTURE))?;
        let factors = &self.material.factors;
        let (r, texture) =
            (factors.textures[TextureSlot::Normal as usize].as_ref()?, self.material.textures[2].as_deref()?);
        let scale = factors.material.normal_scale;
        let [x, y, z] = self.sides(planes, r, texture).map(|[x, y, z, _]| {
            let signed = |c: F4| c * 2.0 - F4::ONE;
            V3 { x: signed(x) * scale, y: signed(y) * scale, z: signed(z) }
        });
        let (n, s, w) = (planes.normal, planes.signs, planes.weights);
        let of_x = V3 { x: n.x * x.z, y: n.y + x.y, z: n.z - s.x * x.x };
        let of_y = V3 { x: n.x + y.x, y: n.y * y.z, z: n.z - s.y * y.y };
        let of_z = V3 { x: n.x + s.z * z.x, y: n.y + z.y, z: n.z * z.z };
        let bent = (of_x * w.x + of_y * w.y + of_z * w.z).unit();

        let tangents = &self.primitive.tangents;
        let along = quad.weights.vec3(quad.ids.map(|i| tangents[i as usize].truncate())).unit();
        let (to_t, to_b, to_n) = (bent.dot(along), bent.dot(n.cross(along)), bent.dot(n));
        let [tangent, bitangent, normal] = quad.tangent_frame();
        let out = (tangent * to_t + bitangent * to_b + normal * to_n).unit();
        Some(if self.double_sided && !quad.front { -out } else { out })
    }
}

impl V3 {
    fn power(self, exponent: f32) -> V3 {
        let power = |v: F4| v.map(|v| libm::powf(v, exponent));
        V3 { x: power(self.x), y: power(self.y), z: power(self.z) }
    }
}
