//! Motion without a closed form (blended layers, repeating curves, blend shapes): ufbx evaluates it at all keys it depends on, at
//! the file's rate between them, and more densely where linear interpolation misses it.

use crate::curve::Span;
use crate::file::File;
use crate::refine::{Quantity, Rows, refine};
use choreo_importer_kit::{Problem, Result};
use choreo_motion::Time;
use ufbx::{Anim, AnimCurve, Interpolation, Keyframe};

/// Samples between two keys of the file, at most.
const MAX_SEGMENTS: usize = 1 << 16;

/// Sample times of the clip, increasing and distinct: keys, both sides of steps, and regular samples where a curve bends.
pub(crate) fn sample_times<'a>(
    file: &File<'_>,
    curves: impl Iterator<Item = &'a AnimCurve>,
    span: Span,
    place: &dyn Fn() -> String,
) -> Result<Vec<Time>> {
    let mut out = Vec::new();
    for curve in curves {
        file.charge(curve.keyframes.len(), 16, place)?;
        let own = |secs: f64| Time::from_secs(secs) - span.begin;
        out.extend(curve.keyframes.iter().map(|k| own(k.time)));
        for pair in curve.keyframes.windows(2) {
            let (a, b) = (&pair[0], &pair[1]);
            if is_flat(a, b) {
                continue;
            }
            match a.interpolation {
                Interpolation::ConstantPrev => out.push(own(b.time) - Time(1)),
                Interpolation::ConstantNext => out.push(own(a.time) + Time(1)),
                _ => {
                    let count = (((b.time - a.time) * file.rate) as usize).min(MAX_SEGMENTS);
                    file.charge(count, 16, place)?;
                    let first = (a.time * file.rate).floor() + 1.0;
                    let even = (0..count).map(|k| (first + k as f64) / file.rate);
                    out.extend(even.filter(|t| *t < b.time).map(own));
                }
            }
        }
    }
    out.sort_unstable();
    out.dedup();
    let (first, last) = (out.first().copied(), out.last().copied());
    if first.is_some_and(|t| t < Time::ZERO) || last.is_some_and(|t| t > span.length()) {
        out.retain(|t| Time::ZERO < *t && *t < span.length());
        out.insert(0, Time::ZERO);
        if span.length() > Time::ZERO {
            out.push(span.length());
        }
    }
    Ok(out)
}

/// Whether the curve is constant between two keys.
pub(crate) fn is_flat(a: &Keyframe, b: &Keyframe) -> bool {
    let straight = a.interpolation != Interpolation::Cubic || a.right.dy == 0.0 && b.left.dy == 0.0;
    a.value == b.value && straight
}

/// Regular samples including both ends, for curves that repeat beyond their keys.
pub(crate) fn even_times(file: &File<'_>, span: Span, place: &dyn Fn() -> String) -> Result<Vec<Time>> {
    let count = ((span.length().as_secs() * file.rate) as usize).saturating_add(2);
    file.charge(count, 8, place)?;
    let at = |k: usize| Time::from_secs(k as f64 / file.rate);
    let mut out: Vec<Time> = (0..count).map(at).take_while(|t| *t < span.length()).collect();
    out.push(span.length());
    Ok(out)
}

/// Sampled translation, rotation and scale of a node. Rows are added until lines between them are close enough.
pub(crate) fn sample_node<'p>(
    file: &File<'_>,
    anim: &Anim,
    node: &ufbx::Node,
    (times, span): (Vec<Time>, Span),
    place: &dyn Fn() -> String,
) -> Result<Rows<'p>> {
    let begin = span.begin.as_secs();
    let evaluate = |time: Time, out: &mut Vec<f64>| {
        let at = node.evaluate_transform(anim, begin + time.as_secs());
        let (t, r, s) = (at.translation, at.rotation, at.scale);
        out.extend([t.x, t.y, t.z, r.x, r.y, r.z, r.w, s.x, s.y, s.z]);
    };
    sample_rows(file, &[Quantity::Translation, Quantity::Rotation, Quantity::Scale], times, evaluate, place)
}

pub(crate) fn sample_rows<'p>(
    file: &File<'_>,
    parts: &'p [Quantity],
    times: Vec<Time>,
    mut evaluate: impl FnMut(Time, &mut Vec<f64>),
    place: &dyn Fn() -> String,
) -> Result<Rows<'p>> {
    let width: usize = parts.iter().map(|p| p.width()).sum();
    file.charge(times.len(), 8 * width, place)?;
    let mut values = Vec::with_capacity(times.len() * width);
    times.iter().for_each(|t| evaluate(*t, &mut values));
    if values.iter().any(|v| !v.is_finite()) {
        return Err(Problem::new(place(), "cannot be evaluated: the result is not finite"));
    }
    let rows = Rows { parts, times, values };
    if file.accuracy.rate.is_some() {
        return Ok(rows);
    }
    Ok(refine(rows, file.accuracy, evaluate, || file.budget.charge(1, 8 + 8 * width).is_ok()))
}
