//! The clips of a layer that are active at a time, with clip time and weight.

use crate::stage::actor::Actor;
use crate::stage::clips::{Cue, Layer, LayerMode};
use crate::stage::fade::apply_ease;
use crate::stage::fade::elapsed_fraction;
use crate::timeline::clip_time::plays_until;
use choreo_motion::Time;

/// A cue that contributes to an actor's pose at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActiveClip {
    /// Index into `Actor::layers`.
    pub layer: usize,
    /// Index into `Layer::cues`.
    pub cue: usize,
    /// Time in the clip.
    pub clip_time: Time,
    /// Blend weight over the clips before it, above 0, at most 1; the layer's mask is not included.
    pub weight: f32,
    /// Whether its layer is additive or subtractive, so that the clips before it keep their weights.
    pub additive: bool,
}

impl Actor {
    /// The clips that play at a time, in the order in which they are blended: each over those before it, additive ones on top. For layers
    /// of the same rank the weights are those before the layers are averaged.
    pub fn active_clips(&self, time: Time) -> Vec<ActiveClip> {
        let mut active = Vec::new();
        let mut active_cues = Vec::new();
        for (layer, of_layer) in self.layers.iter().enumerate() {
            match layer {
                0 => base_cues(of_layer, time, &mut active_cues),
                _ => upper_cues(of_layer, time, &mut active_cues),
            }
            active.extend(active_cues.iter().map(|v| ActiveClip {
                layer,
                cue: v.cue,
                clip_time: v.clip_time,
                weight: v.weight,
                additive: of_layer.mode != LayerMode::Override,
            }));
        }
        active
    }
}

/// An active cue. Cues are blended in order, each over those before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ActiveCue {
    /// Index into `Layer::cues`.
    pub cue: usize,
    pub clip_time: Time,
    /// 0 < weight ≤ 1.
    pub weight: f32,
}

/// Finds the active cues of a base layer: those that have started, without those that a later cue covers entirely. Before the first cue its
/// first pose is held. After an `end` that no cue follows at once, the pose reached there is held.
pub(crate) fn base_cues(layer: &Layer, time: Time, active_cues: &mut Vec<ActiveCue>) {
    active_cues.clear();
    let cues = &layer.cues;
    let started = cues.partition_point(|cue| cue.start <= time);
    if started == 0 {
        if let Some(first) = cues.first() {
            active_cues.push(ActiveCue {
                cue: 0,
                clip_time: first.clip_time(first.start, false),
                weight: 1.0,
            });
        }
        return;
    }
    for index in (0..started).rev() {
        let cue = &cues[index];
        let weight = if index == 0 { 1.0 } else { fade_in_weight(cue, time) * cue.weight_at(time) };
        if weight > 0.0 {
            let (until, held) = plays_until(layer, index, time);
            active_cues.push(ActiveCue { cue: index, clip_time: cue.clip_time(until, held), weight });
        }
        if weight >= 1.0 {
            break;
        }
    }
    active_cues.reverse();
}

/// Finds the active cues of an upper layer: each is active from its start to its end and fades in and out. A cue without an end, or with
/// one where the next begins, hands over to the next: its share goes down as the next one's goes up, without a dip between.
pub(crate) fn upper_cues(layer: &Layer, time: Time, active_cues: &mut Vec<ActiveCue>) {
    active_cues.clear();
    let cues = &layer.cues;
    let started = cues.partition_point(|cue| cue.start <= time);
    for (index, cue) in cues[..started].iter().enumerate() {
        let mut weight = fade_in_weight(cue, time) * cue.weight_at(time);
        let next = cues.get(index + 1).filter(|next| cue.end.is_none_or(|end| end == next.start));
        if let Some(next) = next {
            if next.start <= time {
                let fade = fade_in_weight(next, time);
                let over = fade * next.weight_at(time);
                if fade >= 1.0 || over >= 1.0 {
                    continue;
                }
                // The cue's share under the next one is weight · (1 − over); it must be weight · (1 − fade).
                weight *= (1.0 - fade) / (1.0 - over);
            }
        } else if let Some(end) = cue.end {
            if time >= end {
                continue;
            }
            weight *= apply_ease(cue.ease, elapsed_fraction(end - time, cue.fade_out));
        }
        if weight > 0.0 {
            let clip_time = cue.clip_time(time, false);
            active_cues.push(ActiveCue { cue: index, clip_time, weight });
        }
    }
    let whole = layer.weight_keys.as_ref().and_then(|keys| keys.at(time));
    if let Some(whole) = whole.map(|v| (v[0] as f32).clamp(0.0, 1.0)).filter(|whole| *whole < 1.0) {
        scale_shares(active_cues, whole);
    }
}

