//! Root motion over a timeline: the displacement by which an actor's clips have moved it, at any time.
//!
//! A single clip carries its actor in closed form: k whole loops are the k-th power of one loop's motion
//! ([`choreo_motion::Planar::power`]), so that a time of 100 h costs as much as the first second and drifts no more. During fades the actor
//! moves with the weighted mean of the clips' velocities in its own frame, as in Unreal and Unity. (A mean of positions would add the speed
//! at which the clips diverge.) After an inertialized switch the velocity difference to the new clip decays like the offsets of its pose
//! ([`TransitionVelocity`]). With turns neither has a closed form, so both are integrated once, in fixed steps of exact displacements, into
//! a lookup table.

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

/// Integration steps per second of a fade. The error is 1e-5 m in a fade from a walk to a run with a turn.
const STEPS_PER_SECOND: f64 = 240.0;
const MAX_STEPS: f64 = 65_536.0;
/// Time interval over which a velocity is measured.
const VELOCITY_INTERVAL: Time = Time(Time::TICKS_PER_SECOND / 240);

/// Accumulated root motion of an actor: its frame, and the distance that it went forwards.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Displacement {
    pub frame: Planar,
    /// Metres along the clips' forward direction, regardless of turns.
    pub forward: f64,
}

impl Displacement {
    fn followed_by(self, next: Displacement) -> Displacement {
        Displacement { frame: self.frame.compose(next.frame), forward: self.forward + next.forward }
    }

    /// Displacement from this one to another.
    fn displacement_to(self, there: Displacement) -> Displacement {
        Displacement {
            frame: self.frame.inverse().compose(there.frame),
            forward: there.forward - self.forward,
        }
    }
}

/// Root motion of all actors of a stage; `None` for those without.
#[derive(Clone, Debug, Default)]
pub(crate) struct RootMotionTracks(Vec<Option<Arc<RootMotionTrack>>>);

impl RootMotionTracks {
    pub(crate) fn new(stage: &Stage) -> RootMotionTracks {
        RootMotionTracks(stage.actors.iter().map(|a| RootMotionTrack::of(a).map(Arc::new)).collect())
    }

    /// The track of one actor alone.
    pub(crate) fn for_actor(&self, actor: usize) -> RootMotionTracks {
        RootMotionTracks(vec![self.0.get(actor).cloned().flatten()])
    }

    pub(crate) fn of(&self, actor: usize) -> Option<&RootMotionTrack> {
        self.0.get(actor).and_then(Option::as_deref)
    }
}

#[derive(Clone, Debug)]
pub(crate) struct RootMotionTrack {
    /// Position of the root on the floor in model space: taken from the first clip, and used for all clips.
    anchor: DVec3,
    segments: Vec<MotionSegment>,
    /// Velocities that cues take over from the motion before them, by cue.
    transitions: Vec<Option<TransitionVelocity>>,
}

/// Velocity that an inertialized switch takes over from the motion before it, as the difference from the new clip's velocity. It decays to
/// zero by the minimum-jerk quintic (T. Flash, N. Hogan, "The Coordination of Arm Movements", 1985), as in
/// [`choreo_motion::Inertialization`] for an offset at rest.
#[derive(Clone, Copy, Debug)]
struct TransitionVelocity {
    start: Time,
    duration: Time,
    /// Horizontal velocity and turn in the actor's frame, metres and radians per second.
    velocity: (DVec3, f64),
    /// Speed along the clips' forward direction, metres per second.
    forward: f64,
}

impl TransitionVelocity {
    fn end(&self) -> Time {
        self.start + self.duration
    }

    /// Integral of the remaining share of the velocity between two times, seconds.
    fn remaining_share_secs(&self, from: Time, to: Time) -> f64 {
        let whole = self.duration.as_secs();
        let until = |time: Time| {
            let s = ((time - self.start).as_secs() / whole).clamp(0.0, 1.0);
            let s4 = s * s * s * s;
            s - s4 * (2.5 - s * (3.0 - s))
        };
        whole * (until(to) - until(from))
    }
}

