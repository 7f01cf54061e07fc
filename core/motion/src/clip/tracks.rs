//! A clip's curves, laid out for sampling as structure of arrays. The authored keys are kept exactly.
//!
//! - Curves whose keys are all equal are stored once.
//! - Curves with the same key times share a [`Timeline`]: the interval is searched once for all of them.
//! - If a timeline drives enough joints of a pose block (eight neighboring joints), their keys are laid out in
//!   frame-major rows: the keys of one time lie together, eight joints per register. Sampling reads two
//!   neighboring rows, so that a seek costs as much as the next frame.
//! - Linear curves with separate key times are resampled at common key times ([`crate::clip::common_times`]), so that they can
//!   lie in rows, too.
//! - If that takes too much memory, and for cubic curves, the keys of eight joints are gathered ([`crate::clip::separate_key_times`]).
//! - The few other curves ("singles") are sampled from the authored keys.

use crate::clip::common_times::{CommonTimes, common_times};
use crate::clip::key_search::Timeline;
use crate::clip::packed::Packed;
use crate::clip::separate_key_times::{SeparateKeyTimes, can_pack};
use crate::clip::{Curve, Interpolation, Path};
use crate::pose::PoseBlock;
use crate::simd::lane::{LANES, Lane};
use crate::slerp_series::{one_minus_cos, series_terms_for};
use crate::time::Time;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The three parts of a local transform, in the order of a [`PoseBlock`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Channel {
    Translation,
    Rotation,
    Scale,
}

impl Channel {
    pub(crate) fn of(path: Path) -> Option<Channel> {
        match path {
            Path::Translation => Some(Channel::Translation),
            Path::Rotation => Some(Channel::Rotation),
            Path::Scale => Some(Channel::Scale),
            Path::Weights(_) => None,
        }
    }

    pub(crate) fn width(self) -> usize {
        if self == Channel::Rotation { 4 } else { 3 }
    }

    #[inline(always)]
    pub(crate) fn rows(self, block: &mut PoseBlock) -> &mut [Lane] {
        match self {
            Channel::Translation => &mut block.translation,
            Channel::Rotation => &mut block.rotation,
            Channel::Scale => &mut block.scale,
        }
    }

    /// Value of lanes that no joint uses.
    fn identity(self) -> [f32; 4] {
        match self {
            Channel::Translation => [0.0; 4],
            Channel::Rotation => [0.0, 0.0, 0.0, 1.0],
            Channel::Scale => [1.0; 4],
        }
    }
}

/// One channel of one pose block.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Column {
    pub block: u32,
    pub channel: Channel,
    /// Sign bit set in the lanes that are driven; `None` = all.
    pub mask: Option<Lane>,
    /// Terms of the slerp series that the widest interval needs (linear rotations).
    pub terms: usize,
}

/// A column that does not change.
#[derive(Debug)]
pub(crate) struct ConstantColumn {
    pub column: Column,
    pub rows: [Lane; 4],
}

/// Frame-major rows of one interpolation.
#[derive(Debug, Default)]
pub(crate) struct KeyRows {
    pub columns: Vec<Column>,
    /// Lanes of one key: all columns one after the other. Linear rotations take five: x y z w, and 1 − cos of the
    /// angle to the next key. Cubic: all in-tangents, then all values, then all out-tangents.
    pub row_len: usize,
    pub lanes: Vec<Lane>,
    /// Largest number of terms of the slerp series that any column needs.
    pub terms: usize,
}

/// A curve that is sampled alone; `curve` is an index into the clip's curves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SingleCurve {
    pub curve: usize,
    pub channel: Channel,
    pub terms: usize,
}

/// Curves with the same key times.
#[derive(Debug)]
pub(crate) struct TimelineGroup {
    pub timeline: Timeline,
    pub step: KeyRows,
    pub linear: KeyRows,
    pub cubic: KeyRows,
    pub singles: Vec<SingleCurve>,
}

#[derive(Debug, Default)]
pub(crate) struct Tracks {
    /// Constant columns: translations, then rotations, then scales.
    pub constants: Vec<ConstantColumn>,
    pub groups: Vec<TimelineGroup>,
    /// Linear and cubic curves with separate key times.
    pub separate: [SeparateKeyTimes; 2],
    /// Decoder data of a compressed clip.
    pub packed: Option<Arc<Packed>>,
    /// Whether every joint has a curve, by channel.
    pub covers: [bool; 3],
    /// Whether no curve makes a scale other than exactly 1.
    pub unit_scale: bool,
}

