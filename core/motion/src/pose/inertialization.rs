//! Inertialization: a transition switches to the new clip at once, and the offset from the old one decays.
//!
//! D. Bollo, "Inertialization: High-Performance Animation Transitions in Gears of War", GDC 2018. The offset of each joint from
//! the new pose at the switch, as a vector (rotations as rotation vectors), decays to zero along its own direction by the
//! quintic of the talk, which starts at the velocity of the offset and ends without velocity and acceleration; it ends earlier if
//! the velocity leads to zero earlier, so that it does not overshoot. A velocity that leads away, and one across that direction,
//! which the talk leaves out, decay by a quintic that is zero at both ends and starts at this velocity, so that no joint's
//! velocity jumps. This takes at most the time in which clips reverse their motion ([`MAX_VELOCITY_DECAY_SECS`]): over half a
//! second, hips that move down would sink 2 cm lower than in either clip. The offset is a closed form of the time since the
//! switch.

use crate::math::rotation::{from_rotation_vector, rotation_vector};
use crate::math::transform::Transform;
use crate::pose::Pose;
use crate::time::Time;
use glam::DVec3;

/// The longest time in which velocities that do not lead to the new clip decay, seconds.
const MAX_VELOCITY_DECAY_SECS: f64 = 0.2;

/// The remaining length of an offset at time `t` of `duration` seconds. `x0` ≥ 0 is its length and `v0` its velocity along its direction.
pub(crate) fn decay(x0: f64, v0: f64, duration: f64, t: f64) -> f64 {
    let mut end = duration;
    if v0 < 0.0 {
        end = end.min(-5.0 * x0 / v0);
    }
    if t >= end || end <= 0.0 || x0 <= 0.0 {
        return 0.0;
    }
    if v0 > 0.0 {
        return decay(x0, 0.0, duration, t) + v0 * offset_of_fading_velocity(duration, t);
    }
    let (t2, t3) = (end * end, end * end * end);
    let a0 = ((-8.0 * v0 * end - 20.0 * x0) / t2).max(0.0);
    let a = -(a0 * t2 + 6.0 * v0 * end + 12.0 * x0) / (2.0 * t3 * t2);
    let b = (3.0 * a0 * t2 + 16.0 * v0 * end + 30.0 * x0) / (2.0 * t2 * t2);
    let c = -(3.0 * a0 * t2 + 12.0 * v0 * end + 20.0 * x0) / (2.0 * t3);
    ((((a * t + b) * t + c) * t + a0 / 2.0) * t + v0) * t + x0
}

/// Offset that a unit velocity leads to: the quintic of value 0 and slope 1 at the start, with zero value, slope and second
/// derivative at the end.
fn offset_of_fading_velocity(duration: f64, t: f64) -> f64 {
    let duration = duration.min(MAX_VELOCITY_DECAY_SECS);
    if t >= duration || duration <= 0.0 {
        return 0.0;
    }
    let s = t / duration;
    duration * (s - s * s * s * (6.0 - s * (8.0 - 3.0 * s)))
}

/// A vector offset that decays to zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct DecayingOffset {
    direction: DVec3,
    length_and_velocity: [f64; 2],
    lateral_velocity: DVec3,
}

impl DecayingOffset {
    fn new(offset: DVec3, velocity: DVec3) -> DecayingOffset {
        let x0 = offset.length();
        let direction = if x0 > 1e-9 { offset / x0 } else { DVec3::ZERO };
        let v0 = velocity.dot(direction);
        let length_and_velocity = if x0 > 1e-9 { [x0, v0] } else { [0.0; 2] };
        DecayingOffset { direction, length_and_velocity, lateral_velocity: velocity - direction * v0 }
    }

    fn at(&self, duration: f64, t: f64) -> DVec3 {
        let [x0, v0] = self.length_and_velocity;
        self.direction * decay(x0, v0, duration, t)
            + self.lateral_velocity * offset_of_fading_velocity(duration, t)
    }
}

