//! The foot contacts of an actor, by its clips.

use crate::stage::actor::Actor;
use crate::stage::clips::Cue;
use crate::stage::constraint::Leg;
use crate::stage::constraint::{Constraint, ConstraintKind};
use crate::timeline::active_clips::{ActiveCue, base_cues};
use choreo_asset::Asset;
use choreo_motion::contacts::{ContactInterval, Contacts, Foot, still_intervals};
use choreo_motion::{Clip, Time};
use std::sync::{Arc, Mutex, PoisonError};

/// How often it is asked whether feet are down.
const STEP: Time = Time(Time::TICKS_PER_SECOND / 480);

/// A foot is up for at least so long.
const SHORTEST_STEP: Time = Time(Time::TICKS_PER_SECOND / 15);

/// Contacts of each foot, in the order of time.
type FootIntervals = Arc<Vec<Vec<ContactInterval>>>;

/// The contacts of a stage's clips, which most actors share: each is found once.
#[derive(Debug, Default)]
pub(super) struct ClipContacts(Mutex<Vec<(ContactKey, FootIntervals)>>);

/// Part of a clip on a character.
#[derive(Clone, Debug)]
struct ContactKey {
    asset: Arc<Asset>,
    clip: Arc<Clip>,
    trim: (Time, Time),
    feet: Vec<Foot>,
}

impl ContactKey {
    fn is(&self, other: &ContactKey) -> bool {
        Arc::ptr_eq(&self.asset, &other.asset)
            && Arc::ptr_eq(&self.clip, &other.clip)
            && self.trim == other.trim
            && self.feet == other.feet
    }
}

impl ClipContacts {
    fn of(&self, key: ContactKey) -> FootIntervals {
        let known = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, found)) = known().iter().find(|(other, _)| other.is(&key)) {
            return found.clone();
        }
        let found = Contacts::find(&key.asset.skeleton, &key.clip, key.trim, &key.feet);
        let found = Arc::new(found.map_or_else(Vec::new, |c| c.intervals));
        known().push((key, found.clone()));
        found
    }
}

/// Contacts of each leg's foot in its clip, by cue of the base layer.
pub(super) struct FootContacts<'a> {
    actor: &'a Actor,
    /// The leg whose steps each leg takes while the character is mirrored, and the constraint that does it.
    mirrored: Vec<(&'a Constraint, Vec<usize>)>,
    cues: Vec<FootIntervals>,
}

impl<'a> FootContacts<'a> {
    pub fn new(actor: &'a Actor, legs: &[Leg], known: &ClipContacts) -> FootContacts<'a> {
        // The ball alone: a heel that has come down turns about itself.
        let ball = |leg: &Leg| Foot { joints: vec![leg.toe.unwrap_or(leg.foot)] };
        let feet: Vec<Foot> = legs.iter().map(ball).collect();
        let layer = actor.layers.first().map_or(&[][..], |layer| &layer.cues);
        let key = |cue: &Cue| {
            let (asset, clip) = (actor.asset.clone(), cue.clip.clone());
            ContactKey { asset, clip, trim: cue.trim, feet: feet.clone() }
        };
        let cues = layer.iter().map(|cue| known.of(key(cue))).collect();
        let across = |constraint: &'a Constraint| {
            let ConstraintKind::Mirror(mirroring) = &constraint.kind else { return None };
            let other = |(own, leg): (usize, &Leg)| {
                let partner = mirroring.joints.partner(leg.foot);
                legs.iter().position(|l| Some(l.foot) == partner).unwrap_or(own)
            };
            Some((constraint, legs.iter().enumerate().map(other).collect()))
        };
        let mirrored = actor.constraints.iter().filter_map(across).collect();
        FootContacts { actor, mirrored, cues }
    }

