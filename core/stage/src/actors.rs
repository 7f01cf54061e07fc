//! Evaluates actors from keyed properties, callbacks and clips, before constraints.
//!
//! Steps in order: keyed properties, callbacks, parents, root motion, visibility, culling, selection of the poses that are needed, poses, world
//! transforms.

use crate::culling::{Culling, PoseBounds};
use crate::pose::PoseScratch;
use crate::pose::expressions::ExpressionWeights;
use crate::pose::motions::Motions;
use crate::pose::posing::{PoseNeed, Posing};
use crate::root_motion::apply;
use crate::root_motion::apply::RootMotionScratch;
use crate::snapshot::{ActorState, Snapshot};
use crate::stage::actor::{Placement, Target};
use crate::stage::camera::Rig;
use crate::stage::edits::{ActorEdit, CameraEdit, FrameEdits, edits_for_index};
use crate::stage::sky::SkyEdit;
use crate::stage::{Stage, StageError};
use crate::transforms::order;
use crate::transforms::order::{PlacementOrder, PlacementStep};
use crate::transforms::parents::{ActiveParents, KeptTransforms, interpolate_affine, world_from_parent};
use crate::transforms::rotation_to_face;
use crate::{camera, camera_moves, pose};
use choreo_motion::Time;
use glam::DAffine3;
use std::sync::Arc;

/// Reusable buffers and settings for evaluating one stage.
#[derive(Clone, Debug, Default)]
pub(crate) struct ActorScratch {
    /// Root motion and inertialization of all actors, computed at the first evaluation.
    pub motions: Option<Arc<Motions>>,
    root_motion: RootMotionScratch,
    pub order: PlacementOrder,
    /// Pose buffers, one per chunk of actors that a thread poses.
    pose: Vec<PoseScratch>,
    placements: Vec<Placement>,
    pub parents: ActiveParents,
    pub kept_transforms: KeptTransforms,
    /// World transform of each actor's model, without the actor's own scale.
    unscaled: Vec<DAffine3>,
    pose_needs: Vec<PoseNeed>,
    work: Vec<usize>,
    /// (actor, index into `edits.actors`) of edits that change poses, sorted.
    pose_edits: Vec<(usize, usize)>,
    pub edits: FrameEdits,
    /// Expression weights, one entry per actor, filled for actors whose file states how their eyes move.
    pub expression_weights: Vec<ExpressionWeights>,
    /// Number of actors posed by the last evaluation.
    pub pose_count: usize,
    /// Number of actors posed by all evaluations.
    pub total_pose_count: usize,
    /// Whether hidden actors are posed, too.
    pub pose_hidden: bool,
    /// The active camera and, during a dissolve, the camera before the cut. The poses of their targets are needed.
    pub view_cameras: [Option<usize>; 2],
    /// Aspect ratio (width / height) of the image, if only images are requested; this enables culling.
    pub aspect: Option<f64>,
    /// Whether each actor is out of view.
    culled: Vec<bool>,
    /// If set, only these actors and the actors that they depend on are posed.
    requested_actors: Option<Vec<usize>>,
}

impl ActorScratch {
    pub(crate) fn for_actors(actors: Vec<usize>) -> ActorScratch {
        ActorScratch { requested_actors: Some(actors), ..ActorScratch::default() }
    }

    /// Restricts all further evaluations as [`ActorScratch::for_actors`] does.
    pub(crate) fn restrict_to(&mut self, actors: &[usize]) {
        let requested_actors = self.requested_actors.get_or_insert_default();
        requested_actors.clear();
        requested_actors.extend_from_slice(actors);
    }

    /// Recomputes the world transforms of all actors, after joints that carry other actors have moved.
    pub(crate) fn place(&mut self, stage: &Stage, actors: &mut [ActorState]) {
        place_actors(stage, self, actors);
    }
}

