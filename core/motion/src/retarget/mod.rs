//! Retargeting: the same motion on a character of other proportions, whose joints have other names, axes and rest pose.
//!
//! A target joint t follows a source joint s: it turns in model space from its rest pose as s does from its own. With G the
//! rotations of joints in model space, G₀ those at rest, Y the yaw that makes both face the same way, and A the rotation that
//! aligns the target's limbs at rest with the source's (a T-pose taken to an A-pose):
//!
//! Gₜ = Y Gₛ Gₛ₀⁻¹ Y⁻¹ A Gₜ₀
//!
//! so that limbs point where the source's do, whatever the axes. (World-space, rest-relative deltas, as in the retargeters of
//! game engines.) Relative to the parent, this is L q R with L and R constant if the parents follow each other, too: keys map one
//! to one, and interpolation between them is exact. Otherwise, as between spines of different numbers of joints, the motion is
//! sampled at all keys involved and between them until it is within [`RetargetOptions::tolerance_rad`].
//!
//! The hips follow the source's path, times the ratio of the leg lengths, and are then raised or lowered so that the lowest foot
//! is as far above its height at rest as the source's, times that ratio: feet that stand stay on the floor. Between two contacts
//! the height changes smoothly (`lift`).

mod align;
pub mod bind;
mod coverage;
mod frame;
pub mod joint_map;
mod keys;
mod lift;
mod same_joints;
mod sampler;
mod t_pose;

use crate::clip::Clip;
use crate::retarget::joint_map::{JointMap, belongs_to_humanoid};
use crate::skeleton::Skeleton;
use crate::skeleton::humanoid_joints::{HumanoidJoints, is_below};
use crate::skeleton::model_rest_pose::ModelRestPose;
use align::{aligned_rest_rotations, leg_length, yaw_to_target};
use coverage::JointPartners;
use glam::{DQuat, DVec3};
use std::collections::{BTreeMap, BTreeSet};

pub use coverage::Coverage;
pub use keys::RetargetReport;
pub use same_joints::same_joints;

/// The joints whose translations are retargeted, too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Translations {
    /// The hips and their ancestors.
    #[default]
    Hips,
    /// All joints that follow a source joint, by its displacement from rest times the scale.
    All,
    /// No translation.
    None,
}

/// Options of retargeting.
#[derive(Clone, Debug, PartialEq)]
pub struct RetargetOptions {
    /// Target joint → source joint, or none.
    pub joints: BTreeMap<u32, Option<u32>>,
    /// Metres of the target per metre of the source; `None`: the ratio of the leg lengths.
    pub scale: Option<f64>,
    /// Joints whose translations are retargeted.
    pub translations: Translations,
    /// Whether the hips are raised and lowered so that feet stay on the floor.
    pub floor: bool,
    /// Whether limbs at rest are aligned with the source's; otherwise rest poses count as the same.
    pub align: bool,
    /// Largest error of sampled rotations between keys, radians. For positions it is a tenth of this number times the leg length,
    /// metres.
    pub tolerance_rad: f64,
}

impl Default for RetargetOptions {
    fn default() -> Self {
        RetargetOptions {
            joints: BTreeMap::new(),
            scale: None,
            translations: Translations::Hips,
            floor: true,
            align: true,
            tolerance_rad: 1e-3,
        }
    }
}

/// Retargeting from one skeleton to another. Made once for two skeletons, used for any number of clips.
pub struct Retarget<'a> {
    from: &'a Skeleton,
    to: &'a Skeleton,
    map: JointMap,
    options: RetargetOptions,
    source: SkeletonAnalysis,
    target: SkeletonAnalysis,
    /// Metres of the target per metre of the source.
    scale: f64,
    /// Rotation that makes the source face as the target does.
    yaw: DQuat,
    yaw_degrees: f64,
    /// Rotation of each target joint in model space while the source is at rest.
    aligned: Vec<DQuat>,
    /// D of each target joint that follows a source joint, so that G = yaw · G of the source · D.
    follow: Vec<Option<DQuat>>,
    hips: Option<u32>,
}

/// Measures of one skeleton that retargeting needs.
struct SkeletonAnalysis {
    human: HumanoidJoints,
    rest: ModelRestPose,
    /// y of the floor that the rest pose stands on.
    floor: f64,
    /// Mean leg length, metres.
    leg: f64,
    /// Feet and all joints below them, and the height of each above the floor when it stands, metres.
    contacts: Vec<(u32, f64)>,
    /// Whether both feet are about equally high at rest; otherwise the rest pose does not show how the character stands.
    stands: bool,
}