/// Smallest number of curves of one pose block that are laid out as a column; fewer would leave the rows mostly empty.
pub(crate) const MIN_CURVES_PER_COLUMN: usize = 4;

pub(crate) type Lanes<'a> = [Option<&'a Curve>; LANES];

/// Curves whose key times too few other curves share to fill a row, if there are enough of them in a pose block: by interpolation,
/// block and channel.
pub(crate) type StrayCurves = BTreeMap<(Interpolation, u32, Channel), Vec<usize>>;

/// Finds stray curves. `groups`: indices of curves with equal key times.
fn find_stray_curves<'a>(curves: &[Curve], groups: impl Iterator<Item = &'a Vec<usize>>) -> StrayCurves {
    let mut columns = StrayCurves::new();
    for members in groups {
        let mut group_columns = StrayCurves::new();
        for &index in members {
            let Some(channel) = Channel::of(curves[index].path) else { continue };
            let key = (curves[index].interpolation, curves[index].joint / LANES as u32, channel);
            group_columns.entry(key).or_default().push(index);
        }
        // The other curves lie in rows already.
        group_columns.retain(|_, members| members.len() < MIN_CURVES_PER_COLUMN);
        group_columns
            .into_iter()
            .for_each(|(column, members)| columns.entry(column).or_default().extend(members));
    }
    columns.retain(|_, members| members.len() >= MIN_CURVES_PER_COLUMN);
    columns
}

impl Tracks {
    /// Constant columns of translations and rotations.
    pub(crate) fn constants_without_scales(&self) -> &[ConstantColumn] {
        let scales = self.constants.partition_point(|c| c.column.channel != Channel::Scale);
        &self.constants[..scales]
    }

    pub(crate) fn pack(joint_count: usize, curves: &[Curve], packed: Option<&Arc<Packed>>) -> Tracks {
        let mut driven = [0usize; 3];
        let mut unit_scale = true;
        let mut constants: BTreeMap<(Channel, u32), Lanes> = BTreeMap::new();
        let mut groups: BTreeMap<&[Time], Vec<usize>> = BTreeMap::new();
        for (index, curve) in curves.iter().enumerate() {
            let Some(channel) = Channel::of(curve.path) else { continue };
            driven[channel as usize] += 1;
            let constant = is_constant(curve);
            if channel == Channel::Scale {
                unit_scale &= constant && key_value(curve, 0)[..3] == [1.0; 3];
            }
            if constant {
                let lanes = constants.entry((channel, curve.joint / LANES as u32)).or_default();
                lanes[curve.joint as usize % LANES] = Some(curve);
            } else {
                groups.entry(&curve.times).or_default().push(index);
            }
        }
        let mut stray_curves = find_stray_curves(curves, groups.values());
        let merged = common_times(curves, &stray_curves);
        let mut sampled_elsewhere = vec![false; curves.len()];
        merged.iter().flat_map(|merged| &merged.sources).for_each(|index| sampled_elsewhere[*index] = true);
        stray_curves.retain(|_, members| {
            members.iter().all(|index| !sampled_elsewhere[*index] && can_pack(&curves[*index]))
        });
        stray_curves.values().flatten().for_each(|index| sampled_elsewhere[*index] = true);
        groups.values_mut().for_each(|members| members.retain(|index| !sampled_elsewhere[*index]));
        groups.retain(|_, members| !members.is_empty());
        let merged = merged.map(|CommonTimes { curves, .. }| {
            let members: Vec<usize> = (0..curves.len()).collect();
            TimelineGroup::pack(joint_count, &curves, &members)
        });
        let separate = |interpolation: Interpolation| {
            let same_interpolation = stray_curves.iter().filter(|((other, ..), _)| *other == interpolation);
            SeparateKeyTimes::pack(
                curves,
                same_interpolation.map(|((_, block, channel), members)| (*block, *channel, &members[..])),
            )
        };
        for (column, packed) in packed.iter().flat_map(|p| p.columns().map(move |c| (c, p))) {
            driven[column.channel as usize] += packed.joints(column, joint_count).len();
            unit_scale &= column.channel != Channel::Scale;
        }
        Tracks {
            packed: packed.cloned(),
            separate: [Interpolation::Linear, Interpolation::CubicSpline].map(separate),
            constants: constants
                .into_iter()
                .map(|((channel, block), lanes)| ConstantColumn {
                    column: make_column(joint_count, block, channel, &lanes),
                    rows: key_rows(channel, &lanes, |curve| key_value(curve, 0)),
                })
                .collect(),
            groups: groups
                .into_values()
                .map(|members| TimelineGroup::pack(joint_count, curves, &members))
                .chain(merged)
                .collect(),
            covers: driven.map(|n| n == joint_count),
            unit_scale,
        }
    }
}

