//! Choices that show in images: the same moment is drawn from variants of the stage, and compared with an image of many more samples.

use super::{MeasuredScene, SceneChoices};
use crate::error::BenchError;
use crate::moment::{Moment, REFERENCE_SCALE, averaged};
use crate::plots::{Choice, Row};
use crate::timing::{Case, Clock, interleaved};
use choreo_image_diff::compare;
use choreo_motion::Time;
use choreo_plugin::Frame;
use choreo_render::plan::motion_blur::plan_at;
use choreo_render::{CpuRenderer, PlanOptions, Renderer};
use choreo_stage::{Evaluator, Shadow, Stage, StageError};
use std::cell::RefCell;
use std::sync::Arc;

/// Largest size of the image, because the reference takes many times its samples.
const MAX_PIXELS: u32 = 320 * 180;
/// Larger differences, in steps of 255, are visible side by side.
const TOLERANCE: u8 = 8;

/// A stage to draw, and its name in the table.
struct Variant {
    name: String,
    stage: Stage,
    /// Motion blur draws all its sub-frames, however little moves.
    all_sub_frames: bool,
}

/// Compares numbers of sub-frames of motion blur.
pub fn motion_blur(scene: &MeasuredScene, moment: &Moment) -> Result<SceneChoices, BenchError> {
    let is_blur = |e: &&choreo_stage::EffectState| scene.stage.effects[e.effect].plugin == "motion_blur";
    let Some(blur) = moment.snapshot.effects.iter().find(is_blur) else {
        return Ok(SceneChoices::None("no motion blur is on at this time".into()));
    };
    let with = |samples: u32| {
        let mut stage = (**scene.stage).clone();
        let parameters = &mut stage.effects[blur.effect].parameters;
        parameters.retain(|(name, _)| name != "samples");
        parameters.push(("samples".into(), f64::from(samples)));
        parameters.sort_by(|a, b| a.0.cmp(&b.0));
        stage.effects[blur.effect].keys.retain(|(name, _)| name != "samples");
        stage
    };
    let given = blur.parameters.iter().find(|(name, _)| name == "samples").map_or(16, |(_, n)| *n as u32);
    let mut counts = vec![1, 4, 8, 16, 32, 64, given];
    counts.sort_unstable();
    counts.dedup();
    let name = |samples: u32| format!("{samples} sub-frame{}", if samples == 1 { "" } else { "s" });
    let all = |n: &u32| Variant { name: name(*n), stage: with(*n), all_sub_frames: true };
    let mut variants: Vec<Variant> = counts.iter().map(all).collect();
    let needed = format!("as many as moving pixels need, at most {given}");
    variants.push(Variant { name: needed.clone(), stage: with(given), all_sub_frames: false });
    let mut choice = Choice::new("motion_blur", "How many sub-frames make up a frame?");
    choice.reference = "256 sub-frames".into();
    let truth = Reference { stage: with(256), finer: 1 };
    add_rows(&mut choice, scene, moment, &variants, &truth)?;
    choice.choose(&needed, "limited by the effect's samples");
    Ok(SceneChoices::Choices(vec![choice]))
}

/// Compares sizes of shadow maps.
pub fn shadows(scene: &MeasuredScene, moment: &Moment) -> Result<SceneChoices, BenchError> {
    let sizes: Vec<u32> = scene.stage.lights.iter().filter_map(|light| Some(light.shadow?.size)).collect();
    let Some(given) = sizes.iter().copied().max() else {
        return Ok(SceneChoices::None("no light of the script casts shadows".into()));
    };
    let with = |size: u32| {
        let mut stage = (**scene.stage).clone();
        let shadows = stage.lights.iter_mut().filter_map(|light| light.shadow.as_mut());
        shadows.for_each(|shadow| shadow.size = size);
        stage
    };
    let largest = *Shadow::SIZES.end();
    let mut counts = vec![64, 128, 256, 512, 1024, 2048, largest, given];
    counts.sort_unstable();
    counts.dedup();
    let name = |size: u32| format!("{size} texels a side");
    let variant = |n: &u32| Variant { name: name(*n), stage: with(*n), all_sub_frames: false };
    let variants: Vec<Variant> = counts.iter().map(variant).collect();
    let mut choice = Choice::new("shadows", "How large are shadow maps?");
    choice.reference = format!("{largest} texels a side and 64 samples a pixel, more than any row has");
    let truth = Reference { stage: with(largest), finer: REFERENCE_SCALE };
    add_rows(&mut choice, scene, moment, &variants, &truth)?;
    choice.choose(&name(given), "the largest size that the script sets");
    Ok(SceneChoices::Choices(vec![choice]))
}

