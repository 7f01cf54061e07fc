//! Eight floats at a time, or for vertices sixteen: one set of kernels, three ways to run them, the same bits.
//!
//! A kernel is written once over `F8`, one of skins over `Vertices`. [`Level::Portable`] computes on arrays, [`Level::Avx2`]
//! and [`Level::Avx512`] on registers; all do the same IEEE operations in the same order, so that every machine gives the
//! same bits. Only skinning of vertices fuses multiplications with additions, which saves it a sixth of its time; where the processor
//! cannot, `fused.rs` rounds once by other means. (The arrays alone, compiled for AVX2, were tried: the compiler vectorised the arithmetic, but not the
//! shuffles of the matrix kernel, which then took twice the time.)

#[cfg(target_arch = "x86_64")]
mod avx;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod fused;
mod indexed;
pub mod lane;
mod portable;
mod streams;
mod vertices;

pub(crate) use indexed::{Indexed, Indices};
pub(crate) use streams::{Block, Deformed, Deformer, VertexStreams};
pub(crate) use vertices::{Lanes, Rows, VertexKernel, Vertices, arrays, arrays_mut, dispatch_vertices};

use glam::Affine3A;
use lane::{LANES, Lane};
use portable::Array;

/// How kernels run. The result is the same, bit for bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// Plain Rust, on any processor.
    Portable,
    /// Falls back to `Portable` where the processor lacks it, or in skinning FMA.
    Avx2,
    /// Sixteen vertices at a time in skinning, `Avx2` in all else; falls back to that where the processor lacks it.
    Avx512,
}

impl Level {
    /// The fastest that this machine has.
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

/// Work that is compiled for each level. `run` must be `#[inline(always)]`, with all that it calls, to be so.
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

// Here AVX-512VL (the same lanes, twice the registers) was tried: no faster, sampling 10 % slower.

/// Eight floats; for matrices, two halves of four.
pub(crate) trait F8: Lanes {
    fn load(lane: &Lane) -> Self;
    fn store(self, lane: &mut Lane);
    /// All bits set where equal.
    fn equals(self, b: Self) -> Self;

    /// The same four floats in both halves.
    fn both(half: &[f32; 4]) -> Self;
    /// Zeros, then the four floats.
    fn upper(half: &[f32; 4]) -> Self;
    /// Each half filled with its component I.
    fn spread<const I: usize>(self) -> Self;
    /// The four floats of both halves.
    fn store_halves(self, out: &mut [[f32; 4]; 2]);
    fn load_halves(halves: &[[f32; 4]; 2]) -> Self;
    /// Two matrix columns of each joint, side by side, from rows of components:
    /// `(ax ay az az | bx by bz bz)`.
    fn column_pairs(a: [Self; 3], b: [Self; 3]) -> [Self; LANES];
    /// Component rows of four column pairs, those of the first columns in the lower half; the fourth components are dropped.
    fn half_rows(pairs: [Self; 4]) -> [Self; 3];
    /// The inverse of `column_pairs`: component rows of both columns, of the half rows of four pairs and of the next four.
    fn joined_rows(first: [Self; 3], next: [Self; 3]) -> [[Self; 3]; 2];
    /// Like `half_rows`, with the fourth components.
    fn half_rows4(pairs: [Self; 4]) -> [Self; 4];
    /// Like `joined_rows`, with the fourth components.
    fn joined_rows4(first: [Self; 4], next: [Self; 4]) -> [[Self; 4]; 2];
    /// Each weight, with the other sign where the dot product of its four and the pivot, (0 + 2) + (1 + 3), is negative.
    fn sided(fours: [&[f32; 4]; 4], pivot: &[f32; 4], weights: &[f32; 4]) -> [f32; 4];
    /// A matrix: its first two columns, its third and the translation. The fourth components may hold anything.
    fn of_matrix(matrix: &Affine3A) -> [Self; 2];
    /// Component rows of eight points.
    fn load_points(points: &[[f32; 3]; LANES]) -> [Self; 3];
    fn store_points(rows: [Self; 3], points: &mut [[f32; 3]; LANES]);
    /// [`Bits`] made ready for many bytes.
    type Unpacking: Copy;
    fn unpacking(bits: &Bits) -> Self::Unpacking;
    /// Eight whole numbers that lie bit by bit behind each other, lowest bits first.
    fn unpack(bytes: &[u8; 16], unpacking: Self::Unpacking) -> Self;
}

/// How eight numbers of some bits each, 16 at most, are taken out of 16 bytes; what a lane without bits gives is 0 or 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub(crate) struct Bits {
    /// The byte that a lane's first bit is in; the next three may count on from 15 to 0.
    from: [u8; LANES],
    /// Position of the lane's bits among these 32, counted from the highest, and how many are not the lane's; 31 at most, since
    /// shifts by 32 and more take three more instructions each.
    left: [u8; LANES],
    right: [u8; LANES],
}

impl Bits {
    /// Positions from the number of bits of each lane.
    pub fn new(widths: &[u8; LANES]) -> Bits {
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

    /// Bytes that the eight take.
    pub fn bytes(widths: &[u8; LANES]) -> usize {
        widths.iter().map(|w| usize::from(*w)).sum::<usize>().div_ceil(8)
    }
}

/// Three rows. Kernels call functions like this one rather than `map` or `from_fn` with a closure: a closure that is not inlined is
/// compiled without AVX, and then each intrinsic in it becomes a call (three and four times the time, as measured).
#[inline(always)]
pub(crate) fn load3<F: F8>(rows: &[Lane; 3]) -> [F; 3] {
    [F::load(&rows[0]), F::load(&rows[1]), F::load(&rows[2])]
}

/// Four rows.
#[inline(always)]
pub(crate) fn load4<F: F8>(rows: &[Lane; 4]) -> [F; 4] {
    [F::load(&rows[0]), F::load(&rows[1]), F::load(&rows[2]), F::load(&rows[3])]
}
