//! Levels of detail: geometric error in the image, and the time that it saves.

use crate::images::{draw_frame, error_and_cost_rows, stage};
use crate::{BUDGET_SECS, Section};
use choreo_bench::plots::Choice;
use choreo_bench::timing::Clock;
use choreo_motion::Time;
use choreo_render::{CpuRenderer, Plan, PlanOptions, Renderer, SceneResources};
use std::sync::Arc;

const SIZE: [u32; 2] = [640, 360];
/// Tolerances in pixels; 0 draws all triangles.
const TOLERANCES: [f32; 6] = [0.0, 0.5, 1.0, 2.0, 4.0, 8.0];

/// A crowd of two hundred walkers, twenty rows of ten, with shifted phases.
const CROWD: &str = r##"
    stage(#{ length: 2.0, background: "#8fa0b0" });
    let moves = load("choreo:mannequin", #{ color: "#f2a93b" });
    for z in 0..20 {
        for x in 0..10 {
            let w = cast("walker " + x + " " + z, moves).at(x - 4.5, 0.0, -1.5 * z);
            w.play(moves.clip("Walk")).from(-0.07 * (10 * z + x)).loop();
        }
    }
    sun(#{ direction: [-1.0, -1.6, -0.8] });
    camera("front").fov(40).at(0.0, 3.0, 9.0).look_at([0.0, 0.9, -4.0]);
"##;

pub(crate) fn section() -> Result<Section, String> {
    Ok(Section {
        title: "Levels of detail",
        text: "Models that are often so small that their triangles are smaller than pixels get simplified \
               versions. For each version two sizes are known in metres: its Hausdorff distance from the \
               original surface (by samples), and the pixel size from which on images of both, from \
               fourteen sides, have the same colors. A copy is drawn with the coarsest version for which \
               both sizes are at most the tolerance, measured where the copy is nearest to the camera."
            .into(),
        choices: vec![compare_tolerances()?],
        tables: Vec::new(),
        off_front: Vec::new(),
    })
}

fn compare_tolerances() -> Result<Choice, String> {
    let mut choice =
        Choice::new("detail", "How far may a coarser version be off in the image? (200 walkers)");
    choice.error_unit = "steps of 255";
    choice.by_mean = true;
    choice.reference = "every copy with all of its triangles; mean over all channels of all pixels".into();
    choice.per = format!("image of {}×{}, CPU renderer, {}", SIZE[0], SIZE[1], Clock::Process.words());
    let stage = stage(CROWD, &choreo::registry())?;
    let resources = Arc::new(SceneResources::new(&stage));
    let snapshot = stage.at(Time::from_secs(0.4)).map_err(|e| e.to_string())?;
    let plan = |tolerance: f32| {
        // The planner's tolerance is fixed at one pixel, so the errors of the levels are scaled instead.
        let mut scaled = (*resources).clone();
        let levels = scaled.assets.iter_mut().flat_map(|asset| &mut asset.levels);
        levels.for_each(|level| level.error /= tolerance.max(1e-9));
        let options = PlanOptions { full_detail: tolerance == 0.0, ..PlanOptions::new(SIZE, 4) };
        Plan::new(&scaled, &stage, &snapshot, &options)
    };
    let triangles = |plan: &Plan| {
        let of = |primitive: u32| resources.primitives[primitive as usize].primitive().indices.len() / 3;
        plan.draws.iter().map(|d| of(d.primitive) * d.instance_count as usize).sum::<usize>()
    };
    let mut renderer = CpuRenderer::new(&[]);
    renderer.load(resources.clone()).map_err(|e| e.to_string())?;
    let name = |tolerance: f32| match tolerance {
        0.0 => "all triangles".into(),
        1.0 => "1 pixel".into(),
        more => format!("{more} pixels"),
    };
    let methods: Vec<(String, Plan)> = TOLERANCES.iter().map(|t| (name(*t), plan(*t))).collect();
    let truth = draw_frame(&mut renderer, &methods[0].1)?;
    choice.rows = error_and_cost_rows(&mut renderer, &methods, &truth, 4.0 * BUDGET_SECS)?;
    for (row, (_, plan)) in choice.rows.iter_mut().zip(&methods) {
        row.note = format!("{} triangles, {}", triangles(plan), row.note);
    }
    choice.choose(
        "1 pixel",
        "outlines move by no more than samples smooth; beyond that, figures lose their shape",
    );
    Ok(choice)
}
