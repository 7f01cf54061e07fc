//! Spring simulation of all actors, in which frames can be evaluated in any order.
//!
//! The motion advances in steps of 1/60 s ([`SolverSettings::spring_rate`]), whatever the frame rate. The grid of steps begins at time 0
//! (or a pre-roll earlier) with springs at rest. A frame between two grid points takes one shorter step on a copy of the states, so the
//! state at a grid point is a function of the stage alone. Every Nth state is kept as a checkpoint, shared by all evaluators of a stage. A
//! seek continues from the nearest checkpoint before it; checkpoints change the run time and nothing else.
//!
//! **Which actors.** Only actors whose joints the snapshot needs, with all actors that they can be attached to or can face, at any time:
//! such a group ([`SpringGroup`]) is simulated as a whole. A group that was not needed stays at its last state, and catches up from there or from
//! a checkpoint; its state at a grid point is the same either way. If a callback attaches actors of two groups, all actors become one
//! group.
//!
//! **Cost of a seek.** Without checkpoints, 60 poses of the actors with springs for each second from the start; later at most as many as
//! lie between two checkpoints (16, more once they would take 32 MiB). The timeline is divided into stretches of [`STRETCH_SECS`] seconds.
//! The simulation of each stretch starts from rest, one minute earlier, so that 100 hours into a stage cost no more than 11 minutes. If a
//! spring keeps more than a millionth of a swing after that minute ([`FORGETTING_RATE`]), as an undamped one does, the whole stage is one
//! stretch.

use crate::actors;
use crate::constraints::foot_lock_cache::FootLocks;
use crate::constraints::{ConstrainedScratch, evaluate_actors};
use crate::snapshot::{ActorState, Snapshot};
use crate::stage::edits::{ActorEdit, edits_for_index};
use crate::stage::parenting::Parenting;
use crate::stage::{Stage, StageError};
use crate::transforms::order::PlacementStep;
use choreo_motion::Time;
use choreo_motion::spring::{RigBone, SpringScratch, SpringState, SpringStep};
use glam::DVec3;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Length of a stretch, seconds.
const STRETCH_SECS: i64 = 600;
/// Seconds of simulation before the start of a stretch.
const WARM_UP_SECS: i64 = 60;
/// Least decay rate of springs that forget within [`WARM_UP_SECS`], 1/s: ln 10⁶ / 60 s.
const FORGETTING_RATE: f64 = 13.82 / 60.0;
/// Largest number of steps between two checkpoints.
const MAX_STRIDE: i64 = 36_000;
/// Largest total size of all checkpoints, bytes.
const MAX_BYTES: usize = 32 << 20;

/// Grid point: (stretch, step).
type GridPoint = (i64, i64);
/// Spring states, one per actor of a group.
type GroupStates = Vec<SpringState>;

/// Checkpoints of the simulation, shared by all evaluators of a stage.
#[derive(Debug, Default)]
pub(crate) struct SpringCheckpoints(Mutex<Checkpoints>);

#[derive(Debug)]
struct Checkpoints {
    /// Number of steps between checkpoints; doubled whenever they take too much memory.
    stride: i64,
    /// Checkpoints of each group.
    groups: Vec<BTreeMap<GridPoint, Arc<GroupStates>>>,
    /// Whether all actors are one group, because a callback attaches some.
    is_merged: bool,
    bytes: usize,
}

impl Default for Checkpoints {
    fn default() -> Self {
        Checkpoints { stride: 16, groups: Vec::new(), is_merged: false, bytes: 0 }
    }
}

impl SpringCheckpoints {
    fn lock(&self) -> MutexGuard<'_, Checkpoints> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The latest checkpoint of a group in a stretch, at the step `until` or before, but not before the step `first`.
    fn latest_before(
        &self,
        is_merged: bool,
        number: usize,
        until: GridPoint,
        first: i64,
    ) -> Option<(i64, Arc<GroupStates>)> {
        let kept = self.lock();
        let states = kept.groups.get(number).filter(|_| kept.is_merged == is_merged)?;
        let ((_, step), states) = states.range((until.0, first)..=until).next_back()?;
        Some((*step, states.clone()))
    }

