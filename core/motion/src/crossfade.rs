//! Two clips at two times, blended, to model space, in one go.

use crate::local_to_model::{Matrices, Two};
use crate::sample::SampleTracks;
use crate::simd::{Level, dispatch};
use crate::{Clip, LocalToModel, Pose, Sample, Skeleton, Time};
use glam::Affine3A;

/// What `Sample` twice, `Blend` and `LocalToModel` do (to the rounding of f32), at about two thirds of the time: the
/// blended pose is never written down. Made to be run over many characters with the same scratch poses.
pub struct Crossfade<'a> {
    pub skeleton: &'a Skeleton,
    /// What joints do that a clip does not animate; as many joints as the skeleton.
    pub rest: &'a Pose,
    pub from: &'a Clip,
    pub from_time: Time,
    pub to: &'a Clip,
    pub to_time: Time,
    /// 0..=1: 0 is `from` alone, 1 is `to` alone, exactly.
    pub weight: f32,
    /// Overwritten. Two poses of as many joints as the skeleton.
    pub scratch: &'a mut [Pose; 2],
    /// One a joint.
    pub model_from_joint: &'a mut [Affine3A],
}

impl Crossfade<'_> {
    pub fn check(&self) -> Result<(), String> {
        let joints = self.skeleton.len();
        let counts = [
            ("rest", self.rest.len()),
            ("from", self.from.joint_count()),
            ("to", self.to.joint_count()),
            ("scratch[0]", self.scratch[0].len()),
            ("scratch[1]", self.scratch[1].len()),
            ("model_from_joint", self.model_from_joint.len()),
        ];
        if let Some((field, count)) = counts.iter().find(|(_, count)| *count != joints) {
            return Err(format!("`Crossfade.{field}` is for {count} joints, the skeleton has {joints}"));
        }
        if !(0.0..=1.0).contains(&self.weight) {
            return Err(format!("`Crossfade.weight` is {}, must be 0..=1", self.weight));
        }
        Ok(())
    }

    /// Allocates nothing, but each clip's tracks at its very first sampling.
    pub fn run(&mut self) {
        self.run_on(Level::best());
    }

    /// The same bits at any level; for tests and benchmarks.
    pub fn run_on(&mut self, level: Level) {
        if self.weight == 0.0 || self.weight == 1.0 {
            let (clip, time) =
                if self.weight == 0.0 { (self.from, self.from_time) } else { (self.to, self.to_time) };
            let pose = &mut self.scratch[0];
            pose.copy_from(self.rest);
            Sample { clip, time, pose }.run_on(level);
            LocalToModel { skeleton: self.skeleton, pose, model_from_joint: self.model_from_joint }
                .run_on(level);
            return;
        }
        let unit_scale =
            self.rest.unit_scale() && self.from.tracks().unit_scale && self.to.tracks().unit_scale;
        let plays = [(self.from, self.from_time), (self.to, self.to_time)];
        for ((clip, time), pose) in plays.into_iter().zip(self.scratch.iter_mut()) {
            let tracks = clip.tracks();
            pose.copy_channels(self.rest, tracks.covers.map(|covered| !covered));
            dispatch(level, SampleTracks { tracks, curves: clip.curves(), time, blocks: pose.blocks_mut() });
        }
        let [a, b] = &*self.scratch;
        let locals = Two { a: a.blocks(), b: b.blocks(), weight: self.weight, unit_scale };
        dispatch(level, Matrices { parents: self.skeleton.parents(), locals, out: self.model_from_joint });
    }
}
