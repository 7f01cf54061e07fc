//! Chooses bits and knot spacing of each column and writes the knots.

use super::fit::{CurveFits, STRIDES, bspline_weights, knot_count};
use super::grid::Grid;
use crate::clip::Clip;
use crate::clip::packed::{Packed, PackedColumn, Stride};
use crate::clip::tracks::{Channel, Column};
use crate::simd::Bits;
use crate::simd::lane::{LANES, Lane};
use crate::slerp_series::series_terms_for;
use std::collections::BTreeMap;

/// Largest number of bits of an integer: eight integers then take 16 bytes, one load.
const MAX_BITS: usize = 16;

/// Curves of one channel of one pose block: index and tolerance of each.
type Lanes = [Option<(usize, f64)>; LANES];

/// Packs the moving curves (index, tolerance); also returns the indices of those for which packing does not pay.
pub(super) fn pack_curves(
    clip: &Clip,
    grid: &Grid,
    fits: &CurveFits,
    moving: &[(usize, f64)],
) -> (Packed, Vec<usize>) {
    let mut columns: BTreeMap<(u32, Channel), Lanes> = BTreeMap::new();
    for (index, allowed) in moving {
        let curve = &clip.curves()[*index];
        let Some(channel) = Channel::of(curve.path) else { continue };
        let lanes = columns.entry((curve.joint / LANES as u32, channel)).or_default();
        lanes[curve.joint as usize % LANES] = Some((*index, *allowed));
    }
    let mut unpacked = Vec::new();
    let mut chosen: BTreeMap<usize, Vec<ColumnDraft>> = BTreeMap::new();
    for ((block, channel), lanes) in columns {
        let drafts = STRIDES.iter().enumerate().filter_map(|(at, stride)| {
            ColumnDraft::new(block, channel, &lanes, fits, at).map(|draft| (*stride, draft))
        });
        // Bytes of all knots, including those at the ends.
        let cost =
            |(stride, draft): &(usize, ColumnDraft)| draft.row_bytes() * knot_count(grid.frames, *stride);
        let best = drafts.min_by_key(cost);
        let curves = lanes.iter().flatten().count();
        match best.filter(|best| cost(best) < curves * channel.width() * 4 * grid.frames) {
            Some((stride, draft)) => chosen.entry(stride).or_default().push(draft),
            None => unpacked.extend(lanes.iter().flatten().map(|(index, _)| *index)),
        }
    }
    let joints = clip.joint_count();
    let strides: Vec<Stride> = chosen
        .into_iter()
        .map(|(stride, drafts)| Stride::new(stride, &drafts, joints, grid.frames, fits))
        .collect();
    let terms = strides.iter().flat_map(|s| &s.columns).map(|c| c.column.terms).max().unwrap_or(0);
    let Grid { start, step, frames } = *grid;
    (Packed { start, step, frames, strides, terms }, unpacked)
}

/// Largest error of nlerp against slerp, radians, divided by (1 − cos)^1.5 of the quaternions' angle: 0.004 θ³ for rotations θ
/// apart.
const NLERP_ERROR_FACTOR: f64 = 0.09;

/// A column with the fewest bits at one stride.
struct ColumnDraft {
    block: u32,
    channel: Channel,
    lanes: Lanes,
    /// Index into [`STRIDES`].
    stride: usize,
    nlerp_suffices: bool,
    /// Bits of each component and lane.
    widths: [[u8; LANES]; 4],
    low: [[f64; LANES]; 4],
    range: [[f64; LANES]; 4],
}

impl ColumnDraft {
    /// Chooses the fewest bits. `None` if the error of the spline is too large, or 16 bits are not enough.
    fn new(
        block: u32,
        channel: Channel,
        lanes: &Lanes,
        fits: &CurveFits,
        stride: usize,
    ) -> Option<ColumnDraft> {
        let mut draft = ColumnDraft {
            block,
            channel,
            lanes: *lanes,
            stride,
            nlerp_suffices: true,
            widths: [[0; LANES]; 4],
            low: [[0.0; LANES]; 4],
            range: [[0.0; LANES]; 4],
        };
        for (lane, (index, allowed)) in lanes.iter().enumerate().filter_map(|(i, l)| Some((i, (*l)?))) {
            let fit = fits.fit_of(index)?;
            let (knots, worst) = &fit.splines[stride];
            draft.nlerp_suffices &= NLERP_ERROR_FACTOR * fit.widest * fit.widest.sqrt() <= 0.2 * allowed;
            // The error that remains for the rounding of the knots: independent errors add up by their squares.
            let remaining_error = (allowed * allowed - worst * worst).max(0.0).sqrt();
            if remaining_error < 0.3 * allowed {
                return None;
            }
            // Rounding is evenly spread over a step in each component, which counts twice for quaternions.
            let step = if channel == Channel::Rotation { remaining_error } else { remaining_error * 1.5 };
            for c in 0..channel.width() {
                let (low, high) = knots
                    .iter()
                    .map(|k| k[c])
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
                if high - low <= step {
                    // The middle of the range is as close as rounding would be.
                    draft.low[c][lane] = low + (high - low) * 0.5;
                    continue;
                }
                draft.low[c][lane] = low;
                draft.range[c][lane] = high - low;
                let bits = (1..=MAX_BITS).find(|b| ((1u64 << b) - 1) as f64 * step >= high - low)?;
                draft.widths[c][lane] = bits as u8;
            }
        }
        Some(draft)
    }

