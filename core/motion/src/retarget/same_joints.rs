//! Whether a clip's curves mean the same on another skeleton.

use crate::clip::{Clip, Path};
use crate::retarget::bind::match_names;
use crate::retarget::joint_map::JointMap;
use crate::skeleton::Skeleton;
use crate::skeleton::humanoid_joints::HumanoidJoints;
use crate::skeleton::model_rest_pose::ModelRestPose;
use std::collections::BTreeMap;

/// Whether the joints that a clip moves have the same positions in their parents' spaces in both skeletons, so that their curves
/// can
/// be copied. Rest poses may differ then: a file of a walk alone often rests in its first frame. Joints are those of
/// [`crate::bind_clip`]; ones without a partner do not count.
pub fn same_joints(clip: &Clip, from: &Skeleton, to: &Skeleton) -> bool {
    if from.rest() == to.rest() && from.parents() == to.parents() && from.names() == to.names() {
        return true;
    }
    let matched = match_names(from, to);
    // Every bone must be known by its name: else the clip cannot just be copied.
    let map =
        JointMap::new([from, to], [&HumanoidJoints::of(from), &HumanoidJoints::of(to)], &BTreeMap::new());
    let mut known: Vec<Option<u32>> = vec![None; from.len()];
    for (joint, source, _) in map.pairs() {
        known[source as usize] = Some(joint);
    }
    let (a, b) = (ModelRestPose::of(from), ModelRestPose::of(to));
    let size = a.height().max(b.height());
    let partner = |joint: u32| matched.get(joint as usize).copied().flatten();
    let mut animated: Vec<u32> =
        clip.curves().iter().filter(|c| !matches!(c.path, Path::Weights(_))).map(|c| c.joint).collect();
    animated.sort_unstable();
    animated.dedup();
    if !animated.iter().any(|joint| partner(*joint).is_some()) {
        return false;
    }
    let has_equal_rest_position = |joint: u32| {
        if known[joint as usize].is_some_and(|other| partner(joint) != Some(other)) {
            return false;
        }
        let Some(other) = partner(joint) else { return true };
        let (s, t) = (joint as usize, other as usize);
        let (own, theirs) = (&from.rest()[s], &to.rest()[t]);
        let parents = (from.parents()[s], to.parents()[t]);
        if let (Some(p), Some(q)) = parents
            && partner(p) == Some(q)
        {
            let (offset, scale) = (own.translation - theirs.translation, a.scales[p as usize]);
            let distance = f64::from(offset.length()) * scale;
            return distance <= 2e-3 * size
                && (a.scales[p as usize] / b.scales[q as usize] - 1.0).abs() < 1e-3;
        }
        // The topmost joint: axes and unit of its parent space must be the same. Its own position may differ, since clips move
        // it.
        let of = |rest: &ModelRestPose, parent: Option<u32>| match parent {
            Some(p) => (rest.rotations[p as usize], rest.scales[p as usize]),
            None => (glam::DQuat::IDENTITY, 1.0),
        };
        let ((p, unit_p), (q, unit_q)) = (of(&a, parents.0), of(&b, parents.1));
        p.dot(q).abs() > 1.0 - 1e-6 && (unit_p / unit_q - 1.0).abs() < 1e-3
    };
    animated.into_iter().all(has_equal_rest_position)
}
