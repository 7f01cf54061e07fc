//! Whose constraints come first.

use crate::stage::Stage;
use crate::stage::actor::Target;
use choreo_motion::Time;

/// Buffers of [`rounds`].
#[derive(Clone, Debug, Default)]
pub(crate) struct ConstraintOrder {
    /// Actors with something to do now, in rounds one after the other.
    pub actors: Vec<usize>,
    /// Ends of the rounds within `actors`.
    pub ends: Vec<usize>,
    waiting: Vec<usize>,
    /// (actor, the actor that it needs), sorted.
    needs: Vec<(usize, usize)>,
    done: Vec<bool>,
    path: Vec<usize>,
}

/// Puts the actors that have constraints at a time into rounds: each round needs only what the ones before it have done. A circle is a round
/// of its own.
pub(crate) fn rounds(stage: &Stage, time: Time, order: &mut ConstraintOrder) {
    let ConstraintOrder { actors, ends, waiting, needs, done, path } = order;
    actors.clear();
    ends.clear();
    needs.clear();
    waiting.clear();
    waiting.extend((0..stage.actors.len()).filter(|a| is_busy(stage, *a, time)));
    if waiting.is_empty() {
        return;
    }
    done.clear();
    done.resize(stage.actors.len(), true);
    waiting.iter().for_each(|a| done[*a] = false);
    for &actor in waiting.iter() {
        let a = &stage.actors[actor];
        let constraints = a.constraints.iter().filter(|g| g.share(time) > 0.0).flat_map(|g| g.targets());
        let looks = a.look_at.iter().filter(|l| l.share(time) > 0.0).map(|l| l.target);
        for target in constraints.chain(looks) {
            for_carriers(stage, target, |other| {
                if other != actor && !done[other] {
                    needs.push((actor, other));
                }
            });
        }
    }
    needs.sort_unstable();
    needs.dedup();
    let of = |actor: usize| {
        let from = needs.partition_point(|(a, _)| *a < actor);
        needs[from..].iter().take_while(move |(a, _)| *a == actor).map(|(_, b)| *b)
    };
    while !waiting.is_empty() {
        let begun = actors.len();
        actors.extend(waiting.iter().copied().filter(|a| of(*a).all(|b| done[b])));
        if actors.len() == begun {
            // Follow what is needed until it comes round.
            path.clear();
            let mut at = waiting[0];
            while !path.contains(&at) {
                path.push(at);
                let Some(next) = of(at).find(|b| !done[*b]) else { break };
                at = next;
            }
            let from = path.iter().position(|a| *a == at).unwrap_or(0);
            actors.extend(&path[from..]);
            actors[begun..].sort_unstable();
        }
        actors[begun..].iter().for_each(|a| done[*a] = true);
        waiting.retain(|a| !done[*a]);
        ends.push(actors.len());
    }
}

fn is_busy(stage: &Stage, actor: usize, time: Time) -> bool {
    let a = &stage.actors[actor];
    !a.limits.is_empty()
        || a.constraints.iter().any(|g| g.share(time) > 0.0)
        || a.look_at.iter().any(|l| l.share(time) > 0.0)
}

/// The actors whose joints a target hangs on.
fn for_carriers(stage: &Stage, target: Target, mut found: impl FnMut(usize)) {
    let mut at = match target {
        Target::Point(_) => return,
        Target::Actor(actor) => actor,
        // An unchecked stage may name nobody.
        Target::Joint { actor, .. } if actor < stage.actors.len() => {
            found(actor);
            actor
        }
        Target::Joint { .. } => return,
    };
    // No longer than there are actors: attachments in a circle are an error elsewhere.
    for _ in 0..stage.actors.len() {
        let Some(parent) = stage.actors.get(at).and_then(|a| a.parent) else { return };
        if parent.joint.is_some() && parent.actor < stage.actors.len() {
            found(parent.actor);
        }
        at = parent.actor;
    }
}
