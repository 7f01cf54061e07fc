//! Root motion: how far a clip moves its character over the floor.
//!
//! The root's frame at a clip time is a [`Planar`]: the requested components of the root joint's position in model space, and its
//! heading, the twist about +Y of its rotation since the rest pose (swing–twist decomposition: P. Dobrowolski, "Swing-twist
//! decomposition in Clifford algebra", 2015, §3). It is computed in f64 from the keys, so that accumulated motion does not drift.
//! A clip that walks on the spot moves its character as fast as the floor passes under its planted feet.

use crate::clip::sample_f64::curve_at;
use crate::clip::{Clip, Path};
use crate::contacts::{self, Contacts};
use crate::math::planar::{Planar, wrapped};
use crate::skeleton::Skeleton;
use crate::skeleton::joint_names::humanoid_name;
use crate::time::Time;
use glam::{DAffine3, DQuat, DVec3};
use std::sync::Arc;

/// The parts of the root's motion that are extracted from the clip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RootParts {
    /// Motion along the floor.
    pub horizontal: bool,
    /// Motion up and down.
    pub vertical: bool,
    /// Heading. `None`: only if the clip as a whole turns by more than `MIN_TURN_RAD`, since hips sway in a straight walk.
    pub yaw: Option<bool>,
}

impl Default for RootParts {
    fn default() -> RootParts {
        RootParts { horizontal: true, vertical: false, yaw: None }
    }
}

/// Smallest turn that counts as a change of heading, 15°: more than hips deviate from the direction of travel at the ends of a straight walk.
pub(crate) const MIN_TURN_RAD: f64 = std::f64::consts::PI / 12.0;

/// A root that moves no farther than this share of the leg's length in a clip stays on the spot.
const STILL_DISTANCE_LEGS: f64 = 0.1;
/// The same limit for a root that returns to its start, as in a gallop on the spot. The gait must then be as fast as `MIN_GAIT_SPEED_LEGS`.
const RETURNING_DISTANCE_LEGS: f64 = 0.6;
/// Smallest speed of the floor under a gait on the spot that returns to its start, leg lengths per second.
const MIN_GAIT_SPEED_LEGS: f64 = 1.0;

#[derive(Clone, Debug)]
struct ChainJoint {
    rest: DAffine3,
    parts: (DVec3, DQuat, DVec3),
    /// Indices of the clip's curves of translation, rotation and scale.
    curves: [Option<u32>; 3],
}

/// The root motion of one clip, or of a part of it.
#[derive(Clone, Debug)]
pub struct RootMotion {
    clip: Arc<Clip>,
    joint: u32,
    /// Joints from the root of the skeleton to the root-motion joint.
    chain: Vec<ChainJoint>,
    /// Rotation of the joint in model space at rest.
    rest_rotation: DQuat,
    /// Parts that are extracted.
    pub parts: RootParts,
    yaw: bool,
    /// Velocity against the floor of a clip that walks on the spot, metres per second of the clip.
    pub treadmill: Option<DVec3>,
    /// Part of the clip that is played, clip time.
    pub trim: (Time, Time),
}

impl RootMotion {
    /// Root motion of the trimmed part of a clip. `joint`: the root-motion joint; `None`: as `find_root` finds it.
    pub fn new(
        skeleton: &Skeleton,
        clip: &Arc<Clip>,
        joint: Option<u32>,
        parts: RootParts,
        trim: (Time, Time),
    ) -> Option<RootMotion> {
        let joint = joint.or_else(|| find_root(skeleton, clip))?;
        let mut chain = Vec::new();
        let mut next = Some(joint);
        while let Some(at) = next {
            let rest = skeleton.rest().get(at as usize)?;
            let find = |path: Path| {
                clip.curves().iter().position(|c| c.joint == at && c.path == path).map(|i| i as u32)
            };
            let parts = (rest.translation.as_dvec3(), rest.rotation.as_dquat(), rest.scale.as_dvec3());
            chain.push(ChainJoint {
                rest: DAffine3::from_scale_rotation_translation(parts.2, parts.1, parts.0),
                parts,
                curves: [find(Path::Translation), find(Path::Rotation), find(Path::Scale)],
            });
            next = skeleton.parents()[at as usize];
        }
        chain.reverse();
        let rest_rotation = chain.iter().fold(DQuat::IDENTITY, |q, link| q * link.parts.1).normalize();
        let mut motion = RootMotion {
            clip: clip.clone(),
            joint,
            chain,
            rest_rotation,
            parts,
            yaw: true,
            treadmill: None,
            trim,
        };
        let turn = wrapped(motion.frame(trim.1).yaw - motion.frame(trim.0).yaw);
        motion.yaw = parts.yaw.unwrap_or(turn.abs() > MIN_TURN_RAD);
        if parts.horizontal && trim.1 > trim.0 {
            motion.treadmill = motion.treadmill_velocity(skeleton);
        }
        Some(motion)
    }

    /// The root-motion joint.
    pub fn joint(&self) -> u32 {
        self.joint
    }

