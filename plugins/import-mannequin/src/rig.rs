//! The skeleton: 55 joints with mixamorig names, in a T-pose that faces +Z with its feet on y = 0.
//!
//! Joint axes follow the mixamorig convention (Y along the bone, Z out of the palm for arms, Z forward for legs), so that clips
//! authored for that rig can be copied joint by joint.

use choreo_motion::{Skeleton, SkeletonError, Transform};
use glam::{Mat3, Quat, Vec3, vec3};

pub(crate) const HIPS: usize = 0;
pub(crate) const SPINE: usize = 1;
pub(crate) const SPINE1: usize = 2;
pub(crate) const SPINE2: usize = 3;
pub(crate) const NECK: usize = 4;
pub(crate) const HEAD: usize = 5;
const ARMS: usize = 7;
const JOINTS_PER_ARM: usize = 19;
const LEGS: usize = ARMS + 2 * JOINTS_PER_ARM;
const JOINTS_PER_LEG: usize = 5;
pub(crate) const JOINT_COUNT: usize = LEGS + 2 * JOINTS_PER_LEG;

/// Length of the thigh, and of the shin, metres.
pub(crate) const LEG_SEGMENT: f32 = 0.415;
pub(crate) const ANKLE_HEIGHT: f32 = 0.085;
/// Height of the toe joint, and its distance in front of the ankle, metres.
pub(crate) const BALL_HEIGHT: f32 = 0.022;
pub(crate) const BALL_AHEAD: f32 = 0.125;
/// Distance behind the ankle at which the heel touches the floor, metres.
pub(crate) const HEEL_BEHIND: f32 = 0.045;
pub(crate) const HIP_WIDTH: f32 = 0.095;
pub(crate) const REST_HEIGHT: f32 = 1.75;

/// A side of the body. 0 is the left, at +X.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Left = 0,
    Right = 1,
}

impl Side {
    pub(crate) const BOTH: [Side; 2] = [Side::Left, Side::Right];
    /// +1 left, −1 right.
    pub(crate) fn sign(self) -> f32 {
        if self == Side::Left { 1.0 } else { -1.0 }
    }
    pub(crate) fn shoulder(self) -> usize {
        ARMS + JOINTS_PER_ARM * self as usize
    }
    pub(crate) fn arm(self) -> usize {
        self.shoulder() + 1
    }
    pub(crate) fn fore_arm(self) -> usize {
        self.shoulder() + 2
    }
    pub(crate) fn hand(self) -> usize {
        self.shoulder() + 3
    }
    /// Joint of a finger segment. Finger 0 is the thumb, segment 0 begins at the knuckle.
    pub(crate) fn finger(self, finger: usize, segment: usize) -> usize {
        self.shoulder() + 4 + 3 * finger + segment
    }
    pub(crate) fn up_leg(self) -> usize {
        LEGS + JOINTS_PER_LEG * self as usize
    }
    pub(crate) fn leg(self) -> usize {
        self.up_leg() + 1
    }
    pub(crate) fn foot(self) -> usize {
        self.up_leg() + 2
    }
    pub(crate) fn toe_base(self) -> usize {
        self.up_leg() + 3
    }
}

pub(crate) struct Joint {
    pub name: String,
    pub parent: Option<usize>,
    /// Rest position in model space, metres.
    pub at: Vec3,
    /// Model-from-joint rotation at rest.
    pub axes: Quat,
}

/// (name, knuckle, direction, segment lengths) of the left fingers, thumb first.
pub(crate) const FINGERS: [(&str, Vec3, Vec3, [f32; 3]); 5] = [
    ("Thumb", vec3(0.747, 1.411, 0.020), vec3(0.72, -0.22, 0.66), [0.038, 0.032, 0.027]),
    ("Index", vec3(0.812, 1.421, 0.020), vec3(0.997, 0.0, 0.07), [0.038, 0.025, 0.021]),
    ("Middle", vec3(0.817, 1.423, -0.002), vec3(1.0, 0.0, 0.0), [0.042, 0.028, 0.022]),
    ("Ring", vec3(0.811, 1.421, -0.023), vec3(0.998, 0.0, -0.06), [0.039, 0.026, 0.021]),
    ("Pinky", vec3(0.800, 1.417, -0.042), vec3(0.99, 0.0, -0.13), [0.031, 0.021, 0.018]),
];

/// The rotation whose Y axis is `y` and whose X axis is as close to `x` as possible.
fn axes(y: Vec3, x: Vec3) -> Quat {
    let y = y.normalize();
    let z = x.cross(y).normalize();
    Quat::from_mat3(&Mat3::from_cols(y.cross(z), y, z))
}

