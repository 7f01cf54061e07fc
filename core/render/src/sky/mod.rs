//! Image-based lighting, computed once from a panorama on the CPU and read by both renderers. Diffuse light is stored as
//! spherical harmonics, specular light as an atlas of octahedral maps prefiltered by roughness.

pub mod harmonics;
pub mod octahedral;
pub mod prefilter;

use choreo_asset::Panorama;
use glam::{Vec2, Vec3};
use half::f16;
use harmonics::Harmonics;
use octahedral::OctahedralMap;
use rayon::prelude::{IntoParallelIterator, ParallelIterator};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Largest number of levels in the shaders.
pub(crate) const MAX_LEVELS: usize = 8;

/// Resolution and quality of the maps; the defaults are chosen by `tests/report`, "Image-based light".
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyOptions {
    /// Side of the sharpest map in texels, a power of two.
    pub size: u32,
    /// Number of maps, at even steps of roughness from 0 to 1. Each map is half as large as the one before, but not smaller than
    /// `smallest`.
    pub levels: usize,
    pub smallest: u32,
    /// Samples of the specular lobe for each texel.
    pub samples: u32,
}

impl Default for SkyOptions {
    fn default() -> SkyOptions {
        SkyOptions { size: 256, levels: 8, smallest: 32, samples: 64 }
    }
}

/// The position of a level in the atlas.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AtlasLevel {
    /// First texel inside the border.
    pub at: [u32; 2],
    /// Texels of a side.
    pub size: u32,
}

/// Lighting of a sky as shaders read it.
#[derive(Clone, Debug)]
pub struct SkyMaps {
    pub harmonics: Harmonics,
    pub levels: Vec<AtlasLevel>,
    /// Size of the atlas in texels.
    pub size: [u32; 2],
    /// RGBA of 16-bit floats, rows of the atlas. Each level has a border of one texel, so that filters reach over its edges.
    pub texels: Vec<[f16; 4]>,
}

impl SkyMaps {
    pub fn new(panorama: &Panorama, options: &SkyOptions) -> SkyMaps {
        // The base map is as fine as the panorama, whose height spans half a turn, as roughly a side of the octahedron does.
        let fine = panorama.size()[1].next_power_of_two().clamp(16, 1024).max(options.size);
        let pyramid = prefilter::pyramid(prefilter::base(panorama, fine));
        let harmonics = harmonics::harmonics(pyramid.iter().find(|l| l.size <= 256).unwrap_or(&pyramid[0]));
        let count = options.levels.clamp(2, MAX_LEVELS);
        let maps: Vec<OctahedralMap> = (0..count)
            .map(|i| {
                let roughness = i as f32 / (count - 1) as f32;
                let size = (options.size >> i).max(options.smallest).min(options.size);
                prefilter::level(&pyramid, roughness, size, options.samples)
            })
            .collect();
        // The sharpest map is at the left, the others are stacked to the right of it.
        let mut levels = Vec::with_capacity(count);
        let (mut x, mut y) = (1, 1);
        for (i, map) in maps.iter().enumerate() {
            levels.push(AtlasLevel { at: [x, y], size: map.size });
            (x, y) = if i == 0 { (map.size + 3, 1) } else { (x, y + map.size + 2) };
        }
        let width = levels.iter().map(|l| l.at[0] + l.size + 1).max().unwrap_or(0);
        let height = levels.iter().map(|l| l.at[1] + l.size + 1).max().unwrap_or(0);
        let mut texels = vec![[f16::ZERO; 4]; (width * height) as usize];
        for (level, map) in levels.iter().zip(&maps) {
            let side = map.size as i32;
            for y in -1..=side {
                let row = (level.at[1] as i32 + y) as usize * width as usize;
                for x in -1..=side {
                    let color = map.texel(x, y).min(Vec3::splat(Panorama::BRIGHTEST));
                    let [r, g, b] = color.to_array().map(f16::from_f32);
                    texels[row + (level.at[0] as i32 + x) as usize] = [r, g, b, f16::ONE];
                }
            }
        }
        SkyMaps { harmonics, levels, size: [width, height], texels }
    }

    /// The maps of a panorama: computed on the first call, cached for the panoramas used last.
    pub fn of(panorama: &Panorama) -> Arc<SkyMaps> {
        type CacheEntries = Vec<([u8; 32], Arc<OnceLock<Arc<SkyMaps>>>)>;
        static CACHED_MAPS: Mutex<CacheEntries> = Mutex::new(Vec::new());
        const MAX_CACHED: usize = 4;
        let slot = {
            let mut kept = CACHED_MAPS.lock().unwrap_or_else(PoisonError::into_inner);
            let known = kept.iter().position(|(hash, _)| *hash == panorama.hash());
            let entry = known.map(|at| kept.remove(at)).unwrap_or((panorama.hash(), Arc::default()));
            kept.insert(0, entry.clone());
            kept.truncate(MAX_CACHED);
            entry.1
        };
        // Outside the lock, so that another panorama's maps can be computed meanwhile.
        slot.get_or_init(|| Arc::new(SkyMaps::new(panorama, &SkyOptions::default()))).clone()
    }