    fn store(&self, is_merged: bool, number: usize, key: GridPoint, states: &GroupStates) {
        let mut kept = self.lock();
        if is_merged != kept.is_merged || key.1.rem_euclid(kept.stride) != 0 {
            return;
        }
        let groups = kept.groups.len().max(number + 1);
        kept.groups.resize_with(groups, BTreeMap::new);
        if kept.groups[number].contains_key(&key) {
            return;
        }
        let size = |states: &GroupStates| states.iter().map(SpringState::size).sum::<usize>() + 128;
        kept.bytes += size(states);
        kept.groups[number].insert(key, Arc::new(states.clone()));
        while kept.bytes > MAX_BYTES && kept.stride < MAX_STRIDE {
            kept.stride *= 2;
            let stride = kept.stride;
            for group in &mut kept.groups {
                group.retain(|(_, step), _| step.rem_euclid(stride) == 0);
            }
            kept.bytes = kept.groups.iter().flat_map(BTreeMap::values).map(|s| size(s)).sum();
        }
        // If that is not enough, the checkpoints of the earliest stretches are dropped.
        while kept.bytes > MAX_BYTES {
            let first =
                |group: &BTreeMap<GridPoint, Arc<GroupStates>>| group.first_key_value().map(|(key, _)| *key);
            let oldest = kept.groups.iter_mut().filter(|group| !group.is_empty()).min_by_key(|g| first(g));
            let Some((_, gone)) = oldest.and_then(BTreeMap::pop_first) else { break };
            kept.bytes -= size(&gone);
        }
    }

    /// Makes all actors one group and drops the checkpoints of separate groups.
    fn merge_groups(&self) {
        let mut kept = self.lock();
        if !kept.is_merged {
            *kept = Checkpoints { is_merged: true, ..Checkpoints::default() };
        }
    }
}

/// Actors with springs that can be attached to each other, or face each other, at some time: they are simulated together. Springs of other
/// actors do not affect them.
#[derive(Clone, Debug, Default)]
struct SpringGroup {
    actors: Vec<usize>,
    /// Grid point of `states`; `None`: the states are not valid.
    at: Option<GridPoint>,
    states: GroupStates,
    /// Copies of `states`, advanced to the time of the frame.
    frame_states: GroupStates,
    /// Whether the snapshot needs the group.
    is_needed: bool,
    /// The next step to simulate.
    next: i64,
}

/// The groups of a stage.
#[derive(Clone, Debug, Default)]
struct SpringGroups {
    all: Vec<SpringGroup>,
    /// Index of the group of each actor with springs, and index of the actor in that group.
    places: Vec<Option<(usize, usize)>>,
    /// Set of each actor, with or without springs: the actor that represents the actors that belong together.
    sets: Vec<usize>,
    is_merged: bool,
}

impl SpringGroups {
    fn new(stage: &Stage, is_merged: bool) -> SpringGroups {
        let count = stage.actors.len();
        let mut sets: Vec<usize> = (0..count).collect();
        let mut merge_sets = |a: usize, b: usize| {
            if a < count && b < count {
                let [a, b] = [a, b].map(|actor| representative(&mut sets, actor));
                sets[a] = b;
            }
        };
        for (index, actor) in stage.actors.iter().enumerate() {
            let parents = actor.parents.iter().filter_map(|parent| Some(parent.to?.actor));
            parents.chain(actor.face).for_each(|other| merge_sets(index, other));
            if is_merged {
                merge_sets(index, 0);
            }
        }
        (0..count).for_each(|actor| sets[actor] = representative(&mut sets, actor));
        let mut groups = SpringGroups { sets, is_merged, places: vec![None; count], all: Vec::new() };
        let mut numbers = vec![None; count];
        for actor in (0..count).filter(|actor| has_springs(stage, *actor)) {
            let number = *numbers[groups.sets[actor]].get_or_insert(groups.all.len());
            groups.all.resize_with(groups.all.len().max(number + 1), SpringGroup::default);
            groups.places[actor] = Some((number, groups.all[number].actors.len()));
            groups.all[number].actors.push(actor);
        }
        groups
    }

