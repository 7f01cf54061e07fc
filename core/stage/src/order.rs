//! In which order actors can be placed: after what they are attached to, and turned after what they face has its place.

use crate::{Stage, StageError};

/// A step of placing actors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Step {
    /// Where it stands: needs its parent's world transform.
    Position(usize),
    /// How it is turned: needs its own position and that of what it faces.
    World(usize),
}

/// Buffers of [`find`].
#[derive(Clone, Debug, Default)]
pub(crate) struct Order {
    pub steps: Vec<Step>,
    /// 0 not seen, 1 on the stack, 2 done; two entries an actor.
    state: Vec<u8>,
    stack: Vec<usize>,
}

/// Fills `order.steps` so that each step comes after those that it needs. Two actors may face each other; an actor attached to
/// itself through others, or facing something that it carries, is an error. Links to actors that do not exist are left out.
pub(crate) fn find(stage: &Stage, order: &mut Order) -> Result<(), StageError> {
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
        let [a, b] = needs(stage, node);
        if order.state[node] == 1 {
            order.state[node] = 2;
            order.stack.pop();
            order.steps.push(if node.is_multiple_of(2) {
                Step::Position(node / 2)
            } else {
                Step::World(node / 2)
            });
            continue;
        }
        order.state[node] = 1;
        for need in [a, b].into_iter().flatten() {
            match order.state[need] {
                0 => order.stack.push(need),
                1 => return Err(cycle(stage, need)),
                _ => {}
            }
        }
    }
    Ok(())
}

/// Node 2a is the position of actor a, 2a + 1 its world transform.
fn needs(stage: &Stage, node: usize) -> [Option<usize>; 2] {
    let actor = &stage.actors[node / 2];
    let count = stage.actors.len();
    if node.is_multiple_of(2) {
        [actor.parent.map(|p| p.actor).filter(|p| *p < count).map(|p| 2 * p + 1), None]
    } else {
        [Some(node - 1), actor.face.filter(|f| *f < count && *f != node / 2).map(|f| 2 * f)]
    }
}

/// Walks from a node that is known to reach itself; depth-first search has found that one is on the way.
fn cycle(stage: &Stage, start: usize) -> StageError {
    let name = |node: usize| stage.actors[node / 2].name.clone();
    // By parents alone first: at most as many steps as there are actors.
    for node in 0..stage.actors.len() {
        let mut through = Vec::new();
        let mut at = node;
        for _ in 0..stage.actors.len() {
            let Some(parent) = stage.actors[at].parent.map(|p| p.actor).filter(|p| *p < stage.actors.len())
            else {
                break;
            };
            if parent == node {
                let through =
                    if through.is_empty() { "nothing else".to_string() } else { through.join(", ") };
                return StageError::Cycle(stage.actors[node].name.clone(), through);
            }
            through.push(format!("\"{}\"", stage.actors[parent].name));
            at = parent;
        }
    }
    // Else some actor on the way faces another whose place depends on it.
    let faces = |a: usize| stage.actors[a].face.filter(|f| *f < stage.actors.len());
    for (index, actor) in stage.actors.iter().enumerate() {
        if let Some(face) = faces(index)
            && reaches(stage, 2 * face, 2 * index + 1)
        {
            return StageError::FacingCycle(actor.name.clone(), stage.actors[face].name.clone());
        }
    }
    StageError::Cycle(name(start), "others".to_string())
}

fn reaches(stage: &Stage, from: usize, to: usize) -> bool {
    let mut seen = vec![false; 2 * stage.actors.len()];
    let mut stack = vec![from];
    while let Some(node) = stack.pop() {
        if node == to {
            return true;
        }
        if !std::mem::replace(&mut seen[node], true) {
            stack.extend(needs(stage, node).into_iter().flatten());
        }
    }
    false
}
