//! Crossfade: samples two clips, blends them and converts to model space in one job.

use crate::clip::Clip;
use crate::clip::sample::{Sample, sample};
use crate::input_error::InputError;
use crate::pose::Pose;
use crate::pose::local_to_model::{BlendedPoses, ComputeMatrices, LocalToModel};
use crate::simd::{F8, Kernel, Level, dispatch};
use crate::skeleton::Skeleton;
use crate::time::Time;
use glam::Affine3A;

/// Crossfade of two clips: the result of two `Sample`, a `Blend` and `LocalToModel` (to the rounding of f32), without storing the
/// blended pose. The same scratch poses can serve many characters.
pub struct Crossfade<'a> {
    /// Skeleton of both clips.
    pub skeleton: &'a Skeleton,
    /// Input: transforms of joints that a clip does not animate; as many joints as the skeleton.
    pub rest: &'a Pose,
    /// Clip at weight 0.
    pub from: &'a Clip,
    /// Clip time of `from`.
    pub from_time: Time,
    /// Clip at weight 1.
    pub to: &'a Clip,
    /// Clip time of `to`.
    pub to_time: Time,
    /// Blend weight, 0..=1: 0 is `from` alone, 1 is `to` alone, exactly.
    pub weight: f32,
    /// Scratch, overwritten: two poses of as many joints as the skeleton.
    pub scratch: &'a mut [Pose; 2],
    /// Output: one per joint.
    pub model_from_joint: &'a mut [Affine3A],
}

impl Crossfade<'_> {
    /// Names the first field that does not fit.
    pub fn check(&self) -> Result<(), InputError> {
        let joints = self.skeleton.len();
        InputError::check_lengths(&[
            ("Crossfade.rest", self.rest.len(), joints),
            ("Crossfade.from", self.from.joint_count(), joints),
            ("Crossfade.to", self.to.joint_count(), joints),
            ("Crossfade.scratch[0]", self.scratch[0].len(), joints),
            ("Crossfade.scratch[1]", self.scratch[1].len(), joints),
            ("Crossfade.model_from_joint", self.model_from_joint.len(), joints),
        ])?;
        InputError::check_value((0.0..=1.0).contains(&self.weight), "Crossfade.weight", self.weight, "0..=1")
    }

    /// Runs the crossfade. Allocates nothing except each clip's tracks, when it is first sampled.
    pub fn run(&mut self) {
        self.run_on(Level::best());
    }

    /// Runs at a SIMD level, for tests and benchmarks; the bits are the same at any.
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
        let (from, to) = (self.from.tracks(), self.to.tracks());
        let unit_scale = from.unit_scale
            && to.unit_scale
            && (from.covers[2] && to.covers[2] || self.rest.has_unit_scale());
        let covers = [from.covers, to.covers];
        for (pose, covers) in self.scratch.iter_mut().zip(covers) {
            pose.copy_channels(self.rest, covers.map(|covered| !covered));
        }
        dispatch(level, CrossfadeKernel { job: self, unit_scale });
    }
}

struct CrossfadeKernel<'a, 'b> {
    job: &'b mut Crossfade<'a>,
    unit_scale: bool,
}

impl Kernel for CrossfadeKernel<'_, '_> {
    #[inline(always)]
    fn run<F: F8>(self) {
        let CrossfadeKernel { job, unit_scale } = self;
        let [a, b] = &mut *job.scratch;
        for (clip, time, pose) in [(job.from, job.from_time, &mut *a), (job.to, job.to_time, &mut *b)] {
            let tracks = clip.tracks();
            let constants = if unit_scale { tracks.constants_without_scales() } else { &tracks.constants };
            sample::<F>(tracks, constants, clip.stored_curves(), time, pose.blocks_mut());
        }
        let locals = BlendedPoses { a: a.blocks(), b: b.blocks(), weight: job.weight, unit_scale };
        let by_depth = job.skeleton.by_depth();
        ComputeMatrices { by_depth, locals, out: &mut *job.model_from_joint }.compute::<F>();
    }
}
