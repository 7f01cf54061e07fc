//! Animation clips: key-framed curves of joint transforms and morph weights.
//!
//! Curves are the authored keys (glTF 2.0 §3.11, Appendix C); a clip is built from them once and
//! sampled at any time, without a cache, in any order.

pub(crate) mod common_times;
pub mod crossfade;
pub(crate) mod key_search;
pub(crate) mod packed;
pub(crate) mod property_curve;
pub mod sample;
pub(crate) mod sample_f64;
pub(crate) mod separate_key_times;
pub(crate) mod tracks;

use crate::clip::key_search::find_interval;
use crate::clip::property_curve::{PropertyCurve, PropertyTarget};
use crate::clip::tracks::Tracks;
use crate::time::Time;
use glam::Quat;
use packed::Packed;
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

/// How values between keys are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Interpolation {
    /// The value of the key before.
    Step,
    /// Translation, scale, weights: lerp. Rotation: shortest-arc slerp.
    Linear,
    /// Cubic Hermite; every key holds in-tangent, value, out-tangent (tangents per second).
    CubicSpline,
}

/// The property of a joint that a curve animates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Path {
    /// 3 floats per key, metres.
    Translation,
    /// 4 floats per key, x y z w.
    Rotation,
    /// 3 floats per key.
    Scale,
    /// Morph weights of the mesh at that joint, this many floats per key.
    Weights(u32),
}

impl Path {
    /// Number of the animated property, the same for morph weights whatever their count: curves of two clips that animate one
    /// property of a joint share it.
    pub fn property(self) -> u8 {
        match self {
            Path::Translation => 0,
            Path::Rotation => 1,
            Path::Scale => 2,
            Path::Weights(_) => 3,
        }
    }

    /// Number of floats of a value.
    pub fn width(self) -> usize {
        match self {
            Path::Translation | Path::Scale => 3,
            Path::Rotation => 4,
            Path::Weights(n) => n as usize,
        }
    }
}

/// One authored curve. `values.len() == times.len() * path.width() * (3 if CubicSpline else 1)`.
///
/// Keys are reference-counted, so that curves with equal key times, and clips bound to several
/// skeletons, share them. `vec.into()` makes one.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Index into the skeleton that the clip was authored on.
    pub joint: u32,
    /// The property that the curve animates.
    pub path: Path,
    /// How values between keys are found.
    pub interpolation: Interpolation,
    /// Strictly increasing, at least one.
    pub times: Arc<[Time]>,
    /// [`Curve::stride`] floats per key.
    pub values: Arc<[f32]>,
}

impl Curve {
    /// Number of floats of one key in `values`.
    pub fn stride(&self) -> usize {
        self.path.width() * if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 }
    }
}

/// The authored weight of a facial expression over time. A character that plays the clip looks up its own expression of this
/// name.
#[derive(Clone, Debug, PartialEq)]
pub struct ExpressionCurve {
    /// Name of the expression.
    pub name: String,
    /// How values between keys are found.
    pub interpolation: Interpolation,
    /// Key times as in [`Curve`].
    pub times: Arc<[Time]>,
    /// One weight per key (three numbers if CubicSpline), meant to be 0..=1.
    pub values: Arc<[f32]>,
}

impl ExpressionCurve {
    /// The curve as one morph weight of joint 0.
    pub(crate) fn as_curve(&self) -> Curve {
        let (times, values) = (self.times.clone(), self.values.clone());
        Curve { joint: 0, path: Path::Weights(1), interpolation: self.interpolation, times, values }
    }

    pub(crate) fn with_keys_of(&self, curve: Curve) -> ExpressionCurve {
        let Curve { interpolation, times, values, .. } = curve;
        ExpressionCurve { name: self.name.clone(), interpolation, times, values }
    }
}

/// The reason why curves do not form a clip: a curve and its error.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum ClipError {
    Curve { curve: usize, joint: u32, path: Path, what: CurveError },
    Property { curve: usize, target: PropertyTarget, what: CurveError },
}

