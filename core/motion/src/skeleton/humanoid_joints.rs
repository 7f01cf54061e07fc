//! Finds the joints of a humanoid in a skeleton: which joint is the hips, the left upper arm and so on.

use crate::skeleton::Skeleton;
use crate::skeleton::joint_names::humanoid_name;
use crate::skeleton::model_rest_pose::ModelRestPose;
use crate::skeleton::sides::{Side, side_of};
use crate::skeleton::symmetry::find_partners;
use std::collections::BTreeMap;

/// Joints of a humanoid by the names of `humanoid_name`: "hips", "left arm", "right toebase", …
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HumanoidJoints {
    joints: BTreeMap<String, u32>,
    /// Spine joints, from above the hips to the joint that carries the arms.
    spine: Vec<u32>,
    /// Neck joints, from above the spine to below the head.
    neck: Vec<u32>,
}

/// Joints of a leg and of an arm, from the trunk outwards.
const LEG: [&str; 3] = ["upleg", "leg", "foot"];
const ARM: [&str; 3] = ["arm", "forearm", "hand"];

impl HumanoidJoints {
    /// Finds joints first by the bones that the file itself declares, as VRM does ([`Skeleton::humanoid`]); then by joint names;
    /// then by structure: two legs, and above them two arms, whose chains branch off central joints.
    pub fn of(skeleton: &Skeleton) -> HumanoidJoints {
        let mut human = HumanoidJoints::default();
        if let Some(given) = skeleton.humanoid() {
            human.joints.extend(given.bones().map(|(bone, joint)| (bone.choreo_name().to_string(), joint)));
        }
        human.assign_by_names(skeleton);
        human.assign_by_structure(skeleton);
        human.assign_hips_above_thighs(skeleton);
        human.assign_wrists_as_hands(skeleton);
        let trunk = human.find_spine_and_neck(skeleton);
        (human.spine, human.neck) = trunk;
        human
    }

    /// The joint with a name of `humanoid_name`, such as "left arm".
    pub fn joint(&self, name: &str) -> Option<u32> {
        self.joints.get(name).copied()
    }

    /// All joints, keyed by the names that `humanoid_name` returns.
    pub fn joints(&self) -> &BTreeMap<String, u32> {
        &self.joints
    }

    /// Spine joints, from above the hips to the joint that carries the arms.
    pub fn spine(&self) -> &[u32] {
        &self.spine
    }

    /// Neck joints, from above the spine to below the head.
    pub fn neck(&self) -> &[u32] {
        &self.neck
    }

    /// Whether hips, both legs and both arms were found: enough to retarget as a humanoid.
    pub fn is_humanoid(&self) -> bool {
        let sides = ["left", "right"].iter();
        let mut names =
            sides.flat_map(|side| LEG[..2].iter().chain(&ARM[..2]).map(move |n| format!("{side} {n}")));
        self.joint("hips").is_some() && names.all(|name| self.joint(&name).is_some())
    }

    fn is_assigned(&self, joint: u32) -> bool {
        self.joints.values().any(|j| *j == joint)
    }

    fn assign_by_names(&mut self, skeleton: &Skeleton) {
        let mut found: BTreeMap<String, Option<u32>> = BTreeMap::new();
        let children = children_of_joints(skeleton);
        for (joint, name) in (0u32..).zip(skeleton.names()) {
            let Some(name) = humanoid_name(name) else { continue };
            // A mesh often has the same name as its parent joint or a sibling joint. The ancestor is meant, or the sibling that
            // has children; otherwise nothing is guessed.
            let resolve_duplicate = |first: &mut Option<u32>| {
                let ends = |j: u32| children[j as usize].is_empty();
                let parent = |j: u32| skeleton.parents()[j as usize];
                *first = first.and_then(|first| match (ends(first), ends(joint)) {
                    _ if is_below(skeleton, joint, first) => Some(first),
                    (true, false) if parent(first) == parent(joint) => Some(joint),
                    (false, true) if parent(first) == parent(joint) => Some(first),
                    _ => None,
                });
            };
            found.entry(name).and_modify(resolve_duplicate).or_insert(Some(joint));
        }
        for (name, joint) in found {
            if let Some(joint) = joint
                && !self.is_assigned(joint)
            {
                self.joints.entry(name).or_insert(joint);
            }
        }
    }

