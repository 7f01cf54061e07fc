//! Foot contacts of an actor, found in its clips and blended like their poses.

use crate::stage::actor::Actor;
use crate::stage::clips::Cue;
use crate::stage::constraint::Leg;
use crate::stage::constraint::{Constraint, ConstraintKind};
use crate::timeline::active_clips::{ActiveCue, base_cues};
use choreo_asset::Asset;
use choreo_motion::contacts::{ContactInterval, Contacts, Foot, still_intervals};
use choreo_motion::{Clip, Time};
use std::sync::{Arc, Mutex, PoisonError};

/// Sampling interval of the blended foot contacts.
const CONTACT_SAMPLE_INTERVAL: Time = Time(Time::TICKS_PER_SECOND / 480);

/// Shortest swing of a foot; contacts with a shorter gap are merged.
const SHORTEST_STEP: Time = Time(Time::TICKS_PER_SECOND / 15);

/// Contacts of each foot, in order of time.
type FootIntervals = Arc<Vec<Vec<ContactInterval>>>;

/// Cache of the foot contacts of a stage's clips. Most actors share clips, so each clip is analyzed only once.
#[derive(Debug, Default)]
pub(super) struct ClipContacts(Mutex<Vec<(ContactKey, FootIntervals)>>);

/// Cache key: the trimmed part of a clip, played on a character with these feet.
#[derive(Clone, Debug)]
struct ContactKey {
    asset: Arc<Asset>,
    clip: Arc<Clip>,
    trim: (Time, Time),
    feet: Vec<Foot>,
}

impl ContactKey {
    fn is_same_key(&self, other: &ContactKey) -> bool {
        Arc::ptr_eq(&self.asset, &other.asset)
            && Arc::ptr_eq(&self.clip, &other.clip)
            && self.trim == other.trim
            && self.feet == other.feet
    }
}

impl ClipContacts {
    fn intervals_of(&self, key: ContactKey) -> FootIntervals {
        let known = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, found)) = known().iter().find(|(other, _)| other.is_same_key(&key)) {
            return found.clone();
        }
        let found = Contacts::find(&key.asset.skeleton, &key.clip, key.trim, &key.feet);
        let found = Arc::new(found.map_or_else(Vec::new, |c| c.intervals));
        known().push((key, found.clone()));
        found
    }
}

/// Foot contacts in the clips of an actor's base layer, by cue and leg.
pub(super) struct FootContacts<'a> {
    actor: &'a Actor,
    /// Mirroring constraints, each with the leg of the clip whose contacts each leg takes over.
    mirrored: Vec<(&'a Constraint, Vec<usize>)>,
    cues: Vec<FootIntervals>,
}