/// The reference: a stage that is drawn `finer` times as large with four samples per pixel.
struct Reference {
    stage: Stage,
    finer: u32,
}

/// One stage, ready to be drawn.
struct StageRender<'a> {
    evaluator: Evaluator,
    moment: &'a Moment,
    at: Time,
    samples: u32,
    all_sub_frames: bool,
}

impl StageRender<'_> {
    fn draw(&mut self, renderer: &mut CpuRenderer, size: [u32; 2]) -> Result<Frame, BenchError> {
        let options = PlanOptions {
            effects: &self.moment.effects,
            all_sub_frames: self.all_sub_frames,
            ..PlanOptions::new(size, self.samples)
        };
        let plan = plan_at(&self.moment.resources, &mut self.evaluator, self.at, &options, None);
        let (_, plan) = plan.map_err(|e: StageError| BenchError::from(e))?;
        renderer.submit(plan)?;
        Ok(renderer.collect(None)?)
    }
}

fn add_rows(
    choice: &mut Choice,
    scene: &MeasuredScene,
    moment: &Moment,
    variants: &[Variant],
    reference: &Reference,
) -> Result<(), BenchError> {
    let [width, height] = scene.size;
    let smaller = (1..=64).find(|n| (width / n) * (height / n) <= MAX_PIXELS).unwrap_or(64);
    let size = [width / smaller, height / smaller].map(|n| n.max(16));
    let samples = scene.stage.settings.samples.unwrap_or(4);
    let drawn = |stage: &Stage, samples: u32, all_sub_frames: bool| StageRender {
        evaluator: Evaluator::new(Arc::new(stage.clone())),
        moment,
        at: scene.at,
        samples,
        all_sub_frames,
    };
    let mut renderer = CpuRenderer::new(&moment.effects);
    renderer.load(moment.resources.clone())?;
    let finer = reference.finer;
    let truth_samples = if finer > 1 { 4 } else { samples };
    let truth = drawn(&reference.stage, truth_samples, true).draw(&mut renderer, size.map(|n| n * finer))?;
    let truth = if finer > 1 { averaged(&truth, finer) } else { truth };
    choice.error_unit = "steps of 255";
    choice.by_mean = true;
    choice.reference += &format!(", at {}×{}; mean over all channels of all pixels", size[0], size[1]);
    choice.per = format!("image by the CPU renderer, {}", Clock::Process.words());
    let mut all: Vec<StageRender> =
        variants.iter().map(|variant| drawn(&variant.stage, samples, variant.all_sub_frames)).collect();
    let mut rows = Vec::new();
    for (variant, drawn) in variants.iter().zip(&mut all) {
        let c = compare(&drawn.draw(&mut renderer, size)?, &truth, TOLERANCE)?;
        let share = format!("{:.2} % of pixels beyond {TOLERANCE}", c.share_beyond * 100.0);
        let place = format!("pixel {}, {}", c.worst_at[0], c.worst_at[1]);
        rows.push(Row::new(&variant.name).error(f64::from(c.worst), c.mean).at(place).note(share));
    }
    let shared = RefCell::new(renderer);
    let failed: RefCell<Option<BenchError>> = RefCell::new(None);
    let mut cases: Vec<Case> = Vec::new();
    for drawn in &mut all {
        let (shared, failed) = (&shared, &failed);
        cases.push(Case::new(1, move || {
            if let Err(error) = drawn.draw(&mut shared.borrow_mut(), size) {
                *failed.borrow_mut() = Some(error);
            }
        }));
    }
    let nanos = interleaved(Clock::Process, scene.budget_secs, &mut cases);
    drop(cases);
    if let Some(error) = failed.into_inner() {
        return Err(error);
    }
    choice.rows = rows.into_iter().zip(nanos).map(|(row, nanos)| row.nanos(nanos)).collect();
    Ok(())
}
