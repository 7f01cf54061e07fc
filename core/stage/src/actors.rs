//! Evaluation of actors from keyed properties, hooks and clips: everything before constraints.
//!
//! In this order: keyed properties, hooks, root motion, visibility, culling, which poses are needed at all, poses, transforms.

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
use crate::stage::edits::{ActorEdit, FrameEdits};
use crate::stage::sky::SkyEdit;
use crate::stage::{Stage, StageError};
use crate::transforms::facing;
use crate::transforms::order;
use crate::transforms::order::{PlacementOrder, PlacementStep};
use crate::transforms::world_from_attachment;
use crate::{camera, pose};
use choreo_motion::Time;
use glam::DAffine3;
use std::sync::Arc;

/// Buffers of one stage; what is in them on entry does not matter.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    /// Found out at the first evaluation.
    pub motions: Option<Arc<Motions>>,
    root_motion: RootMotionScratch,
    pub order: PlacementOrder,
    /// One for each part that a thread poses.
    pose: Vec<PoseScratch>,
    placements: Vec<Placement>,
    /// World frame that an actor's placement is in.
    world_from_parent: Vec<DAffine3>,
    needs: Vec<PoseNeed>,
    work: Vec<usize>,
    /// (actor, place in `edits.actors`) of edits that change poses, sorted.
    pose_edits: Vec<(usize, usize)>,
    pub edits: FrameEdits,
    /// Expressions of the actors whose eyes move.
    pub expression_weights: Vec<ExpressionWeights>,
    pub poses: usize,
    pub all_poses: usize,
    pub pose_hidden: bool,
    /// The camera whose targets must be known.
    pub seen_by: Option<usize>,
    /// Aspect ratio, if nothing but images is asked for.
    pub aspect: Option<f64>,
    /// Whether each actor is out of view.
    culled: Vec<bool>,
    /// If given, only these actors and those that they are attached to are posed.
    only: Option<Vec<usize>>,
}

impl Scratch {
    pub fn only(actors: Vec<usize>) -> Scratch {
        Scratch { only: Some(actors), ..Scratch::default() }
    }

    /// As [`Scratch::only`], from now on.
    pub fn look_only_at(&mut self, actors: &[usize]) {
        let only = self.only.get_or_insert_default();
        only.clear();
        only.extend_from_slice(actors);
    }

    /// Places all actors of the last evaluation anew, after joints have moved that others are attached to.
    pub fn place(&mut self, stage: &Stage, actors: &mut [ActorState]) {
        place_actors(stage, self, actors);
    }
}

/// All of the snapshot's actors, without constraints and springs. `bounds`: leaves out actors that are surely not in the image.
pub(crate) fn evaluate_actors(
    stage: &Stage,
    scratch: &mut Scratch,
    time: Time,
    bounds: Option<&PoseBounds>,
    out: &mut Snapshot,
) -> Result<(), StageError> {
    order::find(stage, &mut scratch.order)?;
    out.actors.truncate(stage.actors.len());
    out.actors.resize_with(stage.actors.len(), ActorState::default);
    scratch.placements.clear();
    for (actor, state) in stage.actors.iter().zip(&mut out.actors) {
        scratch.placements.push(pose::keyed_placement(actor, time, state));
    }
    run_hooks(stage, scratch, time, &mut out.actors)?;
    let motions = scratch.motions.get_or_insert_with(|| Arc::new(Motions::new(stage))).clone();
    apply::apply(stage, &motions.root_motion, time, &mut scratch.root_motion, &mut scratch.placements);
    for step in &scratch.order.steps {
        // Parents come first.
        if let PlacementStep::Position(a) = *step
            && let Some(parent) = stage.actors[a].parent
        {
            out.actors[a].visible &= out.actors.get(parent.actor).is_none_or(|p| p.visible);
        }
    }
    cull(stage, scratch, time, bounds, &mut out.actors);
    find_needs(stage, scratch, time, &out.actors);
    let Scratch { pose, needs, pose_edits, edits, expression_weights, .. } = scratch;
    let posing = Posing { time, motions: &motions, needs, pose_edits, edits: &edits.actors };
    scratch.poses = posing.run(&stage.actors, &mut out.actors, pose, expression_weights);
    scratch.all_poses += scratch.poses;
    place_actors(stage, scratch, &mut out.actors);
    Ok(())
}

fn run_hooks(
    stage: &Stage,
    scratch: &mut Scratch,
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
    for hook in &stage.hooks {
        hook.run(time, edits)?;
    }
    scratch.pose_edits.clear();
    for (place, edit) in scratch.edits.actors.iter().enumerate() {
        let index = edit.actor();
        let (Some(placement), Some(state)) = (scratch.placements.get_mut(index), actors.get_mut(index))
        else {
            continue;
        };
        match *edit {
            ActorEdit::MoveTo { translation, .. } => placement.translation = translation,
            ActorEdit::MoveBy { offset, .. } => placement.translation += offset,
            ActorEdit::Turn { rotation, .. } => {
                placement.rotation = (rotation * placement.rotation).normalize();
            }
            ActorEdit::Scale { factor, .. } => placement.scale *= factor,
            ActorEdit::Visible { visible, .. } => state.visible = visible,
            ActorEdit::Tint { tint, .. } => state.tint = tint,
            ActorEdit::LineWidth { width, .. } => state.line_width = Some(width),
            ActorEdit::Copies { count, .. } => state.copies = Some(count),
            ActorEdit::Morph { .. } | ActorEdit::Expression { .. } | ActorEdit::TurnJoint { .. } => {
                scratch.pose_edits.push((index, place))
            }
            ActorEdit::Wind { .. } => {}
        }
    }
    scratch.pose_edits.sort_unstable();
    Ok(())
}

