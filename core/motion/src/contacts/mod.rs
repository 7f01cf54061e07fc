//! Foot contacts: the times at which each foot of a clip is on the floor, and the velocity of the floor.
//!
//! A foot is in contact while it is near its lowest position, hardly rises or sinks, and moves with the floor
//! ([`ContactThresholds`]; thresholds on height and speed with hysteresis: L. Kovar, J. Schreiner, M. Gleicher, "Footskate
//! Cleanup for Motion Capture Editing", SCA 2002, §4). Thresholds are shares of the leg's length, so that they hold for mice and
//! giants, and of the gait's speed: a runner at 4 m/s lands hard, rolls fast and stands for a twentieth of a second.
//!
//! The floor's velocity is not known beforehand: zero for a clip with root motion, that of a treadmill for a clip on the spot.
//! The lowest samples of each foot are nearly always on the floor, so the median of their velocities is a first estimate; the
//! median over feet that are in contact by it is the second. Feet of authored clips move by half more or less than that, and
//! still count as standing.

mod feet;
pub(crate) mod phase_matching;
mod still_intervals;

use crate::clip::Clip;
use crate::clip::sample::Sample;
use crate::pose::Pose;
use crate::pose::local_to_model::LocalToModel;
use crate::skeleton::Skeleton;
use crate::time::Time;
use glam::{Affine3A, DVec3, Vec3};

pub use feet::{find_feet, leg_length, leg_of_ik_control};
pub use still_intervals::still_intervals;

/// Height limit of a contact above the lowest position, in leg lengths. A walk's toe swings through at 2 %, but fast.
const MAX_HEIGHT_LEGS: f64 = 0.06;
/// Vertical speed limit of a contact, in leg lengths per second, and as a fraction of the gait's speed.
const MAX_VERTICAL_SPEED_LEGS: f64 = 0.8;
const MAX_VERTICAL_SPEED_SHARE: f64 = 0.35;
/// Horizontal speed limit of a contact against the floor, in the same units.
const MAX_SLIDING_SPEED_LEGS: f64 = 0.5;
const MAX_SLIDING_SPEED_SHARE: f64 = 0.35;
/// Samples per second, and the largest number of samples per clip.
const SAMPLES_PER_SECOND: f64 = 120.0;
const MAX_SAMPLES: usize = 4096;
/// A foot that has contacts is on the floor in at least 1 of this number of samples.
const CONTACT_SHARE_DIVISOR: usize = 10;

/// Thresholds below which a foot is in contact; above 0. A joint is in contact while [`ContactThresholds::motion_ratio`] is at
/// most 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactThresholds {
    /// Height above the joint's lowest position, metres.
    pub height: f64,
    /// Vertical speed, metres per second.
    pub climb: f64,
    /// Horizontal speed against the floor, metres per second.
    pub slip: f64,
}

impl ContactThresholds {
    /// Thresholds for a leg of `leg` metres and a character that moves over the floor at `gait` metres per second.
    pub fn new(leg: f64, gait: f64) -> ContactThresholds {
        let (climb, slip) = (
            MAX_VERTICAL_SPEED_LEGS * leg + MAX_VERTICAL_SPEED_SHARE * gait,
            MAX_SLIDING_SPEED_LEGS * leg + MAX_SLIDING_SPEED_SHARE * gait,
        );
        ContactThresholds { height: MAX_HEIGHT_LEGS * leg, climb, slip }
    }

    /// Largest ratio of height, vertical and horizontal speed to their thresholds: in contact up to 1. `velocity` is relative to
    /// the floor.
    pub fn motion_ratio(&self, height: f64, velocity: DVec3) -> f64 {
        let level = velocity.with_y(0.0).length();
        (height / self.height).max(velocity.y.abs() / self.climb).max(level / self.slip)
    }
}

/// The joints of one foot, ankle and toe, of which the lower one counts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Foot {
    /// Indices into the skeleton's joints.
    pub joints: Vec<u32>,
}

/// A time span in which a foot is on the floor. `to` may lie after the end of a looped clip: the contact then continues at its
/// beginning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ContactInterval {
    /// Clip time at which the foot touches the floor.
    pub from: Time,
    /// Clip time at which the foot leaves the floor.
    pub to: Time,
}

/// The times at which feet of a clip are on the floor.
#[derive(Clone, Debug, PartialEq)]
pub struct Contacts {
    /// Contact intervals by foot, in the order of time.
    pub intervals: Vec<Vec<ContactInterval>>,
    /// Horizontal velocity of the floor in model space, metres per second of the clip.
    pub floor_velocity: DVec3,
}

/// Positions of all joints in model space.
fn joint_positions(skeleton: &Skeleton, pose: &Pose) -> Vec<Vec3> {
    let mut matrices = vec![Affine3A::IDENTITY; skeleton.len()];
    LocalToModel { skeleton, pose, model_from_joint: &mut matrices }.run();
    matrices.into_iter().map(|m| m.translation.into()).collect()
}

/// A joint of a foot over the clip.
struct JointTrack {
    foot: usize,
    /// Heights above the joint's lowest position, metres.
    heights: Vec<f64>,
    velocities: Vec<DVec3>,
}

