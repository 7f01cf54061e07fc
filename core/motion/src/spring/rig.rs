//! The swinging joints of a skeleton, and their springs.

use super::{SpringBone, SpringCollider, SpringError, SpringJoint, Springs};
use crate::skeleton::Skeleton;
use glam::{DVec3, Vec3};

/// Steps per second of the update that VRM's parameters are tuned for.
const VRM_STEPS_PER_SECOND: f64 = 60.0;

/// Springs of a skeleton: at most one bone per joint, parents first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SpringRig {
    /// Bones, ascending by joint, at most one per joint.
    bones: Vec<RigBone>,
    colliders: Vec<SpringCollider>,
    /// Height of a floor that no tail sinks into, metres of the world.
    pub ground: Option<f64>,
}

/// A joint that swings. Directions are in world space.
#[derive(Clone, Debug, PartialEq)]
pub struct RigBone {
    /// The joint that is turned.
    pub joint: u32,
    /// End of the stick in the joint's space, metres before its scale.
    pub tail: Vec3,
    /// Stiffness and damping.
    pub spring: SpringBone,
    /// Gravity, metres/s².
    pub gravity: DVec3,
    /// Angular acceleration that does not depend on the stick's length, 1/s²: VRM's gravity.
    pub pull: DVec3,
    /// Radius of the tail against colliders, metres before the joint's scale.
    pub hit_radius: f64,
    /// Joint in whose space inertia is measured instead of the world's.
    pub center: Option<u32>,
    /// Indices into the rig's colliders.
    pub colliders: Vec<u32>,
}

impl SpringRig {
    /// Springs of a VRM file. Small swings equal those of the specification's update at 60 steps per second, to the digit (its
    /// two poles are kept: matched z-transform), and so does the position at rest, except that the pull grows here with the angle
    /// and there with its sine. At other rates the specification's motion changes; this does not.
    pub fn from_vrm(springs: &Springs, skeleton: &Skeleton) -> Result<SpringRig, SpringError> {
        springs.check(skeleton.len())?;
        let rest = skeleton.rest_model_from_joint();
        let mut rig = SpringRig { colliders: springs.colliders.clone(), ..SpringRig::default() };
        for chain in &springs.chains {
            for joint in &chain.joints {
                let length = (rest[joint.joint as usize].matrix3 * glam::Vec3A::from(joint.tail)).length();
                let (spring, pull) = spring_and_pull_of_vrm(joint, f64::from(length));
                rig.add(RigBone {
                    joint: joint.joint,
                    tail: joint.tail,
                    spring,
                    gravity: DVec3::ZERO,
                    pull: joint.gravity_direction.as_dvec3().normalize_or_zero() * pull,
                    hit_radius: f64::from(joint.hit_radius),
                    center: chain.center,
                    colliders: chain.colliders.clone(),
                });
            }
        }
        Ok(rig)
    }

    /// Adds a bone, or replaces the one on the same joint.
    pub fn add(&mut self, bone: RigBone) {
        match self.bones.binary_search_by_key(&bone.joint, |b| b.joint) {
            Ok(at) => self.bones[at] = bone,
            Err(at) => self.bones.insert(at, bone),
        }
    }

    /// Adds a collider and returns its index for [`RigBone::colliders`].
    pub fn add_collider(&mut self, collider: SpringCollider) -> u32 {
        self.colliders.push(collider);
        (self.colliders.len() - 1) as u32
    }

    /// Bones, ascending by joint, at most one per joint.
    pub fn bones(&self) -> &[RigBone] {
        &self.bones
    }

    /// Mutable bones.
    pub fn bones_mut(&mut self) -> impl Iterator<Item = &mut RigBone> {
        self.bones.iter_mut()
    }

    /// Shapes that tails cannot enter.
    pub fn colliders(&self) -> &[SpringCollider] {
        &self.colliders
    }

    /// Number of bones.
    pub fn len(&self) -> usize {
        self.bones.len()
    }

    /// Whether there are no bones.
    pub fn is_empty(&self) -> bool {
        self.bones.is_empty()
    }

