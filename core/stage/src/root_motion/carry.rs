//! Root motion and paths in an evaluation: actors carried on from where they have been placed.

use crate::root_motion::travel::{Travel, Travels};
use crate::stage::Stage;
use crate::stage::actor::Placement;
use crate::timeline::active_clips::Voice;
use crate::transforms::facing;
use choreo_motion::Time;
use glam::{DAffine3, DQuat, DVec3};

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
    travels: &Travels,
    time: Time,
    scratch: &mut CarryScratch,
    placements: &mut [Placement],
) {
    let CarryScratch { faced, voices } = scratch;
    faced.clear();
    for (index, actor) in stage.actors.iter().enumerate() {
        if travels.of(index).is_some()
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
        let travel = travels.of(index);
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
