//! Springs of all actors at a time: a simulation that any frame can be had from first.
//!
//! The motion advances in steps of 1/60 s ([`SolverSettings::spring_rate`]), whatever the frame rate. The grid of steps begins at time 0
//! (or a pre-roll earlier) with springs at rest. A frame between two points of the grid is one shorter step further, on a copy. So the
//! state at a point is a function of the stage alone. One state in every N steps is kept, shared by all evaluators of a stage. A seek
//! continues from the nearest one before it; kept states change how long that takes, and nothing else.
//!
//! **What a seek costs.** Without anything kept, 60 poses of the actors that have springs for each second from the start; later at most
//! as many as lie between two kept states (16, more once they would take 32 MiB). Springs remember ten minutes: in each stretch of [`STRETCH`]
//! seconds the motion begins anew, settled, a minute before it, so that 100 hours into a stage cost no more than 11 minutes. A stage with a
//! spring of which that minute would leave more than a millionth of a swing ([`FORGETS`]), as of an undamped one, is one stretch.

use crate::actors;
use crate::constraints::foot_locks::FootLocks;
use crate::constraints::{ConstrainedScratch, evaluate_actors};
use crate::snapshot::{ActorState, Snapshot};
use crate::stage::edits::ActorEdit;
use crate::stage::{Stage, StageError};
use crate::transforms::order::PlacementStep;
use choreo_motion::Time;
use choreo_motion::spring::{RigBone, SpringScratch, SpringState, SpringStep};
use glam::DVec3;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Seconds after which the motion begins anew, and how many before that it does.
const STRETCH: i64 = 600;
const WARM_UP: i64 = 60;
/// Least decay rate of springs that forget within [`WARM_UP`], 1/s: ln 10⁶ / 60 s.
const FORGETS: f64 = 13.82 / 60.0;
/// Most steps between two kept states.
const MOST_STRIDE: i64 = 36_000;
/// Bytes of states that are kept.
const MOST_BYTES: usize = 32 << 20;

/// A point of the grid, in a stretch.
type Key = (i64, i64);
/// One for each actor with springs.
type States = Vec<SpringState>;

/// States that were passed, shared by all evaluators of a stage.
#[derive(Debug, Default)]
pub(crate) struct SpringCheckpoints(Mutex<Checkpoints>);

#[derive(Debug)]
struct Checkpoints {
    /// Number of steps between states that are kept; doubled whenever they take too much memory.
    stride: i64,
    states: BTreeMap<Key, Arc<States>>,
    bytes: usize,
}

impl Default for Checkpoints {
    fn default() -> Self {
        Checkpoints { stride: 16, states: BTreeMap::new(), bytes: 0 }
    }
}

impl SpringCheckpoints {
    /// The last state kept in a stretch, at a step or before, since its first.
    fn before(&self, (stretch, step): Key, first: i64) -> Option<(i64, Arc<States>)> {
        let kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let found = kept.states.range((stretch, first)..=(stretch, step)).next_back();
        found.map(|((_, step), states)| (*step, states.clone()))
    }

    fn keep(&self, key: Key, states: &States) {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if key.1.rem_euclid(kept.stride) != 0 || kept.states.contains_key(&key) {
            return;
        }
        let size = |states: &States| states.iter().map(SpringState::size).sum::<usize>() + 128;
        kept.bytes += size(states);
        kept.states.insert(key, Arc::new(states.clone()));
        while kept.bytes > MOST_BYTES && kept.stride < MOST_STRIDE {
            kept.stride *= 2;
            let stride = kept.stride;
            kept.states.retain(|(_, step), _| step.rem_euclid(stride) == 0);
            kept.bytes = kept.states.values().map(|s| size(s)).sum();
        }
        // Stretch after stretch: the oldest go.
        while kept.bytes > MOST_BYTES {
            let Some((_, gone)) = kept.states.pop_first() else { break };
            kept.bytes -= size(&gone);
        }
    }
}

/// State of the simulation of one evaluator, and buffers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Simulation {
    /// Actors with springs.
    actors: Vec<usize>,
    at: Option<Key>,
    states: States,
    shown: States,
    scratch: Option<Box<ConstrainedScratch>>,
    snapshot: Snapshot,
    buffers: SpringScratch,
}

impl Simulation {
    /// Poses taken for steps of the grid.
    pub fn poses(&self) -> usize {
        self.scratch.as_ref().map_or(0, |s| s.actors.all_poses)
    }
}

fn time_of(stage: &Stage, step: i64) -> Time {
    Time(step.saturating_mul(stage.solvers.spring_step().0))
}

/// The stretch that a step is in, and the step at which that begins to be simulated.
fn stretch_of(stage: &Stage, step: i64) -> (i64, i64) {
    let springs = || stage.actors.iter().filter_map(|a| a.springs.as_ref());
    let pre_roll = springs().map(|s| s.pre_roll).max();
    let pre_roll = pre_roll.unwrap_or(Time::ZERO).0.clamp(0, STRETCH * Time::TICKS_PER_SECOND);
    let (rate, length) = (stage.solvers.spring_rate, stage.solvers.spring_step().0);
    let first = -(pre_roll + length - 1).div_euclid(length);
    let forgets = |bone: &RigBone| {
        let length = f64::from(bone.tail.length()).max(f64::MIN_POSITIVE);
        bone.spring.decay_rate(bone.pull.length() + bone.gravity.length() / length) >= FORGETS
    };
    let forgotten = springs().all(|springs| springs.rig.bones().iter().all(forgets));
    let stretch = if forgotten { step.div_euclid(STRETCH * rate).max(0) } else { 0 };
    (stretch, if stretch == 0 { first.min(step) } else { (stretch * STRETCH - WARM_UP) * rate })
}

