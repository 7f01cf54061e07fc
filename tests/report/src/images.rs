//! Shared parts of the sections about images: stages from script texts, drawn images, their errors and timings.

use choreo_bench::plots::{Row, quantity};
use choreo_bench::timing::{Case, Clock, Nanos, interleaved};
use choreo_image_diff::compare;
use choreo_image_diff::flip;
use choreo_plugin::{Frame, Registry};
use choreo_render::{CpuRenderer, GpuOptions, Plan, Renderer, VulkanRenderer};
use choreo_script::{ScriptOptions, run_text};
use choreo_stage::Stage;
use std::cell::RefCell;
use std::path::Path;
use std::sync::Arc;

/// Differences beyond this many steps of 255 are visible side by side.
const TOLERANCE: u8 = 8;

/// Stage of a script that uses no files.
pub(crate) fn stage(text: &str, registry: &Registry) -> Result<Arc<Stage>, String> {
    let script = run_text("report.rhai", text, Path::new("."), registry, &ScriptOptions::default())
        .map_err(|errors| errors.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))?;
    Ok(Arc::new(script.stage))
}

pub(crate) fn draw_frame(renderer: &mut dyn Renderer, plan: &Plan) -> Result<Frame, String> {
    renderer.submit(plan.clone()).map_err(|e| e.to_string())?;
    renderer.collect(None).map_err(|e| e.to_string())
}

/// The CPU renderer, and Vulkan if a driver is available.
pub(crate) fn renderers(registry: &Registry) -> Vec<(&'static str, Box<dyn Renderer>)> {
    let effects = registry.effects();
    let mut all: Vec<(&str, Box<dyn Renderer>)> = vec![("CPU renderer", Box::new(CpuRenderer::new(effects)))];
    let options = GpuOptions { effects: effects.to_vec(), ..GpuOptions::default() };
    if let Ok(vulkan) = VulkanRenderer::new(options) {
        all.push(("Vulkan", Box::new(vulkan)));
    }
    all
}

/// Error of an image against the reference: channel differences and ꟻLIP.
pub(crate) fn error_row(name: String, frame: &Frame, truth: &Frame) -> Result<Row, String> {
    let c = compare(frame, truth, TOLERANCE).map_err(|e| e.to_string())?;
    let seen = flip(frame, truth).map_err(|e| e.to_string())?;
    let note = format!(
        "{:.2} % of pixels beyond {TOLERANCE}, ꟻLIP mean {}, worst {}",
        c.share_beyond * 100.0,
        quantity(seen.mean),
        quantity(seen.worst)
    );
    Ok(Row::new(name)
        .error(f64::from(c.worst), c.mean)
        .at(format!("pixel {}, {}", c.worst_at[0], c.worst_at[1]))
        .note(note))
}

/// Rows with the error and the cost of each image of one scene; for timing, all images are drawn in turns. The scene must be loaded.
pub(crate) fn error_and_cost_rows(
    renderer: &mut dyn Renderer,
    methods: &[(String, Plan)],
    truth: &Frame,
    secs: f64,
) -> Result<Vec<Row>, String> {
    let mut rows = Vec::new();
    for (name, plan) in methods {
        rows.push(error_row(name.clone(), &draw_frame(renderer, plan)?, truth)?);
    }
    let plans: Vec<&Plan> = methods.iter().map(|(_, plan)| plan).collect();
    for (row, nanos) in rows.iter_mut().zip(measure_times(renderer, &plans, secs)) {
        row.nanos = Some(nanos);
    }
    Ok(rows)
}

/// Process time in nanoseconds for each plan, drawn in turns for `secs` seconds. All plans must be drawable.
pub(crate) fn measure_times(renderer: &mut dyn Renderer, plans: &[&Plan], secs: f64) -> Vec<Nanos> {
    let cell = RefCell::new(renderer);
    let case = |plan: &&Plan| {
        let (cell, plan) = (&cell, (*plan).clone());
        Case::new(1, move || drop(draw_frame(&mut **cell.borrow_mut(), &plan)))
    };
    interleaved(Clock::Process, secs, &mut plans.iter().map(case).collect::<Vec<_>>())
}

/// Encodes linear light from 0 to 1 as sRGB (IEC 61966-2-1).
pub(crate) fn srgb_from_linear(linear: f64) -> f64 {
    choreo_asset::srgb_from_linear(linear)
}
