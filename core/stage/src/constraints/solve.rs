//! Solves the constraints of all actors at a time, actor by actor.

use crate::actors;
use crate::constraints::foot_lock_cache::{FootLockContext, FootLocks};
use crate::constraints::gaze::Gaze;
use crate::constraints::steps::{ConstraintSteps, StepKind, TargetTiming};
use crate::constraints::{foot_lock, look_at, order};
use crate::pose::expressions::ExpressionWeights;
use crate::pose::joints::{PosedSkeleton, rotation_of};
use crate::pose::motions::Motions;
use crate::snapshot::ActorState;
use crate::stage::actor::{Actor, Attachment, Target};
use crate::stage::constraint::{AimConstraint, Constraint, ConstraintKind, Leg, ReachConstraint};
use crate::stage::parenting::ParentScale;
use crate::stage::solvers::SolverSettings;
use crate::stage::{Stage, StageError};
use crate::transforms::parents::world_from_parent;
use crate::transforms::target_position;
use choreo_asset::widen;
use choreo_motion::Time;
use choreo_motion::ik::{Aim, AimJoint, Chain, ChainBone, Limit, TwoBone};
use choreo_motion::math::rotation::rotation_fraction;
use glam::DVec3;
use glam::{DAffine3, DQuat};
use std::sync::Arc;

/// Reusable buffers; their previous contents do not matter.
#[derive(Clone, Debug, Default)]
pub(crate) struct ConstraintScratch {
    pub order: order::ConstraintOrder,
    /// World positions of the targets of a round: (actor, constraint, target, pole).
    targets: Vec<(usize, usize, DVec3, Option<DVec3>)>,
    /// Whether each joint is the turned one or a descendant of it.
    is_descendant: Vec<bool>,
    chain: Chain,
    aim: Vec<AimJoint>,
    turns: Vec<DQuat>,
    aims: Vec<look_at::ActiveLookAt>,
    steps: ConstraintSteps,
    /// An actor's pose before its constraints, and the poses of a cycle of actors.
    pose: Vec<glam::Affine3A>,
    poses: Vec<glam::Affine3A>,
}

/// Solves all constraints of all actors. After a round that moves joints which carry other actors, all actors are placed again.
pub(crate) fn solve_all_constraints(
    stage: &Stage,
    foot_locks: &FootLocks,
    time: Time,
    scratch: &mut ConstraintScratch,
    placing: &mut actors::ActorScratch,
    actors: &mut [ActorState],
) -> Result<(), StageError> {
    order::sort_into_rounds(stage, time, &placing.parents, &mut scratch.order);
    if scratch.order.actors.is_empty() {
        return Ok(());
    }
    let motions = placing.motions.clone().unwrap_or_else(|| Arc::new(Motions::new(stage)));
    let mut round_start = 0;
    for round in 0..scratch.order.ends.len() {
        let (round_end, circular) = (scratch.order.ends[round], scratch.order.circular[round]);
        find_targets(stage, time, scratch, round_start..round_end, actors);
        let solver = |index| ActorSolver { stage, foot_locks, motions: &motions, time, index, circular };
        // Actors that are not posed are skipped.
        let is_posed = |actors: &[ActorState], index: usize| {
            actors[index].model_from_joint.len() == stage.actors[index].asset.skeleton.len()
        };
        if circular {
            scratch.poses.clear();
            for at in round_start..round_end {
                let index = scratch.order.actors[at];
                scratch.poses.extend_from_slice(&actors[index].model_from_joint);
                if is_posed(actors, index) {
                    solver(index).run_trial_steps(scratch, placing, actors)?;
                }
            }
            placing.place(stage, actors);
            update_look_targets(stage, scratch, actors);
            let mut from = 0;
            for at in round_start..round_end {
                let pose = &mut actors[scratch.order.actors[at]].model_from_joint;
                let end = from + pose.len();
                pose.copy_from_slice(&scratch.poses[from..end]);
                from = end;
            }
            placing.place(stage, actors);
        }
        let mut carried = false;
        for at in round_start..round_end {
            let index = scratch.order.actors[at];
            if is_posed(actors, index) {
                solver(index).solve(scratch, placing, actors)?;
                carried |= placing.parents.has_children_on_joints(index);
            }
        }
        if carried {
            placing.place(stage, actors);
        }
        round_start = round_end;
    }
    Ok(())
}

