//! `Stage::at`: from the timeline to a snapshot.
//!
//! In this order: keyed properties, hooks, visibility, which poses are needed at all, poses, places in the world, constraints
//! (planted feet, aims, looks, reaches), places again where a constraint has moved something, springs, lights, camera.

use crate::constraints::foot_lock::FootLocks;
use crate::constraints::solve;
use crate::constraints::solve::ConstraintScratch;
use crate::culling::{Culling, PoseBounds, stands_without_poses};
use crate::framing::Framings;
use crate::pose::PoseScratch;
use crate::pose::motions::Motions;
use crate::pose::posing::Posing;
use crate::root_motion::apply;
use crate::root_motion::apply::RootMotionScratch;
use crate::snapshot::{ActorState, Snapshot};
use crate::springs;
use crate::springs::{Simulation, SpringCheckpoints};
use crate::stage::actor::{Placement, Target};
use crate::stage::camera::Rig;
use crate::stage::edits::{ActorEdit, FrameEdits};
use crate::stage::sky::SkyEdit;
use crate::stage::{Stage, StageError};
use crate::transforms::facing;
use crate::transforms::order;
use crate::transforms::order::{PlacementOrder, PlacementStep};
use crate::transforms::world_from_attachment;
use crate::{camera, effects, layers_2d as layer_2d, lights, pose};
use choreo_motion::Time;
use glam::DAffine3;
use std::sync::{Arc, OnceLock};

impl Stage {
    /// Everything at a time. A stage with no camera is framed as `Rig::Frame`; one with no light of
    /// its own or of its files gets a key sun.
    ///
    /// A function of the time alone: any order, any thread, the same bits. For many frames use an [`Evaluator`], which keeps
    /// its buffers, and what a framing camera has found out, from one to the next.
    ///
    /// ```
    /// # use choreo_asset::*; use choreo_stage::*; use choreo_motion::Time; use std::sync::Arc;
    /// let mut stage = Stage::default();
    /// let anna = stage.cast("anna", Arc::new(Asset::default()));
    /// stage.actors[anna].transform.translation.x = 2.0;
    /// let snapshot = stage.at(Time::from_secs(1.5)).unwrap();
    /// assert_eq!(snapshot.actors[anna].world_from_model.translation.x, 2.0);
    /// ```
    pub fn at(&self, time: Time) -> Result<Snapshot, StageError> {
        let mut snapshot = Snapshot::default();
        evaluate(self, &Memory::new(self), &mut Scratch::default(), time, &mut snapshot)?;
        Ok(snapshot)
    }
}

/// Evaluates one stage at many times without allocating anew. Clones share what a framing camera, planted feet and springs have
/// found out, so one a thread is cheap. None of it changes what comes out.
#[derive(Clone, Debug)]
pub struct Evaluator {
    stage: Arc<Stage>,
    memory: Arc<Memory>,
    scratch: Scratch,
}

/// What has been found out about one stage and holds for every time.
#[derive(Debug)]
struct Memory {
    framings: Framings,
    foot_locks: FootLocks,
    springs: SpringCheckpoints,
    pose_bounds: OnceLock<PoseBounds>,
}

impl Memory {
    fn new(stage: &Stage) -> Memory {
        let (foot_locks, springs) = (FootLocks::default(), SpringCheckpoints::default());
        Memory { framings: Framings::new(stage), foot_locks, springs, pose_bounds: OnceLock::new() }
    }
}

/// How far actors are evaluated.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Evaluation<'a> {
    /// As their clips and callbacks have them.
    Clips,
    /// Poses with their constraints, without springs.
    Constraints(&'a FootLocks),
    /// The same for an image: actors that surely are not visible in it are left out.
    Seen(&'a FootLocks, &'a PoseBounds),
}

impl Evaluator {
    pub fn new(stage: Arc<Stage>) -> Evaluator {
        let memory = Arc::new(Memory::new(&stage));
        let motions = Some(Arc::new(Motions::new(&stage)));
        Evaluator { stage, memory, scratch: Scratch { motions, ..Scratch::default() } }
    }

