//! Triplanar mapping: textures projected along three axes and mixed by the direction of the normal. CPU reference of triplanar.wgsl.

use super::shade::{Fragment, Quad};
use super::texture::Texture;
use crate::lanes::{F4, V3, Weights};
use crate::plan::Features;
use crate::scene_resources::material::MaterialTexture;
use choreo_asset::TextureSlot;
use glam::{Affine2, Vec2};

/// Triplanar coordinates of a quad, in the space of its mesh.
#[derive(Clone, Copy, Debug)]
pub(super) struct TriplanarCoordinates {
    /// Offset from the center, in widths of the image.
    at: V3,
    /// Unit normal in mesh space.
    normal: V3,
    /// Sign of each component of the normal; 1 for zero.
    signs: V3,
    /// Weights of the three projections; their sum is 1.
    weights: V3,
}

impl TriplanarCoordinates {
    /// Texture coordinates for the projections along x, y and z: u to the right as seen from outside the mesh, v down.
    fn uvs(&self) -> [[F4; 2]; 3] {
        let TriplanarCoordinates { at, signs, .. } = self;
        let half = F4::splat(0.5);
        [
            [half - at.z * signs.x, half - at.y],
            [half + at.x, half + at.z * signs.y],
            [half + at.x * signs.z, half - at.y],
        ]
    }
}

impl Fragment<'_> {
    pub(super) fn triplanar_coordinates(
        &self,
        ids: [u32; 3],
        weights: &Weights,
    ) -> Option<TriplanarCoordinates> {
        let mapping =
            self.material.factors.material.triplanar.filter(|_| self.features.has(Features::TRIPLANAR))?;
        let p = self.primitive;
        let normal = weights.interpolate_vec3(ids.map(|i| p.normals[i as usize])).unit();
        let at = weights.interpolate_vec3(ids.map(|i| p.positions[i as usize])) - V3::splat(mapping.middle);
        let map = |v: V3, f: fn(f32) -> f32| V3 { x: v.x.map(f), y: v.y.map(f), z: v.z.map(f) };
        // The weights are powers of the normal (Golus, "Normal Mapping for a Triplanar Shader", 2017): the higher, the narrower the seams.
        let magnitudes = map(normal, f32::abs);
        let scale = F4::ONE / magnitudes.max_component().max(F4::splat(1e-6));
        let shares = (magnitudes * scale).raised_to(mapping.sharpness);
        let sum = F4::ONE / (shares.x + shares.y + shares.z);
        Some(TriplanarCoordinates {
            at: at * F4::splat(1.0 / mapping.size),
            normal,
            signs: map(normal, |v| if v < 0.0 { -1.0 } else { 1.0 }),
            weights: shares * sum,
        })
    }

    /// Samples a texture on all three sides and mixes the texels.
    pub(crate) fn sample_triplanar(
        &self,
        coordinates: &TriplanarCoordinates,
        r: &MaterialTexture,
        texture: &Texture,
    ) -> [F4; 4] {
        let [x, y, z] = self.sample_sides(coordinates, r, texture);
        let w = &coordinates.weights;
        std::array::from_fn(|c| w.x * x[c] + w.y * y[c] + w.z * z[c])
    }

    fn sample_sides(
        &self,
        coordinates: &TriplanarCoordinates,
        r: &MaterialTexture,
        texture: &Texture,
    ) -> [[F4; 4]; 3] {
        let Affine2 { matrix2: m, translation: Vec2 { x, y } } = r.uv_transform;
        coordinates.uvs().map(|[u, v]| {
            let u_placed = u * m.x_axis.x + v * m.y_axis.x + F4::splat(x);
            let v_placed = u * m.x_axis.y + v * m.y_axis.y + F4::splat(y);
            texture.sample(&r.sampler, [u_placed, v_placed])
        })
    }

    /// Normal from the normal map's three projections, each of which bends the surface's normal ("Whiteout Blend" of the same
    /// article). The tangent frame is known in mesh space and in world space, so it transforms the result to world space. `None`
    /// without a normal map.
    pub(crate) fn triplanar_normal(&self, quad: &Quad) -> Option<V3> {
        let coordinates = quad.triplanar.as_ref().filter(|_| self.features.has(Features::NORMAL_TEXTURE))?;
        let factors = &self.material.factors;
        let (r, texture) =
            (factors.textures[TextureSlot::Normal as usize].as_ref()?, self.material.textures[2].as_deref()?);
        let scale = factors.material.normal_scale;
        let [x, y, z] = self.sample_sides(coordinates, r, texture).map(|[x, y, z, _]| {
            let signed = |c: F4| c * 2.0 - F4::ONE;
            V3 { x: signed(x) * scale, y: signed(y) * scale, z: signed(z) }
        });
        let (n, s, w) = (coordinates.normal, coordinates.signs, coordinates.weights);
        let of_x = V3 { x: n.x * x.z, y: n.y + x.y, z: n.z - s.x * x.x };
        let of_y = V3 { x: n.x + y.x, y: n.y * y.z, z: n.z - s.y * y.y };
        let of_z = V3 { x: n.x + s.z * z.x, y: n.y + z.y, z: n.z * z.z };
        let bent = (of_x * w.x + of_y * w.y + of_z * w.z).unit();

        let tangents = &self.primitive.tangents;
        let along = quad.weights.interpolate_vec3(quad.ids.map(|i| tangents[i as usize].truncate())).unit();
        let (to_t, to_b, to_n) = (bent.dot(along), bent.dot(n.cross(along)), bent.dot(n));
        let [tangent, bitangent, normal] = quad.tangent_frame();
        let out = (tangent * to_t + bitangent * to_b + normal * to_n).unit();
        Some(if self.double_sided && !quad.front { -out } else { out })
    }
}

impl V3 {
    fn raised_to(self, exponent: f32) -> V3 {
        let power = |v: F4| v.map(|v| libm::powf(v, exponent));
        V3 { x: power(self.x), y: power(self.y), z: power(self.z) }
    }
}
