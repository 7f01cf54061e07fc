//! Multisampling: smoothness of edges by samples per pixel.

use crate::{BUDGET_SECS, Section, scenes};
use choreo_bench::moment::Moment;
use choreo_bench::plots::{Cell, Table, quantity};
use choreo_bench::scene::renderer;
use choreo_bench::scene::{MeasuredScene, SceneChoices};
use choreo_motion::Time;
use choreo_render::{CpuRenderer, DeviceKind, GpuOptions, Renderer, VulkanRenderer};

pub(crate) fn section() -> Result<Section, String> {
    let registry = choreo::registry();
    let stage = scenes::stage_of_script("01_first_dance.rhai", &registry)?;
    let at = Time::from_secs(5.0);
    let moment = Moment::new(&stage, at, registry.effects()).map_err(|e| e.to_string())?;
    let mut renderers: Vec<Box<dyn Renderer>> = vec![Box::new(CpuRenderer::new(registry.effects()))];
    let options = GpuOptions { effects: registry.effects().to_vec(), ..GpuOptions::default() };
    if let Ok(vulkan) = VulkanRenderer::new(options)
        && vulkan.device().kind != DeviceKind::CpuReference
    {
        renderers.push(Box::new(vulkan));
    }
    let mut scene = MeasuredScene {
        stage: &stage,
        registry: &registry,
        at,
        size: [640, 360],
        renderers,
        asks_for_vulkan: false,
        budget_secs: 4.0 * BUDGET_SECS,
    };
    let mut choices = match renderer::choices(&mut scene, &moment)? {
        SceneChoices::Choices(choices) => choices,
        SceneChoices::None(why) => return Err(why),
    };
    for choice in &mut choices {
        choice.key = "samples".into();
        choice.question =
            "Which renderer draws, with how many samples a pixel? (the first dance, 640×360)".into();
    }
    Ok(Section {
        title: "Samples a pixel",
        text: "One sample decides a whole pixel; stairs on edges are the most visible error. Four samples \
               have five levels. Of the error that remains with four, half is edges, half is texture and \
               light within a pixel, which is shaded once. Without a GPU, the CPU renderer is the default."
            .into(),
        choices,
        tables: vec![coverage_table()],
        off_front: vec![(
            "samples",
            "a Vulkan driver that draws on the CPU, too, is not used even where it is as fast for one \
             scene: the CPU renderer was faster for 40 of 47 lessons and takes a third of the memory \
             (decision 30). If there is a GPU, it is used.",
        )],
    })
}

/// Error of coverage for a straight edge through a pixel: fraction of samples inside, against the exact area.
fn coverage_table() -> Table {
    let mut table = Table::new(
        "A straight edge: error of a pixel's covered part, exact by clipping the pixel in f64",
        &[
            ("samples", "samples"),
            (">worst", "worst"),
            (">mean", "mean"),
            (">worst within 5° of upright", "upright"),
        ],
    );
    for (name, samples) in [
        ("1, the middle", CENTER_SAMPLE.to_vec()),
        ("4, Vulkan's standard places", STANDARD_4_SAMPLES.to_vec()),
        ("16, even grid", grid_samples(4)),
        ("64, even grid", grid_samples(8)),
    ] {
        let (mut worst, mut sum, mut upright, mut count) = (0.0f64, 0.0, 0.0f64, 0);
        for a in 0..720 {
            let angle = f64::from(a) * std::f64::consts::TAU / 720.0;
            let normal = [libm::cos(angle), libm::sin(angle)];
            for o in -70..=70 {
                let offset = f64::from(o) / 100.0;
                let inside = |p: &[f64; 2]| (p[0] - 0.5) * normal[0] + (p[1] - 0.5) * normal[1] < offset;
                let covered = samples.iter().filter(|p| inside(p)).count() as f64 / samples.len() as f64;
                let exact = covered_area(normal, offset);
                if exact <= 0.0 || exact >= 1.0 {
                    continue;
                }
                let error = (covered - exact).abs();
                worst = worst.max(error);
                if a % 180 < 10 || a % 180 > 170 {
                    upright = upright.max(error);
                }
                sum += error;
                count += 1;
            }
        }
        let cell = |v: f64| Cell::number(quantity(v), v);
        table.rows.push(vec![Cell::text(name), cell(worst), cell(sum / f64::from(count)), cell(upright)]);
    }
    table
}

const CENTER_SAMPLE: [[f64; 2]; 1] = [[0.5, 0.5]];
/// Vulkan 1.3 specification, table "Standard Sample Locations".
const STANDARD_4_SAMPLES: [[f64; 2]; 4] = [[0.375, 0.125], [0.875, 0.375], [0.125, 0.625], [0.625, 0.875]];

fn grid_samples(side: usize) -> Vec<[f64; 2]> {
    let at = |i: usize| (i as f64 + 0.5) / side as f64;
    (0..side * side).map(|i| [at(i % side), at(i / side)]).collect()
}

/// Area of the part of the unit square where (p − middle) · normal < offset: the square is clipped by the line (Sutherland and Hodgman),
/// and measured by the shoelace formula.
fn covered_area(normal: [f64; 2], offset: f64) -> f64 {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let distance = |p: &[f64; 2]| (p[0] - 0.5) * normal[0] + (p[1] - 0.5) * normal[1] - offset;
    let mut clipped: Vec<[f64; 2]> = Vec::new();
    for (i, a) in corners.iter().enumerate() {
        let b = &corners[(i + 1) % 4];
        let (da, db) = (distance(a), distance(b));
        if da < 0.0 {
            clipped.push(*a);
        }
        if (da < 0.0) != (db < 0.0) {
            let t = da / (da - db);
            clipped.push([a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t]);
        }
    }
    let area = |i: usize| {
        let (a, b) = (clipped[i], clipped[(i + 1) % clipped.len()]);
        a[0] * b[1] - a[1] * b[0]
    };
    (0..clipped.len()).map(area).sum::<f64>() * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_covered_area_of_simple_edges_is_exact() {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(covered_area([1.0, 0.0], 0.25), 0.75) && near(covered_area([0.0, -1.0], 0.0), 0.5));
        // A vertex of the square cut off at 45°: a triangle with legs of ½.
        let s = std::f64::consts::FRAC_1_SQRT_2;
        assert!(near(covered_area([s, s], -0.5 * s), 0.125));
        assert!(near(covered_area([1.0, 0.0], 0.6), 1.0) && near(covered_area([1.0, 0.0], -0.6), 0.0));
    }
}