impl TimelineGroup {
    fn pack(joint_count: usize, curves: &[Curve], members: &[usize]) -> TimelineGroup {
        let mut columns: BTreeMap<(Interpolation, u32, Channel), [Option<usize>; LANES]> = BTreeMap::new();
        for &index in members {
            let curve = &curves[index];
            let Some(channel) = Channel::of(curve.path) else { continue };
            let key = (curve.interpolation, curve.joint / LANES as u32, channel);
            columns.entry(key).or_default()[curve.joint as usize % LANES] = Some(index);
        }
        let times = Arc::clone(&curves[members[0]].times);
        let mut group = TimelineGroup {
            timeline: Timeline::new(times),
            step: KeyRows::default(),
            linear: KeyRows::default(),
            cubic: KeyRows::default(),
            singles: Vec::new(),
        };
        let mut packed: BTreeMap<Interpolation, Vec<(Column, Lanes)>> = BTreeMap::new();
        for ((interpolation, block, channel), indices) in columns {
            if indices.iter().flatten().count() < MIN_CURVES_PER_COLUMN {
                group.singles.extend(indices.iter().flatten().map(|&curve| SingleCurve {
                    curve,
                    channel,
                    terms: slerp_terms(&curves[curve]),
                }));
                continue;
            }
            let lanes = indices.map(|index| index.map(|i| &curves[i]));
            let column = make_column(joint_count, block, channel, &lanes);
            packed.entry(interpolation).or_default().push((column, lanes));
        }
        for (interpolation, columns) in packed {
            let keys = curves[members[0]].times.len();
            match interpolation {
                Interpolation::Step => group.step = step_rows(keys, &columns),
                Interpolation::Linear => group.linear = linear_rows(keys, &columns),
                Interpolation::CubicSpline => group.cubic = cubic_rows(keys, &columns),
            }
        }
        group
    }
}

/// Whether all keys are equal and all tangents zero, so that the curve has the same value at every time.
fn is_constant(curve: &Curve) -> bool {
    let stride = curve.stride();
    let width = curve.path.width();
    let first = &curve.values[..stride];
    let flat = curve.interpolation != Interpolation::CubicSpline
        || curve.times.len() == 1
        || first[..width].iter().chain(&first[2 * width..]).all(|v| *v == 0.0);
    flat && curve.values.chunks_exact(stride).all(|key| key == first)
}

/// The value of a key (not its tangents), padded to four.
pub(crate) fn key_value(curve: &Curve, key: usize) -> [f32; 4] {
    let at = if curve.interpolation == Interpolation::CubicSpline { 1 } else { 0 };
    tangent_or_value(curve, key, at)
}

/// Element `at` of a key: of a cubic curve, 0 is the in-tangent, 1 the value, 2 the out-tangent; other keys hold the value only.
pub(crate) fn tangent_or_value(curve: &Curve, key: usize, at: usize) -> [f32; 4] {
    let width = curve.path.width();
    let from = key * curve.stride() + at * width;
    let mut out = [0.0; 4];
    out[..width].copy_from_slice(&curve.values[from..from + width]);
    out
}

pub(crate) fn make_column(joint_count: usize, block: u32, channel: Channel, lanes: &Lanes) -> Column {
    let first = block as usize * LANES;
    let full = (0..LANES).all(|lane| lanes[lane].is_some() || first + lane >= joint_count);
    let mask = Lane(lanes.map(|l| f32::from_bits(if l.is_some() { u32::MAX } else { 0 })));
    let terms = match channel {
        Channel::Rotation => lanes.iter().flatten().map(|curve| slerp_terms(curve)).max().unwrap_or(0),
        _ => 0,
    };
    Column { block, channel, mask: (!full).then_some(mask), terms }
}

