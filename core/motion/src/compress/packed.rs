//! Knots as whole numbers of few bits, eight joints side by side, and how they are read.

use super::fit::{Fits, STRIDES, basis, knot_count};
use super::grid::Grid;
use crate::sample::write;
use crate::simd::{Bits, F8, Kernel, Level, dispatch};
use crate::slerp::{Series, terms_for};
use crate::tracks::{Channel, Column};
use crate::{Clip, Curve, Interpolation, LANES, Lane, Path, Pose, PoseBlock, Time};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The widest numbers: eight of them are 16 bytes, one load.
const MOST_BITS: usize = 16;

/// The moving curves of a compressed clip.
#[derive(Debug)]
pub(crate) struct Packed {
    start: Time,
    step: i64,
    frames: usize,
    strides: Vec<Stride>,
    /// The most that a column needs.
    terms: usize,
}

/// Columns that have one knot for as many frames.
#[derive(Debug)]
struct Stride {
    stride: usize,
    columns: Vec<PackedColumn>,
    row_bytes: usize,
    /// Weights of five knots for a frame and for the next, by frame modulo stride.
    weights: Vec<[[f32; 5]; 2]>,
    /// Knot by knot, column by column, component by component; what a wide load may read beyond lies at the end.
    bytes: Vec<u8>,
}

#[derive(Debug)]
struct PackedColumn {
    column: Column,
    /// Whether neighbouring rotations are so near that normalized linear interpolation is as good as slerp.
    straight: bool,
    /// Layout and number of bits of each component's numbers.
    bits: [Bits; 4],
    bytes: [u8; 4],
    /// Value of 0, and of one step.
    low: [Lane; 4],
    step: [Lane; 4],
}

/// Curves of one channel of one pose block: index and what each may be off.
type Lanes = [Option<(usize, f64)>; LANES];

impl Packed {
    /// The moving curves (index, tolerance) packed, and those for which that does not pay.
    pub(super) fn new(
        clip: &Clip,
        grid: &Grid,
        fits: &Fits,
        moving: &[(usize, f64)],
    ) -> (Packed, Vec<usize>) {
        let mut columns: BTreeMap<(u32, Channel), Lanes> = BTreeMap::new();
        for (index, allowed) in moving {
            let curve = &clip.curves()[*index];
            let Some(channel) = Channel::of(curve.path) else { continue };
            let lanes = columns.entry((curve.joint / LANES as u32, channel)).or_default();
            lanes[curve.joint as usize % LANES] = Some((*index, *allowed));
        }
        let mut left = Vec::new();
        let mut chosen: BTreeMap<usize, Vec<Draft>> = BTreeMap::new();
        for ((block, channel), lanes) in columns {
            let drafts = STRIDES.iter().enumerate().filter_map(|(at, stride)| {
                Draft::new(block, channel, &lanes, fits, at).map(|draft| (*stride, draft))
            });
            // Bytes a frame, times all frames: knots at the ends count too.
            let cost =
                |(stride, draft): &(usize, Draft)| draft.row_bytes() * knot_count(grid.frames, *stride);
            let best = drafts.min_by_key(cost);
            let curves = lanes.iter().flatten().count();
            match best.filter(|best| cost(best) < curves * channel.width() * 4 * grid.frames) {
                Some((stride, draft)) => chosen.entry(stride).or_default().push(draft),
                None => left.extend(lanes.iter().flatten().map(|(index, _)| *index)),
            }
        }
        let joints = clip.joint_count();
        let strides: Vec<Stride> = chosen
            .into_iter()
            .map(|(stride, drafts)| Stride::new(stride, &drafts, joints, grid.frames, fits))
            .collect();
        let terms = strides.iter().flat_map(|s| &s.columns).map(|c| c.column.terms).max().unwrap_or(0);
        let Grid { start, step, frames } = *grid;
        (Packed { start, step, frames, strides, terms }, left)
    }

    pub fn is_empty(&self) -> bool {
        self.strides.is_empty()
    }

    /// (block, channel, lanes) of all columns.
    pub fn columns(&self) -> impl Iterator<Item = &Column> {
        self.strides.iter().flat_map(|s| &s.columns).map(|c| &c.column)
    }

