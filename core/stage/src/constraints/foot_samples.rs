//! Samples the motion of an actor's feet without foot locking, at 60 Hz.

use crate::actors::{ActorScratch, evaluate_actors};
use crate::constraints::foot_lock_cache::SAMPLE_INTERVAL;
use crate::constraints::footsteps::REFERENCE_LEG;
use crate::constraints::solve::joint_world_position;
use crate::snapshot::Snapshot;
use crate::stage::constraint::FootLock;
use crate::stage::{Stage, StageError};
use choreo_motion::Time;
use glam::{DAffine3, DVec3};

/// Motion of an actor's feet without the constraint, sampled at 60 Hz.
pub(super) struct FootSamples {
    pub from: Time,
    /// World positions, by foot and sample.
    pub feet: Vec<Vec<DVec3>>,
    /// Legs of the feet, by foot and sample.
    pub limbs: Vec<Vec<Limb>>,
    /// World from model, by sample.
    pub transforms: Vec<DAffine3>,
}

/// A leg: world positions, lengths in metres.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Limb {
    pub hip: DVec3,
    pub ankle: DVec3,
    /// Length of the leg.
    pub reach: f64,
    /// Distance from the ankle to the ball.
    pub sole: f64,
}

/// An actor whose feet are sampled.
pub(super) struct FeetInMotion<'a> {
    pub stage: &'a Stage,
    pub actor: usize,
    pub foot_lock: &'a FootLock,
    pub scratch: ActorScratch,
}

impl FeetInMotion<'_> {
    /// Samples the feet from one time to another, both included.
    pub(super) fn sample_feet(&mut self, from: Time, to: Time) -> Result<FootSamples, StageError> {
        let mut snapshot = Snapshot::default();
        let foot_lock = self.foot_lock;
        let count = foot_lock.legs.len();
        let mut samples = FootSamples {
            from,
            feet: vec![Vec::new(); count],
            limbs: vec![Vec::new(); count],
            transforms: vec![],
        };
        for sample in 0..=(to - from).0 / SAMPLE_INTERVAL.0 {
            evaluate_actors(
                self.stage,
                &mut self.scratch,
                from + Time(sample * SAMPLE_INTERVAL.0),
                None,
                &mut snapshot,
            )?;
            let state = &snapshot.actors[self.actor];
            let place = |joint: u32| {
                let place = state.model_from_joint.get(joint as usize);
                let place = place.map(|m| joint_world_position(&state.world_from_model, m));
                place.filter(|p| p.is_finite()).unwrap_or(DVec3::ZERO)
            };
            samples.transforms.push(state.world_from_model);
            for ((leg, places), limbs) in foot_lock.legs.iter().zip(&mut samples.feet).zip(&mut samples.limbs)
            {
                places.push(place(leg.toe.unwrap_or(leg.foot)));
                let [hip, knee, ankle] = [leg.hip, leg.knee, leg.foot].map(place);
                let reach = (knee - hip).length() + (ankle - knee).length();
                limbs.push(Limb {
                    hip,
                    ankle,
                    reach,
                    sole: leg.toe.map_or(0.0, |toe| (place(toe) - ankle).length()),
                });
            }
        }
        Ok(samples)
    }

    /// World position of a foot at a time.
    pub(super) fn foot_position(&mut self, leg: usize, time: Time) -> Result<DVec3, StageError> {
        Ok(self.sample_feet(time, time)?.feet[leg][0])
    }
}

/// Length of the first leg in the rest pose, times the actor's unkeyed scale, metres.
pub(super) fn leg_length(stage: &Stage, actor: usize, foot_lock: &FootLock) -> f64 {
    let a = &stage.actors[actor];
    let rest = a.asset.rest_model_from_joint();
    let Some(leg) = foot_lock.legs.first() else { return REFERENCE_LEG };
    let place = |joint: u32| {
        rest.get(joint as usize).map_or(DVec3::ZERO, |m| joint_world_position(&DAffine3::IDENTITY, m))
    };
    let (hip, knee, foot) = (place(leg.hip), place(leg.knee), place(leg.foot));
    let length = ((knee - hip).length() + (foot - knee).length()) * a.transform.scale.y.abs();
    if length.is_finite() && length > 1e-9 { length } else { REFERENCE_LEG }
}

impl FootSamples {
    pub(super) fn time_of_sample(&self, index: usize) -> Time {
        self.from + Time(index as i64 * SAMPLE_INTERVAL.0)
    }

    /// Index of the last sample at or before a time, and the share of the way to the next one, 0..=1.
    pub(crate) fn index_at(&self, time: Time) -> (usize, f64) {
        let last = self.transforms.len() - 1;
        let at = ((time - self.from).0 as f64 / SAMPLE_INTERVAL.0 as f64).clamp(0.0, last as f64);
        let low = (at as usize).min(last.saturating_sub(1));
        (low, at - low as f64)
    }

    /// Indices of the first and the last sample within a time span, or of the nearest sample if there is none.
    pub(super) fn samples_between(&self, (from, to): (Time, Time)) -> (usize, usize) {
        let count = self.transforms.len();
        let first = ((from - self.from).0 as u64).div_ceil(SAMPLE_INTERVAL.0 as u64) as usize;
        let first = first.min(count - 1);
        (first, (((to - self.from).0 / SAMPLE_INTERVAL.0) as usize).clamp(first, count - 1))
    }

    /// World position of a foot at a time, interpolated linearly between two samples.
    pub(super) fn foot_position(&self, leg: usize, time: Time) -> DVec3 {
        let (low, share) = self.index_at(time);
        let places = &self.feet[leg];
        places[low].lerp(places[(low + 1).min(places.len() - 1)], share)
    }

    /// World height of the floor at a sample: that of the actor's origin.
    pub(super) fn floor_height(&self, index: usize) -> f64 {
        self.transforms[index].translation.y
    }
}
