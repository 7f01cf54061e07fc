//! Joins two clips, one after the other.

use super::{CurveValues, EditError, key_or_inserted};
use crate::clip::{Clip, Curve, ExpressionCurve, Interpolation, Path};
use crate::skeleton::Skeleton;
use crate::time::Time;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Ticks between the LINEAR keys that replace a cubic curve if the other clip's curve is not cubic: 1/240 s.
const LINEAR_KEY_SPACING: i64 = Time::TICKS_PER_SECOND / 240;

impl Clip {
    /// This clip, followed by `next` from its end on. Properties that only one clip animates are at rest in the other, morph
    /// weights at zero. If the interpolations of a property differ, it becomes LINEAR: STEP exactly, CUBICSPLINE with keys 1/240
    /// s apart.
    pub fn joined(&self, next: &Clip, rest: &Skeleton) -> Result<Clip, EditError> {
        let names = || (self.name.clone(), next.name.clone());
        for clip in [self, next] {
            if clip.joint_count() != rest.len() {
                let (first, second) = (rest.names().first().cloned().unwrap_or_default(), clip.name.clone());
                let (joints, expected) = (clip.joint_count(), rest.len());
                return Err(EditError::Joints { first, second, joints, expected });
            }
        }
        let mut curve_pairs: BTreeMap<(u32, u8), [Option<&Curve>; 2]> = BTreeMap::new();
        for (at, clip) in [self, next].into_iter().enumerate() {
            for curve in clip.curves() {
                curve_pairs.entry((curve.joint, curve.path.property())).or_default()[at] = Some(curve);
            }
        }
        let mut values = [CurveValues::new(self), CurveValues::new(next)];
        let mut curves = Vec::with_capacity(curve_pairs.len());
        for ((joint, _), pair) in curve_pairs {
            let either = pair[0].or(pair[1]);
            let Some(path) = either.map(|c| c.path) else { continue };
            if pair.iter().flatten().any(|c| c.path != path) {
                let (first, second) = names();
                return Err(EditError::Weights { first, second, joint });
            }
            let interpolations: Vec<Interpolation> = pair.iter().flatten().map(|c| c.interpolation).collect();
            let interpolation = if interpolations.windows(2).all(|k| k[0] == k[1]) {
                interpolations[0]
            } else {
                Interpolation::Linear
            };
            let [first, second] = [0, 1].map(|at| match pair[at] {
                Some(curve) => with_interpolation(curve, interpolation, &mut values[at]),
                None => rest_curve(joint, path, interpolation, rest),
            });
            curves.push(join_curves(&first, self.duration, &second, &mut values));
        }
        let names: BTreeSet<&str> =
            [self, next].iter().flat_map(|c| c.expressions()).map(|e| e.name.as_str()).collect();
        let expressions = names.into_iter().map(|name| {
            let pair =
                [self, next].map(|c| c.expressions().iter().find(|e| e.name == name).map(|e| e.as_curve()));
            let equal_interpolation = pair[0]
                .as_ref()
                .zip(pair[1].as_ref())
                .is_none_or(|(a, b)| a.interpolation == b.interpolation);
            let kind = pair.iter().flatten().next().map_or(Interpolation::Linear, |c| c.interpolation);
            let kind = if equal_interpolation { kind } else { Interpolation::Linear };
            let [first, second] = [0, 1].map(|at| match &pair[at] {
                Some(curve) => with_interpolation(curve, kind, &mut values[at]),
                None => rest_curve(0, Path::Weights(1), kind, rest),
            });
            let Curve { interpolation, times, values, .. } =
                join_curves(&first, self.duration, &second, &mut values);
            ExpressionCurve { name: name.to_string(), interpolation, times, values }
        });
        let expressions = expressions.collect();
        Ok(self
            .with_curves(rest.len(), curves)
            .with_checked_expressions(expressions)
            .with_duration(self.duration + next.duration))
    }
}

