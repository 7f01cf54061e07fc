//! Motion blur by accumulation: a frame is the mean, in linear light, of sub-frames at several exact times while the shutter is
//! open (Haeberli and Akeley, "The Accumulation Buffer", SIGGRAPH 1990, §3.2). Full-screen effects are applied to the mean.
//!
//! Earlier frames that an effect reads are also planned here, without motion blur.

use crate::plan::build::effects::{history_of, shutter_of};
use crate::plan::build::scene_inputs::reads_motion;
use crate::plan::options::PlanOptions;
use crate::plan::shutter_motion::ShutterScene;
use crate::plan::{LeftOut, Plan, PlanDissolve};
use crate::scene_resources::SceneResources;
use choreo_motion::Time;
use choreo_plugin::{FrameWish, Hook, Shutter};
use choreo_stage::{CameraState, Cut, Evaluator, Snapshot, Stage, StageError};
use glam::Vec4;

/// Snapshot and plan of the stage at a time, with the sub-frames and earlier frames that effects request. `camera` replaces the
/// stage's.
pub fn plan_at(
    resources: &SceneResources,
    evaluator: &mut Evaluator,
    time: Time,
    options: &PlanOptions,
    camera: Option<CameraState>,
) -> Result<(Snapshot, Plan), StageError> {
    let stage = evaluator.stage().clone();
    plan_with(resources, &stage, time, options, |time| {
        let mut snapshot = evaluator.at(time)?;
        if let Some(camera) = camera {
            (snapshot.camera, snapshot.dissolve) = (camera, None);
        }
        Ok(snapshot)
    })
}

/// Like [`plan_at`], with snapshots from the caller.
pub fn plan_with<E>(
    resources: &SceneResources,
    stage: &Stage,
    time: Time,
    options: &PlanOptions,
    mut at: impl FnMut(Time) -> Result<Snapshot, E>,
) -> Result<(Snapshot, Plan), E> {
    let snapshot = at(time)?;
    let mut plan = plan_shot(resources, stage, time, &snapshot, options, &mut at)?;
    if let Some(dissolve) = &snapshot.dissolve {
        let cut = stage.cuts.iter().rev().find(|cut| cut.at <= time);
        let cut = cut.map_or(Cut::new(time, 0), |cut| *cut);
        let share = dissolve.share;
        let mut before_cut = |time: Time| {
            // Snapshots before the cut have the earlier camera already.
            let mut then = at(time.min(cut.at + cut.dissolve - Time(1)))?;
            if let Some(dissolve) = then.dissolve.take().filter(|_| time >= cut.at) {
                (then.camera, then.effects) = (dissolve.camera, dissolve.effects);
            }
            Ok(then)
        };
        let then = before_cut(time)?;
        let before = plan_shot(resources, stage, time, &then, options, &mut before_cut)?;
        let before = Plan { layers_in_front: None, ..before };
        plan.dissolve = Some(Box::new(PlanDissolve { plan: before, share }));
    }
    Ok((snapshot, plan))
}

/// The plan of one camera at a time, with sub-frames and earlier frames.
fn plan_shot<E>(
    resources: &SceneResources,
    stage: &Stage,
    time: Time,
    snapshot: &Snapshot,
    options: &PlanOptions,
    mut at: impl FnMut(Time) -> Result<Snapshot, E>,
) -> Result<Plan, E> {
    let moves = reads_motion(stage, snapshot, options);
    let before = moves.then(|| at(frames_ago(stage, time, 1))).transpose()?;
    // Motion vectors are zero right after a cut.
    let moved_from = before.as_ref().filter(|before| before.camera.camera == snapshot.camera.camera);
    let of_frame = PlanOptions { moved_from, ..options.clone() };
    let mut plan = plan_alone(resources, stage, snapshot, &of_frame, &mut at)?;
    if matches!(options.wish, FrameWish::Scene(passes) if !passes.color) {
        return Ok(plan);
    }
    if let Some(mut shutter) = shutter_of(stage, snapshot, options.effects) {
        if !(options.all_sub_frames || options.force_all) {
            let shown = ShutterScene { resources, stage, options, plan: &plan };
            let motion = shown.motion(shutter.samples, time_of(stage, time, &shutter), &mut at)?;
            shutter.samples = motion.sub_frames();
            if shutter.samples < motion.most {
                let why = format!("{} of {}: {motion}", shutter.samples, motion.most);
                plan.left_out.push(LeftOut { part: "sub-frames".into(), why });
            }
            plan.shutter_motion = Some(motion);
        }
        for time in times(stage, time, &shutter) {
            let then = at(time)?;
            let part = plan_alone(resources, stage, &then, options, &mut at)?;
            plan.subframes.push(linear(part));
        }
    }
    let back = history_of(stage, snapshot, options.effects, Hook::Image);
    if back > 0 {
        if plan.subframes.is_empty() {
            plan.subframes.push(linear(plan_alone(resources, stage, snapshot, options, &mut at)?));
        }
        for frames in 1..=i64::from(back) {
            let then = at(frames_ago(stage, time, frames))?;
            plan.history.push(linear(plan_alone(resources, stage, &then, options, &mut at)?));
        }
    }
    Ok(plan)
}