    fn row_bytes(&self) -> usize {
        self.widths.iter().map(Bits::bytes).sum()
    }

    fn to_packed_column(&self, joint_count: usize, fits: &CurveFits) -> PackedColumn {
        let first = self.block as usize * LANES;
        let full = (0..LANES).all(|lane| self.lanes[lane].is_some() || first + lane >= joint_count);
        let mask = Lane(self.lanes.map(|l| f32::from_bits(if l.is_some() { u32::MAX } else { 0 })));
        let mut terms = 0;
        if self.channel == Channel::Rotation {
            let fits = self.lanes.iter().flatten().filter_map(|(index, _)| fits.fit_of(*index));
            terms = fits.map(|fit| series_terms_for(fit.widest)).max().unwrap_or(0);
        }
        let (mut low, mut step) = ([Lane::splat(0.0); 4], [Lane::splat(0.0); 4]);
        for c in 0..4 {
            for lane in 0..LANES {
                low[c].0[lane] = self.low[c][lane] as f32;
                step[c].0[lane] = (self.range[c][lane] / self.max_integer(c, lane)) as f32;
            }
        }
        // Lanes without a joint decode to a quaternion of length 1.
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
        PackedColumn { column, nlerp_suffices: self.nlerp_suffices, bits, bytes, low, step }
    }

    /// Largest integer of a component and lane.
    fn max_integer(&self, component: usize, lane: usize) -> f64 {
        ((1u64 << self.widths[component][lane].max(1)) - 1) as f64
    }

    /// Appends the integers of a knot, component by component, eight each, lowest bits first.
    fn append_knot(&self, knot: usize, fits: &CurveFits, out: &mut Vec<u8>) {
        for c in 0..self.channel.width() {
            let mut starts = [0; LANES];
            for lane in 1..LANES {
                starts[lane] = starts[lane - 1] + u32::from(self.widths[c][lane - 1]);
            }
            let mut bits = 0u128;
            for (lane, (index, _)) in self.lanes.iter().enumerate().filter_map(|(i, l)| Some((i, (*l)?))) {
                let Some(fit) = fits.fit_of(index) else { continue };
                let value = fit.splines[self.stride].0[knot][c];
                let range = self.range[c][lane];
                if range > 0.0 {
                    let number = libm::round((value - self.low[c][lane]) / range * self.max_integer(c, lane));
                    bits |= (number.clamp(0.0, self.max_integer(c, lane)) as u128) << starts[lane];
                }
            }
            out.extend_from_slice(&bits.to_le_bytes()[..Bits::bytes(&self.widths[c])]);
        }
    }
}

impl Stride {
    fn new(
        stride: usize,
        drafts: &[ColumnDraft],
        joint_count: usize,
        frames: usize,
        fits: &CurveFits,
    ) -> Stride {
        let mut bytes = Vec::new();
        for knot in 0..knot_count(frames, stride) {
            drafts.iter().for_each(|draft| draft.append_knot(knot, fits, &mut bytes));
        }
        let row_bytes = drafts.iter().map(ColumnDraft::row_bytes).sum();
        // Padding: a row after the last, whose weight is zero, and the rest of a wide load.
        bytes.resize(bytes.len() + row_bytes + 16, 0);
        let weights = (0..stride).map(|phase| {
            let at = |frame: usize| -> [f32; 5] {
                let mut out = [0.0; 5];
                if stride == 1 {
                    out[frame] = 1.0;
                } else {
                    let shift = frame / stride;
                    for (i, w) in
                        bspline_weights((frame % stride) as f64 / stride as f64).into_iter().enumerate()
                    {
                        out[shift + i] = w as f32;
                    }
                }
                out
            };
            [at(phase), at(phase + 1)]
        });
        Stride {
            stride,
            columns: drafts.iter().map(|d| d.to_packed_column(joint_count, fits)).collect(),
            row_bytes,
            weights: weights.collect(),
            bytes,
        }
    }
}