/// Evaluates all actors of the snapshot, without constraints and springs. With `bounds`, actors that are certainly outside the image are
/// culled.
pub(crate) fn evaluate_actors(
    stage: &Stage,
    scratch: &mut ActorScratch,
    time: Time,
    bounds: Option<&PoseBounds>,
    out: &mut Snapshot,
) -> Result<(), StageError> {
    find_kept_transforms(stage, scratch, time, |time, mut scratch| {
        let mut snapshot = Snapshot::default();
        evaluate_actors(stage, &mut scratch, time, None, &mut snapshot)?;
        Ok((scratch, snapshot))
    })?;
    out.actors.truncate(stage.actors.len());
    out.actors.resize_with(stage.actors.len(), ActorState::default);
    scratch.placements.clear();
    for (actor, state) in stage.actors.iter().zip(&mut out.actors) {
        scratch.placements.push(pose::keyed_placement(actor, time, state));
    }
    run_callbacks(stage, scratch, time, &mut out.actors)?;
    scratch.parents.find_active(stage, time, &scratch.edits.actors, &scratch.kept_transforms);
    order::sort_placement_steps(stage, &scratch.parents, &mut scratch.order)?;
    let motions = scratch.motions.get_or_insert_with(|| Arc::new(Motions::new(stage))).clone();
    apply::apply_root_motion(
        stage,
        &motions.root_motion,
        time,
        &mut scratch.root_motion,
        &mut scratch.placements,
    );
    for step in &scratch.order.steps {
        // Parents come first.
        if let PlacementStep::Position(a) = *step
            && let Some(parent) = scratch.parents.of(a).last().and_then(|parent| parent.to)
        {
            out.actors[a].visible &= out.actors.get(parent.actor).is_none_or(|p| p.visible);
        }
    }
    cull_actors(stage, scratch, time, bounds, &mut out.actors);
    find_pose_needs(stage, scratch, time, &out.actors);
    let ActorScratch { pose, pose_needs, pose_edits, edits, expression_weights, .. } = scratch;
    let posing = Posing { time, motions: &motions, pose_needs, pose_edits, edits: &edits.actors };
    scratch.pose_count = posing.run(&stage.actors, &mut out.actors, pose, expression_weights);
    scratch.total_pose_count += scratch.pose_count;
    place_actors(stage, scratch, &mut out.actors);
    Ok(())
}

fn run_callbacks(
    stage: &Stage,
    scratch: &mut ActorScratch,
    time: Time,
    actors: &mut [ActorState],
) -> Result<(), StageError> {
    let edits = &mut scratch.edits;
    edits.actors.clear();
    edits.cameras.clear();
    edits.lights.clear();
    edits.effects.clear();
    (edits.ambient, edits.sky) = (None, SkyEdit::default());
    edits.layers_2d.clear();
    for callback in &stage.frame_callbacks {
        callback.run(time, edits)?;
    }
    scratch.pose_edits.clear();
    for (place, (index, edit)) in scratch.edits.actors.iter().enumerate() {
        let (Some(placement), Some(state)) = (scratch.placements.get_mut(*index), actors.get_mut(*index))
        else {
            continue;
        };
        edit.apply_to_placement(placement);
        match *edit {
            ActorEdit::Visible(visible) => state.visible = visible,
            ActorEdit::Tint(tint) => state.tint = tint,
            ActorEdit::LineWidth(width) => state.line_width = Some(width),
            ActorEdit::Copies(count) => state.copies = Some(count),
            ActorEdit::Morph { .. } | ActorEdit::Expression { .. } | ActorEdit::TurnJoint { .. } => {
                scratch.pose_edits.push((*index, place))
            }
            _ => {}
        }
    }
    scratch.pose_edits.sort_unstable();
    Ok(())
}

