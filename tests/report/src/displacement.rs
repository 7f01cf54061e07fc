//! Displacement maps: subdivision of the displaced shape.

use crate::images::{measure_times, stage};
use crate::rays::Shapes;
use crate::{BUDGET_SECS, Random, Section};
use choreo_asset::Asset;
use choreo_bench::plots::{Choice, Row};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::Clock;
use choreo_motion::Time;
use choreo_render::{CpuRenderer, Plan, PlanOptions, Renderer, SceneResources};
use choreo_stage::Stage;
use glam::DVec3;
use std::f64::consts::TAU;
use std::sync::Arc;

const SIZE: [u32; 2] = [320, 180];
/// Side of the ground in metres, height from trough to crest in metres, and number of waves over a side.
const GROUND_SIDE: f64 = 2.0;
const WAVE_HEIGHT: f64 = 0.1;
const WAVE_COUNT: f64 = 4.0;
/// Number of texels along a side of the height map.
const MAP_SIDE_TEXELS: usize = 128;
const DETAIL_LEVELS: [u32; 7] = [1, 2, 3, 4, 5, 6, 7];
const DEFAULT_DETAIL: u32 = 2;

/// Height as a fraction of `WAVE_HEIGHT`; u and v are positions along x and z as fractions of a side.
fn height_at(u: f64, v: f64) -> f64 {
    0.5 + 0.25 * (libm::sin(TAU * WAVE_COUNT * u) + libm::cos(TAU * WAVE_COUNT * v))
}

fn ground_stage(detail: u32, pixels: &str) -> Result<Arc<Stage>, String> {
    let text = format!(
        "stage(#{{ background: \"black\" }});
         let heights = image({MAP_SIDE_TEXELS}, {MAP_SIDE_TEXELS}, {pixels});
         cast(\"ground\", shape(\"plane\", #{{ size: {GROUND_SIDE:?}, displacement_map: heights, displacement: {WAVE_HEIGHT:?}, detail: {detail} }}));
         sun(#{{ direction: [-0.5, -1.0, -0.8] }});
         camera(\"c\").fov(30).at(0.0, 1.6, 3.2).look_at([0.0, 0.0, 0.0]);"
    );
    stage(&text, &choreo::registry())
}

fn triangle_count(asset: &Asset) -> usize {
    asset.meshes.iter().flat_map(|m| &m.primitives).map(|p| p.indices.len() / 3).sum()
}

fn detail_name(detail: u32) -> String {
    format!("detail {detail}")
}

pub(crate) fn section() -> Result<Section, String> {
    let place = |i: usize| (i as f64 + 0.5) / MAP_SIDE_TEXELS as f64;
    let code = |x: usize, y: usize| (height_at(place(x), place(y)) * 255.0).round() as u8;
    let pixels: Vec<String> = (0..MAP_SIDE_TEXELS * MAP_SIDE_TEXELS)
        .map(|i| code(i % MAP_SIDE_TEXELS, i / MAP_SIDE_TEXELS))
        .map(|c| format!("{c},{c},{c},255"))
        .collect();
    let pixels = format!("[{}]", pixels.join(","));
    let mut choice = Choice::new(
        "displacement",
        "How often is a plane with displaced waves subdivided? (four waves a side)",
    );
    choice.error_unit = "mm";
    choice.by_mean = true;
    choice.reference =
        format!("the waves themselves, {} mm high, at 4,000 places of the mesh, in f64", WAVE_HEIGHT * 1e3);
    choice.per = format!("image of {}×{}, CPU renderer, {}", SIZE[0], SIZE[1], Clock::Process.words());
    for detail in DETAIL_LEVELS {
        let stage = ground_stage(detail, &pixels)?;
        let snapshot = stage.at(Time::ZERO).map_err(|e| e.to_string())?;
        let shapes = Shapes::of(&stage, &snapshot);
        let (mut random, mut error) = (Random(3), ErrorStats::default());
        for _ in 0..4000 {
            let [u, v] = [0.001 + 0.998 * random.unit(), 0.001 + 0.998 * random.unit()];
            let from = DVec3::new((u - 0.5) * GROUND_SIDE, 10.0, (v - 0.5) * GROUND_SIDE);
            let hit = shapes.first_hit(from, DVec3::NEG_Y).ok_or("the ground has a hole")?;
            error.add((hit.point.y - WAVE_HEIGHT * height_at(u, v)).abs() * 1e3);
        }
        let resources = Arc::new(SceneResources::new(&stage));
        let plan = Plan::new(&resources, &stage, &snapshot, &PlanOptions::new(SIZE, 4));
        let mut renderer = CpuRenderer::new(&[]);
        renderer.load(resources).map_err(|e| e.to_string())?;
        let nanos = measure_times(&mut renderer, &[&plan], 0.4 * BUDGET_SECS).remove(0);
        choice.rows.push(
            Row::new(detail_name(detail))
                .error(error.worst, error.mean())
                .nanos(nanos)
                .note(format!("{} triangles", triangle_count(&stage.actors[0].asset))),
        );
    }
    choice.choose(
        &detail_name(DEFAULT_DETAIL),
        "the default, for shapes with many triangles of their own; a plane has two triangles and needs more",
    );
    Ok(Section {
        title: "Displacement",
        text: "A height map moves the vertices of a shape once, when the shape is built: the finer the \
               mesh, the rounder the waves. Each step of `detail` divides a triangle into four; once \
               triangles are as small as texels, the remaining error comes from the 8 bits of the image."
            .into(),
        choices: vec![choice],
        tables: Vec::new(),
        off_front: vec![(
            "displacement",
            "a plane has two triangles, and two subdivision steps make only 32 of them, too few for \
             these waves; a sphere starts with about 2,200.",
        )],
    })
}
