//! A pose in the words of an animator, and the joint rotations that make it.
//!
//! Angles are in degrees. Rotations below are "authored": relative to the T-pose with axes along the model's, so that
//! a rest pose is all identities; `joint_rotations` turns them into the rig's own axes at the end.

use crate::rig::{self, Joint, Side};
use glam::{EulerRot, Quat, Vec2, Vec3, vec3};

/// Pitch bends forwards, yaw turns to the left, roll leans to the left.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Turn {
    pub pitch: f32,
    pub yaw: f32,
    pub roll: f32,
}

pub fn turn(pitch: f32, yaw: f32, roll: f32) -> Turn {
    Turn { pitch, yaw, roll }
}

impl Turn {
    pub fn rotation(self) -> Quat {
        Quat::from_euler(
            EulerRot::YXZ,
            self.yaw.to_radians(),
            self.pitch.to_radians(),
            -self.roll.to_radians(),
        )
    }
    fn part(self, share: f32) -> Turn {
        turn(self.pitch * share, self.yaw * share, self.roll * share)
    }
}

/// Arm pose, relative to an arm that hangs straight down, palm to the thigh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arm {
    /// Sideways and up: 90 is the T-pose, negative crosses the body.
    pub raise: f32,
    /// Forwards and up, after `raise`.
    pub flex: f32,
    /// About the upper arm, inwards.
    pub twist: f32,
    /// 0 straight … 150.
    pub elbow: f32,
    /// About the fore arm, palm turned back.
    pub pronate: f32,
    /// Wrist towards the palm.
    pub wrist: f32,
    /// Wrist towards the thumb.
    pub tilt: f32,
    /// Fingers: 0 flat … 1 fist.
    pub curl: f32,
    /// Shoulder up, and forwards.
    pub lift: f32,
    pub reach: f32,
}

impl Default for Arm {
    fn default() -> Arm {
        Arm {
            raise: 9.0,
            flex: 2.0,
            twist: 12.0,
            elbow: 16.0,
            pronate: 12.0,
            wrist: 4.0,
            tilt: 0.0,
            curl: 0.22,
            lift: 0.0,
            reach: 0.0,
        }
    }
}

/// Foot pose: the ankle's foot point when the sole lies flat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    pub x: f32,
    pub z: f32,
    /// Height of the ball (pitch > 0) or of the heel (pitch < 0) above the floor.
    pub lift: f32,
    /// Toes outwards.
    pub out: f32,
    /// Positive: heel up, turning about the ball. Negative: toes up, turning about the heel.
    pub pitch: f32,
    /// How far the toes stay level while the heel is up, 0..1.
    pub toes: f32,
    /// Knee outwards, relative to the toes.
    pub knee: f32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Offset of the hips from rest, in metres, in the direction that the figure faces.
    pub hips: Vec3,
    pub pelvis: Turn,
    /// Spread over the spine.
    pub spine: Turn,
    /// Rotation in the world, except for `facing`.
    pub head: Turn,
    /// The whole figure turned about the vertical axis through the origin.
    pub facing: f32,
    /// Arms and feet: left, right.
    pub arms: [Arm; 2],
    pub feet: [Foot; 2],
}

impl Default for Pose {
    /// Standing at ease.
    fn default() -> Pose {
        let foot = Foot { x: 0.105, z: 0.0, lift: 0.0, out: 8.0, pitch: 0.0, toes: 1.0, knee: 0.0 };
        Pose {
            hips: vec3(0.0, -0.001, 0.0),
            pelvis: Turn::default(),
            spine: turn(1.0, 0.0, 0.0),
            head: turn(2.0, 0.0, 0.0),
            facing: 0.0,
            arms: [Arm::default(); 2],
            feet: [Foot { z: 0.01, ..foot }, Foot { x: -foot.x, z: -0.01, ..foot }],
        }
    }
}

/// Rotations of all joints (authored axes) and the position of the hips.
pub struct Authored {
    pub hips: Vec3,
    pub rotations: Vec<Quat>,
}