crate::error_texts! { ClipError:
    Self::Curve { curve, joint, path, what } => "curve {curve} ({path:?} of joint {joint}): {what}";
    Self::Property { curve, target, what } => "property curve {curve} ({target:?}): {what}";
}

/// Error of a curve.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum CurveError {
    NoKeys,
    Values { keys: usize, stride: usize, values: usize },
    TimeRepeats { key: usize, time: f64 },
    TimeRunsBackwards { key: usize, time: f64, before: f64 },
    NotFinite { key: usize, value: f32 },
    TooLarge { key: usize, value: f32 },
    NoJoint(usize),
    TooManyWeights(u32),
    ZeroRotation(usize),
    Duplicate(usize),
    TwoCurves,
}

crate::error_texts! { CurveError:
    Self::NoKeys => "it has no keys";
    Self::Values { keys, stride, values } => "the number of values is {values}, must be {} ({stride} per key)", keys.saturating_mul(*stride);
    Self::TimeRepeats { key, time } => "the time of key {key} ({time} s) repeats that of key {} ({time} s); key times must increase", key - 1;
    Self::TimeRunsBackwards { key, time, before } => "the time of key {key} ({time} s) runs backwards from that of key {} ({before} s); key times must increase", key - 1;
    Self::NotFinite { key, value } => "key {key} holds {value}, must be finite";
    Self::TooLarge { key, value } => "key {key} holds {value}, at most ±{MAX_KEY} is allowed";
    Self::NoJoint(joints) => "there is no such joint; number of the skeleton's joints: {joints}";
    Self::TooManyWeights(count) => "{count} morph weights, at most {MAX_WEIGHTS} are allowed";
    Self::ZeroRotation(key) => "the rotation of key {key} has length zero, must be 1";
    Self::Duplicate(curve) => "curve {curve} already drives the same property";
    Self::TwoCurves => "it has two curves, must have one";
}

/// Error of an expression's curve.
#[derive(Clone, Debug, PartialEq)]
pub struct ExpressionError {
    /// Name of the expression.
    pub name: String,
    /// The problem.
    pub what: CurveError,
}

crate::error_texts! { ExpressionError:
    Self { name, what } => "expression \"{name}\": {what}";
}

/// Result of a compression.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CompressionReport {
    /// Bytes of keys, ranges and constants, before and after.
    pub bytes: [usize; 2],
    /// Size of translation, rotation and scale of every joint at 30 Hz in f32: 40 bytes per joint and key.
    pub dense_bytes: usize,
    /// Largest error in model space, metres, of any joint and of points 10 cm from it along each axis: at all keys and halfway
    /// between, at most 4,000 times. Zero if the clip stays as it was, since it would not have become smaller.
    pub worst_m: f64,
}

/// A checked clip. Times run from zero to `duration`; before the first and after the last key a curve holds its end values.
#[derive(Clone, Debug, Default)]
pub struct Clip {
    /// Name in the file.
    pub name: String,
    /// Time of the last key.
    pub duration: Time,
    joint_count: usize,
    /// All curves; of a compressed clip, those that are not packed.
    curves: Arc<[Curve]>,
    packed: Option<Arc<Packed>>,
    compression: Option<CompressionReport>,
    /// All curves of a compressed clip, decoded on request.
    decoded: Arc<OnceLock<Box<[Curve]>>>,
    /// Data for sampling, made at the first sampling and shared by clones.
    tracks: Arc<OnceLock<Tracks>>,
    /// Joints with a transform curve, one bit each.
    animated: Arc<[u64]>,
    /// (joint, curve), sorted.
    weight_curves: Arc<[(u32, u32)]>,
    /// Curves of expressions, sorted by name, each name once.
    expressions: Arc<[ExpressionCurve]>,
    properties: Arc<[property_curve::CheckedPropertyCurve]>,
}

/// Largest number of morph targets that one curve may drive; a file with more is refused.
pub const MAX_WEIGHTS: u32 = 65_536;

/// The largest number a key may hold, so that interpolation stays within f32.
pub(crate) const MAX_KEY: f32 = 1e15;

