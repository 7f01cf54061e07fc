//! What goals, limits and springs must be.

use crate::stage::Stage;
use crate::stage::actor::{Actor, Target};
use crate::stage::constraint::{GoalKind, Plant};
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
    for goal in &actor.goals {
        let name = match &goal.kind {
            GoalKind::Reach(_) => "reach",
            GoalKind::Aim(_) => "aim",
            GoalKind::Plant(_) => "plant_feet",
            GoalKind::Mirror(_) => "mirror",
        };
        if let Some(what) = goal.targets().find_map(|t| target(&t)) {
            bad(name, what);
        }
        goal.problems().into_iter().for_each(|what| bad(name, what));
        if let Some(end) = goal.end.filter(|end| *end < goal.start) {
            let (end, start) = (end.as_secs(), goal.start.as_secs());
            bad(name, format!("ends at {end} s, before it starts at {start} s"));
        }
        if let Some(joint) = joints_of(&goal.kind).into_iter().find(|j| *j as usize >= joints) {
            bad(name, format!("joint {joint} does not exist, there are {joints}"));
            continue;
        }
        let chain = match &goal.kind {
            GoalKind::Reach(reach) => &reach.joints,
            GoalKind::Aim(aim) => &aim.joints,
            GoalKind::Plant(plant) => {
                let count = stage.actors.len();
                if let Some(ground) = plant.ground.iter().find(|g| **g >= count) {
                    bad(name, format!("ground actor {ground} does not exist, there are {count}"));
                }
                continue;
            }
            GoalKind::Mirror(mirroring) => {
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
        let fine = match &goal.kind {
            GoalKind::Reach(reach) => {
                chain.len() >= 2
                    && (0.0..=1.0).contains(&reach.soft)
                    && reach.hint.is_finite()
                    && reach.offset.is_none_or(|o| o.is_finite())
            }
            GoalKind::Aim(aim) => {
                aim.shares.iter().all(|s| (0.0..=1e6).contains(s))
                    && (0.0..=std::f64::consts::PI).contains(&aim.limit)
            }
            GoalKind::Plant(_) | GoalKind::Mirror(_) => true,
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

fn joints_of(kind: &GoalKind) -> Vec<u32> {
    match kind {
        GoalKind::Reach(reach) => reach.joints.clone(),
        GoalKind::Aim(aim) => aim.joints.clone(),
        GoalKind::Plant(Plant { legs, hips, .. }) => {
            let of_legs = legs.iter().flat_map(|l| [Some(l.hip), Some(l.knee), Some(l.foot), l.toe]);
            of_legs.chain([*hips]).flatten().collect()
        }
        GoalKind::Mirror(_) => Vec::new(),
    }
}
