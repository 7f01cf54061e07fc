//! Motion blur: number of sub-frames, by the motion of the fastest pixel.

use crate::images::{draw_frame, stage};
use crate::{BUDGET_SECS, Section};
use choreo_bench::plots::{Cell, Choice, Row, Table, quantity};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_motion::Time;
use choreo_render::plan::motion_blur::plan_at;
use choreo_render::scene_resources::mipmap::srgb_to_linear_table;
use choreo_render::{CpuRenderer, Plan, PlanOptions, Renderer, SceneResources};
use choreo_stage::{Evaluator, Stage};
use std::cell::RefCell;
use std::sync::Arc;

const SIZE: [u32; 2] = [160, 90];
/// Motion of the bar in pixels while the shutter is open.
const BAR_TRAVELS: [f64; 4] = [0.4, 3.0, 12.0, 40.0];
/// Left edge of the bar when the shutter opens, and its width, in pixels.
const BAR_EDGE_AND_WIDTH: [f64; 2] = [50.3, 20.0];
const MAX_SUB_FRAMES: f64 = 16.0;
/// Pixels of motion per sub-frame; 0 always uses the largest number of sub-frames.
const PIXELS_PER_SUB_FRAME: [f64; 5] = [0.0, 0.5, 1.0, 2.0, 4.0];

fn step_name(step: f64) -> String {
    match step {
        0.0 => format!("always {MAX_SUB_FRAMES}"),
        1.0 => "1 pixel a sub-frame".into(),
        more => format!("{more} pixels a sub-frame"),
    }
}

/// Reference value of a column: coverage of the pixel by the bar, averaged over time.
fn reference_coverage(pixels: f64, column: u32) -> f64 {
    const TIME_COUNT: u32 = 4096;
    let covered = |i: u32| {
        let left = BAR_EDGE_AND_WIDTH[0] + pixels * (f64::from(i) + 0.5) / f64::from(TIME_COUNT);
        let x = f64::from(column);
        ((left + BAR_EDGE_AND_WIDTH[1]).min(x + 1.0) - left.max(x)).clamp(0.0, 1.0)
    };
    (0..TIME_COUNT).map(covered).sum::<f64>() / f64::from(TIME_COUNT)
}

/// Scene with one speed of the bar.
struct Scene {
    resources: Arc<SceneResources>,
    /// Plans, one for each of `PIXELS_PER_SUB_FRAME`.
    plans: Vec<Plan>,
}