impl Clip {
    /// Checks the curves against a skeleton of `joint_count` joints: lengths, order, finiteness, unit rotations (renormalized).
    pub fn new(name: String, joint_count: usize, mut curves: Vec<Curve>) -> Result<Clip, ClipError> {
        let mut driven = BTreeMap::new();
        for (index, curve) in curves.iter_mut().enumerate() {
            let place = (curve.joint, curve.path);
            check_curve(curve, joint_count)
                .and_then(|()| {
                    let kind = match curve.path {
                        Path::Weights(_) => Path::Weights(0),
                        path => path,
                    };
                    match driven.insert((curve.joint, kind), index) {
                        Some(first) => Err(CurveError::Duplicate(first)),
                        None => Ok(()),
                    }
                })
                .map_err(|what| ClipError::Curve { curve: index, joint: place.0, path: place.1, what })?;
        }
        let duration = curves.iter().filter_map(|c| c.times.last()).max().copied().unwrap_or(Time::ZERO);
        Ok(Clip::from_checked(name, duration.max(Time::ZERO), joint_count, curves))
    }

    /// Makes a clip of curves that are known to be valid.
    fn from_checked(name: String, duration: Time, joint_count: usize, curves: Vec<Curve>) -> Clip {
        let mut animated = vec![0u64; joint_count.div_ceil(64)];
        let mut weight_curves = Vec::new();
        for (index, curve) in curves.iter().enumerate() {
            match curve.path {
                Path::Weights(_) => weight_curves.push((curve.joint, index as u32)),
                _ => animated[curve.joint as usize / 64] |= 1 << (curve.joint % 64),
            }
        }
        weight_curves.sort_unstable();
        Clip {
            name,
            duration,
            joint_count,
            curves: curves.into(),
            packed: None,
            compression: None,
            decoded: Arc::default(),
            tracks: Arc::default(),
            animated: animated.into(),
            weight_curves: weight_curves.into(),
            expressions: Arc::default(),
            properties: [].into(),
        }
    }

    /// Sets the curves of expressions, checked like the others; each name once. The duration grows to the longest curve.
    pub fn with_expressions(mut self, mut curves: Vec<ExpressionCurve>) -> Result<Clip, ExpressionError> {
        curves.sort_by(|a, b| a.name.cmp(&b.name));
        for (index, curve) in curves.iter().enumerate() {
            let error = |what| ExpressionError { name: curve.name.clone(), what };
            if index > 0 && curves[index - 1].name == curve.name {
                return Err(error(CurveError::TwoCurves));
            }
            let stride = if curve.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
            check_keys(&curve.times, &curve.values, stride).map_err(error)?;
            self.duration = self.duration.max(curve.times[curve.times.len() - 1]);
        }
        self.expressions = curves.into();
        Ok(self)
    }

    /// Authored weights of expressions, by name.
    pub fn expressions(&self) -> &[ExpressionCurve] {
        &self.expressions
    }

    /// Weight of an expression at a time; `None` if the clip does not drive it.
    pub fn sample_expression(&self, name: &str, time: Time) -> Option<f32> {
        let at = self.expressions.binary_search_by(|c| c.name.as_str().cmp(name)).ok()?;
        let curve = &self.expressions[at];
        let mut weight = [0.0];
        crate::clip::sample::interpolate_curve(
            &curve.as_curve(),
            find_interval(&curve.times, time),
            &mut weight,
        );
        Some(weight[0])
    }

    /// The clip with other curves of the same joints, and its duration. `curves` must be valid, as [`Clip::new`] checks them.
    pub fn rekeyed(&self, curves: Vec<Curve>) -> Clip {
        self.with_curves(self.joint_count(), curves).with_duration(self.duration)
    }

    pub(crate) fn with_curves(&self, joint_count: usize, curves: Vec<Curve>) -> Clip {
        let clip = Clip::from_checked(self.name.clone(), self.duration, joint_count, curves);
        Clip { expressions: self.expressions.clone(), ..clip }
    }

