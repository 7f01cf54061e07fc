//! Dithering of images in which neighboring colors differ by less than one 8-bit code: backgrounds (gradients, the sky, and fog
//! over them), and whole images that stay floats until the end, after effects on images and motion blur.
//!
//! A channel between two codes takes the upper one at as many pixels as its share of the step, so that the mean is exact. A fixed
//! table of blue-noise ranks selects these pixels, by void-and-cluster (R. Ulichney, "The void-and-cluster method for dither
//! array generation", SPIE 1913, 1993), so equal frames stay equal. A color that is exactly a code stays that code; in a target
//! of 16-bit floats, so does a color within [`MARGIN`] of it.
//! Counterpart: `shaders/dither.wgsl`.

use crate::scene_resources::mipmap::{linear_to_srgb8, srgb_to_linear_table};
use glam::Vec4;
use std::fmt::Write;
use std::sync::LazyLock;

/// Pixels along each side of the table, a power of two.
pub(crate) const SIDE: usize = 16;
const COUNT: usize = SIDE * SIDE;
/// Standard deviation of the Gaussian by which neighbors count, in pixels; Ulichney's choice.
const SIGMA: f64 = 1.5;

/// Largest distance, in codes, at which a color of a float target is taken for the code. 16-bit floats are off by at most 1/12 of
/// a code on devices that truncate (2⁻¹¹ at a light of ½, where a code is 0.006 wide), and by half of that on devices that round.
pub(crate) const MARGIN: f32 = 3.0 / 32.0;

/// Rank of each pixel of the table: every number below `COUNT`, once.
static RANKS: LazyLock<[u8; COUNT]> = LazyLock::new(ranks);

/// Linear color of a pixel with its first three channels dithered to 8-bit codes.
pub(crate) fn dithered(color: Vec4, x: usize, y: usize) -> Vec4 {
    let threshold = threshold(x, y);
    let channel = |linear: f32| srgb_to_linear_table()[usize::from(code(linear, threshold))];
    Vec4::new(channel(color.x), channel(color.y), channel(color.z), color.w)
}

/// Dithered 8-bit codes of a pixel of a float target. `color` is linear; alpha is rounded.
pub(crate) fn dithered_bytes(color: Vec4, x: usize, y: usize) -> [u8; 4] {
    let threshold = (threshold(x, y) - 0.5) * (1.0 - 2.0 * MARGIN) + 0.5;
    let channel = |linear: f32| code(linear, threshold);
    let alpha = if color.w > 0.0 { color.w.min(1.0) } else { 0.0 };
    [channel(color.x), channel(color.y), channel(color.z), (alpha * 255.0 + 0.5) as u8]
}

/// Dither threshold of a pixel, between 0 and 1: the pixel takes the upper code if its share of the step is more than 1 −
/// threshold.
fn threshold(x: usize, y: usize) -> f32 {
    let rank = RANKS[y % SIDE * SIDE + x % SIDE];
    (f32::from(rank) + 0.5) / COUNT as f32
}

/// One of the two codes around a linear value, by the threshold.
#[inline]
fn code(linear: f32, threshold: f32) -> u8 {
    let table = srgb_to_linear_table();
    let nearest = linear_to_srgb8(linear);
    let low = nearest.saturating_sub(u8::from(table[usize::from(nearest)] > linear));
    let high = low.saturating_add(1);
    let [below, above] = [low, high].map(|code| table[usize::from(code)]);
    // The curve is nearly straight within one step.
    if linear - below > (1.0 - threshold) * (above - below) { high } else { low }
}

/// The table in WGSL, four ranks in each number.
pub(crate) fn wgsl_table() -> String {
    let mut text = format!(
        "const dither_margin: f32 = {MARGIN};\nconst dither_side: u32 = {SIDE}u;\nconst dither_ranks = array<u32, {}>(\n",
        COUNT / 4
    );
    for four in RANKS.chunks_exact(4) {
        let word = u32::from_le_bytes([four[0], four[1], four[2], four[3]]);
        let _ = writeln!(text, "    {word}u,");
    }
    text + ");\n"
}

/// Points of a pattern on a torus, and the density of points around each place.
#[derive(Clone)]
struct Pattern {
    is_on: [bool; COUNT],
    energy: [f64; COUNT],
}

impl Pattern {
    fn set(&mut self, at: usize, on: bool) {
        self.is_on[at] = on;
        let sign = if on { 1.0 } else { -1.0 };
        let apart = |a: usize, b: usize| a.abs_diff(b).min(SIDE - a.abs_diff(b));
        for (other, energy) in self.energy.iter_mut().enumerate() {
            let [dx, dy] = [apart(at % SIDE, other % SIDE), apart(at / SIDE, other / SIDE)];
            *energy += sign * libm::exp(-((dx * dx + dy * dy) as f64) / (2.0 * SIGMA * SIGMA));
        }
    }