    /// Joints that a column drives.
    pub fn joints(&self, column: &Column, joint_count: usize) -> Vec<u32> {
        let drives = |lane: &usize| column.mask.is_none_or(|m| m.0[*lane].to_bits() != 0);
        let joint = |lane: usize| column.block * LANES as u32 + lane as u32;
        (0..LANES).filter(drives).map(joint).filter(|j| (*j as usize) < joint_count).collect()
    }

    pub fn stored_bytes(&self) -> usize {
        let of = |s: &Stride| {
            let ranges =
                s.columns.iter().map(|c| (8 + 3) * LANES * c.column.channel.width() + 8).sum::<usize>();
            s.bytes.len() + ranges
        };
        self.strides.iter().map(of).sum()
    }

    /// The curves as decoded, LINEAR, with keys at all frames.
    pub fn decoded(&self, joint_count: usize) -> Vec<Curve> {
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
            dispatch(Level::best(), Read { packed: self, time: *time, blocks: pose.blocks_mut() });
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

    /// The frame at or before a time that has one after it, and how far the time lies between.
    #[inline(always)]
    fn frame(&self, time: Time) -> (usize, f32) {
        let last = self.frames as i64 - 1;
        let ticks = (time.0.saturating_sub(self.start.0)).clamp(0, last * self.step);
        let frame = (ticks / self.step).min(last - 1);
        (frame as usize, (ticks - frame * self.step) as f32 / self.step as f32)
    }
}

/// Largest difference of nlerp from slerp in radians, over (1 − cos)^1.5 of the quaternions' angle: 0.004 θ³ for rotations θ
/// apart.
const STRAIGHT: f64 = 0.09;

/// A column with the fewest bits at one stride.
struct Draft {
    block: u32,
    channel: Channel,
    lanes: Lanes,
    /// Index in [`STRIDES`].
    stride: usize,
    straight: bool,
    /// Bits of each component and lane.
    widths: [[u8; LANES]; 4],
    low: [[f64; LANES]; 4],
    range: [[f64; LANES]; 4],
}

impl Draft {
    /// `None` where the spline is too far off, or 16 bits are not enough.
    fn new(block: u32, channel: Channel, lanes: &Lanes, fits: &Fits, stride: usize) -> Option<Draft> {
        let mut draft = Draft {
            block,
            channel,
            lanes: *lanes,
            stride,
            straight: true,
            widths: [[0; LANES]; 4],
            low: [[0.0; LANES]; 4],
            range: [[0.0; LANES]; 4],
        };
        for (lane, (index, allowed)) in lanes.iter().enumerate().filter_map(|(i, l)| Some((i, (*l)?))) {
            let fit = fits.of(index)?;
            let (knots, worst) = &fit.splines[stride];
            draft.straight &= STRAIGHT * fit.widest * fit.widest.sqrt() <= 0.2 * allowed;
            // What is left for the rounding of the knots: errors that do not depend on each other add up by their squares.
            let left = (allowed * allowed - worst * worst).max(0.0).sqrt();
            if left < 0.3 * allowed {
                return None;
            }
            // Rounding is evenly spread over a step in each component, which counts twice for quaternions.
            let step = if channel == Channel::Rotation { left } else { left * 1.5 };
            for c in 0..channel.width() {
                let (low, high) = knots
                    .iter()
                    .map(|k| k[c])
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
                if high - low <= step {
                    // Its middle is as near as rounding would be.
                    draft.low[c][lane] = low + (high - low) * 0.5;
                    continue;
                }
                draft.low[c][lane] = low;
                draft.range[c][lane] = high - low;
                let bits = (1..=MOST_BITS).find(|b| ((1u64 << b) - 1) as f64 * step >= high - low)?;
                draft.widths[c][lane] = bits as u8;
            }
        }
        Some(draft)
    }

    fn row_bytes(&self) -> usize {
        self.widths.iter().map(Bits::bytes).sum()
    }