    /// The joint that carries both thighs is the hips, whatever its name: "spine" in Rigify, "root" in CMU's motion capture.
    fn assign_hips_above_thighs(&mut self, skeleton: &Skeleton) {
        let (None, Some(left), Some(right)) =
            (self.joint("hips"), self.joint("left upleg"), self.joint("right upleg"))
        else {
            return;
        };
        let mut above = std::iter::successors(Some(left), |j| skeleton.parents()[*j as usize]).skip(1);
        let Some(hips) = above.find(|j| is_below(skeleton, right, *j)) else { return };
        self.joints.retain(|name, joint| *joint != hips || name != "spine");
        self.assign_if_free("hips", hips);
    }

    /// KayKit has a wrist joint above the hand, where hands of other skeletons rotate: the wrist becomes the hand.
    fn assign_wrists_as_hands(&mut self, skeleton: &Skeleton) {
        for side in ["left", "right"] {
            let (Some(hand), Some(forearm)) =
                (self.joint(&format!("{side} hand")), self.joint(&format!("{side} forearm")))
            else {
                continue;
            };
            let parent = skeleton.parents()[hand as usize];
            if let Some(wrist) = parent.filter(|p| skeleton.parents()[*p as usize] == Some(forearm))
                && skeleton.names()[wrist as usize].to_ascii_lowercase().contains("wrist")
            {
                self.joints.insert(format!("{side} hand"), wrist);
            }
        }
    }

    /// Finds limbs that have no known names: pairs of chains that branch off one central joint.
    fn assign_by_structure(&mut self, skeleton: &Skeleton) {
        if self.is_complete() {
            return;
        }
        let partners = find_partners(skeleton);
        let rest = ModelRestPose::of(skeleton);
        let children = children_of_joints(skeleton);
        let mut limbs: Vec<LimbPair> = Vec::new();
        for (joint, partner) in (0u32..).zip(&partners) {
            let Some(partner) = *partner else { continue };
            let parent = skeleton.parents()[joint as usize];
            let middle = parent.filter(|p| partners[*p as usize] == Some(*p));
            let is_left = side_of(&skeleton.names()[joint as usize]).is_some_and(|s| s.0 == Side::Left);
            let Some(middle) = middle.filter(|_| partner != joint && is_left) else { continue };
            let chains = [joint, partner].map(|from| unbranched_chain(from, &children, &rest));
            if chains.iter().all(|c| c.len() >= 3) {
                let low =
                    chains.iter().flatten().map(|j| rest.positions[*j as usize].y).fold(f64::MAX, f64::min);
                limbs.push(LimbPair { middle, chains, low });
            }
        }
        // The legs are those that reach lowest; of the others the arms begin highest.
        limbs.sort_by(|a, b| a.low.total_cmp(&b.low));
        if limbs.is_empty() {
            return;
        }
        let legs = limbs.remove(0);
        let start = |limb: &LimbPair| rest.positions[limb.chains[0][0] as usize].y;
        // A quadruped has no arms.
        let knee = legs.low + 0.25 * (start(&legs) - legs.low);
        limbs.retain(|limb| {
            start(limb) > start(&legs) && limb.low > knee && is_below(skeleton, limb.middle, legs.middle)
        });
        limbs.sort_by(|a, b| start(b).total_cmp(&start(a)).then(b.chains[0].len().cmp(&a.chains[0].len())));
        self.assign_if_free("hips", legs.middle);
        for (side, chain) in ["left", "right"].iter().zip(&legs.chains) {
            for (name, joint) in LEG.iter().chain(&["toebase"]).zip(chain) {
                self.assign_if_free(&format!("{side} {name}"), *joint);
            }
        }
        let Some(arms) = limbs.first() else { return };
        let position = |joint: u32| rest.positions[joint as usize];
        for (side, chain) in ["left", "right"].iter().zip(&arms.chains) {
            // A collar bone is a short joint before three others.
            let lengths: Vec<f64> =
                chain.windows(2).map(|w| (position(w[1]) - position(w[0])).length()).collect();
            let collar = chain.len() > 3 && lengths[0] < 0.75 * lengths[1];
            let names: &[&str] = if collar { &["shoulder", "arm", "forearm", "hand"] } else { &ARM };
            for (name, joint) in names.iter().zip(chain) {
                self.assign_if_free(&format!("{side} {name}"), *joint);
            }
        }
        // The head is the highest central joint above the arms.
        let above =
            (0u32..).zip(&partners).filter(|(j, p)| **p == Some(*j) && is_below(skeleton, *j, arms.middle));
        let leaves: Vec<u32> = above.map(|(j, _)| j).filter(|j| *j != arms.middle).collect();
        let top = leaves.iter().copied().max_by(|a, b| position(*a).y.total_cmp(&position(*b).y));
        if let Some(top) = top {
            self.assign_if_free("head", top);
        }
    }

