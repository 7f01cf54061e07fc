//! How much of a clip another skeleton follows, and which parts of the body stay at rest.

use crate::clip::Clip;
use crate::skeleton::Skeleton;
use crate::skeleton::humanoid_joints::{HumanoidJoints, is_below};
use std::collections::BTreeSet;

/// Body parts that messages name if they do not follow, from the trunk outwards.
const REPORTED_BODY_PARTS: [&str; 9] = [
    "hips",
    "spine",
    "head",
    "left arm",
    "right arm",
    "left leg",
    "right leg",
    "left fingers",
    "right fingers",
];

/// A hand with this many unmatched joints below it has fingers: a held prop has one or two joints.
const MIN_FINGER_JOINTS: usize = 3;

/// The part of a clip that another skeleton follows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Coverage {
    /// Joints that the clip moves.
    pub moved: usize,
    /// Joints that the clip moves and that no joint of the other skeleton follows.
    pub left_out: Vec<String>,
    /// Parts of the body that stay at rest although the clip moves them: "left arm", "spine", "right fingers".
    pub parts: Vec<&'static str>,
}

/// The joints of both skeletons that belong together.
pub(super) struct JointPartners {
    /// Joints of the source that are followed.
    pub followed: BTreeSet<u32>,
    /// Joints of the target that follow one.
    pub following: BTreeSet<u32>,
    /// Joints of the target that follow none by choice of the caller.
    pub forbidden: BTreeSet<u32>,
}

impl Coverage {
    /// Moved joints of the source that joints of the target follow.
    pub fn followed(&self) -> usize {
        self.moved - self.left_out.len()
    }

    pub(super) fn of(
        clip: &Clip,
        [from, to]: [&Skeleton; 2],
        [source, target]: [&HumanoidJoints; 2],
        partners: &JointPartners,
    ) -> Coverage {
        let moved: BTreeSet<u32> = clip.curves().iter().map(|c| c.joint).collect();
        let names = |joint: &u32| from.names().get(*joint as usize).cloned();
        let left_out: Vec<String> = moved.difference(&partners.followed).filter_map(names).collect();
        let mut coverage = Coverage { moved: moved.len(), left_out, parts: Vec::new() };
        if coverage.left_out.is_empty() {
            return coverage;
        }
        let (own, theirs) = (joints_by_body_part(source), joints_by_body_part(target));
        let stays_at_rest = |part: &&str| {
            let joints = |of: &[(&str, u32)]| -> Vec<u32> {
                of.iter().filter(|(name, _)| name == part).map(|(_, joint)| *joint).collect()
            };
            let (own, theirs) = (joints(&own), joints(&theirs));
            if theirs.iter().any(|j| partners.forbidden.contains(j)) {
                return false;
            }
            let mut moving = own.iter().filter(|j| moved.contains(j)).peekable();
            if moving.peek().is_some() {
                let fingers = part.strip_suffix(" fingers");
                return !moving.any(|j| partners.followed.contains(j))
                    && fingers.is_none_or(|side| has_fingers(to, target, side, partners));
            }
            // The part is known in the target only: the source has it under a name that is not known.
            own.is_empty()
                && !theirs.is_empty()
                && !part.ends_with(" fingers")
                && !theirs.iter().any(|j| partners.following.contains(j))
        };
        coverage.parts = REPORTED_BODY_PARTS.into_iter().filter(stays_at_rest).collect();
        coverage
    }
}

/// Joints of each body part. Collarbones and toes alone are no arm and no leg.
fn joints_by_body_part(human: &HumanoidJoints) -> Vec<(&'static str, u32)> {
    let mut out: Vec<(&'static str, u32)> = Vec::new();
    for (name, joint) in human.joints() {
        let (side, base) = name.split_once(' ').unwrap_or(("", name));
        let sided = |left: &'static str, right: &'static str| if side == "left" { left } else { right };
        let part = match base {
            "hips" => "hips",
            "spine" | "spine1" | "spine2" => "spine",
            "neck" | "head" => "head",
            "arm" | "forearm" | "hand" => sided("left arm", "right arm"),
            "upleg" | "leg" | "foot" => sided("left leg", "right leg"),
            _ if base.starts_with("hand") => sided("left fingers", "right fingers"),
            _ => continue,
        };
        out.push((part, *joint));
    }
    out.extend(human.spine().iter().map(|joint| ("spine", *joint)));
    out.extend(human.neck().iter().map(|joint| ("head", *joint)));
    out
}

/// Whether a hand of the target has more joints below it than a held prop has, none of which follows a source joint.
fn has_fingers(to: &Skeleton, target: &HumanoidJoints, side: &str, partners: &JointPartners) -> bool {
    let Some(hand) = target.joint(&format!("{side} hand")) else { return false };
    let below: Vec<u32> = (0..to.len() as u32).filter(|j| *j != hand && is_below(to, *j, hand)).collect();
    below.len() >= MIN_FINGER_JOINTS && !below.iter().any(|j| partners.following.contains(j))
}
