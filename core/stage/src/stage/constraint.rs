//! Constraints of an actor: foot lock, aim, reach, mirroring; see [`crate::constraints`] for their order.

use crate::mirroring::Mirroring;
use crate::stage::actor::Target;
use crate::stage::described::{FieldType, fields};
use crate::stage::fade::fades_at;
use choreo_asset::hashed;
use choreo_motion::Time;
use glam::DVec3;
use std::sync::Arc;

/// A change of an actor's pose from one time to another, over what its clips do.
#[derive(Clone, Debug, PartialEq)]
pub struct Constraint {
    /// The change.
    pub kind: ConstraintKind,
    /// Stage time at which the constraint starts.
    pub start: Time,
    /// Stage time at which the constraint ends; `None`: never.
    pub end: Option<Time>,
    /// Fade-in after `start` and fade-out before `end`, eased.
    pub fade: Time,
    /// Share of the change, 0..=1.
    pub weight: f32,
}

fields! { Constraint {
    from: start, FieldType::Time;
    until: end, FieldType::Time;
    fade: fade, FieldType::Duration;
    weight: weight, FieldType::Number(0.0, 1.0, "");
} }

fields! { ReachConstraint {
    /// share of the reach in which the limb slows down before it is straight
    soft: soft, FieldType::Number(0.0, 1.0, "");
    /// the hand keeps its rotation from the clip
    keep: keep_rotation, FieldType::Flag;
} }

fields! { AimConstraint {
    /// the most that it turns
    limit: limit, FieldType::Degrees(0.0, 180.0);
} }

/// The change that a constraint makes.
#[derive(Clone, Debug, PartialEq)]
pub enum ConstraintKind {
    /// A hand or foot comes to a target.
    Reach(ReachConstraint),
    /// Joints turn until the last one points at a target.
    Aim(AimConstraint),
    /// Feet on the ground stay where they are.
    FootLock(FootLock),
    /// Mirrors the pose of the clips, left to right, before all other constraints. Root motion is not mirrored.
    Mirror(Arc<Mirroring>),
}

/// The last joint of a chain comes to a target.
#[derive(Clone, Debug, PartialEq)]
pub struct ReachConstraint {
    /// Joints from the shoulder to the hand, each below the one before; at least two. The last one is moved, the others turn.
    pub joints: Vec<u32>,
    /// Target to which the last joint comes.
    pub target: Target,
    /// Offset from the target, in its space: the actor's, the joint's, or the world's of a point. With it an actor's target is its origin,
    /// not its center.
    pub offset: Option<DVec3>,
    /// Pole target: elbows and knees bend towards it.
    pub pole: Option<Target>,
    /// Direction in which a straight limb bends without a pole, in model space.
    pub hint: DVec3,
    /// See [`choreo_motion::ik::TwoBone::soft`]; for two bones.
    pub soft: f64,
    /// Whether the hand keeps its animated rotation, instead of turning with the forearm.
    pub keep_rotation: bool,
}

/// Several joints turn until the last one points at a target.
#[derive(Clone, Debug, PartialEq)]
pub struct AimConstraint {
    /// Joints of the chain, each below the one before. The last one points with the direction that is the model's front at rest.
    pub joints: Vec<u32>,
    /// Relative share of the turn that each joint takes, ≥ 0, one per joint.
    pub shares: Vec<f64>,
    /// Target at which the last joint points.
    pub target: Target,
    /// Largest turn, radians; see [`choreo_motion::ik::Aim::limit`].
    pub limit: f64,
}

/// Feet that are on the ground stay where they are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FootLock {
    /// Legs whose feet stay.
    pub legs: Vec<Leg>,
    /// Joint that is lowered or raised with the ground: the hips.
    pub hips: Option<u32>,
    /// Actors on whose surfaces, as they are at time 0, the feet stand: on the highest surface below each foot. Empty: the feet stand at
    /// the height of this actor's origin.
    pub ground: Vec<usize>,
    /// If not empty, only contacts that overlap one of these spans are locked; each is then locked as a whole.
    pub locked_spans: Vec<(Time, Time)>,
    /// Fades in which feet take steps to their positions in the standing clip; sorted, one after the other.
    pub standing_fades: Vec<StandingFade>,
}