    /// Whether a callback attaches an actor, whose set has springs, to an actor of another set.
    fn are_joined_by(&self, edits: &[(usize, ActorEdit)]) -> bool {
        edits.iter().any(|(actor, edit)| {
            let ActorEdit::Attach(Parenting { to: Some(to), .. }) = edit else { return false };
            let (Some(own), Some(other)) = (self.sets.get(*actor), self.sets.get(to.actor)) else {
                return false;
            };
            own != other && self.all.iter().any(|group| self.sets[group.actors[0]] == *own)
        })
    }

    fn needed_groups_mut(&mut self) -> impl Iterator<Item = &mut SpringGroup> {
        self.all.iter_mut().filter(|group| group.is_needed)
    }
}

/// The actor that represents the set of an actor (union-find with path halving).
fn representative(sets: &mut [usize], mut actor: usize) -> usize {
    while sets[actor] != actor {
        sets[actor] = sets[sets[actor]];
        actor = sets[actor];
    }
    actor
}

fn has_springs(stage: &Stage, actor: usize) -> bool {
    stage.actors[actor].springs.as_ref().is_some_and(|springs| !springs.rig.is_empty())
}

/// State of the simulation of one evaluator, and buffers.
#[derive(Clone, Debug, Default)]
pub(crate) struct SpringSimulation {
    groups: SpringGroups,
    /// Actors of the groups that make a step.
    moving: Vec<usize>,
    scratch: Option<Box<ConstrainedScratch>>,
    snapshot: Snapshot,
    buffers: SpringScratch,
    bone_count: usize,
}

impl SpringSimulation {
    /// Number of poses computed for steps of the grid.
    pub(crate) fn pose_count(&self) -> usize {
        self.scratch.as_ref().map_or(0, |s| s.actors.total_pose_count)
    }

    /// Spring bones simulated for the last snapshot.
    pub(crate) fn bone_count(&self) -> usize {
        self.bone_count
    }
}

fn time_of_step(stage: &Stage, step: i64) -> Time {
    Time(step.saturating_mul(stage.solvers.spring_step().0))
}

/// Index of the stretch that contains a step, and the step at which the simulation of the stretch begins.
fn stretch_of_step(stage: &Stage, step: i64) -> (i64, i64) {
    let springs = || stage.actors.iter().filter_map(|a| a.springs.as_ref());
    let pre_roll = springs().map(|s| s.pre_roll).max();
    let pre_roll = pre_roll.unwrap_or(Time::ZERO).0.clamp(0, STRETCH_SECS * Time::TICKS_PER_SECOND);
    let (rate, length) = (stage.solvers.spring_rate, stage.solvers.spring_step().0);
    let first = -(pre_roll + length - 1).div_euclid(length);
    let decays_in_time = |bone: &RigBone| {
        let length = f64::from(bone.tail.length()).max(f64::MIN_POSITIVE);
        bone.spring.decay_rate(bone.pull.length() + bone.gravity.length() / length) >= FORGETTING_RATE
    };
    let forgotten = springs().all(|springs| springs.rig.bones().iter().all(decays_in_time));
    let stretch = if forgotten { step.div_euclid(STRETCH_SECS * rate).max(0) } else { 0 };
    (stretch, if stretch == 0 { first.min(step) } else { (stretch * STRETCH_SECS - WARM_UP_SECS) * rate })
}

