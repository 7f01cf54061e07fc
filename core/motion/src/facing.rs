//! Detects the front of a character from its skeleton and its clips.

use crate::clip::{Clip, Curve, Path};
use crate::contacts::find_feet;
use crate::root_motion::{RootMotion, RootParts};
use crate::skeleton::Skeleton;
use crate::skeleton::humanoid_joints::HumanoidJoints;
use crate::skeleton::model_rest_pose::ModelRestPose;
use crate::skeleton::sides::{Side, side_of};
use crate::time::Time;
use glam::{DQuat, DVec3};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

/// The horizontal axis of model space that a character faces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Front {
    /// glTF's convention.
    #[default]
    PlusZ,
    /// The opposite of glTF's convention.
    MinusZ,
    /// The left of a character that faces +Z.
    PlusX,
    /// The right of a character that faces +Z.
    MinusX,
}

impl Front {
    /// All fronts, with their names in scripts.
    pub const ALL: [(&str, Front); 4] =
        [("+z", Front::PlusZ), ("-z", Front::MinusZ), ("+x", Front::PlusX), ("-x", Front::MinusX)];

    /// Name in scripts.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, front)| *front == self).map_or("", |(name, _)| name)
    }

    /// Angle about +Y that turns +Z to this front, radians.
    pub fn yaw_rad(self) -> f64 {
        match self {
            Front::PlusZ => 0.0,
            Front::MinusZ => PI,
            Front::PlusX => FRAC_PI_2,
            Front::MinusX => -FRAC_PI_2,
        }
    }

    /// Rotation about +Y that turns +Z to this front.
    pub fn rotation(self) -> DQuat {
        DQuat::from_rotation_y(self.yaw_rad())
    }

    /// Unit direction in model space.
    pub fn direction(self) -> DVec3 {
        match self {
            Front::PlusZ => DVec3::Z,
            Front::MinusZ => DVec3::NEG_Z,
            Front::PlusX => DVec3::X,
            Front::MinusX => DVec3::NEG_X,
        }
    }

    /// The axis within 35° of a direction.
    fn nearest(direction: DVec3) -> Option<Front> {
        let level = direction.with_y(0.0).try_normalize()?;
        Self::ALL.iter().map(|(_, front)| *front).find(|front| front.direction().dot(level) > 0.819)
    }
}

/// The front of a character, and the evidence for it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facing {
    /// The axis that the character faces.
    pub front: Front,
    /// Parts of the character that indicate a front.
    pub evidence: Vec<FacingEvidence>,
    /// Whether the evidence contradicts itself, so that +Z is kept.
    pub doubtful: bool,
}

/// A part of a character, and the direction that it indicates as the front.
#[derive(Clone, Debug, PartialEq)]
pub struct FacingEvidence {
    /// Name of the part: feet, eyes, knees, left and right, or travel of clips.
    pub part: &'static str,
    /// Horizontal unit vector in model space.
    pub direction: DVec3,
}

impl Facing {
    /// Detects the front from the toes, the eyes, the bend of the knees, and joints named as left and right; if none of them
    /// indicates a direction, from the travel of clips. The front is the axis that most of them indicate.
    pub fn of(skeleton: &Skeleton, clips: &[Arc<Clip>]) -> Facing {
        let rest = ModelRestPose::of(skeleton);
        let position = |joint: u32| rest.positions[joint as usize];
        let indicated_directions = [
            ("feet", toe_direction(skeleton, position)),
            ("eyes", eye_direction(skeleton, position)),
            ("knees", knee_direction(skeleton, position)),
            ("left and right", left_right_direction(skeleton, position)),
        ];
        let level = |(part, direction): (&'static str, DVec3)| {
            let direction = direction.with_y(0.0).try_normalize()?;
            Some(FacingEvidence { part, direction })
        };
        let mut evidence: Vec<FacingEvidence> = indicated_directions.into_iter().filter_map(level).collect();
        if evidence.is_empty() {
            evidence.extend(level(("travel of clips", travel_direction(skeleton, clips))));
        }
        let votes = |front| evidence.iter().filter(|e| Front::nearest(e.direction) == Some(front)).count();
        let best = Front::ALL
            .iter()
            .map(|(_, front)| *front)
            .max_by_key(|front| (votes(*front), *front == Front::PlusZ));
        let best = best.unwrap_or_default();
        let doubtful = !evidence.is_empty() && 2 * votes(best) <= evidence.len();
        Facing {
            front: if doubtful || evidence.is_empty() { Front::PlusZ } else { best },
            evidence,
            doubtful,
        }
    }
}

