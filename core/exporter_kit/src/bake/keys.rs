//! Clips that play unchanged keep their keys. The timeline is split into stretches in which clip time is a linear function of stage time.

use crate::bake::tracks::{JUMP_TICKS, Track};
use choreo_plugin::glam::Quat;
use choreo_plugin::motion::{Clip, Curve, Interpolation, Path, Repeat, Time};
use choreo_plugin::stage::{Actor, Cue, Layer, Property, Stage};
use std::collections::BTreeMap;

/// A part of the timeline in which a cue plays at one speed in one direction, or stands still.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stretch {
    cue: usize,
    from: Time,
    to: Time,
    /// Clip time at `from`.
    at: Time,
    /// Clip seconds per stage second.
    rate: f64,
}

/// Curves of clips on the timeline. Their numbers are made when they are requested.
pub struct KeyTracks<'a> {
    stretches: Vec<Stretch>,
    tracks: Vec<KeyTrack<'a>>,
}

struct KeyTrack<'a> {
    /// One per cue; `None` where the clip leaves the joint at rest.
    curves: Vec<Option<&'a Curve>>,
    rest: Vec<f32>,
    cubic: bool,
}

/// Whether an actor's joints and morph weights are those of its clips, one at a time, and nothing else.
pub(crate) fn plays_unchanged(stage: &Stage, actor: &Actor) -> bool {
    let weights = |p: &Property| matches!(p, Property::Morph { .. } | Property::Expression { .. });
    let plain = stage.frame_callbacks.is_empty()
        && actor.constraints.is_empty()
        && actor.look_at.is_empty()
        && actor.limits.is_empty()
        && actor.springs.is_none()
        && actor.expressions.is_empty()
        && actor.morphs.is_empty()
        && !actor.channels.iter().any(|c| weights(&c.property))
        && actor.layers.iter().skip(1).all(|layer| layer.cues.is_empty());
    let Some(base) = actor.layers.first() else { return plain };
    plain && base.mask.is_none() && base.cues.iter().enumerate().all(|(i, cue)| is_plain(actor, i, cue))
}

fn is_plain(actor: &Actor, index: usize, cue: &Cue) -> bool {
    // All fields are named, so that a new one is a compile error until it is clear whether poses are still those of the keys.
    let Cue {
        clip,
        fade_in,
        weight,
        weight_keys,
        phase_matched_fades,
        inertialization,
        root,
        // `plays_at_constant_speed` checks these two fields; `add_stretches` handles the others.
        time_remapping: _,
        freezes: _,
        start: _,
        end: _,
        fade_out: _,
        trim: _,
        ease: _,
        speed: _,
        repeat: _,
    } = cue;
    // The first cue always has full weight.
    let whole = index == 0 || (*weight >= 1.0 && weight_keys.is_none() && *fade_in <= Time::ZERO);
    whole
        && *inertialization <= Time::ZERO
        && phase_matched_fades.iter().all(Option::is_none)
        && cue.plays_at_constant_speed()
        && root.is_none()
        && clip.expressions().is_empty()
        && clip.joint_count() == actor.asset.skeleton.len()
}

/// Keys of the base layer's clips between two times, as (key times, tracks, constant values, numbers). `None` if a spline would have to be
/// cut within a segment, or if curves of one joint differ in interpolation.
type Keys<'a> = (Vec<Vec<Time>>, Vec<Track>, Vec<(u32, Path, Vec<f32>)>, KeyTracks<'a>);

pub(super) fn keys<'a>(actor: &'a Actor, start: Time, end: Time) -> Option<Keys<'a>> {
    let cues = actor.layers.first().map_or(&[][..], |layer| &layer.cues[..]);
    let stretches = actor.layers.first().map_or(Vec::new(), |layer| timeline_stretches(layer, start, end));
    let played: Vec<usize> = {
        let mut played: Vec<usize> = stretches.iter().map(|s| s.cue).collect();
        played.dedup();
        played
    };
    let mut driven: BTreeMap<(u32, u8), Vec<Option<&Curve>>> = BTreeMap::new();
    for cue in &played {
        for curve in cues[*cue].clip.curves() {
            let curves =
                driven.entry((curve.joint, curve.path.property())).or_insert_with(|| vec![None; cues.len()]);
            curves[*cue] = Some(curve);
        }
    }
    let (mut times, mut tracks, mut still) = (Vec::new(), Vec::new(), Vec::new());
    let mut groups: BTreeMap<Vec<usize>, usize> = BTreeMap::new();
    let mut out = KeyTracks { stretches, tracks: Vec::new() };
    for ((joint, _), curves) in driven {
        let first = curves.iter().flatten().next()?;
        let (path, interpolation) = (first.path, first.interpolation);
        let of_played = || played.iter().map(|cue| curves[*cue]);
        if of_played().flatten().any(|c| c.interpolation != interpolation || c.path != path) {
            return None;
        }
        let rest = rest_value(actor, joint, path)?;
        let cubic = interpolation == Interpolation::CubicSpline;
        if let Some(value) = constant(of_played(), &rest) {
            still.push((joint + 1, path, value));
            continue;
        }
        if cubic && !out.splines_are_whole(&curves) {
            return None;
        }
        let group = curves.iter().map(|c| c.map_or(0, |c| c.times.as_ptr() as usize)).collect();
        let track = KeyTrack { curves, rest, cubic };
        let index = *groups.entry(group).or_insert_with(|| {
            times.push(out.times(&track.curves));
            times.len() - 1
        });
        tracks.push(Track { joint: joint + 1, path, interpolation, times: index });
        out.tracks.push(track);
    }
    Some((times, tracks, still, out))
}

