//! Root motion over a timeline: where an actor's clips have carried it, at any time.
//!
//! Alone a clip carries its actor by a closed form: k whole loops are the k-th power of one loop's motion
//! ([`choreo_motion::Planar::power`]), so that a hundred hours in costs what the first second does and drifts no more. While
//! weights change, in fades, the actor moves with the weighted mean of the clips' velocities in its own frame (as
//! Unreal's and Unity's root motion does; a mean of places would add the speed at which the clips part). That has no closed
//! form with turns in it, so it is integrated once, in fixed steps of exact displacements, into a table that any time is
//! looked up in.

use crate::stage::Stage;
use crate::stage::actor::{Actor, Placement};
use crate::stage::clips::{Cue, Layer};
use crate::stage::root_motion::CueRootMotion;
use crate::timeline::active_clips as timeline;
use crate::timeline::active_clips::ActiveCue;
use crate::timeline::clip_time::plays_until;
use choreo_motion::{Planar, Repeat, Time};
use glam::{DQuat, DVec3};
use std::sync::Arc;

/// Steps a second of a fade; an error of the mean velocity of 1e-5 m in a fade from a walk to a run with a turn.
const RATE: f64 = 240.0;
const MOST_STEPS: f64 = 65_536.0;

/// How far an actor has come: where its frame is, and how far it went forwards.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Displacement {
    pub frame: Planar,
    /// Metres along the way of the clips, whatever turns there were.
    pub forward: f64,
}

impl Displacement {
    fn then(self, next: Displacement) -> Displacement {
        Displacement { frame: self.frame.then_in(next.frame), forward: self.forward + next.forward }
    }

    /// The step from here to there.
    fn to(self, there: Displacement) -> Displacement {
        Displacement {
            frame: self.frame.inverse().then_in(there.frame),
            forward: there.forward - self.forward,
        }
    }
}

/// Root motion of all actors of a stage; `None` for those without.
#[derive(Clone, Debug, Default)]
pub(crate) struct RootMotionTracks(Vec<Option<Arc<RootMotionTrack>>>);

impl RootMotionTracks {
    pub fn new(stage: &Stage) -> RootMotionTracks {
        RootMotionTracks(stage.actors.iter().map(|a| RootMotionTrack::of(a).map(Arc::new)).collect())
    }

    /// That of one actor.
    pub fn only(&self, actor: usize) -> RootMotionTracks {
        RootMotionTracks(vec![self.0.get(actor).cloned().flatten()])
    }

    pub fn of(&self, actor: usize) -> Option<&RootMotionTrack> {
        self.0.get(actor).and_then(Option::as_deref)
    }
}

#[derive(Clone, Debug)]
pub(crate) struct RootMotionTrack {
    /// Position of the root on the floor in model space: that of the first clip, and of all others too.
    anchor: DVec3,
    segments: Vec<Segment>,
}

#[derive(Clone, Debug)]
struct Segment {
    start: Time,
    at: Displacement,
    kind: SegmentKind,
}

#[derive(Clone, Debug)]
enum SegmentKind {
    Alone(usize),
    /// Several clips with constant weights.
    Mixed,
    /// Steps from the segment's start, evenly spaced up to `end`.
    Fading {
        end: Time,
        steps: Vec<Displacement>,
    },
}

impl RootMotionTrack {
    fn of(actor: &Actor) -> Option<RootMotionTrack> {
        let layer = actor.layers.first()?;
        let first = layer.cues.iter().find_map(|cue| cue.root.as_deref().map(|root| (cue, root)))?;
        let anchor = anchor(first.0, first.1);
        let mut marks: Vec<Time> = Vec::new();
        for cue in &layer.cues {
            marks.extend([cue.start, cue.start + cue.fade_in]);
            let keys = cue.weight_keys.as_ref().map_or(&[][..], |keys| &keys.times);
            marks.extend(keys.first().into_iter().chain(keys.last()).filter(|t| **t > cue.start));
        }
        marks.sort_unstable();
        marks.dedup();
        let start = Planar { translation: anchor, yaw: 0.0 };
        let mut track = RootMotionTrack { anchor, segments: Vec::new() };
        let mut at = Displacement { frame: start, forward: 0.0 };
        let mut active_cues = Vec::new();
        for (i, mark) in marks.iter().enumerate() {
            let end = marks.get(i + 1).copied();
            let kind = kind(layer, *mark, end, &mut active_cues);
            track.segments.push(Segment { start: *mark, at, kind });
            if let (Some(end), Some(last)) = (end, track.segments.last()) {
                at = last.at(layer, end, &mut active_cues);
            }
        }
        Some(track)
    }

