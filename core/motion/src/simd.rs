//! Eight floats at a time: one set of kernels, two ways to run them, the same bits.
//!
//! A kernel is written once over [`F8`]. [`Level::Portable`] computes on arrays, [`Level::Avx2`] on AVX registers;
//! both do the same IEEE operations in the same order, without fused multiply-add, so that every machine gives the
//! same bits. (The arrays alone, compiled for AVX2, were tried: the compiler vectorised the arithmetic, but not the
//! shuffles of the matrix kernel, which then took twice the time.)

use crate::{LANES, Lane};
use glam::{Affine3A, Vec3A};

/// How kernels run. The result is the same, bit for bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    Portable,
    /// Falls back to `Portable` where the processor lacks it.
    Avx2,
}

impl Level {
    /// The fastest that this machine has.
    pub fn best() -> Level {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return Level::Avx2;
        }
        Level::Portable
    }
}

/// Work that is compiled for each level. `run` must be `#[inline(always)]`, with all that it calls, to be so.
pub(crate) trait Kernel {
    fn run<F: F8>(self);
}

#[inline]
pub(crate) fn dispatch<K: Kernel>(level: Level, kernel: K) {
    #[cfg(target_arch = "x86_64")]
    if level == Level::Avx2 && std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2, as just asked.
        return unsafe { run_avx2(kernel) };
    }
    let _ = level;
    kernel.run::<Array>();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2<K: Kernel>(kernel: K) {
    kernel.run::<avx::Avx>();
}

// AVX-512VL (the same lanes, twice the registers) was tried: no faster, sampling 10 % slower.

/// Eight floats; for matrices, two halves of four.
pub(crate) trait F8: Copy {
    fn load(lane: &Lane) -> Self;
    fn store(self, lane: &mut Lane);
    fn splat(v: f32) -> Self;
    fn add(self, b: Self) -> Self;
    fn sub(self, b: Self) -> Self;
    fn mul(self, b: Self) -> Self;
    fn div(self, b: Self) -> Self;
    fn sqrt(self) -> Self;
    /// `-self` in the lanes where `by` has its sign bit set.
    fn flipped_by(self, by: Self) -> Self;
    /// All bits set where equal.
    fn equals(self, b: Self) -> Self;
    /// All bits set where less; not where NaN.
    fn less(self, b: Self) -> Self;
    /// `yes` in the lanes where the mask has its sign bit set.
    fn select(mask: Self, yes: Self, no: Self) -> Self;

    /// The same four floats in both halves.
    fn both(half: &[f32; 4]) -> Self;
    /// Zeros, then the four floats.
    fn upper(half: &[f32; 4]) -> Self;
    /// Each half filled with its component I.
    fn spread<const I: usize>(self) -> Self;
    /// The four floats of both halves.
    fn store_halves(self, out: &mut [[f32; 4]; 2]);
    fn load_halves(halves: &[[f32; 4]; 2]) -> Self;
    /// From component rows of two matrix columns, the columns side by side, one pair a joint:
    /// `(ax ay az az | bx by bz bz)`.
    fn column_pairs(a: [Self; 3], b: [Self; 3]) -> [Self; LANES];
    /// Component rows of four column pairs, those of the first columns in the lower half; the fourth components are dropped.
    fn half_rows(pairs: [Self; 4]) -> [Self; 3];
    /// The inverse of `column_pairs`: component rows of both columns, of the half rows of four pairs and of the next four.
    fn joined_rows(first: [Self; 3], next: [Self; 3]) -> [[Self; 3]; 2];
    /// As `half_rows`, with the fourth components.
    fn half_rows4(pairs: [Self; 4]) -> [Self; 4];
    /// As `joined_rows`.
    fn joined_rows4(first: [Self; 4], next: [Self; 4]) -> [[Self; 4]; 2];
    /// The dot product of each half, in all of its components: (0 + 1) + (2 + 3).
    fn dot_halves(self, b: Self) -> Self;
    /// A matrix: its first two columns, its third and the translation. The fourth components may hold anything.
    fn of_matrix(matrix: &Affine3A) -> [Self; 2];
    /// Component rows of eight points.
    fn load_points(points: &[[f32; 3]; LANES]) -> [Self; 3];
    fn store_points(rows: [Self; 3], points: &mut [[f32; 3]; LANES]);
    /// Eight whole numbers that lie bit by bit behind each other, lowest bits first.
    fn unpack(bytes: &[u8; 16], width: &Width) -> Self;
}

