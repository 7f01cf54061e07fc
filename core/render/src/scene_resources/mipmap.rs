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

/// Number of levels of a full mip chain.
pub fn level_count(width: u32, height: u32) -> u32 {
    32 - width.max(height).max(1).leading_zeros()
}

/// All levels below the image itself, down to 1×1: each is half of the one above, rounded down. An odd side is covered by three
/// taps weighted by their overlap, so that no texel is dropped. Colors are not weighted by alpha, as a sampler's filter does not
/// weight them.
///
/// Values are not rounded between levels. Level 1 is kept row by row, since its float values take as much memory as the image.
pub fn levels_below(image: &Image, srgb: bool) -> Vec<MipLevel> {
    let decode = if srgb { srgb_to_linear_table() } else { unorm_table() };
    let (w, h) = (image.width.max(1) as usize, image.height.max(1) as usize);
    let texel = |x: usize, y: usize| -> [f32; 4] {
        let at = (y * w + x) * 4;
        let c = &image.rgba[at..at + 4];
        [decode[c[0] as usize], decode[c[1] as usize], decode[c[2] as usize], c[3] as f32 * (1.0 / 255.0)]
    };
    let mut out = Vec::new();
    if w == 1 && h == 1 {
        return out;
    }
    let first = Downsampler::new(w, h);
    let mut bytes = vec![0u8; first.width * first.height * 4];
    let mut above = vec![[0.0f32; 4]; first.width * first.height];
    if first.width == 1 && first.height == 1 {
        first.compute_row(0, texel, &mut above);
        encode(&above, &mut bytes, srgb);
        out.push(first.to_level(bytes));
        return out;
    }
    let second = Downsampler::new(first.width, first.height);
    above = vec![[0.0; 4]; second.width * second.height];
    let two_rows = 2 * first.width * 4;
    above.par_chunks_mut(second.width).zip(bytes.par_chunks_mut(two_rows)).enumerate().for_each(
        |(y, (row, bytes))| {
            let covered = filter_taps(y, first.height, second.height);
            let mut rows = vec![[0.0f32; 4]; covered.count * first.width];
            for (i, row) in rows.chunks_exact_mut(first.width).enumerate() {
                first.compute_row(covered.first + i, texel, row);
            }
            for (row, bytes) in rows.chunks_exact(first.width).zip(bytes.chunks_exact_mut(first.width * 4)) {
                encode(row, bytes, srgb);
            }
            second.compute_row(y, |x, y| rows[(y - covered.first) * first.width + x], row);
        },
    );
    if first.height == 2 * second.height + 1 {
        // The last row of an odd height covers a third row.
        let mut row = vec![[0.0f32; 4]; first.width];
        first.compute_row(first.height - 1, texel, &mut row);
        let at = (first.height - 1) * first.width * 4;
        encode(&row, &mut bytes[at..], srgb);
    }
    out.push(first.to_level(bytes));
    let mut last = second;
    loop {
        let mut bytes = vec![0u8; last.width * last.height * 4];
        let texels = above.par_chunks(last.width);
        bytes
            .par_chunks_mut(last.width * 4)
            .zip(texels)
            .for_each(|(bytes, texels)| encode(texels, bytes, srgb));
        out.push(last.to_level(bytes));
        if last.width == 1 && last.height == 1 {
            return out;
        }
        let next = Downsampler::new(last.width, last.height);
        let mut level = vec![[0.0f32; 4]; next.width * next.height];
        let fetch = |x: usize, y: usize| above[y * last.width + x];
        level.par_chunks_mut(next.width).enumerate().for_each(|(y, row)| next.compute_row(y, fetch, row));
        above = level;
        last = next;
    }
}

/// A level of half the size of the one above.
struct Downsampler {
    width: usize,
    height: usize,
    /// Height of the level above.
    above: usize,
    columns: Vec<Taps>,
}

impl Downsampler {
    fn new(w: usize, h: usize) -> Downsampler {
        let (width, height) = ((w / 2).max(1), (h / 2).max(1));
        Downsampler {
            width,
            height,
            above: h,
            columns: (0..width).map(|x| filter_taps(x, w, width)).collect(),
        }
    }

    fn compute_row(&self, y: usize, above: impl Fn(usize, usize) -> [f32; 4], out: &mut [[f32; 4]]) {
        let rows = filter_taps(y, self.above, self.height);
        for (texel, columns) in out.iter_mut().zip(&self.columns) {
            let mut sum = [0.0f32; 4];
            for (dy, wy) in rows.weights[..rows.count].iter().enumerate() {
                for (dx, wx) in columns.weights[..columns.count].iter().enumerate() {
                    let c = above(columns.first + dx, rows.first + dy);
                    let weight = wx * wy;
                    for (s, c) in sum.iter_mut().zip(c) {
                        *s += c * weight;
                    }
                }
            }
            *texel = sum;
        }
    }

