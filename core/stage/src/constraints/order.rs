//! The order in which the constraints of several actors are solved.

use crate::stage::Stage;
use crate::stage::actor::Target;
use crate::transforms::parents::ActiveParents;
use choreo_motion::Time;

/// The rounds of actors at a time, and buffers of [`sort_into_rounds`].
#[derive(Clone, Debug, Default)]
pub(crate) struct ConstraintOrder {
    /// Actors with active constraints, look-ats or limits, round after round.
    pub actors: Vec<usize>,
    /// Ends of the rounds within `actors`.
    pub ends: Vec<usize>,
    /// Whether each round is a cycle of actors that need each other.
    pub circular: Vec<bool>,
    waiting: Vec<usize>,
    /// (actor, the actor that it needs), sorted.
    dependencies: Vec<(usize, usize)>,
    done: Vec<bool>,
    path: Vec<usize>,
    /// Actors that carry one target, directly or through other actors.
    carriers: Vec<usize>,
}

/// Sorts the actors with active constraints into rounds, which are solved one after the other: each round depends only on earlier ones.
/// Actors that depend on each other in a cycle are a round of their own.
pub(crate) fn sort_into_rounds(
    stage: &Stage,
    time: Time,
    parents: &ActiveParents,
    order: &mut ConstraintOrder,
) {
    let ConstraintOrder { actors, ends, circular, waiting, dependencies, done, path, carriers } = order;
    actors.clear();
    ends.clear();
    circular.clear();
    dependencies.clear();
    waiting.clear();
    waiting.extend((0..stage.actors.len()).filter(|a| has_active_constraints(stage, *a, time)));
    if waiting.is_empty() {
        return;
    }
    done.clear();
    done.resize(stage.actors.len(), true);
    waiting.iter().for_each(|a| done[*a] = false);
    for &actor in waiting.iter() {
        let a = &stage.actors[actor];
        let constraints = a.constraints.iter().filter(|g| g.weight_at(time) > 0.0).flat_map(|g| g.targets());
        let looks = a.look_at.iter().filter(|l| l.weight_at(time) > 0.0).map(|l| l.target);
        for target in constraints.chain(looks) {
            for_each_carrier_joint(stage, parents, target, carriers, |other, _| {
                if other != actor && !done[other] {
                    dependencies.push((actor, other));
                }
            });
        }
    }
    dependencies.sort_unstable();
    dependencies.dedup();
    let dependencies_of = |actor: usize| {
        let from = dependencies.partition_point(|(a, _)| *a < actor);
        dependencies[from..].iter().take_while(move |(a, _)| *a == actor).map(|(_, b)| *b)
    };
    while !waiting.is_empty() {
        let round_start = actors.len();
        actors.extend(waiting.iter().copied().filter(|a| dependencies_of(*a).all(|b| done[b])));
        circular.push(actors.len() == round_start);
        if actors.len() == round_start {
            // Follows the dependencies until an actor comes up again, which closes a cycle.
            path.clear();
            let mut at = waiting[0];
            while !path.contains(&at) {
                path.push(at);
                let Some(next) = dependencies_of(at).find(|b| !done[*b]) else { break };
                at = next;
            }
            let from = path.iter().position(|a| *a == at).unwrap_or(0);
            actors.extend(&path[from..]);
            actors[round_start..].sort_unstable();
        }
        actors[round_start..].iter().for_each(|a| done[*a] = true);
        waiting.retain(|a| !done[*a]);
        ends.push(actors.len());
    }
}

fn has_active_constraints(stage: &Stage, actor: usize, time: Time) -> bool {
    let a = &stage.actors[actor];
    !a.limits.is_empty()
        || a.constraints.iter().any(|g| g.weight_at(time) > 0.0)
        || a.look_at.iter().any(|l| l.weight_at(time) > 0.0)
}

/// Calls `found` with each joint (actor, joint) that carries a target, directly or through parents.
pub(super) fn for_each_carrier_joint(
    stage: &Stage,
    parents: &ActiveParents,
    target: Target,
    carriers: &mut Vec<usize>,
    mut found: impl FnMut(usize, u32),
) {
    carriers.clear();
    match target {
        Target::Point(_) => {}
        Target::Actor(actor) => carriers.push(actor),
        // An unchecked stage may name actors that do not exist.
        Target::Joint { actor, joint } if actor < stage.actors.len() => {
            found(actor, joint);
            carriers.push(actor);
        }
        Target::Joint { .. } => {}
    }
    let mut next = 0;
    while let Some(&at) = carriers.get(next) {
        next += 1;
        for parent in parents.carriers(at) {
            if let Some(joint) = parent.joint {
                found(parent.actor, joint);
            }
            if !carriers.contains(&parent.actor) {
                carriers.push(parent.actor);
            }
        }
    }
}