    /// Keeps the bones of the joints for which `keep` is true.
    pub fn retain(&mut self, keep: impl Fn(u32) -> bool) {
        self.bones.retain(|b| keep(b.joint));
    }

    /// Fails at the first value that does not fit a skeleton of `joint_count` joints, or is out of range.
    pub fn check(&self, joint_count: usize) -> Result<(), SpringError> {
        let bad = |place: String, what: String| Err(SpringError { place, what });
        for (index, collider) in self.colliders.iter().enumerate() {
            if collider.joint as usize >= joint_count {
                let what = format!("joint {} does not exist (count: {joint_count})", collider.joint);
                return bad(format!("colliders[{index}]"), what);
            }
        }
        for bone in &self.bones {
            let place = format!("bone of joint {}", bone.joint);
            let joints = [Some(bone.joint), bone.center];
            if let Some(joint) = joints.into_iter().flatten().find(|j| *j as usize >= joint_count) {
                return bad(place, format!("joint {joint} does not exist (count: {joint_count})"));
            }
            if let Some(c) = bone.colliders.iter().find(|c| **c as usize >= self.colliders.len()) {
                return bad(place, format!("collider {c} does not exist (count: {})", self.colliders.len()));
            }
            let SpringBone { stiffness, damping } = bone.spring;
            for (name, value) in
                [("stiffness", stiffness), ("damping", damping), ("hit_radius", bone.hit_radius)]
            {
                if !(0.0..=1e18).contains(&value) {
                    return bad(place, format!("{name} is {value}, must be 0..=1e18"));
                }
            }
            if !(bone.tail.is_finite() && bone.gravity.is_finite() && bone.pull.is_finite()) {
                return bad(place, "tail, gravity and pull must be finite".into());
            }
        }
        match self.ground {
            Some(y) if !y.is_finite() => bad("ground".into(), format!("is at {y} m, must be finite")),
            _ => Ok(()),
        }
    }
}