impl SkeletonAnalysis {
    fn of(skeleton: &Skeleton) -> SkeletonAnalysis {
        let human = HumanoidJoints::of(skeleton);
        let rest = ModelRestPose::of(skeleton);
        let leg = leg_length(&human, &rest);
        // A rest pose that does not stand near y = 0, as with the hips at the origin, stands on its lowest joint. Only joints of
        // the character count, since files have cameras and IK controls below the floor.
        let in_humanoid = belongs_to_humanoid(skeleton, &human);
        let lowest = rest.positions.iter().zip(&in_humanoid).filter(|(_, in_humanoid)| **in_humanoid);
        let lowest = lowest.map(|(p, _)| p.y).fold(f64::MAX, f64::min);
        let floor = if lowest.abs() > 0.25 * leg && leg > 0.0 { lowest } else { 0.0 };
        // Feet that are not below the hips, such as IK controls of a rig, do not move when the hips are raised.
        let moves_with_hips =
            |foot: &u32| human.joint("hips").is_some_and(|hips| is_below(skeleton, *foot, hips));
        let feet = ["left foot", "right foot"].map(|name| human.joint(name).filter(moves_with_hips));
        let height = |joint: u32| rest.positions[joint as usize].y - floor;
        let mut contacts = Vec::new();
        for joint in 0..skeleton.len() as u32 {
            if feet.iter().flatten().any(|foot| is_below(skeleton, joint, *foot)) {
                contacts.push((joint, height(joint)));
            }
        }
        let stands = match feet {
            [Some(left), Some(right)] => (height(left) - height(right)).abs() < 0.1 * leg,
            _ => true,
        };
        // A character that rests in the middle of a stride stands on its lower foot, and on the other one when that is as low.
        if let ([Some(left), Some(right)], false) = (feet, stands) {
            let low = height(left).min(height(right));
            for (joint, standing) in &mut contacts {
                *standing -= height(if is_below(skeleton, *joint, left) { left } else { right }) - low;
            }
        }
        SkeletonAnalysis { human, rest, floor, leg, contacts, stands }
    }
}

impl<'a> Retarget<'a> {
    /// Finds the joints that belong together, and the scale between the skeletons.
    pub fn new(from: &'a Skeleton, to: &'a Skeleton, options: RetargetOptions) -> Retarget<'a> {
        let (mut source, mut target) = (SkeletonAnalysis::of(from), SkeletonAnalysis::of(to));
        let map = JointMap::new([from, to], [&source.human, &target.human], &options.joints);
        // Toes that the other skeleton lacks do not define its height, and a clip would not come back to where it began.
        target.contacts.retain(|(joint, _)| map.source(*joint).is_some());
        source.contacts.retain(|(joint, _)| map.pairs().any(|(_, followed, _)| followed == *joint));
        let ratio = |a: f64, b: f64| Some(a / b).filter(|r| r.is_finite() && *r > 1e-6 && *r < 1e6);
        let legs = ratio(target.leg, source.leg);
        let scale =
            options.scale.or(legs).or(ratio(target.rest.height(), source.rest.height())).unwrap_or(1.0);
        let (yaw, yaw_degrees) = yaw_to_target(&source, &target);
        let aligned = aligned_rest_rotations(to, &map, &source, &target, yaw, options.align);
        let follow = (0u32..)
            .zip(&aligned)
            .map(|(joint, aligned)| {
                let s = map.source(joint)? as usize;
                Some(crate::math::rotation::normalize_or_identity(
                    source.rest.rotations[s].conjugate() * yaw.conjugate() * *aligned,
                ))
            })
            .collect();
        let hips = target.human.joint("hips").filter(|h| map.source(*h).is_some());
        Retarget { from, to, map, options, source, target, scale, yaw, yaw_degrees, aligned, follow, hips }
    }

    /// Source joints that the target joints follow.
    pub fn map(&self) -> &JointMap {
        &self.map
    }

    /// Metres of the target per metre of the source.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// The yaw that turns the source to face as the target does, degrees: 0, 90, 180 or −90.
    pub fn yaw_degrees(&self) -> f64 {
        self.yaw_degrees
    }

    /// Joints that alignment turns by more than 0.5° when the source is at rest, with the angle in degrees.
    pub fn alignment(&self) -> Vec<(u32, f64)> {
        let angle = |(joint, aligned): (u32, &DQuat)| {
            let turn = *aligned * self.target.rest.rotations[joint as usize].conjugate();
            self.map.source(joint)?;
            let degrees = 2.0 * libm::asin(turn.xyz().length().min(1.0)).to_degrees();
            (degrees > 0.5).then_some((joint, degrees))
        };
        (0u32..).zip(&self.aligned).filter_map(angle).collect()
    }

    /// Whether the source rests on both feet. If it does not, as in a file of a run alone that rests in its first frame, limbs
    /// still point where they should, but the trunk and the feet are off by the error of the rest pose.
    pub fn rests_standing(&self) -> bool {
        self.source.stands
    }

    /// Whether the target rests on both feet. If it does not, heights of its feet are measured from the lower one.
    pub fn target_stands(&self) -> bool {
        self.target.stands
    }

    /// Whether both skeletons are humanoids, with hips, legs and arms: otherwise little but names identifies joints.
    pub fn is_humanoid(&self) -> bool {
        self.source.human.is_humanoid() && self.target.human.is_humanoid() && self.hips.is_some()
    }

    /// How much of a clip the target follows, and which parts of the body stay at rest.
    pub fn coverage(&self, clip: &Clip) -> Coverage {
        let partners = JointPartners {
            followed: self.map.pairs().map(|(_, source, _)| source).collect(),
            following: self.map.pairs().map(|(joint, _, _)| joint).collect(),
            forbidden: self.options.joints.iter().filter(|(_, s)| s.is_none()).map(|(j, _)| *j).collect(),
        };
        Coverage::of(clip, [self.from, self.to], [&self.source.human, &self.target.human], &partners)
    }

    /// Position in model space of a target joint that translates, for a position of its source joint. Positions at rest
    /// correspond; for the hips, their heights above the floors do.
    fn target_position(&self, joint: u32, source: DVec3) -> DVec3 {
        let s = self.map.source(joint).unwrap_or(0) as usize;
        let mut from_rest = source - self.source.rest.positions[s];
        let mut rest = self.target.rest.positions[joint as usize];
        if Some(joint) == self.hips {
            from_rest.y += self.source.floor;
            rest.y -= self.target.floor;
        }
        rest + self.yaw * from_rest * self.scale
    }

    /// Whether both skeletons have feet.
    fn both_have_feet(&self) -> bool {
        !self.source.contacts.is_empty() && !self.target.contacts.is_empty()
    }

    /// Whether a joint's position follows the source's: the hips and their ancestors, and feet that are not below the hips, such
    /// as IK controls of a rig.
    fn translates(&self, joint: u32) -> bool {
        let is_ik_foot = || {
            let foot = ["left foot", "right foot"].iter().any(|f| self.target.human.joint(f) == Some(joint));
            foot && self.hips.is_some_and(|hips| !is_below(self.to, joint, hips))
        };
        self.options.translations != Translations::None
            && self.map.source(joint).is_some()
            && (self.hips.is_some_and(|hips| is_below(self.to, hips, joint)) || is_ik_foot())
    }
}