    /// The times at which the foot of each of `legs` legs comes down and goes up, between two times, to a 480th of a second.
    pub fn stands(&self, legs: usize, from: Time, to: Time) -> Vec<Vec<(Time, Time)>> {
        let at = |i: usize| from + Time(i as i64 * STEP.0);
        let count = ((to - from).0 / STEP.0) as usize;
        let mut unrest = vec![Vec::with_capacity(count + 1); legs];
        let mut active_cues = Vec::new();
        for time in (0..=count).map(at) {
            if let Some(layer) = self.actor.layers.first() {
                base_cues(layer, time, &mut active_cues);
            }
            for (leg, unrest) in unrest.iter_mut().enumerate() {
                unrest.push(self.unrest(leg, time, &active_cues));
            }
        }
        let of_leg = |unrest: Vec<f64>| {
            let still = still_intervals(&unrest, STEP.as_secs(), false).into_iter();
            let mut found: Vec<(Time, Time)> = still.map(|(first, last)| (at(first), at(last))).collect();
            // Up with one clip and down at once with the other: a foot that steps on the spot has no time to get anywhere.
            found.dedup_by(|next, before| {
                let close = next.0 - before.1 < SHORTEST_STEP;
                if close {
                    before.1 = next.1;
                }
                close
            });
            found
        };
        unrest.into_iter().map(of_leg).collect()
    }

    /// Seconds until a leg's foot comes down as the clip has it that plays at a time with most weight; 0: it stands. `backwards`: since it
    /// went up. At most `most`.
    pub(crate) fn lands_secs(&self, leg: usize, time: Time, backwards: bool, most: f64) -> f64 {
        let leg = self.leg_in_clips(leg, time);
        let playing = self.actor.active_clips(time);
        let Some(cue) = playing.iter().rev().find(|c| c.layer == 0 && c.weight >= 0.5).map(|c| c.cue) else {
            return 0.0;
        };
        let step = if backwards { Time(-STEP.0) } else { STEP };
        let samples = (most / STEP.as_secs()) as i64;
        let down = |i: &i64| {
            let clip_time = self.actor.layers[0].cues[cue].clip_time(time + Time(step.0 * i), false);
            self.is_down(cue, leg, clip_time)
        };
        (0..samples).find(down).map_or(most, |i| i as f64 * STEP.as_secs())
    }

    /// The leg whose steps a leg takes while the character is mirrored.
    fn leg_in_clips(&self, leg: usize, time: Time) -> usize {
        let constraints = self.mirrored.iter().filter(|(constraint, _)| constraint.share(time) >= 0.5);
        constraints.fold(leg, |leg, (_, across)| across.get(leg).copied().unwrap_or(leg))
    }

    /// 0 if the foot stands in most of the active clips, by their weights, else 2 (see [`choreo_motion::contacts::still_intervals`]):
    /// contacts are mixed as poses
    /// are (L. Kovar, M. Gleicher, "Flexible Automatic Motion Blending with Registration Curves", SCA 2003, §3.3).
    fn unrest(&self, leg: usize, time: Time, active_cues: &[ActiveCue]) -> f64 {
        let leg = self.leg_in_clips(leg, time);
        // Each is blended over those before it.
        let mut share = 0.0;
        for active in active_cues {
            let weight = f64::from(active.weight);
            let down = self.is_down(active.cue, leg, active.clip_time);
            share += (f64::from(u8::from(down)) - share) * weight;
        }
        if share >= 0.5 { 0.0 } else { 2.0 }
    }

    fn is_down(&self, cue: usize, leg: usize, at: Time) -> bool {
        let Some(trim) = self.actor.layers.first().and_then(|l| l.cues.get(cue)).map(|c| c.trim) else {
            return false;
        };
        let stands = self.cues.get(cue).and_then(|c| c.get(leg)).map_or(&[][..], |s| s);
        let round = trim.1 - trim.0;
        stands.iter().any(|s| (s.from <= at && at <= s.to) || (s.from <= at + round && at + round <= s.to))
    }
}
