//! Reflections of Blinn–Phong and Phong surfaces. CPU reference of reflection.wgsl.

use super::shade::{Fragment, Quad};
use crate::lanes::{F4, V3};
use crate::plan::Features;
use crate::plan::shader_features::texture_slot;
use choreo_asset::Reflection;
use glam::Vec3;
use std::f32::consts::PI;

impl Fragment<'_> {
    /// Reflectance and reflected color; `None` for a draw without reflection.
    pub(super) fn reflection(&self, quad: &Quad, [n, v]: [V3; 2]) -> Option<[V3; 2]> {
        if !self.features.has(Features::REFLECTION) {
            return None;
        }
        let material = &self.material.factors.material;
        let mut share =
            V3::splat(material.reflection.as_deref().map_or(Vec3::ZERO, |r: &Reflection| r.color));
        if let Some([r, g, b, _]) = self.sample_feature_texture(quad, Features::REFLECTION_TEXTURE) {
            share = share * V3 { x: r, y: g, z: b };
        }
        let direction = n * (n.dot(v) * 2.0) - v;
        let roughness = material.mirror_roughness();
        let reflected = match self.features.has(Features::ENVIRONMENT_TEXTURE) {
            true => self.sample_environment_map(direction, roughness),
            false => self.environment_light().reflected(direction, F4::splat(roughness)),
        };
        Some([share, reflected])
    }

    /// The material's environment map, sampled in the four directions of a quad.
    fn sample_environment_map(&self, direction: V3, roughness: f32) -> V3 {
        let refs = self.material.factors.textures;
        let slot = texture_slot(Features::ENVIRONMENT_TEXTURE);
        let (Some(r), Some(map)) = (refs[slot].as_ref(), self.material.textures[slot].as_deref()) else {
            return V3::splat(Vec3::ONE);
        };
        let directions: [Vec3; 4] =
            std::array::from_fn(|i| Vec3::new(direction.x.0[i], direction.y.0[i], direction.z.0[i]));
        let lanes: [F4; 4] = std::array::from_fn(|i| {
            let direction = directions[i];
            let (across, down) =
                (directions[i | 1] - directions[i & !1], directions[i | 2] - directions[i & !2]);
            let pixel = across.length_squared().max(down.length_squared()).sqrt();
            let angle = pixel.max(2.0 * roughness * roughness);
            let level = libm::log2f((angle * map.width() / (2.0 * PI)).max(1.0));
            let [x, z] = if direction.x == 0.0 && direction.z == 0.0 {
                [0.0, 1.0]
            } else {
                [direction.x, -direction.z]
            };
            let u = 0.5 + libm::atan2f(x, z) / (2.0 * PI);
            let v = libm::acosf(direction.y.clamp(-1.0, 1.0)) / PI;
            map.sample_level(&r.sampler, [u, v], level)
        });
        let channel = |c: usize| F4(std::array::from_fn(|i| lanes[i].0[c]));
        V3 { x: channel(0), y: channel(1), z: channel(2) }
    }
}