    /// How far the actor has come at a time.
    fn step(&self, layer: &Layer, time: Time, active_cues: &mut Vec<ActiveCue>) -> Displacement {
        let begun = self.segments.partition_point(|segment| segment.start <= time);
        match begun.checked_sub(1).map(|i| &self.segments[i]) {
            Some(segment) => segment.at(layer, time, active_cues),
            None => Displacement { frame: Planar { translation: self.anchor, yaw: 0.0 }, forward: 0.0 },
        }
    }

    /// Motion that moves an actor's placement: model space now from model space without root motion.
    pub fn carried(&self, actor: &Actor, time: Time, active_cues: &mut Vec<ActiveCue>) -> Displacement {
        let Some(layer) = actor.layers.first() else { return Displacement::default() };
        let Displacement { frame, forward } = self.step(layer, time, active_cues);
        let back = Planar { translation: -self.anchor, yaw: 0.0 };
        Displacement { frame: frame.then_in(back), forward }
    }

    pub fn anchor(&self) -> DVec3 {
        self.anchor
    }

    /// Transform, applied to a pose's model space, that removes the clip's root motion and puts the root back on its anchor.
    pub(crate) fn back_to_anchor(&self, root: &CueRootMotion, cue: &Cue, clip_time: Time) -> Option<Planar> {
        // A clip on the spot has no motion to remove.
        if root.motion.treadmill.is_some() {
            return None;
        }
        let first = root.motion.frame(first_time(cue));
        let now = root.motion.frame(clip_time);
        let now = Planar { yaw: now.yaw - first.yaw, ..now };
        Some(Planar { translation: self.anchor, yaw: 0.0 }.then_in(now.inverse()))
    }
}

fn first_time(cue: &Cue) -> Time {
    if cue.speed < 0.0 { cue.trim.1 } else { cue.trim.0 }
}

fn anchor(cue: &Cue, root: &CueRootMotion) -> DVec3 {
    match root.motion.treadmill {
        Some(_) => DVec3::ZERO,
        None => root.motion.frame(first_time(cue)).translation.with_y(0.0),
    }
}

fn kind(layer: &Layer, start: Time, end: Option<Time>, active_cues: &mut Vec<ActiveCue>) -> SegmentKind {
    let within = |share: i64, active_cues: &mut Vec<ActiveCue>| {
        let span = end.map_or(Time::from_secs(4.0), |end| end - start);
        timeline::base_cues(layer, start + Time(span.0 / 8 * share), active_cues);
        active_cues.iter().map(|v| (v.cue, v.weight)).collect::<Vec<_>>()
    };
    let looks: Vec<Vec<(usize, f32)>> = [1, 3, 4, 6, 7].map(|share| within(share, active_cues)).into();
    let same = looks.windows(2).all(|pair| pair[0] == pair[1]);
    match (&looks[0][..], end) {
        ([(cue, _)], _) if same => SegmentKind::Alone(*cue),
        (_, Some(end)) if !same => fading(layer, start, end, active_cues),
        _ => SegmentKind::Mixed,
    }
}

fn fading(layer: &Layer, start: Time, end: Time, active_cues: &mut Vec<ActiveCue>) -> SegmentKind {
    let count = libm::ceil((end - start).as_secs() * RATE).clamp(1.0, MOST_STEPS) as i64;
    let mut steps = vec![Displacement::default()];
    let mut at = Displacement::default();
    for i in 0..count {
        at = at.then(mean_step(
            layer,
            knot(start, end, count, i),
            knot(start, end, count, i + 1),
            active_cues,
        ));
        steps.push(at);
    }
    SegmentKind::Fading { end, steps }
}

fn knot(start: Time, end: Time, count: i64, i: i64) -> Time {
    start + Time((i128::from((end - start).0) * i128::from(i) / i128::from(count)) as i64)
}

