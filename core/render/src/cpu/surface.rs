//! Surface effects, applied in order, and their inputs. CPU reference of surface.wgsl.

use super::background_row_color;
use super::shade::{Fragment, Shaded};
use super::sky::sky_behind;
use super::vertex::Vertex;
use crate::effect_faults::{Fault, MAGENTA};
use crate::lanes::{F4, Mask, V3, Weights};
use crate::plan::{Features, Glass};
use choreo_plugin::{Effect, SurfaceSample};
use glam::{Vec2, Vec3, Vec4};

/// Largest number of quads that surface effects process at once: effects in WGSL run over 32 pixels together.
pub(super) const MAX_QUADS: usize = 8;

impl Fragment<'_> {
    /// Shades a quad and applies the surface effects. `at`: the first pixel of the quad.
    pub(super) fn shade_with_effects(
        &self,
        vertices: &[Vertex],
        ids: [u32; 3],
        front: bool,
        weights: &Weights,
        at: [i32; 2],
    ) -> Shaded {
        let mut shaded = self.shade(vertices, ids, front, weights);
        if self.has_surface_effects() {
            let samples = self.surface_samples(vertices, ids, front, weights, at);
            self.apply_surface_effects(std::slice::from_mut(&mut shaded), &samples);
        }
        shaded
    }

    pub(crate) fn has_surface_effects(&self) -> bool {
        !self.surface.is_empty() && self.glass != Glass::Filter
    }

    /// Inputs of surface effects for a quad.
    pub(super) fn surface_samples(
        &self,
        vertices: &[Vertex],
        ids: [u32; 3],
        front: bool,
        weights: &Weights,
        at: [i32; 2],
    ) -> [SurfaceSample; 4] {
        let relative = weights.interpolate_vec3(ids.map(|i| vertices[i as usize].relative));
        let has = |bit| self.features.has(bit);
        let normals = self.features.is_lit() || has(Features::EFFECT_NORMALS);
        let joints = weights.interpolate_vec3(ids.map(|i| vertices[i as usize].joints));
        let mut normal = V3::splat(Vec3::ZERO);
        if normals {
            normal = weights.interpolate_vec3(ids.map(|i| vertices[i as usize].normal)).unit();
            normal = if front { normal } else { -normal };
        }
        let uvs = &self.primitive.uvs[0];
        let uv = (has(Features::UV0) && !uvs.is_empty())
            .then(|| weights.interpolate_vec2(ids.map(|i| uvs[i as usize])));
        let shadowed = has(Features::EFFECT_SHADOW)
            .then(|| self.shadowed_light_share(relative, normal, weights.visible));
        let view = &self.plan.view;
        let sky = self.plan.sky.as_ref().filter(|sky| sky.background && has(Features::SKY));
        let sky = self.sky.zip(sky);
        let sample = |i: usize| {
            let lane = |v: &V3| Vec3::new(v.x.0[i], v.y.0[i], v.z.0[i]);
            let (relative, normal) = (lane(&relative), lane(&normal));
            let eye = view.eye.truncate();
            let to_eye = eye - relative * view.eye.w;
            let y = (at[1] + i as i32 / 2).max(0) as usize;
            let world = relative + view.position.as_vec3();
            let distance = if view.eye.w > 0.5 { relative.length() } else { -relative.dot(eye) };
            SurfaceSample {
                world,
                distance,
                viewer: world - relative * view.eye.w + eye * distance,
                normal,
                facing: normal.dot(to_eye * (1.0 / to_eye.dot(to_eye).max(1e-20).sqrt())),
                background: match &sky {
                    Some((maps, sky)) => {
                        sky_behind(self.plan, maps, sky, if view.eye.w > 0.5 { relative } else { -eye })
                    }
                    None => background_row_color(self.plan, y).truncate(),
                },
                joints: if has(Features::EFFECT_JOINTS) { lane(&joints) } else { Vec3::ZERO },
                shadow: shadowed.map_or(0.0, |shadowed| shadowed.0[i]),
                uv: uv.map_or(Vec2::ZERO, |[u, v]| Vec2::new(u.0[i], v.0[i])),
            }
        };
        std::array::from_fn(sample)
    }

    /// Applies the surface effects in order to at most [`MAX_QUADS`] quads. `samples`: four for each quad.
    pub(crate) fn apply_surface_effects(&self, quads: &mut [Shaded], samples: &[SurfaceSample]) {
        let mut colors = [Vec4::ZERO; 4 * MAX_QUADS];
        let colors = &mut colors[..samples.len()];
        for (colors, shaded) in colors.chunks_exact_mut(4).zip(&*quads) {
            for (i, color) in colors.iter_mut().enumerate() {
                *color = shaded.pixel(i);
                // The light of glass is premultiplied by its alpha.
                if self.glass == Glass::Light && color.w > 0.0 {
                    *color = (color.truncate() / color.w).extend(color.w);
                }
            }
        }
        for ((effect, parameters), number) in self.surface.iter().zip(0..) {
            let Effect::Surface(effect) = effect else { continue };
            effect.surfaces(colors, samples, parameters);
            for (i, color) in colors.iter_mut().enumerate() {
                if let Some(fault) = Fault::of(*color) {
                    let pixel_fault = &mut quads[i / 4].faults[i % 4];
                    *pixel_fault = pixel_fault.or(Some((number, fault)));
                    *color = MAGENTA;
                }
            }
        }
        for (colors, shaded) in colors.chunks_exact(4).zip(quads) {
            for (i, mut color) in colors.iter().copied().enumerate() {
                if self.glass == Glass::Light {
                    let alpha = shaded.rgba[3].0[i];
                    color = (color.truncate() * alpha).extend(alpha);
                }
                for (out, c) in shaded.rgba.iter_mut().zip(color.to_array()) {
                    out.0[i] = c;
                }
            }
        }
    }

    /// Shadowed share of the light on a white diffuse surface, by luminance.
    fn shadowed_light_share(&self, relative: V3, n: V3, visible: Mask) -> F4 {
        // ITU-R BT.709.
        let luminance = Vec3::new(0.2126, 0.7152, 0.0722);
        let (mut total, mut shadowed) =
            (self.environment_light().diffuse(n).dot(V3::splat(luminance)), F4::ZERO);
        for light in &self.plan.lights {
            let (l, strength) = light.incoming(relative);
            let incoming = n.dot(l).clamp(0.0, 1.0) * strength * light.color.dot(luminance);
            total += incoming;
            shadowed += incoming * (F4::ONE - self.unshadowed_share(light, [relative, n, l], visible));
        }
        shadowed / total.max(F4::splat(1e-6))
    }
}