/// Updates the targets of looks and aims in a cycle of actors, after a trial has moved all of them. Reaches keep their targets: two hands
/// that reach for each other would return to where they were.
fn update_look_targets(stage: &Stage, scratch: &mut ConstraintScratch, actors: &[ActorState]) {
    for aim in &mut scratch.aims {
        aim.world_target = target_position(stage, actors, &aim.target).unwrap_or(aim.world_target);
    }
    for (actor, number, target, _) in &mut scratch.targets {
        if let ConstraintKind::Aim(aim) = &stage.actors[*actor].constraints[*number].kind {
            *target = target_position(stage, actors, &aim.target).unwrap_or(*target);
        }
    }
}

/// Finds the positions of the targets of a round before any of its actors moves.
fn find_targets(
    stage: &Stage,
    time: Time,
    scratch: &mut ConstraintScratch,
    round: std::ops::Range<usize>,
    actors: &[ActorState],
) {
    scratch.targets.clear();
    scratch.aims.clear();
    for &index in &scratch.order.actors[round] {
        for (number, constraint) in stage.actors[index].constraints.iter().enumerate() {
            if constraint.weight_at(time) > 0.0
                && let Some((target, pole)) = current_target_and_pole(stage, actors, constraint)
            {
                scratch.targets.push((index, number, target, pole));
            }
        }
        look_at::find_aims_of(stage, time, actors, index, &mut scratch.aims);
    }
}

/// World positions of the target and the pole of a constraint.
pub(crate) fn current_target_and_pole(
    stage: &Stage,
    actors: &[ActorState],
    constraint: &Constraint,
) -> Option<(DVec3, Option<DVec3>)> {
    match &constraint.kind {
        ConstraintKind::FootLock(_) | ConstraintKind::Mirror(_) => None,
        ConstraintKind::Aim(aim) => Some((target_position(stage, actors, &aim.target)?, None)),
        ConstraintKind::Reach(reach) => {
            let at = match (reach.offset, reach.target) {
                (None, target) => target_position(stage, actors, &target)?,
                (Some(offset), Target::Point(p)) => p + offset,
                (Some(offset), Target::Actor(actor)) => {
                    target_with_offset(stage, actors, actor, None, offset)?
                }
                (Some(offset), Target::Joint { actor, joint }) => {
                    target_with_offset(stage, actors, actor, Some(joint), offset)?
                }
            };
            let pole = reach.pole.and_then(|pole| target_position(stage, actors, &pole));
            at.is_finite().then_some((at, pole))
        }
    }
}

fn target_with_offset(
    stage: &Stage,
    actors: &[ActorState],
    actor: usize,
    joint: Option<u32>,
    offset: DVec3,
) -> Option<DVec3> {
    stage.actors.get(actor)?;
    let at = Attachment { actor, joint };
    // An offset from an actor is in the actor's units, an offset from a joint in metres.
    let scale = if joint.is_some() { ParentScale::Keep } else { ParentScale::Inherit };
    Some(world_from_parent(stage, actors, &at, scale).transform_point3(offset))
}

/// Number of trials for an actor whose own steps depend on each other in a cycle. A spine that takes a quarter of an aim leaves an error
/// of 4° after one trial and 0.1° after three.
const TARGET_TRIALS: usize = 3;

/// An actor whose constraints are solved.
struct ActorSolver<'a> {
    stage: &'a Stage,
    foot_locks: &'a FootLocks,
    motions: &'a Arc<Motions>,
    time: Time,
    index: usize,
    /// Whether the actor belongs to a cycle of actors that depend on each other; its look targets then come from a trial.
    circular: bool,
}

