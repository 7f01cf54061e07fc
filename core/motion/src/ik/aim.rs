//! Aim constraint: several joints turn together until the last one points at a target (spine, neck and head, or an arm that
//! points).

use crate::math::rotation::{rotation_between, rotation_fraction};
use glam::{DQuat, DVec3};
use std::f64::consts::PI;

/// A joint of an [`Aim`], from the root outwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AimJoint {
    /// Position, in the common space.
    pub position: DVec3,
    /// Share of the rotation that this joint takes, relative to the other joints; ≥ 0, finite.
    pub share: f64,
}

/// Turns joints until a direction of the last one points at a target. All in one space.
#[derive(Debug)]
pub struct Aim<'a> {
    /// Joints from the root outwards; the last one points. `run` updates the positions.
    pub joints: &'a mut [AimJoint],
    /// Direction in which the last joint points now.
    pub forward: DVec3,
    /// The point to point at, in the common space.
    pub target: DVec3,
    /// Largest rotation of the last joint, radians, 0..=π. For targets beyond it, the rotation fades out until the target is
    /// straight behind, so that a target that passes behind does not whip the joint from side to side.
    pub limit: f64,
    /// Weight of the constraint, 0..=1.
    pub weight: f64,
}

impl Aim<'_> {
    /// Computes the rotation of each joint, including those of the joints before it; `turns` has one per joint. Nothing is turned
    /// if `forward` is zero or the target is at the last joint.
    pub fn run(&mut self, turns: &mut [DQuat]) {
        turns.fill(DQuat::IDENTITY);
        let shares = |joints: &[AimJoint]| joints.iter().map(|j| j.share.max(0.0)).sum::<f64>();
        let Some(last) = self.joints.last().copied() else { return };
        let whole = limited_rotation(self.forward, self.target - last.position, self.limit, self.weight);
        // The goal lies in the direction of the limited rotation, at the target's distance.
        let Some(whole) = whole else { return };
        let goal = last.position + whole * self.forward.normalize() * (self.target - last.position).length();
        let mut forward = self.forward;
        let mut total = DQuat::IDENTITY;
        let count = self.joints.len();
        // Rotations of the other joints move the last one and change its direction to the target: each joint takes its share of
        // the remaining rotation, and the last one all that is left.
        for (at, turned) in turns.iter_mut().enumerate().take(count) {
            let remaining_shares = shares(&self.joints[at..]);
            let share = if at + 1 == count {
                1.0
            } else {
                (self.joints[at].share.max(0.0) / remaining_shares).clamp(0.0, 1.0)
            };
            let tip = self.joints[count - 1].position;
            if share > 0.0 && share.is_finite() {
                let turn = rotation_fraction(rotation_between(forward, goal - tip), share);
                let pivot = self.joints[at].position;
                for joint in &mut self.joints[at + 1..] {
                    joint.position = pivot + turn * (joint.position - pivot);
                }
                forward = turn * forward;
                total = (turn * total).normalize();
            }
            *turned = total;
        }
    }
}

/// The rotation from one direction towards another, at most `limit`, fading out beyond it, times a weight.
fn limited_rotation(from: DVec3, to: DVec3, limit: f64, weight: f64) -> Option<DQuat> {
    let (from, to) = (from.try_normalize()?, to.try_normalize()?);
    let cross = from.cross(to);
    let Some(axis) = cross.try_normalize() else { return Some(DQuat::IDENTITY) };
    let angle = libm::atan2(cross.length(), from.dot(to));
    let limit = limit.clamp(0.0, PI);
    let limited_angle = if angle <= limit { angle } else { limit * (PI - angle) / (PI - limit) };
    let turn = DQuat::from_axis_angle(axis, limited_angle * weight.clamp(0.0, 1.0));
    turn.is_finite().then_some(turn)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spine(shares: [f64; 3]) -> [AimJoint; 3] {
        let at =
            |i: usize| AimJoint { position: DVec3::new(0.0, 1.0 + 0.3 * i as f64, 0.0), share: shares[i] };
        [at(0), at(1), at(2)]
    }

    /// Position and direction of the last joint after all turns, by forward kinematics.
    fn posed_end(turns: &[DQuat; 3], joints: [AimJoint; 3]) -> (DVec3, DVec3) {
        let (mut at, mut before) = (joints[0].position, joints[0].position);
        for i in 1..3 {
            at += turns[i - 1] * (joints[i].position - before);
            before = joints[i].position;
        }
        (at, turns[2] * DVec3::Z)
    }

    #[test]
    fn the_last_joint_points_at_the_target_and_all_joints_with_a_share_turn() {
        for target in [DVec3::new(2.0, 1.0, 1.0), DVec3::new(-0.5, 2.5, 0.9), DVec3::new(0.3, 1.7, 0.4)] {
            for shares in [[1.0, 1.0, 1.0], [0.2, 0.3, 0.5], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]] {
                let mut joints = spine(shares);
                let mut turns = [DQuat::IDENTITY; 3];
                let limit = 80f64.to_radians();
                Aim { joints: &mut joints, forward: DVec3::Z, target, limit, weight: 1.0 }.run(&mut turns);
                let (at, forward) = posed_end(&turns, spine(shares));
                assert!((at - joints[2].position).length() < 1e-12);
                let off = super::super::limit::angle_of(super::rotation_between(forward, target - at));
                assert!(off < 1e-9, "{target} {shares:?}: {off}");
                let first = super::super::limit::angle_of(turns[0]);
                assert_eq!(first > 1e-6, shares[0] > 0.0, "{shares:?}");
            }
        }
    }

    #[test]
    fn targets_at_the_joint_straight_behind_or_nan_turn_nothing() {
        let head = spine([1.0; 3])[2].position;
        for target in [head, head - DVec3::Z, DVec3::NAN] {
            let mut turns = [DQuat::IDENTITY; 3];
            Aim { joints: &mut spine([1.0; 3]), forward: DVec3::Z, target, limit: 1.0, weight: 1.0 }
                .run(&mut turns);
            assert!(turns.iter().all(|t| super::super::limit::angle_of(*t) < 1e-9), "{target}: {turns:?}");
        }
    }
}
