//! Standing spans of a character before or after walking: each foot keeps one position for as long as the standing clip plays.
//!
//! A standing clip made for another character shifts the feet by centimetres as the weight shifts, above all if the legs have other
//! proportions. The position of a foot is the mean over one loop of the clip, so that all fades get the same position.

use crate::constraints::foot_lock::{Contact, FADE_SECS};
use crate::constraints::foot_samples::{FeetInMotion, FootSamples};
use crate::constraints::footsteps::Footstep;
use crate::stage::actor::Actor;
use crate::stage::constraint::FootLock;
use crate::stage::{Stage, StageError};
use choreo_motion::{Repeat, Time};
use glam::DVec3;
use std::sync::OnceLock;

/// Number of samples in the first loop of the clip, and in the rest of the standing span.
const LOOP_SAMPLES: u32 = 24;
const LATER_SAMPLES: u32 = 8;
/// Seconds between samples of a clip on an upper layer, and the largest number of these samples.
const LAYER_SAMPLE_SECS: f64 = 0.1;
const MAX_LAYER_SAMPLES: f64 = 64.0;
/// Longest part of a loop that is sampled.
const MAX_LOOP: Time = Time(20 * Time::TICKS_PER_SECOND);
/// Largest horizontal and vertical distance of a foot from its mean position, in leg lengths. A foot that is farther away travels, and
/// the feet are not held in this span.
const MAX_DRIFT_LEGS: f64 = 0.15;
const MAX_HEIGHT_DRIFT_LEGS: f64 = 0.05;

/// Time span in which a standing clip plays alone.
#[derive(Debug)]
pub(super) struct StandingSpan {
    pub from: Time,
    pub to: Time,
    /// Stage time of one loop of the clip.
    loop_duration: Time,
    places: OnceLock<Option<Vec<DVec3>>>,
}

/// The standing spans between the standing fades of a constraint, sorted. Empty if the constraint locks feet everywhere, or on the ground
/// of other actors.
pub(super) fn find_stands(actor: &Actor, foot_lock: &FootLock) -> Vec<StandingSpan> {
    let cues = actor.layers.first().map_or(&[][..], |layer| &layer.cues);
    let fades = &foot_lock.standing_fades;
    let mut all = Vec::new();
    // The height of a foot on uneven ground is not that of the clip.
    if foot_lock.locked_spans.is_empty() || !foot_lock.ground.is_empty() {
        return all;
    }
    for (i, fade) in fades.iter().enumerate() {
        let begun = match fade.ends_standing {
            true => cues.partition_point(|cue| cue.start <= fade.from),
            false if i > 0 && fades[i - 1].ends_standing => continue,
            false => cues.partition_point(|cue| cue.start < fade.from),
        };
        let Some(cue) = begun.checked_sub(1).map(|c| &cues[c]) else { continue };
        let (from, to) = match fade.ends_standing {
            true => {
                let next_fade = fades.get(i + 1).map_or(Time::MAX, |next| next.from);
                (fade.to, cues.get(begun).map_or(Time::MAX, |next| next.start).min(next_fade))
            }
            false => (cue.start + cue.fade_in.max(cue.inertialization), fade.from),
        };
        let loop_duration = (cue.trim.1 - cue.trim.0).scaled(1.0 / cue.speed.abs().max(1e-3)).min(MAX_LOOP);
        if from.max(Time::ZERO) < to {
            all.push(StandingSpan { from: from.max(Time::ZERO), to, loop_duration, places: OnceLock::new() });
        }
    }
    all
}

impl StandingSpan {
    /// World position of each foot; `None` if the clip or the actor moves a foot away. `leg_length`: metres.
    pub(super) fn foot_positions(
        &self,
        feet: &mut FeetInMotion,
        leg_length: f64,
    ) -> Result<Option<&[DVec3]>, StageError> {
        if self.places.get().is_none() {
            let found = self.find_foot_positions(feet, leg_length)?;
            self.places.get_or_init(|| found);
        }
        Ok(self.places.get().and_then(Option::as_deref))
    }

    fn find_foot_positions(
        &self,
        feet: &mut FeetInMotion,
        leg_length: f64,
    ) -> Result<Option<Vec<DVec3>>, StageError> {
        let round = self.to.min(self.from + self.loop_duration) - self.from;
        let end = self.to.min((self.from + round).max(feet.stage.settings.length));
        let within =
            (0..LOOP_SAMPLES).map(|i| self.from + round.scaled(f64::from(i) / f64::from(LOOP_SAMPLES)));
        let later = (1..=LATER_SAMPLES).map(|i| {
            self.from + round + (end - self.from - round).scaled(f64::from(i) / f64::from(LATER_SAMPLES))
        });
        let also = self.extra_sample_times(feet.stage, feet.actor);
        let mut places_by_time = Vec::new();
        for time in within.chain(later).chain(also) {
            let samples = feet.sample_feet(time, time)?;
            places_by_time.push(samples.feet.iter().map(|places| places[0]).collect::<Vec<_>>());
        }
        let count = feet.foot_lock.legs.len();
        let mean = |foot: usize| {
            places_by_time[..LOOP_SAMPLES as usize].iter().map(|places| places[foot]).sum::<DVec3>()
                / f64::from(LOOP_SAMPLES)
        };
        let means: Vec<DVec3> = (0..count).map(mean).collect();
        let near = |places: &Vec<DVec3>| {
            places.iter().zip(&means).all(|(place, mean)| {
                let off = *place - *mean;
                off.with_y(0.0).length() <= MAX_DRIFT_LEGS * leg_length
                    && off.y.abs() <= MAX_HEIGHT_DRIFT_LEGS * leg_length
            })
        };
        Ok(places_by_time.iter().all(near).then_some(means))
    }