/// The value of a joint that no clip drives. `None`: weights of a mesh that does not exist or has another number of targets.
fn rest_value(actor: &Actor, joint: u32, path: Path) -> Option<Vec<f32>> {
    let rest = actor.asset.skeleton.rest().get(joint as usize)?;
    Some(match path {
        Path::Translation => rest.translation.to_array().to_vec(),
        Path::Rotation => rest.rotation.to_array().to_vec(),
        Path::Scale => rest.scale.to_array().to_vec(),
        Path::Weights(n) => {
            let mut on_joint = actor.asset.instances.iter().filter(|i| i.joint == joint);
            let first = on_joint.next().filter(|i| i.weights.len() == n as usize)?;
            on_joint.next().is_none().then(|| first.weights.clone())?
        }
    })
}

/// The value that all curves have all the time; `None` if one of them changes.
fn constant<'a>(mut curves: impl Iterator<Item = Option<&'a Curve>>, rest: &[f32]) -> Option<Vec<f32>> {
    let width = rest.len();
    let mut known: Option<Vec<f32>> = None;
    curves
        .all(|curve| {
            let Some(curve) = curve else { return *known.get_or_insert_with(|| rest.to_vec()) == rest };
            let cubic = curve.interpolation == Interpolation::CubicSpline;
            let first = &curve.values[if cubic { width } else { 0 }..][..width];
            let value = known.get_or_insert_with(|| first.to_vec());
            let still = |key: &[f32]| match cubic {
                false => key == *value,
                true => {
                    key[width..2 * width] == **value
                        && key[..width].iter().chain(&key[2 * width..]).all(|tangent| *tangent == 0.0)
                }
            };
            curve.values.chunks(curve.stride().max(1)).all(still)
        })
        .then_some(known)
        .flatten()
}

fn timeline_stretches(layer: &Layer, start: Time, end: Time) -> Vec<Stretch> {
    let mut out = Vec::new();
    for (index, cue) in layer.cues.iter().enumerate() {
        let next = layer.cues.get(index + 1).map(|next| next.start);
        let from = if index == 0 { start } else { cue.start.max(start) };
        // The cue's last pose is one tick before the next cue starts.
        let to = next.filter(|next| *next <= end).map_or(end, |next| next - Time(1));
        if from > to || cue.start > end && index > 0 {
            continue;
        }
        let held_from = cue.end.filter(|end| next.is_none_or(|next| next > *end));
        add_stretches(cue, index, [from, to, held_from.unwrap_or(Time::MAX)], &mut out);
    }
    out
}

/// Adds the stretches of a cue between two times; the cue stands still from `held` on.
fn add_stretches(cue: &Cue, index: usize, [mut from, to, held]: [Time; 3], out: &mut Vec<Stretch>) {
    let playback = cue.playback();
    let length = i128::from((cue.trim.1 - cue.trim.0).0.max(0));
    let still = |from: Time, to: Time, at: Time| Stretch { cue: index, from, to, at, rate: 0.0 };
    let clip_time = |time: Time| playback.clip_time_at(cue.played_ticks(time));
    if from < cue.start {
        let until = (cue.start - Time(1)).min(to);
        out.push(still(from, until, clip_time(cue.start)));
        from = cue.start;
    }
    while from <= to {
        let played = cue.played_ticks(from);
        let ended = cue.repeat == Repeat::Once && played >= length;
        if length == 0 || cue.speed == 0.0 || ended {
            out.push(still(from, to, clip_time(from)));
            return;
        }
        if from >= held {
            let (first, last) = if cue.speed < 0.0 { (cue.trim.1, cue.trim.0) } else { cue.trim };
            let at = clip_time(held);
            // The last pose of the round is held, not the first pose of a next round that never comes.
            let at = if at == first && cue.played_ticks(held) > 0 && cue.repeat == Repeat::Loop {
                last
            } else {
                at
            };
            out.push(still(from, to, at));
            return;
        }
        let round = played.div_euclid(length);
        let turned = cue.repeat == Repeat::PingPong && round % 2 != 0;
        let rate = if turned { -cue.speed } else { cue.speed };
        let boundary = cue.time_of_played((round + 1) * length).unwrap_or(Time::MAX);
        // The next stretch begins a tick later: a loop jumps to its start there, and a spline may leave a key with another tangent than it
        // arrived.
        let until = (boundary - Time(1)).min(to).min(held - Time(1)).max(from);
        out.push(Stretch { cue: index, from, to: until, at: clip_time(from), rate });
        from = until + Time(1);
    }
}

