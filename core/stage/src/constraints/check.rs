//! Errors of constraints, limits and springs.

use crate::stage::Stage;
use crate::stage::actor::{Actor, Target};
use crate::stage::constraint::{ConstraintKind, FootLock};
use crate::stage::described::Described;
use choreo_motion::Time;

/// Errors of the constraints, limits and springs of an actor, as place and text.
pub(crate) fn constraint_problems(stage: &Stage, actor: &Actor) -> Vec<(String, String)> {
    let mut found = Vec::new();
    let joints = actor.asset.skeleton.len();
    let mut bad = |place: &str, what: String| found.push((place.to_string(), what));
    for constraint in &actor.constraints {
        let name = constraint.kind.name();
        if let Some(what) = constraint.targets().find_map(|t| target_problem(stage, &t)) {
            bad(name, what);
        }
        constraint.problems().into_iter().for_each(|what| bad(name, what));
        if let Some(end) = constraint.end.filter(|end| *end < constraint.start) {
            let (end, start) = (end.as_secs(), constraint.start.as_secs());
            bad(name, format!("ends at {end} s, before it starts at {start} s"));
        }
        match joints_of(&constraint.kind).into_iter().find(|j| *j as usize >= joints) {
            Some(joint) => bad(name, format!("joint {joint} does not exist (count: {joints})")),
            None => {
                kind_problems(stage, actor, &constraint.kind).into_iter().for_each(|what| bad(name, what))
            }
        }
    }
    for (joint, limit) in &actor.limits {
        if *joint as usize >= joints {
            bad("limit", format!("joint {joint} does not exist (count: {joints})"));
        }
        if let Err(what) = limit.check() {
            bad("limit", what.to_string());
        }
    }
    if let Some(springs) = &actor.springs {
        if let Err(error) = springs.rig.check(joints) {
            bad("springs", error.to_string());
        }
        if !springs.wind.is_finite() {
            bad("springs", format!("the wind is {}, must be finite", springs.wind));
        }
        if springs.pre_roll < Time::ZERO {
            bad("springs", format!("the pre-roll is {} s, must not be negative", springs.pre_roll.as_secs()));
        }
    }
    found
}

fn target_problem(stage: &Stage, target: &Target) -> Option<String> {
    let (index, joint) = match *target {
        Target::Point(p) => {
            return (!p.is_finite()).then(|| format!("the target is {p}, must be finite"));
        }
        Target::Actor(actor) => (actor, None),
        Target::Joint { actor, joint } => (actor, Some(joint)),
    };
    let Some(other) = stage.actors.get(index) else {
        return Some(format!("target actor {index} does not exist (count: {})", stage.actors.len()));
    };
    let count = other.asset.skeleton.len();
    let unknown = joint.filter(|j| *j as usize >= count);
    unknown.map(|j| format!("target joint {j} does not exist (count: {count})"))
}

/// Errors of a constraint whose joints exist.
fn kind_problems(stage: &Stage, actor: &Actor, kind: &ConstraintKind) -> Vec<String> {
    let mut found = Vec::new();
    let mut require = |holds: bool, text: &dyn Fn() -> String| {
        if !holds {
            found.push(text());
        }
    };
    let chain = match kind {
        ConstraintKind::Reach(reach) => {
            let (count, soft, hint) = (reach.joints.len(), reach.soft, reach.hint);
            require(count >= 2, &|| format!("the number of joints is {count}, must be at least 2"));
            require((0.0..=1.0).contains(&soft), &|| format!("soft is {soft}, must be from 0 to 1"));
            require(hint.is_finite(), &|| format!("the hint is {hint}, must be finite"));
            if let Some(offset) = reach.offset {
                require(offset.is_finite(), &|| format!("the offset is {offset}, must be finite"));
            }
            &reach.joints
        }
        ConstraintKind::Aim(aim) => {
            for share in &aim.shares {
                require((0.0..=1e6).contains(share), &|| {
                    format!("a share is {share}, must be from 0 to 1e6")
                });
            }
            let limit = aim.limit;
            let in_range = (0.0..=std::f64::consts::PI).contains(&limit);
            require(in_range, &|| format!("the limit is {limit} rad, must be from 0 to π"));
            &aim.joints
        }
        ConstraintKind::FootLock(foot_lock) => {
            let count = stage.actors.len();
            let unknown = foot_lock.ground.iter().find(|g| **g >= count);
            let text = |g| format!("ground actor {g} does not exist (count: {count})");
            return unknown.map(text).into_iter().collect();
        }
        ConstraintKind::Mirror(mirroring) => {
            let (count, joints) = (mirroring.joints.joint_count(), actor.asset.skeleton.len());
            let text = || format!("the mirror map has {count} joints, the skeleton has {joints}");
            return (count != joints).then(text).into_iter().collect();
        }
    };
    let parents = actor.asset.skeleton.parents();
    let below = |of: u32, joint: u32| {
        std::iter::successors(parents[joint as usize], |at| parents[*at as usize]).any(|at| at == of)
    };
    if chain.is_empty() || chain.windows(2).any(|w| !below(w[0], w[1])) {
        found.push("each joint must be below the one before it".to_string());
    }
    found
}

fn joints_of(kind: &ConstraintKind) -> Vec<u32> {
    match kind {
        ConstraintKind::Reach(reach) => reach.joints.clone(),
        ConstraintKind::Aim(aim) => aim.joints.clone(),
        ConstraintKind::FootLock(FootLock { legs, hips, .. }) => {
            let of_legs = legs.iter().flat_map(|l| [Some(l.hip), Some(l.knee), Some(l.foot), l.toe]);
            of_legs.chain([*hips]).flatten().collect()
        }
        ConstraintKind::Mirror(_) => Vec::new(),
    }
}
