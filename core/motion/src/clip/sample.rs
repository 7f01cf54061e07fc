//! Sampling: evaluates a clip at a time, into a pose.

use crate::clip::key_search::Interval;
use crate::clip::tracks::{Channel, Column, ConstantColumn, KeyRows, SingleCurve, TimelineGroup, Tracks};
use crate::clip::{Clip, Curve, Interpolation};
use crate::input_error::InputError;
use crate::pose::blend::{dot, lerp};
use crate::pose::{Pose, PoseBlock};
use crate::simd::lane::{LANES, Lane};
use crate::simd::{F8, Kernel, Level, dispatch, load4};
use crate::slerp_series::{MAX_TERMS, SlerpSeries, slerp_weights};
use crate::time::Time;

/// Evaluates a clip at a time. Joints and properties that the clip does not animate keep what is in the pose.
///
/// The pose at the time of a key equals that key bit for bit, except for the sign of a quaternion and the normalization of
/// CUBICSPLINE.
pub struct Sample<'a> {
    /// The clip that is evaluated.
    pub clip: &'a Clip,
    /// Clip time; before the first and after the last key the end values hold.
    pub time: Time,
    /// Input and output: as many joints as the clip's skeleton.
    pub pose: &'a mut Pose,
}

impl Sample<'_> {
    /// Names the first field that does not fit.
    pub fn check(&self) -> Result<(), InputError> {
        InputError::check_lengths(&[("Sample.pose", self.pose.len(), self.clip.joint_count())])
    }

    /// Samples the clip. Joints that the pose does not have are left out. Allocates nothing except the clip's tracks, when it is
    /// first sampled (see [`Clip::prepare`]).
    pub fn run(&mut self) {
        self.run_on(Level::best());
    }

    /// Runs at a SIMD level, for tests and benchmarks; the bits are the same at any.
    pub fn run_on(&mut self, level: Level) {
        let (tracks, curves) = (self.clip.tracks(), self.clip.stored_curves());
        dispatch(level, SampleTracks { tracks, curves, time: self.time, blocks: self.pose.blocks_mut() });
    }
}

struct SampleTracks<'a> {
    tracks: &'a Tracks,
    curves: &'a [Curve],
    time: Time,
    blocks: &'a mut [PoseBlock],
}

impl Kernel for SampleTracks<'_> {
    #[inline(always)]
    fn run<F: F8>(self) {
        sample::<F>(self.tracks, &self.tracks.constants, self.curves, self.time, self.blocks);
    }
}

#[inline(always)]
pub(crate) fn sample<F: F8>(
    tracks: &Tracks,
    constants: &[ConstantColumn],
    curves: &[Curve],
    time: Time,
    blocks: &mut [PoseBlock],
) {
    for ConstantColumn { column, rows } in constants {
        if let Some(block) = blocks.get_mut(column.block as usize) {
            store_column::<F>(column, block, load4(rows));
        }
    }
    if let Some(packed) = &tracks.packed {
        crate::clip::packed::decode::<F>(packed, time, blocks);
    }
    let mut batch = SlerpBatch::default();
    for group in &tracks.groups {
        let at = group.timeline.find(time);
        if !group.step.columns.is_empty() {
            sample_step::<F>(&group.step, at, blocks);
        }
        if !group.linear.columns.is_empty() {
            sample_linear::<F>(&group.linear, at, blocks);
        }
        if !group.cubic.columns.is_empty() {
            sample_cubic::<F>(&group.cubic, at, blocks);
        }
        sample_singles::<F>(group, curves, at, blocks, &mut batch);
    }
    for separate in &tracks.separate {
        separate.sample::<F>(time, blocks);
    }
    batch.flush::<F>(blocks);
}

/// Stores the components that the channel has, in the lanes that the column drives.
#[inline(always)]
pub(crate) fn store_column<F: F8>(column: &Column, block: &mut PoseBlock, values: [F; 4]) {
    let rows = column.channel.rows(block);
    match &column.mask {
        None => {
            for (row, value) in rows.iter_mut().zip(values) {
                value.store(row);
            }
        }
        Some(mask) => {
            let mask = F::load(mask);
            for (row, value) in rows.iter_mut().zip(values) {
                F::select(mask, value, F::load(row)).store(row);
            }
        }
    }
}

#[inline(always)]
fn sample_step<F: F8>(rows: &KeyRows, at: Interval, blocks: &mut [PoseBlock]) {
    let mut row = &rows.lanes[at.key * rows.row_len..(at.key + 1) * rows.row_len];
    for column in &rows.columns {
        let (values, rest) = row.split_at(column.channel.width());
        row = rest;
        if let Some(block) = blocks.get_mut(column.block as usize) {
            let last = F::load(&values[values.len() - 1]);
            store_column(
                column,
                block,
                [F::load(&values[0]), F::load(&values[1]), F::load(&values[2]), last],
            );
        }
    }
}