/// How numbers of so many bits are taken out of 16 bytes.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
pub(crate) struct Width {
    /// Four bytes a lane: where they lie; 128 is a zero.
    bytes: [u8; 4 * LANES],
    /// Bits of a lane's bytes that belong to the lane before.
    shift: [u32; LANES],
    mask: [u32; LANES],
}

/// By bits, 0 to 16.
pub(crate) static WIDTHS: [Width; 17] = {
    let mut all = [Width { bytes: [128; 4 * LANES], shift: [0; LANES], mask: [0; LANES] }; 17];
    let mut bits = 0;
    while bits <= 16 {
        let mut lane = 0;
        while lane < LANES {
            let mut byte = 0;
            while byte < 4 {
                let at = lane * bits / 8 + byte;
                if at < 16 {
                    all[bits].bytes[4 * lane + byte] = at as u8;
                }
                byte += 1;
            }
            all[bits].shift[lane] = (lane * bits % 8) as u32;
            all[bits].mask[lane] = (1 << bits) - 1;
            lane += 1;
        }
        bits += 1;
    }
    all
};

/// Three rows. Kernels call functions like this one rather than `map` with a closure: a closure that is not inlined is
/// compiled without AVX, and then each intrinsic in it becomes a call (three times the time, once measured).
#[inline(always)]
pub(crate) fn load3<F: F8>(rows: &[Lane; 3]) -> [F; 3] {
    [F::load(&rows[0]), F::load(&rows[1]), F::load(&rows[2])]
}

/// Four rows.
#[inline(always)]
pub(crate) fn load4<F: F8>(rows: &[Lane; 4]) -> [F; 4] {
    [F::load(&rows[0]), F::load(&rows[1]), F::load(&rows[2]), F::load(&rows[3])]
}

/// The specification of [`F8`]: plain arrays.
#[derive(Clone, Copy)]
pub(crate) struct Array([f32; LANES]);

impl Array {
    #[inline(always)]
    fn map2(self, b: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Array(std::array::from_fn(|i| f(self.0[i], b.0[i])))
    }
}