impl ActorSolver<'_> {
    /// Runs the steps once as a trial, without the eyes and the face.
    fn run_trial_steps(
        &self,
        scratch: &mut ConstraintScratch,
        placing: &mut actors::ActorScratch,
        actors: &mut [ActorState],
    ) -> Result<(), StageError> {
        if !actors[self.index].world_from_model.inverse().is_finite() {
            return Ok(());
        }
        scratch.steps.find_and_sort(self.stage, &placing.parents, self.time, self.index, &scratch.aims);
        self.run_steps(true, scratch, placing, actors)
    }

    fn solve(
        &self,
        scratch: &mut ConstraintScratch,
        placing: &mut actors::ActorScratch,
        actors: &mut [ActorState],
    ) -> Result<(), StageError> {
        let ActorSolver { stage, time, index, .. } = *self;
        if !actors[index].world_from_model.inverse().is_finite() {
            return Ok(());
        }
        scratch.steps.find_and_sort(stage, &placing.parents, time, index, &scratch.aims);
        if !self.circular
            && scratch.steps.ordered.iter().any(|step| step.target == TargetTiming::AfterAllSteps)
        {
            // The effect of the steps on the targets is found by executing them, without the eyes and the face.
            scratch.pose.clone_from(&actors[index].model_from_joint);
            for _ in 0..TARGET_TRIALS {
                self.run_steps(true, scratch, placing, actors)?;
                placing.place(stage, actors);
                self.find_late_targets(scratch, actors);
                actors[index].model_from_joint.clone_from(&scratch.pose);
            }
        }
        self.run_steps(false, scratch, placing, actors)?;
        clamp_to_limits(stage, index, scratch, actors);
        Ok(())
    }

    fn run_steps(
        &self,
        trial: bool,
        scratch: &mut ConstraintScratch,
        placing: &mut actors::ActorScratch,
        actors: &mut [ActorState],
    ) -> Result<(), StageError> {
        for at in 0..scratch.steps.ordered.len() {
            let step = scratch.steps.ordered[at];
            let timing = if self.circular && !trial { TargetTiming::Before } else { step.target };
            if timing == TargetTiming::AfterPreviousSteps {
                placing.place(self.stage, actors);
            }
            let face = (!trial).then(|| &mut placing.expression_weights[self.index]);
            match step.kind {
                StepKind::Constraint(number) => {
                    self.apply_constraint(number, timing, scratch, face, actors)?
                }
                StepKind::Look(number) => self.apply_look_at(number, timing, scratch, face, actors),
            }
        }
        Ok(())
    }

    fn apply_constraint(
        &self,
        number: usize,
        timing: TargetTiming,
        scratch: &mut ConstraintScratch,
        face: Option<&mut ExpressionWeights>,
        actors: &mut [ActorState],
    ) -> Result<(), StageError> {
        let ActorSolver { stage, foot_locks, motions, time, index, .. } = *self;
        let actor = &stage.actors[index];
        let constraint = &actor.constraints[number];
        let share = constraint.weight_at(time);
        let world_from_model = actors[index].world_from_model;
        let model_from_world = world_from_model.inverse();
        if let ConstraintKind::FootLock(foot_lock) = &constraint.kind {
            let context = FootLockContext { stage, motions, actor: index, constraint: number, foot_lock };
            let Some(track) = foot_locks.track_at(context, time)? else { return Ok(()) };
            let mut posed = PosedSkeleton {
                skeleton: &actor.asset.skeleton,
                model_from_joint: &mut actors[index].model_from_joint,
                is_descendant: &mut scratch.is_descendant,
            };
            let spaces = [&world_from_model, &model_from_world];
            foot_lock::apply_foot_lock(&track, foot_lock, time, share, spaces[0], spaces[1], &mut posed);
            return Ok(());
        }
        let found = target_and_pole_for_step(stage, scratch, (index, number), constraint, timing, actors);
        let Some((target, pole)) = found else { return Ok(()) };
        let target = model_from_world.transform_point3(target);
        let pole = pole.map(|p| model_from_world.transform_point3(p));
        let state = &mut actors[index];
        solve_constraint(actor, &constraint.kind, share, (target, pole), &stage.solvers, scratch, state);
        if let (ConstraintKind::Aim(aim), Some(face)) = (&constraint.kind, face) {
            let gaze = Gaze { actor, joint: last_joint_index(&aim.joints) as u32, target, share, time };
            turn_eyes(&gaze, index, scratch, state, face);
        }
        Ok(())
    }

    fn apply_look_at(
        &self,
        number: usize,
        timing: TargetTiming,
        scratch: &mut ConstraintScratch,
        face: Option<&mut ExpressionWeights>,
        actors: &mut [ActorState],
    ) {
        let ActorSolver { stage, time, index, .. } = *self;
        let mut aim = scratch.aims[number];
        if timing == TargetTiming::AfterPreviousSteps {
            aim.world_target = target_position(stage, actors, &aim.target).unwrap_or(aim.world_target);
        }
        let state = &mut actors[index];
        look_at::turn_joint_to_target(stage, &aim, state, &mut scratch.is_descendant);
        if let Some(face) = face {
            let target = state.world_from_model.inverse().transform_point3(aim.world_target);
            let actor = &stage.actors[index];
            let gaze = Gaze { actor, joint: aim.joint, target, share: aim.share, time };
            turn_eyes(&gaze, index, scratch, state, face);
        }
    }

    /// Updates the targets whose positions are known only after all steps.
    fn find_late_targets(&self, scratch: &mut ConstraintScratch, actors: &[ActorState]) {
        let ConstraintScratch { steps, targets, aims, .. } = scratch;
        let late = steps.ordered.iter().filter(|step| step.target == TargetTiming::AfterAllSteps);
        for step in late {
            match step.kind {
                StepKind::Constraint(number) => {
                    let constraint = &self.stage.actors[self.index].constraints[number];
                    let of = |t: &&mut (usize, usize, DVec3, _)| (t.0, t.1) == (self.index, number);
                    if let Some(found) = targets.iter_mut().find(of)
                        && let Some((target, pole)) = current_target_and_pole(self.stage, actors, constraint)
                    {
                        (found.2, found.3) = (target, pole);
                    }
                }
                StepKind::Look(number) => {
                    let aim = &mut aims[number];
                    let target = target_position(self.stage, actors, &aim.target);
                    aim.world_target = target.unwrap_or(aim.world_target);
                }
            }
        }
    }
}

