//! Weights of blend shapes over a clip.

use crate::curve::Span;
use crate::file::File;
use crate::morphs;
use crate::refine::Quantity;
use crate::sampled;
use choreo_importer_kit::Result;
use choreo_motion::Time;
use ufbx::{Anim, AnimCurve, BlendChannel};

pub(crate) const WEIGHT_PROPERTY: &str = "DeformPercent";

/// A channel's weight (1 for 100 percent), linear between keys.
pub(crate) struct WeightTrack(Vec<(Time, f64)>);

impl WeightTrack {
    pub(crate) fn still(channel: &BlendChannel) -> WeightTrack {
        WeightTrack(vec![(Time::ZERO, channel.weight)])
    }

    /// `repeats`: a curve of the channel repeats or continues beyond its keys.
    pub(crate) fn new(
        file: &File<'_>,
        anim: &Anim,
        channel: &BlendChannel,
        (curves, repeats): (&[&AnimCurve], bool),
        span: Span,
        place: &dyn Fn() -> String,
    ) -> Result<WeightTrack> {
        let times = match repeats {
            true => sampled::even_times(file, span, place)?,
            false => sampled::sample_times(file, curves.iter().copied(), span, place)?,
        };
        let begin = span.begin.as_secs();
        let evaluate = |time: Time, out: &mut Vec<f64>| {
            out.push(channel.evaluate_blend_weight(anim, begin + time.as_secs()));
        };
        let rows = sampled::sample_rows(file, &[Quantity::Weight], times, evaluate, place)?;
        let keys = rows.times.into_iter().zip(rows.values).collect();
        Ok(WeightTrack(add_bends(channel, keys)))
    }

    pub(crate) fn times(&self) -> impl Iterator<Item = Time> {
        self.0.iter().map(|k| k.0)
    }

    pub(crate) fn at(&self, time: Time) -> f64 {
        let next = self.0.partition_point(|k| k.0 <= time);
        match (next.checked_sub(1).map(|i| self.0[i]), self.0.get(next)) {
            (Some((from, a)), Some((to, b))) => {
                a + (b - a) * ((time.0 - from.0) as f64 / (to.0 - from.0) as f64)
            }
            (Some((_, only)), None) | (None, Some(&(_, only))) => only,
            (None, None) => 0.0,
        }
    }
}

/// Adds keys where the weights of the channel's shapes bend.
fn add_bends(channel: &BlendChannel, track: Vec<(Time, f64)>) -> Vec<(Time, f64)> {
    let bends = morphs::bend_weights(channel);
    let mut keys: Vec<(Time, f64)> = Vec::with_capacity(track.len());
    for pair in track.windows(2) {
        let ((from, a), (to, b)) = (pair[0], pair[1]);
        keys.push(pair[0]);
        let mut crossed: Vec<(Time, f64)> = bends
            .iter()
            .filter(|bend| (a < **bend && **bend < b) || (b < **bend && **bend < a))
            .map(|bend| {
                let ticks = (to.0 - from.0) as f64 * ((bend - a) / (b - a));
                (Time(from.0 + ticks.round() as i64), *bend)
            })
            .filter(|(time, _)| from < *time && *time < to)
            .collect();
        crossed.sort_by_key(|k| k.0);
        crossed.dedup_by_key(|k| k.0);
        keys.extend(crossed);
    }
    keys.extend(track.last());
    keys
}
