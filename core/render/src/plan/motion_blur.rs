//! Motion blur by accumulation: a frame as the mean, in linear light, of frames at several exact times while the shutter is
//! open (Haeberli and Akeley, "The Accumulation Buffer", SIGGRAPH 1990, §3.2). Effects over the picture come after the mean.
//! And the frames before, where an effect reads them: each at its own time alone, without motion blur.

use crate::plan::build::effects::{exposure_of, history_of};
use crate::{Catalog, Plan, PlanOptions};
use choreo_motion::Time;
use choreo_plugin::{Exposure, Hook};
use choreo_stage::{CameraState, Evaluator, Snapshot, Stage, StageError};
use glam::Vec4;

/// The stage at a time and its plan, with those of all times of the exposure where an effect asks for one.
/// `camera`: in place of the stage's.
pub fn plan_at(
    catalog: &Catalog,
    evaluator: &mut Evaluator,
    time: Time,
    options: &PlanOptions,
    camera: Option<CameraState>,
) -> Result<(Snapshot, Plan), StageError> {
    let stage = evaluator.stage().clone();
    plan_with(catalog, &stage, time, options, |time| {
        let mut snapshot = evaluator.at(time)?;
        snapshot.camera = camera.unwrap_or(snapshot.camera);
        Ok(snapshot)
    })
}

/// As [`plan_at`], of snapshots that the caller makes.
pub fn plan_with<E>(
    catalog: &Catalog,
    stage: &Stage,
    time: Time,
    options: &PlanOptions,
    mut at: impl FnMut(Time) -> Result<Snapshot, E>,
) -> Result<(Snapshot, Plan), E> {
    let snapshot = at(time)?;
    let mut plan = plan_alone(catalog, stage, &snapshot, options, &mut at)?;
    if let Some(exposure) = exposure_of(stage, &snapshot, options.effects) {
        for time in times(stage, time, &exposure) {
            let then = at(time)?;
            let part = plan_alone(catalog, stage, &then, options, &mut at)?;
            plan.exposed.push(Plan { post: Vec::new(), linear: true, over: None, ..part });
        }
    }
    let back = history_of(stage, &snapshot, options.effects, Hook::Picture);
    if back > 0 {
        let alone = |plan: Plan| Plan { post: Vec::new(), linear: true, over: None, ..plan };
        if plan.exposed.is_empty() {
            plan.exposed.push(alone(plan_alone(catalog, stage, &snapshot, options, &mut at)?));
        }
        for frames in 1..=i64::from(back) {
            let then = at(frames_ago(stage, time, frames))?;
            plan.before.push(alone(plan_alone(catalog, stage, &then, options, &mut at)?));
        }
    }
    Ok((snapshot, plan))
}

/// Before the first frame stands the first.
fn frames_ago(stage: &Stage, time: Time, frames: i64) -> Time {
    (time - stage.settings.fps.time_of(frames)).max(Time(0).min(time))
}

/// The plan of one snapshot, without those of other times that effects ask for: with the stage a frame before it, two frames
/// before it and so on, as many as the lines of effects look back.
pub fn plan_alone<E>(
    catalog: &Catalog,
    stage: &Stage,
    snapshot: &Snapshot,
    options: &PlanOptions,
    at: impl FnMut(Time) -> Result<Snapshot, E>,
) -> Result<Plan, E> {
    let back = i64::from(history_of(stage, snapshot, options.effects, Hook::Overlay));
    let earlier = (1..=back).map(|frames| frames_ago(stage, snapshot.time, frames));
    let before = earlier.map(at).collect::<Result<Vec<Snapshot>, E>>()?;
    Ok(Plan::new(catalog, stage, snapshot, &PlanOptions { before: &before, ..options.clone() }))
}

/// Evenly over the time that the shutter is open, each in the middle of its part, and never beyond a cut: a shot does not
/// shine into its neighbour.
pub fn times(stage: &Stage, time: Time, exposure: &Exposure) -> Vec<Time> {
    let fps = stage.settings.fps;
    let frame = f64::from(fps.den) / f64::from(fps.num.max(1));
    let samples = exposure.samples.max(1);
    let cuts = || stage.cuts.iter().map(|cut| cut.at);
    let first = cuts().filter(|at| *at <= time).max().unwrap_or(Time(i64::MIN));
    let last = cuts().filter(|at| *at > time).min().map_or(Time::MAX, |next| next - Time(1));
    let at = |i: u32| {
        let share = (f64::from(i) + 0.5) / f64::from(samples) - exposure.before;
        (time + Time::from_secs(share * exposure.open * frame)).clamp(first, last)
    };
    (0..samples).map(at).collect()
}

/// The sum of pictures, linear RGBA; each adds its share.
#[derive(Debug)]
pub struct Accumulated {
    pixels: Vec<Vec4>,
    count: u32,
}

impl Accumulated {
    pub fn new(pixels: usize) -> Accumulated {
        Accumulated { pixels: vec![Vec4::ZERO; pixels], count: 0 }
    }

    pub fn add(&mut self, picture: impl Iterator<Item = Vec4>) {
        self.pixels.iter_mut().zip(picture).for_each(|(sum, pixel)| *sum += pixel);
        self.count += 1;
    }

    pub fn mean(self) -> Vec<Vec4> {
        let share = 1.0 / self.count.max(1) as f32;
        self.pixels.into_iter().map(|sum| sum * share).collect()
    }
}

/// A 16-bit float (IEEE 754 binary16), exactly.
pub fn half(bits: u16) -> f32 {
    let (sign, exponent, fraction) = (u32::from(bits >> 15) << 31, (bits >> 10) & 31, u32::from(bits & 1023));
    match exponent {
        // Subnormal: fraction · 2⁻²⁴, exact in f32.
        0 => f32::from_bits(sign | (fraction as f32 * (1.0 / 16_777_216.0)).to_bits()),
        31 => f32::from_bits(sign | 0x7f80_0000 | fraction << 13),
        _ => f32::from_bits(sign | (u32::from(exponent) + 112) << 23 | fraction << 13),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_stage::Cut;

    #[test]
    fn times_are_even_and_stay_in_the_shot() {
        let mut stage = Stage::default();
        let exposure = Exposure { samples: 4, open: 0.5, before: 0.5 };
        let frame = Time::TICKS_PER_SECOND / 30;
        let at = Time(frame * 10);
        let off = |stage: &Stage| times(stage, at, &exposure).iter().map(|t| t.0 - at.0).collect::<Vec<_>>();
        assert_eq!(off(&stage), [-3, -1, 1, 3].map(|n| n * frame / 16));
        stage.cuts = vec![Cut { at, camera: 0 }, Cut { at: at + Time(frame / 8), camera: 0 }];
        assert_eq!(off(&stage), [0, 0, frame / 16, frame / 8 - 1]);
        let later = Exposure { before: 0.0, ..exposure };
        assert!(times(&Stage::default(), at, &later).iter().all(|t| *t > at));
    }

    #[test]
    fn halves_are_read_exactly() {
        for (bits, value) in [
            (0x0000, 0.0),
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0x0400, 6.103_515_6e-5),
            (0x0001, 5.960_464_5e-8),
            (0x3555, 0.333_251_95),
        ] {
            assert_eq!(half(bits), value, "{bits:#06x}");
        }
        assert!(half(0x7c00).is_infinite() && half(0x7e00).is_nan() && half(0x8000).is_sign_negative());
    }
}