/// Multiplies each cue's share of the layer by a factor below 1, and converts the shares back to weights over the cues before.
fn scale_shares(active_cues: &mut Vec<ActiveCue>, by: f32) {
    convert_weights_to_shares(active_cues);
    let mut left = 1.0;
    for active in active_cues.iter_mut().rev() {
        let share = active.weight * by;
        // `left` is at least the sum of the remaining shares, and above zero because `by` is below 1.
        active.weight = share / left;
        left -= share;
    }
    active_cues.retain(|active| active.weight > 0.0);
}

/// Converts weights over the cues before into shares of the layer as a whole: w · Π (1 − w of those after).
pub(crate) fn convert_weights_to_shares(active_cues: &mut [ActiveCue]) {
    let mut left = 1.0;
    for active in active_cues.iter_mut().rev() {
        let weight = active.weight;
        active.weight = weight * left;
        left *= 1.0 - weight;
    }
}

impl Cue {
    /// Weight at a time without fades, 0..=1.
    fn weight_at(&self, time: Time) -> f32 {
        let keyed = self.weight_keys.as_ref().and_then(|keys| keys.at(time));
        keyed.map_or(self.weight, |v| (v[0] as f32).clamp(0.0, 1.0))
    }
}

fn fade_in_weight(cue: &Cue, time: Time) -> f32 {
    if cue.inertialization > Time::ZERO {
        return 1.0;
    }
    apply_ease(cue.ease, elapsed_fraction(time - cue.start, cue.fade_in))
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_motion::Clip;
    use std::sync::Arc;

    fn layer(starts_and_fades: &[(f64, f64)]) -> Layer {
        let clip = Arc::new(Clip::new("clip".into(), 0, vec![]).unwrap());
        let mut layer = Layer::default();
        for (start, fade) in starts_and_fades {
            let (start, fade_in) = (Time::from_secs(*start), Time::from_secs(*fade));
            layer.add(Cue { start, fade_in, ..Cue::new(clip.clone()) });
        }
        layer
    }

    fn active_cue_indices(
        active_cues: impl Fn(&Layer, Time, &mut Vec<ActiveCue>),
        layer: &Layer,
        t: f64,
    ) -> Vec<usize> {
        let mut out = Vec::new();
        active_cues(layer, Time::from_secs(t), &mut out);
        out.iter().map(|v| v.cue).collect()
    }

    #[test]
    fn fully_covered_cues_are_not_active() {
        let layer = layer(&[(0.0, 0.0), (1.0, 0.5), (2.0, 0.0), (3.0, 1.0)]);
        let cases: [(f64, &[usize]); 7] = [
            (-1.0, &[0]),
            (0.5, &[0]),
            (1.25, &[0, 1]),
            (1.5, &[1]),
            (2.0, &[2]),
            (3.5, &[2, 3]),
            (4.0, &[3]),
        ];
        for (t, expected) in cases {
            assert_eq!(active_cue_indices(base_cues, &layer, t), expected, "at {t} s");
        }
        // A cue at weight zero, at the very start of its fade, is not active either.
        assert_eq!(active_cue_indices(base_cues, &layer, 1.0), [0]);
        assert_eq!(active_cue_indices(upper_cues, &layer, -1.0), [0usize; 0]);
        assert_eq!(active_cue_indices(upper_cues, &layer, 3.5), [2, 3]);
        assert_eq!(active_cue_indices(upper_cues, &layer, 4.0), [3]);
    }

    #[test]
    fn layer_weight_scales_the_share_of_each_cue() {
        let mut layer = layer(&[(0.0, 0.0), (1.0, 1.0), (1.5, 1.0)]);
        let active = |layer: &Layer| {
            let mut active_cues = Vec::new();
            upper_cues(layer, Time::from_secs(1.75), &mut active_cues);
            convert_weights_to_shares(&mut active_cues);
            active_cues.iter().map(|v| (v.cue, v.weight)).collect::<Vec<_>>()
        };
        let whole = active(&layer);
        assert_eq!(whole.len(), 3);
        for by in [1.0, 0.999, 0.4, 1e-6] {
            layer.weight_keys = Some(Arc::new(crate::stage::channel::Channel {
                property: crate::stage::channel::Property::Weight,
                interpolation: choreo_motion::Interpolation::Linear,
                times: vec![Time::ZERO],
                values: vec![by],
            }));
            for ((cue, share), (again, scaled)) in whole.iter().zip(active(&layer)) {
                assert!(
                    *cue == again && (f64::from(*share) * by - f64::from(scaled)).abs() < 1e-6 * by + 1e-9
                );
            }
        }
        layer.weight_keys = layer
            .weight_keys
            .map(|keys| Arc::new(crate::stage::channel::Channel { values: vec![0.0], ..(*keys).clone() }));
        assert!(active(&layer).is_empty());
    }
}