fn cull_actors(
    stage: &Stage,
    scratch: &mut ActorScratch,
    time: Time,
    bounds: Option<&PoseBounds>,
    actors: &mut [ActorState],
) {
    let mut out = std::mem::take(&mut scratch.culled);
    out.clear();
    // If a callback attaches an actor or aims the camera, the camera may depend on a pose; then nothing is culled.
    let attaches = |(_, edit): &(usize, ActorEdit)| matches!(edit, ActorEdit::Attach(_));
    let looks = |(_, edit): &(usize, CameraEdit)| matches!(edit, CameraEdit::LookAt(_) | CameraEdit::Rig(_));
    let edits = &scratch.edits;
    let bounds = bounds.filter(|_| !edits.actors.iter().any(attaches) && !edits.cameras.iter().any(looks));
    if let (Some(pose_bounds), Some(aspect)) = (bounds, scratch.aspect) {
        // Joints are not posed yet, so actors attached to joints are misplaced here. All other actors already have their final transforms.
        place_actors(stage, scratch, actors);
        let ActorScratch { edits, order, parents, view_cameras, .. } = &*scratch;
        let camera = camera::state_without_poses(stage, edits, time, view_cameras[0], actors);
        Culling { stage, pose_bounds, camera, aspect, edits, time, order: &order.steps, parents, actors }
            .run(&mut out);
    }
    for (index, state) in actors.iter_mut().enumerate() {
        state.culled = out.get(index).is_some_and(|out| *out);
    }
    scratch.culled = out;
}

/// Finds the actors to pose. An invisible actor is posed only if all poses are requested, or if a visible actor, the camera, a light, an
/// effect or a constraint depends on one of its joints.
fn find_pose_needs(stage: &Stage, scratch: &mut ActorScratch, time: Time, actors: &[ActorState]) {
    let (pose_needs, work, parents) = (&mut scratch.pose_needs, &mut scratch.work, &scratch.parents);
    pose_needs.clear();
    pose_needs.resize(stage.actors.len(), PoseNeed::default());
    work.clear();
    let mut require = |work: &mut Vec<usize>, actor: usize, pose: bool| {
        if let Some(need) = pose_needs.get_mut(actor) {
            let before = *need;
            *need = PoseNeed { world: true, pose: need.pose || pose };
            if *need != before {
                work.push(actor);
            }
        }
    };
    let required_pose_of_target = |target: &Target| match *target {
        Target::Point(_) => None,
        Target::Actor(actor) => Some((actor, false)),
        Target::Joint { actor, .. } => Some((actor, true)),
    };
    if let Some(requested_actors) = &scratch.requested_actors {
        requested_actors.iter().for_each(|actor| require(work, *actor, true));
    } else {
        for (index, state) in actors.iter().enumerate() {
            if (state.visible && !state.culled) || scratch.pose_hidden {
                require(work, index, true);
            }
        }
    }
    let lights = if scratch.requested_actors.is_none() { &stage.lights[..] } else { &[] };
    for parent in lights.iter().filter_map(|light| light.parent) {
        require(work, parent.actor, parent.joint.is_some());
    }
    for (index, camera) in
        scratch.view_cameras.iter().flatten().filter_map(|c| Some((*c, stage.cameras.get(*c)?)))
    {
        let target = match scratch.edits.rig_of(index, camera) {
            Rig::Fixed { look_at, .. } => look_at.as_ref().and_then(required_pose_of_target),
            Rig::Follow { target, .. } | Rig::Orbit { target, .. } => required_pose_of_target(target),
            Rig::File { actor, .. } => Some((*actor, true)),
            Rig::Frame { .. } => None,
        };
        let looks = camera_moves::aim_targets(camera, index, &scratch.edits, time);
        for (actor, pose) in
            target.into_iter().chain(looks.filter_map(|target| required_pose_of_target(&target)))
        {
            require(work, actor, pose);
        }
    }
    let effects = if scratch.requested_actors.is_none() { &stage.effects[..] } else { &[] };
    let distances = effects.iter().filter(|used| used.is_active(time)).flat_map(|used| &used.distances);
    for (actor, pose) in distances.filter_map(|distance| required_pose_of_target(&distance.target)) {
        require(work, actor, pose);
    }
    while let Some(index) = work.pop() {
        let actor = &stage.actors[index];
        for parent in parents.carriers(index) {
            require(work, parent.actor, parent.joint.is_some());
        }
        if let Some(face) = actor.face {
            require(work, face, false);
        }
        for look in &actor.look_at {
            if look.weight_at(time) > 0.0
                && let Some((actor, pose)) = required_pose_of_target(&look.target)
            {
                require(work, actor, pose);
            }
        }
        for constraint in actor.constraints.iter().filter(|g| g.weight_at(time) > 0.0) {
            for (actor, pose) in constraint.targets().filter_map(|t| required_pose_of_target(&t)) {
                require(work, actor, pose);
            }
        }
    }
}

