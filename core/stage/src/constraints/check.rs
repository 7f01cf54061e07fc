//! What constraints, limits and springs must be.

use crate::stage::Stage;
use crate::stage::actor::{Actor, Target};
use crate::stage::constraint::{ConstraintKind, FootLock};
use crate::stage::described::Described;
use choreo_motion::Time;

/// What is wrong with an actor's, as place and text.
pub(crate) fn problems(stage: &Stage, actor: &Actor) -> Vec<(String, String)> {
    let mut found = Vec::new();
    let joints = actor.asset.skeleton.len();
    let mut bad = |place: &str, what: String| found.push((place.to_string(), what));
    let target = |target: &Target| -> Option<String> {
        let (index, joint) = match *target {
            Target::Point(p) => {
                return (!p.is_finite()).then(|| format!("the target is {p}, must be finite"));
            }
            Target::Actor(actor) => (actor, None),
            Target::Joint { actor, joint } => (actor, Some(joint)),
        };
        let Some(other) = stage.actors.get(index) else {
            return Some(format!("target actor {index} does not exist, there are {}", stage.actors.len()));
        };
        let count = other.asset.skeleton.len();
        let unknown = joint.filter(|j| *j as usize >= count);
        unknown.map(|j| format!("target joint {j} does not exist, there are {count}"))
    };
    for constraint in &actor.constraints {
        let name = match &constraint.kind {
            ConstraintKind::Reach(_) => "reach",
            ConstraintKind::Aim(_) => "aim",
            ConstraintKind::FootLock(_) => "plant_feet",
            ConstraintKind::Mirror(_) => "mirror",
        };
        if let Some(what) = constraint.targets().find_map(|t| target(&t)) {
            bad(name, what);
        }
        constraint.problems().into_iter().for_each(|what| bad(name, what));
        if let Some(end) = constraint.end.filter(|end| *end < constraint.start) {
            let (end, start) = (end.as_secs(), constraint.start.as_secs());
            bad(name, format!("ends at {end} s, before it starts at {start} s"));
        }
        if let Some(joint) = joints_of(&constraint.kind).into_iter().find(|j| *j as usize >= joints) {
            bad(name, format!("joint {joint} does not exist, there are {joints}"));
            continue;
        }
        let chain = match &constraint.kind {
            ConstraintKind::Reach(reach) => &reach.joints,
            ConstraintKind::Aim(aim) => &aim.joints,
            ConstraintKind::FootLock(foot_lock) => {
                let count = stage.actors.len();
                if let Some(ground) = foot_lock.ground.iter().find(|g| **g >= count) {
                    bad(name, format!("ground actor {ground} does not exist, there are {count}"));
                }
                continue;
            }
            ConstraintKind::Mirror(mirroring) => {
                let count = mirroring.joints.joint_count();
                if count != joints {
                    bad(name, format!("the map is of {count} joints, the skeleton has {joints}"));
                }
                continue;
            }
        };
        let parents = actor.asset.skeleton.parents();
        let below = |of: u32, joint: u32| {
            let mut at = parents[joint as usize];
            while let Some(parent) = at {
                if parent == of {
                    return true;
                }
                at = parents[parent as usize];
            }
            false
        };
        if chain.is_empty() || chain.windows(2).any(|w| !below(w[0], w[1])) {
            bad(name, "each joint must be below the one before it".into());
        }
        let fine = match &constraint.kind {
            ConstraintKind::Reach(reach) => {
                chain.len() >= 2
                    && (0.0..=1.0).contains(&reach.soft)
                    && reach.hint.is_finite()
                    && reach.offset.is_none_or(|o| o.is_finite())
            }
            ConstraintKind::Aim(aim) => {
                aim.shares.iter().all(|s| (0.0..=1e6).contains(s))
                    && (0.0..=std::f64::consts::PI).contains(&aim.limit)
            }
            ConstraintKind::FootLock(_) | ConstraintKind::Mirror(_) => true,
        };
        if !fine {
            bad(name, "a number is out of range".into());
        }
    }
    for (joint, limit) in &actor.limits {
        if *joint as usize >= joints {
            bad("limit", format!("joint {joint} does not exist, there are {joints}"));
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
            bad("springs", "the pre-roll is negative".into());
        }
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
