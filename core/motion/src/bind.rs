//! Clips on other skeletons: curves re-indexed by joint name.

use crate::t_pose::Bodies;
use crate::{Clip, Curve, Skeleton};

/// The clip's curves on the joints of another skeleton that have the same name, exactly or else without namespace
/// prefixes ([`crate::skeleton::plain_name`]), or else by its place in a human body ([`crate::joint_names::humanoid_name`]):
/// that fits where both skeletons rest in the same pose with the same axes. Keys are shared with the given clip, not copied.
/// Also returns the names of animated joints for which `to` has none, in skeleton order.
///
/// Where a skeleton has a [`Humanoid`] of its own, human bones are matched by that before any name, and their rotations are
/// carried from T-pose to T-pose, the hips' place in proportion to their height (VRM Animation 1.0,
/// "how_to_transform_human_pose.md"); other bones keep their own lengths. So the axes and sizes of the two may differ.
///
/// Where two joints of the clip's skeleton match one of the target's, the exactly named wins, else the first.
/// Curves of expressions go along as they are.
pub fn bind_clip(clip: &Clip, from: &Skeleton, to: &Skeleton) -> (Clip, Vec<String>) {
    if from.names() == to.names() {
        return (clip.clone(), Vec::new());
    }
    let bodies = (from.humanoid().is_some() || to.humanoid().is_some()).then(|| Bodies::new(from, to));
    let matched: Vec<Option<u32>> = match_joints(from, to, bodies.as_ref());
    let mut unmatched = std::collections::BTreeSet::new();
    let mut curves: Vec<Curve> = Vec::with_capacity(clip.curves().len());
    for curve in clip.curves() {
        match matched.get(curve.joint as usize).copied().flatten() {
            Some(joint) => {
                let bone = bodies.as_ref().and_then(|b| b.bone(curve.joint)).filter(|(_, to)| *to == joint);
                match (&bodies, bone) {
                    (Some(bodies), Some((bone, _))) => curves.extend(bodies.carry(curve, bone)),
                    _ => curves.push(Curve { joint, ..curve.clone() }),
                }
            }
            None => {
                unmatched.insert(curve.joint);
            }
        }
    }
    let names = unmatched.into_iter().filter_map(|j| from.names().get(j as usize).cloned()).collect();
    (clip.with_curves(to.len(), curves), names)
}

/// By names alone.
pub(crate) fn match_names(from: &Skeleton, to: &Skeleton) -> Vec<Option<u32>> {
    match from.names() == to.names() {
        true => (0..from.len() as u32).map(Some).collect(),
        false => match_joints(from, to, None),
    }
}

/// Joint of `to` for each joint of `from`; no joint of `to` twice.
fn match_joints(from: &Skeleton, to: &Skeleton, bodies: Option<&Bodies>) -> Vec<Option<u32>> {
    let mut exact = std::collections::BTreeMap::new();
    let mut plain = std::collections::BTreeMap::new();
    for (joint, name) in to.names().iter().enumerate() {
        exact.entry(name.as_str()).or_insert(joint as u32);
        // `None` = several joints with this plain name: none of them is meant.
        plain
            .entry(crate::skeleton::plain_name(name))
            .and_modify(|j| *j = None)
            .or_insert(Some(joint as u32));
    }
    let mut taken = vec![false; to.len()];
    let mut matched: Vec<Option<u32>> = vec![None; from.len()];
    for (from, to) in bodies.iter().flat_map(|b| b.pairs()) {
        taken[to as usize] = true;
        matched[from as usize] = Some(to);
    }
    for (slot, name) in matched.iter_mut().zip(from.names()) {
        if slot.is_none()
            && let Some(joint) = exact.get(name.as_str())
            && !taken[*joint as usize]
        {
            taken[*joint as usize] = true;
            *slot = Some(*joint);
        }
    }
    for (slot, name) in matched.iter_mut().zip(from.names()) {
        if slot.is_none()
            && let Some(Some(joint)) = plain.get(&crate::skeleton::plain_name(name))
            && !taken[*joint as usize]
        {
            taken[*joint as usize] = true;
            *slot = Some(*joint);
        }
    }
    // Last, the same human joint in another family of names.
    let mut humanoid = std::collections::BTreeMap::new();
    for (joint, name) in to.names().iter().enumerate() {
        if let Some(name) = crate::joint_names::humanoid_name(name) {
            humanoid.entry(name).and_modify(|j| *j = None).or_insert(Some(joint as u32));
        }
    }
    for (slot, name) in matched.iter_mut().zip(from.names()) {
        if slot.is_none()
            && let Some(name) = crate::joint_names::humanoid_name(name)
            && let Some(Some(joint)) = humanoid.get(&name)
            && !taken[*joint as usize]
        {
            taken[*joint as usize] = true;
            *slot = Some(*joint);
        }
    }
    matched
}