/// A base layer in which root motion moves the actor.
#[derive(Clone, Copy)]
struct RootMotionLayer<'a> {
    layer: &'a Layer,
    transitions: &'a [Option<TransitionVelocity>],
}

#[derive(Clone, Debug)]
struct MotionSegment {
    start: Time,
    at: Displacement,
    kind: SegmentKind,
}

#[derive(Clone, Debug)]
enum SegmentKind {
    SingleCue(usize),
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
        let anchor = anchor_of_cue(first.0, first.1);
        let mut boundaries: Vec<Time> = Vec::new();
        for cue in &layer.cues {
            boundaries.extend([cue.start, cue.start + cue.fade_in, cue.start + cue.inertialization]);
            let keys = cue.weight_keys.as_ref().map_or(&[][..], |keys| &keys.times);
            boundaries.extend(keys.first().into_iter().chain(keys.last()).filter(|t| **t > cue.start));
        }
        boundaries.sort_unstable();
        boundaries.dedup();
        let start = Planar { translation: anchor, yaw: 0.0 };
        let transitions = vec![None; layer.cues.len()];
        let mut track = RootMotionTrack { anchor, segments: Vec::new(), transitions };
        let mut at = Displacement { frame: start, forward: 0.0 };
        let mut active_cues = Vec::new();
        for (i, boundary) in boundaries.iter().enumerate() {
            let end = boundaries.get(i + 1).copied();
            track.add_transitions(layer, *boundary, &mut active_cues);
            let layer_motion = RootMotionLayer { layer, transitions: &track.transitions };
            let segment = MotionSegment {
                start: *boundary,
                at,
                kind: segment_kind(layer_motion, *boundary, end, &mut active_cues),
            };
            if let Some(end) = end {
                at = segment.at(layer_motion, end, &mut active_cues);
            }
            track.segments.push(segment);
        }
        Some(track)
    }

    /// Computes the velocities that the inertialized cues which start at a time take over.
    fn add_transitions(&mut self, layer: &Layer, start: Time, active_cues: &mut Vec<ActiveCue>) {
        for (index, cue) in layer.cues.iter().enumerate().skip(1) {
            if cue.start != start || cue.inertialization <= Time::ZERO {
                continue;
            }
            let layer_motion = RootMotionLayer { layer, transitions: &self.transitions };
            let before = mean_step(layer_motion, start - VELOCITY_INTERVAL, start, active_cues);
            let after = cue_displacement(layer, index, start).displacement_to(cue_displacement(
                layer,
                index,
                start + VELOCITY_INTERVAL,
            ));
            let [(velocity, turn), (own_velocity, own_turn)] =
                [before, after].map(|step| step.frame.velocity());
            let per_second = 1.0 / VELOCITY_INTERVAL.as_secs();
            self.transitions[index] = Some(TransitionVelocity {
                start,
                duration: cue.inertialization,
                velocity: ((velocity - own_velocity) * per_second, (turn - own_turn) * per_second),
                forward: (before.forward - after.forward) * per_second,
            });
        }
    }

    /// Accumulated displacement of the actor at a time.
    fn accumulated_displacement(
        &self,
        layer: &Layer,
        time: Time,
        active_cues: &mut Vec<ActiveCue>,
    ) -> Displacement {
        let started_segments = self.segments.partition_point(|segment| segment.start <= time);
        match started_segments.checked_sub(1).map(|i| &self.segments[i]) {
            Some(segment) => {
                segment.at(RootMotionLayer { layer, transitions: &self.transitions }, time, active_cues)
            }
            None => Displacement { frame: Planar { translation: self.anchor, yaw: 0.0 }, forward: 0.0 },
        }
    }

    /// Root motion of an actor at a time: current model space from model space without root motion.
    pub(crate) fn displacement_at(
        &self,
        actor: &Actor,
        time: Time,
        active_cues: &mut Vec<ActiveCue>,
    ) -> Displacement {
        let Some(layer) = actor.layers.first() else { return Displacement::default() };
        let Displacement { frame, forward } = self.accumulated_displacement(layer, time, active_cues);
        let back = Planar { translation: -self.anchor, yaw: 0.0 };
        Displacement { frame: frame.compose(back), forward }
    }

    pub(crate) fn anchor(&self) -> DVec3 {
        self.anchor
    }

    /// Transform, applied to a pose's model space, that removes the clip's root motion and puts the root back on its anchor.
    pub(crate) fn back_to_anchor(&self, root: &CueRootMotion, cue: &Cue, clip_time: Time) -> Option<Planar> {
        // A clip on the spot has no motion to remove.
        if root.motion.treadmill.is_some() {
            return None;
        }
        let first = root.motion.frame(first_clip_time(cue));
        let now = root.motion.frame(clip_time);
        let now = Planar { yaw: now.yaw - first.yaw, ..now };
        Some(Planar { translation: self.anchor, yaw: 0.0 }.compose(now.inverse()))
    }
}

