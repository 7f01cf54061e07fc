//! Blending two poses.
//!
//! Translations and scales: lerp. Rotations: shortest-arc nlerp, `normalize(a + (±b − a) w)`. A blend has no authored
//! speed that slerp would keep: the weight is eased anyway, both go along the same arc and agree at 0, ½ and 1. Seen as
//! a shift of the weight, nlerp differs from slerp by at most 0.01° for rotations 20° apart, 0.9° at 90°, 8° at 180°,
//! and costs a third.

use crate::{LANES, Pose, PoseBlock};

/// `out = from` at weight 0, `to` at weight 1 (exactly), joint by joint. All poses have equally many joints.
pub struct Blend<'a> {
    pub from: &'a Pose,
    pub to: &'a Pose,
    /// 0..=1.
    pub weight: f32,
    /// Multiplies the weight, one a joint, 0..=1; `None` = 1.
    pub mask: Option<&'a [f32]>,
    pub out: &'a mut Pose,
}

impl Blend<'_> {
    pub fn check(&self) -> Result<(), String> {
        check("Blend", self.from.len(), self.to.len(), self.weight, self.mask)
    }

    pub fn run(&mut self) {
        self.out.copy_from(self.from);
        BlendOnto { pose: self.out, to: self.to, weight: self.weight, mask: self.mask }.run();
    }
}

/// In place: `pose` goes towards `to` by the weight.
pub struct BlendOnto<'a> {
    pub pose: &'a mut Pose,
    pub to: &'a Pose,
    /// 0..=1.
    pub weight: f32,
    /// Multiplies the weight, one a joint, 0..=1; `None` = 1.
    pub mask: Option<&'a [f32]>,
}

impl BlendOnto<'_> {
    pub fn check(&self) -> Result<(), String> {
        check("BlendOnto", self.pose.len(), self.to.len(), self.weight, self.mask)
    }

    pub fn run(&mut self) {
        for (i, (a, b)) in self.pose.blocks_mut().iter_mut().zip(self.to.blocks()).enumerate() {
            let mut weights = [self.weight; LANES];
            if let Some(mask) = self.mask {
                let mask = &mask[(i * LANES).min(mask.len())..];
                for (lane, weight) in weights.iter_mut().enumerate() {
                    *weight *= mask.get(lane).copied().unwrap_or(0.0);
                }
            }
            blend_block(a, b, &weights);
        }
    }
}

fn check(job: &str, from: usize, to: usize, weight: f32, mask: Option<&[f32]>) -> Result<(), String> {
    if from != to {
        return Err(format!("`{job}`: poses of {from} and {to} joints, must be equally many"));
    }
    if !(0.0..=1.0).contains(&weight) {
        return Err(format!("`{job}.weight` is {weight}, must be 0..=1"));
    }
    if let Some(mask) = mask {
        if mask.len() != from {
            return Err(format!("`{job}.mask` has {} weights, the poses have {from} joints", mask.len()));
        }
        if let Some(joint) = mask.iter().position(|w| !(0.0..=1.0).contains(w)) {
            return Err(format!("`{job}.mask[{joint}]` is {}, must be 0..=1", mask[joint]));
        }
    }
    Ok(())
}

fn blend_block(a: &mut PoseBlock, b: &PoseBlock, weights: &[f32; LANES]) {
    for lane in 0..LANES {
        let w = weights[lane];
        if w == 0.0 {
            continue;
        }
        let mix = |x: f32, y: f32| if w == 1.0 { y } else { x + (y - x) * w };
        for c in 0..3 {
            a.translation[c].0[lane] = mix(a.translation[c].0[lane], b.translation[c].0[lane]);
            a.scale[c].0[lane] = mix(a.scale[c].0[lane], b.scale[c].0[lane]);
        }
        let p = [0, 1, 2, 3].map(|c| a.rotation[c].0[lane]);
        let q = [0, 1, 2, 3].map(|c| b.rotation[c].0[lane]);
        let dot = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3];
        let r = if w == 1.0 {
            q
        } else {
            let sign = if dot < 0.0 { -1.0 } else { 1.0 };
            let r = [0, 1, 2, 3].map(|c| p[c] + (sign * q[c] - p[c]) * w);
            let k = 1.0 / (r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3]).sqrt();
            r.map(|c| c * k)
        };
        for c in 0..4 {
            a.rotation[c].0[lane] = r[c];
        }
    }
}
