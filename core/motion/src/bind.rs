//! Clips on other skeletons: curves re-indexed by joint name.

use crate::{Clip, Curve, Skeleton};

/// The clip's curves on the joints of another skeleton that have the same name, exactly or else without namespace
/// prefixes ([`crate::skeleton::plain_name`]), or else by its place in a human body ([`crate::joint_names::humanoid_name`]):
/// that fits where both skeletons rest in the same pose with the same axes. Keys are shared with the given clip, not copied.
/// Also returns the names of animated joints for which `to` has none, in skeleton order.
///
/// Where two joints of the clip's skeleton match one of the target's, the exactly named wins, else the first.
pub fn bind_clip(clip: &Clip, from: &Skeleton, to: &Skeleton) -> (Clip, Vec<String>) {
    let matched: Vec<Option<u32>> = match_joints(from, to);
    let mut unmatched = std::collections::BTreeSet::new();
    let mut curves: Vec<Curve> = Vec::with_capacity(clip.curves().len());
    for curve in clip.curves() {
        match matched.get(curve.joint as usize).copied().flatten() {
            Some(joint) => curves.push(Curve { joint, ..curve.clone() }),
            None => {
                unmatched.insert(curve.joint);
            }
        }
    }
    let names = unmatched.into_iter().filter_map(|j| from.names().get(j as usize).cloned()).collect();
    (clip.with_curves(to.len(), curves), names)
}

/// Joint of `to` for each joint of `from`; no joint of `to` twice.
fn match_joints(from: &Skeleton, to: &Skeleton) -> Vec<Option<u32>> {
    if from.names() == to.names() {
        return (0..from.len() as u32).map(Some).collect();
    }
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
    for (slot, name) in matched.iter_mut().zip(from.names()) {
        if let Some(joint) = exact.get(name.as_str())
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