fn mask_of(set: bool) -> f32 {
    f32::from_bits(if set { u32::MAX } else { 0 })
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
    fn splat(v: f32) -> Self {
        Array([v; LANES])
    }
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        self.map2(b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        self.map2(b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        self.map2(b, |a, b| a * b)
    }
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        self.map2(b, |a, b| a / b)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Array(self.0.map(f32::sqrt))
    }
    #[inline(always)]
    fn flipped_by(self, by: Self) -> Self {
        self.map2(by, |a, b| f32::from_bits(a.to_bits() ^ (b.to_bits() & (1 << 31))))
    }
    #[inline(always)]
    fn equals(self, b: Self) -> Self {
        self.map2(b, |a, b| mask_of(a == b))
    }
    #[inline(always)]
    fn less(self, b: Self) -> Self {
        self.map2(b, |a, b| mask_of(a < b))
    }
    #[inline(always)]
    fn select(mask: Self, yes: Self, no: Self) -> Self {
        Array(std::array::from_fn(|i| if mask.0[i].is_sign_negative() { yes.0[i] } else { no.0[i] }))
    }
    #[inline(always)]
    fn both(half: &[f32; 4]) -> Self {
        let [a, b, c, d] = *half;
        Array([a, b, c, d, a, b, c, d])
    }
    #[inline(always)]
    fn upper(half: &[f32; 4]) -> Self {
        let [a, b, c, d] = *half;
        Array([0.0, 0.0, 0.0, 0.0, a, b, c, d])
    }
    #[inline(always)]
    fn spread<const I: usize>(self) -> Self {
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
    fn joined_rows(first: [Self; 3], next: [Self; 3]) -> [[Self; 3]; 2] {
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
    fn joined_rows4(first: [Self; 4], next: [Self; 4]) -> [[Self; 4]; 2] {
        let half = |row: usize, from: usize| {
            Array(std::array::from_fn(
                |i| if i < 4 { first[row].0[from + i] } else { next[row].0[from + i - 4] },
            ))
        };
        [0, 4].map(|from| [half(0, from), half(1, from), half(2, from), half(3, from)])
    }
    #[inline(always)]
    fn dot_halves(self, b: Self) -> Self {
        let p = self.mul(b).0;
        let (low, high) = ((p[0] + p[1]) + (p[2] + p[3]), (p[4] + p[5]) + (p[6] + p[7]));
        Array([low, low, low, low, high, high, high, high])
    }
    #[inline(always)]
    fn of_matrix(matrix: &Affine3A) -> [Self; 2] {
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
    #[inline(always)]
    fn unpack(bytes: &[u8; 16], width: &Width) -> Self {
        let byte = |at: u8| bytes.get(usize::from(at)).copied().unwrap_or(0);
        Array(std::array::from_fn(|lane| {
            let word = u32::from_le_bytes(std::array::from_fn(|i| byte(width.bytes[4 * lane + i])));
            ((word >> width.shift[lane]) & width.mask[lane]) as f32
        }))
    }
}

#[cfg(target_arch = "x86_64")]
mod avx {
    use super::{F8, LANES, Lane, Width};
    use glam::Affine3A;
    use std::arch::x86_64::*;

    /// Only ever made inside `run_avx2`, which is entered after asking the processor: that is what makes each
    /// `unsafe` below sound, all of which only call AVX intrinsics on values, or load and store whole references.
    #[derive(Clone, Copy)]
    pub(crate) struct Avx(__m256);

    impl F8 for Avx {
        #[inline(always)]
        fn load(lane: &Lane) -> Self {
            // A `Lane` is 32 bytes, 32-byte aligned.
            Avx(unsafe { _mm256_load_ps(lane.0.as_ptr()) })
        }
        #[inline(always)]
        fn store(self, lane: &mut Lane) {
            unsafe { _mm256_store_ps(lane.0.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn splat(v: f32) -> Self {
            Avx(unsafe { _mm256_set1_ps(v) })
        }
        #[inline(always)]
        fn add(self, b: Self) -> Self {
            Avx(unsafe { _mm256_add_ps(self.0, b.0) })
        }
        #[inline(always)]
        fn sub(self, b: Self) -> Self {
            Avx(unsafe { _mm256_sub_ps(self.0, b.0) })
        }
        #[inline(always)]
        fn mul(self, b: Self) -> Self {
            Avx(unsafe { _mm256_mul_ps(self.0, b.0) })
        }
        #[inline(always)]
        fn div(self, b: Self) -> Self {
            Avx(unsafe { _mm256_div_ps(self.0, b.0) })
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            Avx(unsafe { _mm256_sqrt_ps(self.0) })
        }
        #[inline(always)]
        fn flipped_by(self, by: Self) -> Self {
            Avx(unsafe { _mm256_xor_ps(self.0, _mm256_and_ps(by.0, _mm256_set1_ps(-0.0))) })
        }
        #[inline(always)]
        fn equals(self, b: Self) -> Self {
            Avx(unsafe { _mm256_cmp_ps::<_CMP_EQ_OQ>(self.0, b.0) })
        }
        #[inline(always)]
        fn less(self, b: Self) -> Self {
            Avx(unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, b.0) })
        }
        #[inline(always)]
        fn select(mask: Self, yes: Self, no: Self) -> Self {
            Avx(unsafe { _mm256_blendv_ps(no.0, yes.0, mask.0) })
        }
        #[inline(always)]
        fn both(half: &[f32; 4]) -> Self {
            Avx(unsafe {
                let half = _mm_loadu_ps(half.as_ptr());
                _mm256_set_m128(half, half)
            })
        }
        #[inline(always)]
        fn upper(half: &[f32; 4]) -> Self {
            Avx(unsafe {
                let both = Self::both(half).0;
                _mm256_blend_ps::<0xF0>(_mm256_setzero_ps(), both)
            })
        }
        #[inline(always)]
        fn spread<const I: usize>(self) -> Self {
            Avx(unsafe {
                match I {
                    0 => _mm256_permute_ps::<0x00>(self.0),
                    1 => _mm256_permute_ps::<0x55>(self.0),
                    2 => _mm256_permute_ps::<0xAA>(self.0),
                    _ => _mm256_permute_ps::<0xFF>(self.0),
                }
            })
        }
        #[inline(always)]
        fn store_halves(self, out: &mut [[f32; 4]; 2]) {
            unsafe { _mm256_storeu_ps(out.as_mut_ptr().cast(), self.0) }
        }
        #[inline(always)]
        fn load_halves(halves: &[[f32; 4]; 2]) -> Self {
            Avx(unsafe { _mm256_loadu_ps(halves.as_ptr().cast()) })
        }
        #[inline(always)]
        fn column_pairs(a: [Self; 3], b: [Self; 3]) -> [Self; LANES] {
            unsafe {
                let mut low = [_mm256_setzero_ps(); 3];
                let mut high = low;
                for c in 0..3 {
                    low[c] = _mm256_permute2f128_ps::<0x20>(a[c].0, b[c].0);
                    high[c] = _mm256_permute2f128_ps::<0x31>(a[c].0, b[c].0);
                }
                let [a0, a1, a2, a3] = columns(low);
                let [a4, a5, a6, a7] = columns(high);
                [Avx(a0), Avx(a1), Avx(a2), Avx(a3), Avx(a4), Avx(a5), Avx(a6), Avx(a7)]
            }
        }
        #[inline(always)]
        fn half_rows(p: [Self; 4]) -> [Self; 3] {
            let [x, y, z] = unsafe { rows([p[0].0, p[1].0, p[2].0, p[3].0]) };
            [Avx(x), Avx(y), Avx(z)]
        }
        #[inline(always)]
        fn joined_rows(first: [Self; 3], next: [Self; 3]) -> [[Self; 3]; 2] {
            let (mut a, mut b) = (first, next);
            for c in 0..3 {
                a[c] = first[c].lower_halves(next[c]);
                b[c] = first[c].upper_halves(next[c]);
            }
            [a, b]
        }
        #[inline(always)]
        fn half_rows4(p: [Self; 4]) -> [Self; 4] {
            unsafe {
                let (ab, cd) = (_mm256_unpacklo_ps(p[0].0, p[1].0), _mm256_unpacklo_ps(p[2].0, p[3].0));
                let (ab_zw, cd_zw) = (_mm256_unpackhi_ps(p[0].0, p[1].0), _mm256_unpackhi_ps(p[2].0, p[3].0));
                [
                    Avx(_mm256_shuffle_ps::<0b01_00_01_00>(ab, cd)),
                    Avx(_mm256_shuffle_ps::<0b11_10_11_10>(ab, cd)),
                    Avx(_mm256_shuffle_ps::<0b01_00_01_00>(ab_zw, cd_zw)),
                    Avx(_mm256_shuffle_ps::<0b11_10_11_10>(ab_zw, cd_zw)),
                ]
            }
        }
        #[inline(always)]
        fn joined_rows4(first: [Self; 4], next: [Self; 4]) -> [[Self; 4]; 2] {
            let (mut a, mut b) = (first, next);
            for c in 0..4 {
                a[c] = first[c].lower_halves(next[c]);
                b[c] = first[c].upper_halves(next[c]);
            }
            [a, b]
        }
        #[inline(always)]
        fn dot_halves(self, b: Self) -> Self {
            unsafe {
                let p = _mm256_mul_ps(self.0, b.0);
                let pairs = _mm256_add_ps(p, _mm256_permute_ps::<0b10_11_00_01>(p));
                Avx(_mm256_add_ps(pairs, _mm256_permute_ps::<0b01_00_11_10>(pairs)))
            }
        }
        #[inline(always)]
        fn of_matrix(matrix: &Affine3A) -> [Self; 2] {
            // On x86-64 a `Vec3A` is an SSE register: four floats, none of them padding.
            let from: *const f32 = std::ptr::from_ref(matrix).cast();
            unsafe { [Avx(_mm256_loadu_ps(from)), Avx(_mm256_loadu_ps(from.add(8)))] }
        }
        #[inline(always)]
        fn load_points(points: &[[f32; 3]; LANES]) -> [Self; 3] {
            // The 24 floats as six quarters of eight points; then the shuffles of Intel's "3D Vector Normalization
            // Using 256-Bit AVX" (S. Kaufmann, 2011).
            let from: *const f32 = points.as_ptr().cast();
            unsafe {
                let m03 = _mm256_loadu2_m128(from.add(12), from);
                let m14 = _mm256_loadu2_m128(from.add(16), from.add(4));
                let m25 = _mm256_loadu2_m128(from.add(20), from.add(8));
                let xy = _mm256_shuffle_ps::<0b10_01_11_10>(m14, m25);
                let yz = _mm256_shuffle_ps::<0b01_00_10_01>(m03, m14);
                [
                    Avx(_mm256_shuffle_ps::<0b10_00_11_00>(m03, xy)),
                    Avx(_mm256_shuffle_ps::<0b11_01_10_00>(yz, xy)),
                    Avx(_mm256_shuffle_ps::<0b11_00_11_01>(yz, m25)),
                ]
            }
        }
        #[inline(always)]
        fn store_points([x, y, z]: [Self; 3], points: &mut [[f32; 3]; LANES]) {
            let to: *mut f32 = points.as_mut_ptr().cast();
            unsafe {
                let xy = _mm256_shuffle_ps::<0b10_00_10_00>(x.0, y.0);
                let yz = _mm256_shuffle_ps::<0b11_01_11_01>(y.0, z.0);
                let zx = _mm256_shuffle_ps::<0b11_01_10_00>(z.0, x.0);
                let m03 = _mm256_shuffle_ps::<0b10_00_10_00>(xy, zx);
                let m14 = _mm256_shuffle_ps::<0b11_01_10_00>(yz, xy);
                let m25 = _mm256_shuffle_ps::<0b11_01_11_01>(zx, yz);
                _mm256_storeu2_m128(to.add(12), to, m03);
                _mm256_storeu2_m128(to.add(16), to.add(4), m14);
                _mm256_storeu2_m128(to.add(20), to.add(8), m25);
            }
        }
        #[inline(always)]
        fn unpack(bytes: &[u8; 16], width: &Width) -> Self {
            // A `Width` is aligned to 32 bytes, and so is each of its three parts.
            unsafe {
                let bytes = _mm256_broadcastsi128_si256(_mm_loadu_si128(bytes.as_ptr().cast()));
                let words = _mm256_shuffle_epi8(bytes, _mm256_load_si256(width.bytes.as_ptr().cast()));
                let shifted = _mm256_srlv_epi32(words, _mm256_load_si256(width.shift.as_ptr().cast()));
                let numbers = _mm256_and_si256(shifted, _mm256_load_si256(width.mask.as_ptr().cast()));
                Avx(_mm256_cvtepi32_ps(numbers))
            }
        }
    }

    impl Avx {
        #[inline(always)]
        fn lower_halves(self, b: Self) -> Self {
            Avx(unsafe { _mm256_permute2f128_ps::<0x20>(self.0, b.0) })
        }
        #[inline(always)]
        fn upper_halves(self, b: Self) -> Self {
            Avx(unsafe { _mm256_permute2f128_ps::<0x31>(self.0, b.0) })
        }
    }

    /// Component rows of four column pairs, in each half.
    #[inline(always)]
    unsafe fn rows([a, b, c, d]: [__m256; 4]) -> [__m256; 3] {
        unsafe {
            let (ab, cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
            let (ab_z, cd_z) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
            [
                _mm256_shuffle_ps::<0b01_00_01_00>(ab, cd),
                _mm256_shuffle_ps::<0b11_10_11_10>(ab, cd),
                _mm256_shuffle_ps::<0b01_00_01_00>(ab_z, cd_z),
            ]
        }
    }

    /// Rows x, y, z of four joints in each half, to a column x y z z of each.
    #[inline(always)]
    unsafe fn columns([x, y, z]: [__m256; 3]) -> [__m256; 4] {
        unsafe {
            let low = _mm256_unpacklo_ps(x, y);
            let high = _mm256_unpackhi_ps(x, y);
            [
                _mm256_shuffle_ps::<0b00_00_01_00>(low, z),
                _mm256_shuffle_ps::<0b01_01_11_10>(low, z),
                _mm256_shuffle_ps::<0b10_10_01_00>(high, z),
                _mm256_shuffle_ps::<0b11_11_11_10>(high, z),
            ]
        }
    }
}
