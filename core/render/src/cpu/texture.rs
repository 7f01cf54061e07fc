//! Texture sampling as Vulkan defines it (1.3, chapter "Image Operations"): level from the quad's derivatives,
//! bilinear within a level, linear between levels, sRGB decoded before filtering.

use crate::lanes::F4;
use crate::scene_resources::TextureResource;
use crate::scene_resources::mipmap::{MipLevel, levels_below, srgb_to_linear_table};
use choreo_asset::{Image, Sampler, Wrap};
use std::sync::Arc;

pub(super) struct Texture {
    image: Arc<Image>,
    /// Mip levels 1 and up.
    smaller_levels: Vec<MipLevel>,
    color_table: [f32; 256],
    alpha_table: [f32; 256],
}

struct Texels<'a> {
    width: i32,
    height: i32,
    rgba: &'a [u8],
}

impl Texture {
    pub(super) fn new(t: &TextureResource) -> Texture {
        let linear = std::array::from_fn(|i| i as f32 / 255.0);
        Texture {
            image: t.image.clone(),
            smaller_levels: if t.mipmaps { levels_below(&t.image, t.srgb) } else { Vec::new() },
            color_table: if t.srgb { *srgb_to_linear_table() } else { linear },
            alpha_table: linear,
        }
    }

    fn mip_level(&self, i: usize) -> Texels<'_> {
        match i.checked_sub(1).and_then(|i| self.smaller_levels.get(i)) {
            Some(l) => Texels { width: l.width as i32, height: l.height as i32, rgba: &l.rgba },
            None => Texels {
                width: self.image.width as i32,
                height: self.image.height as i32,
                rgba: &self.image.rgba,
            },
        }
    }

    /// Samples the four pixels of a quad: r, g, b, a.
    pub(super) fn sample(&self, sampler: &Sampler, [u, v]: [F4; 2]) -> [F4; 4] {
        let lod = self.level_of_detail(&u.0, &v.0);
        let (level, blend, linear) = self.select_levels(sampler, lod);
        let mut out = [F4::ZERO; 4];
        let (near, far) = (self.mip_level(level), self.mip_level(level + 1));
        for i in 0..4 {
            let mut rgba = self.filter(&near, sampler, linear, u.0[i], v.0[i]);
            if blend > 0.0 {
                let other = self.filter(&far, sampler, linear, u.0[i], v.0[i]);
                rgba = rgba * (1.0 - blend) + other * blend;
            }
            for (out, c) in out.iter_mut().zip(rgba.0) {
                out.0[i] = c;
            }
        }
        out
    }

    /// Width of the whole image in texels.
    pub(super) fn width(&self) -> f32 {
        self.image.width as f32
    }

    /// Samples at a given level of detail, not below 0: r, g, b, a.
    pub(crate) fn sample_level(&self, sampler: &Sampler, [u, v]: [f32; 2], lod: f32) -> F4 {
        let (level, blend, linear) = self.select_levels(sampler, lod);
        let near = self.filter(&self.mip_level(level), sampler, linear, u, v);
        if blend == 0.0 {
            return near;
        }
        near * (1.0 - blend) + self.filter(&self.mip_level(level + 1), sampler, linear, u, v) * blend
    }

    /// The level to read, the weight of the next level, and whether texels are interpolated.
    fn select_levels(&self, sampler: &Sampler, lod: f32) -> (usize, f32, bool) {
        let last = self.smaller_levels.len() as f32;
        let magnified = lod <= 0.0;
        let linear = if magnified { sampler.mag_linear } else { sampler.min_linear };
        let (level, blend) = match sampler.mip_linear {
            _ if magnified || last == 0.0 => (0, 0.0),
            None => (0, 0.0),
            // "nearest": ⌈λ + ½⌉ − 1
            Some(false) => ((lod.min(last) + 0.5).ceil() as usize - 1, 0.0),
            Some(true) => {
                let lod = lod.min(last);
                (lod as usize, lod - lod.floor())
            }
        };
        (level, blend, linear)
    }

    /// λ = log₂ of the longer of the two axes of the pixel's footprint, in texels. It is computed from the quad's first pixel and
    /// its neighbors, as lavapipe does.
    fn level_of_detail(&self, u: &[f32; 4], v: &[f32; 4]) -> f32 {
        let (w, h) = (self.image.width as f32, self.image.height as f32);
        let length_squared = |i: usize| {
            let (du, dv) = ((u[i] - u[0]) * w, (v[i] - v[0]) * h);
            du * du + dv * dv
        };
        let (x, y) = (length_squared(1), length_squared(2));
        let rho_squared = if x > y { x } else { y };
        // NaN and infinity (behind the camera) select the finest level.
        if rho_squared > 1.0 && rho_squared < f32::MAX { 0.5 * libm::log2f(rho_squared) } else { 0.0 }
    }

    #[inline(always)]
    fn filter(&self, t: &Texels, sampler: &Sampler, linear: bool, u: f32, v: f32) -> F4 {
        if !linear {
            let x = nearest_texel(sampler.wrap_u, u, t.width);
            let y = nearest_texel(sampler.wrap_v, v, t.height);
            return self.texel(t, x, y);
        }
        let (x0, x1, fx) = texel_pair(sampler.wrap_u, u, t.width);
        let (y0, y1, fy) = texel_pair(sampler.wrap_v, v, t.height);
        let top = self.texel(t, x0, y0) * (1.0 - fx) + self.texel(t, x1, y0) * fx;
        let bottom = self.texel(t, x0, y1) * (1.0 - fx) + self.texel(t, x1, y1) * fx;
        top * (1.0 - fy) + bottom * fy
    }

    #[inline(always)]
    fn texel(&self, t: &Texels, x: i32, y: i32) -> F4 {
        let at = (y as usize * t.width as usize + x as usize) * 4;
        let c = &t.rgba[at..at + 4];
        F4([
            self.color_table[c[0] as usize],
            self.color_table[c[1] as usize],
            self.color_table[c[2] as usize],
            self.alpha_table[c[3] as usize],
        ])
    }
}