/// Share of a leg's length that may be used: a knee that locks looks dead, and pops.
const LONGEST: f32 = 0.9975;

fn rx(degrees: f32) -> Quat {
    Quat::from_rotation_x(degrees.to_radians())
}
fn ry(degrees: f32) -> Quat {
    Quat::from_rotation_y(degrees.to_radians())
}
fn rz(degrees: f32) -> Quat {
    Quat::from_rotation_z(degrees.to_radians())
}

struct FootTarget {
    ankle: Vec3,
    rotation: Quat,
    knee_yaw: Quat,
}

fn foot_target(foot: &Foot, side: Side) -> FootTarget {
    let yaw = ry(side.sign() * foot.out);
    let pitch = rx(foot.pitch);
    // The vector from the pivot to the ankle, with a flat sole and the toes ahead.
    let (pivot, to_ankle) = if foot.pitch >= 0.0 {
        let pivot = vec3(0.0, rig::BALL_HEIGHT, rig::BALL_AHEAD);
        (pivot, vec3(0.0, rig::ANKLE_HEIGHT - rig::BALL_HEIGHT, -rig::BALL_AHEAD))
    } else {
        (vec3(0.0, 0.0, -rig::HEEL_BEHIND), vec3(0.0, rig::ANKLE_HEIGHT, rig::HEEL_BEHIND))
    };
    let ankle = vec3(foot.x, foot.lift, foot.z) + yaw * (pivot + pitch * to_ankle);
    FootTarget { ankle, rotation: yaw * pitch, knee_yaw: ry(side.sign() * (foot.out + foot.knee)) }
}

/// The thigh's world rotation and the knee's bend for an ankle `reach` away from the hip joint.
///
/// Two equal segments: the bend is twice the angle at the hip (law of cosines); the knee's axis lies across the plane
/// of `ahead`, so it bends one way only.
fn leg(reach: Vec3, ahead: Vec3) -> (Quat, f32) {
    let span = (reach.length() / (2.0 * rig::LEG_SEGMENT)).clamp(0.1, 1.0);
    let half = libm::acosf(span);
    let down = reach.normalize();
    let across = (-down).cross(ahead).normalize();
    let frame = Quat::from_mat3(&glam::Mat3::from_cols(across, -down, across.cross(-down)));
    (frame * Quat::from_rotation_x(-half), 2.0 * half)
}

/// The smaller of two, rounded where they are within `k`.
fn soft_min(a: f32, b: f32, k: f32) -> f32 {
    crate::field::join(a, b, k)
}

impl Pose {
    pub fn solve(&self, joints: &[Joint]) -> Authored {
        let mut rotations = vec![Quat::IDENTITY; joints.len()];
        let facing = ry(self.facing);
        let pelvis = self.pelvis.rotation();
        let feet = [foot_target(&self.feet[0], Side::Left), foot_target(&self.feet[1], Side::Right)];

        // Let the hips down to where both legs reach.
        let mut hips = joints[rig::HIPS].at + self.hips;
        let mut height = hips.y;
        for side in Side::BOTH {
            let socket = hips + pelvis * (joints[side.up_leg()].at - joints[rig::HIPS].at);
            let to = feet[side as usize].ankle - socket;
            let longest = 2.0 * rig::LEG_SEGMENT * LONGEST;
            let across = Vec2::new(to.x, to.z).length().min(longest);
            let highest = (longest * longest - across * across).sqrt() + feet[side as usize].ankle.y;
            height = soft_min(height, highest + hips.y - socket.y, 0.012);
        }
        hips.y = height;

        rotations[rig::HIPS] = facing * pelvis;
        for side in Side::BOTH {
            let target = &feet[side as usize];
            let socket = hips + pelvis * (joints[side.up_leg()].at - joints[rig::HIPS].at);
            let (thigh, knee) = leg(target.ankle - socket, target.knee_yaw * Vec3::Z);
            let shin = thigh * Quat::from_rotation_x(knee);
            rotations[side.up_leg()] = pelvis.conjugate() * thigh;
            rotations[side.leg()] = Quat::from_rotation_x(knee);
            rotations[side.foot()] = shin.conjugate() * target.rotation;
            let foot = self.feet[side as usize];
            rotations[side.toe_base()] = rx(-foot.pitch.max(0.0) * foot.toes);
        }

        let third = self.spine.part(1.0 / 3.0).rotation();
        for joint in [rig::SPINE, rig::SPINE1, rig::SPINE2] {
            rotations[joint] = third;
        }
        let chest = pelvis * third * third * third;
        let nod = chest.conjugate() * self.head.rotation();
        rotations[rig::NECK] = Quat::IDENTITY.slerp(nod, 0.4);
        rotations[rig::HEAD] = rotations[rig::NECK].conjugate() * nod;

        for side in Side::BOTH {
            self.arms[side as usize].solve(side, &mut rotations);
        }
        Authored { hips: facing * hips, rotations }
    }
}