    pub fn texel(&self, x: usize, y: usize) -> Vec3 {
        let [r, g, b, _] = self.texels[y * self.size[0] as usize + x].map(f16::to_f32);
        Vec3::new(r, g, b)
    }

    /// Specular light for a roughness from a direction, interpolated between the two nearest levels.
    pub fn specular(&self, dir: Vec3, roughness: f32) -> Vec3 {
        let sum = dir.x.abs() + dir.y.abs() + dir.z.abs();
        if !(sum.is_finite() && sum > 0.0) {
            return Vec3::ZERO;
        }
        let place = octahedral::octahedral(dir);
        let last = self.levels.len() - 1;
        // NaN counts as roughness 0.
        let level = if roughness > 0.0 { roughness.min(1.0) } else { 0.0 } * last as f32;
        let low = level as usize;
        let sharp = self.sample(place, low);
        let rough = self.sample(place, (low + 1).min(last));
        let t = level - low as f32;
        sharp * (1.0 - t) + rough * t
    }

    fn sample(&self, place: Vec2, level: usize) -> Vec3 {
        let level = &self.levels[level];
        let first = Vec2::new(level.at[0] as f32, level.at[1] as f32);
        let at = first + place * level.size as f32 - 0.5;
        let (low, t) = (at.floor(), at - at.floor());
        // No clamping: each level has a border of one texel, so x + 1 and y + 1 exist.
        let (x, y) = (low.x as usize, low.y as usize);
        let row = |y| self.texel(x, y) * (1.0 - t.x) + self.texel(x + 1, y) * t.x;
        row(y) * (1.0 - t.y) + row(y + 1) * t.y
    }
}

/// The panorama as 16-bit floats for the background; at a lower resolution if a device does not support its width.
#[derive(Clone, Debug)]
pub(crate) struct SkyBackground {
    pub size: [u32; 2],
    pub texels: Vec<[f16; 4]>,
}

impl SkyBackground {
    pub(crate) fn new(panorama: &Panorama, most: u32) -> SkyBackground {
        let [width, height] = panorama.size();
        let step = width.max(height).div_ceil(most.max(1)).max(1);
        let size = [width.div_ceil(step), height.div_ceil(step)];
        let texels = (0..size[1])
            .into_par_iter()
            .flat_map_iter(|y| (0..size[0]).map(move |x| (x, y)))
            .map(|(x, y)| {
                let each = (0..step * step).map(|i| (x * step + i % step, y * step + i / step));
                let sum = each.fold(Vec3::ZERO, |s, (x, y)| s + panorama.texel(x.into(), y.into()));
                let [r, g, b] = (sum / (step * step) as f32).to_array().map(f16::from_f32);
                [r, g, b, f16::ONE]
            })
            .collect();
        SkyBackground { size, texels }
    }

    pub(crate) fn texel(&self, x: i64, y: i64) -> Vec3 {
        let x = x.rem_euclid(i64::from(self.size[0])) as usize;
        let y = y.clamp(0, i64::from(self.size[1]) - 1) as usize;
        let [r, g, b, _] = self.texels[y * self.size[0] as usize + x].map(f16::to_f32);
        Vec3::new(r, g, b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_white_sky_stays_white_at_every_roughness() {
        let white = Panorama::new("white", 32, 16, vec![1.0; 3 * 32 * 16]).unwrap();
        let maps = SkyMaps::new(&white, &SkyOptions { size: 32, ..SkyOptions::default() });
        for level in &maps.levels {
            for y in 0..level.size + 2 {
                for x in 0..level.size + 2 {
                    let at = |a: u32, b: u32| (a + b - 1) as usize;
                    let off = (maps.texel(at(level.at[0], x), at(level.at[1], y)) - 1.0).abs().max_element();
                    assert!(off < 1e-3, "{level:?} {x} {y}: {off}");
                }
            }
        }
    }

    /// Light is conserved: the mean over all directions stays that of the sky.
    #[test]
    fn prefiltering_conserves_the_mean_radiance() {
        let studio = Panorama::studio();
        let maps = SkyMaps::new(&studio, &SkyOptions::default());
        let mean = |level: &AtlasLevel| {
            let mut sum = glam::DVec3::ZERO;
            for y in 0..level.size {
                for x in 0..level.size {
                    let texel = maps.texel((level.at[0] + x) as usize, (level.at[1] + y) as usize);
                    sum += texel.as_dvec3() * octahedral::solid_angle(level.size, x, y);
                }
            }
            sum / (4.0 * std::f64::consts::PI)
        };
        let sharp = mean(&maps.levels[0]);
        for level in &maps.levels[1..] {
            let off = (mean(level) / sharp - 1.0).abs().max_element();
            assert!(off < 0.02, "{level:?}: {off}");
        }
    }
}