fn cull(
    stage: &Stage,
    scratch: &mut Scratch,
    time: Time,
    bounds: Option<&PoseBounds>,
    actors: &mut [ActorState],
) {
    let mut out = std::mem::take(&mut scratch.culled);
    out.clear();
    if let (Some(pose_bounds), Some(aspect)) = (bounds, scratch.aspect) {
        // What hangs on joints is not asked for; the others are where they will be.
        place_actors(stage, scratch, actors);
        let Scratch { edits, order, seen_by, .. } = &*scratch;
        let camera = camera::by_places(stage, edits, time, *seen_by, actors);
        Culling { stage, pose_bounds, camera, aspect, edits, time, order: &order.steps, actors }
            .run(&mut out);
    }
    for (index, state) in actors.iter_mut().enumerate() {
        state.culled = out.get(index).is_some_and(|out| *out);
    }
    scratch.culled = out;
}

/// An invisible actor is posed only where something visible, the camera, a light or a look-at hangs on one of its joints,
/// or where all are asked for.
fn find_needs(stage: &Stage, scratch: &mut Scratch, time: Time, actors: &[ActorState]) {
    let camera = scratch.seen_by;
    let (needs, work) = (&mut scratch.needs, &mut scratch.work);
    needs.clear();
    needs.resize(stage.actors.len(), PoseNeed::default());
    work.clear();
    let mut want = |work: &mut Vec<usize>, actor: usize, pose: bool| {
        if let Some(need) = needs.get_mut(actor) {
            let before = *need;
            *need = PoseNeed { world: true, pose: need.pose || pose };
            if *need != before {
                work.push(actor);
            }
        }
    };
    let want_target = |target: &Target| match *target {
        Target::Point(_) => None,
        Target::Actor(actor) => Some((actor, false)),
        Target::Joint { actor, .. } => Some((actor, true)),
    };
    if let Some(only) = &scratch.only {
        only.iter().for_each(|actor| want(work, *actor, true));
    } else {
        for (index, state) in actors.iter().enumerate() {
            if (state.visible && !state.culled) || scratch.pose_hidden {
                want(work, index, true);
            }
        }
    }
    let lights = if scratch.only.is_none() { &stage.lights[..] } else { &[] };
    for parent in lights.iter().filter_map(|light| light.parent) {
        want(work, parent.actor, parent.joint.is_some());
    }
    if let Some(camera) = camera.and_then(|c| stage.cameras.get(c)) {
        let target = match &camera.rig {
            Rig::Fixed { look_at, .. } => look_at.as_ref().and_then(want_target),
            Rig::Follow { target, .. } | Rig::Orbit { target, .. } => want_target(target),
            Rig::File { actor, .. } => Some((*actor, true)),
            Rig::Frame { .. } => None,
        };
        if let Some((actor, pose)) = target {
            want(work, actor, pose);
        }
    }
    while let Some(index) = work.pop() {
        let actor = &stage.actors[index];
        if let Some(parent) = actor.parent {
            want(work, parent.actor, parent.joint.is_some());
        }
        if let Some(face) = actor.face {
            want(work, face, false);
        }
        for look in &actor.look_at {
            if look.share(time) > 0.0
                && let Some((actor, pose)) = want_target(&look.target)
            {
                want(work, actor, pose);
            }
        }
        for constraint in actor.constraints.iter().filter(|g| g.share(time) > 0.0) {
            for (actor, pose) in constraint.targets().filter_map(|t| want_target(&t)) {
                want(work, actor, pose);
            }
        }
    }
}

fn place_actors(stage: &Stage, scratch: &mut Scratch, actors: &mut [ActorState]) {
    scratch.world_from_parent.clear();
    scratch.world_from_parent.resize(actors.len(), DAffine3::IDENTITY);
    for step in &scratch.order.steps {
        match *step {
            PlacementStep::Position(a) => {
                let frame = stage.actors[a].parent.map(|p| world_from_attachment(stage, actors, &p));
                let frame = frame.unwrap_or(DAffine3::IDENTITY);
                scratch.world_from_parent[a] = frame;
                actors[a].world_from_model.translation =
                    frame.transform_point3(scratch.placements[a].translation);
            }
            PlacementStep::World(a) => {
                let frame = scratch.world_from_parent[a];
                let Placement { translation, mut rotation, scale } = scratch.placements[a];
                if let Some(other) = stage.actors[a]
                    .face
                    .and_then(|f| actors.get(f))
                    .filter(|_| !scratch.root_motion.has_faced(a))
                {
                    let way = other.world_from_model.translation - actors[a].world_from_model.translation;
                    rotation = facing(&frame, way) * rotation;
                }
                let parent_from_model =
                    DAffine3::from_scale_rotation_translation(scale, rotation, translation);
                actors[a].world_from_model = frame * parent_from_model;
            }
        }
    }
}
