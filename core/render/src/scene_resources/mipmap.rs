//! Mipmaps, computed once on the CPU for both renderers: a box filter of the level above, in linear light for sRGB images.

use choreo_asset::{Image, linear_from_srgb};
use rayon::prelude::{IndexedParallelIterator, ParallelIterator, ParallelSlice, ParallelSliceMut};
use std::sync::OnceLock;

/// One level, RGBA8 in the image's own encoding.
#[derive(Clone, Debug, PartialEq)]
pub struct MipLevel {
    pub width: u32,
    pub height: u32,
    pub rgba: Vec<u8>,
}

/// Number of levels of a full chain.
pub fn level_count(width: u32, height: u32) -> u32 {
    32 - width.max(height).max(1).leading_zeros()
}

/// All levels below the image itself, down to 1×1: each is half of the one above, rounded down. An odd side is covered by three
/// taps weighted by their share, so that nothing is dropped. Colors are not weighted by alpha, nor are they by a sampler's filter.
pub fn levels_below(image: &Image, srgb: bool) -> Vec<MipLevel> {
    let decode = if srgb { srgb_to_linear_table() } else { unorm_table() };
    let mut out = Vec::new();
    // Not rounded from level to level.
    let mut above: Vec<[f32; 4]> = Vec::new();
    let (mut w, mut h) = (image.width.max(1) as usize, image.height.max(1) as usize);
    while w > 1 || h > 1 {
        let (nw, nh) = ((w / 2).max(1), (h / 2).max(1));
        let columns: Vec<Taps> = (0..nw).map(|x| taps(x, w, nw)).collect();
        let fetch = |x: usize, y: usize| -> [f32; 4] {
            if above.is_empty() {
                let at = (y * w + x) * 4;
                let c = &image.rgba[at..at + 4];
                [
                    decode[c[0] as usize],
                    decode[c[1] as usize],
                    decode[c[2] as usize],
                    c[3] as f32 * (1.0 / 255.0),
                ]
            } else {
                above[y * w + x]
            }
        };
        let row = |y: usize, row: &mut [[f32; 4]]| {
            let rows = taps(y, h, nh);
            for (texel, columns) in row.iter_mut().zip(&columns) {
                let mut sum = [0.0f32; 4];
                for (dy, wy) in rows.weights[..rows.count].iter().enumerate() {
                    for (dx, wx) in columns.weights[..columns.count].iter().enumerate() {
                        let c = fetch(columns.first + dx, rows.first + dy);
                        let weight = wx * wy;
                        for (s, c) in sum.iter_mut().zip(c) {
                            *s += c * weight;
                        }
                    }
                }
                *texel = sum;
            }
        };
        let mut level = vec![[0.0f32; 4]; nw * nh];
        level.par_chunks_mut(nw).enumerate().for_each(|(y, r)| row(y, r));
        let mut rgba = vec![0u8; nw * nh * 4];
        rgba.par_chunks_mut(nw * 4).zip(level.par_chunks(nw)).for_each(|(bytes, texels)| {
            for (b, t) in bytes.chunks_exact_mut(4).zip(texels) {
                for i in 0..3 {
                    b[i] = if srgb { linear_to_srgb8(t[i]) } else { unorm8(t[i]) };
                }
                b[3] = unorm8(t[3]);
            }
        });
        out.push(MipLevel { width: nw as u32, height: nh as u32, rgba });
        above = level;
        (w, h) = (nw, nh);
    }
    out
}

struct Taps {
    first: usize,
    count: usize,
    weights: [f32; 3],
}

/// The texels of a side of `size` that texel `i` of a side of `half` covers, and how much of each.
fn taps(i: usize, size: usize, half: usize) -> Taps {
    if size == half {
        return Taps { first: i, count: 1, weights: [1.0, 0.0, 0.0] };
    }
    if size == half * 2 {
        return Taps { first: i * 2, count: 2, weights: [0.5, 0.5, 0.0] };
    }
    // size = 2·half + 1: the texel covers [i·size/half, (i+1)·size/half), in units of 1/half.
    let total = size as f32;
    Taps {
        first: i * 2,
        count: 3,
        weights: [(half - i) as f32 / total, half as f32 / total, (i + 1) as f32 / total],
    }
}