    fn is_complete(&self) -> bool {
        let side =
            |side: &str| LEG.iter().chain(&ARM).all(|name| self.joint(&format!("{side} {name}")).is_some());
        side("left") && side("right") && self.joint("hips").is_some() && self.joint("head").is_some()
    }

    fn assign_if_free(&mut self, name: &str, joint: u32) {
        if !self.is_assigned(joint) && !self.joints.contains_key(name) {
            self.joints.insert(name.to_string(), joint);
        }
    }

    fn find_spine_and_neck(&self, skeleton: &Skeleton) -> (Vec<u32>, Vec<u32>) {
        let first = |names: [&str; 2]| names.iter().find_map(|n| self.joint(n));
        let (Some(hips), Some(left), Some(right)) = (
            self.joint("hips"),
            first(["left shoulder", "left arm"]),
            first(["right shoulder", "right arm"]),
        ) else {
            return Default::default();
        };
        let up = |from: u32| std::iter::successors(Some(from), |j| skeleton.parents()[*j as usize]);
        let rights: Vec<u32> = up(right).collect();
        let Some(mut chest) = up(left).find(|j| rights.contains(j)) else { return Default::default() };
        // Biped's collar bones hang on the neck.
        let mut neck = Vec::new();
        if self.joint("neck") == Some(chest) {
            neck.push(chest);
            let Some(below) = skeleton.parents()[chest as usize] else { return Default::default() };
            chest = below;
        }
        if !is_below(skeleton, chest, hips) {
            return Default::default();
        }
        // Biped's legs hang on a pelvis, or on the first joint of the spine: joints that carry legs are no part of the spine.
        let legs = ["left upleg", "right upleg"].map(|n| self.joint(n));
        let carries = |j: u32| legs.iter().flatten().any(|leg| is_below(skeleton, *leg, j));
        let mut spine: Vec<u32> = up(chest).take_while(|j| *j != hips && !carries(*j)).collect();
        spine.reverse();
        if let Some(head) = self.joint("head").filter(|h| is_below(skeleton, *h, chest)) {
            neck = up(head).skip(1).take_while(|j| *j != chest).collect();
            neck.reverse();
        }
        (spine, neck)
    }
}

/// A left and a right chain of joints that branch off one central joint.
struct LimbPair {
    middle: u32,
    /// Left and right chain, from the central joint outwards.
    chains: [Vec<u32>; 2],
    /// Smallest y of the limb's joints.
    low: f64,
}

/// Whether `joint` is `above` or a descendant of it.
pub(crate) fn is_below(skeleton: &Skeleton, joint: u32, above: u32) -> bool {
    std::iter::successors(Some(joint), |j| skeleton.parents()[*j as usize])
        .take_while(|j| *j >= above)
        .any(|j| j == above)
}

fn children_of_joints(skeleton: &Skeleton) -> Vec<Vec<u32>> {
    let mut children = vec![Vec::new(); skeleton.len()];
    for (joint, parent) in (0u32..).zip(skeleton.parents()) {
        if let Some(parent) = parent {
            children[*parent as usize].push(joint);
        }
    }
    children
}

/// The chain of joints from a joint outwards until it branches or ends; meshes at a joint's own position do not count.
fn unbranched_chain(from: u32, children: &[Vec<u32>], rest: &ModelRestPose) -> Vec<u32> {
    let mut chain = vec![from];
    let mut joint = from;
    let min_distance = 1e-4 * rest.height();
    loop {
        let position = rest.positions[joint as usize];
        let mut next = children[joint as usize]
            .iter()
            .filter(|c| (rest.positions[**c as usize] - position).length() > min_distance);
        match (next.next(), next.next()) {
            (Some(child), None) => {
                chain.push(*child);
                joint = *child;
            }
            _ => return chain,
        }
    }
}