/// The continuous spring whose samples at 60 Hz are the specification's update, and the strength of its gravity.
///
/// A small angle θ of a stick of length L obeys `θ₁ = ρ (θ + e (θ − θ₋))` with e = 1 − drag and ρ = L / (L + stiffness · dt), since
/// the pull lengthens the vector that is then brought back to L. So z² − ρ(1 + e) z + ρe = 0, and K and κ are the product and
/// the negative sum of ln z / dt.
fn spring_and_pull_of_vrm(joint: &SpringJoint, length: f64) -> (SpringBone, f64) {
    let dt = 1.0 / VRM_STEPS_PER_SECOND;
    let pull = f64::from(joint.stiffness);
    // A drag of 1 loses all speed; here a billionth is kept, so that the logarithm is finite.
    let kept_speed = (1.0 - f64::from(joint.drag_force)).clamp(1e-9, 1.0);
    let rho = length / (length + pull * dt);
    if length <= 0.0 || rho <= 0.0 {
        return (SpringBone::default(), 0.0);
    }
    let (sum, product) = (rho * (1.0 + kept_speed), rho * kept_speed);
    let discriminant = 0.25 * sum * sum - product;
    let damping = -libm::log(product) / dt;
    let stiffness = if discriminant < 0.0 {
        let angle = libm::atan2((-discriminant).sqrt(), 0.5 * sum);
        let decay = 0.5 * libm::log(product);
        (decay * decay + angle * angle) / (dt * dt)
    } else {
        let large = 0.5 * sum + discriminant.sqrt();
        libm::log(large) * libm::log(product / large) / (dt * dt)
    };
    let stiffness = stiffness.max(0.0);
    // Balance of stiffness against gravity as in the file; without stiffness, the same final speed of falling.
    let share = if pull > 0.0 {
        stiffness / pull
    } else if kept_speed < 1.0 {
        damping / ((1.0 - kept_speed) * length)
    } else {
        1.0 / (dt * length)
    };
    (SpringBone { stiffness, damping }, f64::from(joint.gravity_power) * share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spring::{BoneState, Drive};

    /// The specification's update of one stick, in a plane; angles in radians.
    fn specification_angles(
        joint: &SpringJoint,
        length: f64,
        frames: usize,
        rate: f64,
        start: f64,
    ) -> Vec<f64> {
        let dt = 1.0 / rate;
        let tail = |angle: f64| DVec3::new(libm::sin(angle), -libm::cos(angle), 0.0) * length;
        let (mut now, mut before) = (tail(start), tail(start));
        let mut angles = Vec::new();
        for _ in 0..frames {
            let inertia = (now - before) * (1.0 - f64::from(joint.drag_force));
            let stiffness = DVec3::NEG_Y * f64::from(joint.stiffness) * dt;
            let external = joint.gravity_direction.as_dvec3() * f64::from(joint.gravity_power) * dt;
            let next = (now + inertia + stiffness + external).normalize() * length;
            (before, now) = (now, next);
            angles.push(libm::atan2(now.x, -now.y));
        }
        angles
    }

    fn choreo_angles(joint: &SpringJoint, length: f64, frames: usize, rate: f64, start: f64) -> Vec<f64> {
        let (spring, pull) = spring_and_pull_of_vrm(joint, length);
        let drive = Drive {
            head: DVec3::ZERO,
            follows: false,
            target: DVec3::NEG_Y,
            length,
            gravity: DVec3::ZERO,
            pull: joint.gravity_direction.as_dvec3() * pull,
            wind: DVec3::ZERO,
        };
        let direction = DVec3::new(libm::sin(start), -libm::cos(start), 0.0);
        // The specification starts with no difference between two samples, half a step before no speed.
        let mut state = BoneState { direction, velocity: DVec3::ZERO, ..spring.settled(&drive) };
        let mut angles = Vec::new();
        for _ in 0..frames {
            spring.step(&mut state, &drive, 1.0 / rate);
            angles.push(libm::atan2(state.direction.x, -state.direction.y));
        }
        angles
    }

    /// Sum and product of the two poles, which state decay and frequency of a swing, from its samples.
    fn two_poles(angles: &[f64]) -> [f64; 2] {
        // a₂ = s a₁ − p a₀ at two places.
        let [a, b, c, d] = [angles[2], angles[3], angles[4], angles[5]];
        let det = b * b - a * c;
        [(b * c - a * d) / det, (c * c - b * d) / det]
    }

    #[test]
    fn small_swings_match_the_specification_at_60_hz_and_differ_at_144_hz() {
        for (stiffness, drag) in [(1.0, 0.4), (0.2, 0.1), (4.0, 0.9), (0.05, 0.01)] {
            let joint = SpringJoint { stiffness, drag_force: drag, ..SpringJoint::default() };
            let at = |rate: f64| {
                let (specified, ours) = (
                    specification_angles(&joint, 0.1, 8, rate, 1e-4),
                    choreo_angles(&joint, 0.1, 8, rate, 1e-4),
                );
                (two_poles(&specified), two_poles(&ours))
            };
            let (wanted, got) = at(60.0);
            for i in 0..2 {
                assert!((wanted[i] - got[i]).abs() < 1e-5, "{stiffness} {drag}: {wanted:?} {got:?}");
            }
            // At another rate, the specification's own update behaves like a different spring.
            let (wanted, got) = at(144.0);
            assert!((wanted[1] - got[1]).abs() > 1e-3, "{stiffness} {drag}: {wanted:?} {got:?}");
        }
    }

    #[test]
    fn the_rest_position_matches_the_specification() {
        let joint = SpringJoint {
            stiffness: 1.0,
            gravity_power: 0.3,
            gravity_direction: Vec3::X,
            drag_force: 0.4,
            ..SpringJoint::default()
        };
        let (wanted, got) = (
            specification_angles(&joint, 0.1, 400, 60.0, 0.0)[399],
            choreo_angles(&joint, 0.1, 400, 60.0, 0.0)[399],
        );
        // tan θ = gravity / stiffness; here θ K = f cos θ, 3 % less.
        assert!((wanted - libm::atan(0.3)).abs() < 1e-6, "{wanted}");
        assert!((got - wanted).abs() < 0.015, "{got}, {wanted}");
    }
}