/// Decaying offsets of all joints after a switch from one motion to another.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Inertialization {
    /// Offsets of rotation vector, translation and scale of each joint.
    joints: Vec<[DecayingOffset; 3]>,
    /// Duration of the decay.
    pub duration: Time,
}

impl Inertialization {
    /// `from`: poses of the old motion, `step` before the switch and at it. `to`: poses of the new one, at the switch and `step`
    /// after it.
    pub fn new(from: [&Pose; 2], to: [&Pose; 2], step: Time, duration: Time) -> Inertialization {
        let joints = from[1].len().min(to[0].len()).min(from[0].len()).min(to[1].len());
        let per_second = 1.0 / step.as_secs().max(1e-9);
        let joint_offsets = |joint: usize| {
            let [before, source] = from.map(|pose| pose.get(joint));
            let [target, after] = to.map(|pose| pose.get(joint));
            let turn = |a: Transform, b: Transform| {
                // The rotation from a to b, in the parent's space.
                rotation_vector(b.rotation.as_dquat() * a.rotation.as_dquat().conjugate())
            };
            let spin = (turn(before, source) - turn(target, after)) * per_second;
            let place = |t: Transform| t.translation.as_dvec3();
            let scale = |t: Transform| t.scale.as_dvec3();
            let velocity = |of: &dyn Fn(Transform) -> DVec3| {
                ((of(source) - of(before)) - (of(after) - of(target))) * per_second
            };
            [
                DecayingOffset::new(turn(target, source), spin),
                DecayingOffset::new(place(source) - place(target), velocity(&place)),
                DecayingOffset::new(scale(source) - scale(target), velocity(&scale)),
            ]
        };
        Inertialization { joints: (0..joints).map(joint_offsets).collect(), duration }
    }

    /// Adds the offsets that remain at a time `since` the switch to a pose of the new motion.
    pub fn apply(&self, since: Time, pose: &mut Pose) {
        if since >= self.duration || since < Time::ZERO {
            return;
        }
        let (duration, t) = (self.duration.as_secs(), since.as_secs());
        for (joint, offsets) in self.joints.iter().enumerate().take(pose.len()) {
            let [turn, place, scale] = offsets.map(|offset| offset.at(duration, t));
            if turn == DVec3::ZERO && place == DVec3::ZERO && scale == DVec3::ZERO {
                continue;
            }
            let mut local = pose.get(joint);
            local.rotation = (from_rotation_vector(turn) * local.rotation.as_dquat()).normalize().as_quat();
            local.translation = (local.translation.as_dvec3() + place).as_vec3();
            local.scale = (local.scale.as_dvec3() + scale).as_vec3();
            if local.is_finite() {
                pose.set(joint, local);
            }
        }
    }
}

/// Decaying offsets of plain numbers, such as morph weights, after a switch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WeightInertialization {
    weights: Vec<DecayingOffset>,
    /// Duration of the decay.
    pub duration: Time,
}

impl WeightInertialization {
    /// Like [`Inertialization::new`]; weights that are not in all lists are left out.
    pub fn new(from: [&[f32]; 2], to: [&[f32]; 2], step: Time, duration: Time) -> WeightInertialization {
        let per_second = 1.0 / step.as_secs().max(1e-9);
        let at = |of: &[f32], i: usize| f64::from(of[i]);
        let count = from.iter().chain(&to).map(|of| of.len()).min().unwrap_or(0);
        let weight_offset = |i: usize| {
            let ([before, source], [target, after]) = (from.map(|of| at(of, i)), to.map(|of| at(of, i)));
            let velocity = ((source - before) - (after - target)) * per_second;
            DecayingOffset::new(DVec3::X * (source - target), DVec3::X * velocity)
        };
        WeightInertialization { weights: (0..count).map(weight_offset).collect(), duration }
    }

