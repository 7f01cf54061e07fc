//! SIMD kernels over eight floats at a time, or sixteen for vertices: written once, run at three levels, with the same bits.
//!
//! A kernel is written once over `F8`, or over `Vertices` for skinning. [`Level::Portable`] computes on arrays, [`Level::Avx2`]
//! and [`Level::Avx512`] on registers; all do the same IEEE operations in the same order, so that every machine gives the
//! same bits. Only skinning of vertices fuses multiplications with additions, which saves it a sixth of its time; where the processor
//! cannot, `fused.rs` rounds once by other means. (Arrays alone, compiled for AVX2, were tried: the compiler vectorized the
//! arithmetic, but not the
//! shuffles of the matrix kernel, which then took twice the time.)

#[cfg(target_arch = "x86_64")]
mod avx;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod fused;
mod indexed;
pub(crate) mod lane;
mod portable;
mod streams;
mod vertices;

pub(crate) use indexed::{Indexed, Indices};
pub(crate) use streams::{Block, DeformedBlock, Deformer, VertexStreams};
pub(crate) use vertices::{Lanes, Rows, VertexKernel, Vertices, as_arrays, as_arrays_mut, dispatch_vertices};

use glam::Affine3A;
use lane::{LANES, Lane};
use portable::Array;

/// Instruction set that kernels run on. Results are the same, bit for bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// Plain Rust, on any processor.
    Portable,
    /// AVX2; falls back to `Portable` if the processor lacks it, or, for skinning, lacks FMA.
    Avx2,
    /// AVX-512 for skinning, with sixteen vertices at a time, and `Avx2` for all else; falls back to `Avx2` if the processor
    /// lacks it.
    Avx512,
}

impl Level {
    /// The fastest level that this machine supports.
    pub fn best() -> Level {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return if has_avx512() { Level::Avx512 } else { Level::Avx2 };
        }
        Level::Portable
    }
}

#[cfg(target_arch = "x86_64")]
fn has_avx512() -> bool {
    std::arch::is_x86_feature_detected!("avx512f") && std::arch::is_x86_feature_detected!("avx512dq")
}

/// Work that is compiled for each level. This requires `#[inline(always)]` on `run` and on all functions that it calls.
pub(crate) trait Kernel {
    fn run<F: F8>(self);
}

#[inline]
pub(crate) fn dispatch<K: Kernel>(level: Level, kernel: K) {
    #[cfg(target_arch = "x86_64")]
    if level != Level::Portable && std::arch::is_x86_feature_detected!("avx2") {
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

// AVX-512VL (the same lanes, twice the registers) was tried here: no faster, and sampling 10 % slower.

/// Eight floats; for matrices, two halves of four.
pub(crate) trait F8: Lanes {
    fn load(lane: &Lane) -> Self;
    fn store(self, lane: &mut Lane);
    /// Mask with all bits set in the lanes that are equal.
    fn equals(self, b: Self) -> Self;

    /// The same four floats in both halves.
    fn load_twice(half: &[f32; 4]) -> Self;
    /// Zeros, then the four floats.
    fn load_upper_half(half: &[f32; 4]) -> Self;
    /// Each half filled with its component I.
    fn broadcast_component<const I: usize>(self) -> Self;
    /// Stores the four floats of each half.
    fn store_halves(self, out: &mut [[f32; 4]; 2]);
    fn load_halves(halves: &[[f32; 4]; 2]) -> Self;
    /// Two matrix columns of each joint, side by side, from rows of components:
    /// `(ax ay az az | bx by bz bz)`.
    fn column_pairs(a: [Self; 3], b: [Self; 3]) -> [Self; LANES];
    /// Component rows of four column pairs, those of the first columns in the lower half; the fourth components are dropped.
    fn half_rows(pairs: [Self; 4]) -> [Self; 3];
    /// The inverse of `column_pairs`: component rows of both columns, of the half rows of four pairs and of the next four.
    fn join_rows(first: [Self; 3], next: [Self; 3]) -> [[Self; 3]; 2];
    /// Like `half_rows`, with the fourth components.
    fn half_rows4(pairs: [Self; 4]) -> [Self; 4];
    /// Like `join_rows`, with the fourth components.
    fn join_rows4(first: [Self; 4], next: [Self; 4]) -> [[Self; 4]; 2];
    /// Each weight, negated if the dot product of its four floats and the pivot, summed as (0 + 2) + (1 + 3), is negative.
    fn flip_weights_to_hemisphere(fours: [&[f32; 4]; 4], pivot: &[f32; 4], weights: &[f32; 4]) -> [f32; 4];
    /// A matrix: its first two columns, its third and the translation. The fourth components may hold anything.
    fn load_matrix(matrix: &Affine3A) -> [Self; 2];
    /// Component rows of eight points.
    fn load_points(points: &[[f32; 3]; LANES]) -> [Self; 3];
    fn store_points(rows: [Self; 3], points: &mut [[f32; 3]; LANES]);
    /// [`Bits`] prepared for unpacking many bytes.
    type Unpacking: Copy;
    fn unpacking(bits: &Bits) -> Self::Unpacking;
    /// Unpacks eight consecutive integers, lowest bits first, to floats.
    fn unpack(bytes: &[u8; 16], unpacking: Self::Unpacking) -> Self;
}

/// Layout of eight integers of at most 16 bits each in 16 bytes. A lane without bits yields 0 or 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub(crate) struct Bits {
    /// Index of the byte that holds a lane's first bit; the three bytes after it wrap around from 15 to 0.
    from: [u8; LANES],
    /// Shifts that isolate a lane's bits among these 32: left, to drop higher bits, then right. At most 31, since shifts by 32
    /// and more take three more instructions each.
    left: [u8; LANES],
    right: [u8; LANES],
}

impl Bits {
    /// Layout for the given number of bits of each lane.
    pub(crate) fn new(widths: &[u8; LANES]) -> Bits {
        let mut bits = Bits::default();
        let mut at = 0;
        for (lane, width) in widths.iter().enumerate() {
            bits.from[lane] = at / 8;
            bits.left[lane] = (32 - at % 8 - width).min(31);
            bits.right[lane] = (32 - width).min(31);
            at += width;
        }
        bits
    }

    /// Number of bytes that the eight integers take.
    pub(crate) fn bytes(widths: &[u8; LANES]) -> usize {
        widths.iter().map(|w| usize::from(*w)).sum::<usize>().div_ceil(8)
    }
}

/// Loads three rows. Kernels call functions like this one rather than `map` or `from_fn` with a closure: a closure that is not
/// inlined is
/// compiled without AVX, and then each intrinsic in it becomes a call (three and four times the time, as measured).
#[inline(always)]
pub(crate) fn load3<F: F8>(rows: &[Lane; 3]) -> [F; 3] {
    [F::load(&rows[0]), F::load(&rows[1]), F::load(&rows[2])]
}

/// Loads four rows.
#[inline(always)]
pub(crate) fn load4<F: F8>(rows: &[Lane; 4]) -> [F; 4] {
    [F::load(&rows[0]), F::load(&rows[1]), F::load(&rows[2]), F::load(&rows[3])]
}
