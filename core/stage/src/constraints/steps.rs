//! The order of one actor's own constraints: a constraint whose target is attached to the actor's own hand runs after the constraint that
//! moves the hand.

use crate::constraints::look_at::ActiveLookAt;
use crate::constraints::order::for_each_carrier_joint;
use crate::stage::Stage;
use crate::stage::actor::{Actor, Target};
use crate::stage::constraint::{Constraint, ConstraintKind};
use crate::transforms::parents::ActiveParents;
use choreo_motion::{Skeleton, Time};

/// A constraint or look-at of an actor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StepKind {
    /// Index into the actor's constraints.
    Constraint(usize),
    /// Index into the aims of the round.
    Look(usize),
}

/// The moment at which the position of a step's target is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TargetTiming {
    /// Known before the actor moves.
    Before,
    /// Known when the steps before this one have moved the actor.
    AfterPreviousSteps,
    /// Known only after all steps: the target is attached to joints of a later step, which depends on joints of this one.
    AfterAllSteps,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct ConstraintStep {
    pub kind: StepKind,
    pub target: TargetTiming,
}

/// The ordered steps of one actor, and buffers of [`ConstraintSteps::find_and_sort`].
#[derive(Clone, Debug, Default)]
pub(crate) struct ConstraintSteps {
    pub(super) ordered: Vec<ConstraintStep>,
    default_order: Vec<StepKind>,
    waiting: Vec<usize>,
    /// (step, the step that moves its target), by index in `default_order`.
    dependencies: Vec<(usize, usize)>,
    carriers: Vec<usize>,
}

/// Largest number of simultaneous constraints of an actor that are reordered. Larger numbers keep the default order, because sorting
/// takes cubic time.
const MAX_REORDERED: usize = 256;

impl ConstraintSteps {
    /// Fills `ordered` with the active constraints and look-ats of an actor. The default order: foot locks, aims, looks, reaches, each in the
    /// order of the script. A step whose target is moved by another step comes after that step, unless that step depends on it.
    pub(super) fn find_and_sort(
        &mut self,
        stage: &Stage,
        parents: &ActiveParents,
        time: Time,
        index: usize,
        aims: &[ActiveLookAt],
    ) {
        let actor = &stage.actors[index];
        let active = |(_, c): &(usize, &Constraint)| {
            c.weight_at(time) > 0.0 && (c.last_joint() as usize) < actor.asset.skeleton.len()
        };
        let default_order = &mut self.default_order;
        default_order.clear();
        for phase in 0..3 {
            let constraints = actor.constraints.iter().enumerate().filter(active);
            let constraints = constraints.filter(|(_, c)| phase_of(&c.kind) == Some(phase));
            default_order.extend(constraints.map(|(number, _)| StepKind::Constraint(number)));
            if phase == 1 {
                default_order
                    .extend((0..aims.len()).filter(|at| aims[*at].actor == index).map(StepKind::Look));
            }
        }
        self.find_dependencies(stage, parents, index, aims);
        self.sort_by_dependencies(actor, aims);
    }

    /// Finds the steps that move the targets of other steps.
    fn find_dependencies(
        &mut self,
        stage: &Stage,
        parents: &ActiveParents,
        index: usize,
        aims: &[ActiveLookAt],
    ) {
        let ConstraintSteps { default_order, dependencies, carriers, .. } = self;
        dependencies.clear();
        if default_order.len() < 2 || default_order.len() > MAX_REORDERED {
            return;
        }
        let actor = &stage.actors[index];
        let skeleton = &actor.asset.skeleton;
        for (at, step) in default_order.iter().enumerate() {
            let mut add = |target: Target| {
                for_each_carrier_joint(stage, parents, target, carriers, |carrier, joint| {
                    if carrier != index {
                        return;
                    }
                    let movers = default_order.iter().enumerate().filter(|(other, mover)| {
                        *other != at
                            && moved_joints(actor, aims, **mover).any(|m| is_at_or_below(skeleton, joint, m))
                    });
                    dependencies.extend(movers.map(|(other, _)| (at, other)));
                });
            };
            match *step {
                StepKind::Constraint(number) => actor.constraints[number].targets().for_each(&mut add),
                StepKind::Look(number) => add(aims[number].target),
            }
        }
    }

