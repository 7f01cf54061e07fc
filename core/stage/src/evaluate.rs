//! Evaluates a stage at a time into a snapshot (`Stage::at`).
//!
//! Steps in order: keyed properties, callbacks, visibility, selection of the poses that are needed, poses, world transforms, constraints (foot
//! locks, aims, looks, reaches), world transforms again if a constraint has moved something, springs, lights, camera.

use crate::constraints::foot_lock_cache::FootLocks;
use crate::constraints::{self, ConstrainedScratch};
use crate::culling::{PoseBounds, is_independent_of_poses};
use crate::framing::FramingCache;
use crate::pose::motions::Motions;
use crate::snapshot::{ActorState, Dissolve, LightState, Snapshot};
use crate::springs::{self, SpringCheckpoints, SpringSimulation};
use crate::stage::actor::Actor;
use crate::stage::edits::FrameEdits;
use crate::stage::{Stage, StageError};
use crate::{actors, camera, effects, layers_2d, lights};
use choreo_motion::Time;
use std::sync::{Arc, OnceLock};

impl Stage {
    /// Evaluates the stage at a time. A stage without a camera is framed as by `Rig::Frame`. A stage without a sky, and without lights of
    /// its own or of its files, gets a default sun.
    ///
    /// The result depends on the time alone: any order of calls and any thread give the same bits. For many frames use an [`Evaluator`],
    /// which keeps its buffers and the results of framing from frame to frame.
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
        evaluate_stage(self, &StageCache::new(self), &mut Scratch::default(), time, &mut snapshot)?;
        Ok(snapshot)
    }
}

/// Evaluates one stage at many times and reuses its buffers. Clones share the results of framing, foot locking and springs, so that one
/// clone per thread is cheap. Sharing does not change the snapshots.
#[derive(Clone, Debug)]
pub struct Evaluator {
    stage: Arc<Stage>,
    cache: Arc<StageCache>,
    scratch: Scratch,
}

/// CPU work for one snapshot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EvaluationCosts {
    /// Actors whose joints are posed.
    pub poses: usize,
    /// Active constraints and look-ats of posed actors.
    pub constraints: usize,
    /// Spring bones that are simulated.
    pub spring_bones: usize,
}

/// Cached results about one stage that hold for every time; each is computed when it is first needed.
#[derive(Debug)]
struct StageCache {
    framings: FramingCache,
    foot_locks: FootLocks,
    springs: SpringCheckpoints,
    pose_bounds: OnceLock<PoseBounds>,
}

impl StageCache {
    fn new(stage: &Stage) -> StageCache {
        let (foot_locks, springs) = (FootLocks::default(), SpringCheckpoints::default());
        StageCache {
            framings: FramingCache::new(stage, foot_locks.clone()),
            foot_locks,
            springs,
            pose_bounds: OnceLock::new(),
        }
    }
}

/// Reusable buffers for one stage.
#[derive(Clone, Debug, Default)]
struct Scratch {
    constrained: ConstrainedScratch,
    simulation: SpringSimulation,
}

impl Evaluator {
    /// An evaluator of a stage; results about the whole stage are computed when they are first needed.
    pub fn new(stage: Arc<Stage>) -> Evaluator {
        let cache = Arc::new(StageCache::new(&stage));
        let motions = Some(Arc::new(Motions::new(&stage)));
        let mut scratch = Scratch::default();
        scratch.constrained.actors.motions = motions;
        Evaluator { stage, cache, scratch }
    }

    /// The stage that it evaluates.
    pub fn stage(&self) -> &Arc<Stage> {
        &self.stage
    }

    /// Evaluates the stage at a time, with the same bits as [`Stage::at`].
    pub fn at(&mut self, time: Time) -> Result<Snapshot, StageError> {
        let mut snapshot = Snapshot::default();
        self.at_into(time, &mut snapshot)?;
        Ok(snapshot)
    }

    /// Evaluates the stage as [`Evaluator::at`] does, reusing the memory of a snapshot. After an error the snapshot is incomplete.
    pub fn at_into(&mut self, time: Time, snapshot: &mut Snapshot) -> Result<(), StageError> {
        evaluate_stage(&self.stage, &self.cache, &mut self.scratch, time, snapshot)
    }

    /// Poses hidden actors, too, for tools that need joints instead of images. The images do not change.
    pub fn posing_hidden(mut self) -> Evaluator {
        self.scratch.constrained.actors.pose_hidden = true;
        self
    }

    /// An evaluator for images of the stage's own camera with this aspect ratio (width / height): actors that certainly are neither visible
    /// in them nor cast a visible shadow are not posed, and are marked with `ActorState::culled`. The images do not change.
    pub fn for_images(mut self, aspect: f64) -> Evaluator {
        self.scratch.constrained.actors.aspect = Some(aspect);
        self
    }

    /// Changes that callbacks have made in the last evaluation.
    pub(crate) fn edits(&self) -> &FrameEdits {
        &self.scratch.constrained.actors.edits
    }

