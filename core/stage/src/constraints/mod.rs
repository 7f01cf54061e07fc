//! Constraints: changes of a pose after the clips. Feet are locked to the ground, the spine turns to look, and a hand reaches for a prop.
//!
//! Order, after all actors have been posed and placed: foot locks, aims, look-ats and reaches, each in the order of the script; then joint
//! limits. Springs run after all constraints ([`crate::springs`]). Actors are solved one by one, and an actor that others reach for comes
//! before them ([`order`]), so that a hand stays on a prop in another actor's moving hand. If actors depend on each other in a cycle,
//! hands reach for the positions from before the round, and looks use the positions after one trial of all steps. Within one actor, a look
//! at a prop in its own hand comes after the reach that moves the hand ([`steps`]).

pub(crate) mod check;
mod foot_contacts;
pub(crate) mod foot_lock;
pub(crate) mod foot_lock_cache;
mod foot_samples;
mod footsteps;
mod gait_fades;
pub(crate) mod gaze;
pub(crate) mod ground;
pub(crate) mod legs;
mod long_contacts;
pub(crate) mod look_at;
pub(crate) mod order;
pub(crate) mod solve;
mod standing_fades;
mod stands;
mod steps;

use crate::actors;
use crate::constraints::foot_lock_cache::FootLocks;
use crate::constraints::solve::ConstraintScratch;
use crate::culling::PoseBounds;
use crate::snapshot::Snapshot;
use crate::stage::{Stage, StageError};
use choreo_motion::Time;

/// Reusable buffers of [`evaluate_actors`].
#[derive(Clone, Debug, Default)]
pub(crate) struct ConstrainedScratch {
    pub actors: actors::ActorScratch,
    solve: ConstraintScratch,
}

impl ConstrainedScratch {
    pub(crate) fn of(actors: actors::ActorScratch) -> ConstrainedScratch {
        ConstrainedScratch { actors, ..ConstrainedScratch::default() }
    }
}

/// Evaluates all actors of the snapshot with their constraints, without springs. `bounds`: see [`actors::evaluate_actors`].
pub(crate) fn evaluate_actors(
    stage: &Stage,
    scratch: &mut ConstrainedScratch,
    time: Time,
    foot_locks: &FootLocks,
    bounds: Option<&PoseBounds>,
    out: &mut Snapshot,
) -> Result<(), StageError> {
    actors::find_kept_transforms(stage, &scratch.actors, time, |time, actors| {
        let (mut scratch, mut snapshot) = (ConstrainedScratch::of(actors), Snapshot::default());
        evaluate_actors(stage, &mut scratch, time, foot_locks, None, &mut snapshot)?;
        Ok((scratch.actors, snapshot))
    })?;
    actors::evaluate_actors(stage, &mut scratch.actors, time, bounds, out)?;
    solve::solve_all_constraints(
        stage,
        foot_locks,
        time,
        &mut scratch.solve,
        &mut scratch.actors,
        &mut out.actors,
    )
}