    /// Times at which upper layers may lift a foot, or keyframes may move the actor.
    fn extra_sample_times(&self, stage: &Stage, actor: usize) -> Vec<Time> {
        let actor = &stage.actors[actor];
        let mut all = Vec::new();
        for cue in actor.layers.iter().skip(1).flat_map(|layer| &layer.cues) {
            let long = (cue.trim.1 - cue.trim.0).scaled(1.0 / cue.speed.abs().max(1e-3));
            let from = self.from.max(cue.start);
            let natural = if cue.repeat == Repeat::Once { cue.start + long } else { stage.settings.length };
            let over = self.to.min(cue.end.unwrap_or(natural)) - from;
            let count = (over.as_secs() / LAYER_SAMPLE_SECS).clamp(0.0, MAX_LAYER_SAMPLES) as i32;
            all.extend((1..=count).map(|i| from + over.scaled(f64::from(i) / f64::from(count + 1))));
        }
        let keys = actor.channels.iter().flat_map(|channel| &channel.times).copied();
        all.extend(keys.filter(|time| self.from < *time && *time < self.to).take(MAX_LAYER_SAMPLES as usize));
        all
    }

    /// The contact of a foot for the whole standing span.
    pub(super) fn contact_at(&self, at: DVec3) -> Contact {
        Contact { by_step: true, ..Contact::new((self.from, self.to), Some(at), [DVec3::ZERO; 2]) }
    }
}

/// A foot in a span of time in which contacts are planned.
pub(super) struct HeldFoot<'a> {
    pub leg: usize,
    /// World position of the foot in the standing span.
    pub position: DVec3,
    pub samples: &'a FootSamples,
    pub span: (Time, Time),
    pub steps: &'a [Footstep],
}

impl HeldFoot<'_> {
    /// Keeps the foot in place from its last step before the standing span, or the start of `span`, to its first step after the standing
    /// span, or the end of `span`. A foot that stood elsewhere and took no step moves to its position within [`FADE_SECS`]; it is off by millimetres.
    pub(super) fn hold(&self, stand: &StandingSpan, contacts: &mut Vec<Contact>) {
        let (mut from, mut to) = (stand.from.max(self.span.0), stand.to.min(self.span.1));
        for step in self.steps {
            match step.leads_to_walk() {
                false if step.to <= stand.to => from = from.max(step.to),
                true if step.from >= stand.from => to = to.min(step.from),
                _ => {}
            }
        }
        let overlaps = |c: &Contact| c.from <= to && c.to >= from;
        let Some(first) = contacts.iter().position(overlaps).filter(|_| from < to) else { return };
        let count = contacts[first..].iter().take_while(|c| overlaps(c)).count();
        let (before, after) = (contacts[first], contacts[first + count - 1]);
        let is_there = |c: &Contact| c.position.is_some_and(|at| (at - self.position).length() < 1e-6);
        let off = |at: Option<DVec3>, time: Time| {
            at.unwrap_or_default() - self.samples.foot_position(self.leg, time)
        };
        let mut kept = Vec::new();
        if stand.from < self.span.0 {
            from = self.span.0;
        } else if before.from >= from || is_there(&before) {
            from = before.from;
        } else if before.position.is_some() {
            let to = before.from.max(from - Time::from_secs(FADE_SECS));
            kept.push(Contact {
                to,
                last_offset: off(before.position, to),
                roll_span: (before.roll_span.0, to),
                ..before
            });
        }
        let mut late = None;
        if stand.to > self.span.1 {
            to = self.span.1;
        } else if after.to <= to || is_there(&after) {
            to = after.to;
        } else if after.position.is_some() {
            let from = after.to.min(to + Time::from_secs(FADE_SECS));
            late = Some(Contact {
                from,
                first_offset: off(after.position, from),
                roll_span: (from, after.roll_span.1),
                ..after
            });
        }
        let offsets = [from, to].map(|time| off(Some(self.position), time));
        kept.push(Contact { by_step: true, ..Contact::new((from, to), Some(self.position), offsets) });
        kept.extend(late);
        contacts.splice(first..first + count, kept);
    }
}
