//! Constraints: how a body is changed after its clips. Feet stay where they stand, the spine turns to look, a hand takes hold of a prop,
//! and at last hair and tails swing.
//!
//! In this order, after all actors have been posed and placed: planted feet, aims, looks, reaches, each in the order of the
//! script; then joint limits; springs last of all, once every constraint is done ([`springs`]). Constraints come actor by actor, those
//! first whose hands others reach for ([`order`]), so that a hand on a prop in another's moving hand is on it. In a circle
//! hands reach for the other's place as it was before, and looks go to where that one comes when all is tried once. Of one actor, a look at a prop in its own hand comes after
//! the reach that moves the hand ([`steps`]).

pub(crate) mod check;
mod foot_contacts;
pub(crate) mod foot_lock;
pub(crate) mod foot_locks;
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
use crate::constraints::foot_locks::FootLocks;
use crate::constraints::solve::ConstraintScratch;
use crate::culling::PoseBounds;
use crate::snapshot::Snapshot;
use crate::stage::{Stage, StageError};
use choreo_motion::Time;

/// Buffers of [`evaluate_actors`]; what is in them on entry does not matter.
#[derive(Clone, Debug, Default)]
pub(crate) struct ConstrainedScratch {
    pub actors: actors::Scratch,
    solve: ConstraintScratch,
}

impl ConstrainedScratch {
    pub fn of(actors: actors::Scratch) -> ConstrainedScratch {
        ConstrainedScratch { actors, ..ConstrainedScratch::default() }
    }
}

/// All of the snapshot's actors with their constraints, without springs. `bounds` as in [`actors::evaluate_actors`].
pub(crate) fn evaluate_actors(
    stage: &Stage,
    scratch: &mut ConstrainedScratch,
    time: Time,
    foot_locks: &FootLocks,
    bounds: Option<&PoseBounds>,
    out: &mut Snapshot,
) -> Result<(), StageError> {
    actors::settle_parents(stage, &scratch.actors, time, |time, actors| {
        let (mut scratch, mut snapshot) = (ConstrainedScratch::of(actors), Snapshot::default());
        evaluate_actors(stage, &mut scratch, time, foot_locks, None, &mut snapshot)?;
        Ok((scratch.actors, snapshot))
    })?;
    actors::evaluate_actors(stage, &mut scratch.actors, time, bounds, out)?;
    solve::run(stage, foot_locks, time, &mut scratch.solve, &mut scratch.actors, &mut out.actors)
}
