//! Baking: resamples a clip at an even rate. Clips with separate key times per joint become faster; the error is measured.

use crate::clip::sample::Sample;
use crate::clip::{Clip, Curve, Interpolation, Path};
use crate::pose::Pose;
use crate::time::{FrameRate, Time};
use std::sync::Arc;

/// Largest deviation of a baked clip from its source, measured at every source key and halfway between baked keys.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BakeDeviation {
    /// Largest distance of a joint in its parent's space, metres.
    pub translation_m: f64,
    /// Largest angle of a joint in its parent's space, radians.
    pub rotation_rad: f64,
    /// Largest difference of a scale component.
    pub scale: f64,
}

/// Error of baking: the clip would become too large.
#[derive(Clone, Debug, PartialEq)]
pub struct BakeError {
    /// Name of the clip.
    pub clip: String,
    /// Requested keys per second.
    pub fps: f64,
    /// Number of values that the clip would have.
    pub floats: u128,
}

crate::error_texts! { BakeError:
    Self { clip, fps, floats } => "baking the clip \"{clip}\" at {fps} frames/s makes {floats} numbers, at most {MAX_BAKED_FLOATS} are allowed; choose a lower rate";
}

/// Largest number of values of a baked clip: 256 MiB.
pub(crate) const MAX_BAKED_FLOATS: u128 = 1 << 26;

impl Clip {
    /// The clip with its LINEAR and CUBICSPLINE transform curves resampled to LINEAR keys at `rate`, the last key at the clip's
    /// end. STEP curves and morph weights stay as authored.
    pub fn baked(&self, rate: FrameRate) -> Result<(Clip, BakeDeviation), BakeError> {
        let bakes = |curve: &Curve| {
            !matches!(curve.path, Path::Weights(_))
                && curve.interpolation != Interpolation::Step
                && curve.times.len() > 1
        };
        let frames = rate.frames_in(self.duration);
        let width: usize = self.curves().iter().filter(|c| bakes(c)).map(|c| c.path.width()).sum();
        let floats = (frames as u128 + 1) * width as u128;
        if floats > MAX_BAKED_FLOATS {
            return Err(BakeError { clip: self.name.clone(), fps: rate.as_fps(), floats });
        }
        let starts = (0..frames).map(|frame| rate.time_of(frame)).filter(|time| *time < self.duration);
        let times: Arc<[Time]> = starts.chain([self.duration]).collect();
        let mut values: Vec<Vec<f32>> = self.curves().iter().map(|_| Vec::new()).collect();
        let mut pose = Pose::identity(self.joint_count());
        for &time in times.iter().filter(|_| width > 0) {
            Sample { clip: self, time, pose: &mut pose }.run();
            for (curve, values) in self.curves().iter().zip(&mut values).filter(|(curve, _)| bakes(curve)) {
                let joint = pose.get(curve.joint as usize);
                match curve.path {
                    Path::Rotation => values.extend(joint.rotation.to_array()),
                    Path::Scale => values.extend(joint.scale.to_array()),
                    _ => values.extend(joint.translation.to_array()),
                }
            }
        }
        let curves = self.curves().iter().zip(values).map(|(curve, values)| {
            if !bakes(curve) {
                return curve.clone();
            }
            let interpolation = Interpolation::Linear;
            Curve { interpolation, times: Arc::clone(&times), values: values.into(), ..curve.clone() }
        });
        let baked = self.with_curves(self.joint_count(), curves.collect()).with_properties_of(self);
        let error = self.distance_from(&baked, &times);
        Ok((baked, error))
    }

    fn distance_from(&self, baked: &Clip, times: &[Time]) -> BakeDeviation {
        let middles = times.windows(2).map(|pair| Time(pair[0].0 + (pair[1].0 - pair[0].0) / 2));
        let mut times_to_compare: Vec<Time> =
            self.curves().iter().flat_map(|c| c.times.iter().copied()).chain(middles).collect();
        times_to_compare.sort_unstable();
        times_to_compare.dedup();
        let mut poses = [Pose::identity(self.joint_count()), Pose::identity(self.joint_count())];
        let mut worst = BakeDeviation::default();
        for time in times_to_compare {
            let [a, b] = &mut poses;
            Sample { clip: self, time, pose: a }.run();
            Sample { clip: baked, time, pose: b }.run();
            for (a, b) in a.iter().zip(b.iter()) {
                let moved = (a.translation - b.translation).length();
                worst.translation_m = worst.translation_m.max(f64::from(moved));
                worst.scale = worst.scale.max(f64::from((a.scale - b.scale).abs().max_element()));
                let (p, q) = (a.rotation.as_dquat(), b.rotation.as_dquat());
                let chord = (p - if p.dot(q) < 0.0 { -q } else { q }).length();
                worst.rotation_rad = worst.rotation_rad.max(4.0 * libm::asin((chord / 2.0).min(1.0)));
            }
        }
        worst
    }
}
