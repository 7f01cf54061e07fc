//! Quantized B-spline knots of a compressed clip, eight joints side by side, and the kernel that decodes them.

use crate::clip::sample::store_column;
use crate::clip::tracks::{Channel, Column};
use crate::clip::{Curve, Interpolation, Path};
use crate::pose::{Pose, PoseBlock};
use crate::simd::lane::{LANES, Lane};
use crate::simd::{Bits, F8, Kernel, Level, dispatch};
use crate::slerp_series::SlerpSeries;
use crate::time::Time;
use std::sync::Arc;

/// The moving curves of a compressed clip.
#[derive(Debug)]
pub(crate) struct Packed {
    pub(crate) start: Time,
    pub(crate) step: i64,
    pub(crate) frames: usize,
    pub(crate) strides: Vec<Stride>,
    /// Largest number of terms of the slerp series that any column needs.
    pub(crate) terms: usize,
}

/// Columns that have one knot per `stride` frames.
#[derive(Debug)]
pub(crate) struct Stride {
    pub(crate) stride: usize,
    pub(crate) columns: Vec<PackedColumn>,
    pub(crate) row_bytes: usize,
    /// B-spline weights by frame modulo stride: those of five knots for that frame and for the next.
    pub(crate) weights: Vec<[[f32; 5]; 2]>,
    /// Knot by knot, column by column, component by component, with padding at the end for wide loads.
    pub(crate) bytes: Vec<u8>,
}

#[derive(Debug)]
pub(crate) struct PackedColumn {
    pub(crate) column: Column,
    /// Whether neighboring rotations are so close that normalized linear interpolation is as good as slerp.
    pub(crate) nlerp_suffices: bool,
    /// Layout and number of bits of each component's numbers.
    pub(crate) bits: [Bits; 4],
    pub(crate) bytes: [u8; 4],
    /// Dequantization: the value of 0, and that of one step.
    pub(crate) low: [Lane; 4],
    pub(crate) step: [Lane; 4],
}

impl Packed {
    pub(crate) fn is_empty(&self) -> bool {
        self.strides.is_empty()
    }

    /// (block, channel, lanes) of all columns.
    pub(crate) fn columns(&self) -> impl Iterator<Item = &Column> {
        self.strides.iter().flat_map(|s| &s.columns).map(|c| &c.column)
    }

    /// Joints that a column drives.
    pub(crate) fn joints(&self, column: &Column, joint_count: usize) -> Vec<u32> {
        let drives = |lane: &usize| column.mask.is_none_or(|m| m.0[*lane].to_bits() != 0);
        let joint = |lane: usize| column.block * LANES as u32 + lane as u32;
        (0..LANES).filter(drives).map(joint).filter(|j| (*j as usize) < joint_count).collect()
    }

    pub(crate) fn stored_bytes(&self) -> usize {
        let bytes_of_stride = |s: &Stride| {
            let ranges =
                s.columns.iter().map(|c| (8 + 3) * LANES * c.column.channel.width() + 8).sum::<usize>();
            s.bytes.len() + ranges
        };
        self.strides.iter().map(bytes_of_stride).sum()
    }

    /// The curves as decoded, LINEAR, with keys at all frames.
    pub(crate) fn decoded(&self, joint_count: usize) -> Vec<Curve> {
        let times: Arc<[Time]> =
            (0..self.frames as i64).map(|k| Time(self.start.0 + k * self.step)).collect();
        let mut curves: Vec<Curve> = Vec::new();
        let mut values: Vec<Vec<f32>> = Vec::new();
        for column in self.columns() {
            for joint in self.joints(column, joint_count) {
                let path = match column.channel {
                    Channel::Translation => Path::Translation,
                    Channel::Rotation => Path::Rotation,
                    Channel::Scale => Path::Scale,
                };
                let interpolation = Interpolation::Linear;
                curves.push(Curve { joint, path, interpolation, times: times.clone(), values: [].into() });
                values.push(Vec::with_capacity(self.frames * path.width()));
            }
        }
        let mut pose = Pose::identity(joint_count);
        for time in times.iter() {
            dispatch(Level::best(), DecodePacked { packed: self, time: *time, blocks: pose.blocks_mut() });
            for (curve, values) in curves.iter().zip(&mut values) {
                let local = pose.get(curve.joint as usize);
                match curve.path {
                    Path::Translation => values.extend(local.translation.to_array()),
                    Path::Rotation => values.extend(local.rotation.to_array()),
                    _ => values.extend(local.scale.to_array()),
                }
            }
        }
        for (curve, values) in curves.iter_mut().zip(values) {
            curve.values = values.into();
        }
        curves
    }

    /// The frame at or before a time, at most the last but one, and the fraction to the next frame.
    #[inline(always)]
    fn frame(&self, time: Time) -> (usize, f32) {
        let last = self.frames as i64 - 1;
        let ticks = (time.0.saturating_sub(self.start.0)).clamp(0, last * self.step);
        let frame = (ticks / self.step).min(last - 1);
        (frame as usize, (ticks - frame * self.step) as f32 / self.step as f32)
    }
}

struct DecodePacked<'a> {
    packed: &'a Packed,
    time: Time,
    blocks: &'a mut [PoseBlock],
}

impl Kernel for DecodePacked<'_> {
    #[inline(always)]
    fn run<F: F8>(self) {
        decode::<F>(self.packed, self.time, self.blocks);
    }
}

