//! Eight floats in an AVX register.

use super::{Bits, F8, Lanes};
use crate::simd::lane::{LANES, Lane};
use glam::Affine3A;
use std::arch::x86_64::*;

/// Values exist only inside `run_avx2`, which is entered after a check of the processor: that makes the calls of AVX intrinsics
/// below sound. They work on values, or load and store whole references.
#[derive(Clone, Copy)]
pub(crate) struct Avx(pub(super) __m256);

impl Lanes for Avx {
    const COUNT: usize = LANES;
    #[inline(always)]
    fn splat(v: f32) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
        Avx(unsafe { _mm256_set1_ps(v) })
    }
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
        Avx(unsafe { _mm256_add_ps(self.0, b.0) })
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
        Avx(unsafe { _mm256_sub_ps(self.0, b.0) })
    }
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
        Avx(unsafe { _mm256_mul_ps(self.0, b.0) })
    }
    // Only skinning of vertices uses fused operations, and it is entered after a check for FMA, too.
    #[inline(always)]
    fn fused_add(self, b: Self, c: Self) -> Self {
        // SAFETY: on values alone, inside the `run_avx2` of vertices, which requires FMA, too.
        Avx(unsafe { _mm256_fmadd_ps(self.0, b.0, c.0) })
    }
    #[inline(always)]
    fn fused_sub(self, b: Self, c: Self) -> Self {
        // SAFETY: on values alone, inside the `run_avx2` of vertices, which requires FMA, too.
        Avx(unsafe { _mm256_fmsub_ps(self.0, b.0, c.0) })
    }
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
        Avx(unsafe { _mm256_div_ps(self.0, b.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
        Avx(unsafe { _mm256_sqrt_ps(self.0) })
    }
    #[inline(always)]
    fn flip_sign_by(self, by: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
        Avx(unsafe { _mm256_xor_ps(self.0, _mm256_and_ps(by.0, _mm256_set1_ps(-0.0))) })
    }
    #[inline(always)]
    fn less(self, b: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
        Avx(unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, b.0) })
    }
    #[inline(always)]
    fn and(self, b: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
        Avx(unsafe { _mm256_and_ps(self.0, b.0) })
    }
    #[inline(always)]
    fn all(mask: Self) -> bool {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
        unsafe { _mm256_movemask_ps(mask.0) == 0xFF }
    }
    #[inline(always)]
    fn select(mask: Self, yes: Self, no: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
        Avx(unsafe { _mm256_blendv_ps(no.0, yes.0, mask.0) })
    }
}

