//! Finds the legs of a skeleton that inverse kinematics can bend.

use crate::stage::constraint::Leg;
use choreo_motion::contacts::{find_feet, leg_of_ik_control};
use choreo_motion::{HumanoidJoints, Skeleton};

/// Finds the legs of a biped or quadruped by its feet ([`find_feet`]): the two bones above each foot. If two joints of one leg are named
/// foot, the upper one is the foot. Feet that are IK handles and are not below the hips belong to the leg that ends beside them, if there
/// is one.
pub fn find_legs(skeleton: &Skeleton) -> Vec<Leg> {
    let parents = skeleton.parents();
    let up = |joint: u32| parents.get(joint as usize).copied().flatten();
    let human = HumanoidJoints::of(skeleton);
    let hips = human.joint("hips");
    let hangs = |joint: u32| {
        let Some(hips) = hips else { return true };
        std::iter::successors(Some(joint), |j| up(*j)).any(|j| j == hips)
    };
    let leg = |joints: &[u32]| {
        let (foot, toe) = match *joints {
            [toe] if up(toe).is_some_and(|p| is_foot(skeleton, p)) => (up(toe)?, Some(toe)),
            [foot] => (foot, None),
            [foot, toe, ..] => (foot, Some(toe)),
            [] => return None,
        };
        let own = up(foot).and_then(|knee| Some(Leg { hip: up(knee)?, knee, foot, toe }));
        let own = own.filter(|leg| hangs(leg.foot) && up(leg.hip).is_some());
        own.or_else(|| {
            leg_of_ik_control(skeleton, &human, foot).map(|[hip, knee]| Leg { hip, knee, foot, toe })
        })
    };
    find_feet(skeleton).iter().filter_map(|foot| leg(&foot.joints)).collect()
}

fn is_foot(skeleton: &Skeleton, joint: u32) -> bool {
    skeleton.names().get(joint as usize).is_some_and(|name| name.to_lowercase().contains("foot"))
}