#[inline(always)]
pub(crate) fn decode<F: F8>(packed: &Packed, time: Time, blocks: &mut [PoseBlock]) {
    let (frame, fraction) = packed.frame(time);
    let series = SlerpSeries::new(fraction, packed.terms);
    for stride in &packed.strides {
        let phase = frame % stride.stride;
        let from = &stride.bytes[frame / stride.stride * stride.row_bytes..];
        let weights = &stride.weights[phase];
        if stride.stride == 1 {
            decode_columns::<F, 2>(stride, from, weights, fraction, &series, blocks);
        } else if phase + 1 < stride.stride {
            decode_columns::<F, 4>(stride, from, weights, fraction, &series, blocks);
        } else {
            decode_columns::<F, 5>(stride, from, weights, fraction, &series, blocks);
        }
    }
}

/// Decodes all columns of a stride from N neighboring knots.
#[inline(always)]
fn decode_columns<F: F8, const N: usize>(
    stride: &Stride,
    from: &[u8],
    weights: &[[f32; 5]; 2],
    fraction: f32,
    series: &SlerpSeries,
    blocks: &mut [PoseBlock],
) {
    let mut weights_a = [F::splat(0.0); N];
    let mut weights_b = weights_a;
    let mut weights_between = weights_a;
    for i in 0..N {
        let (a, b) = (weights[0][i], weights[1][i]);
        weights_a[i] = F::splat(a);
        weights_b[i] = F::splat(b);
        weights_between[i] = F::splat(a + (b - a) * fraction);
    }
    let mut at = 0;
    for column in &stride.columns {
        let rotation = column.column.channel == Channel::Rotation;
        let values = if rotation && !column.nlerp_suffices {
            decode_slerp::<F, N>(column, from, at, stride.row_bytes, [&weights_a, &weights_b], series)
        } else if rotation {
            decode_linear::<F, N, 4>(column, from, at, stride.row_bytes, &weights_between)
        } else {
            decode_linear::<F, N, 3>(column, from, at, stride.row_bytes, &weights_between)
        };
        let Some(mut values) = values else { return };
        if rotation {
            values = normalize_near_unit(values);
        }
        at += column.bytes.iter().map(|b| usize::from(*b)).sum::<usize>();
        let Some(block) = blocks.get_mut(column.column.block as usize) else { continue };
        store_column(&column.column, block, values);
    }
}

/// The first `W` components, interpolated linearly between frames; components that are not stored have the value `low`.
#[inline(always)]
fn decode_linear<F: F8, const N: usize, const W: usize>(
    column: &PackedColumn,
    from: &[u8],
    mut at: usize,
    row_bytes: usize,
    weights: &[F; N],
) -> Option<[F; 4]> {
    let mut values = [F::load(&column.low[3]); 4];
    for (c, value) in values.iter_mut().enumerate().take(W) {
        let knots = unpack_knots::<F, N>(from, at, row_bytes, &column.bits[c])?;
        *value = F::load(&column.low[c]).add(F::load(&column.step[c]).mul(weighted_sum(&knots, weights)));
        at += usize::from(column.bytes[c]);
    }
    Some(values)
}

/// Slerp between the rotations at both frames.
#[inline(always)]
fn decode_slerp<F: F8, const N: usize>(
    column: &PackedColumn,
    from: &[u8],
    mut at: usize,
    row_bytes: usize,
    [weights_a, weights_b]: [&[F; N]; 2],
    series: &SlerpSeries,
) -> Option<[F; 4]> {
    let zero = F::splat(0.0);
    let (mut a, mut b, mut square) = ([zero; 4], [zero; 4], zero);
    for c in 0..4 {
        let knots = unpack_knots::<F, N>(from, at, row_bytes, &column.bits[c])?;
        let (low, step) = (F::load(&column.low[c]), F::load(&column.step[c]));
        a[c] = low.add(step.mul(weighted_sum(&knots, weights_a)));
        b[c] = low.add(step.mul(weighted_sum(&knots, weights_b)));
        let chord = a[c].sub(b[c]);
        square = square.add(chord.mul(chord));
        at += usize::from(column.bytes[c]);
    }
    let (wa, wb) = series.weights(square.mul(F::splat(0.5)), column.column.terms);
    for c in 0..4 {
        a[c] = a[c].mul(wa).add(b[c].mul(wb));
    }
    Some(a)
}

/// One component of neighboring knots; in registers, since it is used at once.
#[inline(always)]
fn unpack_knots<F: F8, const N: usize>(
    from: &[u8],
    at: usize,
    row_bytes: usize,
    bits: &Bits,
) -> Option<[F; N]> {
    let unpacking = F::unpacking(bits);
    let mut knots = [F::splat(0.0); N];
    for (i, knot) in knots.iter_mut().enumerate() {
        *knot = F::unpack(from.get(at + i * row_bytes..)?.first_chunk()?, unpacking);
    }
    Some(knots)
}

#[inline(always)]
fn weighted_sum<F: F8, const N: usize>(knots: &[F; N], weights: &[F; N]) -> F {
    let mut sum = knots[0].mul(weights[0]);
    for i in 1..N {
        sum = sum.add(knots[i].mul(weights[i]));
    }
    sum
}

/// Normalizes quaternions within a few hundredths of length 1: 1/√(1 + e) = 1 − e/2 + 3e²/8 − …, without root and division.
#[inline(always)]
fn normalize_near_unit<F: F8>(q: [F; 4]) -> [F; 4] {
    let one = F::splat(1.0);
    let e = crate::pose::blend::dot(q, q).sub(one);
    let k = one.add(e.mul(e.mul(F::splat(0.375)).sub(F::splat(0.5))));
    [q[0].mul(k), q[1].mul(k), q[2].mul(k), q[3].mul(k)]
}
