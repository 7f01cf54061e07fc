//! A pose in an animator's terms, and the joint rotations that produce it.
//!
//! Angles are in degrees. Rotations are "authored": relative to the T-pose, with axes parallel to the model's, so that the rest
//! pose is all identities. `joint_rotations` converts them to the rig's joint axes.

use crate::rig::{self, Joint, Side};
use glam::{EulerRot, Quat, Vec2, Vec3, vec3};

/// Pitch bends forwards, yaw turns to the left, roll leans to the left.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Turn {
    pub pitch: f32,
    pub yaw: f32,
    pub roll: f32,
}

pub(crate) fn turn(pitch: f32, yaw: f32, roll: f32) -> Turn {
    Turn { pitch, yaw, roll }
}

impl Turn {
    pub(crate) fn rotation(self) -> Quat {
        Quat::from_euler(
            EulerRot::YXZ,
            self.yaw.to_radians(),
            self.pitch.to_radians(),
            -self.roll.to_radians(),
        )
    }
    fn scaled(self, share: f32) -> Turn {
        turn(self.pitch * share, self.yaw * share, self.roll * share)
    }
}

/// Arm pose, relative to an arm that hangs straight down, palm to the thigh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Arm {
    /// Abduction, sideways and up: 90 is the T-pose, negative values cross the body.
    pub raise: f32,
    /// Flexion, forwards and up, applied after `raise`.
    pub flex: f32,
    /// Inward rotation about the upper arm.
    pub twist: f32,
    /// Elbow flexion: 0 straight … 150.
    pub elbow: f32,
    /// Rotation about the forearm that turns the palm back.
    pub pronate: f32,
    /// Wrist flexion towards the palm.
    pub wrist: f32,
    /// Wrist tilt towards the thumb.
    pub tilt: f32,
    /// Finger curl: 0 flat … 1 fist.
    pub curl: f32,
    /// Shoulder shift up, and forwards (`reach`).
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

/// Foot pose. x and z are the floor point below the ankle when the sole is flat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Foot {
    pub x: f32,
    pub z: f32,
    /// Height above the floor of the ball (pitch ≥ 0) or of the heel (pitch < 0), metres.
    pub lift: f32,
    /// Toes pointing outwards.
    pub out: f32,
    /// Positive: heel up, rotating about the ball. Negative: toes up, rotating about the heel.
    pub pitch: f32,
    /// How far the toes stay level while the heel is up, 0 to 1.
    pub toes: f32,
    /// Knee pointing outwards, relative to the toes.
    pub knee: f32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pose {
    /// Offset of the hips from rest, metres, in the facing direction's frame.
    pub hips: Vec3,
    pub pelvis: Turn,
    /// Distributed over the three spine joints.
    pub spine: Turn,
    /// Rotation in world space, apart from `facing`.
    pub head: Turn,
    /// Rotation of the whole figure about the vertical axis through the origin.
    pub facing: f32,
    /// Left and right arm, left and right foot.
    pub arms: [Arm; 2],
    pub feet: [Foot; 2],
}

impl Default for Pose {
    /// A relaxed standing pose.
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

/// Hip position, and rotations of all joints in authored axes.
pub(crate) struct Authored {
    pub hips: Vec3,
    pub rotations: Vec<Quat>,
}

/// Largest share of a leg's length that is used: a fully straight knee looks lifeless and pops.
const MAX_LEG_EXTENSION: f32 = 0.9975;

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
    // Pivot of the foot, and the vector from it to the ankle, with a flat sole and the toes ahead.
    let (pivot, to_ankle) = if foot.pitch >= 0.0 {
        let pivot = vec3(0.0, rig::BALL_HEIGHT, rig::BALL_AHEAD);
        (pivot, vec3(0.0, rig::ANKLE_HEIGHT - rig::BALL_HEIGHT, -rig::BALL_AHEAD))
    } else {
        (vec3(0.0, 0.0, -rig::HEEL_BEHIND), vec3(0.0, rig::ANKLE_HEIGHT, rig::HEEL_BEHIND))
    };
    let ankle = vec3(foot.x, foot.lift, foot.z) + yaw * (pivot + pitch * to_ankle);
    FootTarget { ankle, rotation: yaw * pitch, knee_yaw: ry(side.sign() * (foot.out + foot.knee)) }
}

/// Two-bone IK of a leg: the world rotation of the thigh and the flexion of the knee, for an ankle `reach` away from the hip
/// joint.
///
/// Both bones are equally long, so the flexion is twice the angle at the hip (law of cosines). The knee's axis is perpendicular
/// to `ahead`, so the knee bends one way only.
fn leg(reach: Vec3, ahead: Vec3) -> (Quat, f32) {
    let span = (reach.length() / (2.0 * rig::LEG_SEGMENT)).clamp(0.1, 1.0);
    let half = libm::acosf(span);
    let down = reach.normalize();
    let across = (-down).cross(ahead).normalize();
    let frame = Quat::from_mat3(&glam::Mat3::from_cols(across, -down, across.cross(-down)));
    (frame * Quat::from_rotation_x(-half), 2.0 * half)
}

/// Smooth minimum: rounded where the two values differ by less than `k`.
fn soft_min(a: f32, b: f32, k: f32) -> f32 {
    crate::field::smooth_union(a, b, k)
}

impl Pose {
    pub(crate) fn solve(&self, joints: &[Joint]) -> Authored {
        let mut rotations = vec![Quat::IDENTITY; joints.len()];
        let facing = ry(self.facing);
        let pelvis = self.pelvis.rotation();
        let feet = [foot_target(&self.feet[0], Side::Left), foot_target(&self.feet[1], Side::Right)];

        // Lowers the hips to where both legs reach their ankles.
        let mut hips = joints[rig::HIPS].at + self.hips;
        let mut height = hips.y;
        for side in Side::BOTH {
            let socket = hips + pelvis * (joints[side.up_leg()].at - joints[rig::HIPS].at);
            let to = feet[side as usize].ankle - socket;
            let longest = 2.0 * rig::LEG_SEGMENT * MAX_LEG_EXTENSION;
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

        let third = self.spine.scaled(1.0 / 3.0).rotation();
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
    /// Interpolates the angles: this pose at 0, the other at 1.
    pub(crate) fn mix(&self, other: &Arm, share: f32) -> Arm {
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
        // Angles are defined for the left arm; the right arm is mirrored in x = 0.
        let s = side.sign();
        let (turn_y, turn_z) = (|a: f32| ry(s * a), |a: f32| rz(s * a));
        // The collarbone joins in from 30 degrees on (scapulohumeral rhythm, about 1 in 3).
        let up = (self.raise - 30.0).max(0.0) * 0.22 + (self.flex - 60.0).max(0.0) * 0.12;
        let shoulder = turn_z(self.lift + up.min(24.0)) * turn_y(-self.reach);
        let arm = rx(-self.flex) * turn_z(self.raise - 90.0) * rx(self.twist);
        rotations[side.shoulder()] = shoulder;
        rotations[side.arm()] = shoulder.conjugate() * arm;
        rotations[side.fore_arm()] = turn_y(-self.elbow.clamp(0.0, 150.0)) * rx(self.pronate * 0.4);
        rotations[side.hand()] = rx(self.pronate * 0.6) * turn_z(-self.wrist) * turn_y(-self.tilt);
        for finger in 1..5 {
            // Outer fingers close further.
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

/// Converts rotations from authored axes to the rig's: `parent_axes⁻¹ · authored · axes`.
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
