//! Springs of all actors at a time: a simulation in which any frame can be evaluated first.
//!
//! The motion advances in steps of 1/60 s ([`SolverSettings::spring_rate`]), whatever the frame rate. The grid of steps begins at time 0
//! (or a pre-roll earlier) with springs at rest. A frame between two points of the grid is one shorter step further, on a copy. So the
//! state at a point is a function of the stage alone. One state in every N steps is kept, shared by all evaluators of a stage. A seek
//! continues from the nearest one before it; kept states change how long that takes, and nothing else.
//!
//! **Which actors.** Only those whose joints the snapshot needs, with all to which they can be attached or that they can face, at any time: a
//! group ([`Group`]) is brought to a time as a whole. A group that was not needed is where it was left, and catches up from there or from a
//! kept state; its state at a point is the same, however it got there. Where a callback attaches actors of two groups, all are one group.
//!
//! **What a seek costs.** Without anything kept, 60 poses of the actors that have springs for each second from the start; later at most
//! as many as lie between two kept states (16, more once they would take 32 MiB). Springs remember ten minutes: in each stretch of [`STRETCH`]
//! seconds the motion begins anew, settled, a minute before it, so that 100 hours into a stage cost no more than 11 minutes. A stage with a
//! spring of which that minute would leave more than a millionth of a swing ([`FORGETS`]), as of an undamped one, is one stretch.

use crate::actors;
use crate::constraints::foot_locks::FootLocks;
use crate::constraints::{ConstrainedScratch, evaluate_actors};
use crate::snapshot::{ActorState, Snapshot};
use crate::stage::edits::{ActorEdit, edits_of};
use crate::stage::parenting::Parenting;
use crate::stage::{Stage, StageError};
use crate::transforms::order::PlacementStep;
use choreo_motion::Time;
use choreo_motion::spring::{RigBone, SpringScratch, SpringState, SpringStep};
use glam::DVec3;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

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
/// One for each actor of a group.
type States = Vec<SpringState>;

/// States that were passed, shared by all evaluators of a stage.
#[derive(Debug, Default)]
pub(crate) struct SpringCheckpoints(Mutex<Checkpoints>);

#[derive(Debug)]
struct Checkpoints {
    /// Number of steps between states that are kept; doubled whenever they take too much memory.
    stride: i64,
    /// Kept states of each group.
    groups: Vec<BTreeMap<Key, Arc<States>>>,
    /// Whether all actors are one group, because a callback attaches some.
    joined: bool,
    bytes: usize,
}

impl Default for Checkpoints {
    fn default() -> Self {
        Checkpoints { stride: 16, groups: Vec::new(), joined: false, bytes: 0 }
    }
}

impl SpringCheckpoints {
    fn kept(&self) -> MutexGuard<'_, Checkpoints> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The last state of a group kept in a stretch, at a step or before, since its first.
    fn before(&self, joined: bool, number: usize, until: Key, first: i64) -> Option<(i64, Arc<States>)> {
        let kept = self.kept();
        let states = kept.groups.get(number).filter(|_| kept.joined == joined)?;
        let ((_, step), states) = states.range((until.0, first)..=until).next_back()?;
        Some((*step, states.clone()))
    }

    fn keep(&self, joined: bool, number: usize, key: Key, states: &States) {
        let mut kept = self.kept();
        if joined != kept.joined || key.1.rem_euclid(kept.stride) != 0 {
            return;
        }
        let groups = kept.groups.len().max(number + 1);
        kept.groups.resize_with(groups, BTreeMap::new);
        if kept.groups[number].contains_key(&key) {
            return;
        }
        let size = |states: &States| states.iter().map(SpringState::size).sum::<usize>() + 128;
        kept.bytes += size(states);
        kept.groups[number].insert(key, Arc::new(states.clone()));
        while kept.bytes > MOST_BYTES && kept.stride < MOST_STRIDE {
            kept.stride *= 2;
            let stride = kept.stride;
            for group in &mut kept.groups {
                group.retain(|(_, step), _| step.rem_euclid(stride) == 0);
            }
            kept.bytes = kept.groups.iter().flat_map(BTreeMap::values).map(|s| size(s)).sum();
        }
        // Stretch after stretch: the oldest go.
        while kept.bytes > MOST_BYTES {
            let first = |group: &BTreeMap<Key, Arc<States>>| group.first_key_value().map(|(key, _)| *key);
            let oldest = kept.groups.iter_mut().filter(|group| !group.is_empty()).min_by_key(|g| first(g));
            let Some((_, gone)) = oldest.and_then(BTreeMap::pop_first) else { break };
            kept.bytes -= size(&gone);
        }
    }

    /// Makes one group of all, and forgets what was kept of several.
    fn join(&self) {
        let mut kept = self.kept();
        if !kept.joined {
            *kept = Checkpoints { joined: true, ..Checkpoints::default() };
        }
    }
}

