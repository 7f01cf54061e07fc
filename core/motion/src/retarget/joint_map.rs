//! The map of joints: which joint of one skeleton takes its motion from which joint of another.

use crate::retarget::bind::match_names;
use crate::skeleton::Skeleton;
use crate::skeleton::humanoid_joints::HumanoidJoints;
use std::collections::BTreeMap;

/// How two joints were matched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum MatchedBy {
    /// The caller stated it.
    Given,
    /// The names are equal, exactly or without a prefix.
    Name,
    /// The same joint of a human body, by names of other families, by the file or by structure.
    Body,
    /// A joint at the same fraction of the spine or neck, which has more joints in one skeleton than in the other.
    Share,
}

impl MatchedBy {
    /// Text in reports.
    pub fn as_str(self) -> &'static str {
        match self {
            MatchedBy::Given => "as given",
            MatchedBy::Name => "by name",
            MatchedBy::Body => "by body",
            MatchedBy::Share => "by share",
        }
    }
}

/// Source joint that each target joint follows.
#[derive(Clone, Debug, PartialEq)]
pub struct JointMap {
    sources: Vec<Option<(u32, MatchedBy)>>,
}

impl JointMap {
    /// Matches the joints. `given` pairs a target joint with a source joint, or with none, and takes precedence over all else.
    pub fn new(
        [from, to]: [&Skeleton; 2],
        [source, target]: [&HumanoidJoints; 2],
        given: &BTreeMap<u32, Option<u32>>,
    ) -> JointMap {
        let mut sources: Vec<Option<(u32, MatchedBy)>> = vec![None; to.len()];
        let mut used = vec![false; from.len()];
        for (joint, other) in given {
            if let (Some(slot), Some(other)) = (sources.get_mut(*joint as usize), other)
                && (*other as usize) < from.len()
            {
                *slot = Some((*other, MatchedBy::Given));
                used[*other as usize] = true;
            }
        }
        let mut pair_if_free = |joint: u32, other: u32, how: MatchedBy| {
            let (slot, used) = (&mut sources[joint as usize], &mut used[other as usize]);
            if !given.contains_key(&joint) && slot.is_none() && !*used {
                *slot = Some((other, how));
                *used = true;
            }
        };
        // If spines differ in their number of joints, equal names along them mean different positions.
        let trunks = [[source.spine(), target.spine()], [source.neck(), target.neck()]];
        let shared: Vec<u32> = trunks
            .iter()
            .filter(|[s, t]| s.len() != t.len() && !s.is_empty() && !t.is_empty())
            .flat_map(|[s, t]| {
                for (joint, other) in pair_chains(t, s) {
                    pair_if_free(joint, other, MatchedBy::Share);
                }
                t.iter().copied()
            })
            .collect();
        // A humanoid joint is matched with the same humanoid joint, whatever other joint has its name: "root" is the hips in one
        // file, and the joint on the ground in another.
        let names_another_pair = |joint: u32, other: u32| {
            let of_source = source
                .joints()
                .iter()
                .any(|(name, j)| *j == other && target.joint(name).is_some_and(|theirs| theirs != joint));
            let of_target = target
                .joints()
                .iter()
                .any(|(name, j)| *j == joint && source.joint(name).is_some_and(|theirs| theirs != other));
            of_source || of_target
        };
        // Joints outside a humanoid are not matched with joints inside: a mesh beside the bones may be called "Body", too.
        let both_humanoid = source.is_humanoid() && target.is_humanoid();
        let in_humanoid =
            both_humanoid.then(|| [belongs_to_humanoid(from, source), belongs_to_humanoid(to, target)]);
        let is_mixed = |joint: u32, other: u32| {
            in_humanoid
                .as_ref()
                .is_some_and(|[source, target]| source[other as usize] != target[joint as usize])
        };
        let names = match_names(from, to);
        for (other, joint) in (0u32..).zip(&names) {
            if let Some(joint) = joint
                .filter(|j| !shared.contains(j) && !names_another_pair(*j, other) && !is_mixed(*j, other))
                && crate::skeleton::plain_name(&from.names()[other as usize])
                    == crate::skeleton::plain_name(&to.names()[joint as usize])
            {
                pair_if_free(joint, other, MatchedBy::Name);
            }
        }
        for (name, joint) in target.joints() {
            if let Some(other) = source.joint(name).filter(|_| !shared.contains(joint)) {
                pair_if_free(*joint, other, MatchedBy::Body);
            }
        }
        for [s, t] in trunks.iter().filter(|[s, t]| s.len() == t.len()) {
            for (joint, other) in t.iter().zip(s.iter()) {
                pair_if_free(*joint, *other, MatchedBy::Body);
            }
        }
        JointMap { sources }
    }

    /// Number of joints of the target.
    pub fn len(&self) -> usize {
        self.sources.len()
    }

    /// Whether no joint follows another.
    pub fn is_empty(&self) -> bool {
        self.sources.iter().all(Option::is_none)
    }

    /// The source joint that a target joint follows.
    pub fn source(&self, joint: u32) -> Option<u32> {
        self.sources.get(joint as usize).copied().flatten().map(|(source, _)| source)
    }

    /// How the source joint of a target joint was found.
    pub fn how(&self, joint: u32) -> Option<MatchedBy> {
        self.sources.get(joint as usize).copied().flatten().map(|(_, how)| how)
    }

    /// (target, source, how), in the target's order.
    pub fn pairs(&self) -> impl Iterator<Item = (u32, u32, MatchedBy)> + '_ {
        (0u32..).zip(&self.sources).filter_map(|(joint, s)| s.map(|(source, how)| (joint, source, how)))
    }
}

/// Whether each joint belongs to the humanoid: its bones, all joints below them, and the ancestors of the hips.
pub(super) fn belongs_to_humanoid(skeleton: &Skeleton, human: &HumanoidJoints) -> Vec<bool> {
    let mut in_humanoid: Vec<bool> = Vec::with_capacity(skeleton.len());
    for (joint, parent) in (0u32..).zip(skeleton.parents()) {
        let bone = human.joints().values().any(|bone| *bone == joint);
        in_humanoid.push(bone || parent.is_some_and(|p| in_humanoid[p as usize]));
    }
    for joint in std::iter::successors(human.joint("hips"), |j| skeleton.parents()[*j as usize]) {
        in_humanoid[joint as usize] = true;
    }
    in_humanoid
}

/// Pairs two chains so that their first joints match and their last joints match, each joint at most once.
fn pair_chains(target: &[u32], source: &[u32]) -> Vec<(u32, u32)> {
    let (long, short) = (target.len().max(source.len()), target.len().min(source.len()));
    // A single joint is paired with the end of the other chain, which carries the limbs.
    let at = |i: usize| match short {
        1 => long - 1,
        _ => (i * (long - 1) + (short - 1) / 2) / (short - 1),
    };
    let pair = |i: usize| match target.len() <= source.len() {
        true => (target[i], source[at(i)]),
        false => (target[at(i)], source[i]),
    };
    (0..short).map(pair).collect()
}
