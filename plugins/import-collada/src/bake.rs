//! Channels of one node become curves of its translation, rotation and scale.
//!
//! A matrix that is animated as a whole keeps its keys: each is decomposed, and translation, rotation and scale are interpolated
//! between them. All other channels (angles about axes, single coordinates, curved keys) are sampled at all keys, and between
//! keys where linear interpolation would exceed the tolerances below.

use crate::controller::MorphTargets;
use crate::nodes::{TransformElement, TransformKind, Tree, transform};
use crate::sampler::{Interpolation as Between, Sampler};
use crate::xml::Xml;
use choreo_importer_kit::decompose::{Trs, decompose};
use choreo_importer_kit::{Result, WithPlace};
use choreo_motion::{Curve, Interpolation, Path, Time, Transform};
use glam::{DQuat, Vec3};
use std::rc::Rc;
use std::sync::Arc;

/// Tolerance: radians for rotations, relative for scales, and relative to the node's longest translation for lengths.
pub(crate) const TOLERANCE: f64 = 5e-5;
/// Halvings of an interval between two keys, at most.
pub(crate) const MAX_DEPTH: u32 = 9;
/// Keys of one node, at most.
pub(crate) const MAX_KEYS: usize = 1_000_000;

/// The values of a transform element that a channel drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Component {
    All,
    One(usize),
}

impl Component {
    /// Parses `.X`, `.ANGLE`, `(2)` or `(3)(0)`; the last form is column and row of a matrix.
    pub(crate) fn of(member: &str, kind: TransformKind) -> Option<Component> {
        if member.is_empty() {
            return Some(Component::All);
        }
        let index = match member.strip_prefix('.') {
            Some("X") => 0,
            Some("Y") => 1,
            Some("Z") => 2,
            Some("ANGLE") => 3,
            Some(_) => return None,
            None => {
                let mut numbers = member.split(['(', ')']).filter(|t| !t.is_empty());
                let first: usize = numbers.next()?.parse().ok()?;
                match numbers.next() {
                    None => first,
                    Some(second) if kind == TransformKind::Matrix && first < 4 => {
                        second.parse::<usize>().ok()?.checked_mul(4)? + first
                    }
                    Some(_) => return None,
                }
            }
        };
        let count = match kind {
            TransformKind::Matrix => 16,
            TransformKind::Translate | TransformKind::Scale => 3,
            TransformKind::Rotate => 4,
            TransformKind::LookAt => 9,
        };
        (index < count).then_some(Component::One(index))
    }
}

pub(crate) struct Bound {
    pub element: usize,
    pub component: Component,
    pub sampler: Rc<Sampler>,
}

struct AnimatedNode<'t, 'a> {
    tree: &'t Tree<'a>,
    root: bool,
    stack: Vec<TransformElement<'a>>,
    bound: &'t [Bound],
    /// The sampler, where the only channel drives a whole matrix with STEP or LINEAR keys.
    whole: Option<&'t Sampler>,
}

impl AnimatedNode<'_, '_> {
    fn fill(&mut self, time: Time) {
        for b in self.bound {
            let values = &mut self.stack[b.element].values;
            match b.component {
                Component::One(index) => values[index] = b.sampler.value(time, 0),
                Component::All => b.sampler.row(time, values),
            }
        }
    }

    fn at(&mut self, time: Time) -> Trs {
        if let Some(sampler) = self.whole {
            let (key, part) = sampler.locate(time);
            if part > 0.0 {
                let (a, b) = (self.at(sampler.times[key]), self.at(sampler.times[key + 1]));
                return between(&a, &b, part);
            }
        }
        self.fill(time);
        decompose(&self.tree.convention.local(&self.stack, self.root))
    }
}

/// Interpolates like the motion crate: lerp for translation and scale, slerp for rotation.
fn between(a: &Trs, b: &Trs, part: f64) -> Trs {
    Trs {
        translation: a.translation.lerp(b.translation, part),
        rotation: slerp(a.rotation, b.rotation, part),
        scale: a.scale.lerp(b.scale, part),
        error: 0.0,
    }
}

