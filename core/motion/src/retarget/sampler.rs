//! Samples motion that no single curve describes, as densely as the tolerance requires.

use super::Retarget;
use super::frame::RetargetBuffers;
use super::keys::MOST_KEYS;
use crate::clip::Clip;
use crate::math::rotation::unit;
use crate::time::Time;
use glam::{DQuat, DVec3};
use std::collections::BTreeSet;

/// Samples both skeletons at one time after the other.
pub(super) struct Sampler<'a> {
    pub of: &'a Retarget<'a>,
    pub clip: &'a Clip,
    /// Target joints whose rotation, and whose position (`translating`), is sampled.
    pub rotating: &'a [u32],
    pub translating: &'a [u32],
    pub frame: RetargetBuffers,
    pub raised: Option<(f64, f64)>,
    pub keys: Vec<Key>,
}

impl Sampler<'_> {
    /// Samples at `times` and between them. Returns false if the limit of keys was reached before the tolerance.
    pub fn run(&mut self, times: BTreeSet<Time>) -> bool {
        let most = MOST_KEYS / (self.rotating.len() + self.translating.len()).max(1);
        let mut enough = true;
        for time in times {
            let next = self.sample(time);
            if let Some(before) = self.keys.last().cloned() {
                enough &= self.refine(&before, &next, 0, most);
            }
            self.keys.push(next);
        }
        if self.keys.is_empty() {
            let key = self.sample(Time::ZERO);
            self.keys.push(key);
        }
        enough
    }

    fn sample(&mut self, time: Time) -> Key {
        self.frame.at(self.of, self.clip, time);
        let raised = self.frame.raised;
        let (low, high) = self.raised.unwrap_or((raised, raised));
        self.raised = Some((low.min(raised), high.max(raised)));
        Key {
            time,
            turns: self.rotating.iter().map(|j| self.frame.locals[*j as usize].1).collect(),
            places: self.translating.iter().map(|j| self.frame.locals[*j as usize].0).collect(),
        }
    }

    /// Adds keys between two until the middle of each pair is within the tolerance.
    fn refine(&mut self, from: &Key, to: &Key, depth: usize, most: usize) -> bool {
        /// Most bisections: down to 1/64 of the span between two keys of the source.
        const DEEPEST: usize = 6;
        let span = to.time - from.time;
        if depth == DEEPEST || span.0 < 2 {
            return true;
        }
        let middle = self.sample(Time(from.time.0 + span.0 / 2));
        let (of, allowed) = (self.of, self.of.options.tolerance_rad);
        let off = |(a, (m, b)): (&DQuat, (&DQuat, &DQuat))| {
            let half = unit(*a + if a.dot(*b) < 0.0 { -*b } else { *b });
            2.0 * (half - *m).length().min((half + *m).length())
        };
        let turned = from.turns.iter().zip(middle.turns.iter().zip(&to.turns)).map(off).fold(0.0, f64::max);
        // Differences are in metres of the model, whatever unit the parents are in.
        let size =
            |joint: &u32| of.to.parents()[*joint as usize].map_or(1.0, |p| of.target.rest.scales[p as usize]);
        let gone = from.places.iter().zip(middle.places.iter().zip(&to.places)).zip(self.translating);
        let off = |((a, (m, b)), joint): ((&DVec3, (&DVec3, &DVec3)), &u32)| {
            ((*a + *b) / 2.0 - *m).length() * size(joint)
        };
        let gone = gone.map(off).fold(0.0, f64::max);
        if turned <= allowed && gone <= 0.1 * allowed * of.target.leg.max(0.01) {
            return true;
        }
        if self.keys.len() >= most {
            return false;
        }
        let first = self.refine(from, &middle, depth + 1, most);
        self.keys.push(middle.clone());
        first & self.refine(&middle, to, depth + 1, most)
    }
}

/// Both skeletons at a time, as far as sampled curves need it.
#[derive(Clone)]
pub(super) struct Key {
    pub time: Time,
    pub turns: Vec<DQuat>,
    pub places: Vec<DVec3>,
}
