//! Sixteen floats in an AVX-512 register, only for skinning of vertices: a matrix fills one register.

use super::avx::Avx;
use super::vertices::{Lanes, Rows, TOO_FEW_VERTICES, Vertices};
use glam::Affine3A;
use std::arch::x86_64::*;

/// Values exist only inside `run_avx512`, which is entered after a check of the processor: that makes the calls of intrinsics
/// below sound. They work on values, or load and store whole references.
#[derive(Clone, Copy)]
pub(crate) struct Avx512(__m512);

const COUNT: usize = 16;
const _: () = assert!(size_of::<Affine3A>() == size_of::<__m512>(), "a matrix fills a register");

impl Lanes for Avx512 {
    const COUNT: usize = COUNT;
    #[inline(always)]
    fn splat(v: f32) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx512` (see `Avx512`).
        Avx512(unsafe { _mm512_set1_ps(v) })
    }
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx512` (see `Avx512`).
        Avx512(unsafe { _mm512_add_ps(self.0, b.0) })
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx512` (see `Avx512`).
        Avx512(unsafe { _mm512_sub_ps(self.0, b.0) })
    }
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx512` (see `Avx512`).
        Avx512(unsafe { _mm512_mul_ps(self.0, b.0) })
    }
    #[inline(always)]
    fn fused_add(self, b: Self, c: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx512` (see `Avx512`).
        Avx512(unsafe { _mm512_fmadd_ps(self.0, b.0, c.0) })
    }
    #[inline(always)]
    fn fused_sub(self, b: Self, c: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx512` (see `Avx512`).
        Avx512(unsafe { _mm512_fmsub_ps(self.0, b.0, c.0) })
    }
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx512` (see `Avx512`).
        Avx512(unsafe { _mm512_div_ps(self.0, b.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx512` (see `Avx512`).
        Avx512(unsafe { _mm512_sqrt_ps(self.0) })
    }
    #[inline(always)]
    fn flip_sign_by(self, by: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx512` (see `Avx512`).
        Avx512(unsafe { _mm512_xor_ps(self.0, _mm512_and_ps(by.0, _mm512_set1_ps(-0.0))) })
    }
    #[inline(always)]
    fn less(self, b: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx512` (see `Avx512`).
        Avx512(unsafe {
            _mm512_castsi512_ps(_mm512_movm_epi32(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, b.0)))
        })
    }
    #[inline(always)]
    fn and(self, b: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx512` (see `Avx512`).
        Avx512(unsafe { _mm512_and_ps(self.0, b.0) })
    }
    #[inline(always)]
    fn all(mask: Self) -> bool {
        // SAFETY: computes on register values alone, and runs inside `run_avx512` (see `Avx512`).
        unsafe { _mm512_movepi32_mask(_mm512_castps_si512(mask.0)) == 0xFFFF }
    }
    #[inline(always)]
    fn select(mask: Self, yes: Self, no: Self) -> Self {
        // SAFETY: computes on register values alone, and runs inside `run_avx512` (see `Avx512`).
        Avx512(unsafe {
            _mm512_mask_blend_ps(_mm512_movepi32_mask(_mm512_castps_si512(mask.0)), no.0, yes.0)
        })
    }
}

impl Vertices for Avx512 {
    type Eight = Avx;
    type Matrix = Avx512;
    type Four = [Avx512; 3];

    #[inline(always)]
    fn zero_matrix() -> Self {
        Avx512::splat(0.0)
    }
    #[inline(always)]
    fn scaled_matrix(matrix: &Affine3A, weight: f32) -> Self {
        Avx512::load_matrix(matrix).mul(Avx512::splat(weight))
    }
    #[inline(always)]
    fn add_scaled_matrix(sum: Self, matrix: &Affine3A, weight: f32) -> Self {
        Avx512::load_matrix(matrix).fused_add(Avx512::splat(weight), sum)
    }
    #[inline(always)]
    fn interleave_four([a, b, c, d]: [Self; 4]) -> [Self; 3] {
        // Each quarter holds a column: x y z w of four vertices become components.
        // SAFETY: computes on register values alone, and runs inside `run_avx512` (see `Avx512`).
        unsafe {
            let (ab, cd) = (_mm512_unpacklo_ps(a.0, b.0), _mm512_unpacklo_ps(c.0, d.0));
            let (ab_z, cd_z) = (_mm512_unpackhi_ps(a.0, b.0), _mm512_unpackhi_ps(c.0, d.0));
            [
                Avx512(_mm512_shuffle_ps::<0b01_00_01_00>(ab, cd)),
                Avx512(_mm512_shuffle_ps::<0b11_10_11_10>(ab, cd)),
                Avx512(_mm512_shuffle_ps::<0b01_00_01_00>(ab_z, cd_z)),
            ]
        }
    }
    #[inline(always)]
    fn join_columns(fours: [[Self; 3]; 4]) -> Rows<Self> {
        let mut columns = [fours[0]; 4];
        for component in 0..3 {
            let [a, b, c, d] = fours;
            let all = [a[component].0, b[component].0, c[component].0, d[component].0];
            // SAFETY: computes on register values alone, and runs inside `run_avx512` (see `Avx512`).
            let quarters = unsafe { transpose_quarters(all) };
            for column in 0..4 {
                columns[column][component] = Avx512(quarters[column]);
            }
        }
        columns
    }
    #[inline(always)]
    fn join_halves(fours: [[Avx; 4]; 4]) -> [[Self; 4]; 2] {
        let mut out = [[Avx512::splat(0.0); 4]; 2];
        let [a, b, c, d] = fours;
        for component in 0..4 {
            let (a, b, c, d) = (a[component].0, b[component].0, c[component].0, d[component].0);
            // SAFETY: computes on register values alone, and runs inside `run_avx512` (see `Avx512`).
            unsafe {
                let ab = _mm512_insertf32x8::<1>(_mm512_castps256_ps512(a), b);
                let cd = _mm512_insertf32x8::<1>(_mm512_castps256_ps512(c), d);
                out[0][component] = Avx512(_mm512_shuffle_f32x4::<0b10_00_10_00>(ab, cd));
                out[1][component] = Avx512(_mm512_shuffle_f32x4::<0b11_01_11_01>(ab, cd));
            }
        }
        out
    }
    #[inline(always)]
    fn load_point_rows(points: &[[f32; 3]]) -> [Self; 3] {
        load_points(points.first_chunk().expect(TOO_FEW_VERTICES))
    }
    #[inline(always)]
    fn store_point_rows(rows: [Self; 3], points: &mut [[f32; 3]]) {
        store_points(rows, points.first_chunk_mut().expect(TOO_FEW_VERTICES));
    }
}

impl Avx512 {
    #[inline(always)]
    fn load_matrix(matrix: &Affine3A) -> Self {
        // A `Vec3A` is an SSE register on x86-64: four floats, none of them padding. An `Affine3A` is four of them.
        let from: *const f32 = std::ptr::from_ref(matrix).cast();
        // SAFETY: inside `run_avx512`; a borrowed matrix is as large as the register, as asserted above.
        Avx512(unsafe { _mm512_loadu_ps(from) })
    }
}

/// Transposes the quarters of four registers: all first quarters together, all second ones, and so on.
#[inline(always)]
unsafe fn transpose_quarters([a, b, c, d]: [__m512; 4]) -> [__m512; 4] {
    // SAFETY: on values alone; the caller is inside `run_avx512`.
    unsafe {
        let (ab, cd) =
            (_mm512_shuffle_f32x4::<0b01_00_01_00>(a, b), _mm512_shuffle_f32x4::<0b01_00_01_00>(c, d));
        let (ab_23, cd_23) =
            (_mm512_shuffle_f32x4::<0b11_10_11_10>(a, b), _mm512_shuffle_f32x4::<0b11_10_11_10>(c, d));
        [
            _mm512_shuffle_f32x4::<0b10_00_10_00>(ab, cd),
            _mm512_shuffle_f32x4::<0b11_01_11_01>(ab, cd),
            _mm512_shuffle_f32x4::<0b10_00_10_00>(ab_23, cd_23),
            _mm512_shuffle_f32x4::<0b11_01_11_01>(ab_23, cd_23),
        ]
    }
}

/// Indices of the floats that two permutations take: the first from two registers, the second from the result and a third.
type PermuteIndices = [[[i32; COUNT]; 2]; 3];

/// Positions of each component among the 48 floats of the points.
static LOAD_INDICES: PermuteIndices = {
    let mut indices = [[[0; COUNT]; 2]; 3];
    let mut i = 0;
    while i < 48 {
        let (vertex, component) = (i / 3, i % 3);
        if i < 32 {
            indices[component][0][vertex] = i as i32;
            indices[component][1][vertex] = vertex as i32;
        } else {
            indices[component][1][vertex] = (i - 16) as i32;
        }
        i += 1;
    }
    indices
};

/// Positions of the components in each register of the points' 48 floats.
static STORE_INDICES: PermuteIndices = {
    let mut indices = [[[0; COUNT]; 2]; 3];
    let mut i = 0;
    while i < 48 {
        let (vertex, component) = (i / 3, i % 3);
        let (register, lane) = (i / COUNT, i % COUNT);
        if component < 2 {
            indices[register][0][lane] = (16 * component + vertex) as i32;
            indices[register][1][lane] = lane as i32;
        } else {
            indices[register][1][lane] = (16 + vertex) as i32;
        }
        i += 1;
    }
    indices
};

#[inline(always)]
unsafe fn permute_twice(indices: &[[i32; COUNT]; 2], [a, b, c]: [__m512; 3]) -> __m512 {
    // SAFETY: the caller is inside `run_avx512`; both loads are of 16 borrowed numbers, which need no alignment.
    unsafe {
        let first = _mm512_loadu_si512(indices[0].as_ptr().cast());
        let second = _mm512_loadu_si512(indices[1].as_ptr().cast());
        _mm512_permutex2var_ps(_mm512_permutex2var_ps(a, first, b), second, c)
    }
}

#[inline(always)]
fn load_points(points: &[[f32; 3]; COUNT]) -> [Avx512; 3] {
    let from: *const f32 = points.as_ptr().cast();
    // SAFETY: inside `run_avx512`; 48 floats are borrowed, and three times 16 are read.
    unsafe {
        let all = [_mm512_loadu_ps(from), _mm512_loadu_ps(from.add(16)), _mm512_loadu_ps(from.add(32))];
        [
            Avx512(permute_twice(&LOAD_INDICES[0], all)),
            Avx512(permute_twice(&LOAD_INDICES[1], all)),
            Avx512(permute_twice(&LOAD_INDICES[2], all)),
        ]
    }
}

#[inline(always)]
fn store_points([x, y, z]: [Avx512; 3], points: &mut [[f32; 3]; COUNT]) {
    let to: *mut f32 = points.as_mut_ptr().cast();
    for (register, indices) in STORE_INDICES.iter().enumerate() {
        // SAFETY: inside `run_avx512`; 48 floats are borrowed to be written, 16 for each of the three registers.
        unsafe { _mm512_storeu_ps(to.add(16 * register), permute_twice(indices, [x.0, y.0, z.0])) };
    }
}