/// A key of a stretch: at a clip time, or the key of the curve with an index.
enum Key {
    At(Time),
    Own(usize),
}

impl KeyTracks<'_> {
    /// Calls `each` for every key of a track, with the stage time, the stretch, and the place in the clip.
    fn each_key(&self, curves: &[Option<&Curve>], mut each: impl FnMut(Time, &Stretch, Key)) {
        for (number, stretch) in self.stretches.iter().enumerate() {
            let Stretch { cue, from, to, at, rate } = *stretch;
            each(from, stretch, Key::At(at));
            let end = at + (to - from).scaled(rate);
            let mut last = from;
            if let (Some(curve), true) = (curves[cue], rate != 0.0) {
                let times = &curve.times;
                let (low, high) = (at.min(end), at.max(end));
                let first = times.partition_point(|t| *t <= low);
                let count = times.partition_point(|t| *t < high).saturating_sub(first);
                for i in 0..count {
                    let key = if rate > 0.0 { first + i } else { first + count - 1 - i };
                    let time = from + (times[key] - at).scaled(1.0 / rate);
                    if (time - last).0 > JUMP_TICKS && (to - time).0 > JUMP_TICKS {
                        each(time, stretch, Key::Own(key));
                        last = time;
                    }
                }
            }
            let follows = self.stretches.get(number + 1).is_some_and(|next| next.from <= to);
            if to > from && !follows {
                each(to, stretch, Key::At(end));
            }
        }
    }

    fn times(&self, curves: &[Option<&Curve>]) -> Vec<Time> {
        let mut out = Vec::new();
        self.each_key(curves, |time, _, _| out.push(time));
        out
    }

    /// Appends the numbers of a track.
    pub fn values(&self, track: usize, out: &mut Vec<f32>) {
        let KeyTrack { curves, rest, cubic } = &self.tracks[track];
        let width = rest.len();
        self.each_key(curves, |_, stretch, key| match (curves[stretch.cue], key) {
            (None, _) if *cubic => {
                out.extend(std::iter::repeat_n(0.0, width).chain(rest.iter().copied()));
                out.extend(std::iter::repeat_n(0.0, width));
            }
            (None, _) => out.extend_from_slice(rest),
            (Some(curve), Key::Own(key)) if *cubic => spline_key(curve, key, stretch.rate as f32, out),
            (Some(curve), key) if curve.interpolation == Interpolation::Step && stretch.rate < 0.0 => {
                // Played backwards, a STEP key is where the value before it begins.
                let at = match key {
                    Key::Own(key) => curve.times[key],
                    Key::At(at) => at,
                };
                value_at(curve, at - Time(1), out);
            }
            (Some(curve), Key::Own(key)) => out.extend_from_slice(&curve.values[key * width..][..width]),
            (Some(curve), Key::At(at)) if *cubic => match key_at(curve, at, stretch.rate) {
                Ok(key) => spline_key(curve, key, stretch.rate as f32, out),
                Err(next) => {
                    // The value of the first or last key is held outside of the keys.
                    let key = next.min(curve.times.len() - 1);
                    let value = &curve.values[key * 3 * width + width..][..width];
                    out.extend(std::iter::repeat_n(0.0, width).chain(value.iter().copied()));
                    out.extend(std::iter::repeat_n(0.0, width));
                }
            },
            (Some(curve), Key::At(at)) => value_at(curve, at, out),
        });
    }

    /// Whether no stretch begins or ends within a segment of a spline.
    fn splines_are_whole(&self, curves: &[Option<&Curve>]) -> bool {
        self.stretches.iter().all(|s| {
            let Some(curve) = curves[s.cue] else { return true };
            let ends = [s.at, s.at + (s.to - s.from).scaled(s.rate)];
            ends.into_iter().all(|at| match key_at(curve, at, s.rate) {
                Ok(_) => true,
                Err(next) => next == 0 || next == curve.times.len(),
            })
        })
    }
}

