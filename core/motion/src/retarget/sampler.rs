//! Samples motion that no single curve describes, as densely as the tolerance requires.

use super::Retarget;
use super::frame::RetargetBuffers;
use super::keys::MAX_SAMPLED_KEYS;
use crate::clip::Clip;
use crate::math::rotation::normalize_or_identity;
use crate::time::Time;
use glam::{DQuat, DVec3};
use std::collections::BTreeSet;

/// Samples both skeletons at one time after the other.
pub(super) struct Sampler<'a> {
    pub retarget: &'a Retarget<'a>,
    pub clip: &'a Clip,
    /// Target joints whose rotations (`rotating`) or positions (`translating`) are sampled.
    pub rotating: &'a [u32],
    pub translating: &'a [u32],
    pub frame: RetargetBuffers,
    pub raised: Option<(f64, f64)>,
    pub keys: Vec<SampledKey>,
}

impl Sampler<'_> {
    /// Samples at `times` and between them. Returns false if the limit of keys was reached before the tolerance.
    pub(super) fn run(&mut self, times: BTreeSet<Time>) -> bool {
        let max_keys = MAX_SAMPLED_KEYS / (self.rotating.len() + self.translating.len()).max(1);
        let mut enough = true;
        for time in times {
            let next = self.sample(time);
            if let Some(before) = self.keys.last().cloned() {
                enough &= self.refine(&before, &next, 0, max_keys);
            }
            self.keys.push(next);
        }
        if self.keys.is_empty() {
            let key = self.sample(Time::ZERO);
            self.keys.push(key);
        }
        enough
    }

    fn sample(&mut self, time: Time) -> SampledKey {
        self.frame.pose_at(self.retarget, self.clip, time);
        let raised = self.frame.raised;
        let (low, high) = self.raised.unwrap_or((raised, raised));
        self.raised = Some((low.min(raised), high.max(raised)));
        SampledKey {
            time,
            rotations: self.rotating.iter().map(|j| self.frame.locals[*j as usize].1).collect(),
            positions: self.translating.iter().map(|j| self.frame.locals[*j as usize].0).collect(),
        }
    }

    /// Adds keys between two until the middle of each pair is within the tolerance.
    fn refine(&mut self, from: &SampledKey, to: &SampledKey, depth: usize, max_keys: usize) -> bool {
        /// Largest number of bisections: down to 1/64 of the span between two keys of the source.
        const MAX_DEPTH: usize = 6;
        let span = to.time - from.time;
        if depth == MAX_DEPTH || span.0 < 2 {
            return true;
        }
        let middle = self.sample(Time(from.time.0 + span.0 / 2));
        let (retarget, allowed) = (self.retarget, self.retarget.options.tolerance_rad);
        let deviation = |(a, (m, b)): (&DQuat, (&DQuat, &DQuat))| {
            let half = normalize_or_identity(*a + if a.dot(*b) < 0.0 { -*b } else { *b });
            2.0 * (half - *m).length().min((half + *m).length())
        };
        let rotation_error = from
            .rotations
            .iter()
            .zip(middle.rotations.iter().zip(&to.rotations))
            .map(deviation)
            .fold(0.0, f64::max);
        // Differences are in metres of the model, whatever unit the parents are in.
        let size = |joint: &u32| {
            retarget.to.parents()[*joint as usize].map_or(1.0, |p| retarget.target.rest.scales[p as usize])
        };
        let position_error =
            from.positions.iter().zip(middle.positions.iter().zip(&to.positions)).zip(self.translating);
        let deviation = |((a, (m, b)), joint): ((&DVec3, (&DVec3, &DVec3)), &u32)| {
            ((*a + *b) / 2.0 - *m).length() * size(joint)
        };
        let position_error = position_error.map(deviation).fold(0.0, f64::max);
        if rotation_error <= allowed && position_error <= 0.1 * allowed * retarget.target.leg.max(0.01) {
            return true;
        }
        if self.keys.len() >= max_keys {
            return false;
        }
        let first = self.refine(from, &middle, depth + 1, max_keys);
        self.keys.push(middle.clone());
        first & self.refine(&middle, to, depth + 1, max_keys)
    }
}

/// Sampled rotations and positions of the target's joints at one time.
#[derive(Clone)]
pub(super) struct SampledKey {
    pub time: Time,
    pub rotations: Vec<DQuat>,
    pub positions: Vec<DVec3>,
}