/// Wraps a coordinate to the range in which `wrap_index` is exact: [0, 1], or [0, 2] if mirrored.
#[inline(always)]
fn wrap_coordinate(wrap: Wrap, u: f32) -> f32 {
    match wrap {
        Wrap::Repeat => u - floor(u),
        Wrap::MirroredRepeat => u - 2.0 * floor(u * 0.5),
        Wrap::ClampToEdge => u.clamp(0.0, 1.0),
    }
}

/// Rounds down without a call where the instruction set has no rounding instruction.
#[inline(always)]
fn floor(v: f32) -> f32 {
    if v.abs() < 8_388_608.0 {
        let t = v as i32 as f32;
        if t > v { t - 1.0 } else { t }
    } else {
        v
    }
}

/// Wraps an index to a row of `size` texels. The result is valid for any index, also for one from a NaN coordinate.
#[inline(always)]
fn wrap_index(wrap: Wrap, i: i32, size: i32) -> i32 {
    let i = match wrap {
        Wrap::Repeat if i < 0 => i + size,
        Wrap::Repeat if i >= size => i - size,
        Wrap::MirroredRepeat if i >= size => 2 * size - 1 - i,
        // Mirrored, the index before the first texel is the first texel, and so is the index at 2·size.
        _ => i,
    };
    i.max(0).min(size - 1)
}

#[inline(always)]
fn nearest_texel(wrap: Wrap, u: f32, size: i32) -> i32 {
    wrap_index(wrap, floor(wrap_coordinate(wrap, u) * size as f32) as i32, size)
}