/// World positions of the target and the pole of a constraint. `of`: index of the actor, and index of its constraint.
fn target_and_pole_for_step(
    stage: &Stage,
    scratch: &ConstraintScratch,
    of: (usize, usize),
    constraint: &Constraint,
    timing: TargetTiming,
    actors: &[ActorState],
) -> Option<(DVec3, Option<DVec3>)> {
    // A target on the actor itself moves with the steps that have run so far.
    let own = |t| matches!(t, Target::Joint { actor, .. } if actor == of.0);
    if timing == TargetTiming::AfterPreviousSteps
        || (timing == TargetTiming::Before && constraint.targets().all(own))
    {
        return current_target_and_pole(stage, actors, constraint);
    }
    let found = scratch.targets.iter().find(|(actor, number, ..)| (*actor, *number) == of);
    found.map(|(_, _, target, pole)| (*target, *pole))
}

/// Solves an aim or a reach. Target and pole are in model space.
fn solve_constraint(
    actor: &Actor,
    kind: &ConstraintKind,
    share: f64,
    (target, pole): (DVec3, Option<DVec3>),
    solvers: &SolverSettings,
    scratch: &mut ConstraintScratch,
    state: &mut ActorState,
) {
    let rest = actor.asset.rest_model_from_joint();
    let mut posed = PosedSkeleton {
        skeleton: &actor.asset.skeleton,
        model_from_joint: &mut state.model_from_joint,
        is_descendant: &mut scratch.is_descendant,
    };
    match kind {
        ConstraintKind::Aim(aim) => {
            let forward =
                look_at::forward_in_joint(&rest[last_joint_index(&aim.joints)], actor.asset.front());
            solve_aim(aim, share, target, forward, &mut scratch.aim, &mut scratch.turns, &mut posed);
        }
        ConstraintKind::Reach(reach) => {
            solve_reach(
                reach,
                share,
                target,
                pole,
                &actor.limits,
                rest,
                solvers,
                &mut scratch.chain,
                &mut posed,
            );
        }
        ConstraintKind::FootLock(_) | ConstraintKind::Mirror(_) => {}
    }
}