fn scene(pixels: f64) -> Result<Scene, String> {
    let registry = choreo::registry();
    // The orthographic camera shows ten pixels per metre.
    let from = (BAR_EDGE_AND_WIDTH[0] + BAR_EDGE_AND_WIDTH[1] * 0.5 - 80.0) * 0.1;
    let text = format!(
        "stage(#{{ fps: 1, length: 2, background: \"black\", view: \"none\" }});
         let bar = cast(\"bar\", shape(\"quad\", #{{ size: [{:?}, 30.0], color: \"white\", unlit: true }}));
         bar.key(\"position\", [[0, [{from:?}, -15.0, 0.0]], [1, [{:?}, -15.0, 0.0]]], \"linear\");
         camera(\"c\").ortho(9.0).at(0.0, 0.0, 5.0).look_at([0.0, 0.0, 0.0]);
         effect(\"motion_blur\", #{{ samples: 256, shutter: 360.0, around: \"start\" }});",
        BAR_EDGE_AND_WIDTH[1] * 0.1,
        from + pixels * 0.1,
    );
    let mut stage = stage(&text, &registry)?;
    let resources = Arc::new(SceneResources::new(&stage));
    let options = PlanOptions { effects: registry.effects(), ..PlanOptions::new(SIZE, 4) };
    let plan = |stage: &Arc<Stage>, secs: f64, options: &PlanOptions| {
        let (mut evaluator, time) = (Evaluator::new(stage.clone()), Time::from_secs(secs));
        let planned = plan_at(&resources, &mut evaluator, time, options, None);
        planned.map(|(_, plan)| plan).map_err(|e| e.to_string())
    };
    let moved = plan(&stage, 0.0, &options)?.shutter_motion.ok_or("no motion blur is on")?;
    let moved = moved.found?;
    let options = PlanOptions { all_sub_frames: true, ..options };
    let mut plans = Vec::new();
    for step in PIXELS_PER_SUB_FRAME {
        let count =
            if step == 0.0 { MAX_SUB_FRAMES } else { (moved / step).ceil().clamp(1.0, MAX_SUB_FRAMES) };
        let parameters = &mut Arc::make_mut(&mut stage).effects[0].parameters;
        parameters.iter_mut().filter(|(name, _)| name == "samples").for_each(|(_, n)| *n = count);
        // A single sub-frame is the image in the middle of the exposure.
        let (secs, effects) = if count == 1.0 { (0.5, &[][..]) } else { (0.0, registry.effects()) };
        plans.push(plan(&stage, secs, &PlanOptions { effects, ..options.clone() })?);
    }
    Ok(Scene { resources, plans })
}

pub(crate) fn section() -> Result<Section, String> {
    let registry = choreo::registry();
    let mut choice = Choice::new("sub_frames", "How many sub-frames does a frame with motion blur take?");
    choice.error_unit = "% of white";
    choice.reference = "a bar 20 pixels wide that moves by 0.4, 3, 12 and 40 pixels; the share of time and of each pixel that it covers, \
                        in f64"
        .into();
    choice.per = format!("image of {}×{}, CPU renderer, {}", SIZE[0], SIZE[1], Clock::Process.words());
    let scenes = BAR_TRAVELS.map(scene).into_iter().collect::<Result<Vec<_>, _>>()?;
    let columns: Vec<String> = BAR_TRAVELS.iter().map(|v| format!(">{v} pixels")).collect();
    let mut titles: Vec<(&str, &'static str)> = vec![("worst error in % of white", "way")];
    titles.extend(columns.iter().map(|c| (c.as_str(), "speed")));
    let mut table = Table::new("By the motion of the fastest pixel", &titles);
    let linear = srgb_to_linear_table();
    let renderer = |scene: &Scene| {
        let mut renderer = CpuRenderer::new(registry.effects());
        renderer.load(scene.resources.clone()).map(|()| renderer).map_err(|e| e.to_string())
    };
    for (method, step) in PIXELS_PER_SUB_FRAME.into_iter().enumerate() {
        let (mut all, mut cells) = (ErrorStats::default(), vec![Cell::text(step_name(step))]);
        for (scene, pixels) in scenes.iter().zip(BAR_TRAVELS) {
            let frame = draw_frame(&mut renderer(scene)?, &scene.plans[method])?;
            let row = &frame.rgba[(SIZE[0] * SIZE[1] / 2 * 4) as usize..][..4 * SIZE[0] as usize];
            let mut worst = 0.0f64;
            for (column, code) in (0..).zip(row.iter().step_by(4)) {
                let truth = reference_coverage(pixels, column);
                let error = (f64::from(linear[usize::from(*code)]) - truth).abs() * 100.0;
                worst = worst.max(error);
                // Only columns that the bar's edges cross are compared.
                if truth > 0.0 && truth < 1.0 {
                    all.add(error);
                }
            }
            cells.push(Cell::number(quantity(worst), worst));
        }
        let counts: Vec<String> =
            scenes.iter().map(|s| s.plans[method].subframes.len().max(1).to_string()).collect();
        let note = format!("{} sub-frames", counts.join(", "));
        choice.rows.push(Row::new(step_name(step)).error(all.worst, all.mean()).note(note));
        table.rows.push(cells);
    }
    let renderers = scenes.iter().map(|s| renderer(s).map(RefCell::new)).collect::<Result<Vec<_>, _>>()?;
    let case = |method: usize| {
        let (scenes, renderers) = (&scenes, &renderers);
        Case::new(BAR_TRAVELS.len(), move || {
            for (scene, renderer) in scenes.iter().zip(renderers) {
                drop(std::hint::black_box(draw_frame(&mut *renderer.borrow_mut(), &scene.plans[method])));
            }
        })
    };
    let nanos = interleaved(
        Clock::Process,
        3.0 * BUDGET_SECS,
        &mut (0..PIXELS_PER_SUB_FRAME.len()).map(case).collect::<Vec<_>>(),
    );
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    choice.choose(&step_name(1.0), "a pixel is a mean over its own width, so that such steps leave no gaps");
    Ok(Section {
        title: "Sub-frames of motion blur",
        text: format!(
            "Motion blur is the mean of images while the shutter is open. Few images show as separate \
             copies, and many waste time where little moves. The plan computes how far the fastest pixel \
             moves and draws one sub-frame for each pixel of motion, at most {MAX_SUB_FRAMES} by default; in slow \
             motion the remaining error comes from the four samples of an edge."
        ),
        choices: vec![choice],
        tables: vec![table],
        off_front: Vec::new(),
    })
}