/// One key of eight curves, as one row per component; the identity in lanes without a curve.
fn key_rows(channel: Channel, lanes: &Lanes, value: impl Fn(&Curve) -> [f32; 4]) -> [Lane; 4] {
    let mut rows = [Lane::splat(0.0); 4];
    for (lane, curve) in lanes.iter().enumerate() {
        let value = curve.map_or(channel.identity(), &value);
        for (row, component) in rows.iter_mut().zip(value) {
            row.0[lane] = component;
        }
    }
    rows
}

fn step_rows(keys: usize, columns: &[(Column, Lanes)]) -> KeyRows {
    let mut rows = KeyRows::with_columns(columns);
    for key in 0..keys {
        for (column, lanes) in columns {
            let values = key_rows(column.channel, lanes, |curve| key_value(curve, key));
            rows.lanes.extend_from_slice(&values[..column.channel.width()]);
        }
    }
    rows.row_len = rows.lanes.len() / keys;
    rows
}

fn cubic_rows(keys: usize, columns: &[(Column, Lanes)]) -> KeyRows {
    let mut rows = KeyRows::with_columns(columns);
    for key in 0..keys {
        for at in 0..3 {
            for (column, lanes) in columns {
                let values = key_rows(column.channel, lanes, |curve| tangent_or_value(curve, key, at));
                rows.lanes.extend_from_slice(&values[..column.channel.width()]);
            }
        }
    }
    rows.row_len = rows.lanes.len() / (3 * keys);
    rows
}

/// Packs linear keys. Rotations get the sign nearest to the key before, so that sampling need not choose the shorter arc.
fn linear_rows(keys: usize, columns: &[(Column, Lanes)]) -> KeyRows {
    let mut rows = KeyRows::with_columns(columns);
    let mut signs = vec![[1.0f32; LANES]; columns.len()];
    for key in 0..keys {
        for (index, (column, lanes)) in columns.iter().enumerate() {
            let mut values = key_rows(column.channel, lanes, |curve| key_value(curve, key));
            if column.channel != Channel::Rotation {
                rows.lanes.extend_from_slice(&values[..3]);
                continue;
            }
            let mut angles = Lane::splat(0.0);
            for lane in 0..LANES {
                let sign = signs[index][lane];
                values.iter_mut().for_each(|row| row.0[lane] *= sign);
                if let Some(curve) = lanes[lane].filter(|_| key + 1 < keys) {
                    let (d, flip) = shorter_arc(key_value(curve, key), key_value(curve, key + 1));
                    angles.0[lane] = d as f32;
                    signs[index][lane] = if flip { -sign } else { sign };
                }
            }
            rows.lanes.extend_from_slice(&values);
            rows.lanes.push(angles);
        }
    }
    rows.row_len = rows.lanes.len() / keys;
    rows
}

impl KeyRows {
    fn with_columns(columns: &[(Column, Lanes)]) -> KeyRows {
        let columns: Vec<Column> = columns.iter().map(|(column, _)| *column).collect();
        let terms = columns.iter().map(|c| c.terms).max().unwrap_or(0);
        KeyRows { columns, row_len: 0, lanes: Vec::new(), terms }
    }
}

/// 1 − cos of the shorter arc between two keys, and whether the second must change its sign for it.
pub(crate) fn shorter_arc(a: [f32; 4], b: [f32; 4]) -> (f64, bool) {
    let dot: f64 = (0..4).map(|i| f64::from(a[i]) * f64::from(b[i])).sum();
    let flip = dot < 0.0;
    (one_minus_cos(a, if flip { b.map(|c| -c) } else { b }), flip)
}

/// Terms of the slerp series that a curve needs: 0 unless it is a linear rotation.
fn slerp_terms(curve: &Curve) -> usize {
    if curve.path != Path::Rotation || curve.interpolation != Interpolation::Linear {
        return 0;
    }
    let widest = (1..curve.times.len())
        .map(|key| shorter_arc(key_value(curve, key - 1), key_value(curve, key)).0)
        .fold(0.0, f64::max);
    series_terms_for(widest)
}
