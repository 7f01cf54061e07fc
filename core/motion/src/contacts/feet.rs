//! Finds the joints that are feet, and the length of the legs.

use super::{Foot, model};
use crate::pose::Pose;
use crate::skeleton::Skeleton;
use crate::skeleton::humanoid_joints::HumanoidJoints;
use crate::skeleton::joint_names::humanoid_name;

/// Hands that rest at most this far above the feet are fore paws, in legs.
const PAW: f32 = 0.25;

/// The feet of a skeleton by their names, left before right: `left foot` with its toes, or with the one joint that hangs on it;
/// else every joint called foot, toe, paw or hoof with no other below it, and hands that rest on the ground, as a fox's do. Where no joint is
/// called so, the ends of both legs by their structure.
pub fn find_feet(skeleton: &Skeleton) -> Vec<Foot> {
    let named = |wanted: &str| {
        skeleton.names().iter().position(|n| humanoid_name(n).as_deref() == Some(wanted)).map(|j| j as u32)
    };
    let mut feet = Vec::new();
    for side in ["left", "right"] {
        let (heel, toe) = (named(&format!("{side} foot")), named(&format!("{side} toebase")));
        let toe = toe.or_else(|| only_child(skeleton, heel?));
        let joints: Vec<u32> = heel.into_iter().chain(toe).collect();
        if !joints.is_empty() {
            feet.push(Foot { joints });
        }
    }
    if feet.len() == 2 {
        return feet;
    }
    let mut feet = ends_called(skeleton, &["foot", "toe", "paw", "hoof"]);
    if feet.is_empty() {
        return feet_of_legs(skeleton);
    }
    let rest = model(skeleton, &Pose::rest(skeleton));
    let height = |foot: &Foot| foot.joints.iter().map(|j| rest[*j as usize].y).fold(f32::INFINITY, f32::min);
    let ground = feet.iter().map(height).fold(f32::NEG_INFINITY, f32::max);
    if let Some(leg) = leg_length(skeleton, &feet) {
        let mut hands = ends_called(skeleton, &["hand"]);
        hands.retain(|hand| height(hand) - ground <= PAW * leg as f32);
        if hands.len() == 2 {
            feet.append(&mut hands);
        }
    }
    feet
}

/// The feet of a character by its structure: the ends of both legs.
fn feet_of_legs(skeleton: &Skeleton) -> Vec<Foot> {
    let human = HumanoidJoints::of(skeleton);
    let foot = |side: &str| {
        let heel = human.joint(&format!("{side} foot"))?;
        let toe = human.joint(&format!("{side} toebase")).or_else(|| only_child(skeleton, heel));
        Some(Foot { joints: std::iter::once(heel).chain(toe).collect() })
    };
    [foot("left"), foot("right")].into_iter().collect::<Option<_>>().unwrap_or_default()
}

fn only_child(skeleton: &Skeleton, joint: u32) -> Option<u32> {
    let mut below = (0u32..).zip(skeleton.parents()).filter(|(_, p)| **p == Some(joint)).map(|(j, _)| j);
    below.next().filter(|_| below.next().is_none())
}

/// Joints with one of the words in their names, and none of them below.
fn ends_called(skeleton: &Skeleton, words: &[&str]) -> Vec<Foot> {
    let called = |name: &String| {
        let name = name.to_lowercase();
        words.iter().any(|word| name.contains(word))
    };
    let called: Vec<bool> = skeleton.names().iter().map(called).collect();
    let mut above: Vec<bool> = vec![false; skeleton.len()];
    for joint in (0..skeleton.len()).rev() {
        if let Some(parent) = skeleton.parents()[joint]
            && (called[joint] || above[joint])
        {
            above[parent as usize] = true;
        }
    }
    let ends = (0..skeleton.len()).filter(|j| called[*j] && !above[*j]);
    ends.map(|joint| Foot { joints: vec![joint as u32] }).collect()
}

/// Along the bones from the joint that all feet hang on to a foot, the longest, metres: whatever pose the skeleton rests in.
/// `None` without feet or length.
pub fn leg_length(skeleton: &Skeleton, feet: &[Foot]) -> Option<f64> {
    let model = model(skeleton, &Pose::rest(skeleton));
    let above = |joint: u32| {
        let up = |j: &u32| skeleton.parents().get(*j as usize).copied().flatten();
        std::iter::successors(Some(joint), up).collect::<Vec<u32>>()
    };
    let chains: Vec<Vec<u32>> = feet.iter().filter_map(|f| f.joints.first()).map(|j| above(*j)).collect();
    // The lowest of all that carry every foot, but no foot itself.
    let first = chains.first()?;
    let shared = first.iter().skip(1).find(|j| chains.iter().all(|chain| chain.contains(j)))?;
    let length = |chain: &Vec<u32>| {
        let bones = chain.windows(2).take_while(|pair| pair[0] != *shared);
        let bone =
            |pair: &[u32]| Some((*model.get(pair[0] as usize)? - *model.get(pair[1] as usize)?).length());
        bones.filter_map(bone).map(f64::from).sum::<f64>()
    };
    let leg = chains.iter().map(length).fold(0.0, f64::max);
    (leg.is_finite() && leg > 0.0).then_some(leg)
}