    /// The clip with each curve changed, including those of expressions, which are passed as curves of one morph weight.
    pub(crate) fn try_map_curves<E>(
        &self,
        mut change: impl FnMut(&Curve) -> Result<Curve, E>,
    ) -> Result<Clip, E> {
        let curves = self.curves().iter().map(&mut change).collect::<Result<Vec<_>, E>>()?;
        let expression = |e: &ExpressionCurve| Ok(e.with_keys_of(change(&e.as_curve())?));
        let expressions = self.expressions.iter().map(expression).collect::<Result<Vec<_>, E>>()?;
        Ok(self.with_curves(self.joint_count, curves).with_checked_expressions(expressions))
    }

    /// Sets expression curves that are known to be valid, sorted by name.
    pub(crate) fn with_checked_expressions(self, expressions: Vec<ExpressionCurve>) -> Clip {
        Clip { expressions: expressions.into(), ..self }
    }

    /// Sets the duration.
    pub(crate) fn with_duration(mut self, duration: Time) -> Clip {
        self.duration = duration;
        self
    }

    /// The clip with curves of its asset's cameras, lights and materials. The duration grows to the longest curve.
    pub fn with_properties(mut self, curves: Vec<PropertyCurve>) -> Result<Clip, ClipError> {
        self.properties = property_curve::check_property_curves(curves)?.into();
        let last = self.properties.iter().filter_map(|p| p.curve().times.last()).max();
        self.duration = self.duration.max(last.copied().unwrap_or(Time::ZERO));
        Ok(self)
    }

    /// Animated properties of cameras, lights and materials, each with its curve (in the form of a curve of morph weights).
    pub fn properties(&self) -> impl ExactSizeIterator<Item = (PropertyTarget, &Curve)> {
        self.properties.iter().map(|p| (p.target(), p.curve()))
    }

    /// Samples a property into the first elements of `out`. Returns false and leaves `out` unchanged if the clip does not drive
    /// it.
    pub fn sample_property(&self, target: PropertyTarget, time: Time, out: &mut [f32]) -> bool {
        let found = self.properties.iter().find(|p| p.target() == target);
        found.inspect(|p| p.sample(time, out)).is_some()
    }

    /// Prepares the clip for sampling, which otherwise happens when it is first sampled.
    pub fn prepare(&self) {
        self.tracks();
    }

    pub(crate) fn with_properties_of(self, other: &Clip) -> Clip {
        Clip { properties: other.properties.clone(), ..self }
    }

    pub(crate) fn tracks(&self) -> &Tracks {
        self.tracks.get_or_init(|| Tracks::pack(self.joint_count, &self.curves, self.packed.as_ref()))
    }

    /// The authored curves, as checked; those of a compressed clip are decoded once, when they are requested.
    pub fn curves(&self) -> &[Curve] {
        let Some(packed) = &self.packed else { return &self.curves };
        self.decoded.get_or_init(|| {
            let decoded = packed.decoded(self.joint_count);
            self.curves.iter().cloned().chain(decoded).collect()
        })
    }

    /// Curves that are stored as keys.
    pub(crate) fn stored_curves(&self) -> &[Curve] {
        &self.curves
    }

    pub(crate) fn packed(&self) -> Option<&Packed> {
        self.packed.as_deref()
    }

    /// Whether the clip is compressed; see [`Clip::compressed`].
    pub fn is_compressed(&self) -> bool {
        self.packed.is_some()
    }

    /// The result of the clip's compression; `None` if it was not compressed, or would not have become smaller.
    pub fn compression(&self) -> Option<CompressionReport> {
        self.compression
    }

    pub(crate) fn with_compression(self, compression: CompressionReport) -> Clip {
        Clip { compression: Some(compression), ..self }
    }

    /// Adds packed curves to those of the clip.
    pub(crate) fn with_packed(self, packed: Arc<Packed>) -> Clip {
        let mut animated = self.animated.to_vec();
        for column in packed.columns() {
            for joint in packed.joints(column, self.joint_count) {
                animated[joint as usize / 64] |= 1 << (joint % 64);
            }
        }
        Clip {
            packed: Some(packed),
            animated: animated.into(),
            tracks: Arc::default(),
            decoded: Arc::default(),
            ..self
        }
    }