/// Simulates springs and turns their joints, in a snapshot whose actors are posed, placed and constrained. After joints that carry other
/// actors have moved, all actors are placed again.
pub(crate) fn simulate_springs(
    stage: &Stage,
    foot_locks: &FootLocks,
    checkpoints: &SpringCheckpoints,
    simulation: &mut SpringSimulation,
    time: Time,
    scratch: &mut actors::ActorScratch,
    actors: &mut [ActorState],
) -> Result<(), StageError> {
    simulation.bone_count = 0;
    if !(0..stage.actors.len()).any(|actor| has_springs(stage, actor)) {
        return Ok(());
    }
    let step = time.0.div_euclid(stage.solvers.spring_step().0);
    loop {
        let is_merged = checkpoints.lock().is_merged;
        if simulation.groups.all.is_empty() || simulation.groups.is_merged != is_merged {
            simulation.groups = SpringGroups::new(stage, is_merged);
        }
        for group in &mut simulation.groups.all {
            group.is_needed = group.actors.iter().any(|actor| is_posed(stage, *actor, &actors[*actor]));
        }
        if advance_groups(stage, foot_locks, checkpoints, simulation, step, scratch)? {
            break;
        }
    }
    let remaining_time = Time(time.0 - time_of_step(stage, step).0);
    let SpringSimulation { groups, buffers, bone_count, .. } = simulation;
    for group in groups.needed_groups_mut() {
        group.frame_states.resize_with(group.states.len(), SpringState::default);
        for (copy, state) in group.frame_states.iter_mut().zip(&group.states) {
            copy.copy_from(state);
        }
        let rigs = group.actors.iter().filter_map(|actor| stage.actors[*actor].springs.as_ref());
        *bone_count += rigs.map(|springs| springs.rig.len()).sum::<usize>();
    }
    step_springs(stage, (groups, MovedStates::FrameCopy), buffers, remaining_time, scratch, actors);
    Ok(())
}

/// Whether an actor is posed. Hidden and culled actors are not; their springs do not show.
fn is_posed(stage: &Stage, actor: usize, state: &ActorState) -> bool {
    state.model_from_joint.len() == stage.actors[actor].asset.skeleton.len()
}

/// Advances the needed groups to a grid point. `shared`: buffers with the transforms that are kept where parents change. Returns `false` if
/// a callback has attached actors of two groups, so that the simulation must begin again with one group.
fn advance_groups(
    stage: &Stage,
    foot_locks: &FootLocks,
    checkpoints: &SpringCheckpoints,
    simulation: &mut SpringSimulation,
    step: i64,
    shared: &actors::ActorScratch,
) -> Result<bool, StageError> {
    let (stretch, first) = stretch_of_step(stage, step);
    let is_merged = simulation.groups.is_merged;
    let mut from = step + 1;
    for number in 0..simulation.groups.all.len() {
        let kept_at = |at: i64| {
            let found = checkpoints.latest_before(is_merged, number, (stretch, step), first);
            found.filter(|(kept_at, _)| at < *kept_at)
        };
        let group = &mut simulation.groups.all[number];
        if group.is_needed {
            group.seek_checkpoint((stretch, step), first, kept_at);
            from = from.min(group.next);
        }
    }
    let mut scratch = simulation.scratch.take().unwrap_or_default();
    scratch.actors.kept_transforms = shared.kept_transforms.clone();
    while from <= step {
        let moved = MovedStates::Grid(from);
        let SpringSimulation { groups, moving, buffers, snapshot, .. } = simulation;
        moving.clear();
        moving.extend(groups.all.iter().filter(|g| g.is_moved_by(moved)).flat_map(|g| &g.actors));
        scratch.actors.restrict_to(moving);
        evaluate_actors(stage, &mut scratch, time_of_step(stage, from), foot_locks, None, snapshot)?;
        let scratch_of_actors = &mut scratch.actors;
        if groups.are_joined_by(&scratch_of_actors.edits.actors) {
            checkpoints.merge_groups();
            simulation.scratch = Some(scratch);
            return Ok(false);
        }
        let by = stage.solvers.spring_step();
        step_springs(stage, (groups, moved), buffers, by, scratch_of_actors, &mut snapshot.actors);
        for (number, group) in groups.all.iter().enumerate().filter(|(_, g)| g.is_moved_by(moved)) {
            checkpoints.store(is_merged, number, (stretch, from), &group.states);
        }
        from += 1;
    }
    simulation.scratch = Some(scratch);
    for group in simulation.groups.needed_groups_mut() {
        group.at = Some((stretch, step));
    }
    Ok(true)
}

