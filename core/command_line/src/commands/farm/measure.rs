//! Cost of a film's frames, measured by drawing some of them.

use super::chunks::FilmCost;
use crate::args::RenderArgs;
use crate::commands::render::Job;
use crate::drawing::device;
use crate::drawing::pipeline::render_failure;
use crate::failure::Failure;
use choreo_render::plan::frame_key::scene_key;
use choreo_render::plan::motion_blur::plan_at;
use choreo_render::{PlanOptions, SceneResources};
use choreo_stage::Evaluator;
use std::sync::Arc;
use std::time::Instant;

/// Largest number of places in the film where frames are drawn.
const MAX_SAMPLED_PLACES: u64 = 8;
/// Seconds after which no further place is begun.
const MAX_SAMPLING_SECS: f64 = 30.0;

/// Draws two consecutive frames at several places. The difference between them is the extra cost of a frame without a previous one:
/// pre-roll of springs, spans of foot locks. `opening`: when opening the scene began.
pub(crate) fn measure_cost(args: &RenderArgs, job: &Job, opening: Instant) -> Result<FilmCost, Failure> {
    let effects = job.scene.registry.effects();
    let mut renderer = device::start_renderer(args.device, effects).wait()?.renderer;
    let samples = job.samples.or(job.settings.samples);
    let samples = samples.unwrap_or_else(|| device::default_samples(renderer.device()));
    renderer.set_effects(effects).map_err(render_failure)?;
    let resources = Arc::new(SceneResources::new(&job.scene.stage));
    renderer.load(resources.clone()).map_err(render_failure)?;
    let size = job.settings.size;
    let options = PlanOptions { effects, ..PlanOptions::new(size, samples) };
    let aspect = f64::from(size[0]) / f64::from(size[1].max(1));
    let mut spare = None;
    let mut start_secs = opening.elapsed().as_secs_f64();
    let (sampling, total) = (Instant::now(), job.frames.len() as u64);
    let (mut frames, mut first_frame_extra_secs) = (Vec::new(), Vec::new());
    for place in 0..MAX_SAMPLED_PLACES.min(total) {
        let first = (place * total / MAX_SAMPLED_PLACES.min(total)) as usize;
        // A new evaluator for each place: a machine of the farm has no previous frame either.
        let mut evaluator = Evaluator::new(job.scene.stage.clone()).for_images(aspect);
        let (mut seconds, mut previous_key) = (Vec::new(), None);
        for (number, time) in job.frames.iter().skip(first).take(2) {
            let drawing = Instant::now();
            let planned = plan_at(&resources, &mut evaluator, *time, &options, None);
            let (_, plan) = planned.map_err(|e| Failure::input(e.to_string()))?;
            let layers = plan.layers_in_front.as_ref().map(|layers| layers.hash);
            let key = (scene_key(&plan, &resources, effects), layers);
            // A frame equal to the previous one is not drawn by a render either.
            if previous_key != Some(key) {
                renderer.submit(plan).map_err(render_failure)?;
                spare = Some(renderer.collect(spare.take()).map_err(render_failure)?);
            }
            previous_key = Some(key);
            seconds.push((number.unsigned_abs(), drawing.elapsed().as_secs_f64()));
        }
        if let (Some(first), Some(last)) = (seconds.first(), seconds.last()) {
            frames.push(*last);
            first_frame_extra_secs.push((first.1 - last.1).max(0.0));
        }
        if sampling.elapsed().as_secs_f64() > MAX_SAMPLING_SECS {
            break;
        }
    }
    start_secs += first_frame_extra_secs.iter().sum::<f64>() / first_frame_extra_secs.len().max(1) as f64;
    Ok(FilmCost { start_secs, frames })
}