    fn finished(&self, joint_count: usize, fits: &Fits) -> PackedColumn {
        let first = self.block as usize * LANES;
        let full = (0..LANES).all(|lane| self.lanes[lane].is_some() || first + lane >= joint_count);
        let mask = Lane(self.lanes.map(|l| f32::from_bits(if l.is_some() { u32::MAX } else { 0 })));
        let mut terms = 0;
        if self.channel == Channel::Rotation {
            let fits = self.lanes.iter().flatten().filter_map(|(index, _)| fits.of(*index));
            terms = fits.map(|fit| terms_for(fit.widest)).max().unwrap_or(0);
        }
        let (mut low, mut step) = ([Lane::splat(0.0); 4], [Lane::splat(0.0); 4]);
        for c in 0..4 {
            for lane in 0..LANES {
                low[c].0[lane] = self.low[c][lane] as f32;
                step[c].0[lane] = (self.range[c][lane] / self.highest(c, lane)) as f32;
            }
        }
        // Lanes without a joint decode to something of length 1.
        if self.channel == Channel::Rotation {
            for lane in (0..LANES).filter(|lane| self.lanes[*lane].is_none()) {
                low[3].0[lane] = 1.0;
            }
        }
        let column =
            Column { block: self.block, channel: self.channel, mask: (!full).then_some(mask), terms };
        let bits = self.widths.each_ref().map(Bits::new);
        // Eight times 16 bits at most.
        let bytes = self.widths.each_ref().map(|w| Bits::bytes(w) as u8);
        PackedColumn { column, straight: self.straight, bits, bytes, low, step }
    }

    /// The largest number of a component and lane.
    fn highest(&self, component: usize, lane: usize) -> f64 {
        ((1u64 << self.widths[component][lane].max(1)) - 1) as f64
    }

    /// Component by component, eight numbers each, lowest bits first.
    fn write(&self, knot: usize, fits: &Fits, out: &mut Vec<u8>) {
        for c in 0..self.channel.width() {
            let mut starts = [0; LANES];
            for lane in 1..LANES {
                starts[lane] = starts[lane - 1] + u32::from(self.widths[c][lane - 1]);
            }
            let mut bits = 0u128;
            for (lane, (index, _)) in self.lanes.iter().enumerate().filter_map(|(i, l)| Some((i, (*l)?))) {
                let Some(fit) = fits.of(index) else { continue };
                let value = fit.splines[self.stride].0[knot][c];
                let range = self.range[c][lane];
                if range > 0.0 {
                    let number = libm::round((value - self.low[c][lane]) / range * self.highest(c, lane));
                    bits |= (number.clamp(0.0, self.highest(c, lane)) as u128) << starts[lane];
                }
            }
            out.extend_from_slice(&bits.to_le_bytes()[..Bits::bytes(&self.widths[c])]);
        }
    }
}

impl Stride {
    fn new(stride: usize, drafts: &[Draft], joint_count: usize, frames: usize, fits: &Fits) -> Stride {
        let mut bytes = Vec::new();
        for knot in 0..knot_count(frames, stride) {
            drafts.iter().for_each(|draft| draft.write(knot, fits, &mut bytes));
        }
        let row_bytes = drafts.iter().map(Draft::row_bytes).sum();
        // The row after the last, which weighs nothing, and the rest of a wide load.
        bytes.resize(bytes.len() + row_bytes + 16, 0);
        let weights = (0..stride).map(|phase| {
            let at = |frame: usize| -> [f32; 5] {
                let mut out = [0.0; 5];
                if stride == 1 {
                    out[frame] = 1.0;
                } else {
                    let shift = frame / stride;
                    for (i, w) in basis((frame % stride) as f64 / stride as f64).into_iter().enumerate() {
                        out[shift + i] = w as f32;
                    }
                }
                out
            };
            [at(phase), at(phase + 1)]
        });
        Stride {
            stride,
            columns: drafts.iter().map(|d| d.finished(joint_count, fits)).collect(),
            row_bytes,
            weights: weights.collect(),
            bytes,
        }
    }
}

struct Read<'a> {
    packed: &'a Packed,
    time: Time,
    blocks: &'a mut [PoseBlock],
}

impl Kernel for Read<'_> {
    #[inline(always)]
    fn run<F: F8>(self) {
        read::<F>(self.packed, self.time, self.blocks);
    }
}

#[inline(always)]
pub(crate) fn read<F: F8>(packed: &Packed, time: Time, blocks: &mut [PoseBlock]) {
    let (frame, fraction) = packed.frame(time);
    let series = Series::new(fraction, packed.terms);
    for stride in &packed.strides {
        let phase = frame % stride.stride;
        let from = &stride.bytes[frame / stride.stride * stride.row_bytes..];
        let weights = &stride.weights[phase];
        if stride.stride == 1 {
            columns::<F, 2>(stride, from, weights, fraction, &series, blocks);
        } else if phase + 1 < stride.stride {
            columns::<F, 4>(stride, from, weights, fraction, &series, blocks);
        } else {
            columns::<F, 5>(stride, from, weights, fraction, &series, blocks);
        }
    }
}