impl Arm {
    /// This one at 0, the other at 1.
    pub fn mix(&self, other: &Arm, share: f32) -> Arm {
        let mix = |a: f32, b: f32| a + (b - a) * share;
        Arm {
            raise: mix(self.raise, other.raise),
            flex: mix(self.flex, other.flex),
            twist: mix(self.twist, other.twist),
            elbow: mix(self.elbow, other.elbow),
            pronate: mix(self.pronate, other.pronate),
            wrist: mix(self.wrist, other.wrist),
            tilt: mix(self.tilt, other.tilt),
            curl: mix(self.curl, other.curl),
            lift: mix(self.lift, other.lift),
            reach: mix(self.reach, other.reach),
        }
    }

    fn solve(&self, side: Side, rotations: &mut [Quat]) {
        // Everything is thought of on the left; the right is its mirror image in x = 0.
        let s = side.sign();
        let (turn_y, turn_z) = (|a: f32| ry(s * a), |a: f32| rz(s * a));
        // The collar bone takes part from 30 degrees on (scapulohumeral rhythm, about 1 in 3).
        let up = (self.raise - 30.0).max(0.0) * 0.22 + (self.flex - 60.0).max(0.0) * 0.12;
        let shoulder = turn_z(self.lift + up.min(24.0)) * turn_y(-self.reach);
        let arm = rx(-self.flex) * turn_z(self.raise - 90.0) * rx(self.twist);
        rotations[side.shoulder()] = shoulder;
        rotations[side.arm()] = shoulder.conjugate() * arm;
        rotations[side.fore_arm()] = turn_y(-self.elbow.clamp(0.0, 150.0)) * rx(self.pronate * 0.4);
        rotations[side.hand()] = rx(self.pronate * 0.6) * turn_z(-self.wrist) * turn_y(-self.tilt);
        for finger in 1..5 {
            // The outer fingers close more.
            let bend = self.curl * (78.0 + 5.0 * finger as f32);
            for segment in 0..3 {
                rotations[side.finger(finger, segment)] = turn_z(-bend * [0.8, 1.1, 0.75][segment]);
            }
        }
        let bend = self.curl * 48.0;
        rotations[side.finger(0, 0)] = turn_y(bend * 0.5) * turn_z(-bend * 0.4);
        for segment in 1..3 {
            rotations[side.finger(0, segment)] = turn_y(bend * 0.55) * turn_z(-bend * 0.25);
        }
    }
}

/// Converts authored axes to the rig's: `parent_axes⁻¹ · authored · axes`.
pub(crate) fn joint_rotations(joints: &[Joint], authored: &Authored) -> Vec<Quat> {
    joints
        .iter()
        .zip(&authored.rotations)
        .map(|(joint, rotation)| {
            let parent = joint.parent.map_or(Quat::IDENTITY, |p| joints[p].axes);
            (parent.conjugate() * *rotation * joint.axes).normalize()
        })
        .collect()
}
