//! Computes the poses of all actors at one time, in parallel if there are many.

use crate::pose;
use crate::pose::PoseScratch;
use crate::pose::expressions::ExpressionWeights;
use crate::pose::gaze;
use crate::pose::motions::Motions;
use crate::snapshot::ActorState;
use crate::stage::actor::Actor;
use crate::stage::edits::ActorEdit;
use choreo_motion::Time;
#[cfg(feature = "threads")]
use rayon::prelude::*;

/// Smallest number of poses that is distributed over threads; distributing costs some microseconds.
const MIN_PARALLEL_POSES: usize = 48;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PoseNeed {
    /// Whether the actor's world transform is needed.
    pub world: bool,
    pub pose: bool,
}

/// Inputs of the poses. Each pose is a function of its actor, the time and the edits alone, so that threads change no bit.
pub(crate) struct Posing<'a> {
    pub time: Time,
    pub motions: &'a Motions,
    /// One entry per actor.
    pub pose_needs: &'a [PoseNeed],
    /// (actor, index into `edits`), sorted.
    pub pose_edits: &'a [(usize, usize)],
    pub edits: &'a [(usize, ActorEdit)],
}

/// Threads that can pose actors at once.
fn available_threads() -> usize {
    #[cfg(feature = "threads")]
    return rayon::current_num_threads();
    #[cfg(not(feature = "threads"))]
    1
}

impl Posing<'_> {
    /// Poses the actors that need it and returns their number. `scratch` grows to one entry per chunk of actors. `expression_weights`: one
    /// entry per actor, filled for actors whose file states how their eyes move.
    pub(crate) fn run(
        &self,
        actors: &[Actor],
        states: &mut [ActorState],
        scratch: &mut Vec<PoseScratch>,
        expression_weights: &mut Vec<ExpressionWeights>,
    ) -> usize {
        let poses = self.pose_needs.iter().filter(|need| need.pose).count();
        let threads = if poses < MIN_PARALLEL_POSES { 1 } else { available_threads() };
        // Neighboring actors often cost the same: small chunks keep one thread from getting all that are expensive.
        let size = actors.len().div_ceil(if threads > 1 { 4 * threads } else { 1 }).max(1);
        let chunks = actors.len().div_ceil(size);
        if expression_weights.len() < actors.len() {
            expression_weights.resize_with(actors.len(), ExpressionWeights::default);
        }
        if scratch.len() < chunks {
            scratch.resize_with(chunks, PoseScratch::default);
        }
        if threads <= 1 {
            scratch
                .iter_mut()
                .take(1)
                .for_each(|scratch| self.pose_chunk(0, actors, states, scratch, expression_weights));
        }
        #[cfg(feature = "threads")]
        if threads > 1 {
            let each = actors.par_chunks(size).zip(states.par_chunks_mut(size)).zip(&mut scratch[..chunks]);
            each.zip(expression_weights.par_chunks_mut(size)).enumerate().for_each(
                |(i, (((actors, states), scratch), expression_weights))| {
                    self.pose_chunk(i * size, actors, states, scratch, expression_weights);
                },
            );
        }
        poses
    }

    /// Poses a chunk of actors. `first`: index of its first actor.
    fn pose_chunk(
        &self,
        first: usize,
        actors: &[Actor],
        states: &mut [ActorState],
        scratch: &mut PoseScratch,
        expression_weights: &mut [ExpressionWeights],
    ) {
        for (index, ((actor, state), expression_weights)) in
            (first..).zip(actors.iter().zip(states).zip(expression_weights))
        {
            if !self.pose_needs[index].pose {
                state.model_from_joint.clear();
                state.morph_weights.clear();
                state.base_colors.clear();
                state.materials.clear();
                continue;
            }
            state.skinning = actor.skinning;
            let at = self.pose_edits.partition_point(|(a, _)| *a < index);
            let edits = self.pose_edits[at..].iter().take_while(|(a, _)| *a == index);
            let edits = edits.map(|(_, place)| &self.edits[*place].1);
            let (joints, weights) = (&mut state.model_from_joint, &mut state.morph_weights);
            pose::pose_actor(actor, self.time, self.motions.of(index), edits, scratch, joints, weights);
            if actor.asset.eyes.is_some() {
                expression_weights.requested.clear();
                expression_weights.requested.extend_from_slice(scratch.requested_expressions());
                expression_weights.resolved.clear();
                expression_weights.resolved.extend_from_slice(scratch.resolved_expressions());
            }
            crate::properties::base_colors(actor, self.time, &mut state.base_colors);
            crate::properties::materials::find_changed_materials(
                actor,
                scratch.resolved_expressions(),
                self.time,
                &mut state.materials,
            );
            gaze::apply_requested_gaze(actor, self.time, state, expression_weights);
        }
    }
}