    pub fn stage(&self) -> &Arc<Stage> {
        &self.stage
    }

    /// The same bits as [`Stage::at`].
    pub fn at(&mut self, time: Time) -> Result<Snapshot, StageError> {
        let mut snapshot = Snapshot::default();
        self.at_into(time, &mut snapshot)?;
        Ok(snapshot)
    }

    /// As `at`, reusing a snapshot's memory. After an error the snapshot is half filled.
    pub fn at_into(&mut self, time: Time, snapshot: &mut Snapshot) -> Result<(), StageError> {
        evaluate(&self.stage, &self.memory, &mut self.scratch, time, snapshot)
    }

    /// Hidden actors are posed too: for tools that look at joints and not at pictures. What is seen does not change by it.
    pub fn posing_hidden(mut self) -> Evaluator {
        self.scratch.pose_hidden = true;
        self
    }

    /// An evaluator for images of the stage's own camera with this aspect ratio: actors that surely are neither visible in them nor cast a
    /// visible shadow are not posed, and marked as [`ActorState::out_of_view`]. The images do not change by it.
    pub fn for_images(mut self, aspect: f64) -> Evaluator {
        self.scratch.aspect = Some(aspect);
        self
    }

    /// What the callbacks changed at the last evaluation.
    pub(crate) fn edits(&self) -> &FrameEdits {
        &self.scratch.edits
    }

    /// How many poses the last evaluation took.
    pub fn poses(&self) -> usize {
        self.scratch.poses
    }

    /// How many poses this evaluator has taken since it was made, those of earlier times for springs included.
    pub fn total_poses(&self) -> usize {
        self.scratch.all_poses + self.scratch.simulation.poses()
    }
}

/// Buffers of one stage; what is in them on entry does not matter.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    /// Found out at the first evaluation.
    motions: Option<Arc<Motions>>,
    root_motion: RootMotionScratch,
    order: PlacementOrder,
    /// One for each part that a thread poses.
    pose: Vec<PoseScratch>,
    placements: Vec<Placement>,
    /// World frame that an actor's placement is in.
    world_from_parent: Vec<DAffine3>,
    needs: Vec<PoseNeed>,
    work: Vec<usize>,
    /// (actor, place in `edits.actors`) of edits that change poses, sorted.
    pose_edits: Vec<(usize, usize)>,
    pub(crate) edits: FrameEdits,
    constraints: ConstraintScratch,
    simulation: Simulation,
    carried: Vec<usize>,
    poses: usize,
    all_poses: usize,
    pose_hidden: bool,
    /// The camera whose targets must be known.
    seen_by: Option<usize>,
    /// Aspect ratio, if nothing but images is asked for.
    aspect: Option<f64>,
    /// Whether each actor is out of view.
    culled: Vec<bool>,
    /// If given, only these actors and those that they are attached to are posed.
    only: Option<Vec<usize>>,
}

impl Scratch {
    pub(crate) fn all_poses(&self) -> usize {
        self.all_poses
    }

    pub(crate) fn only(actors: Vec<usize>) -> Scratch {
        Scratch { only: Some(actors), ..Scratch::default() }
    }

    /// As [`Scratch::only`], from now on.
    pub(crate) fn look_only_at(&mut self, actors: &[usize]) {
        let only = self.only.get_or_insert_default();
        only.clear();
        only.extend_from_slice(actors);
    }

