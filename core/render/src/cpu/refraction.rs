//! Refraction: the scene color copy where the refracted ray leaves the volume. CPU reference of refraction.wgsl.

use super::shade::Fragment;
use crate::lanes::{F4, V3};
use crate::plan::Features;
use crate::plan::scene_color_copy::blur;
use choreo_asset::MaterialLayers;
use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

/// The image before the first refracting surface, with its mipmaps.
pub(super) struct SceneColorCopy {
    levels: Vec<Level>,
}

struct Level {
    size: [usize; 2],
    texels: Vec<Vec4>,
}

impl SceneColorCopy {
    pub(super) fn new(pixels: Vec<Vec4>, size: [u32; 2], levels: u32) -> SceneColorCopy {
        let mut all = vec![Level { size: size.map(|s| s as usize), texels: pixels }];
        while all.len() < levels as usize {
            let next = all[all.len() - 1].next_mip_level();
            all.push(next);
        }
        SceneColorCopy { levels: all }
    }

    /// Trilinear sample, clamped to the edge. `at`: 0 to 1 from the top left.
    fn sample(&self, at: Vec2, lod: f32) -> Vec3 {
        let last = self.levels.len() - 1;
        let lod = if lod > 0.0 { lod.min(last as f32) } else { 0.0 };
        let level = lod as usize;
        let near = self.levels[level].sample(at);
        let share = lod - level as f32;
        if share > 0.0 { near.lerp(self.levels[level + 1].sample(at), share) } else { near }
    }
}

impl Level {
    /// The next smaller mip level, as a blit with a linear filter creates it: each texel is this level, sampled at its center.
    fn next_mip_level(&self) -> Level {
        let size = self.size.map(|side| (side / 2).max(1));
        let mut texels = vec![Vec4::ZERO; size[0] * size[1]];
        texels.par_chunks_mut(size[0]).enumerate().for_each(|(y, row)| {
            for (x, texel) in row.iter_mut().enumerate() {
                let center = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                *texel = self.sample(center / Vec2::new(size[0] as f32, size[1] as f32)).extend(1.0);
            }
        });
        Level { size, texels }
    }

    fn sample(&self, at: Vec2) -> Vec3 {
        let [(x0, x1, fx), (y0, y1, fy)] = [texel_pair(at.x, self.size[0]), texel_pair(at.y, self.size[1])];
        let texel = |x: usize, y: usize| self.texels[y * self.size[0] + x].truncate();
        let top = texel(x0, y0).lerp(texel(x1, y0), fx);
        top.lerp(texel(x0, y1).lerp(texel(x1, y1), fx), fy)
    }
}

/// The two texels around a coordinate, and the weight of the second. NaN selects texel 0.
fn texel_pair(at: f32, size: usize) -> (usize, usize, f32) {
    let last = (size - 1) as f32;
    let x = at * size as f32 - 0.5;
    let x = if x > 0.0 { x.min(last) } else { 0.0 };
    let first = x as usize;
    (first, (first + 1).min(size - 1), x - first as f32)
}

/// Refracted ray inside the volume by Snell's law, unit length; zero for total reflection. CPU reference of `bent`.
fn refracted_ray(n: V3, v: V3, ior: f32) -> V3 {
    let eta = F4::splat(1.0 / ior);
    let nv = n.dot(v);
    let k = F4::ONE - eta * eta * (F4::ONE - nv * nv);
    let ray = n * (eta * nv - k.max(F4::ZERO).sqrt()) - v * eta;
    ray * F4(k.0.map(|k| if k < 0.0 { 0.0 } else { 1.0 }))
}

impl Fragment<'_> {
    /// Color where the refracted ray leaves the volume after `depth` metres, blurred by the surface's roughness.
    pub(super) fn refracted_color(
        &self,
        relative: V3,
        [n, v]: [V3; 2],
        layers: &MaterialLayers,
        depth: F4,
        roughness: F4,
    ) -> V3 {
        let Some(scene_color) = &self.scene_color else { return V3::splat(Vec3::ZERO) };
        let iors = layers.iors();
        let color_at_ior = |ior: f32| {
            let exit = relative + refracted_ray(n, v, ior) * depth;
            let height = libm::log2f(self.plan.size[1] as f32);
            std::array::from_fn::<Vec3, 4, _>(|i| {
                let exit = Vec4::new(exit.x.0[i], exit.y.0[i], exit.z.0[i], 1.0);
                let clip = self.plan.view.clip_from_relative * exit;
                let at = clip.truncate().truncate() / clip.w.max(1e-6) * 0.5 + 0.5;
                scene_color.sample(at, height * blur(roughness.0[i], ior))
            })
        };
        let green = color_at_ior(iors.y);
        let (red, blue) = match self.features.has(Features::DISPERSION) {
            true => (color_at_ior(iors.x), color_at_ior(iors.z)),
            false => (green, green),
        };
        V3 { x: F4(red.map(|c| c.x)), y: F4(green.map(|c| c.y)), z: F4(blue.map(|c| c.z)) }
    }
}
