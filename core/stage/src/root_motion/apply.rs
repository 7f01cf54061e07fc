//! Applies root motion and path following: moves actors from their placements.

use crate::root_motion::track::{RootMotionTrack, RootMotionTracks};
use crate::stage::Stage;
use crate::stage::actor::Placement;
use crate::timeline::active_clips::ActiveCue;
use crate::transforms::rotation_to_face;
use choreo_motion::Time;
use glam::{DAffine3, DQuat, DVec3};

/// Reusable buffers of [`apply_root_motion`].
#[derive(Clone, Debug, Default)]
pub(crate) struct RootMotionScratch {
    /// Actors with root motion that face another actor, with the turn towards it at their start; sorted by actor.
    faced: Vec<(usize, DQuat)>,
    active_cues: Vec<ActiveCue>,
}

impl RootMotionScratch {
    /// Whether root motion has already turned an actor to the actor that it faces.
    pub(crate) fn has_faced(&self, actor: usize) -> bool {
        self.faced.binary_search_by_key(&actor, |(actor, _)| *actor).is_ok()
    }
}

/// Moves actors by root motion from their placements. An actor that faces another walks towards the other's placement: following the
/// other's motion would make each position depend on the other.
pub(crate) fn apply_root_motion(
    stage: &Stage,
    root_motion: &RootMotionTracks,
    time: Time,
    scratch: &mut RootMotionScratch,
    placements: &mut [Placement],
) {
    let RootMotionScratch { faced, active_cues } = scratch;
    faced.clear();
    for (index, actor) in stage.actors.iter().enumerate() {
        if root_motion.of(index).is_some()
            && actor.path_following.is_none()
            && let Some(other) = actor.face.and_then(|other| placements.get(other))
        {
            let way = other.translation - placements[index].translation;
            faced.push((index, rotation_to_face(&DAffine3::IDENTITY, way, actor.asset.front())));
        }
    }
    for (index, turn) in faced.iter() {
        let placement = &mut placements[*index];
        placement.rotation = (*turn * placement.rotation).normalize();
    }
    for (index, actor) in stage.actors.iter().enumerate() {
        let track = root_motion.of(index);
        let placement = placements[index];
        if let Some(path_following) = &actor.path_following {
            let size = placement.scale.z.abs();
            let forward =
                |at| track.map_or(0.0, |track| size * track.displacement_at(actor, at, active_cues).forward);
            let metres = path_following.metres(time, forward);
            let anchor = track.map_or(DVec3::ZERO, RootMotionTrack::anchor);
            placements[index] = path_following.placed(placement, metres, anchor, actor.asset.front());
        } else if let Some(track) = track {
            placements[index] =
                placement.moved_by_root_motion(track.displacement_at(actor, time, active_cues).frame);
        }
    }
}