/// Turns the joints of all springs in a snapshot whose actors are posed, placed and have done their constraints. All actors are
/// placed anew after joints have moved that others are attached to.
pub(crate) fn run(
    stage: &Stage,
    foot_locks: &FootLocks,
    kept: &SpringCheckpoints,
    simulation: &mut Simulation,
    time: Time,
    scratch: &mut actors::Scratch,
    actors: &mut [ActorState],
) -> Result<(), StageError> {
    simulation.actors.clear();
    let springy = |a: &&usize| stage.actors[**a].springs.as_ref().is_some_and(|s| !s.rig.is_empty());
    // Parents come first.
    let placed = scratch.order.steps.iter().filter_map(|step| match step {
        PlacementStep::World(actor) => Some(actor),
        PlacementStep::Position(_) => None,
    });
    simulation.actors.extend(placed.filter(springy));
    if simulation.actors.is_empty() {
        return Ok(());
    }
    let step = time.0.div_euclid(stage.solvers.spring_step().0);
    advance(stage, foot_locks, kept, simulation, step, scratch)?;
    let rest = Time(time.0 - time_of(stage, step).0);
    simulation.shown.resize_with(simulation.states.len(), SpringState::default);
    for (shown, state) in simulation.shown.iter_mut().zip(&simulation.states) {
        shown.copy_from(state);
    }
    let Simulation { actors: springy, shown, buffers, .. } = simulation;
    swing(stage, springy, shown, buffers, rest, scratch, actors);
    Ok(())
}

/// Brings the simulation to a point of the grid. `shared`: knows the transforms that are kept where parents change.
fn advance(
    stage: &Stage,
    foot_locks: &FootLocks,
    kept: &SpringCheckpoints,
    simulation: &mut Simulation,
    step: i64,
    shared: &actors::Scratch,
) -> Result<(), StageError> {
    let (stretch, first) = stretch_of(stage, step);
    let mut at = simulation.at.filter(|at| at.0 == stretch && (first..=step).contains(&at.1)).map(|at| at.1);
    if at != Some(step)
        && let Some((kept_at, states)) = kept.before((stretch, step), first)
        && at.is_none_or(|at| at < kept_at)
    {
        at = Some(kept_at);
        // The states are copied into existing memory, because a clone of each would allocate.
        simulation.states.resize_with(states.len(), SpringState::default);
        simulation.states.iter_mut().zip(states.iter()).for_each(|(own, kept)| own.copy_from(kept));
    }
    // The state is invalid until the loop ends, in case a callback fails.
    simulation.at = None;
    let mut scratch = simulation.scratch.take().unwrap_or_default();
    scratch.actors.kept_transforms = shared.kept_transforms.clone();
    let mut from = at.map_or(first, |at| at + 1);
    if at.is_none() {
        simulation.states.clear();
        simulation.states.resize_with(simulation.actors.len(), SpringState::default);
    }
    while from <= step {
        scratch.actors.look_only_at(&simulation.actors);
        evaluate_actors(
            stage,
            &mut scratch,
            time_of(stage, from),
            foot_locks,
            None,
            &mut simulation.snapshot,
        )?;
        let Simulation { actors, states, buffers, snapshot, .. } = simulation;
        let scratch = &mut scratch.actors;
        swing(stage, actors, states, buffers, stage.solvers.spring_step(), scratch, &mut snapshot.actors);
        kept.keep((stretch, from), &simulation.states);
        from += 1;
    }
    simulation.scratch = Some(scratch);
    simulation.at = Some((stretch, step));
    Ok(())
}

/// One step of all springs, parents before what is attached to them.
fn swing(
    stage: &Stage,
    springy: &[usize],
    states: &mut States,
    buffers: &mut SpringScratch,
    by: Time,
    scratch: &mut actors::Scratch,
    actors: &mut [ActorState],
) {
    for (&index, state) in springy.iter().zip(states) {
        let actor = &stage.actors[index];
        let Some(springs) = &actor.springs else { continue };
        let placed = &mut actors[index];
        // Hidden actors are not posed; nothing shows.
        if placed.model_from_joint.len() != actor.asset.skeleton.len() {
            continue;
        }
        SpringStep {
            rig: &springs.rig,
            skeleton: &actor.asset.skeleton,
            world_from_model: placed.world_from_model,
            wind: wind(&scratch.edits.actors, index).unwrap_or(springs.wind),
            seconds: by.as_secs(),
            state,
            scratch: buffers,
            model_from_joint: &mut placed.model_from_joint,
        }
        .run();
        if scratch.parents.has_on_joints(index) {
            scratch.place(stage, actors);
        }
    }
}

/// The wind that a callback has set last.
fn wind(edits: &[ActorEdit], of: usize) -> Option<DVec3> {
    edits.iter().rev().find_map(|edit| match edit {
        ActorEdit::Wind { actor, wind } if *actor == of => Some(*wind),
        _ => None,
    })
}
