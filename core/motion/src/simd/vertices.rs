//! Register operations for skinning, on as many vertices at a time as a register has lanes.

use super::{F8, Level, portable::Array};
use glam::{Affine3A, Vec3};

/// A register of floats.
pub(crate) trait Lanes: Copy {
    const COUNT: usize;
    fn splat(v: f32) -> Self;
    fn add(self, b: Self) -> Self;
    fn sub(self, b: Self) -> Self;
    fn mul(self, b: Self) -> Self;
    /// `self * b + c`, rounded once.
    fn fused_add(self, b: Self, c: Self) -> Self;
    /// `self * b - c`, rounded once.
    fn fused_sub(self, b: Self, c: Self) -> Self;
    fn div(self, b: Self) -> Self;
    fn sqrt(self) -> Self;
    /// `-self` in the lanes where `by` has its sign bit set.
    fn flip_sign_by(self, by: Self) -> Self;
    /// Mask with all bits set in the lanes that are less; none in lanes with NaN.
    fn less(self, b: Self) -> Self;
    /// Mask of the lanes that are set in both masks.
    fn and(self, b: Self) -> Self;
    /// Whether a mask is set in all lanes.
    fn all(mask: Self) -> bool;
    /// `yes` in the lanes where the mask has its sign bit set.
    fn select(mask: Self, yes: Self, no: Self) -> Self;
}

/// Component rows of four matrix columns, one vertex per lane.
pub(crate) type Rows<F> = [[F; 3]; 4];

/// Registers with one vertex per lane, at most sixteen.
pub(crate) trait Vertices: Lanes {
    /// Eight floats.
    type Eight: F8;
    /// The four columns of one matrix.
    type Matrix: Copy;
    /// The columns of four vertices' matrices, component by component.
    type Four: Copy;

    fn zero_matrix() -> Self::Matrix;
    /// Matrix times weight.
    fn scaled_matrix(matrix: &Affine3A, weight: f32) -> Self::Matrix;
    /// Sum plus matrix times weight, rounded once.
    fn add_scaled_matrix(sum: Self::Matrix, matrix: &Affine3A, weight: f32) -> Self::Matrix;
    fn interleave_four(matrices: [Self::Matrix; 4]) -> Self::Four;
    /// Columns of all vertices, from groups of four; groups beyond the lanes are not read.
    fn join_columns(fours: [Self::Four; 4]) -> Rows<Self>;
    /// Component rows of the lower and of the upper four floats, from as many groups of four vertices as the lanes hold, each
    /// from [`F8::half_rows4`].
    fn join_halves(fours: [[Self::Eight; 4]; 4]) -> [[Self; 4]; 2];
    /// Component rows of the first points. Panics if there are fewer points than lanes.
    fn load_point_rows(points: &[[f32; 3]]) -> [Self; 3];
    /// Stores component rows to the first points. Panics if there are fewer points than lanes.
    fn store_point_rows(rows: [Self; 3], points: &mut [[f32; 3]]);
}

impl<F: F8> Vertices for F {
    type Eight = F;
    type Matrix = [F; 2];
    type Four = [[F; 3]; 2];

    #[inline(always)]
    fn zero_matrix() -> [F; 2] {
        [F::splat(0.0); 2]
    }
    #[inline(always)]
    fn scaled_matrix(matrix: &Affine3A, weight: f32) -> [F; 2] {
        let ([x, y], weight) = (F::load_matrix(matrix), F::splat(weight));
        [x.mul(weight), y.mul(weight)]
    }
    #[inline(always)]
    fn add_scaled_matrix(sum: [F; 2], matrix: &Affine3A, weight: f32) -> [F; 2] {
        let ([x, y], weight) = (F::load_matrix(matrix), F::splat(weight));
        [x.fused_add(weight, sum[0]), y.fused_add(weight, sum[1])]
    }
    #[inline(always)]
    fn interleave_four([a, b, c, d]: [[F; 2]; 4]) -> [[F; 3]; 2] {
        [F::half_rows([a[0], b[0], c[0], d[0]]), F::half_rows([a[1], b[1], c[1], d[1]])]
    }
    #[inline(always)]
    fn join_columns([[a01, a23], [b01, b23], _, _]: [[[F; 3]; 2]; 4]) -> Rows<F> {
        let ([c0, c1], [c2, c3]) = (F::join_rows(a01, b01), F::join_rows(a23, b23));
        [c0, c1, c2, c3]
    }
    #[inline(always)]
    fn join_halves([a, b, _, _]: [[F; 4]; 4]) -> [[F; 4]; 2] {
        F::join_rows4(a, b)
    }
    #[inline(always)]
    fn load_point_rows(points: &[[f32; 3]]) -> [F; 3] {
        F::load_points(points.first_chunk().expect(TOO_FEW_VERTICES))
    }
    #[inline(always)]
    fn store_point_rows(rows: [F; 3], points: &mut [[f32; 3]]) {
        F::store_points(rows, points.first_chunk_mut().expect(TOO_FEW_VERTICES));
    }
}

const _: () = assert!(size_of::<Vec3>() == size_of::<[f32; 3]>() && align_of::<Vec3>() == align_of::<f32>());

/// Points as arrays of their components.
#[inline(always)]
pub(crate) fn as_arrays(points: &[Vec3]) -> &[[f32; 3]] {
    // SAFETY: a `Vec3` is three floats in their order (`repr(C)`), as just asserted without padding; all floats are valid.
    unsafe { std::slice::from_raw_parts(points.as_ptr().cast(), points.len()) }
}

/// Points as mutable arrays of their components.
#[inline(always)]
pub(crate) fn as_arrays_mut(points: &mut [Vec3]) -> &mut [[f32; 3]] {
    // SAFETY: as in `as_arrays`.
    unsafe { std::slice::from_raw_parts_mut(points.as_mut_ptr().cast(), points.len()) }
}

/// Panic message for a block with too few vertices.
pub(super) const TOO_FEW_VERTICES: &str = "the slice holds fewer vertices than the register has lanes";

/// A [`super::Kernel`] over vertices.
pub(crate) trait VertexKernel {
    fn run<F: Vertices>(self);
}

#[inline]
pub(crate) fn dispatch_vertices<K: VertexKernel>(level: Level, kernel: K) {
    #[cfg(target_arch = "x86_64")]
    {
        let has_fma =
            std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma");
        if level == Level::Avx512 && super::has_avx512() && has_fma {
            // SAFETY: the processor has what the function is compiled for, as just asked.
            return unsafe { run_avx512(kernel) };
        }
        if level != Level::Portable && has_fma {
            // SAFETY: the processor has AVX2 and FMA, as just asked.
            return unsafe { run_avx2(kernel) };
        }
    }
    let _ = level;
    kernel.run::<Array>();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn run_avx2<K: VertexKernel>(kernel: K) {
    kernel.run::<super::avx::Avx>();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,avx512f,avx512dq")]
fn run_avx512<K: VertexKernel>(kernel: K) {
    kernel.run::<super::avx512::Avx512>();
}
