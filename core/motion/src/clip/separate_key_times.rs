//! Sampling of curves with separate key times: the keys of eight neighboring joints are found, gathered and interpolated at once.
//!
//! A grid over the clip holds the interval of each curve at the start of each cell. The few keys within a cell are found by
//! bisection, so that a seek costs as much as the next frame. Neighboring keys lie side by side, so that one load reads both.

use crate::clip::sample::{hermite_weights_x8, normalize_or, slerp_shorter_arc, store_column};
use crate::clip::tracks::{Channel, Column, Lanes, make_column, tangent_or_value};
use crate::clip::{Curve, Interpolation};
use crate::pose::PoseBlock;
use crate::pose::blend::lerp;
use crate::simd::F8;
use crate::simd::lane::{LANES, Lane};
use crate::time::Time;

/// The largest number of ticks that f64 holds exactly.
const MAX_EXACT_TICKS: i64 = 1 << 53;

/// Curves of one interpolation. A curve of N keys has N + 1 intervals: up to its first key, between each two keys, and from its
/// last key on.
#[derive(Debug, Default)]
pub(crate) struct SeparateKeyTimes {
    columns: Vec<SeparateTimesColumn>,
    /// Entries of [`Self::keys`] that one key takes: 1, or 3 for in-tangent, value and out-tangent.
    entries_per_key: usize,
    /// Start of the grid, ticks, and cells per tick.
    start: f64,
    density: f64,
    cells: usize,
    /// One row per cell, with an element per column.
    grid: Vec<Cell>,
    /// Ticks at which each interval begins.
    interval_starts: Vec<f64>,
    spans: Vec<KeySpan>,
    /// The key before each interval, and then the key after it.
    keys: Vec<[f32; 4]>,
}

/// Packed column of curves that do not share key times.
#[derive(Debug)]
struct SeparateTimesColumn {
    column: Column,
    /// The last interval of each lane's curve.
    last: [u32; LANES],
}

#[derive(Clone, Copy, Debug)]
struct Cell {
    /// The interval of each lane where the cell begins.
    intervals: [u32; LANES],
    /// Number of bisection steps that find an interval in the cell.
    bisection_steps: u32,
}

/// The time between two keys.
#[derive(Clone, Copy, Debug)]
struct KeySpan {
    /// Start, ticks.
    from: f64,
    /// 1 / duration in ticks; 0 beyond the ends of a curve.
    rate: f64,
    secs: f32,
}

/// The span before the first and after the last key of a curve, where the value holds.
const OUTSIDE_SPAN: KeySpan = KeySpan { from: 0.0, rate: 0.0, secs: 0.0 };

/// Whether [`SeparateKeyTimes`] can hold a curve: linear or cubic, several keys, times exact in f64.
pub(crate) fn can_pack(curve: &Curve) -> bool {
    let exact = |time: Option<&Time>| time.is_some_and(|t| t.0.abs() < MAX_EXACT_TICKS);
    curve.interpolation != Interpolation::Step
        && curve.times.len() > 1
        && exact(curve.times.first())
        && exact(curve.times.last())
}

impl SeparateKeyTimes {
    /// Packs curves of one interpolation, linear or cubic, all of which pass [`can_pack`]. `members`: block, channel and curve
    /// indices.
    pub(crate) fn pack<'a>(
        curves: &'a [Curve],
        members: impl Iterator<Item = (u32, Channel, &'a [usize])>,
    ) -> Self {
        let mut packed = SeparateKeyTimes { entries_per_key: 1, ..SeparateKeyTimes::default() };
        // The first interval of each lane.
        let mut firsts: Vec<[u32; LANES]> = Vec::new();
        for (block, channel, members) in members {
            let mut lanes: Lanes = [None; LANES];
            let [mut first, mut last] = [[0; LANES]; 2];
            for curve in members.iter().map(|index| &curves[*index]) {
                let lane = curve.joint as usize % LANES;
                lanes[lane] = Some(curve);
                first[lane] = packed.interval_starts.len() as u32;
                last[lane] = first[lane] + curve.times.len() as u32;
                packed.add_curve(curve);
            }
            // Lanes without a curve copy another lane, and are not written.
            let Some(driven) = lanes.iter().position(Option::is_some) else { continue };
            for lane in (0..LANES).filter(|lane| lanes[*lane].is_none()) {
                (first[lane], last[lane]) = (first[driven], last[driven]);
            }
            firsts.push(first);
            packed
                .columns
                .push(SeparateTimesColumn { column: make_column(usize::MAX, block, channel, &lanes), last });
        }
        packed.build_grid(&firsts);
        packed
    }

    fn add_curve(&mut self, curve: &Curve) {
        let ticks = |key: usize| curve.times[key].0 as f64;
        let count = curve.times.len();
        // The first key's value holds up to its time, inclusive.
        self.interval_starts.extend([f64::NEG_INFINITY, ticks(0) + 1.0]);
        self.interval_starts.extend((1..count).map(ticks));
        self.interval_starts.push(f64::INFINITY);
        self.spans.push(OUTSIDE_SPAN);
        self.spans.extend((1..count).map(|key| {
            let length = curve.times[key] - curve.times[key - 1];
            KeySpan { from: ticks(key - 1), rate: 1.0 / length.0 as f64, secs: length.as_secs() as f32 }
        }));
        self.spans.extend([OUTSIDE_SPAN; 2]);
        self.entries_per_key = if curve.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        for key in std::iter::once(0).chain(0..count).chain([count - 1]) {
            self.keys.extend((0..self.entries_per_key).map(|at| tangent_or_value(curve, key, at)));
        }
    }