/// Binds or retargets a clip to another skeleton, and returns how much of it follows. Curves are copied if joints mean the same
/// there (see [`same_joints`]). If both files declare humanoid bones, rotations go from T-pose to T-pose, as in VRM
/// ([`crate::bind_clip`]). Between other humanoids the clip is retargeted, with a report. Skeletons that are no humanoids are
/// matched by names, or retargeted if structure identifies more joints than names do.
pub fn bind_or_retarget(
    clip: &Clip,
    from: &Skeleton,
    to: &Skeleton,
) -> (Clip, Coverage, Option<RetargetReport>) {
    let both_declare_bones = from.humanoid().is_some() && to.humanoid().is_some();
    if both_declare_bones || same_joints(clip, from, to) {
        let (clip, coverage) = bind_with_coverage(clip, from, to);
        return (clip, coverage, None);
    }
    let retarget = Retarget::new(from, to, RetargetOptions::default());
    let coverage = retarget.coverage(clip);
    if !retarget.is_humanoid() {
        let (bound, by_name) = bind_with_coverage(clip, from, to);
        if coverage.followed() <= by_name.followed() {
            return (bound, by_name, None);
        }
    }
    let (clip, report) = retarget.clip(clip);
    (clip, coverage, Some(report))
}

/// [`crate::bind_clip`], and how much of the clip it binds.
fn bind_with_coverage(clip: &Clip, from: &Skeleton, to: &Skeleton) -> (Clip, Coverage) {
    let (bound, unmatched) = crate::retarget::bind::bind_clip(clip, from, to);
    let moved: BTreeSet<u32> = clip.curves().iter().map(|c| c.joint).collect();
    if unmatched.is_empty() {
        return (bound, Coverage { moved: moved.len(), ..Coverage::default() });
    }
    let left_out: BTreeSet<&str> = unmatched.iter().map(String::as_str).collect();
    let has_partner =
        |joint: &u32| from.names().get(*joint as usize).is_some_and(|name| !left_out.contains(name.as_str()));
    let partners = JointPartners {
        followed: moved.into_iter().filter(has_partner).collect(),
        following: bound.curves().iter().map(|c| c.joint).collect(),
        forbidden: BTreeSet::new(),
    };
    let humans = [from, to].map(HumanoidJoints::of);
    let coverage = Coverage::of(clip, [from, to], [&humans[0], &humans[1]], &partners);
    (bound, coverage)
}