/// Actors with springs that can be attached to each other or face what is attached, at some time: they move together. No other actor's springs
/// change how they move.
#[derive(Clone, Debug, Default)]
struct Group {
    actors: Vec<usize>,
    /// The point of the grid whose state it has.
    at: Option<Key>,
    states: States,
    shown: States,
    /// Whether the snapshot needs it.
    is_needed: bool,
    /// The step that it has to make next.
    next: i64,
}

/// The groups of a stage.
#[derive(Clone, Debug, Default)]
struct Groups {
    all: Vec<Group>,
    /// The group of each actor with springs, and its place there.
    places: Vec<Option<(usize, usize)>>,
    /// The set of actors that belong together in which each one is, whether they have springs or not.
    sets: Vec<usize>,
    joined: bool,
}

impl Groups {
    fn new(stage: &Stage, joined: bool) -> Groups {
        let count = stage.actors.len();
        let mut sets: Vec<usize> = (0..count).collect();
        let mut join = |a: usize, b: usize| {
            if a < count && b < count {
                let [a, b] = [a, b].map(|actor| root(&mut sets, actor));
                sets[a] = b;
            }
        };
        for (index, actor) in stage.actors.iter().enumerate() {
            let parents = actor.parents.iter().filter_map(|parent| Some(parent.to?.actor));
            parents.chain(actor.face).for_each(|other| join(index, other));
            if joined {
                join(index, 0);
            }
        }
        (0..count).for_each(|actor| sets[actor] = root(&mut sets, actor));
        let mut groups = Groups { sets, joined, places: vec![None; count], all: Vec::new() };
        let mut numbers = vec![None; count];
        for actor in (0..count).filter(|actor| has_springs(stage, *actor)) {
            let number = *numbers[groups.sets[actor]].get_or_insert(groups.all.len());
            groups.all.resize_with(groups.all.len().max(number + 1), Group::default);
            groups.places[actor] = Some((number, groups.all[number].actors.len()));
            groups.all[number].actors.push(actor);
        }
        groups
    }

    /// Whether a callback attaches an actor that springs can move along with to one of another set.
    fn are_joined_by(&self, edits: &[(usize, ActorEdit)]) -> bool {
        edits.iter().any(|(actor, edit)| {
            let ActorEdit::Attach(Parenting { to: Some(to), .. }) = edit else { return false };
            let (Some(own), Some(other)) = (self.sets.get(*actor), self.sets.get(to.actor)) else {
                return false;
            };
            own != other && self.all.iter().any(|group| self.sets[group.actors[0]] == *own)
        })
    }

    fn needed(&mut self) -> impl Iterator<Item = &mut Group> {
        self.all.iter_mut().filter(|group| group.is_needed)
    }
}