impl F8 for Avx {
    #[inline(always)]
    fn load(lane: &Lane) -> Self {
        // SAFETY: inside `run_avx2`; a `Lane` is 32 bytes, 32-byte aligned.
        Avx(unsafe { _mm256_load_ps(lane.0.as_ptr()) })
    }
    #[inline(always)]
    fn store(self, lane: &mut Lane) {
        // SAFETY: as in `load`; the lane is borrowed to be written.
        unsafe { _mm256_store_ps(lane.0.as_mut_ptr(), self.0) }
    }
    #[inline(always)]
    fn equals(self, b: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
        Avx(unsafe { _mm256_cmp_ps::<_CMP_EQ_OQ>(self.0, b.0) })
    }
    #[inline(always)]
    fn load_twice(half: &[f32; 4]) -> Self {
        // SAFETY: inside `run_avx2`; four floats are borrowed, and need no alignment.
        Avx(unsafe {
            let half = _mm_loadu_ps(half.as_ptr());
            _mm256_set_m128(half, half)
        })
    }
    #[inline(always)]
    fn load_upper_half(half: &[f32; 4]) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
        Avx(unsafe {
            let both = Self::load_twice(half).0;
            _mm256_blend_ps::<0xF0>(_mm256_setzero_ps(), both)
        })
    }
    #[inline(always)]
    fn broadcast_component<const I: usize>(self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
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
        // SAFETY: inside `run_avx2`; eight floats are borrowed to be written, and need no alignment.
        unsafe { _mm256_storeu_ps(out.as_mut_ptr().cast(), self.0) }
    }
    #[inline(always)]
    fn load_halves(halves: &[[f32; 4]; 2]) -> Self {
        // SAFETY: inside `run_avx2`; eight floats are borrowed, and need no alignment.
        Avx(unsafe { _mm256_loadu_ps(halves.as_ptr().cast()) })
    }
    #[inline(always)]
    fn column_pairs(a: [Self; 3], b: [Self; 3]) -> [Self; LANES] {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
        unsafe {
            let mut low = [_mm256_setzero_ps(); 3];
            let mut high = low;
            for c in 0..3 {
                low[c] = _mm256_permute2f128_ps::<0x20>(a[c].0, b[c].0);
                high[c] = _mm256_permute2f128_ps::<0x31>(a[c].0, b[c].0);
            }
            let [a0, a1, a2, a3] = transpose_to_columns(low);
            let [a4, a5, a6, a7] = transpose_to_columns(high);
            [Avx(a0), Avx(a1), Avx(a2), Avx(a3), Avx(a4), Avx(a5), Avx(a6), Avx(a7)]
        }
    }
    #[inline(always)]
    fn half_rows(p: [Self; 4]) -> [Self; 3] {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
        let [x, y, z] = unsafe { transpose_to_rows([p[0].0, p[1].0, p[2].0, p[3].0]) };
        [Avx(x), Avx(y), Avx(z)]
    }
    #[inline(always)]
    fn join_rows(first: [Self; 3], next: [Self; 3]) -> [[Self; 3]; 2] {
        let (mut a, mut b) = (first, next);
        for c in 0..3 {
            a[c] = first[c].lower_halves(next[c]);
            b[c] = first[c].upper_halves(next[c]);
        }
        [a, b]
    }
    #[inline(always)]
    fn half_rows4(p: [Self; 4]) -> [Self; 4] {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
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
    fn join_rows4(first: [Self; 4], next: [Self; 4]) -> [[Self; 4]; 2] {
        let (mut a, mut b) = (first, next);
        for c in 0..4 {
            a[c] = first[c].lower_halves(next[c]);
            b[c] = first[c].upper_halves(next[c]);
        }
        [a, b]
    }
    #[inline(always)]
    fn flip_weights_to_hemisphere(q: [&[f32; 4]; 4], pivot: &[f32; 4], weights: &[f32; 4]) -> [f32; 4] {
        let mut out = [0.0; 4];
        // SAFETY: inside `run_avx2`; every load and the store are of four borrowed floats, which need no alignment.
        unsafe {
            let pivot = _mm_loadu_ps(pivot.as_ptr());
            let a = _mm_mul_ps(_mm_loadu_ps(q[0].as_ptr()), pivot);
            let b = _mm_mul_ps(_mm_loadu_ps(q[1].as_ptr()), pivot);
            let c = _mm_mul_ps(_mm_loadu_ps(q[2].as_ptr()), pivot);
            let d = _mm_mul_ps(_mm_loadu_ps(q[3].as_ptr()), pivot);
            // Sums of components 0 + 2 and 1 + 3: a02 b02 a13 b13, and likewise for c and d.
            let ab = _mm_add_ps(_mm_unpacklo_ps(a, b), _mm_unpackhi_ps(a, b));
            let cd = _mm_add_ps(_mm_unpacklo_ps(c, d), _mm_unpackhi_ps(c, d));
            let dots = _mm_add_ps(_mm_movelh_ps(ab, cd), _mm_movehl_ps(cd, ab));
            let signs = _mm_and_ps(dots, _mm_set1_ps(-0.0));
            _mm_storeu_ps(out.as_mut_ptr(), _mm_xor_ps(_mm_loadu_ps(weights.as_ptr()), signs));
        }
        out
    }
    #[inline(always)]
    fn load_matrix(matrix: &Affine3A) -> [Self; 2] {
        // A `Vec3A` is an SSE register on x86-64: four floats, none of them padding.
        let from: *const f32 = std::ptr::from_ref(matrix).cast();
        // SAFETY: inside `run_avx2`; 16 floats are borrowed, as `local_to_model.rs` asserts of an `Affine3A`, and two times eight are read.
        unsafe { [Avx(_mm256_loadu_ps(from)), Avx(_mm256_loadu_ps(from.add(8)))] }
    }
    #[inline(always)]
    fn load_points(points: &[[f32; 3]; LANES]) -> [Self; 3] {
        // The 24 floats as six quarters of eight points; then the shuffles of Intel's "3D Vector Normalization
        // Using 256-Bit AVX" (S. Kaufmann, 2011).
        let from: *const f32 = points.as_ptr().cast();
        // SAFETY: inside `run_avx2`; 24 floats are borrowed, and the last of four begins at 20.
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
        // SAFETY: inside `run_avx2`; 24 floats are borrowed to be written, and the last of four begins at 20.
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
    type Unpacking = [__m256i; 3];
    #[inline(always)]
    fn unpacking(bits: &Bits) -> [__m256i; 3] {
        // SAFETY: inside `run_avx2`; each load is of the eight bytes of one borrowed array.
        unsafe {
            let wide = [&bits.from, &bits.left, &bits.right];
            let from = _mm256_cvtepu8_epi32(_mm_loadl_epi64(wide[0].as_ptr().cast()));
            // The mask shows the compiler that the counts are below 32; for larger ones it adds a selection to each shift.
            let below_32 = _mm256_set1_epi32(31);
            let left =
                _mm256_and_si256(_mm256_cvtepu8_epi32(_mm_loadl_epi64(wide[1].as_ptr().cast())), below_32);
            let right =
                _mm256_and_si256(_mm256_cvtepu8_epi32(_mm_loadl_epi64(wide[2].as_ptr().cast())), below_32);
            // Index of each lane's first byte, four times; then those of the three bytes after it.
            let first = _mm256_set_epi32(
                0x0C0C_0C0C,
                0x0808_0808,
                0x0404_0404,
                0,
                0x0C0C_0C0C,
                0x0808_0808,
                0x0404_0404,
                0,
            );
            let four = _mm256_add_epi8(_mm256_shuffle_epi8(from, first), _mm256_set1_epi32(0x0302_0100));
            [four, left, right]
        }
    }
    #[inline(always)]
    fn unpack(bytes: &[u8; 16], [four, left, right]: [__m256i; 3]) -> Self {
        // SAFETY: inside `run_avx2`; the load is of 16 borrowed bytes, which need no alignment.
        unsafe {
            let bytes = _mm256_broadcastsi128_si256(_mm_loadu_si128(bytes.as_ptr().cast()));
            // Only the four lowest bits of an index count.
            let words = _mm256_shuffle_epi8(bytes, four);
            Avx(_mm256_cvtepi32_ps(_mm256_srlv_epi32(_mm256_sllv_epi32(words, left), right)))
        }
    }
}

impl Avx {
    #[inline(always)]
    fn lower_halves(self, b: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
        Avx(unsafe { _mm256_permute2f128_ps::<0x20>(self.0, b.0) })
    }
    #[inline(always)]
    fn upper_halves(self, b: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx2` (see `Avx`).
        Avx(unsafe { _mm256_permute2f128_ps::<0x31>(self.0, b.0) })
    }
}

/// Transposes four columns into the rows x, y, z and w, separately in each 128-bit half.
#[inline(always)]
unsafe fn transpose_to_rows([a, b, c, d]: [__m256; 4]) -> [__m256; 3] {
    // SAFETY: on values alone; the caller is inside `run_avx2`.
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
unsafe fn transpose_to_columns([x, y, z]: [__m256; 3]) -> [__m256; 4] {
    // SAFETY: on values alone; the caller is inside `run_avx2`.
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