#[inline(always)]
fn texel_pair(wrap: Wrap, u: f32, size: i32) -> (i32, i32, f32) {
    let x = wrap_coordinate(wrap, u) * size as f32 - 0.5;
    let f = floor(x);
    let i = f as i32;
    (wrap_index(wrap, i, size), wrap_index(wrap, i.saturating_add(1), size), x - f)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp_texture(width: u32, mipmaps: bool) -> Texture {
        let rgba = (0..width).flat_map(|x| [x as u8 * 10, 0, 0, 255]).collect();
        let image = Arc::new(Image { name: String::new(), width, height: 1, rgba, file: None });
        Texture::new(&TextureResource { image, srgb: false, mipmaps, hash: [0; 16], streamed: None })
    }

    fn sample_red(t: &Texture, s: &Sampler, u: f32) -> f32 {
        t.sample(s, [F4::splat(u), F4::splat(0.5)])[0].0[0] * 255.0
    }

    #[test]
    fn wrap_modes_select_expected_texels() {
        let t = ramp_texture(4, false);
        for (wrap, expected) in [
            (Wrap::Repeat, [20.0, 30.0, 0.0, 10.0, 20.0, 30.0, 0.0, 10.0, 20.0]),
            (Wrap::MirroredRepeat, [10.0, 0.0, 0.0, 10.0, 20.0, 30.0, 30.0, 20.0, 10.0]),
            (Wrap::ClampToEdge, [0.0, 0.0, 0.0, 10.0, 20.0, 30.0, 30.0, 30.0, 30.0]),
        ] {
            for linear in [false, true] {
                let s = Sampler {
                    wrap_u: wrap,
                    wrap_v: wrap,
                    mag_linear: linear,
                    min_linear: linear,
                    mip_linear: None,
                };
                // Texel centers −2 … 6: filtering changes nothing there.
                for (i, e) in expected.iter().enumerate() {
                    let u = (i as f32 - 2.0 + 0.5) / 4.0;
                    assert!((sample_red(&t, &s, u) - e).abs() < 1e-4, "{wrap:?} linear {linear} texel {i}");
                }
            }
            let s = Sampler { wrap_u: wrap, ..Sampler::default() };
            for u in [f32::NAN, f32::INFINITY, -1e30, 1e30, f32::NEG_INFINITY] {
                assert!(
                    sample_red(&t, &s, u).is_finite() || !u.is_finite(),
                    "a finite coordinate gives a finite color"
                );
            }
        }
    }

    #[test]
    fn linear_filter_halfway_between_texels_gives_their_mean() {
        let s = Sampler { wrap_u: Wrap::Repeat, ..Sampler::default() };
        let t = ramp_texture(4, false);
        assert!((sample_red(&t, &s, 0.5) - 15.0).abs() < 1e-4);
        assert!((sample_red(&t, &s, 0.0) - 15.0).abs() < 1e-4, "between the last (30) and the first (0)");
    }

    #[test]
    fn mip_level_matches_the_pixel_footprint() {
        let t = ramp_texture(16, true);
        let level_red = |step: f32| {
            let u = F4([0.5, 0.5 + step, 0.5, 0.5 + step]);
            t.sample(&Sampler::default(), [u, F4::splat(0.5)])[0].0[0] * 255.0
        };
        // A step of 16 texels per pixel: the 1×1 level, the mean of 0, 10 … 150.
        assert!((level_red(1.0) - 75.0).abs() < 0.51);
        assert!((level_red(1.0 / 16.0) - 75.0).abs() < 0.51, "between texels 7 and 8 of level 0");
        let u = F4([0.53125, 0.53125 + 0.5, 0.53125, 0.53125 + 0.5]);
        let nearest = Sampler { mip_linear: Some(false), min_linear: false, ..Sampler::default() };
        // 8 texels per pixel: level 3 of 2 texels, the right one is the mean of 80 … 150.
        assert!((t.sample(&nearest, [u, F4::splat(0.5)])[0].0[0] * 255.0 - 115.0).abs() < 0.51);
    }
}