/// The direction from heels to toes; zero for toes that point down.
fn toe_direction(skeleton: &Skeleton, position: impl Fn(u32) -> DVec3) -> DVec3 {
    let ahead = |joints: &[u32]| match joints {
        [heel, toe, ..] => horizontal_direction(position(*toe) - position(*heel), 0.3),
        _ => DVec3::ZERO,
    };
    find_feet(skeleton).iter().map(|foot| ahead(&foot.joints)).sum()
}

/// Direction from the parent joints of the eyes to the eyes.
fn eye_direction(skeleton: &Skeleton, position: impl Fn(u32) -> DVec3) -> DVec3 {
    let is_eye = |name: &str| {
        let name = name.to_lowercase();
        name.contains("eye")
            && !["brow", "lid", "lash", "target", "end"].iter().any(|other| name.contains(other))
    };
    let eyes = (0u32..).zip(skeleton.names()).filter(|(_, name)| is_eye(name));
    let parents = skeleton.parents();
    eyes.filter_map(|(eye, _)| {
        Some(horizontal_direction(position(eye) - position(parents[eye as usize]?), 0.2))
    })
    .sum()
}

/// Direction in which bent knees lie off the lines from hips to ankles.
fn knee_direction(skeleton: &Skeleton, position: impl Fn(u32) -> DVec3) -> DVec3 {
    let joints = HumanoidJoints::of(skeleton);
    let bend = |side: &str| {
        let find = |part: &str| joints.joint(&format!("{side} {part}")).map(&position);
        let (Some(hip), Some(knee), Some(ankle)) = (find("upleg"), find("leg"), find("foot")) else {
            return DVec3::ZERO;
        };
        let leg = ankle - hip;
        let bend = knee - hip - leg * ((knee - hip).dot(leg) / leg.length_squared());
        if bend.length() > 0.01 * leg.length() { horizontal_direction(bend, 0.3) } else { DVec3::ZERO }
    };
    bend("left") + bend("right")
}

/// Forward direction from joints that are named as left and right: with +Y up, left × up is forward.
fn left_right_direction(skeleton: &Skeleton, position: impl Fn(u32) -> DVec3) -> DVec3 {
    let mut pairs: BTreeMap<String, [Vec<u32>; 2]> = BTreeMap::new();
    for (joint, name) in (0u32..).zip(skeleton.names()) {
        if let Some((side, rest)) = side_of(name) {
            pairs.entry(rest).or_default()[usize::from(side == Side::Right)].push(joint);
        }
    }
    let across = |pair: &[Vec<u32>; 2]| match pair {
        [left, right] if left.len() == 1 && right.len() == 1 => {
            horizontal_direction(position(left[0]) - position(right[0]), 0.7)
        }
        _ => DVec3::ZERO,
    };
    let across: Vec<DVec3> = pairs.values().map(across).filter(|way| *way != DVec3::ZERO).collect();
    // If the pairs contradict each other, the names do not mean sides.
    sum_unless_contradictory(&across).cross(DVec3::Y)
}

/// Sum of unit vectors; zero if they contradict each other.
fn sum_unless_contradictory(directions: &[DVec3]) -> DVec3 {
    let sum: DVec3 = directions.iter().sum();
    if sum.length() > 0.5 * directions.len() as f64 { sum } else { DVec3::ZERO }
}

/// Smallest number of rotating joints in a clip of a walking character. Clips with fewer move a door, a cart or a camera.
const MIN_ROTATING_JOINTS: usize = 4;

/// Direction of travel of clips in which limbs move; zero if the clips contradict each other.
fn travel_direction(skeleton: &Skeleton, clips: &[Arc<Clip>]) -> DVec3 {
    let limbs = |clip: &&Arc<Clip>| {
        let turns = |curve: &&Curve| curve.path == Path::Rotation && curve.times.len() > 1;
        clip.curves().iter().filter(turns).count() >= MIN_ROTATING_JOINTS
    };
    let velocity = |clip: &Arc<Clip>| {
        let span = (Time::ZERO, clip.duration);
        RootMotion::new(skeleton, clip, None, RootParts::default(), span).map(|motion| motion.velocity())
    };
    let moving =
        clips.iter().filter(limbs).filter_map(velocity).map(|v| v.with_y(0.0)).filter(|v| v.length() > 0.2);
    sum_unless_contradictory(&moving.map(|v| v.normalize()).collect::<Vec<_>>())
}

/// Horizontal unit vector along a displacement; zero unless its horizontal part is more than `share` of its length.
fn horizontal_direction(displacement: DVec3, share: f64) -> DVec3 {
    let level = displacement.with_y(0.0);
    if level.length() > share * displacement.length() { level.normalize_or_zero() } else { DVec3::ZERO }
}
