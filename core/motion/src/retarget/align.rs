//! Aligns the target skeleton with the source's rest pose.

use super::SkeletonAnalysis;
use crate::math::rotation::{normalize_or_identity, rotation_between};
use crate::retarget::joint_map::JointMap;
use crate::skeleton::Skeleton;
use crate::skeleton::humanoid_joints::{HumanoidJoints, is_below};
use crate::skeleton::model_rest_pose::ModelRestPose;
use glam::{DQuat, DVec3};

/// Mean length of the legs from hip to foot, metres; 0 if there are none.
pub(super) fn leg_length(human: &HumanoidJoints, rest: &ModelRestPose) -> f64 {
    let leg = |side: &str| {
        let position = |name: &str| Some(rest.positions[human.joint(&format!("{side} {name}"))? as usize]);
        let (hip, knee, foot) = (position("upleg")?, position("leg")?, position("foot")?);
        Some((knee - hip).length() + (foot - knee).length())
    };
    match (leg("left"), leg("right")) {
        (Some(l), Some(r)) => (l + r) / 2.0,
        (l, r) => l.or(r).unwrap_or(0.0),
    }
}

/// Yaw that rotates the left side of the source to that of the target, rounded to quarter turns: as a rotation, and in degrees.
pub(super) fn yaw_to_target(source: &SkeletonAnalysis, target: &SkeletonAnalysis) -> (DQuat, f64) {
    let left = |side: &SkeletonAnalysis| {
        let across = |name: &str| {
            let position =
                |s: &str| side.human.joint(&format!("{s} {name}")).map(|j| side.rest.positions[j as usize]);
            let mut across = position("left")? - position("right")?;
            across.y = 0.0;
            (across.length() > 1e-6).then_some(across)
        };
        ["upleg", "shoulder", "arm"].iter().find_map(|name| across(name))
    };
    let (Some(s), Some(t)) = (left(source), left(target)) else { return (DQuat::IDENTITY, 0.0) };
    let angle = libm::atan2(s.cross(t).y, s.dot(t)).to_degrees();
    let quarters = (angle / 90.0).round();
    // Exact quarters, -0 and -180 as 0 and 180.
    match quarters as i32 {
        0 => (DQuat::IDENTITY, 0.0),
        1 => (
            DQuat::from_xyzw(0.0, std::f64::consts::FRAC_1_SQRT_2, 0.0, std::f64::consts::FRAC_1_SQRT_2),
            90.0,
        ),
        -1 => (
            DQuat::from_xyzw(0.0, -std::f64::consts::FRAC_1_SQRT_2, 0.0, std::f64::consts::FRAC_1_SQRT_2),
            -90.0,
        ),
        _ => (DQuat::from_xyzw(0.0, 1.0, 0.0, 0.0), 180.0),
    }
}

/// How a joint of the target is aligned with the source's rest pose.
enum AlignmentRule {
    /// The bone is aligned with the source's by the shortest rotation.
    Limb(u32),
    /// The foot is turned about the vertical only, so that a flat sole stays flat.
    Foot(Option<u32>),
    /// The rest rotation is kept: rigs place the joints of the trunk differently, and no character rests bent.
    Trunk,
    /// The joint turns with its parent.
    Rigid,
}

/// Rotations of the target's joints in model space when the source is at rest.
pub(super) fn aligned_rest_rotations(
    to: &Skeleton,
    map: &JointMap,
    source: &SkeletonAnalysis,
    target: &SkeletonAnalysis,
    yaw: DQuat,
    align: bool,
) -> Vec<DQuat> {
    let rules = if align { alignment_rules(to, map, source, target) } else { Vec::new() };
    let mut corrections: Vec<DQuat> = Vec::with_capacity(to.len());
    for joint in 0..to.len() {
        let parent = to.parents()[joint].map_or(DQuat::IDENTITY, |p| corrections[p as usize]);
        let bone = |tip: u32| {
            let own = target.rest.positions[tip as usize] - target.rest.positions[joint];
            let (a, b) = (map.source(joint as u32)? as usize, map.source(tip)? as usize);
            Some((own, yaw * (source.rest.positions[b] - source.rest.positions[a])))
        };
        let correction = match rules.get(joint) {
            None | Some(AlignmentRule::Trunk) => DQuat::IDENTITY,
            Some(AlignmentRule::Rigid) => parent,
            Some(AlignmentRule::Limb(tip)) => {
                bone(*tip).map_or(parent, |(own, theirs)| rotation_between(parent * own, theirs) * parent)
            }
            Some(AlignmentRule::Foot(tip)) => {
                let flat = |v: DVec3| DVec3::new(v.x, 0.0, v.z);
                let heading =
                    tip.and_then(bone).map(|(own, theirs)| rotation_between(flat(own), flat(theirs)));
                heading.unwrap_or(DQuat::IDENTITY)
            }
        };
        corrections.push(normalize_or_identity(correction));
    }
    corrections
        .iter()
        .zip(&target.rest.rotations)
        .map(|(correction, rest)| normalize_or_identity(*correction * *rest))
        .collect()
}

fn alignment_rules(
    to: &Skeleton,
    map: &JointMap,
    source: &SkeletonAnalysis,
    target: &SkeletonAnalysis,
) -> Vec<AlignmentRule> {
    let mut rules: Vec<AlignmentRule> = (0..to.len()).map(|_| AlignmentRule::Rigid).collect();
    let human = &target.human;
    for (name, joint) in human.joints() {
        let Some(partner) = map.source(*joint) else { continue };
        let (side, part) = name.split_once(' ').unwrap_or(("", name));
        // The next joint of the limb that both have, below this one.
        let tip = |parts: &[&str]| {
            parts.iter().find_map(|part| {
                let tip = human.joint(&format!("{side} {part}"))?;
                let their_tip = map.source(tip)?;
                let below = tip != *joint && is_below(to, tip, *joint) && their_tip != partner;
                (below && source.human.joint(&format!("{side} {part}")) == Some(their_tip)).then_some(tip)
            })
        };
        let limb = |parts: &[&str]| tip(parts).map_or(AlignmentRule::Rigid, AlignmentRule::Limb);
        rules[*joint as usize] = match part {
            "arm" => limb(&["forearm"]),
            "forearm" => limb(&["hand"]),
            "hand" => limb(&["handmiddle1", "handindex1", "handring1"]),
            "upleg" => limb(&["leg"]),
            "leg" => limb(&["foot"]),
            "foot" => AlignmentRule::Foot(tip(&["toebase"])),
            "toebase" | "eye" | "jaw" => AlignmentRule::Rigid,
            _ => match part.strip_prefix("hand").and_then(|finger| Some((finger, finger.chars().last()?))) {
                Some((finger, digit @ ('1' | '2'))) => {
                    let next = if digit == '1' { "2" } else { "3" };
                    let finger = &finger[..finger.len() - 1];
                    limb(&[&format!("hand{finger}{next}")])
                }
                Some(_) => AlignmentRule::Rigid,
                None => AlignmentRule::Trunk,
            },
        };
    }
    for joint in human.spine().iter().chain(human.neck()) {
        rules[*joint as usize] = AlignmentRule::Trunk;
    }
    // Nothing above the hips is turned.
    if let Some(hips) = human.joint("hips") {
        for above in std::iter::successors(Some(hips), |j| to.parents()[*j as usize]) {
            rules[above as usize] = AlignmentRule::Trunk;
        }
    }
    rules
}