/// Turns the eyes of an actor after its head has turned, except eyes with a look-at of their own.
fn turn_eyes(
    gaze: &Gaze,
    index: usize,
    scratch: &mut ConstraintScratch,
    state: &mut ActorState,
    expression_weights: &mut ExpressionWeights,
) {
    let aimed = |eye| scratch.aims.iter().any(|a| (a.actor, a.joint) == (index, eye));
    gaze.turn_eyes(aimed, state, &mut scratch.is_descendant, expression_weights);
}

fn last_joint_index(joints: &[u32]) -> usize {
    joints.last().map_or(0, |j| *j as usize)
}

fn solve_aim(
    aim: &AimConstraint,
    share: f64,
    target: DVec3,
    forward_in_joint: glam::Vec3A,
    joints: &mut Vec<AimJoint>,
    turns: &mut Vec<DQuat>,
    posed: &mut PosedSkeleton,
) {
    joints.clear();
    let shares = aim.shares.iter().copied().chain(std::iter::repeat(1.0));
    joints.extend(
        aim.joints.iter().zip(shares).map(|(j, share)| AimJoint { position: posed.position(*j), share }),
    );
    turns.clear();
    turns.resize(joints.len(), DQuat::IDENTITY);
    let head = &posed.model_from_joint[last_joint_index(&aim.joints)];
    let forward = glam::Vec3::from(head.matrix3 * forward_in_joint).as_dvec3();
    Aim { joints, forward, target, limit: aim.limit, weight: share }.run(turns);
    let mut before = DQuat::IDENTITY;
    for (joint, turn) in aim.joints.iter().zip(turns.iter()) {
        posed.turn(*joint, *turn * before.inverse());
        before = *turn;
    }
}

#[expect(clippy::too_many_arguments, reason = "what a reach depends on")]
fn solve_reach(
    reach: &ReachConstraint,
    share: f64,
    target: DVec3,
    pole: Option<DVec3>,
    limits: &[(u32, Limit)],
    rest: &[glam::Affine3A],
    solvers: &SolverSettings,
    chain: &mut Chain,
    posed: &mut PosedSkeleton,
) {
    let Some((&end, bones)) = reach.joints.split_last() else { return };
    let before = posed.rotation(end);
    // A partial share moves the hand only part of the way.
    let target = posed.position(end).lerp(target, share);
    let limited = bones.iter().any(|j| limits.iter().any(|(joint, _)| joint == j));
    if let ([start, middle], false) = (bones, limited) {
        let limb = TwoBone {
            start: posed.position(*start),
            middle: posed.position(*middle),
            end: posed.position(end),
            target,
            pole: pole.map(|p| posed.position(*middle).lerp(p, share)),
            hint: reach.hint,
            soft: reach.soft * share,
        };
        if let Some(turned) = limb.solve() {
            posed.turn(*start, turned.start);
            posed.turn(*middle, turned.middle * turned.start.inverse());
        }
    } else {
        solve_chain(reach, bones, target, limits, rest, solvers, chain, posed);
    }
    if reach.keep_rotation {
        let turned = before * posed.rotation(end).inverse();
        posed.turn(end, rotation_fraction(turned, share));
    }
}

