//! Forward against deferred shading, by number of lights per surface and by overdraw.

use crate::images::{draw_frame, measure_times, stage};
use crate::{BUDGET_SECS, Section};
use choreo_bench::plots::{Cell, Table, ratio, time};
use choreo_bench::timing::Clock;
use choreo_image_diff::compare;
use choreo_motion::Time;
use choreo_render::plan::DeferredCause;
use choreo_render::{GpuOptions, Plan, PlanOptions, Renderer, SceneResources, VulkanRenderer};
use choreo_stage::{Pipeline, Stage};
use std::sync::Arc;

const SIZE: [u32; 2] = [1280, 720];
const LIGHT_COUNTS: [usize; 4] = [1, 8, 64, 256];
const OVERDRAW_LAYERS: [usize; 3] = [1, 3, 8];

pub(crate) fn section() -> Result<Section, String> {
    Ok(Section {
        title: "Forward and deferred",
        text: "Forward rendering lights a surface when it is drawn, and nearer surfaces are drawn over it. \
               Deferred rendering stores the nearest surface in a G-buffer (36 bytes a pixel), and lights \
               each pixel once. Writing and reading the G-buffer costs time at every pixel: on lavapipe \
               about as much as four lights of a list. It pays where more lights than that are wasted on \
               surfaces that are hidden later: the plan estimates both from the boxes of the lit objects \
               and the lists of lights, and chooses deferred from four wasted lights a pixel on (`KEEPING` \
               in `plan/build/deferred.rs`), with one sample a pixel. The walls are slanted tiles of eight \
               materials, drawn material by material. A light with a shadow counts as one here but costs \
               more: the estimate favors forward. GPUs are not measured: writing and reading 72 bytes a \
               pixel weighs more against their arithmetic, so deferred may pay later there than this table \
               shows."
            .into(),
        choices: Vec::new(),
        tables: vec![measure_pipelines()?],
        off_front: Vec::new(),
    })
}

/// `layers` walls of slanted tiles, one behind the other, in eight materials. Materials are drawn one after another, regardless of depth.
/// Lamps with a range of 2 m are spread along all walls.
fn walls_scene(lights: usize, layers: usize) -> Result<Arc<Stage>, String> {
    let text = format!(
        r##"
        stage(#{{ samples: 1, background: "black", ambient: 0.1 }});
        let tiles = [];
        for m in 0..8 {{
            tiles.push(shape("quad", #{{ size: [1.12, 1.12], color: [0.4 + 0.07 * m, 0.9 - 0.08 * m, 0.5], roughness: 0.3 + 0.08 * m, metallic: if m % 4 == 3 {{ 1.0 }} else {{ 0.0 }} }}));
        }}
        for layer in 0..{layers} {{
            for x in 0..16 {{
                for y in 0..9 {{
                    let i = (layer * 16 + x) * 9 + y;
                    cast(`tile ${{i}}`, tiles[rand(i, 0, 8).to_int()])
                        .at(x - 7.5, y - 4.5, 0.3 * layer).rotate(rand(i + 5000, -12, 12), rand(i + 9000, -12, 12), 0);
                }}
            }}
        }}
        for i in 0..{lights} {{
            point(#{{ position: [rand(i, -7.5, 7.5), rand(i + 1000, -4, 4), rand(i + 2000, 0.6, 0.3 * {layers} + 1.0)], range: 2.0, intensity: 0.4 }});
        }}
        camera("front").fov(40).at(0.0, 0.0, 0.3 * {layers} + 11.5).look_at([0.0, 0.0, 0.0]);
        "##
    );
    stage(&text, &choreo::registry())
}

fn plan(stage: &Arc<Stage>, resources: &SceneResources, pipeline: Pipeline) -> Result<Plan, String> {
    let mut stage = Stage::clone(stage);
    stage.settings.pipeline = pipeline;
    let snapshot = stage.at(Time::ZERO).map_err(|e| e.to_string())?;
    Ok(Plan::new(resources, &stage, &snapshot, &PlanOptions::new(SIZE, 1)))
}

/// Estimates on which the plan based its choice.
fn plan_estimates(plan: &Plan) -> String {
    if let Some(DeferredCause::Pays { lights, surfaces, wasted }) = plan.deferred.as_ref().map(|d| d.cause) {
        return format!("{lights:.1} lights per surface, {surfaces:.1} surfaces, {wasted:.1} wasted");
    }
    let out = plan.left_out.iter().find(|l| l.part == "deferred shading");
    let why = out.map_or("", |l| &l.why);
    why.split(", and a G-buffer").next().unwrap_or_default().to_string()
}

fn measure_pipelines() -> Result<Table, String> {
    let columns = [
        (">lights", "lights"),
        (">walls", "walls"),
        (">forward", "forward"),
        (">deferred", "deferred"),
        (">deferred / forward", "ratio"),
        (">mean difference", "mean"),
        (">worst", "worst"),
        ("the plan chooses", "chosen"),
        ("by", "estimate"),
    ];
    let title = format!("Time of an image of {}×{}, {}", SIZE[0], SIZE[1], Clock::Process.words());
    let mut table = Table::new(title, &columns);
    let mut gpu = VulkanRenderer::new(GpuOptions::default()).map_err(|e| e.to_string())?;
    for layers in OVERDRAW_LAYERS {
        for lights in LIGHT_COUNTS {
            let stage = walls_scene(lights, layers)?;
            let resources = Arc::new(SceneResources::new(&stage));
            gpu.load(resources.clone()).map_err(|e| e.to_string())?;
            let [forward, deferred, auto] =
                [Pipeline::Forward, Pipeline::Deferred, Pipeline::Auto].map(|p| plan(&stage, &resources, p));
            let (forward, deferred, auto) = (forward?, deferred?, auto?);
            let [there, here] = [draw_frame(&mut gpu, &forward)?, draw_frame(&mut gpu, &deferred)?];
            let difference = compare(&there, &here, 2).map_err(|e| e.to_string())?;
            let took = measure_times(&mut gpu, &[&forward, &deferred], 2.0 * BUDGET_SECS);
            let number = |v: f64, digits: usize| Cell::number(format!("{v:.digits$}"), v);
            let chosen = if auto.deferred.is_some() { "deferred" } else { "forward" };
            table.rows.push(vec![
                Cell::count(lights),
                Cell::count(layers),
                time(took[0]),
                time(took[1]),
                ratio(&took[0], &took[1]),
                number(difference.mean, 3),
                Cell::count(usize::from(difference.worst)),
                Cell::text(chosen),
                Cell::text(plan_estimates(&auto)),
            ]);
        }
    }
    Ok(table)
}
