//! Poses of both skeletons at one time, in f64.

use super::lift::{Clearance, Lift};
use super::{Retarget, Translations};
use crate::clip::Clip;
use crate::clip::sample::Sample;
use crate::math::rotation::normalize_or_identity;
use crate::math::transform::Transform;
use crate::pose::Pose;
use crate::time::Time;
use glam::{DAffine3, DQuat, DVec3};

/// Buffers that are reused from one time to the next, so that nothing is allocated.
pub(super) struct RetargetBuffers {
    pose: Pose,
    source: ModelPose,
    target: ModelPose,
    /// parent-from-joint of the target.
    pub locals: Vec<(DVec3, DQuat)>,
    /// Lift of the hips, metres, that keeps the feet on the floor.
    pub raised: f64,
    /// Height by which the hips are raised, over the clip; `None` if they are not raised.
    lift: Option<Lift>,
}

#[derive(Default)]
struct ModelPose {
    rotations: Vec<DQuat>,
    matrices: Vec<DAffine3>,
}

impl ModelPose {
    fn position(&self, joint: u32) -> DVec3 {
        self.matrices[joint as usize].translation
    }

    fn push(&mut self, parent: Option<u32>, local: Transform) {
        let (t, r, s) = (
            local.translation.as_dvec3(),
            normalize_or_identity(local.rotation.as_dquat()),
            local.scale.as_dvec3(),
        );
        let own = DAffine3::from_scale_rotation_translation(s, r, t);
        let (matrix, rotation) = match parent {
            Some(p) => (self.matrices[p as usize] * own, self.rotations[p as usize] * r),
            None => (own, r),
        };
        self.matrices.push(matrix);
        self.rotations.push(normalize_or_identity(rotation));
    }
}

impl RetargetBuffers {
    /// Buffers for one clip.
    pub(super) fn new(retarget: &Retarget, clip: &Clip) -> RetargetBuffers {
        let mut frame = RetargetBuffers {
            pose: Pose::rest(retarget.from),
            source: ModelPose::default(),
            target: ModelPose::default(),
            locals: vec![(DVec3::ZERO, DQuat::IDENTITY); retarget.to.len()],
            raised: 0.0,
            lift: None,
        };
        if retarget.options.floor
            && retarget.options.translations != Translations::None
            && retarget.both_have_feet()
        {
            frame.lift = Some(Lift::new(retarget, clip, &mut frame));
        }
        frame
    }

    /// Poses the source at a time of the clip, and retargets the pose to the target.
    pub(super) fn pose_at(&mut self, retarget: &Retarget, clip: &Clip, time: Time) {
        self.raised = self.lift.as_ref().map_or(0.0, |lift| lift.at(time));
        self.pose_source(retarget, clip, time);
        self.pose_target(retarget);
    }

    /// The clearance of the feet at a time of the clip.
    pub(super) fn clearance_at(&mut self, retarget: &Retarget, clip: &Clip, time: Time) -> Clearance {
        self.raised = 0.0;
        self.pose_source(retarget, clip, time);
        self.pose_target(retarget);
        self.clearance(retarget)
    }

    fn pose_source(&mut self, retarget: &Retarget, clip: &Clip, time: Time) {
        for (joint, rest) in retarget.from.rest().iter().enumerate() {
            self.pose.set(joint, *rest);
        }
        Sample { clip, time, pose: &mut self.pose }.run();
        self.source.rotations.clear();
        self.source.matrices.clear();
        for (joint, local) in self.pose.iter().enumerate() {
            self.source.push(retarget.from.parents()[joint], local);
        }
    }

    /// The lift with which the lowest foot is as far above its height at rest as the source's, times the scale.
    fn clearance(&self, retarget: &Retarget) -> Clearance {
        let above = |side: &super::SkeletonAnalysis, model: &ModelPose, only: &dyn Fn(u32) -> bool| {
            let joints = side.contacts.iter().filter(|(joint, _)| only(*joint));
            joints.map(|(joint, standing)| model.position(*joint).y - standing).fold(f64::MAX, f64::min)
        };
        let all = |_| true;
        let (source_clearance, target_clearance) =
            (above(&retarget.source, &self.source, &all), above(&retarget.target, &self.target, &all));
        let ankles = ["left foot", "right foot"].map(|name| retarget.source.human.joint(name));
        let ankle = above(&retarget.source, &self.source, &|joint| ankles.contains(&Some(joint)));
        let ankle = if ankle == f64::MAX { source_clearance } else { ankle };
        let source_clearance = source_clearance * retarget.scale;
        Clearance {
            raised: source_clearance - target_clearance,
            least: source_clearance.min(0.0) - target_clearance,
            ankle: ankle / retarget.source.leg.max(1e-6),
        }
    }

    fn pose_target(&mut self, retarget: &Retarget) {
        self.target.rotations.clear();
        self.target.matrices.clear();
        for (joint, rest) in retarget.to.rest().iter().enumerate() {
            let parent = retarget.to.parents()[joint];
            let base = parent.map_or(DQuat::IDENTITY, |p| self.target.rotations[p as usize]);
            let mut local = *rest;
            let mut turn = normalize_or_identity(rest.rotation.as_dquat());
            if let (Some(s), Some(d)) = (retarget.map.source(joint as u32), retarget.follow[joint]) {
                turn = normalize_or_identity(
                    base.conjugate() * retarget.yaw * self.source.rotations[s as usize] * d,
                );
            }
            let mut at = rest.translation.as_dvec3();
            if retarget.translates(joint as u32)
                && let Some(s) = retarget.map.source(joint as u32)
            {
                let mut place = retarget.target_position(joint as u32, self.source.position(s));
                if Some(joint as u32) == retarget.hips {
                    place.y += self.raised;
                }
                let above = parent.map_or(DAffine3::IDENTITY, |p| self.target.matrices[p as usize]);
                let inside = above.inverse().transform_point3(place);
                if inside.is_finite() {
                    at = inside;
                }
            }
            // Positions of the joints below are computed from the rounded numbers that the clip will hold.
            local.translation = at.as_vec3();
            self.locals[joint] = (at, turn);
            let own = DAffine3::from_scale_rotation_translation(local.scale.as_dvec3(), turn, at);
            let (matrix, rotation) = match parent {
                Some(p) => (self.target.matrices[p as usize] * own, normalize_or_identity(base * turn)),
                None => (own, turn),
            };
            self.target.matrices.push(matrix);
            self.target.rotations.push(rotation);
        }
    }
}