    /// Adds the offsets that remain at a time `since` the switch to the weights of the new motion.
    pub fn apply(&self, since: Time, weights: &mut [f32]) {
        if since >= self.duration || since < Time::ZERO {
            return;
        }
        let (duration, t) = (self.duration.as_secs(), since.as_secs());
        for (offset, weight) in self.weights.iter().zip(weights) {
            let remaining = offset.at(duration, t).x;
            if remaining != 0.0 {
                *weight = (f64::from(*weight) + remaining) as f32;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Quat, Vec3};

    #[test]
    fn decay_starts_with_the_given_offset_and_velocity_and_ends_at_rest() {
        for (x0, v0, end) in [(1.0, 0.0, 0.4), (0.3, 2.0, 0.5), (1.0, -3.0, 0.4), (0.2, -5.0, 0.4)] {
            let x = |t| decay(x0, v0, end, t);
            let h = 1e-6;
            assert!((x(0.0) - x0).abs() < 1e-12 && ((x(h) - x(0.0)) / h - v0).abs() < 1e-3);
            let real_end = if v0 < 0.0 { f64::min(end, -5.0 * x0 / v0) } else { end };
            assert_eq!(x(end), 0.0);
            assert!(x(real_end - h).abs() < 1e-12, "{}", x(real_end - h));
            assert!(((x(real_end - 2.0 * h) - x(real_end - h)) / h).abs() < 1e-6);
            for i in 0..=100 {
                assert!(x(f64::from(i) / 100.0 * end) >= -1e-12, "overshoots: {x0} {v0}");
            }
        }
        // Without the limit on its end this offset would overshoot by far.
        let free = 0.2 - 5.0 * 0.2;
        assert!(free < -0.5);
    }

    #[test]
    fn a_switch_starts_with_the_old_pose_and_velocity_and_ends_in_the_new_motion() {
        let pose = |x: f32, degrees: f32| {
            let mut pose = Pose::identity(1);
            let rotation = Quat::from_rotation_z(degrees.to_radians());
            pose.set(0, Transform { translation: Vec3::X * x, rotation, ..Transform::IDENTITY });
            pose
        };
        let step = Time::from_secs(1.0 / 240.0);
        let h = step.as_secs() as f32;
        // The old one at x = 1 + 2t and 30° + 90°/s, the new one at x = 3 − t and −40°/s.
        let inertia = Inertialization::new(
            [&pose(1.0 - 2.0 * h, 30.0 - 90.0 * h), &pose(1.0, 30.0)],
            [&pose(3.0, 0.0), &pose(3.0 - h, -40.0 * h)],
            step,
            Time::from_secs(0.3),
        );
        let at = |t: f32| {
            let mut new = pose(3.0 - t, -40.0 * t);
            inertia.apply(Time::from_secs(t.into()), &mut new);
            new.get(0)
        };
        assert!(at(0.0).translation.abs_diff_eq(Vec3::X, 1e-5));
        assert!(at(0.0).rotation.abs_diff_eq(Quat::from_rotation_z(30f32.to_radians()), 1e-5));
        let speed = (at(1e-3).translation.x - at(0.0).translation.x) / 1e-3;
        assert!((speed - 2.0).abs() < 0.05, "{speed}");
        assert_eq!(at(0.3), pose(2.7, -12.0).get(0));
        // Weights decay like a translation along one axis.
        let weights = WeightInertialization::new(
            [&[1.0 - 2.0 * h, 5.0], &[1.0]],
            [&[3.0], &[3.0 - h]],
            step,
            Time::from_secs(0.3),
        );
        for t in [0.0, 0.07, 0.2, 0.299, 0.3, 0.5] {
            let mut new = [3.0 - t, 7.0];
            weights.apply(Time::from_secs(t.into()), &mut new);
            let place = if t < 0.3 { at(t).translation.x } else { 3.0 - t };
            assert!((new[0] - place).abs() < 1e-5 && new[1] == 7.0, "{t}: {new:?} {place}");
        }
        assert!((at(0.299).translation.x - 2.701).abs() < 1e-4);
    }
}