    /// Makes the grid, with about four cells per key of an average curve.
    fn build_grid(&mut self, firsts: &[[u32; LANES]]) {
        let finite = self.interval_starts.iter().copied().filter(|start| start.is_finite());
        let (start, end) = finite.fold((f64::MAX, f64::MIN), |(a, b), t| (a.min(t), b.max(t)));
        self.cells = 1 + 4 * self.interval_starts.len() / (firsts.len() * LANES).max(1);
        (self.start, self.density) = (start, (self.cells - 1) as f64 / (end - start).max(1.0));
        let mut grid = Vec::with_capacity(self.cells * firsts.len());
        for cell in 0..self.cells {
            for (firsts, SeparateTimesColumn { last, .. }) in firsts.iter().zip(&self.columns) {
                let (mut intervals, mut max_within) = (*firsts, 0);
                for (interval, last) in intervals.iter_mut().zip(last) {
                    let starts = &self.interval_starts[*interval as usize + 1..=*last as usize];
                    let before = starts.partition_point(|start| self.cell_index(*start) < cell);
                    let within = starts[before..].partition_point(|start| self.cell_index(*start) == cell);
                    *interval += before as u32;
                    max_within = within.max(max_within);
                }
                grid.push(Cell { intervals, bisection_steps: usize::BITS - max_within.leading_zeros() });
            }
        }
        self.grid = grid;
    }

    /// Cell of a time; never decreases with time.
    #[inline(always)]
    fn cell_index(&self, ticks: f64) -> usize {
        (((ticks - self.start) * self.density) as usize).min(self.cells - 1)
    }

    #[inline(always)]
    pub(crate) fn sample<F: F8>(&self, time: Time, blocks: &mut [PoseBlock]) {
        if self.columns.is_empty() {
            return;
        }
        let ticks = time.0 as f64;
        let row = &self.grid[self.cell_index(ticks) * self.columns.len()..][..self.columns.len()];
        for (SeparateTimesColumn { column, last }, cell) in self.columns.iter().zip(row) {
            let Some(block) = blocks.get_mut(column.block as usize) else { continue };
            let intervals = self.find_intervals(cell, last, ticks);
            let values = match self.entries_per_key {
                1 => self.sample_linear::<F>(column, &intervals, ticks),
                _ => self.sample_cubic::<F>(column, &intervals, ticks),
            };
            let Some(values) = values else { return };
            store_column(column, block, values);
        }
    }

    /// The last interval of each lane that has begun at `ticks`.
    #[inline(always)]
    fn find_intervals(&self, cell: &Cell, last: &[u32; LANES], ticks: f64) -> [u32; LANES] {
        let mut intervals = cell.intervals;
        for halving in (0..cell.bisection_steps).rev() {
            for lane in 0..LANES {
                let next = (intervals[lane] + (1 << halving)).min(last[lane]);
                let begun = u32::from(self.interval_starts[next as usize] <= ticks);
                intervals[lane] += (next - intervals[lane]) * begun;
            }
        }
        intervals
    }

    /// Fractions of eight intervals at a time, and their durations in seconds.
    #[inline(always)]
    fn fractions<F: F8>(&self, intervals: &[u32; LANES], ticks: f64) -> (F, F) {
        let (mut from, mut rate, mut secs) = ([0.0; LANES], [0.0; LANES], Lane::default());
        for lane in 0..LANES {
            let span = &self.spans[intervals[lane] as usize];
            (from[lane], rate[lane], secs.0[lane]) = (span.from, span.rate, span.secs);
        }
        let mut fraction = Lane::default();
        for lane in 0..LANES {
            fraction.0[lane] = ((ticks - from[lane]) * rate[lane]) as f32;
        }
        (F::load(&fraction), F::load(&secs))
    }

    /// Two neighboring entries of the keys of eight intervals, one row per component. `at`: index of the first one within the
    /// interval's entries.
    #[inline(always)]
    fn load_key_pairs<F: F8>(&self, intervals: &[u32; LANES], at: usize) -> Option<[[F; 4]; 2]> {
        let mut pairs = [F::splat(0.0); LANES];
        for lane in 0..LANES {
            let from = intervals[lane] as usize * self.entries_per_key + at;
            pairs[lane] = F::load_halves(self.keys.get(from..)?.first_chunk()?);
        }
        let [a, b, c, d, e, f, g, h] = pairs;
        Some(F::join_rows4(F::half_rows4([a, b, c, d]), F::half_rows4([e, f, g, h])))
    }

    #[inline(always)]
    fn sample_linear<F: F8>(&self, column: &Column, intervals: &[u32; LANES], ticks: f64) -> Option<[F; 4]> {
        let [a, b] = self.load_key_pairs::<F>(intervals, 0)?;
        let (t, _) = self.fractions::<F>(intervals, ticks);
        if column.channel == Channel::Rotation {
            return Some(slerp_shorter_arc(a, b, t, column.terms));
        }
        Some([lerp(a[0], b[0], t), lerp(a[1], b[1], t), lerp(a[2], b[2], t), a[3]])
    }

    #[inline(always)]
    fn sample_cubic<F: F8>(&self, column: &Column, intervals: &[u32; LANES], ticks: f64) -> Option<[F; 4]> {
        let [key, tangent] = self.load_key_pairs::<F>(intervals, 1)?;
        let [next_tangent, next] = self.load_key_pairs::<F>(intervals, 3)?;
        let (t, secs) = self.fractions::<F>(intervals, ticks);
        let w = hermite_weights_x8(t, secs);
        let mut values = key;
        for i in 0..4 {
            let value = key[i].mul(w[0]).add(tangent[i].mul(w[1]));
            values[i] = value.add(next_tangent[i].mul(w[2])).add(next[i].mul(w[3]));
        }
        Some(if column.channel == Channel::Rotation { normalize_or(values, key) } else { values })
    }
}