fn unorm8(v: f32) -> u8 {
    (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// Decoded value of each of the 256 sRGB codes (IEC 61966-2-1).
pub fn srgb_to_linear_table() -> &'static [f32; 256] {
    static TABLE: OnceLock<[f32; 256]> = OnceLock::new();
    TABLE.get_or_init(|| std::array::from_fn(|i| linear_from_srgb(i as f64 / 255.0) as f32))
}

fn unorm_table() -> &'static [f32; 256] {
    static TABLE: OnceLock<[f32; 256]> = OnceLock::new();
    TABLE.get_or_init(|| std::array::from_fn(|i| i as f32 / 255.0))
}

/// The nearest sRGB code: the thresholds lie at the decoded values of code + ½. A table by the upper bits finds the code to
/// within one or two steps.
pub fn linear_to_srgb8(v: f32) -> u8 {
    const BITS: usize = 12;
    struct Tables {
        thresholds: [f32; 256],
        first: Vec<u8>,
    }
    static TABLES: OnceLock<Tables> = OnceLock::new();
    let t = TABLES.get_or_init(|| {
        let mut thresholds: [f32; 256] =
            std::array::from_fn(|i| linear_from_srgb((i as f64 + 0.5) / 255.0) as f32);
        thresholds[255] = f32::INFINITY;
        let code_of = |v: f32| thresholds.partition_point(|t| *t <= v).min(255) as u8;
        let first = (0..=(1usize << BITS)).map(|i| code_of(i as f32 / (1 << BITS) as f32)).collect();
        Tables { thresholds, first }
    });
    // NaN clamps to 0.
    let v = if v > 0.0 { v.min(1.0) } else { 0.0 };
    let mut code = t.first[(v * (1 << BITS) as f32) as usize];
    while v >= t.thresholds[code as usize] {
        code += 1;
    }
    code
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: u32, height: u32, rgba: Vec<u8>) -> Image {
        Image { name: String::new(), width, height, rgba }
    }

    #[test]
    fn every_code_survives() {
        for (i, v) in srgb_to_linear_table().iter().enumerate() {
            assert_eq!(linear_to_srgb8(*v) as usize, i);
        }
        assert_eq!(linear_to_srgb8(f32::NAN), 0);
        assert_eq!(linear_to_srgb8(2.0), 255);
        assert_eq!(linear_to_srgb8(-1.0), 0);
    }

    #[test]
    fn nearest_code_against_f64() {
        for i in 0..=100_000u32 {
            let v = i as f32 / 100_000.0;
            let x = v as f64;
            let e = if x <= 0.0031308 { x * 12.92 } else { 1.055 * libm::pow(x, 1.0 / 2.4) - 0.055 };
            assert!((linear_to_srgb8(v) as f64 - e * 255.0).abs() <= 0.501, "{v}");
        }
    }

    #[test]
    fn black_and_white_average_in_linear_light() {
        let two = image(2, 1, vec![0, 0, 0, 255, 255, 255, 255, 255]);
        // Half the light of white is code 188 in sRGB, 128 in a linear image.
        assert_eq!(levels_below(&two, true)[0].rgba, [188, 188, 188, 255]);
        assert_eq!(levels_below(&two, false)[0].rgba, [128, 128, 128, 255]);
    }

    #[test]
    fn odd_sides_lose_nothing() {
        // One bright texel anywhere in a row of 5 gives the same 1×1 average: 51 of 255.
        for bright in 0..5 {
            let mut rgba = vec![0u8; 20];
            rgba[bright * 4] = 255;
            let levels = levels_below(&image(5, 1, rgba), false);
            assert_eq!(levels.iter().map(|l| (l.width, l.height)).collect::<Vec<_>>(), [(2, 1), (1, 1)]);
            assert_eq!(levels[1].rgba[0], 51, "texel {bright}");
        }
    }

    #[test]
    fn counts() {
        assert_eq!(
            [level_count(1, 1), level_count(2, 1), level_count(5, 3), level_count(1024, 1024)],
            [1, 2, 3, 11]
        );
        assert_eq!(levels_below(&image(1, 1, vec![1, 2, 3, 4]), true), []);
    }
}