#[inline(always)]
fn sample_linear<F: F8>(rows: &KeyRows, at: Interval, blocks: &mut [PoseBlock]) {
    let (mut a, mut b) = (rows.row(at.key), rows.row(at.next));
    let t = F::splat(at.fraction);
    let series = SlerpSeries::new(at.fraction, rows.terms);
    for column in &rows.columns {
        if column.channel == Channel::Rotation {
            let (Some((ka, rest_a)), Some((kb, rest_b))) =
                (a.split_first_chunk::<5>(), b.split_first_chunk::<5>())
            else {
                return;
            };
            (a, b) = (rest_a, rest_b);
            let Some(block) = blocks.get_mut(column.block as usize) else { continue };
            let (wa, wb) = series.weights(F::load(&ka[4]), column.terms);
            let mut values = [wa; 4];
            for (value, (a, b)) in values.iter_mut().zip(ka.iter().zip(kb)) {
                *value = F::load(a).mul(wa).add(F::load(b).mul(wb));
            }
            store_column(column, block, values);
        } else {
            let (Some((ka, rest_a)), Some((kb, rest_b))) =
                (a.split_first_chunk::<3>(), b.split_first_chunk::<3>())
            else {
                return;
            };
            (a, b) = (rest_a, rest_b);
            let Some(block) = blocks.get_mut(column.block as usize) else { continue };
            let mut values = [t; 4];
            for (value, (a, b)) in values.iter_mut().zip(ka.iter().zip(kb)) {
                *value = lerp(F::load(a), F::load(b), t);
            }
            store_column(column, block, values);
        }
    }
}

/// Hermite basis (glTF 2.0 Appendix C.4): weights of value, out-tangent, next in-tangent, next value; tangents are per second.
#[inline(always)]
fn hermite_weights(at: Interval) -> [f32; 4] {
    let (t, span) = (at.fraction, at.span.as_secs() as f32);
    let (t2, t3) = (t * t, t * t * t);
    [2.0 * t3 - 3.0 * t2 + 1.0, span * (t3 - 2.0 * t2 + t), span * (t3 - t2), 3.0 * t2 - 2.0 * t3]
}

/// [`hermite_weights`] of eight fractions and spans, with the same bits.
#[inline(always)]
pub(crate) fn hermite_weights_x8<F: F8>(t: F, span_secs: F) -> [F; 4] {
    let [one, two, three] = [F::splat(1.0), F::splat(2.0), F::splat(3.0)];
    let t2 = t.mul(t);
    let t3 = t2.mul(t);
    [
        two.mul(t3).sub(three.mul(t2)).add(one),
        span_secs.mul(t3.sub(two.mul(t2)).add(t)),
        span_secs.mul(t3.sub(t2)),
        three.mul(t2).sub(two.mul(t3)),
    ]
}

#[inline(always)]
fn sample_cubic<F: F8>(rows: &KeyRows, at: Interval, blocks: &mut [PoseBlock]) {
    let len = rows.row_len;
    let (a, b) = (&rows.lanes[at.key * 3 * len..][..3 * len], &rows.lanes[at.next * 3 * len..][..3 * len]);
    let w = hermite_weights(at);
    let weights = [F::splat(w[0]), F::splat(w[1]), F::splat(w[2]), F::splat(w[3])];
    let mut from = 0;
    for column in &rows.columns {
        let width = column.channel.width();
        let start = from;
        from += width;
        let Some(block) = blocks.get_mut(column.block as usize) else { continue };
        let mut keys = [weights[0]; 4];
        let mut values = keys;
        for i in 0..width {
            let at = start + i;
            keys[i] = F::load(&a[len + at]);
            let value = keys[i].mul(weights[0]).add(F::load(&a[2 * len + at]).mul(weights[1]));
            values[i] = value.add(F::load(&b[at]).mul(weights[2])).add(F::load(&b[len + at]).mul(weights[3]));
        }
        if column.channel == Channel::Rotation {
            values = normalize_or(values, keys);
        }
        store_column(column, block, values);
    }
}

/// Normalizes quaternions; returns `otherwise` if the length is zero (as between opposite keys without tangents) or overflows f32.
#[inline(always)]
pub(crate) fn normalize_or<F: F8>(q: [F; 4], otherwise: [F; 4]) -> [F; 4] {
    let square = dot(q, q);
    let usable = F::splat(1e-30).less(square);
    let k = F::splat(1.0).div(square.sqrt());
    let mut out = otherwise;
    for i in 0..4 {
        let unit = F::select(usable, q[i].mul(k), otherwise[i]);
        out[i] = F::select(square.less(F::splat(1e30)), unit, otherwise[i]);
    }
    out
}

impl KeyRows {
    #[inline(always)]
    fn row(&self, key: usize) -> &[Lane] {
        &self.lanes[key * self.row_len..(key + 1) * self.row_len]
    }
}

