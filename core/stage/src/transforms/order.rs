//! The order in which actors are placed: after their parents, and oriented after the actors that they face.

use crate::stage::{Stage, StageError};
use crate::transforms::parents::ActiveParents;

/// A step of placing actors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PlacementStep {
    /// Position: needs its parent's world transform.
    Position(usize),
    /// Orientation: needs its own position and that of the actor that it faces.
    World(usize),
}

/// Buffers of [`sort_placement_steps`].
#[derive(Clone, Debug, Default)]
pub(crate) struct PlacementOrder {
    pub steps: Vec<PlacementStep>,
    /// 0 not seen, 1 on the stack, 2 done; two entries per actor.
    state: Vec<u8>,
    stack: Vec<usize>,
    dependencies: Vec<usize>,
}

/// Fills `order.steps` so that each step comes after those that it needs. Two actors may face each other; an actor attached to
/// itself through others, or facing something that it carries, is an error. Links to actors that do not exist are left out.
pub(crate) fn sort_placement_steps(
    stage: &Stage,
    parents: &ActiveParents,
    order: &mut PlacementOrder,
) -> Result<(), StageError> {
    let count = stage.actors.len();
    order.steps.clear();
    order.state.clear();
    order.state.resize(2 * count, 0);
    order.stack.clear();
    for root in (0..2 * count).rev() {
        // Reversed, so that actors come out by index where nothing else orders them.
        order.stack.push(root);
    }
    while let Some(&node) = order.stack.last() {
        if order.state[node] == 2 {
            order.stack.pop();
            continue;
        }
        if order.state[node] == 1 {
            order.state[node] = 2;
            order.stack.pop();
            order.steps.push(if node.is_multiple_of(2) {
                PlacementStep::Position(node / 2)
            } else {
                PlacementStep::World(node / 2)
            });
            continue;
        }
        order.state[node] = 1;
        order.dependencies.clear();
        add_dependencies(stage, parents, node, &mut order.dependencies);
        for index in 0..order.dependencies.len() {
            let dependency = order.dependencies[index];
            match order.state[dependency] {
                0 => order.stack.push(dependency),
                1 => return Err(cycle_error(stage, order, dependency)),
                _ => {}
            }
        }
    }
    Ok(())
}

/// Node 2a is the position of actor a, 2a + 1 its world transform.
fn add_dependencies(stage: &Stage, parents: &ActiveParents, node: usize, out: &mut Vec<usize>) {
    let actor = node / 2;
    if node.is_multiple_of(2) {
        out.extend(parents.carriers(actor).map(|p| 2 * p.actor + 1));
    } else {
        let face = stage.actors[actor].face.filter(|f| *f < stage.actors.len() && *f != actor);
        out.extend([node - 1].into_iter().chain(face.map(|f| 2 * f)));
    }
}

/// Names the cycle that the depth-first search has found: it is on the stack, from the node that is needed again upwards.
fn cycle_error(stage: &Stage, order: &PlacementOrder, again: usize) -> StageError {
    // A node may lie on the stack several times; its last place is the one that was entered.
    let from = order.stack.iter().rposition(|node| *node == again).unwrap_or(0);
    let mut seen = vec![false; order.state.len()];
    let entered = order.stack[from..].iter().rev().copied();
    let mut path: Vec<usize> = entered
        .filter(|node| order.state[*node] == 1 && !std::mem::replace(&mut seen[*node], true))
        .collect();
    path.reverse();
    let name = |actor: usize| stage.actors[actor].name.clone();
    for (place, node) in path.iter().enumerate() {
        let next = path[(place + 1) % path.len()];
        // A world transform needs another actor's position only to face it.
        if !node.is_multiple_of(2) && next.is_multiple_of(2) && next / 2 != node / 2 {
            return StageError::FacingCycle(name(node / 2), name(next / 2));
        }
    }
    let mut actors: Vec<usize> = path.iter().map(|node| node / 2).collect();
    actors.dedup();
    if actors.len() > 1 && actors.first() == actors.last() {
        actors.pop();
    }
    let first = (0..actors.len()).min_by_key(|i| actors[*i]).unwrap_or(0);
    actors.rotate_left(first);
    let mut through: Vec<String> = actors[1..].iter().take(8).map(|a| format!("\"{}\"", name(*a))).collect();
    if actors.len() > 9 {
        through.push(format!("and {} more", actors.len() - 9));
    }
    let through = if through.is_empty() { "nothing else".to_string() } else { through.join(", ") };
    StageError::Cycle(name(actors[0]), through)
}