/// All joints, parents first.
pub(crate) fn joints() -> Vec<Joint> {
    let mut list: Vec<Joint> = Vec::with_capacity(JOINT_COUNT);
    let mut add = |name: String, parent: Option<usize>, at: Vec3, axes: Quat| {
        list.push(Joint { name: format!("mixamorig:{name}"), parent, at, axes });
    };
    let trunk = [
        ("Hips", vec3(0.0, 0.96, 0.0)),
        ("Spine", vec3(0.0, 1.05, -0.008)),
        ("Spine1", vec3(0.0, 1.15, -0.012)),
        ("Spine2", vec3(0.0, 1.26, -0.012)),
        ("Neck", vec3(0.0, 1.465, -0.015)),
        ("Head", vec3(0.0, 1.55, -0.002)),
        ("HeadTop_End", vec3(0.0, 1.75, 0.0)),
    ];
    for (i, (name, at)) in trunk.into_iter().enumerate() {
        add(name.into(), i.checked_sub(1), at, Quat::IDENTITY);
    }
    for side in Side::BOTH {
        let (word, s) = (if side == Side::Left { "Left" } else { "Right" }, side.sign());
        let mirrored = |v: Vec3| vec3(s * v.x, v.y, v.z);
        // Y points to the fingertips, Z out of the palm, which faces down.
        let along = axes(vec3(s, 0.0, 0.0), vec3(0.0, 0.0, -s));
        let chain = [
            ("Shoulder", SPINE2, vec3(0.035, 1.425, -0.012)),
            ("Arm", side.shoulder(), vec3(0.178, 1.42, -0.012)),
            ("ForeArm", side.arm(), vec3(0.460, 1.42, -0.012)),
            ("Hand", side.fore_arm(), vec3(0.712, 1.42, -0.012)),
        ];
        for (name, parent, at) in chain {
            add(format!("{word}{name}"), Some(parent), mirrored(at), along);
        }
        for (finger, (name, knuckle, direction, lengths)) in FINGERS.into_iter().enumerate() {
            let direction = mirrored(direction.normalize());
            let mut at = mirrored(knuckle);
            for (segment, length) in lengths.into_iter().enumerate() {
                let parent = if segment == 0 { side.hand() } else { side.finger(finger, segment - 1) };
                add(
                    format!("{word}Hand{name}{}", segment + 1),
                    Some(parent),
                    at,
                    axes(direction, vec3(0.0, 0.0, -s)),
                );
                at += direction * length;
            }
        }
    }
    for side in Side::BOTH {
        let (word, s) = (if side == Side::Left { "Left" } else { "Right" }, side.sign());
        let x = s * HIP_WIDTH;
        let knee = ANKLE_HEIGHT + LEG_SEGMENT;
        let ankle = vec3(x, ANKLE_HEIGHT, 0.0);
        let ball = vec3(x, BALL_HEIGHT, BALL_AHEAD);
        let down = axes(Vec3::NEG_Y, Vec3::NEG_X);
        let ahead = axes(Vec3::Z, Vec3::NEG_X);
        let chain = [
            ("UpLeg", HIPS, vec3(x, knee + LEG_SEGMENT, 0.0), down),
            ("Leg", side.up_leg(), vec3(x, knee, 0.0), down),
            ("Foot", side.leg(), ankle, axes(ball - ankle, Vec3::NEG_X)),
            ("ToeBase", side.foot(), ball, ahead),
            ("Toe_End", side.toe_base(), vec3(x, BALL_HEIGHT, 0.205), ahead),
        ];
        for (name, parent, at, axes) in chain {
            add(format!("{word}{name}"), Some(parent), at, axes);
        }
    }
    list
}

/// Rest rotation of a joint relative to its parent.
pub(crate) fn rest_rotation(joints: &[Joint], joint: usize) -> Quat {
    match joints[joint].parent {
        Some(parent) => joints[parent].axes.conjugate() * joints[joint].axes,
        None => joints[joint].axes,
    }
}

/// The joints as a skeleton for the stage, scaled.
pub(crate) fn skeleton(joints: &[Joint], scale: f32) -> Result<Skeleton, SkeletonError> {
    let rest = (0..joints.len()).map(|i| {
        let joint = &joints[i];
        let translation = match joint.parent {
            Some(parent) => joints[parent].axes.conjugate() * (joint.at - joints[parent].at),
            None => joint.at,
        };
        Transform { translation: translation * scale, rotation: rest_rotation(joints, i), scale: Vec3::ONE }
    });
    Skeleton::new(
        joints.iter().map(|j| j.name.clone()).collect(),
        joints.iter().map(|j| j.parent.map(|p| p as u32)).collect(),
        rest.collect(),
    )
}