fn slerp(a: DQuat, b: DQuat, part: f64) -> DQuat {
    let b = if a.dot(b) < 0.0 { -b } else { b };
    let angle = libm::acos(a.dot(b).clamp(-1.0, 1.0));
    if angle < 1e-9 {
        return a;
    }
    let sin = libm::sin(angle);
    (a * (libm::sin((1.0 - part) * angle) / sin) + b * (libm::sin(part * angle) / sin)).normalize()
}

struct Key {
    time: Time,
    parts: Trs,
}

/// The curves of one joint. Errors have no place yet.
pub(crate) fn joint(
    xml: &Xml<'_>,
    tree: &Tree<'_>,
    joint: u32,
    bound: &[Bound],
    range: (Time, Time),
) -> Result<Vec<Curve>> {
    let stack = tree.joints[joint as usize].stack.clone();
    let root = tree.joints[joint as usize].parent.is_none();
    let whole = match bound {
        [b] if stack[b.element].kind == TransformKind::Matrix
            && b.component == Component::All
            && b.sampler.is_plain() =>
        {
            Some(&*b.sampler)
        }
        _ => None,
    };
    let rest = transform(&decompose(&tree.convention.local(&stack, root)));
    let keys = keys(&mut AnimatedNode { tree, root, stack, bound, whole }, range)?;
    xml.budget.charge(keys.len() as u64, 48)?;
    let all_step = bound.iter().all(|b| b.sampler.steps().1);
    let interpolation = if all_step { Interpolation::Step } else { Interpolation::Linear };
    Ok(curves(joint, &rest, &keys, range.0, interpolation))
}

/// Keys at all key times of the samplers, and between them where linear interpolation is not close enough.
fn keys(node: &mut AnimatedNode<'_, '_>, (start, end): (Time, Time)) -> Result<Vec<Key>> {
    let bound = node.bound;
    let times = key_times(bound.iter().map(|b| &*b.sampler), start, end);
    let all_step = bound.iter().all(|b| b.sampler.steps().1);
    let mut keys: Vec<Key> = Vec::with_capacity(times.len());
    let at_keys: Vec<Trs> = times.iter().map(|t| node.at(*t)).collect();
    let longest = at_keys.iter().map(|p| p.translation.length()).fold(1e-6, f64::max);
    for (index, time) in times.iter().enumerate() {
        if let Some(before) = index.checked_sub(1).filter(|_| !all_step).map(|i| times[i]) {
            let jumps = bound.iter().any(|b| {
                let key = b.sampler.locate(before).0;
                b.sampler.interpolation[key] == Between::Step && b.sampler.times.binary_search(time).is_ok()
            });
            // A value that jumps at this key holds until one tick before it.
            let until = if jumps { Time(time.0 - 1) } else { *time };
            let held = if jumps { node.at(until) } else { at_keys[index] };
            if node.whole.is_none() && until > before {
                let ends = ((before, &at_keys[index - 1]), (until, &held));
                refine(node, ends, None, longest, 0, &mut keys);
            }
            if jumps && until > before {
                keys.push(Key { time: until, parts: held });
            }
        }
        keys.push(Key { time: *time, parts: at_keys[index] });
        if keys.len() > MAX_KEYS {
            let what = format!("its animation comes to more than {MAX_KEYS} keys, which is the limit");
            return Err(what.into());
        }
    }
    Ok(keys)
}