/// The states that a step moves.
#[derive(Clone, Copy)]
enum MovedStates {
    /// States at grid points, of the groups whose next step is at most this one.
    Grid(i64),
    /// Copies of the states, advanced beyond the last grid point.
    FrameCopy,
}

impl SpringGroup {
    /// Finds the nearest state from which a grid point can be reached. `at` stays `None` until the group is there, in case a callback
    /// fails. `kept_after`: the latest checkpoint, if it is after a step.
    fn seek_checkpoint(
        &mut self,
        (stretch, step): GridPoint,
        first: i64,
        kept_after: impl Fn(i64) -> Option<(i64, Arc<GroupStates>)>,
    ) {
        let here = self.at.take().filter(|at| at.0 == stretch && (first..=step).contains(&at.1));
        let mut at = here.map(|(_, at)| at);
        if at != Some(step)
            && let Some((kept_at, states)) = kept_after(at.unwrap_or(i64::MIN))
        {
            at = Some(kept_at);
            // The states are copied into existing memory, because a clone of each would allocate.
            self.states.resize_with(states.len(), SpringState::default);
            self.states.iter_mut().zip(states.iter()).for_each(|(own, kept)| own.copy_from(kept));
        }
        if at.is_none() {
            self.states.clear();
            self.states.resize_with(self.actors.len(), SpringState::default);
        }
        self.next = at.map_or(first, |at| at + 1);
    }

    fn is_moved_by(&self, moved: MovedStates) -> bool {
        self.is_needed
            && match moved {
                MovedStates::Grid(step) => self.next <= step,
                MovedStates::FrameCopy => true,
            }
    }
}

/// Simulates one step of the springs of all groups that move, parents before the actors attached to them.
fn step_springs(
    stage: &Stage,
    (groups, moved): (&mut SpringGroups, MovedStates),
    buffers: &mut SpringScratch,
    by: Time,
    scratch: &mut actors::ActorScratch,
    actors: &mut [ActorState],
) {
    for step in 0..scratch.order.steps.len() {
        let PlacementStep::World(index) = scratch.order.steps[step] else { continue };
        let Some((number, place)) = groups.places[index] else { continue };
        let group = &mut groups.all[number];
        let placed = &mut actors[index];
        let actor = &stage.actors[index];
        let Some(springs) = actor.springs.as_ref().filter(|_| group.is_moved_by(moved)) else { continue };
        if !is_posed(stage, index, placed) {
            continue;
        }
        let states = match moved {
            MovedStates::Grid(_) => &mut group.states,
            MovedStates::FrameCopy => &mut group.frame_states,
        };
        SpringStep {
            rig: &springs.rig,
            skeleton: &actor.asset.skeleton,
            world_from_model: placed.world_from_model,
            wind: latest_wind_edit(&scratch.edits.actors, index).unwrap_or(springs.wind),
            seconds: by.as_secs(),
            state: &mut states[place],
            scratch: buffers,
            model_from_joint: &mut placed.model_from_joint,
        }
        .run();
        if scratch.parents.has_children_on_joints(index) {
            scratch.place(stage, actors);
        }
    }
}

/// The wind that callbacks have set last for an actor, if any.
fn latest_wind_edit(edits: &[(usize, ActorEdit)], of: usize) -> Option<DVec3> {
    edits_for_index(edits, of).rev().find_map(|edit| match edit {
        ActorEdit::Wind(wind) => Some(*wind),
        _ => None,
    })
}