    /// The clip from which the motion is extracted, unchanged.
    pub fn clip(&self) -> &Arc<Clip> {
        &self.clip
    }

    /// Mean velocity of the character, on the spot or not: metres per second of the clip, in the axes of the model at the start.
    pub fn velocity(&self) -> DVec3 {
        if let Some(velocity) = self.treadmill {
            return velocity;
        }
        let secs = (self.trim.1 - self.trim.0).as_secs();
        let displacement = self.place(self.trim.1) - self.place(self.trim.0);
        if secs > 0.0 { displacement / secs } else { DVec3::ZERO }
    }

    /// Velocity against the floor if the root stays on the spot while the feet walk.
    fn treadmill_velocity(&self, skeleton: &Skeleton) -> Option<DVec3> {
        let steps = 16;
        let span = (self.trim.1 - self.trim.0).0;
        let first = self.place(self.trim.0).with_y(0.0);
        let max_distance = (1..=steps)
            .map(|i| (self.place(self.trim.0 + Time(span / steps * i)).with_y(0.0) - first).length())
            .fold(0.0, f64::max);
        let feet = contacts::find_feet(skeleton);
        let leg = contacts::leg_length(skeleton, &feet)?;
        let returns =
            (self.place(self.trim.1).with_y(0.0) - first).length() <= 0.5 * STILL_DISTANCE_LEGS * leg;
        if max_distance > if returns { RETURNING_DISTANCE_LEGS } else { STILL_DISTANCE_LEGS } * leg {
            return None;
        }
        let Contacts { floor_velocity, .. } = Contacts::find(skeleton, &self.clip, self.trim, &feet)?;
        (max_distance <= STILL_DISTANCE_LEGS * leg || floor_velocity.length() > MIN_GAIT_SPEED_LEGS * leg)
            .then_some(-floor_velocity)
    }

    /// Position of the root joint in model space, metres.
    pub fn place(&self, time: Time) -> DVec3 {
        self.root_transform(time).0
    }

    /// Frame that moves the character along, in model space.
    pub fn frame(&self, time: Time) -> Planar {
        if let Some(velocity) = self.treadmill {
            let secs = (time - self.trim.0).as_secs();
            return Planar { translation: velocity * secs, yaw: 0.0 };
        }
        let (place, rotation) = self.root_transform(time);
        let RootParts { horizontal, vertical, .. } = self.parts;
        let translation = DVec3::new(
            if horizontal { place.x } else { 0.0 },
            if vertical { place.y } else { 0.0 },
            if horizontal { place.z } else { 0.0 },
        );
        let yaw = if self.yaw { twist_about_y(rotation * self.rest_rotation.conjugate()) } else { 0.0 };
        Planar { translation, yaw }
    }

    /// Position and rotation of the root joint in model space.
    fn root_transform(&self, time: Time) -> (DVec3, DQuat) {
        let mut model = DAffine3::IDENTITY;
        let mut turned = DQuat::IDENTITY;
        for link in &self.chain {
            let (mut t, mut r, mut s) = link.parts;
            if link.curves == [None; 3] {
                model *= link.rest;
                turned *= r;
                continue;
            }
            let value = |curve: u32| curve_at(&self.clip.curves()[curve as usize], time);
            let three = |v: [f64; 4]| DVec3::new(v[0], v[1], v[2]);
            if let Some(curve) = link.curves[0] {
                t = three(value(curve));
            }
            if let Some(curve) = link.curves[1] {
                r = DQuat::from_array(value(curve));
            }
            if let Some(curve) = link.curves[2] {
                s = three(value(curve));
            }
            model *= DAffine3::from_scale_rotation_translation(s, r, t);
            turned *= r;
        }
        (model.translation, turned.normalize())
    }
}

/// Twist of a rotation about +Y, radians, without its swing; 0 if the rotation turns +Y upside down.
fn twist_about_y(q: DQuat) -> f64 {
    if q.y == 0.0 && q.w == 0.0 { 0.0 } else { wrapped(2.0 * libm::atan2(q.y, q.w)) }
}

/// The root-motion joint of a clip: the topmost ancestor of the hips that the clip translates, else the hips. If no joint is
/// named as the hips, the first joint that the clip translates, else the first joint.
pub(crate) fn find_root(skeleton: &Skeleton, clip: &Clip) -> Option<u32> {
    let moves = |joint: u32| {
        clip.curves().iter().any(|c| {
            c.joint == joint
                && c.path == Path::Translation
                && c.values.chunks_exact(c.stride()).any(|key| key != &c.values[..c.stride()])
        })
    };
    let hips = skeleton.names().iter().position(|n| humanoid_name(n).as_deref() == Some("hips"));
    let Some(hips) = hips else {
        let first = (0..skeleton.len() as u32).find(|joint| moves(*joint));
        return first.or((!skeleton.is_empty()).then_some(0));
    };
    let mut root = hips as u32;
    let mut next = skeleton.parents()[hips];
    while let Some(joint) = next {
        if moves(joint) {
            root = joint;
        }
        next = skeleton.parents()[joint as usize];
    }
    Some(root)
}