impl<'a> FootContacts<'a> {
    pub(super) fn new(actor: &'a Actor, legs: &[Leg], known: &ClipContacts) -> FootContacts<'a> {
        // Only the ball of the foot counts: after heel strike the foot still rotates about the heel.
        let ball = |leg: &Leg| Foot { joints: vec![leg.toe.unwrap_or(leg.foot)] };
        let feet: Vec<Foot> = legs.iter().map(ball).collect();
        let layer = actor.layers.first().map_or(&[][..], |layer| &layer.cues);
        let key = |cue: &Cue| {
            let (asset, clip) = (actor.asset.clone(), cue.clip.clone());
            ContactKey { asset, clip, trim: cue.trim, feet: feet.clone() }
        };
        let cues = layer.iter().map(|cue| known.intervals_of(key(cue))).collect();
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

    /// Contacts of the feet of `legs` legs between two times, as touch-down and lift-off times, with a resolution of 1/480 s.
    pub(super) fn contact_spans(&self, legs: usize, from: Time, to: Time) -> Vec<Vec<(Time, Time)>> {
        let at = |i: usize| from + Time(i as i64 * CONTACT_SAMPLE_INTERVAL.0);
        let count = ((to - from).0 / CONTACT_SAMPLE_INTERVAL.0) as usize;
        let mut ratios = vec![Vec::with_capacity(count + 1); legs];
        let mut active_cues = Vec::new();
        for time in (0..=count).map(at) {
            if let Some(layer) = self.actor.layers.first() {
                base_cues(layer, time, &mut active_cues);
            }
            for (leg, ratios) in ratios.iter_mut().enumerate() {
                ratios.push(self.motion_ratio(leg, time, &active_cues));
            }
        }
        let of_leg = |ratios: Vec<f64>| {
            let still = still_intervals(&ratios, CONTACT_SAMPLE_INTERVAL.as_secs(), false).into_iter();
            let mut found: Vec<(Time, Time)> = still.map(|(first, last)| (at(first), at(last))).collect();
            // Contacts that nearly touch are merged: the foot lifts off in one clip and lands in the other at once, which leaves no time
            // for a step.
            found.dedup_by(|next, before| {
                let close = next.0 - before.1 < SHORTEST_STEP;
                if close {
                    before.1 = next.1;
                }
                close
            });
            found
        };
        ratios.into_iter().map(of_leg).collect()
    }

    /// Seconds until a leg's foot touches down in the clip that has at least half of the weight at `time`; 0 if the foot stands.
    /// `backwards`: seconds since it lifted off instead. At most `most`.
    pub(crate) fn secs_until_landing(&self, leg: usize, time: Time, backwards: bool, most: f64) -> f64 {
        let leg = self.leg_in_clips(leg, time);
        let playing = self.actor.active_clips(time);
        let Some(cue) = playing.iter().rev().find(|c| c.layer == 0 && c.weight >= 0.5).map(|c| c.cue) else {
            return 0.0;
        };
        let step = if backwards { Time(-CONTACT_SAMPLE_INTERVAL.0) } else { CONTACT_SAMPLE_INTERVAL };
        let samples = (most / CONTACT_SAMPLE_INTERVAL.as_secs()) as i64;
        let down = |i: &i64| {
            let clip_time = self.actor.layers[0].cues[cue].clip_time(time + Time(step.0 * i), false);
            self.is_foot_down(cue, leg, clip_time)
        };
        (0..samples).find(down).map_or(most, |i| i as f64 * CONTACT_SAMPLE_INTERVAL.as_secs())
    }

    /// The leg of the clip whose contacts a leg takes over: another leg while the character is mirrored.
    fn leg_in_clips(&self, leg: usize, time: Time) -> usize {
        let constraints = self.mirrored.iter().filter(|(constraint, _)| constraint.weight_at(time) >= 0.5);
        constraints.fold(leg, |leg, (_, across)| across.get(leg).copied().unwrap_or(leg))
    }

    /// 0 if the foot stands in at least half of the active clips by weight, else 2, on the scale of
    /// [`choreo_motion::contacts::still_intervals`]. Contacts are blended like poses (L. Kovar, M. Gleicher, "Flexible Automatic Motion
    /// Blending with Registration Curves", SCA 2003, §3.3).
    fn motion_ratio(&self, leg: usize, time: Time, active_cues: &[ActiveCue]) -> f64 {
        let leg = self.leg_in_clips(leg, time);
        // Each clip is blended over the clips before it.
        let mut share = 0.0;
        for active in active_cues {
            let weight = f64::from(active.weight);
            let down = self.is_foot_down(active.cue, leg, active.clip_time);
            share += (f64::from(u8::from(down)) - share) * weight;
        }
        if share >= 0.5 { 0.0 } else { 2.0 }
    }

    fn is_foot_down(&self, cue: usize, leg: usize, at: Time) -> bool {
        let Some(trim) = self.actor.layers.first().and_then(|l| l.cues.get(cue)).map(|c| c.trim) else {
            return false;
        };
        let stands = self.cues.get(cue).and_then(|c| c.get(leg)).map_or(&[][..], |s| s);
        let round = trim.1 - trim.0;
        stands.iter().any(|s| (s.from <= at && at <= s.to) || (s.from <= at + round && at + round <= s.to))
    }
}