    /// The tightest cluster among the points (`on`), or the largest void among the gaps; the first of several.
    fn extreme(&self, on: bool) -> usize {
        let energy = |at: &usize| if on { -self.energy[*at] } else { self.energy[*at] };
        let places = (0..COUNT).filter(|at| self.is_on[*at] == on);
        places.min_by(|a, b| energy(a).total_cmp(&energy(b))).unwrap_or(0)
    }
}

fn ranks() -> [u8; COUNT] {
    let mut pattern = Pattern { is_on: [false; COUNT], energy: [0.0; COUNT] };
    // A tenth of the places, spread by a fixed stride.
    let first = COUNT / 10;
    (0..first).for_each(|i| pattern.set(i * 97 % COUNT, true));
    // Points move from the tightest cluster to the largest void, until both are the same place.
    loop {
        let cluster = pattern.extreme(true);
        pattern.set(cluster, false);
        let void = pattern.extreme(false);
        pattern.set(void, true);
        if void == cluster {
            break;
        }
    }
    let mut ranks = [0; COUNT];
    let mut fewer = pattern.clone();
    for rank in (0..first).rev() {
        let cluster = fewer.extreme(true);
        fewer.set(cluster, false);
        ranks[cluster] = rank as u8;
    }
    for rank in first..COUNT {
        let void = pattern.extreme(false);
        pattern.set(void, true);
        ranks[void] = rank as u8;
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_asset::linear_from_srgb;

    #[test]
    fn ranks_are_each_there_once_and_low_ones_apart() {
        let ranks = ranks();
        let mut sorted = ranks;
        sorted.sort_unstable();
        assert!(sorted.iter().enumerate().all(|(i, rank)| i == usize::from(*rank)));
        // Blue noise: at every density up to a half, no two of the lower ranks touch by more than white noise's share.
        let touching = |below: u8| {
            let on = |x: usize, y: usize| ranks[y % SIDE * SIDE + x % SIDE] < below;
            let pairs = (0..COUNT).filter(|i| on(i % SIDE, i / SIDE) && on(i % SIDE + 1, i / SIDE)).count();
            pairs as f64 / f64::from(below)
        };
        for below in [16u8, 32, 64] {
            let white = f64::from(below) / COUNT as f64;
            assert!(touching(below) <= 0.25 * white, "{below}: {} of {white}", touching(below));
        }
    }

    #[test]
    fn codes_stay_and_means_are_exact() {
        for code in 0..=255u8 {
            let linear = srgb_to_linear_table()[usize::from(code)];
            for at in 0..COUNT {
                let out = dithered(Vec4::new(linear, linear, linear, 1.0), at % SIDE, at / SIDE);
                assert_eq!(linear_to_srgb8(out.x), code);
            }
        }
        for code in [3.25, 17.5, 100.125, 128.9, 254.5] {
            let linear = linear_from_srgb(code / 255.0) as f32;
            let sum: f64 = (0..COUNT)
                .map(|at| dithered(Vec4::splat(linear), at % SIDE, at / SIDE).x)
                .map(|linear| f64::from(linear_to_srgb8(linear)))
                .sum();
            assert!((sum / COUNT as f64 - code).abs() < 0.01, "{code}: {}", sum / COUNT as f64);
        }
    }

    #[test]
    fn codes_of_16_bit_floats_stay_and_means_are_within_the_margin() {
        let mean = |linear: f32| {
            let codes = (0..COUNT).map(|at| dithered_bytes(Vec4::splat(linear), at % SIDE, at / SIDE)[1]);
            codes.map(f64::from).sum::<f64>() / COUNT as f64
        };
        for code in 0..=255u8 {
            let linear = srgb_to_linear_table()[usize::from(code)];
            let rounded = half::f16::from_f32(linear);
            let cut_off =
                if rounded.to_f32() > linear { half::f16::from_bits(rounded.to_bits() - 1) } else { rounded };
            for float in [rounded, cut_off] {
                assert_eq!(mean(float.to_f32()), f64::from(code));
            }
        }
        for code in [3.25, 17.5, 100.125, 128.9, 254.5] {
            let off = mean(linear_from_srgb(code / 255.0) as f32) - code;
            assert!(off.abs() <= f64::from(MARGIN), "{code}: {off}");
        }
        for out in [-1.0, f32::NAN] {
            assert_eq!(mean(out), 0.0);
        }
        assert_eq!(mean(7.0), 255.0);
    }
}
