//! Weighted blend of any number of poses over a base, independent of their order.
//!
//! `out = (max(0, 1 − W) base + Σ wᵢ poseᵢ) / max(1, W)` joint by joint, with W = Σ wᵢ: if the weights sum to less than 1, the
//! base gets the rest; if to more, they are normalized (ozz-animation's `BlendingJob`, whose threshold is 1 here). Rotations are
//! blended from the base to the mean of the poses as in [`crate::Blend`]. A sum does not depend on the order of its terms except
//! for rounding. Quaternions are summed in the hemisphere of the base's (q and −q are one rotation), which does not depend on the
//! order either; ozz takes the first pose's.

use crate::pose::blend::{CorrectedNlerp, Mix, dot};
use crate::pose::{Pose, PoseBlock};
use crate::simd::lane::{LANES, Lane};
use crate::simd::{F8, Kernel, Level, dispatch, load4};

/// Accumulates a weighted sum of poses; its memory is reused by the next one.
#[derive(Clone, Debug, Default)]
pub struct WeightedBlend {
    sums: Vec<(PoseBlock, Lane)>,
}

const EMPTY_SUM: (PoseBlock, Lane) = (
    PoseBlock {
        translation: [Lane::splat(0.0); 3],
        rotation: [Lane::splat(0.0); 4],
        scale: [Lane::splat(0.0); 3],
    },
    Lane::splat(0.0),
);

impl WeightedBlend {
    /// Begins a sum over a base of this many joints.
    pub fn start(&mut self, joints: usize) {
        self.sums.clear();
        self.sums.resize(joints.div_ceil(LANES), EMPTY_SUM);
    }

    /// Adds a pose. `base` must be the same for all poses of a sum; `weight` ≥ 0 is multiplied by the mask's weight of each joint
    /// (`None` = 1).
    pub fn add(&mut self, base: &Pose, pose: &Pose, weight: f32, mask: Option<&[f32]>) {
        let (base, pose) = (base.blocks(), pose.blocks());
        dispatch(Level::best(), AddPose { sums: &mut self.sums, base, pose, weight, mask });
    }

    /// Blends the sum over the base.
    pub fn finish(&self, base: &mut Pose) {
        dispatch(Level::best(), BlendSum { sums: &self.sums, base: base.blocks_mut() });
    }
}

struct AddPose<'a> {
    sums: &'a mut [(PoseBlock, Lane)],
    base: &'a [PoseBlock],
    pose: &'a [PoseBlock],
    weight: f32,
    mask: Option<&'a [f32]>,
}

impl Kernel for AddPose<'_> {
    #[inline(always)]
    fn run<F: F8>(self) {
        for (i, ((sum, total), (base, pose))) in
            self.sums.iter_mut().zip(self.base.iter().zip(self.pose)).enumerate()
        {
            let mut weights = Lane::splat(self.weight);
            if let Some(mask) = self.mask {
                let mask = mask.get(i * LANES..).unwrap_or_default();
                for (lane, weight) in weights.0.iter_mut().enumerate() {
                    *weight *= mask.get(lane).copied().unwrap_or(0.0);
                }
            }
            let w = F::load(&weights);
            let plus = |sum: &mut Lane, value: F| F::load(sum).add(value.mul(w)).store(sum);
            for n in 0..3 {
                plus(&mut sum.translation[n], F::load(&pose.translation[n]));
                plus(&mut sum.scale[n], F::load(&pose.scale[n]));
            }
            let q: [F; 4] = load4(&pose.rotation);
            let sign_of_dot = dot(load4(&base.rotation), q);
            for (sum, q) in sum.rotation.iter_mut().zip(q) {
                plus(sum, q.flip_sign_by(sign_of_dot));
            }
            F::load(total).add(w).store(total);
        }
    }
}

struct BlendSum<'a> {
    sums: &'a [(PoseBlock, Lane)],
    base: &'a mut [PoseBlock],
}

impl Kernel for BlendSum<'_> {
    #[inline(always)]
    fn run<F: F8>(self) {
        let (zero, one) = (F::splat(0.0), F::splat(1.0));
        for ((sum, total), base) in self.sums.iter().zip(self.base) {
            let total = F::load(total);
            let base_weight = F::select(total.less(one), one.sub(total), zero);
            let k = one.div(F::select(total.less(one), one, total));
            let untouched = total.equals(zero);
            let mixed = |base: &Lane, sum: &Lane| F::load(base).mul(base_weight).add(F::load(sum)).mul(k);
            for n in 0..3 {
                let t = mixed(&base.translation[n], &sum.translation[n]);
                F::select(untouched, F::load(&base.translation[n]), t).store(&mut base.translation[n]);
                let s = mixed(&base.scale[n], &sum.scale[n]);
                F::select(untouched, F::load(&base.scale[n]), s).store(&mut base.scale[n]);
            }
            let base_rotation: [F; 4] = load4(&base.rotation);
            let q: [F; 4] = load4(&sum.rotation);
            let square = dot(q, q);
            // All quaternions are in the hemisphere of the base, so that a sum near zero is only rounding.
            let usable = F::splat(1e-12).less(square);
            let length = one.div(square.sqrt());
            let mut mean = base_rotation;
            for n in 0..4 {
                mean[n] = F::select(usable, q[n].mul(length), base_rotation[n]);
            }
            // The mean is mixed in like one pose of the total weight, so that equal layers give the same as one layer of their sum.
            let interpolated =
                CorrectedNlerp::mix(base_rotation, mean, F::select(total.less(one), total, one));
            let length = one.div(dot(interpolated, interpolated).sqrt());
            for n in 0..4 {
                let turned = F::select(total.less(one), interpolated[n].mul(length), mean[n]);
                F::select(untouched, base_rotation[n], turned).store(&mut base.rotation[n]);
            }
        }
    }
}
