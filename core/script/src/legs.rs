//! The legs of a character, for foot locking.

use crate::api_error::ApiError;
use choreo_asset::Asset;
use choreo_motion::{HumanBone, HumanoidJoints, Skeleton};
use choreo_stage::{Leg, find_legs};

/// The legs found by joint names, else those that end in the feet that the file declares.
pub(crate) fn legs(asset: &Asset) -> Vec<Leg> {
    let found = find_legs(&asset.skeleton);
    if !found.is_empty() {
        return found;
    }
    let feet = [HumanBone::LeftFoot, HumanBone::RightFoot];
    let feet = feet.iter().filter_map(|b| humanoid_joint(asset, *b));
    feet.filter_map(|foot| leg_of_foot(&asset.skeleton, foot).ok()).collect()
}

/// The hips if they are an ancestor of all legs, else the lowest common ancestor of the legs. In some skeletons the legs are
/// children of the spine, with the pelvis beside them.
pub(crate) fn hips(asset: &Asset, legs: &[Leg]) -> Option<u32> {
    let parents = asset.skeleton.parents();
    let ancestors = |leg: &Leg| std::iter::successors(parents[leg.hip as usize], |j| parents[*j as usize]);
    let (first, others) = legs.split_first()?;
    let lowest =
        ancestors(first).find(|joint| others.iter().all(|leg| ancestors(leg).any(|j| j == *joint)))?;
    let hips = HumanoidJoints::of(&asset.skeleton).joint("hips");
    let is_above =
        |hips: &u32| std::iter::successors(Some(lowest), |j| parents[*j as usize]).any(|j| j == *hips);
    Some(hips.filter(is_above).unwrap_or(lowest))
}

/// The leg that ends in a foot: the parent of the foot is the knee, and its parent is the hip.
pub(crate) fn leg_of_foot(skeleton: &Skeleton, foot: u32) -> Result<Leg, ApiError> {
    let parents = skeleton.parents();
    let knee_and_hip = parents[foot as usize].and_then(|knee| Some((knee, parents[knee as usize]?)));
    let Some((knee, hip)) = knee_and_hip else {
        let name = skeleton.names()[foot as usize].clone();
        let error =
            format!("plant_feet: joint \"{name}\" needs a knee and a hip: a parent that has a parent");
        return Err(ApiError::new(error).focus(name));
    };
    let mut children = (0..parents.len() as u32).filter(|j| parents[*j as usize] == Some(foot));
    let toe = children.find(|j| skeleton.names()[*j as usize].to_ascii_lowercase().contains("toe"));
    Ok(Leg { hip, knee, foot, toe })
}

/// The joint that the file declares for a humanoid bone, else the joint of that name.
fn humanoid_joint(asset: &Asset, bone: HumanBone) -> Option<u32> {
    let declared = asset.skeleton.humanoid().and_then(|h| h.joint(bone));
    declared.or_else(|| asset.skeleton.find(bone.name()).map(|j| j as u32))
}