/// All columns of a stride from N neighbouring knots.
#[inline(always)]
fn columns<F: F8, const N: usize>(
    stride: &Stride,
    from: &[u8],
    weights: &[[f32; 5]; 2],
    fraction: f32,
    series: &Series,
    blocks: &mut [PoseBlock],
) {
    let mut of_a = [F::splat(0.0); N];
    let mut of_b = of_a;
    let mut between = of_a;
    for i in 0..N {
        let (a, b) = (weights[0][i], weights[1][i]);
        of_a[i] = F::splat(a);
        of_b[i] = F::splat(b);
        between[i] = F::splat(a + (b - a) * fraction);
    }
    let mut at = 0;
    for column in &stride.columns {
        let rotation = column.column.channel == Channel::Rotation;
        let values = if rotation && !column.straight {
            slerped::<F, N>(column, from, at, stride.row_bytes, [&of_a, &of_b], series)
        } else if rotation {
            between_knots::<F, N, 4>(column, from, at, stride.row_bytes, &between)
        } else {
            between_knots::<F, N, 3>(column, from, at, stride.row_bytes, &between)
        };
        let Some(mut values) = values else { return };
        if rotation {
            values = near_unit(values);
        }
        at += column.bytes.iter().map(|b| usize::from(*b)).sum::<usize>();
        let Some(block) = blocks.get_mut(column.column.block as usize) else { continue };
        write(&column.column, block, values);
    }
}

/// The first `W` components on the straight way between frames; those that are not stored are as `low` says.
#[inline(always)]
fn between_knots<F: F8, const N: usize, const W: usize>(
    column: &PackedColumn,
    from: &[u8],
    mut at: usize,
    row_bytes: usize,
    weights: &[F; N],
) -> Option<[F; 4]> {
    let mut values = [F::load(&column.low[3]); 4];
    for (c, value) in values.iter_mut().enumerate().take(W) {
        let knots = knots::<F, N>(from, at, row_bytes, &column.bits[c])?;
        *value = F::load(&column.low[c]).add(F::load(&column.step[c]).mul(weighed(&knots, weights)));
        at += usize::from(column.bytes[c]);
    }
    Some(values)
}

/// Rotations at both frames, and the way between them on the sphere.
#[inline(always)]
fn slerped<F: F8, const N: usize>(
    column: &PackedColumn,
    from: &[u8],
    mut at: usize,
    row_bytes: usize,
    [of_a, of_b]: [&[F; N]; 2],
    series: &Series,
) -> Option<[F; 4]> {
    let zero = F::splat(0.0);
    let (mut a, mut b, mut square) = ([zero; 4], [zero; 4], zero);
    for c in 0..4 {
        let knots = knots::<F, N>(from, at, row_bytes, &column.bits[c])?;
        let (low, step) = (F::load(&column.low[c]), F::load(&column.step[c]));
        a[c] = low.add(step.mul(weighed(&knots, of_a)));
        b[c] = low.add(step.mul(weighed(&knots, of_b)));
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

/// A component of neighbouring knots; in registers, since it is used up at once.
#[inline(always)]
fn knots<F: F8, const N: usize>(from: &[u8], at: usize, row_bytes: usize, bits: &Bits) -> Option<[F; N]> {
    let unpacking = F::unpacking(bits);
    let mut knots = [F::splat(0.0); N];
    for (i, knot) in knots.iter_mut().enumerate() {
        *knot = F::unpack(from.get(at + i * row_bytes..)?.first_chunk()?, unpacking);
    }
    Some(knots)
}

#[inline(always)]
fn weighed<F: F8, const N: usize>(knots: &[F; N], weights: &[F; N]) -> F {
    let mut sum = knots[0].mul(weights[0]);
    for i in 1..N {
        sum = sum.add(knots[i].mul(weights[i]));
    }
    sum
}

/// Quaternions within a few hundredths of length 1 brought there: 1/√(1 + e) = 1 − e/2 + 3e²/8 − …, without root and division.
#[inline(always)]
fn near_unit<F: F8>(q: [F; 4]) -> [F; 4] {
    let one = F::splat(1.0);
    let e = crate::blend::dot(q, q).sub(one);
    let k = one.add(e.mul(e.mul(F::splat(0.375)).sub(F::splat(0.5))));
    [q[0].mul(k), q[1].mul(k), q[2].mul(k), q[3].mul(k)]
}
