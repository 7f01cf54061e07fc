//! Root motion and paths in an evaluation: actors carried on from where they have been placed.

use crate::evaluate::facing;
use crate::inertia::Inertias;
use crate::stage::{Placement, Stage};
use crate::timeline::Voice;
use crate::travel::{Travel, Travels};
use choreo_motion::Time;
use glam::{DAffine3, DQuat, DVec3};

/// What is found out once for a stage, by actor: how far root motion leads, what dies down after inertialized cues.
#[derive(Debug, Default)]
pub(crate) struct Motions {
    travels: Travels,
    inertias: Vec<Inertias>,
}

impl Motions {
    pub fn new(stage: &Stage) -> Motions {
        let travels = Travels::new(stage);
        let inertia = |(i, actor)| Inertias::new(actor, travels.of(i));
        let inertias = stage.actors.iter().enumerate().map(inertia).collect();
        Motions { travels, inertias }
    }

    pub fn of(&self, actor: usize) -> (Option<&Travel>, Option<&Inertias>) {
        (self.travels.of(actor), self.inertias.get(actor))
    }
}

/// Buffers.
#[derive(Clone, Debug, Default)]
pub(crate) struct CarryScratch {
    /// Turned to what they face where they start, since they walk there; sorted by actor.
    faced: Vec<(usize, DQuat)>,
    voices: Vec<Voice>,
}

impl CarryScratch {
    /// Whether an actor has been turned to what it faces already.
    pub fn has_faced(&self, actor: usize) -> bool {
        self.faced.binary_search_by_key(&actor, |(actor, _)| *actor).is_ok()
    }
}

/// Carries actors on from their placements. One that faces another walks towards where that one starts from: where it comes
/// to would depend on where it is.
pub(crate) fn carry(
    stage: &Stage,
    motions: &Motions,
    time: Time,
    scratch: &mut CarryScratch,
    placements: &mut [Placement],
) {
    let CarryScratch { faced, voices } = scratch;
    faced.clear();
    for (index, actor) in stage.actors.iter().enumerate() {
        if motions.travels.of(index).is_some()
            && actor.walk.is_none()
            && let Some(other) = actor.face.and_then(|other| placements.get(other))
        {
            let way = other.translation - placements[index].translation;
            faced.push((index, facing(&DAffine3::IDENTITY, way)));
        }
    }
    for (index, turn) in faced.iter() {
        let placement = &mut placements[*index];
        placement.rotation = (*turn * placement.rotation).normalize();
    }
    for (index, actor) in stage.actors.iter().enumerate() {
        let travel = motions.travels.of(index);
        let placement = placements[index];
        if let Some(walk) = &actor.walk {
            let size = placement.scale.z.abs();
            let forward = |at| travel.map_or(0.0, |travel| size * travel.carried(actor, at, voices).forward);
            let metres = walk.metres(time, forward);
            let anchor = travel.map_or(DVec3::ZERO, Travel::anchor);
            placements[index] = walk.placed(placement, metres, anchor);
        } else if let Some(travel) = travel {
            placements[index] = placement.carried(travel.carried(actor, time, voices).frame);
        }
    }
}