/// The mean of what the clips that count do between two times, by their weights in the middle: of the logarithms of their
/// exact motions, which are velocities.
fn mean_step(layer: &Layer, from: Time, to: Time, active_cues: &mut Vec<ActiveCue>) -> Displacement {
    timeline::base_cues(layer, from.middle(to), active_cues);
    timeline::shares(active_cues);
    let (mut velocity, mut turn, mut forward) = (DVec3::ZERO, 0.0, 0.0);
    for active in active_cues.iter() {
        let share = f64::from(active.weight);
        let step = displacement(layer, active.cue, from).to(displacement(layer, active.cue, to));
        let (v, yaw) = step.frame.velocity();
        velocity += v * share;
        turn += yaw * share;
        forward += step.forward * share;
    }
    Displacement { frame: Planar::from_velocity((velocity, turn)), forward }
}

impl Segment {
    fn at(&self, layer: &Layer, time: Time, active_cues: &mut Vec<ActiveCue>) -> Displacement {
        let time = time.max(self.start);
        let since = match &self.kind {
            SegmentKind::Alone(cue) => {
                displacement(layer, *cue, self.start).to(displacement(layer, *cue, time))
            }
            SegmentKind::Mixed => mean_step(layer, self.start, time, active_cues),
            SegmentKind::Fading { end, steps } => {
                let count = steps.len() as i64 - 1;
                let into = i128::from((time.min(*end) - self.start).0) * i128::from(count);
                let i = (into / i128::from((*end - self.start).0.max(1))).clamp(0, i128::from(count)) as i64;
                let from = knot(self.start, *end, count, i);
                let step = steps[i as usize];
                if from < time { step.then(mean_step(layer, from, time, active_cues)) } else { step }
            }
        };
        self.at.then(since)
    }
}

/// How far a cue of a base layer has carried its actor since its start.
fn displacement(layer: &Layer, index: usize, time: Time) -> Displacement {
    let cue = &layer.cues[index];
    let Some(root) = cue.root.as_deref().filter(|root| root.carries) else { return Displacement::default() };
    let (until, _) = plays_until(layer, index, time);
    let played = cue.played(until);
    let length = i128::from((cue.trim.1 - cue.trim.0).0.max(0));
    if length == 0 {
        return Displacement::default();
    }
    let frame = |at: Time| root.motion.frame(at);
    let (start, end) = if cue.speed < 0.0 { (cue.trim.1, cue.trim.0) } else { cue.trim };
    let first = frame(start);
    let way = direction(first.inverse().then_in(frame(end)).translation);
    let step = |there: Planar| {
        let frame = first.inverse().then_in(there);
        Displacement { frame, forward: frame.translation.with_y(0.0).dot(way) }
    };
    let within = |offset: i128| {
        let offset = Time(offset as i64);
        step(frame(if cue.speed < 0.0 { start - offset } else { start + offset }))
    };
    match cue.repeat {
        Repeat::Once => within(played.clamp(0, length)),
        Repeat::PingPong => {
            let phase = played.rem_euclid(2 * length);
            within(if phase > length { 2 * length - phase } else { phase })
        }
        Repeat::Loop => {
            let whole = played.div_euclid(length).clamp(-(1 << 50), 1 << 50) as i64;
            let round = within(length);
            let rounds =
                Displacement { frame: round.frame.power(whole), forward: round.forward * whole as f64 };
            rounds.then(within(played.rem_euclid(length)))
        }
    }
}

/// The horizontal direction of a way; forwards, +Z, where it leads nowhere.
fn direction(way: DVec3) -> DVec3 {
    way.with_y(0.0).try_normalize().unwrap_or(DVec3::Z)
}

impl Placement {
    /// This placement moved by root motion, in its own space.
    pub fn carried(self, by: Planar) -> Placement {
        let Placement { translation, rotation, scale } = self;
        // In a mirrored space a turn to the left is one to the right.
        let mirrored = if scale.x * scale.z < 0.0 { -1.0 } else { 1.0 };
        let turned = DQuat::from_rotation_y(by.yaw * mirrored);
        Placement {
            translation: translation + rotation * (scale * by.translation),
            rotation: (rotation * turned).normalize(),
            scale,
        }
    }
}