/// Pairs of keys of linear rotations, collected from single curves until there are eight, which are slerped at once.
#[derive(Default)]
struct SlerpBatch {
    a: [Lane; 4],
    b: [Lane; 4],
    fraction: Lane,
    joints: [u32; LANES],
    count: usize,
    terms: usize,
}

impl SlerpBatch {
    #[inline(always)]
    fn push<F: F8>(
        &mut self,
        a: &[f32],
        b: &[f32],
        t: f32,
        joint: u32,
        terms: usize,
        blocks: &mut [PoseBlock],
    ) {
        for i in 0..4 {
            self.a[i].0[self.count] = a[i];
            self.b[i].0[self.count] = b[i];
        }
        self.fraction.0[self.count] = t;
        self.joints[self.count] = joint;
        self.terms = self.terms.max(terms);
        self.count += 1;
        if self.count == LANES {
            self.flush::<F>(blocks);
        }
    }

    #[inline(always)]
    fn flush<F: F8>(&mut self, blocks: &mut [PoseBlock]) {
        if self.count == 0 {
            return;
        }
        let (a, b) = (load4::<F>(&self.a), load4::<F>(&self.b));
        let values = slerp_shorter_arc(a, b, F::load(&self.fraction), self.terms);
        let mut out = [Lane::splat(0.0); 4];
        for i in 0..4 {
            values[i].store(&mut out[i]);
        }
        for lane in 0..self.count {
            store_joint(blocks, self.joints[lane], Channel::Rotation, out.map(|row| row.0[lane]));
        }
        self.count = 0;
        self.terms = 0;
    }
}

/// Slerp between eight pairs of keys, on the shorter arc.
#[inline(always)]
pub(crate) fn slerp_shorter_arc<F: F8>(a: [F; 4], b: [F; 4], t: F, terms: usize) -> [F; 4] {
    let cos = dot(a, b);
    // 1 − cos is computed from the chord: for small angles, rounding of the dot product loses it.
    let mut square = F::splat(0.0);
    for i in 0..4 {
        let chord = a[i].sub(b[i].flip_sign_by(cos));
        square = square.add(chord.mul(chord));
    }
    let d = square.mul(F::splat(0.5));
    let (wa, wb) = slerp_weights::<F>(t, d, terms.min(MAX_TERMS));
    let mut out = a;
    for i in 0..4 {
        out[i] = a[i].mul(wa).add(b[i].flip_sign_by(cos).mul(wb));
    }
    out
}

/// Stores one channel of one joint, if the pose has it.
#[inline(always)]
fn store_joint(blocks: &mut [PoseBlock], joint: u32, channel: Channel, value: [f32; 4]) {
    if let Some(block) = blocks.get_mut(joint as usize / LANES) {
        for (row, component) in channel.rows(block).iter_mut().zip(value) {
            row.0[joint as usize % LANES] = component;
        }
    }
}

#[inline(always)]
fn sample_singles<F: F8>(
    group: &TimelineGroup,
    curves: &[Curve],
    at: Interval,
    blocks: &mut [PoseBlock],
    batch: &mut SlerpBatch,
) {
    for SingleCurve { curve, channel, terms } in &group.singles {
        let curve = &curves[*curve];
        if *channel == Channel::Rotation && curve.interpolation == Interpolation::Linear {
            let (a, b) = (&curve.values[at.key * 4..][..4], &curve.values[at.next * 4..][..4]);
            batch.push::<F>(a, b, at.fraction, curve.joint, *terms, blocks);
        } else {
            let mut value = [0.0; 4];
            interpolate_curve(curve, at, &mut value);
            store_joint(blocks, curve.joint, *channel, value);
        }
    }
}

/// Evaluates one curve, except linear rotations, in a known interval.
pub(crate) fn interpolate_curve(curve: &Curve, at: Interval, out: &mut [f32]) {
    let (width, stride) = (curve.path.width(), curve.stride());
    let count = width.min(out.len());
    let a = &curve.values[at.key * stride..][..stride];
    let b = &curve.values[at.next * stride..][..stride];
    match curve.interpolation {
        Interpolation::Step => out[..count].copy_from_slice(&a[..count]),
        Interpolation::Linear => {
            for i in 0..count {
                out[i] = a[i] + (b[i] - a[i]) * at.fraction;
            }
        }
        Interpolation::CubicSpline => {
            let w = hermite_weights(at);
            for i in 0..count {
                out[i] = a[width + i] * w[0] + a[2 * width + i] * w[1] + b[i] * w[2] + b[width + i] * w[3];
            }
            if curve.path == crate::clip::Path::Rotation && count == 4 {
                let square = (out[0] * out[0] + out[1] * out[1]) + (out[2] * out[2] + out[3] * out[3]);
                let k = 1.0 / square.sqrt();
                for i in 0..4 {
                    out[i] = if 1e-30 < square && square < 1e30 { out[i] * k } else { a[width + i] };
                }
            }
        }
    }
}