    fn to_level(&self, rgba: Vec<u8>) -> MipLevel {
        MipLevel { width: self.width as u32, height: self.height as u32, rgba }
    }
}

fn encode(texels: &[[f32; 4]], bytes: &mut [u8], srgb: bool) {
    for (b, t) in bytes.chunks_exact_mut(4).zip(texels) {
        for i in 0..3 {
            b[i] = if srgb { linear_to_srgb8(t[i]) } else { unorm8(t[i]) };
        }
        b[3] = unorm8(t[3]);
    }
}

struct Taps {
    first: usize,
    count: usize,
    weights: [f32; 3],
}

/// The texels of a side of `size` that texel `i` of a side of `half` covers, with their weights.
fn filter_taps(i: usize, size: usize, half: usize) -> Taps {
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

/// The nearest sRGB code. Thresholds are the decoded values of code + ½. A table indexed by the upper bits finds the code to
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
        Image { name: String::new(), width, height, rgba, file: None }
    }

    #[test]
    fn every_srgb_code_round_trips() {
        for (i, v) in srgb_to_linear_table().iter().enumerate() {
            assert_eq!(linear_to_srgb8(*v) as usize, i);
        }
        assert_eq!(linear_to_srgb8(f32::NAN), 0);
        assert_eq!(linear_to_srgb8(2.0), 255);
        assert_eq!(linear_to_srgb8(-1.0), 0);
    }

    #[test]
    fn srgb_encoding_gives_the_nearest_code() {
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
    fn odd_sides_drop_no_texel() {
        // One bright texel anywhere in a row of 5 gives the same 1×1 average: 51 of 255.
        for bright in 0..5 {
            let mut rgba = vec![0u8; 20];
            rgba[bright * 4] = 255;
            let levels = levels_below(&image(5, 1, rgba), false);
            assert_eq!(levels.iter().map(|l| (l.width, l.height)).collect::<Vec<_>>(), [(2, 1), (1, 1)]);
            assert_eq!(levels[1].rgba[0], 51, "texel {bright}");
        }
    }

    /// Reference: level by level, each kept whole, with the same sums in the same order.
    fn reference_levels(image: &Image, srgb: bool) -> Vec<MipLevel> {
        let decode = if srgb { srgb_to_linear_table() } else { unorm_table() };
        let (mut w, mut h) = (image.width as usize, image.height as usize);
        let texels = image.rgba.as_chunks::<4>().0.iter();
        let color = |c: &[u8; 4]| {
            let [r, g, b] = [0, 1, 2].map(|i| decode[usize::from(c[i])]);
            [r, g, b, f32::from(c[3]) * (1.0 / 255.0)]
        };
        let mut above: Vec<[f32; 4]> = texels.map(color).collect();
        let mut out = Vec::new();
        while w > 1 || h > 1 {
            let next = Downsampler::new(w, h);
            let mut level = vec![[0.0; 4]; next.width * next.height];
            for (y, row) in level.chunks_exact_mut(next.width).enumerate() {
                next.compute_row(y, |x, y| above[y * w + x], row);
            }
            let mut bytes = vec![0; 4 * level.len()];
            encode(&level, &mut bytes, srgb);
            out.push(next.to_level(bytes));
            (w, h, above) = (next.width, next.height, level);
        }
        out
    }

    #[test]
    fn row_by_row_levels_equal_whole_levels() {
        for (width, height) in
            [(1, 1), (2, 1), (1, 3), (3, 2), (5, 7), (7, 5), (16, 16), (31, 9), (1, 40), (40, 1), (13, 27)]
        {
            let rgba =
                (0..4 * width * height).map(|i: u32| (i.wrapping_mul(2_654_435_761) >> 23) as u8).collect();
            let image = image(width, height, rgba);
            for srgb in [true, false] {
                assert_eq!(levels_below(&image, srgb), reference_levels(&image, srgb), "{width}×{height}");
            }
        }
    }

    #[test]
    fn level_count_of_full_chains() {
        assert_eq!(
            [level_count(1, 1), level_count(2, 1), level_count(5, 3), level_count(1024, 1024)],
            [1, 2, 3, 11]
        );
        assert_eq!(levels_below(&image(1, 1, vec![1, 2, 3, 4]), true), []);
    }
}