/// Index of the key at a clip time, to a few ticks of the stage; else, as the error, the index of the next key.
fn key_at(curve: &Curve, at: Time, rate: f64) -> Result<usize, usize> {
    let next = curve.times.partition_point(|t| *t < at);
    let near = [next.checked_sub(1), Some(next)].into_iter().flatten();
    let mut near = near.filter(|k| {
        curve.times.get(*k).is_some_and(|t| ((*t - at).0.abs() as f64) <= 2.0 + 2.0 * rate.abs())
    });
    near.next().ok_or(next)
}

/// Appends a key of a spline that is played at a rate: tangents are scaled to stage seconds, and swapped if the clip plays backwards.
fn spline_key(curve: &Curve, key: usize, rate: f32, out: &mut Vec<f32>) {
    let width = curve.path.width();
    let parts: Vec<&[f32]> = curve.values[key * 3 * width..][..3 * width].chunks(width).collect();
    // The value of the first or last key is held outside of the keys.
    let before = if key == 0 { 0.0 } else { rate };
    let after = if key + 1 == curve.times.len() { 0.0 } else { rate };
    let (mut into, mut away) = ((parts[0], before), (parts[2], after));
    if rate < 0.0 {
        std::mem::swap(&mut into, &mut away);
    }
    out.extend(into.0.iter().map(|v| v * into.1));
    out.extend_from_slice(parts[1]);
    out.extend(away.0.iter().map(|v| v * away.1));
}

/// Appends a STEP or LINEAR curve's value at a time.
fn value_at(curve: &Curve, time: Time, out: &mut Vec<f32>) {
    let width = curve.path.width();
    let value = |key: usize| &curve.values[key * width..][..width];
    let next = curve.times.partition_point(|t| *t <= time);
    if next == 0 || next == curve.times.len() || curve.interpolation == Interpolation::Step {
        out.extend_from_slice(value(next.saturating_sub(1)));
        return;
    }
    let (a, b) = (value(next - 1), value(next));
    let t = time.fraction(curve.times[next - 1], curve.times[next]);
    match curve.path {
        Path::Rotation => {
            let rotation = |v: &[f32]| Quat::from_xyzw(v[0], v[1], v[2], v[3]);
            out.extend(rotation(a).slerp(rotation(b), t).normalize().to_array());
        }
        _ => out.extend(a.iter().zip(b).map(|(a, b)| a + (b - a) * t)),
    }
}

/// Adds the stage times of the keys of an actor's clips, where the slope of LINEAR curves jumps. Cues with time
/// remapping, freezes or phase matching are left out.
pub(crate) fn add_key_times(actor: &Actor, start: Time, end: Time, out: &mut Vec<Time>) {
    for (number, layer) in actor.layers.iter().enumerate() {
        for (index, cue) in layer.cues.iter().enumerate() {
            if !cue.plays_at_constant_speed() || cue.phase_matched_fades.iter().any(Option::is_some) {
                continue;
            }
            // The cue is active until the next one has faded in.
            let next =
                layer.cues.get(index + 1).map(|next| next.start + next.fade_in.max(next.inertialization));
            let own = cue.end.filter(|_| number > 0);
            let to = next.or(own).map_or(end, |time| time.min(end));
            let mut stretches = Vec::new();
            let held = cue.end.filter(|_| number == 0 && next.is_none()).unwrap_or(Time::MAX);
            add_stretches(cue, index, [cue.start.max(start), to, held], &mut stretches);
            let mut known: Vec<*const Time> = Vec::new();
            for curve in cue.clip.curves() {
                if known.contains(&curve.times.as_ptr()) {
                    continue;
                }
                known.push(curve.times.as_ptr());
                for Stretch { from, to, at, rate, .. } in stretches.iter().filter(|s| s.rate != 0.0) {
                    let on_stage = |key: &Time| *from + (*key - *at).scaled(1.0 / rate);
                    out.extend(curve.times.iter().map(on_stage).filter(|time| from < time && time < to));
                }
            }
        }
    }
}

/// Identifies the motion of an actor that plays its clips unchanged: two actors of one asset that move alike have the same identity.
pub(super) fn identity(actor: &Actor) -> Vec<u64> {
    let mut out = vec![std::sync::Arc::as_ptr(&actor.asset) as u64];
    for cue in actor.layers.first().iter().flat_map(|layer| &layer.cues) {
        let clip: *const Clip = std::sync::Arc::as_ptr(&cue.clip);
        let end = cue.end.map_or(i64::MAX, |end| end.0);
        let times = [cue.start.0, end, cue.trim.0.0, cue.trim.1.0].map(|ticks| ticks as u64);
        out.extend([clip as u64, cue.speed.to_bits(), cue.repeat as u64].into_iter().chain(times));
    }
    out
}
