//! Poses of both skeletons at one time, in f64.

use super::lift::{Clearance, Lift};
use super::{Retarget, Translations};
use crate::clip::Clip;
use crate::clip::sample::Sample;
use crate::math::rotation::unit;
use crate::math::transform::Transform;
use crate::pose::Pose;
use crate::time::Time;
use glam::{DAffine3, DQuat, DVec3};

/// Buffers that are kept from one time to the next, so that nothing is allocated.
pub(super) struct RetargetBuffers {
    pose: Pose,
    source: Model,
    target: Model,
    /// parent-from-joint of the target.
    pub locals: Vec<(DVec3, DQuat)>,
    /// Metres by which the hips were raised, so that the feet stay on the floor.
    pub raised: f64,
    /// Height by which the hips are raised, over the clip; `None` if they are not raised.
    lift: Option<Lift>,
}

#[derive(Default)]
struct Model {
    rotations: Vec<DQuat>,
    matrices: Vec<DAffine3>,
}

impl Model {
    fn place(&self, joint: u32) -> DVec3 {
        self.matrices[joint as usize].translation
    }

    fn push(&mut self, parent: Option<u32>, local: Transform) {
        let (t, r, s) =
            (local.translation.as_dvec3(), unit(local.rotation.as_dquat()), local.scale.as_dvec3());
        let own = DAffine3::from_scale_rotation_translation(s, r, t);
        let (matrix, rotation) = match parent {
            Some(p) => (self.matrices[p as usize] * own, self.rotations[p as usize] * r),
            None => (own, r),
        };
        self.matrices.push(matrix);
        self.rotations.push(unit(rotation));
    }
}

impl RetargetBuffers {
    /// Buffers for one clip.
    pub fn new(of: &Retarget, clip: &Clip) -> RetargetBuffers {
        let mut frame = RetargetBuffers {
            pose: Pose::rest(of.from),
            source: Model::default(),
            target: Model::default(),
            locals: vec![(DVec3::ZERO, DQuat::IDENTITY); of.to.len()],
            raised: 0.0,
            lift: None,
        };
        if of.options.floor && of.options.translations != Translations::None && of.both_have_feet() {
            frame.lift = Some(Lift::new(of, clip, &mut frame));
        }
        frame
    }

    /// Poses the source at a time of the clip, and the target after it.
    pub fn at(&mut self, of: &Retarget, clip: &Clip, time: Time) {
        self.raised = self.lift.as_ref().map_or(0.0, |lift| lift.at(time));
        self.sample(of, clip, time);
        self.follow(of);
    }

    /// The clearance of the feet at a time of the clip.
    pub fn clearance_at(&mut self, of: &Retarget, clip: &Clip, time: Time) -> Clearance {
        self.raised = 0.0;
        self.sample(of, clip, time);
        self.follow(of);
        self.clearance(of)
    }

    fn sample(&mut self, of: &Retarget, clip: &Clip, time: Time) {
        for (joint, rest) in of.from.rest().iter().enumerate() {
            self.pose.set(joint, *rest);
        }
        Sample { clip, time, pose: &mut self.pose }.run();
        self.source.rotations.clear();
        self.source.matrices.clear();
        for (joint, local) in self.pose.iter().enumerate() {
            self.source.push(of.from.parents()[joint], local);
        }
    }

    /// The clearance of the feet: the lowest one as far above its height at rest as the source's, times the scale.
    fn clearance(&self, of: &Retarget) -> Clearance {
        let above = |side: &super::Side, model: &Model, only: &dyn Fn(u32) -> bool| {
            let joints = side.contacts.iter().filter(|(joint, _)| only(*joint));
            joints.map(|(joint, standing)| model.place(*joint).y - standing).fold(f64::MAX, f64::min)
        };
        let all = |_| true;
        let (wanted, is) = (above(&of.source, &self.source, &all), above(&of.target, &self.target, &all));
        let ankles = ["left foot", "right foot"].map(|name| of.source.human.joint(name));
        let ankle = above(&of.source, &self.source, &|joint| ankles.contains(&Some(joint)));
        let ankle = if ankle == f64::MAX { wanted } else { ankle };
        let wanted = wanted * of.scale;
        Clearance { raised: wanted - is, least: wanted.min(0.0) - is, ankle: ankle / of.source.leg.max(1e-6) }
    }

    fn follow(&mut self, of: &Retarget) {
        self.target.rotations.clear();
        self.target.matrices.clear();
        for (joint, rest) in of.to.rest().iter().enumerate() {
            let parent = of.to.parents()[joint];
            let base = parent.map_or(DQuat::IDENTITY, |p| self.target.rotations[p as usize]);
            let mut local = *rest;
            let mut turn = unit(rest.rotation.as_dquat());
            if let (Some(s), Some(d)) = (of.map.source(joint as u32), of.follow[joint]) {
                turn = unit(base.conjugate() * of.yaw * self.source.rotations[s as usize] * d);
            }
            let mut at = rest.translation.as_dvec3();
            if of.moves(joint as u32)
                && let Some(s) = of.map.source(joint as u32)
            {
                let mut place = of.place(joint as u32, self.source.place(s));
                if Some(joint as u32) == of.hips {
                    place.y += self.raised;
                }
                let above = parent.map_or(DAffine3::IDENTITY, |p| self.target.matrices[p as usize]);
                let inside = above.inverse().transform_point3(place);
                if inside.is_finite() {
                    at = inside;
                }
            }
            // Places of the joints below are those of the numbers that the clip will hold.
            local.translation = at.as_vec3();
            self.locals[joint] = (at, turn);
            let own = DAffine3::from_scale_rotation_translation(local.scale.as_dvec3(), turn, at);
            let (matrix, rotation) = match parent {
                Some(p) => (self.target.matrices[p as usize] * own, unit(base * turn)),
                None => (own, turn),
            };
            self.target.matrices.push(matrix);
            self.target.rotations.push(rotation);
        }
    }
}