/// A curve with one key: the rest pose, or morph weights of zero.
fn rest_curve(joint: u32, path: Path, interpolation: Interpolation, rest: &Skeleton) -> Curve {
    let rest = rest.rest().get(joint as usize).copied().unwrap_or_default();
    let value = match path {
        Path::Translation => rest.translation.to_array().to_vec(),
        Path::Rotation => rest.rotation.to_array().to_vec(),
        Path::Scale => rest.scale.to_array().to_vec(),
        Path::Weights(n) => vec![0.0; n as usize],
    };
    let mut values = Vec::new();
    if interpolation == Interpolation::CubicSpline {
        let zeros = vec![0.0; value.len()];
        values.extend(zeros.iter().chain(&value).chain(&zeros));
    } else {
        values.extend(value);
    }
    Curve { joint, path, interpolation, times: [Time::ZERO].into(), values: values.into() }
}

/// The curve, converted to another interpolation.
fn with_interpolation(curve: &Curve, interpolation: Interpolation, values: &mut CurveValues) -> Curve {
    if curve.interpolation == interpolation {
        return curve.clone();
    }
    let mut times = Vec::new();
    for (i, time) in curve.times.iter().enumerate() {
        let before = (i > 0).then(|| curve.times[i - 1]);
        match (curve.interpolation, before) {
            (Interpolation::Step, Some(before)) if *time - before > Time(1) => times.push(*time - Time(1)),
            (Interpolation::CubicSpline, Some(before)) => {
                let steps = ((*time - before).0 / LINEAR_KEY_SPACING).max(1);
                times.extend((1..steps).map(|s| before + Time(LINEAR_KEY_SPACING * s)));
            }
            _ => {}
        }
        times.push(*time);
    }
    let keys = times.iter().flat_map(|time| values.at(curve, *time)).collect();
    Curve { interpolation, times: times.into(), values: keys, ..curve.clone() }
}

/// Joins two curves of the same interpolation; the second begins at the time `end` of the first.
fn join_curves(first: &Curve, end: Time, second: &Curve, values: &mut [CurveValues; 2]) -> Curve {
    let stride = first.stride();
    let cubic = first.interpolation == Interpolation::CubicSpline;
    let width = first.path.width();
    let held_key = |curve: &Curve, time: Time, values: &mut CurveValues| match curve.times.len() {
        // This includes curves of the rest pose, which are in no clip.
        1 if cubic => {
            let mut key = curve.values.to_vec();
            key[..width].fill(0.0);
            key[2 * width..].fill(0.0);
            key
        }
        1 => curve.values.to_vec(),
        _ => key_or_inserted(curve, time, values),
    };
    let [first_values, second_values] = values;
    let mut start_key = held_key(second, Time::ZERO, second_values);
    let end_key = held_key(first, end, first_values);
    let value = |key: &[f32]| if cubic { key[width..2 * width].to_vec() } else { key.to_vec() };
    let seamless = value(&start_key) == value(&end_key);
    let (mut times, mut keys) = (Vec::new(), Vec::new());
    for (i, time) in first.times.iter().enumerate().filter(|(_, t)| **t < end) {
        times.push(*time);
        keys.extend(&first.values[i * stride..][..stride]);
    }
    // A cubic that is held after its last key has slope zero there.
    let before = keys.len();
    if cubic && before > 0 && first.times[first.times.len() - 1] < end {
        keys[before - width..].fill(0.0);
    }
    if first.interpolation != Interpolation::Step && !seamless {
        let last = end - Time(1);
        if times.last().is_none_or(|t| *t < last) {
            times.push(last);
            keys.extend(held_key(first, last, first_values));
        }
    }
    if seamless && cubic {
        start_key[..width].copy_from_slice(&end_key[..width]);
    }
    let later = second.times.iter().enumerate().filter(|(_, t)| **t > Time::ZERO);
    times.push(end);
    keys.extend(start_key);
    for (i, time) in later {
        times.push(end + *time);
        let begin = keys.len();
        keys.extend(&second.values[i * stride..][..stride]);
        if cubic && i == 0 {
            keys[begin..begin + width].fill(0.0);
        }
    }
    let times: Arc<[Time]> = times.into();
    Curve { times, values: keys.into(), ..first.clone() }
}