/// Curves of translation, rotation and scale. Translations and scales that stay at rest are left out; rotations are always kept,
/// so that the clip drives its joints.
fn curves(
    joint: u32,
    rest: &Transform,
    keys: &[Key],
    start: Time,
    interpolation: Interpolation,
) -> Vec<Curve> {
    let times: Arc<[Time]> = keys.iter().map(|k| k.time - start).collect();
    let curve = |path, values: Vec<f32>| Curve {
        joint,
        path,
        interpolation,
        times: times.clone(),
        values: values.into(),
    };
    let mut out = Vec::with_capacity(3);
    let differs = |values: &[f32], rest: Vec3, tolerance: &dyn Fn(f32) -> f32| {
        let far = |(v, r): (&f32, f32)| (v - r).abs() > tolerance(r);
        values.chunks_exact(3).any(|row| row.iter().zip(rest.to_array()).any(far))
    };
    let translations: Vec<f32> = keys.iter().flat_map(|k| k.parts.translation.as_vec3().to_array()).collect();
    let near = rest.translation.abs().max_element().max(1e-6) * 2e-7;
    if differs(&translations, rest.translation, &|_| near) {
        out.push(curve(Path::Translation, translations));
    }
    let rotations = keys.iter().flat_map(|k| k.parts.rotation.as_quat().to_array()).collect();
    out.push(curve(Path::Rotation, rotations));
    let scales: Vec<f32> = keys.iter().flat_map(|k| k.parts.scale.as_vec3().to_array()).collect();
    // Matrices printed with six digits give scales such as 0.999998.
    if differs(&scales, rest.scale, &|scale| 1e-5 * scale.abs().max(1e-3)) {
        out.push(curve(Path::Scale, scales));
    }
    out
}

/// Start, end, and all key times between them.
pub(crate) fn key_times<'s>(
    samplers: impl Iterator<Item = &'s Sampler>,
    start: Time,
    end: Time,
) -> Vec<Time> {
    let mut times = vec![start, end];
    let mut first = end;
    let mut last = start;
    for sampler in samplers {
        times.extend(sampler.times.iter().filter(|t| (start..=end).contains(*t)));
        first = first.min(sampler.times.first().copied().unwrap_or(end));
        last = last.max(sampler.times.last().copied().unwrap_or(start));
    }
    times.sort_unstable();
    times.dedup();
    // Nothing changes before the first and after the last key.
    times.retain(|t| *t >= first.max(start).min(end) && *t <= last.min(end).max(start));
    if times.is_empty() {
        times.push(start);
    }
    times
}

/// Key times, each preceded by the last tick before it where a value jumps.
pub(crate) fn held_keys<'s, I: Iterator<Item = &'s Sampler>>(
    times: &[Time],
    samplers: impl Fn() -> I,
) -> Vec<Time> {
    let mut out: Vec<Time> = Vec::with_capacity(times.len());
    for time in times {
        let jumps = |s: &Sampler| {
            s.times.binary_search(time).is_ok_and(|key| key > 0 && s.interpolation[key - 1] == Between::Step)
        };
        let all_step = samplers().all(|s| s.steps().1);
        if !all_step && samplers().any(jumps) && out.last().is_some_and(|last| *last < *time - Time(1)) {
            out.push(*time - Time(1));
        }
        out.push(*time);
    }
    out
}