#[expect(clippy::too_many_arguments, reason = "the chain, its goal and the buffers of one call")]
fn solve_chain(
    reach: &ReachConstraint,
    bones: &[u32],
    target: DVec3,
    limits: &[(u32, Limit)],
    rest: &[glam::Affine3A],
    solvers: &SolverSettings,
    chain: &mut Chain,
    posed: &mut PosedSkeleton,
) {
    let Some(&first) = bones.first() else { return };
    let parents = posed.skeleton.parents();
    let parent_of = |joint: u32| parents[joint as usize];
    let turned = |joint: Option<u32>| joint.map_or(DQuat::IDENTITY, |j| posed.rotation(j));
    let rested = |joint: Option<u32>| joint.map_or(DQuat::IDENTITY, |j| rotation_of(&rest[j as usize]));
    chain.origin = posed.position(first);
    chain.parent = turned(parent_of(first));
    chain.bones.clear();
    let mut above = parent_of(first);
    for (bone, next) in bones.iter().zip(&reach.joints[1..]) {
        let rotation = posed.rotation(*bone);
        chain.bones.push(ChainBone {
            rotation: (turned(above).inverse() * rotation).normalize(),
            rest: (rested(above).inverse() * rotation_of(&rest[*bone as usize])).normalize(),
            offset: rotation.inverse() * (posed.position(*next) - posed.position(*bone)),
            limit: limits.iter().find(|(j, _)| j == bone).map_or(Limit::Free, |(_, limit)| *limit),
        });
        above = Some(*bone);
    }
    let before: Vec<DQuat> = bones.iter().map(|b| posed.rotation(*b)).collect();
    chain.solve(target, solvers.chain_solver, solvers.chain_iterations, solvers.chain_tolerance);
    let (mut now, mut done) = (chain.parent, DQuat::IDENTITY);
    for ((joint, bone), before) in bones.iter().zip(&chain.bones).zip(before) {
        now = (now * bone.rotation).normalize();
        let whole = now * before.inverse();
        posed.turn(*joint, whole * done.inverse());
        done = whole;
    }
}

/// Turns joints back that clips or constraints have turned beyond their limits.
fn clamp_to_limits(stage: &Stage, index: usize, scratch: &mut ConstraintScratch, actors: &mut [ActorState]) {
    let actor = &stage.actors[index];
    let rest = actor.asset.rest_model_from_joint();
    let skeleton = &actor.asset.skeleton;
    let mut posed = PosedSkeleton {
        skeleton,
        model_from_joint: &mut actors[index].model_from_joint,
        is_descendant: &mut scratch.is_descendant,
    };
    for (joint, limit) in actor.limits.iter().filter(|(j, _)| (*j as usize) < rest.len()) {
        let parent = skeleton.parents()[*joint as usize];
        let turned = parent.map_or(DQuat::IDENTITY, |p| posed.rotation(p));
        let rested = parent.map_or(DQuat::IDENTITY, |p| rotation_of(&rest[p as usize]));
        let now = posed.rotation(*joint);
        let (local, rest) = (turned.inverse() * now, rested.inverse() * rotation_of(&rest[*joint as usize]));
        if limit.excess(rest, local) > 1e-6 {
            let kept = turned * limit.clamp(rest, local);
            posed.turn(*joint, kept * now.inverse());
        }
    }
}

/// Bends a leg with two-bone IK so that its foot comes to `target` and keeps its rotation; model space.
pub(super) fn bend_leg(leg: &Leg, target: DVec3, hint: DVec3, posed: &mut PosedSkeleton) {
    let rotation = posed.rotation(leg.foot);
    let [start, middle, end] = [leg.hip, leg.knee, leg.foot].map(|j| posed.position(j));
    // No softness: the foot must stay in place as long as the leg reaches.
    let limb = TwoBone { start, middle, end, target, pole: None, hint, soft: 0.0 };
    if let Some(turned) = limb.solve() {
        posed.turn(leg.hip, turned.start);
        posed.turn(leg.knee, turned.middle * turned.start.inverse());
        if !posed.is_below(leg.foot, leg.knee) {
            posed.shift(leg.foot, turned.new_end - end);
        }
        let back = rotation * posed.rotation(leg.foot).inverse();
        posed.turn(leg.foot, back);
    }
}

/// World position of a joint.
pub(crate) fn joint_world_position(world_from_model: &DAffine3, joint: &glam::Affine3A) -> DVec3 {
    world_from_model.transform_point3(widen(joint).translation)
}