fn first_clip_time(cue: &Cue) -> Time {
    if cue.speed < 0.0 { cue.trim.1 } else { cue.trim.0 }
}

fn anchor_of_cue(cue: &Cue, root: &CueRootMotion) -> DVec3 {
    match root.motion.treadmill {
        Some(_) => DVec3::ZERO,
        None => root.motion.frame(first_clip_time(cue)).translation.with_y(0.0),
    }
}

fn segment_kind(
    layer_motion: RootMotionLayer,
    start: Time,
    end: Option<Time>,
    active_cues: &mut Vec<ActiveCue>,
) -> SegmentKind {
    let RootMotionLayer { layer, transitions } = layer_motion;
    let within = |share: i64, active_cues: &mut Vec<ActiveCue>| {
        let span = end.map_or(Time::from_secs(4.0), |end| end - start);
        timeline::base_cues(layer, start + Time(span.0 / 8 * share), active_cues);
        active_cues.iter().map(|v| (v.cue, v.weight)).collect::<Vec<_>>()
    };
    let sampled_weights: Vec<Vec<(usize, f32)>> =
        [1, 3, 4, 6, 7].map(|share| within(share, active_cues)).into();
    let is_in_transition = |(cue, _): &(usize, f32)| transitions[*cue].is_some_and(|of| start < of.end());
    let is_constant = sampled_weights.windows(2).all(|pair| pair[0] == pair[1])
        && !sampled_weights[0].iter().any(is_in_transition);
    match (&sampled_weights[0][..], end) {
        ([(cue, _)], _) if is_constant => SegmentKind::SingleCue(*cue),
        (_, Some(end)) if !is_constant => fading_segment(layer_motion, start, end, active_cues),
        _ => SegmentKind::Mixed,
    }
}

fn fading_segment(
    layer_motion: RootMotionLayer,
    start: Time,
    end: Time,
    active_cues: &mut Vec<ActiveCue>,
) -> SegmentKind {
    let count = libm::ceil((end - start).as_secs() * STEPS_PER_SECOND).clamp(1.0, MAX_STEPS) as i64;
    let mut steps = vec![Displacement::default()];
    let mut at = Displacement::default();
    for i in 0..count {
        at = at.followed_by(mean_step(
            layer_motion,
            step_time(start, end, count, i),
            step_time(start, end, count, i + 1),
            active_cues,
        ));
        steps.push(at);
    }
    SegmentKind::Fading { end, steps }
}

fn step_time(start: Time, end: Time, count: i64, i: i64) -> Time {
    start + Time((i128::from((end - start).0) * i128::from(i) / i128::from(count)) as i64)
}