/// A fade between a clip that walks and one that stands, or a turn while standing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StandingFade {
    /// Time at which it begins.
    pub from: Time,
    /// Time at which it has ended.
    pub to: Time,
    /// Whether the standing clip plays at the end of the fade; else it plays at the start.
    pub ends_standing: bool,
}

impl FootLock {
    /// Largest lowering of the hips, as a share of the leg's length.
    pub(crate) const MAX_HIP_DROP_SHARE: f64 = 0.25;
}

/// Joints of a leg, from the hip down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Leg {
    /// The thigh, which turns in the hip.
    pub hip: u32,
    /// The lower leg, which turns in the knee.
    pub knee: u32,
    /// The foot, which turns in the ankle.
    pub foot: u32,
    /// The ball of the foot, which stays while the heel rises.
    pub toe: Option<u32>,
}

hashed! {
    struct Constraint { start, end, fade, weight, kind }
    enum ConstraintKind {
        0 Reach(reach),
        1 Aim(aim),
        2 FootLock(foot_lock),
        3 Mirror(mirroring),
    }
    struct ReachConstraint { joints, target, offset, pole, hint, soft, keep_rotation }
    struct AimConstraint { joints, shares, target, limit }
    struct FootLock { legs, hips, ground, locked_spans, standing_fades }
    struct StandingFade { from, to, ends_standing }
    struct Leg { hip, knee, foot, toe }
}

impl ConstraintKind {
    /// The name in scripts.
    pub fn name(&self) -> &'static str {
        match self {
            ConstraintKind::Reach(_) => "reach",
            ConstraintKind::Aim(_) => "aim",
            ConstraintKind::FootLock(_) => "plant_feet",
            ConstraintKind::Mirror(_) => "mirror",
        }
    }
}

impl Constraint {
    /// A constraint from time zero on, without fades.
    pub fn new(kind: ConstraintKind) -> Constraint {
        Constraint { kind, start: Time::ZERO, end: None, fade: Time::ZERO, weight: 1.0 }
    }

    /// Weight with fades, 0..=1; 0 outside `start..end`.
    pub(crate) fn weight_at(&self, time: Time) -> f64 {
        let Some([fade_in, fade_out]) = fades_at(time, self.start, self.end, self.fade) else { return 0.0 };
        // Foot locks and mirroring that begin with the stage do not fade in.
        let is_on_from_start = self.start <= Time::ZERO
            && matches!(self.kind, ConstraintKind::FootLock(_) | ConstraintKind::Mirror(_));
        let fade_in = if is_on_from_start { 1.0 } else { fade_in };
        f64::from((self.weight * fade_in * fade_out).clamp(0.0, 1.0))
    }

    /// The highest joint index of the constraint; 0 if it has no joints.
    pub(crate) fn last_joint(&self) -> u32 {
        let last = match &self.kind {
            ConstraintKind::Reach(reach) => reach.joints.iter().max().copied(),
            ConstraintKind::Aim(aim) => aim.joints.iter().max().copied(),
            ConstraintKind::FootLock(foot_lock) => {
                let of_leg = |l: &Leg| l.hip.max(l.knee).max(l.foot).max(l.toe.unwrap_or(0));
                foot_lock.legs.iter().map(of_leg).chain(foot_lock.hips).max()
            }
            ConstraintKind::Mirror(_) => None,
        };
        last.unwrap_or(0)
    }

    /// Targets on which the constraint depends.
    pub(crate) fn targets(&self) -> impl Iterator<Item = Target> {
        let (target, pole) = match &self.kind {
            ConstraintKind::Reach(reach) => (Some(reach.target), reach.pole),
            ConstraintKind::Aim(aim) => (Some(aim.target), None),
            ConstraintKind::FootLock(_) | ConstraintKind::Mirror(_) => (None, None),
        };
        target.into_iter().chain(pole)
    }
}