    /// States of the stage's own lights at the time of this evaluator's last snapshot, by index; `None`: the light does not shine.
    pub fn stage_lights(&self, snapshot: &Snapshot) -> Vec<Option<LightState>> {
        let (stage, edits, time) = (&self.stage, self.edits(), snapshot.time);
        let lights = stage.lights.iter().enumerate();
        lights
            .map(|(index, light)| lights::stage_light(stage, light, index, edits, time, &snapshot.actors))
            .collect()
    }

    /// Number of poses that the last evaluation computed.
    pub fn poses(&self) -> usize {
        self.scratch.constrained.actors.pose_count
    }

    /// CPU work for a snapshot of this evaluator's stage; `poses` and `spring_bones` are those of the last evaluation.
    pub fn costs(&self, snapshot: &Snapshot) -> EvaluationCosts {
        let posed = |(actor, state): &(&Actor, &ActorState)| {
            !state.model_from_joint.is_empty() && state.model_from_joint.len() == actor.asset.skeleton.len()
        };
        let spring_bones = self.scratch.simulation.bone_count();
        let mut costs = EvaluationCosts { poses: self.poses(), constraints: 0, spring_bones };
        for (actor, _) in self.stage.actors.iter().zip(&snapshot.actors).filter(posed) {
            let solved = actor.constraints.iter().filter(|c| c.weight_at(snapshot.time) > 0.0).count();
            let looks = actor.look_at.iter().filter(|look| look.weight_at(snapshot.time) > 0.0).count();
            costs.constraints += solved + looks;
        }
        costs
    }

    /// Number of poses that this evaluator has computed so far, including poses at earlier times for springs.
    pub fn total_poses(&self) -> usize {
        self.scratch.constrained.actors.total_pose_count + self.scratch.simulation.pose_count()
    }
}

fn evaluate_stage(
    stage: &Stage,
    cache: &StageCache,
    scratch: &mut Scratch,
    time: Time,
    out: &mut Snapshot,
) -> Result<(), StageError> {
    let camera = camera::active_camera_at(stage, time);
    let StageCache { framings, foot_locks, springs, pose_bounds } = cache;
    let Scratch { constrained, simulation } = scratch;
    let actors = &mut constrained.actors;
    let dissolving = camera::dissolving_at(stage, time);
    actors.view_cameras = [camera, dissolving.map(|(before, _)| before)];
    let cull = actors.aspect.is_some() && dissolving.is_none() && is_independent_of_poses(stage, camera);
    let bounds = cull.then(|| pose_bounds.get_or_init(|| PoseBounds::new(stage)));
    find_kept_transforms(stage, cache, constrained, time)?;
    constraints::evaluate_actors(stage, constrained, time, foot_locks, bounds, out)?;
    let scratch = &mut constrained.actors;
    springs::simulate_springs(stage, foot_locks, springs, simulation, time, scratch, &mut out.actors)?;
    out.time = time;
    out.background = stage.settings.background;
    let ambient = (stage.settings.ambient_up, stage.settings.ambient_down);
    (out.ambient_up, out.ambient_down) = scratch.edits.ambient.unwrap_or(ambient);
    layers_2d::evaluate_layers_2d(stage, &scratch.edits.layers_2d, time, &mut out.layers_2d);
    out.sky = stage.sky.as_ref().map(|sky| sky.at(&scratch.edits, time));
    lights::evaluate_lights(stage, &scratch.edits, time, &out.actors, &mut out.lights);
    let frame = |index, azimuth, elevation, projection| {
        framings.frame_camera(stage, index, azimuth, elevation, projection)
    };
    out.camera = camera::evaluate_camera(stage, frame, &scratch.edits, time, camera, &out.actors)?;
    effects::evaluate_effects(stage, &scratch.edits, time, &out.camera, &out.actors, &mut out.effects);
    out.dissolve = None;
    if let Some((before, share)) = dissolving {
        let camera = camera::evaluate_camera(stage, frame, &scratch.edits, time, Some(before), &out.actors)?;
        let mut effects = Vec::new();
        effects::evaluate_effects(stage, &scratch.edits, time, &camera, &out.actors, &mut effects);
        out.dissolve = Some(Dissolve { camera, effects, share });
    }
    Ok(())
}

/// Computes the kept transforms of actors whose parents have changed before a time, with constraints and springs.
fn find_kept_transforms(
    stage: &Stage,
    cache: &StageCache,
    scratch: &ConstrainedScratch,
    time: Time,
) -> Result<(), StageError> {
    let StageCache { foot_locks, springs, .. } = cache;
    actors::find_kept_transforms(stage, &scratch.actors, time, |time, actors| {
        let (mut scratch, mut snapshot) = (ConstrainedScratch::of(actors), Snapshot::default());
        constraints::evaluate_actors(stage, &mut scratch, time, foot_locks, None, &mut snapshot)?;
        let (actors, mut simulation) = (&mut scratch.actors, SpringSimulation::default());
        springs::simulate_springs(
            stage,
            foot_locks,
            springs,
            &mut simulation,
            time,
            actors,
            &mut snapshot.actors,
        )?;
        Ok((scratch.actors, snapshot))
    })
}