    /// Places all actors of the last evaluation anew, after joints have moved that others hang on.
    pub(crate) fn place_again(&mut self, stage: &Stage, actors: &mut [ActorState]) {
        place_actors(stage, self, actors);
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PoseNeed {
    /// Its place in the world counts for something.
    world: bool,
    pub(crate) pose: bool,
}

fn evaluate(
    stage: &Stage,
    memory: &Memory,
    scratch: &mut Scratch,
    time: Time,
    out: &mut Snapshot,
) -> Result<(), StageError> {
    let camera = camera::on_at(stage, time);
    let Memory { framings, foot_locks, springs, pose_bounds } = memory;
    scratch.seen_by = camera;
    let how = match scratch.aspect.is_some() && stands_without_poses(stage, camera) {
        true => Evaluation::Seen(foot_locks, pose_bounds.get_or_init(|| PoseBounds::new(stage))),
        false => Evaluation::Constraints(foot_locks),
    };
    evaluate_actors(stage, scratch, time, how, out)?;
    swing(stage, foot_locks, springs, scratch, time, &mut out.actors)?;
    out.time = time;
    out.background = stage.settings.background;
    let ambient = (stage.settings.ambient_up, stage.settings.ambient_down);
    (out.ambient_up, out.ambient_down) = scratch.edits.ambient.unwrap_or(ambient);
    effects::evaluate(stage, &scratch.edits, time, camera, &mut out.effects);
    layer_2d::evaluate(stage, &scratch.edits.layers_2d, time, &mut out.layers_2d);
    out.sky = stage.sky.as_ref().map(|sky| sky.at(&scratch.edits, time));
    lights::evaluate(stage, &scratch.edits, time, &out.actors, &mut out.lights);
    out.camera = camera::evaluate(stage, framings, &scratch.edits, time, camera, &out.actors)?;
    Ok(())
}

/// The springs of actors that have done everything else. Costs nothing where there are none.
fn swing(
    stage: &Stage,
    foot_locks: &FootLocks,
    kept: &SpringCheckpoints,
    scratch: &mut Scratch,
    time: Time,
    actors: &mut [ActorState],
) -> Result<(), StageError> {
    if stage.actors.iter().all(|a| a.springs.is_none()) {
        return Ok(());
    }
    let mut carried = std::mem::take(&mut scratch.carried);
    carried.clear();
    carried.extend(scratch.order.steps.iter().filter_map(|step| match step {
        PlacementStep::World(actor) => Some(*actor),
        PlacementStep::Position(_) => None,
    }));
    let mut simulation = std::mem::take(&mut scratch.simulation);
    let edits = std::mem::take(&mut scratch.edits.actors);
    let place = |actors: &mut [ActorState]| place_actors(stage, scratch, actors);
    let done = springs::run(stage, foot_locks, kept, &mut simulation, time, &edits, &carried, actors, place);
    (scratch.simulation, scratch.carried, scratch.edits.actors) = (simulation, carried, edits);
    done
}

/// All of the snapshot's actors, but for their springs.
pub(crate) fn evaluate_actors(
    stage: &Stage,
    scratch: &mut Scratch,
    time: Time,
    how: Evaluation,
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
    cull(stage, scratch, time, how, &mut out.actors);
    find_needs(stage, scratch, time, &out.actors);
    let Scratch { pose, needs, pose_edits, edits, constraints, .. } = scratch;
    let posing = Posing { time, motions: &motions, needs, pose_edits, edits: &edits.actors };
    scratch.poses = posing.run(&stage.actors, &mut out.actors, pose, &mut constraints.expression_weights);
    scratch.all_poses += scratch.poses;
    place_actors(stage, scratch, &mut out.actors);
    if let Evaluation::Constraints(foot_locks) | Evaluation::Seen(foot_locks, _) = how {
        let mut constraints = std::mem::take(&mut scratch.constraints);
        let place = |actors: &mut [ActorState]| place_actors(stage, scratch, actors);
        let done = solve::run(stage, foot_locks, time, &mut constraints, &mut out.actors, place);
        scratch.constraints = constraints;
        done?;
    }
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

fn cull(stage: &Stage, scratch: &mut Scratch, time: Time, how: Evaluation, actors: &mut [ActorState]) {
    let mut out = std::mem::take(&mut scratch.culled);
    out.clear();
    if let (Evaluation::Seen(_, pose_bounds), Some(aspect)) = (how, scratch.aspect) {
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