    /// Number of joints of the skeleton that the clip was checked against.
    pub fn joint_count(&self) -> usize {
        self.joint_count
    }

    /// Whether any translation, rotation or scale curve moves this joint.
    pub fn animates(&self, joint: u32) -> bool {
        self.animated.get(joint as usize / 64).is_some_and(|bits| bits >> (joint % 64) & 1 == 1)
    }

    /// Samples the morph weights of the mesh at `joint` into `out`. Returns false and leaves `out` unchanged if the clip does not
    /// drive them. If the counts differ, the smaller one applies.
    pub fn sample_weights(&self, joint: u32, time: Time, out: &mut [f32]) -> bool {
        let at = self.weight_curves.partition_point(|(j, _)| *j < joint);
        let Some((_, curve)) = self.weight_curves.get(at).filter(|(j, _)| *j == joint) else { return false };
        let curve = &self.curves[*curve as usize];
        crate::clip::sample::interpolate_curve(curve, find_interval(&curve.times, time), out);
        true
    }
}

/// Checks that there is a key, that times increase, and that all keys have their values, all finite.
fn check_keys(times: &[Time], values: &[f32], stride: usize) -> Result<(), CurveError> {
    let keys = times.len();
    if keys == 0 {
        return Err(CurveError::NoKeys);
    }
    if keys.checked_mul(stride) != Some(values.len()) {
        return Err(CurveError::Values { keys, stride, values: values.len() });
    }
    if let Some(at) = times.windows(2).position(|pair| pair[1] <= pair[0]) {
        let (key, time, before) = (at + 1, times[at + 1].as_secs(), times[at].as_secs());
        return Err(match times[at + 1] == times[at] {
            true => CurveError::TimeRepeats { key, time },
            false => CurveError::TimeRunsBackwards { key, time, before },
        });
    }
    if let Some(at) = values.iter().position(|v| !v.is_finite()) {
        return Err(CurveError::NotFinite { key: at / stride, value: values[at] });
    }
    if let Some(at) = values.iter().position(|v| v.abs() > MAX_KEY) {
        return Err(CurveError::TooLarge { key: at / stride, value: values[at] });
    }
    Ok(())
}

/// Checks one curve and renormalizes its rotations; the error states which key is wrong.
pub(crate) fn check_curve(curve: &mut Curve, joint_count: usize) -> Result<(), CurveError> {
    if curve.joint as usize >= joint_count {
        return Err(CurveError::NoJoint(joint_count));
    }
    if let Path::Weights(n) = curve.path
        && n > MAX_WEIGHTS
    {
        return Err(CurveError::TooManyWeights(n));
    }
    check_keys(&curve.times, &curve.values, curve.stride())?;
    let (keys, stride) = (curve.times.len(), curve.stride());
    if curve.path == Path::Rotation {
        let value_at = if curve.interpolation == Interpolation::CubicSpline { 4 } else { 0 };
        for key in 0..keys {
            let at = key * stride + value_at;
            let q: [f32; 4] = [0, 1, 2, 3].map(|i| curve.values[at + i]);
            let unit = unit_rotation(q).ok_or(CurveError::ZeroRotation(key))?;
            if unit != q {
                Arc::make_mut(&mut curve.values)[at..at + 4].copy_from_slice(&unit);
            }
        }
    }
    Ok(())
}

/// Normalizes a quaternion in f64; unchanged if it has unit length to the precision of f32, `None` at length zero.
fn unit_rotation(q: [f32; 4]) -> Option<[f32; 4]> {
    let length_squared: f64 = q.iter().map(|&c| f64::from(c) * f64::from(c)).sum();
    if (length_squared - 1.0).abs() <= 3e-7 {
        return Some(q);
    }
    let length = length_squared.sqrt();
    if length < 1e-12 {
        return None;
    }
    let unit = q.map(|c| (f64::from(c) / length) as f32);
    Quat::from_array(unit).is_finite().then_some(unit)
}