fn place_actors(stage: &Stage, scratch: &mut ActorScratch, actors: &mut [ActorState]) {
    let ActorScratch { order, parents, placements, root_motion, edits, unscaled, .. } = scratch;
    unscaled.clear();
    unscaled.resize(actors.len(), DAffine3::IDENTITY);
    for step in &order.steps {
        match *step {
            PlacementStep::Position(a) => {
                let own = &placements[a];
                let mut position = own.translation;
                let mut space = DAffine3::IDENTITY;
                for parent in parents.of_mut(a) {
                    parent.find_space(stage, actors);
                    space = parent.world_from_parent;
                    let local = parent.local_placement(own, edits_for_index(&edits.actors, a));
                    position = match space.transform_point3(local.translation) {
                        here if parent.weight >= 1.0 => here,
                        here => position.lerp(here, parent.weight),
                    };
                }
                actors[a].world_from_parent = space;
                actors[a].world_from_model.translation = position;
            }
            PlacementStep::World(a) => {
                let at = actors[a].world_from_model.translation;
                let faced = stage.actors[a].face.and_then(|f| actors.get(f));
                let faced = faced.filter(|_| !root_motion.has_faced(a));
                let way = faced.map(|other| other.world_from_model.translation - at);
                let own = &placements[a];
                let turned = |space: &DAffine3, rotation| match way {
                    Some(way) => rotation_to_face(space, way, stage.actors[a].asset.front()) * rotation,
                    None => rotation,
                };
                let in_space = |space: &DAffine3, local: &Placement| {
                    let rotation = turned(space, local.rotation);
                    *space * DAffine3::from_rotation_translation(rotation, local.translation)
                };
                let all = parents.of(a);
                let mut placed = in_space(&DAffine3::IDENTITY, own);
                for parent in all {
                    let here = in_space(
                        &parent.world_from_parent,
                        &parent.local_placement(own, edits_for_index(&edits.actors, a)),
                    );
                    placed = if parent.weight >= 1.0 {
                        here
                    } else {
                        interpolate_affine(&placed, &here, parent.weight)
                    };
                }
                unscaled[a] = placed;
                actors[a].world_from_model = placed * DAffine3::from_scale(own.scale);
            }
        }
    }
}

/// Computes the kept transforms of actors whose parents have changed before a time. `evaluate` evaluates the stage at the moment of a
/// change, for the actors that the passed buffers name.
pub(crate) fn find_kept_transforms(
    stage: &Stage,
    scratch: &ActorScratch,
    time: Time,
    evaluate: impl Fn(Time, ActorScratch) -> Result<(ActorScratch, Snapshot), StageError>,
) -> Result<(), StageError> {
    let kept = &scratch.kept_transforms;
    // Earlier changes come first, because the transforms that later parents keep depend on them.
    for changes in kept.missing_transforms(stage, time).chunk_by(|a, b| a.0 == b.0) {
        let parent_of = |actor: usize, number: usize| &stage.actors[actor].parents[number];
        let parents = changes.iter().filter_map(|(_, a, n)| Some(parent_of(*a, *n).to?.actor));
        let changed_actors =
            changes.iter().map(|(_, a, _)| *a).chain(parents).filter(|a| *a < stage.actors.len());
        let (kept_transforms, motions) = (kept.clone(), scratch.motions.clone());
        let at_change =
            ActorScratch { kept_transforms, motions, ..ActorScratch::for_actors(changed_actors.collect()) };
        let (at_change, snapshot) = evaluate(changes[0].0, at_change)?;
        for (_, actor, number) in changes {
            let parent = parent_of(*actor, *number);
            let space = |to| world_from_parent(stage, &snapshot.actors, &to, parent.scale);
            let space = parent.to.map_or(DAffine3::IDENTITY, space);
            let Placement { translation, rotation, .. } = at_change.placements[*actor];
            let local = DAffine3::from_rotation_translation(rotation, translation);
            let offset = space.inverse() * at_change.unscaled[*actor] * local.inverse();
            kept.insert(*actor, *number, if offset.is_finite() { offset } else { DAffine3::IDENTITY });
        }
    }
    Ok(())
}
