//! Finds the joints that are feet, and the length of the legs.

use super::{Foot, joint_positions};
use crate::pose::Pose;
use crate::skeleton::Skeleton;
use crate::skeleton::humanoid_joints::{HumanoidJoints, is_below};
use crate::skeleton::joint_names::humanoid_name;
use crate::skeleton::model_rest_pose::ModelRestPose;

/// Largest height above the feet, in leg lengths, at which a hand at rest counts as a forepaw.
const MAX_PAW_HEIGHT_LEGS: f32 = 0.25;
/// Largest distance of a foot that is an IK control from the end of its leg, in leg lengths.
const MAX_CONTROL_DISTANCE_LEGS: f64 = 0.1;

/// Finds the feet of a skeleton by joint names, left before right: `left foot` with its toes, or with its only child; else every
/// joint named foot, toe, paw or hoof with no other below it, and hands that rest near the ground, as a fox's do. If no joint
/// has such a name, the ends of both legs by structure.
pub fn find_feet(skeleton: &Skeleton) -> Vec<Foot> {
    let joint_named = |wanted: &str| {
        skeleton.names().iter().position(|n| humanoid_name(n).as_deref() == Some(wanted)).map(|j| j as u32)
    };
    let mut feet = Vec::new();
    for side in ["left", "right"] {
        let (heel, toe) = (joint_named(&format!("{side} foot")), joint_named(&format!("{side} toebase")));
        let toe = toe.or_else(|| only_child(skeleton, heel?));
        let joints: Vec<u32> = heel.into_iter().chain(toe).collect();
        if !joints.is_empty() {
            feet.push(Foot { joints });
        }
    }
    if feet.len() == 2 {
        return feet;
    }
    let mut feet = end_joints_named(skeleton, &["foot", "toe", "paw", "hoof"]);
    if feet.is_empty() {
        return feet_of_legs(skeleton);
    }
    let rest = joint_positions(skeleton, &Pose::rest(skeleton));
    let height = |foot: &Foot| foot.joints.iter().map(|j| rest[*j as usize].y).fold(f32::INFINITY, f32::min);
    let ground = feet.iter().map(height).fold(f32::NEG_INFINITY, f32::max);
    if let Some(leg) = leg_length(skeleton, &feet) {
        let mut hands = end_joints_named(skeleton, &["hand"]);
        hands.retain(|hand| height(hand) - ground <= MAX_PAW_HEIGHT_LEGS * leg as f32);
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

/// Thigh and shin of a foot that is an IK control: it is no descendant of them, and clips keep it at their end. `None` for other
/// feet.
pub fn leg_of_ik_control(skeleton: &Skeleton, human: &HumanoidJoints, foot: u32) -> Option<[u32; 2]> {
    let side =
        ["left", "right"].into_iter().find(|side| human.joint(&format!("{side} foot")) == Some(foot))?;
    let [hip, knee] = [human.joint(&format!("{side} upleg"))?, human.joint(&format!("{side} leg"))?];
    let parents = skeleton.parents();
    let rest = ModelRestPose::of(skeleton);
    let distance = |a: u32, b: u32| (rest.positions[a as usize] - rest.positions[b as usize]).length();
    let ends = (0u32..).zip(parents).filter(|(_, parent)| **parent == Some(knee));
    let gap = ends.map(|(end, _)| distance(end, foot)).fold(f64::INFINITY, f64::min);
    let beside = gap < MAX_CONTROL_DISTANCE_LEGS * (distance(hip, knee) + distance(knee, foot));
    (beside && parents[knee as usize] == Some(hip) && !is_below(skeleton, foot, hip)).then_some([hip, knee])
}

/// The only child of a joint. Child meshes, which often have the joint's name, do not count.
fn only_child(skeleton: &Skeleton, joint: u32) -> Option<u32> {
    let name = |joint: u32| humanoid_name(&skeleton.names()[joint as usize]);
    let hangs = |below: &u32| skeleton.parents()[*below as usize] == Some(joint);
    let mut below = (0..skeleton.len() as u32)
        .filter(hangs)
        .filter(|below| name(joint).is_none() || name(*below) != name(joint));
    below.next().filter(|_| below.next().is_none())
}

/// Joints with one of the words in their names, and no such joint below them.
fn end_joints_named(skeleton: &Skeleton, words: &[&str]) -> Vec<Foot> {
    let has_word = |name: &String| {
        let name = name.to_lowercase();
        words.iter().any(|word| name.contains(word))
    };
    let matches: Vec<bool> = skeleton.names().iter().map(has_word).collect();
    let mut has_match_below: Vec<bool> = vec![false; skeleton.len()];
    for joint in (0..skeleton.len()).rev() {
        if let Some(parent) = skeleton.parents()[joint]
            && (matches[joint] || has_match_below[joint])
        {
            has_match_below[parent as usize] = true;
        }
    }
    let ends = (0..skeleton.len()).filter(|j| matches[*j] && !has_match_below[*j]);
    ends.map(|joint| Foot { joints: vec![joint as u32] }).collect()
}

/// Length of the longest leg, metres, whatever the rest pose: along the bones from the lowest joint that carries another foot,
/// too, to the foot; from the thigh if feet are IK controls. `None` without feet or length.
pub fn leg_length(skeleton: &Skeleton, feet: &[Foot]) -> Option<f64> {
    let model = joint_positions(skeleton, &Pose::rest(skeleton));
    let chain_to_root = |joint: u32| {
        let up = |j: &u32| skeleton.parents().get(*j as usize).copied().flatten();
        std::iter::successors(Some(joint), up).collect::<Vec<u32>>()
    };
    let chains: Vec<Vec<u32>> =
        feet.iter().filter_map(|f| f.joints.first()).map(|j| chain_to_root(*j)).collect();
    let distance =
        |a: u32, b: u32| Some(f64::from((*model.get(a as usize)? - *model.get(b as usize)?).length()));
    // Joints of one leg only, and the joint that carries the leg.
    let chain_of_leg = |chain: &[u32]| {
        let shared = |joint: &u32| chains.iter().any(|other| other[0] != chain[0] && other.contains(joint));
        chain.iter().skip(1).position(shared).map(|at| chain[..at + 2].to_vec())
    };
    let legs: Vec<Vec<u32>> = chains.iter().filter_map(|chain| chain_of_leg(chain)).collect();
    let along = |leg: &Vec<u32>| leg.windows(2).filter_map(|pair| distance(pair[0], pair[1])).sum::<f64>();
    let mut length = legs.iter().map(along).fold(0.0, f64::max);
    if legs.iter().all(|leg| leg.len() < 3) {
        let human = HumanoidJoints::of(skeleton);
        for foot in legs.iter().map(|leg| leg[0]) {
            let of_ik_control = |[hip, knee]: [u32; 2]| Some(distance(hip, knee)? + distance(knee, foot)?);
            length =
                length.max(leg_of_ik_control(skeleton, &human, foot).and_then(of_ik_control).unwrap_or(0.0));
        }
    }
    (length.is_finite() && length > 0.0).then_some(length)
}
