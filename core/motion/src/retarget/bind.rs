//! Binds clips to other skeletons: curves are re-indexed by joint name.

use crate::clip::{Clip, Curve, Path};
use crate::retarget::t_pose::HumanoidPair;
use crate::skeleton::Skeleton;
use crate::skeleton::model_rest_pose::ModelRestPose;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// Binds a clip to another skeleton: its curves go to the joints with the same name, exactly, else without namespace prefixes
/// (`crate::skeleton::plain_name`), else with the same humanoid name (`crate::skeleton::joint_names::humanoid_name`). This fits
/// if both skeletons rest in the same pose with the same axes. Keys are shared with the given clip, not copied. Also returns the
/// names of animated joints for which `to` has none, in skeleton order.
///
/// If a skeleton has a `Humanoid`, humanoid bones are matched by that before any name. Their rotations are transferred from
/// T-pose to T-pose, the position of the hips in proportion to their height (VRM Animation 1.0, "how_to_transform_human_pose.md"); other
/// bones keep their own lengths. So the axes and sizes of the two may differ.
///
/// If two joints of the clip's skeleton match one of the target's, the exact name wins, else the first. Curves of expressions are
/// unchanged. Translations keep their size in metres of the model: below a node that converts centimetres, the numbers are a
/// hundred times as large as elsewhere.
pub fn bind_clip(clip: &Clip, from: &Skeleton, to: &Skeleton) -> (Clip, Vec<String>) {
    if from.names() == to.names() {
        return (clip.clone(), Vec::new());
    }
    let humanoids =
        (from.humanoid().is_some() || to.humanoid().is_some()).then(|| HumanoidPair::new(from, to));
    let matched: Vec<Option<u32>> = match_joints(from, to, humanoids.as_ref());
    let units = ParentUnits { from: ModelRestPose::of(from).scales, to: ModelRestPose::of(to).scales };
    let mut unmatched = BTreeSet::new();
    let mut curves: Vec<Curve> = Vec::with_capacity(clip.curves().len());
    for curve in clip.curves() {
        match matched.get(curve.joint as usize).copied().flatten() {
            Some(joint) => {
                let bone =
                    humanoids.as_ref().and_then(|b| b.bone(curve.joint)).filter(|(_, to)| *to == joint);
                match (&humanoids, bone) {
                    (Some(humanoids), Some((bone, _))) => curves.extend(humanoids.transfer(curve, bone)),
                    _ => {
                        let parents = [from.parents()[curve.joint as usize], to.parents()[joint as usize]];
                        curves.push(Curve { joint, ..units.convert(curve, parents) });
                    }
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

/// Raw binding: the clip's curves, bit for bit, on the joints of another skeleton that have exactly the same names. Nothing is
/// retargeted or scaled, and the clip stays as long as it was. Joints of `to` that the clip does not move keep their rest (bind) pose.
/// Joints that share one name are paired in order. Also returns the names of animated joints that `to` lacks, in skeleton order.
pub fn bind_by_name(clip: &Clip, from: &Skeleton, to: &Skeleton) -> (Clip, Vec<String>) {
    let mut unused_joints: BTreeMap<&str, VecDeque<u32>> = BTreeMap::new();
    for (joint, name) in (0u32..).zip(to.names()) {
        unused_joints.entry(name).or_default().push_back(joint);
    }
    let partner = |name: &String| unused_joints.get_mut(name.as_str()).and_then(VecDeque::pop_front);
    let partners: Vec<Option<u32>> = from.names().iter().map(partner).collect();
    let bound = |curve: &Curve| Some(Curve { joint: partners[curve.joint as usize]?, ..curve.clone() });
    let curves = clip.curves().iter().filter_map(bound).collect();
    let unbound: BTreeSet<u32> =
        clip.curves().iter().map(|c| c.joint).filter(|joint| partners[*joint as usize].is_none()).collect();
    let names = unbound.into_iter().map(|joint| from.names()[joint as usize].clone()).collect();
    (clip.with_curves(to.len(), curves).with_duration(clip.duration), names)
}

/// Mean scale of model-from-joint of each joint.
struct ParentUnits {
    from: Vec<f64>,
    to: Vec<f64>,
}

impl ParentUnits {
    /// Converts a curve to the units of another parent; the keys are unchanged if these are equal but for rounding.
    fn convert(&self, curve: &Curve, [from, to]: [Option<u32>; 2]) -> Curve {
        let parent_unit = |scales: &[f64], parent: Option<u32>| parent.map_or(1.0, |p| scales[p as usize]);
        let ratio = parent_unit(&self.from, from) / parent_unit(&self.to, to);
        if curve.path != Path::Translation || !ratio.is_finite() || (ratio - 1.0).abs() < 1e-4 {
            return curve.clone();
        }
        let values = curve.values.iter().map(|v| (f64::from(*v) * ratio) as f32).collect();
        Curve { values, ..curve.clone() }
    }
}

/// Matches joints by names alone.
pub(crate) fn match_names(from: &Skeleton, to: &Skeleton) -> Vec<Option<u32>> {
    match from.names() == to.names() {
        true => (0..from.len() as u32).map(Some).collect(),
        false => match_joints(from, to, None),
    }
}

/// Joint of `to` for each joint of `from`; no joint of `to` twice.
fn match_joints(from: &Skeleton, to: &Skeleton, humanoids: Option<&HumanoidPair>) -> Vec<Option<u32>> {
    let mut exact = BTreeMap::new();
    let mut plain = BTreeMap::new();
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
    for (from, to) in humanoids.iter().flat_map(|b| b.pairs()) {
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
    let mut humanoid = BTreeMap::new();
    for (joint, name) in to.names().iter().enumerate() {
        if let Some(name) = crate::skeleton::joint_names::humanoid_name(name) {
            humanoid.entry(name).and_modify(|j| *j = None).or_insert(Some(joint as u32));
        }
    }
    for (slot, name) in matched.iter_mut().zip(from.names()) {
        if slot.is_none()
            && let Some(name) = crate::skeleton::joint_names::humanoid_name(name)
            && let Some(Some(joint)) = humanoid.get(&name)
            && !taken[*joint as usize]
        {
            taken[*joint as usize] = true;
            *slot = Some(*joint);
        }
    }
    matched
}
