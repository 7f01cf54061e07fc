//! Contacts that last longer than a leg reaches: the foot takes steps in between.
//!
//! During a phase-matched fade between a walk and a run, a foot may land in one clip when it lifts off in the other, above all with
//! quadrupeds, whose gaits are matched by whole strides. Its contact then covers most of a stride, and a leg that cannot reach so far would
//! drag the foot.

use crate::constraints::foot_lock::{Contact, hip_drop_to_reach, reachable_position};
use crate::constraints::foot_samples::{FootSamples, Limb};
use crate::constraints::footsteps::{Footstep, PlannedStep, hurried_secs, step_lift, step_secs};
use choreo_motion::Time;
use glam::DVec3;

/// Largest number of steps in one contact.
const MAX_STEPS: i64 = 3;
/// Shortest time in which the foot stands between two steps.
const MIN_STAND: Time = Time(Time::TICKS_PER_SECOND / 20);

/// Splits contacts of one leg's foot that are too long.
pub(super) struct LongContacts<'a> {
    pub samples: &'a FootSamples,
    /// Index of the leg.
    pub leg: usize,
    /// Length of the leg, metres.
    pub leg_length: f64,
    /// Largest lowering of the hips, in leg lengths.
    pub lowest: f64,
    /// Upper limit of the world height of the standing foot.
    pub highest: f64,
}

impl LongContacts<'_> {
    /// Splits a contact into the time spans in which the foot stands: the whole contact if the leg reaches that far, else the parts between
    /// as few steps as let it reach, or bring it nearest.
    pub(super) fn split_contact(&self, span: (Time, Time)) -> Vec<(Time, Time)> {
        let mut best = (self.overreach(span), vec![span]);
        for parts in (1..=MAX_STEPS).filter_map(|count| self.split_evenly(span, count)) {
            if best.0 <= 0.0 {
                break;
            }
            let beyond = parts.iter().map(|part| self.overreach(*part)).fold(0.0, f64::max);
            if beyond < best.0 {
                best = (beyond, parts);
            }
        }
        best.1
    }

    /// Equal parts of a contact with `count` steps in between, at normal speed if there is time, else hurried. `None` if the parts would be
    /// too short.
    fn split_evenly(&self, (from, to): (Time, Time), count: i64) -> Option<Vec<(Time, Time)>> {
        let stand = |step: Time| Time(((to - from).0 - count * step.0) / (count + 1));
        let secs = [step_secs(self.leg_length), hurried_secs(self.leg_length)];
        let step = secs.map(Time::from_secs).into_iter().find(|step| stand(*step) >= MIN_STAND)?;
        let part = |i: i64| {
            let begin = from + Time(i * (stand(step) + step).0);
            (begin, if i == count { to } else { begin + stand(step) })
        };
        Some((0..=count).map(part).collect())
    }

    /// The steps between the parts of a contact.
    pub(super) fn steps_between(&self, parts: &[Contact]) -> Vec<Footstep> {
        let step = |pair: &[Contact]| {
            let [start, end] = [pair[0].position?, pair[1].position?];
            let (to, lift) = ((pair[1].from - pair[0].to).as_secs(), step_lift(start, end, self.leg_length));
            let planned = PlannedStep { from: 0.0, to, start, velocity: DVec3::ZERO, end, lift };
            Some(Footstep::new(planned, pair[0].to, false))
        };
        parts.windows(2).filter_map(step).collect()
    }

    /// Largest distance in metres by which the leg would miss the foot's position if the foot stood all the time.
    fn overreach(&self, span: (Time, Time)) -> f64 {
        let (first, last) = self.samples.samples_between(span);
        let limbs = &self.samples.limbs[self.leg][first..=last];
        let at = reachable_position(self.samples, self.leg, (first, last), self.highest);
        let overreach = |limb: &Limb| {
            let hip = limb.hip - DVec3::Y * hip_drop_to_reach(limb, at).clamp(0.0, self.lowest * limb.reach);
            (hip - at).length() - limb.reach - limb.sole
        };
        limbs.iter().map(overreach).fold(0.0, f64::max)
    }
}