impl Contacts {
    /// Detects the contacts in the trimmed part of a clip, which counts as a loop if it ends as it begins. `None` without feet,
    /// legs or duration, or if clip and skeleton differ in their number of joints.
    pub fn find(skeleton: &Skeleton, clip: &Clip, trim: (Time, Time), feet: &[Foot]) -> Option<Contacts> {
        let leg = leg_length(skeleton, feet)?;
        let span = (trim.1 - trim.0).as_secs();
        let count = ((span * SAMPLES_PER_SECOND) as usize).clamp(8, MAX_SAMPLES);
        if span <= 0.0 || clip.joint_count() != skeleton.len() {
            return None;
        }
        let time = |i: usize| trim.0 + Time(((trim.1 - trim.0).0 as i128 * i as i128 / count as i128) as i64);
        let step = span / count as f64;
        let joints: Vec<(usize, u32)> =
            feet.iter().enumerate().flat_map(|(f, foot)| foot.joints.iter().map(move |j| (f, *j))).collect();
        let mut pose = Pose::rest(skeleton);
        let mut positions: Vec<Vec<DVec3>> = vec![Vec::with_capacity(count + 1); joints.len()];
        for i in 0..=count {
            Sample { clip, time: time(i), pose: &mut pose }.run();
            let model = joint_positions(skeleton, &pose);
            for ((_, joint), positions) in joints.iter().zip(&mut positions) {
                positions.push(model[*joint as usize].as_dvec3());
            }
        }
        let displacements: Vec<DVec3> = positions.iter().map(|p| p[count] - p[0]).collect();
        let drift = displacements.iter().sum::<DVec3>() / displacements.len().max(1) as f64;
        let looped = displacements.iter().all(|displacement| (*displacement - drift).length() < 0.1 * leg);
        let tracks: Vec<JointTrack> = joints
            .iter()
            .zip(&positions)
            .map(|((foot, _), positions)| JointTrack::new(*foot, positions, step, looped.then_some(drift)))
            .collect();
        let mut floor = horizontal_median(&lowest_velocities(&tracks, leg))?;
        let mut motion_ratios = vec![vec![f64::INFINITY; count + 1]; feet.len()];
        // The floor's velocity is estimated from the lowest samples first, then from joints in contact.
        for _ in 0..2 {
            let thresholds = ContactThresholds::new(leg, (floor - drift.with_y(0.0) / span).length());
            let mut contact_velocities = Vec::new();
            motion_ratios.iter_mut().for_each(|row| row.fill(f64::INFINITY));
            for track in &tracks {
                let row = &mut motion_ratios[track.foot];
                for ((smallest_ratio, height), velocity) in
                    row.iter_mut().zip(&track.heights).zip(&track.velocities)
                {
                    let ratio = thresholds.motion_ratio(*height, *velocity - floor);
                    if ratio <= 1.0 {
                        contact_velocities.push(*velocity);
                    }
                    *smallest_ratio = smallest_ratio.min(ratio);
                }
            }
            floor = horizontal_median(&contact_velocities).unwrap_or(floor);
        }
        let at = |i: usize| if i <= count { time(i) } else { trim.1 + (time(i - count) - trim.0) };
        let to_interval = |(from, to): (usize, usize)| ContactInterval { from: at(from), to: at(to) };
        let intervals_of_row =
            |row: &Vec<f64>| still_intervals(row, step, looped).into_iter().map(to_interval).collect();
        Some(Contacts {
            intervals: motion_ratios.iter().map(intervals_of_row).collect(),
            floor_velocity: floor,
        })
    }
}

impl JointTrack {
    /// `drift`: displacement of a loop per cycle; `None` if the clip is no loop.
    fn new(foot: usize, positions: &[DVec3], step: f64, drift: Option<DVec3>) -> JointTrack {
        let lowest = positions.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
        let count = positions.len() - 1;
        // Central differences, around the seam of a loop, else one-sided at the ends.
        let velocity = |i: usize| match (drift, i) {
            (Some(drift), i) if i == 0 || i == count => {
                (positions[1] + drift - positions[count - 1]) / (2.0 * step)
            }
            (_, i) => {
                let (a, b) = (i.saturating_sub(1), (i + 1).min(count));
                (positions[b] - positions[a]) / ((b - a) as f64 * step)
            }
        };
        let heights = positions.iter().map(|p| p.y - lowest).collect();
        JointTrack { foot, heights, velocities: (0..=count).map(velocity).collect() }
    }
}

/// Velocities of joints while they are low: in the lowest tenth of their samples at least, since in a run a foot is on the floor
/// for no longer.
fn lowest_velocities(tracks: &[JointTrack], leg: f64) -> Vec<DVec3> {
    let mut found = Vec::new();
    for track in tracks {
        let mut sorted = track.heights.clone();
        sorted.sort_by(f64::total_cmp);
        let limit = sorted[sorted.len() / CONTACT_SHARE_DIVISOR].max(0.5 * MAX_HEIGHT_LEGS * leg);
        let pairs = track.heights.iter().zip(&track.velocities);
        found.extend(pairs.filter(|(height, _)| **height <= limit).map(|(_, velocity)| *velocity));
    }
    found
}

/// Component-wise median of the horizontal components; `None` without samples.
fn horizontal_median(samples: &[DVec3]) -> Option<DVec3> {
    let middle = |component: fn(&DVec3) -> f64| {
        let mut values: Vec<f64> = samples.iter().map(component).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    Some(DVec3::new(middle(|v| v.x)?, 0.0, middle(|v| v.z)?))
}