/// Adds keys between two times until linear interpolation is close enough. `middle` is the exact value in the middle, where the
/// caller has computed it.
fn refine(
    node: &mut AnimatedNode<'_, '_>,
    (a, b): ((Time, &Trs), (Time, &Trs)),
    middle: Option<Trs>,
    longest: f64,
    depth: u32,
    out: &mut Vec<Key>,
) {
    let span = b.0.0 - a.0.0;
    if depth == MAX_DEPTH || span < Time::TICKS_PER_SECOND / 2000 || out.len() > MAX_KEYS {
        return;
    }
    let time_at = |quarter: i64| Time(a.0.0 + span / 4 * quarter);
    let off = |time: Time, truth: &Trs| {
        let part = (time.0 - a.0.0) as f64 / span as f64;
        let guess = between(a.1, b.1, part);
        let angle = 2.0 * libm::acos(guess.rotation.dot(truth.rotation).abs().min(1.0));
        guess.translation.distance(truth.translation) > longest * TOLERANCE
            || angle > TOLERANCE
            || (guess.scale - truth.scale).abs().max_element()
                > truth.scale.abs().max_element().max(1e-9) * TOLERANCE
    };
    let time = time_at(2);
    let middle = middle.unwrap_or_else(|| node.at(time));
    // Quarters are tested too, because an S-shaped curve can meet its line in the middle.
    let mut quarters = [None, None];
    let mut split = off(time, &middle);
    for (known, quarter) in quarters.iter_mut().zip([1, 3]) {
        if !split {
            let parts = node.at(time_at(quarter));
            split = off(time_at(quarter), &parts);
            // The value is reused only where it lies exactly in the middle of a half.
            *known = (span % 8 == 0).then_some(parts);
        }
    }
    if split {
        refine(node, (a, (time, &middle)), quarters[0], longest, depth + 1, out);
        out.push(Key { time, parts: middle });
        refine(node, ((time, &middle), b), quarters[1], longest, depth + 1, out);
    }
}

/// The morph weights of one mesh instance as one curve, with keys at all key times.
pub(crate) fn weights(
    xml: &Xml<'_>,
    morph: &MorphTargets,
    samplers: &[(usize, Rc<Sampler>)],
    (start, end): (Time, Time),
) -> Result<Vec<Curve>> {
    let count = morph.weights.len();
    let all = || samplers.iter().map(|s| &*s.1);
    let mut times = key_times(all(), start, end);
    if !all().all(Sampler::is_plain) {
        // Curved weights are sampled at 60 Hz.
        let frame = Time::TICKS_PER_SECOND / 60;
        let frames = ((end.0 - start.0) / frame).clamp(0, MAX_KEYS as i64);
        times.extend((0..frames).map(|i| Time(start.0 + i * frame)));
        times.sort_unstable();
        times.dedup();
    }
    let times = held_keys(&times, all);
    let place = || format!("morph of node {}", morph.joint);
    xml.budget.charge(times.len() as u64, count * 4 + 8).at(place)?;
    let mut values = Vec::with_capacity(times.len() * count);
    for time in &times {
        let mut row = morph.weights.clone();
        for (index, sampler) in samplers {
            if let Some(slot) = row.get_mut(*index) {
                *slot = sampler.value(*time, 0) as f32;
            }
        }
        values.extend(row);
    }
    let times: Arc<[Time]> = times.iter().map(|t| *t - start).collect();
    Ok(vec![Curve {
        joint: morph.joint,
        path: Path::Weights(count as u32),
        interpolation: if all().all(|s| s.steps().1) { Interpolation::Step } else { Interpolation::Linear },
        times,
        values: values.into(),
    }])
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn parts_of_transforms() {
        assert_eq!(Component::of("", TransformKind::Matrix), Some(Component::All));
        assert_eq!(Component::of(".Y", TransformKind::Translate), Some(Component::One(1)));
        assert_eq!(Component::of(".ANGLE", TransformKind::Rotate), Some(Component::One(3)));
        assert_eq!(Component::of(".ANGLE", TransformKind::Scale), None);
        // Column 3, row 1 is the y of the translation.
        assert_eq!(Component::of("(3)(1)", TransformKind::Matrix), Some(Component::One(7)));
        assert_eq!(Component::of("(2)", TransformKind::Translate), Some(Component::One(2)));
        for wrong in [".W", "(4)(0)", "(0)(4)", "(-1)", "(x)", "(99999999999999999999)"] {
            assert_eq!(Component::of(wrong, TransformKind::Matrix), None, "{wrong}");
        }
    }

    #[test]
    fn slerp_takes_the_short_way() {
        let a = DQuat::IDENTITY;
        let b = -DQuat::from_axis_angle(DVec3::Z, 1.0);
        assert!(slerp(a, b, 0.5).angle_between(DQuat::from_axis_angle(DVec3::Z, 0.5)) < 1e-7);
    }
}
