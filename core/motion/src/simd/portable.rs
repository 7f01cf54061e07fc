//! Eight floats in an array, on any processor.

use super::{Bits, F8, Lanes, fused::fused_multiply_add};
use crate::simd::lane::{LANES, Lane};
use glam::{Affine3A, Vec3A};

/// Reference implementation of [`F8`] on plain arrays.
#[derive(Clone, Copy)]
pub(crate) struct Array([f32; LANES]);

impl Array {
    #[inline(always)]
    fn map_pairs(self, b: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Array(std::array::from_fn(|i| f(self.0[i], b.0[i])))
    }
}

fn mask_of(set: bool) -> f32 {
    f32::from_bits(if set { u32::MAX } else { 0 })
}

impl Lanes for Array {
    const COUNT: usize = LANES;
    #[inline(always)]
    fn splat(v: f32) -> Self {
        Array([v; LANES])
    }
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        self.map_pairs(b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        self.map_pairs(b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        self.map_pairs(b, |a, b| a * b)
    }
    #[inline(always)]
    fn fused_add(self, b: Self, c: Self) -> Self {
        Array(std::array::from_fn(|i| fused_multiply_add(self.0[i], b.0[i], c.0[i])))
    }
    #[inline(always)]
    fn fused_sub(self, b: Self, c: Self) -> Self {
        Array(std::array::from_fn(|i| fused_multiply_add(self.0[i], b.0[i], -c.0[i])))
    }
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        self.map_pairs(b, |a, b| a / b)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Array(self.0.map(f32::sqrt))
    }
    #[inline(always)]
    fn flip_sign_by(self, by: Self) -> Self {
        self.map_pairs(by, |a, b| f32::from_bits(a.to_bits() ^ (b.to_bits() & (1 << 31))))
    }
    #[inline(always)]
    fn less(self, b: Self) -> Self {
        self.map_pairs(b, |a, b| mask_of(a < b))
    }
    #[inline(always)]
    fn and(self, b: Self) -> Self {
        self.map_pairs(b, |a, b| f32::from_bits(a.to_bits() & b.to_bits()))
    }
    #[inline(always)]
    fn all(mask: Self) -> bool {
        mask.0.iter().all(|m| m.is_sign_negative())
    }
    #[inline(always)]
    fn select(mask: Self, yes: Self, no: Self) -> Self {
        Array(std::array::from_fn(|i| if mask.0[i].is_sign_negative() { yes.0[i] } else { no.0[i] }))
    }
}

impl F8 for Array {
    #[inline(always)]
    fn load(lane: &Lane) -> Self {
        Array(lane.0)
    }
    #[inline(always)]
    fn store(self, lane: &mut Lane) {
        lane.0 = self.0;
    }
    #[inline(always)]
    fn equals(self, b: Self) -> Self {
        self.map_pairs(b, |a, b| mask_of(a == b))
    }
    #[inline(always)]
    fn load_twice(half: &[f32; 4]) -> Self {
        let [a, b, c, d] = *half;
        Array([a, b, c, d, a, b, c, d])
    }
    #[inline(always)]
    fn load_upper_half(half: &[f32; 4]) -> Self {
        let [a, b, c, d] = *half;
        Array([0.0, 0.0, 0.0, 0.0, a, b, c, d])
    }
    #[inline(always)]
    fn broadcast_component<const I: usize>(self) -> Self {
        let (a, b) = (self.0[I], self.0[4 + I]);
        Array([a, a, a, a, b, b, b, b])
    }
    #[inline(always)]
    fn store_halves(self, out: &mut [[f32; 4]; 2]) {
        let [a, b, c, d, e, f, g, h] = self.0;
        *out = [[a, b, c, d], [e, f, g, h]];
    }
    #[inline(always)]
    fn load_halves([low, high]: &[[f32; 4]; 2]) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (*low, *high);
        Array([a, b, c, d, e, f, g, h])
    }
    #[inline(always)]
    fn column_pairs(a: [Self; 3], b: [Self; 3]) -> [Self; LANES] {
        std::array::from_fn(|i| {
            let ([ax, ay, az], [bx, by, bz]) = (a.map(|r| r.0[i]), b.map(|r| r.0[i]));
            Array([ax, ay, az, az, bx, by, bz, bz])
        })
    }
    #[inline(always)]
    fn half_rows(pairs: [Self; 4]) -> [Self; 3] {
        let [x, y, z, _] = Self::half_rows4(pairs);
        [x, y, z]
    }
    #[inline(always)]
    fn join_rows(first: [Self; 3], next: [Self; 3]) -> [[Self; 3]; 2] {
        let half = |row: usize, from: usize| {
            Array(std::array::from_fn(
                |i| if i < 4 { first[row].0[from + i] } else { next[row].0[from + i - 4] },
            ))
        };
        [0, 4].map(|from| [half(0, from), half(1, from), half(2, from)])
    }
    #[inline(always)]
    fn half_rows4(pairs: [Self; 4]) -> [Self; 4] {
        std::array::from_fn(|c| Array(std::array::from_fn(|i| pairs[i % 4].0[c + i / 4 * 4])))
    }
    #[inline(always)]
    fn join_rows4(first: [Self; 4], next: [Self; 4]) -> [[Self; 4]; 2] {
        let half = |row: usize, from: usize| {
            Array(std::array::from_fn(
                |i| if i < 4 { first[row].0[from + i] } else { next[row].0[from + i - 4] },
            ))
        };
        [0, 4].map(|from| [half(0, from), half(1, from), half(2, from), half(3, from)])
    }
    #[inline(always)]
    fn flip_weights_to_hemisphere(fours: [&[f32; 4]; 4], p: &[f32; 4], weights: &[f32; 4]) -> [f32; 4] {
        std::array::from_fn(|i| {
            let q = fours[i];
            let dot = (q[0] * p[0] + q[2] * p[2]) + (q[1] * p[1] + q[3] * p[3]);
            f32::from_bits(weights[i].to_bits() ^ (dot.to_bits() & (1 << 31)))
        })
    }
    #[inline(always)]
    fn load_matrix(matrix: &Affine3A) -> [Self; 2] {
        let pair = |a: Vec3A, b: Vec3A| Array([a.x, a.y, a.z, 0.0, b.x, b.y, b.z, 0.0]);
        let m = &matrix.matrix3;
        [pair(m.x_axis, m.y_axis), pair(m.z_axis, matrix.translation)]
    }
    #[inline(always)]
    fn load_points(points: &[[f32; 3]; LANES]) -> [Self; 3] {
        std::array::from_fn(|component| Array(std::array::from_fn(|i| points[i][component])))
    }
    #[inline(always)]
    fn store_points(rows: [Self; 3], points: &mut [[f32; 3]; LANES]) {
        for (i, point) in points.iter_mut().enumerate() {
            *point = [rows[0].0[i], rows[1].0[i], rows[2].0[i]];
        }
    }
    type Unpacking = Bits;
    fn unpacking(bits: &Bits) -> Bits {
        *bits
    }
    #[inline(always)]
    fn unpack(bytes: &[u8; 16], bits: Bits) -> Self {
        Array(std::array::from_fn(|lane| {
            let word =
                u32::from_le_bytes(std::array::from_fn(|i| bytes[(usize::from(bits.from[lane]) + i) % 16]));
            (word.wrapping_shl(bits.left[lane].into()).wrapping_shr(bits.right[lane].into())) as f32
        }))
    }
}