/// A plan whose image is accumulated: without full-screen passes and layers over the image, which come later.
fn linear(plan: Plan) -> Plan {
    Plan { post: Vec::new(), scene_inputs: None, linear: true, layers_in_front: None, ..plan }
}

/// The time of an earlier frame, not before the first one.
fn frames_ago(stage: &Stage, time: Time, frames: i64) -> Time {
    (time - stage.settings.fps.time_of(frames)).max(Time(0).min(time))
}

/// The plan of one snapshot without sub-frames, with the earlier snapshots that overlays draw.
pub fn plan_alone<E>(
    resources: &SceneResources,
    stage: &Stage,
    snapshot: &Snapshot,
    options: &PlanOptions,
    at: impl FnMut(Time) -> Result<Snapshot, E>,
) -> Result<Plan, E> {
    let back = i64::from(history_of(stage, snapshot, options.effects, Hook::Overlay));
    let earlier = (1..=back).map(|frames| frames_ago(stage, snapshot.time, frames));
    let before = earlier.map(at).collect::<Result<Vec<Snapshot>, E>>()?;
    Ok(Plan::new(resources, stage, snapshot, &PlanOptions { before: &before, ..options.clone() }))
}

/// Names of the parts of a frame that [`plan_alone`] leaves out because they need other frames.
pub fn left_out_alone(stage: &Stage, snapshot: &Snapshot, options: &PlanOptions) -> Vec<&'static str> {
    let parts = [
        ("motion blur", shutter_of(stage, snapshot, options.effects).is_some()),
        ("effects of earlier frames", history_of(stage, snapshot, options.effects, Hook::Image) > 0),
        ("effects of motion", reads_motion(stage, snapshot, options)),
        ("dissolve", snapshot.dissolve.is_some()),
    ];
    parts.into_iter().filter(|(_, needs)| *needs).map(|(name, _)| name).collect()
}

/// Times of the sub-frames: evenly spaced while the shutter is open, each in the middle of its interval.
pub fn times(stage: &Stage, time: Time, exposure: &Shutter) -> Vec<Time> {
    let samples = exposure.samples.max(1);
    let time_of = time_of(stage, time, exposure);
    (0..samples).map(|i| time_of((f64::from(i) + 0.5) / f64::from(samples))).collect()
}

/// The time at a fraction of the open shutter, clamped between cuts, so that no shot bleeds into the next.
fn time_of(stage: &Stage, time: Time, exposure: &Shutter) -> impl Fn(f64) -> Time {
    let fps = stage.settings.fps;
    let frame = f64::from(fps.den) / f64::from(fps.num.max(1));
    let cuts = || stage.cuts.iter().map(|cut| cut.at);
    let first = cuts().filter(|at| *at <= time).max().unwrap_or(Time(i64::MIN));
    let last = cuts().filter(|at| *at > time).min().map_or(Time::MAX, |next| next - Time(1));
    let Shutter { open, before, .. } = *exposure;
    move |share| (time + Time::from_secs((share - before) * open * frame)).clamp(first, last)
}

/// Accumulation buffer: the sum of images, linear RGBA.
#[derive(Debug)]
pub(crate) struct Accumulated {
    pixels: Vec<Vec4>,
    count: u32,
}

impl Accumulated {
    pub(crate) fn new(pixels: usize) -> Accumulated {
        Accumulated { pixels: vec![Vec4::ZERO; pixels], count: 0 }
    }

    pub(crate) fn add(&mut self, image: impl Iterator<Item = Vec4>) {
        self.pixels.iter_mut().zip(image).for_each(|(sum, pixel)| *sum += pixel);
        self.count += 1;
    }

    pub(crate) fn mean(self) -> Vec<Vec4> {
        let share = 1.0 / self.count.max(1) as f32;
        self.pixels.into_iter().map(|sum| sum * share).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sub_frame_times_are_even_and_stay_within_the_shot() {
        let mut stage = Stage::default();
        let exposure = Shutter { samples: 4, open: 0.5, before: 0.5 };
        let frame = Time::TICKS_PER_SECOND / 30;
        let at = Time(frame * 10);
        let off = |stage: &Stage| times(stage, at, &exposure).iter().map(|t| t.0 - at.0).collect::<Vec<_>>();
        assert_eq!(off(&stage), [-3, -1, 1, 3].map(|n| n * frame / 16));
        stage.cuts = vec![Cut::new(at, 0), Cut::new(at + Time(frame / 8), 0)];
        assert_eq!(off(&stage), [0, 0, frame / 16, frame / 8 - 1]);
        let later = Shutter { before: 0.0, ..exposure };
        assert!(times(&Stage::default(), at, &later).iter().all(|t| *t > at));
    }
}