    fn sort_by_dependencies(&mut self, actor: &Actor, aims: &[ActiveLookAt]) {
        let ConstraintSteps { ordered, default_order, waiting, dependencies, .. } = self;
        ordered.clear();
        if dependencies.is_empty() {
            ordered.extend(
                default_order.iter().map(|kind| ConstraintStep { kind: *kind, target: TargetTiming::Before }),
            );
            return;
        }
        let dependencies_of =
            |step: usize| dependencies.iter().filter(move |(a, _)| *a == step).map(|(_, b)| *b);
        let depends_on = |step: usize, on: usize| {
            let last = last_joint(actor, aims, default_order[step]);
            let below = |m| last.is_some_and(|last| is_at_or_below(&actor.asset.skeleton, last, m));
            moved_joints(actor, aims, default_order[on]).any(below)
        };
        waiting.clear();
        waiting.extend(0..default_order.len());
        while !waiting.is_empty() {
            let free = (0..waiting.len()).find(|at| {
                let waits = dependencies_of(waiting[*at]).any(|other| waiting.contains(&other));
                !waits && !waiting[..*at].iter().any(|before| depends_on(waiting[*at], *before))
            });
            // The first step of the default order begins a cycle.
            let step = waiting.remove(free.unwrap_or(0));
            let target = if dependencies_of(step).any(|other| waiting.contains(&other)) {
                TargetTiming::AfterAllSteps
            } else if dependencies_of(step).next().is_some() {
                TargetTiming::AfterPreviousSteps
            } else {
                TargetTiming::Before
            };
            ordered.push(ConstraintStep { kind: default_order[step], target });
        }
    }
}

/// Phase of a constraint in the default order; `None` for mirroring, which is applied with the clips.
fn phase_of(kind: &ConstraintKind) -> Option<usize> {
    match kind {
        ConstraintKind::FootLock(_) => Some(0),
        ConstraintKind::Aim(_) => Some(1),
        ConstraintKind::Reach(_) => Some(2),
        ConstraintKind::Mirror(_) => None,
    }
}

/// The uppermost joints that a step moves; all below them move along.
fn moved_joints<'a>(
    actor: &'a Actor,
    aims: &[ActiveLookAt],
    step: StepKind,
) -> impl Iterator<Item = u32> + use<'a> {
    let (first_joint, legs) = match step {
        StepKind::Look(number) => (Some(aims[number].joint), &[][..]),
        StepKind::Constraint(number) => match &actor.constraints[number].kind {
            ConstraintKind::Aim(aim) => (aim.joints.first().copied(), &[][..]),
            ConstraintKind::Reach(reach) => (reach.joints.first().copied(), &[][..]),
            ConstraintKind::FootLock(lock) => (lock.hips, lock.legs.as_slice()),
            ConstraintKind::Mirror(_) => (None, &[][..]),
        },
    };
    first_joint.into_iter().chain(legs.iter().map(|leg| leg.hip))
}

/// The joint at the end of a step's chain; foot locks have none and depend on no other step.
fn last_joint(actor: &Actor, aims: &[ActiveLookAt], step: StepKind) -> Option<u32> {
    match step {
        StepKind::Look(number) => Some(aims[number].joint),
        StepKind::Constraint(number) => match &actor.constraints[number].kind {
            ConstraintKind::Aim(aim) => aim.joints.last().copied(),
            ConstraintKind::Reach(reach) => reach.joints.last().copied(),
            ConstraintKind::FootLock(_) | ConstraintKind::Mirror(_) => None,
        },
    }
}

fn is_at_or_below(skeleton: &Skeleton, joint: u32, above: u32) -> bool {
    let parent = |at: &u32| skeleton.parents().get(*at as usize).copied().flatten();
    std::iter::successors(Some(joint), parent).any(|at| at == above)
}