/// Displacement between two times: the mean of the active clips' exact displacements, weighted as in the middle of the step. The mean is
/// taken over logarithms, which are velocities. The velocities that inertialized switches still add are included.
fn mean_step(
    RootMotionLayer { layer, transitions }: RootMotionLayer,
    from: Time,
    to: Time,
    active_cues: &mut Vec<ActiveCue>,
) -> Displacement {
    timeline::base_cues(layer, from.middle(to), active_cues);
    timeline::convert_weights_to_shares(active_cues);
    let (mut velocity, mut turn, mut forward) = (DVec3::ZERO, 0.0, 0.0);
    for active in active_cues.iter() {
        let share = f64::from(active.weight);
        let step = cue_displacement(layer, active.cue, from)
            .displacement_to(cue_displacement(layer, active.cue, to));
        let (v, yaw) = step.frame.velocity();
        velocity += v * share;
        turn += yaw * share;
        forward += step.forward * share;
        if let Some(transition) = &transitions[active.cue] {
            let secs = transition.remaining_share_secs(from, to) * share;
            velocity += transition.velocity.0 * secs;
            turn += transition.velocity.1 * secs;
            forward += transition.forward * secs;
        }
    }
    Displacement { frame: Planar::from_velocity((velocity, turn)), forward }
}

impl MotionSegment {
    fn at(
        &self,
        layer_motion: RootMotionLayer,
        time: Time,
        active_cues: &mut Vec<ActiveCue>,
    ) -> Displacement {
        let layer = layer_motion.layer;
        let time = time.max(self.start);
        let since = match &self.kind {
            SegmentKind::SingleCue(cue) => {
                cue_displacement(layer, *cue, self.start).displacement_to(cue_displacement(layer, *cue, time))
            }
            SegmentKind::Mixed => mean_step(layer_motion, self.start, time, active_cues),
            SegmentKind::Fading { end, steps } => {
                let count = steps.len() as i64 - 1;
                let into = i128::from((time.min(*end) - self.start).0) * i128::from(count);
                let i = (into / i128::from((*end - self.start).0.max(1))).clamp(0, i128::from(count)) as i64;
                let from = step_time(self.start, *end, count, i);
                let step = steps[i as usize];
                if from < time {
                    step.followed_by(mean_step(layer_motion, from, time, active_cues))
                } else {
                    step
                }
            }
        };
        self.at.followed_by(since)
    }
}

/// Displacement by which a cue of a base layer has moved its actor since its start.
fn cue_displacement(layer: &Layer, index: usize, time: Time) -> Displacement {
    let cue = &layer.cues[index];
    let Some(root) = cue.root.as_deref().filter(|root| root.carries) else { return Displacement::default() };
    let (until, _) = plays_until(layer, index, time);
    let played = cue.played_ticks(until);
    let length = i128::from((cue.trim.1 - cue.trim.0).0.max(0));
    if length == 0 {
        return Displacement::default();
    }
    let frame = |at: Time| root.motion.frame(at);
    let (start, end) = if cue.speed < 0.0 { (cue.trim.1, cue.trim.0) } else { cue.trim };
    let first = frame(start);
    let way = horizontal_direction(first.inverse().compose(frame(end)).translation);
    let step = |there: Planar| {
        let frame = first.inverse().compose(there);
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
            rounds.followed_by(within(played.rem_euclid(length)))
        }
    }
}

/// Horizontal unit direction of a vector; +Z, forwards, if it has no horizontal part.
fn horizontal_direction(way: DVec3) -> DVec3 {
    way.with_y(0.0).try_normalize().unwrap_or(DVec3::Z)
}

impl Placement {
    /// The placement moved by root motion in its own space.
    pub fn moved_by_root_motion(self, by: Planar) -> Placement {
        let Placement { translation, rotation, scale } = self;
        // A left turn becomes a right turn in a mirrored space.
        let mirrored = if scale.x * scale.z < 0.0 { -1.0 } else { 1.0 };
        let turned = DQuat::from_rotation_y(by.yaw * mirrored);
        Placement {
            translation: translation + rotation * (scale * by.translation),
            rotation: (rotation * turned).normalize(),
            scale,
        }
    }
}