/// The actor that stands for the set of another one, each on the way being put nearer to it.
fn root(sets: &mut [usize], mut actor: usize) -> usize {
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
pub(crate) struct Simulation {
    groups: Groups,
    /// Actors that make a step.
    moving: Vec<usize>,
    scratch: Option<Box<ConstrainedScratch>>,
    snapshot: Snapshot,
    buffers: SpringScratch,
    bones: usize,
}

impl Simulation {
    /// Poses taken for steps of the grid.
    pub fn poses(&self) -> usize {
        self.scratch.as_ref().map_or(0, |s| s.actors.all_poses)
    }

    /// Spring bones simulated for the last snapshot.
    pub fn bones(&self) -> usize {
        self.bones
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

/// Turns the joints of the springs in a snapshot whose actors are posed, placed and have done their constraints. All actors are
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
    simulation.bones = 0;
    if !(0..stage.actors.len()).any(|actor| has_springs(stage, actor)) {
        return Ok(());
    }
    let step = time.0.div_euclid(stage.solvers.spring_step().0);
    loop {
        let joined = kept.kept().joined;
        if simulation.groups.all.is_empty() || simulation.groups.joined != joined {
            simulation.groups = Groups::new(stage, joined);
        }
        for group in &mut simulation.groups.all {
            group.is_needed = group.actors.iter().any(|actor| is_posed(stage, *actor, &actors[*actor]));
        }
        if advance(stage, foot_locks, kept, simulation, step, scratch)? {
            break;
        }
    }
    let rest = Time(time.0 - time_of(stage, step).0);
    let Simulation { groups, buffers, bones, .. } = simulation;
    for group in groups.needed() {
        group.shown.resize_with(group.states.len(), SpringState::default);
        for (shown, state) in group.shown.iter_mut().zip(&group.states) {
            shown.copy_from(state);
        }
        let rigs = group.actors.iter().filter_map(|actor| stage.actors[*actor].springs.as_ref());
        *bones += rigs.map(|springs| springs.rig.len()).sum::<usize>();
    }
    swing(stage, (groups, Moves::Shown), buffers, rest, scratch, actors);
    Ok(())
}

/// Hidden actors and those out of view are not posed; nothing shows.
fn is_posed(stage: &Stage, actor: usize, state: &ActorState) -> bool {
    state.model_from_joint.len() == stage.actors[actor].asset.skeleton.len()
}

/// Brings the groups that are needed to a point of the grid. `shared`: knows the transforms that are kept where parents change. `false`: a
/// callback has attached actors of two groups, and all are to be begun anew as one.
fn advance(
    stage: &Stage,
    foot_locks: &FootLocks,
    kept: &SpringCheckpoints,
    simulation: &mut Simulation,
    step: i64,
    shared: &actors::Scratch,
) -> Result<bool, StageError> {
    let (stretch, first) = stretch_of(stage, step);
    let joined = simulation.groups.joined;
    let mut from = step + 1;
    for number in 0..simulation.groups.all.len() {
        let kept_at = |at: i64| {
            let found = kept.before(joined, number, (stretch, step), first);
            found.filter(|(kept_at, _)| at < *kept_at)
        };
        let group = &mut simulation.groups.all[number];
        if group.is_needed {
            group.seek((stretch, step), first, kept_at);
            from = from.min(group.next);
        }
    }
    let mut scratch = simulation.scratch.take().unwrap_or_default();
    scratch.actors.kept_transforms = shared.kept_transforms.clone();
    while from <= step {
        let moves = Moves::Grid(from);
        let Simulation { groups, moving, buffers, snapshot, .. } = simulation;
        moving.clear();
        moving.extend(groups.all.iter().filter(|g| g.is_moved(moves)).flat_map(|g| &g.actors));
        scratch.actors.look_only_at(moving);
        evaluate_actors(stage, &mut scratch, time_of(stage, from), foot_locks, None, snapshot)?;
        let scratch_of_actors = &mut scratch.actors;
        if groups.are_joined_by(&scratch_of_actors.edits.actors) {
            kept.join();
            simulation.scratch = Some(scratch);
            return Ok(false);
        }
        let by = stage.solvers.spring_step();
        swing(stage, (groups, moves), buffers, by, scratch_of_actors, &mut snapshot.actors);
        for (number, group) in groups.all.iter().enumerate().filter(|(_, g)| g.is_moved(moves)) {
            kept.keep(joined, number, (stretch, from), &group.states);
        }
        from += 1;
    }
    simulation.scratch = Some(scratch);
    for group in simulation.groups.needed() {
        group.at = Some((stretch, step));
    }
    Ok(true)
}

/// The states that a step moves.
#[derive(Clone, Copy)]
enum Moves {
    /// States at points of the grid, of the groups that have come to this one.
    Grid(i64),
    /// Copies of them, beyond the last point.
    Shown,
}

impl Group {
    /// Finds the nearest state from which a point of the grid is reached; the state is invalid until the group is there, in case a callback
    /// fails. `kept_after`: the last one that is kept, if it is after a step.
    fn seek(
        &mut self,
        (stretch, step): Key,
        first: i64,
        kept_after: impl Fn(i64) -> Option<(i64, Arc<States>)>,
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

    fn is_moved(&self, moves: Moves) -> bool {
        self.is_needed
            && match moves {
                Moves::Grid(step) => self.next <= step,
                Moves::Shown => true,
            }
    }
}

/// One step of the springs of all groups that move, parents before what is attached to them.
fn swing(
    stage: &Stage,
    (groups, moves): (&mut Groups, Moves),
    buffers: &mut SpringScratch,
    by: Time,
    scratch: &mut actors::Scratch,
    actors: &mut [ActorState],
) {
    for step in 0..scratch.order.steps.len() {
        let PlacementStep::World(index) = scratch.order.steps[step] else { continue };
        let Some((number, place)) = groups.places[index] else { continue };
        let group = &mut groups.all[number];
        let placed = &mut actors[index];
        let actor = &stage.actors[index];
        let Some(springs) = actor.springs.as_ref().filter(|_| group.is_moved(moves)) else { continue };
        if !is_posed(stage, index, placed) {
            continue;
        }
        let states = match moves {
            Moves::Grid(_) => &mut group.states,
            Moves::Shown => &mut group.shown,
        };
        SpringStep {
            rig: &springs.rig,
            skeleton: &actor.asset.skeleton,
            world_from_model: placed.world_from_model,
            wind: wind(&scratch.edits.actors, index).unwrap_or(springs.wind),
            seconds: by.as_secs(),
            state: &mut states[place],
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
fn wind(edits: &[(usize, ActorEdit)], of: usize) -> Option<DVec3> {
    edits_of(edits, of).rev().find_map(|edit| match edit {
        ActorEdit::Wind(wind) => Some(*wind),
        _ => None,
    })
}
