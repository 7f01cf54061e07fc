//! Cutouts by alpha test and by alpha to coverage; transparent surfaces sorted per object and peeled per pixel.

use crate::images::{error_and_cost_rows, renderers, srgb_from_linear, stage};
use crate::{BUDGET_SECS, Section};
use choreo_bench::moment::Moment;
use choreo_bench::plots::Choice;
use choreo_bench::timing::Clock;
use choreo_motion::Time;
use choreo_plugin::Frame;
use choreo_render::{Plan, PlanOptions, SceneResources};
use choreo_stage::{Cutouts, Stage, Transparency};
use std::sync::Arc;

const SIZE: [u32; 2] = [480, 272];

pub(crate) fn section() -> Result<Section, String> {
    Ok(Section {
        title: "Cut-outs and transparent surfaces",
        text: "A cut-out by `discard` keeps or drops all samples of a pixel, so that four samples smooth \
               the edges of the mesh but not of the cut-out. With alpha to coverage it keeps as many \
               samples as lie inside, for the same shading. Transparent copies are sorted by the centers of \
               their boxes; where copies intersect no order is right, and layers are peeled from the back: \
               each layer draws its surfaces once to find them and once to blend them. The plan uses depth \
               peeling only where boxes show that sorting fails."
            .into(),
        choices: vec![compare_cutouts()?, compare_pane_transparency()?],
        tables: Vec::new(),
        off_front: Vec::new(),
    })
}

/// Adds rows for images of one scene, each compared with the reference and timed in turns.
fn add_measured_rows(
    choice: &mut Choice,
    resources: &Arc<SceneResources>,
    methods: &[(&str, Plan)],
    truth: &Frame,
) -> Result<(), String> {
    for (renderer_name, mut renderer) in renderers(&choreo::registry()) {
        renderer.load(resources.clone()).map_err(|e| e.to_string())?;
        let named = |(name, plan): &(&str, Plan)| (format!("{name}, {renderer_name}"), plan.clone());
        let methods: Vec<(String, Plan)> = methods.iter().map(named).collect();
        choice.rows.extend(error_and_cost_rows(&mut *renderer, &methods, truth, 2.0 * BUDGET_SECS)?);
    }
    choice.error_unit = "steps of 255";
    choice.by_mean = true;
    choice.per = format!("image of {}×{}, {}", SIZE[0], SIZE[1], Clock::Process.words());
    Ok(())
}

/// The stage with other settings for cutouts and transparency.
fn stage_with(stage: &Arc<Stage>, cutouts: Cutouts, transparency: Transparency) -> Arc<Stage> {
    let mut stage = Stage::clone(stage);
    stage.settings.cutouts = cutouts;
    stage.settings.transparency = transparency;
    Arc::new(stage)
}

fn plan(stage: &Arc<Stage>, resources: &SceneResources, samples: u32) -> Result<Plan, String> {
    let snapshot = stage.at(Time::ZERO).map_err(|e| e.to_string())?;
    Ok(Plan::new(resources, stage, &snapshot, &PlanOptions::new(SIZE, samples)))
}

/// Leaves on cards; the alpha edge is half a texel wide in a texture of 64 texels.
const LEAVES: &str = r##"
    stage(#{ background: "#c9d4e0" });
    let pixels = [];
    for y in 0..64 {
        for x in 0..64 {
            let u = (x + 0.5) / 64.0;
            let v = (y + 0.5) / 64.0;
            let deep = 0.4 * sqrt(sin(PI * v)) - abs(u - 0.5);
            pixels.push(50); pixels.push(110); pixels.push(40);
            pixels.push(clamp(127.5 + deep * 64.0 * 60.0, 0.0, 255.0));
        }
    }
    let leaf = shape("quad", #{ size: [0.4, 0.6], image: image(64, 64, pixels, #{ wrap: "clamp" }), alpha: "mask", unlit: true, double_sided: true });
    for i in 0..60 {
        cast(`leaf ${i}`, leaf).at(rand(3 * i, -1.6, 1.6), rand(3 * i + 1, -0.2, 1.5), rand(3 * i + 2, -1.0, 0.4))
            .rotate(0, rand(900 + i, -60, 60), rand(700 + i, 0, 360));
    }
    camera("front").fov(30).at(0.0, 0.9, 4.6).look_at([0.0, 0.9, 0.0]);
"##;

fn compare_cutouts() -> Result<Choice, String> {
    let key = "cutouts";
    let mut choice = Choice::new(key, "Which samples of a pixel does a cut-out keep? (60 leaves)");
    choice.reference =
        "64 samples a pixel, textures and cut included; mean over all channels of all pixels".into();
    let stage = stage(LEAVES, &choreo::registry())?;
    let hard = stage_with(&stage, Cutouts::Hard, Transparency::Auto);
    let moment = Moment::new(&hard, Time::ZERO, &[]).map_err(|e| e.to_string())?;
    let truth = moment.supersampled(SIZE).map_err(|e| e.to_string())?;
    let resources = Arc::new(SceneResources::new(&stage));
    let methods = [
        ("1 sample", plan(&hard, &resources, 1)?),
        ("4 samples, discard", plan(&hard, &resources, 4)?),
        ("4 samples, coverage", plan(&stage, &resources, 4)?),
    ];
    add_measured_rows(&mut choice, &resources, &methods, &truth)?;
    choice.choose(
        "4 samples, coverage, Vulkan",
        "where there are several samples a pixel; discard where the device cannot set alpha to one",
    );
    Ok(choice)
}

/// Five panes that intersect in one line, like a revolving door: rotation about y in degrees, color, alpha.
const PANES: [(f64, [f64; 3], f64); 5] = [
    (17.0, [0.8, 0.1, 0.1], 0.6),
    (53.0, [0.1, 0.3, 0.8], 0.5),
    (89.0, [0.9, 0.7, 0.1], 0.6),
    (125.0, [0.1, 0.6, 0.3], 0.5),
    (161.0, [0.7, 0.2, 0.7], 0.6),
];
/// Half width and height of a pane; distance, height and field of view (degrees) of the camera.
const DOOR_AND_CAMERA: [f64; 5] = [1.2, 1.8, 5.0, 0.9, 30.0];

fn compare_pane_transparency() -> Result<Choice, String> {
    let mut choice =
        Choice::new("transparency", "In which order are intersecting panes blended? (five through one line)");
    choice.reference =
        "rays in f64 that meet every pane, mixed by depth, 64 a pixel; mean over all channels of all pixels"
            .into();
    let [half, tall, distance, eye, fov] = DOOR_AND_CAMERA;
    let mut text = String::from("stage(#{ background: \"black\" });\n");
    for (i, (turn, [r, g, b], alpha)) in PANES.iter().enumerate() {
        let color = format!(
            "[{}, {}, {}, {alpha:?}]",
            srgb_from_linear(*r),
            srgb_from_linear(*g),
            srgb_from_linear(*b)
        );
        text += &format!(
            "cast(\"pane {i}\", shape(\"quad\", #{{ size: [{:?}, {tall:?}], color: {color}, alpha: \"blend\", unlit: true, double_sided: true }})).turn({turn:?});\n",
            2.0 * half,
        );
    }
    text += &format!(
        "camera(\"front\").fov({fov:?}).at(0.0, {eye:?}, {distance:?}).look_at([0.0, {eye:?}, 0.0]);\n"
    );
    let stage = stage(&text, &choreo::registry())?;
    let resources = Arc::new(SceneResources::new(&stage));
    let of = |how| plan(&stage_with(&stage, Cutouts::Smooth, how), &resources, 4);
    let mut fewer = of(Transparency::Independent)?;
    if let Some(peel) = &mut fewer.depth_peeling {
        peel.layers = 2;
    }
    let methods = [
        ("sorted", of(Transparency::Sorted)?),
        ("2 layers, the rest sorted", fewer),
        ("independent", of(Transparency::Independent)?),
    ];
    add_measured_rows(&mut choice, &resources, &methods, &reference_image())?;
    choice.choose(
        "independent, Vulkan",
        "where boxes cross or stand in the wrong order; sorted everywhere else",
    );
    Ok(choice)
}

/// Ray-traced image with 64 samples a pixel.
fn reference_image() -> Frame {
    let [width, height] = SIZE.map(|s| s as usize);
    let mut rgba = Vec::with_capacity(width * height * 4);
    for y in 0..height {
        for x in 0..width {
            let mut sum = [0.0; 3];
            for s in 0..64 {
                let at = |pixel: usize, s: usize| pixel as f64 + (s as f64 + 0.5) / 8.0;
                let mixed = reference_light(at(x, s % 8), at(y, s / 8));
                sum.iter_mut().zip(mixed).for_each(|(sum, c)| *sum += c / 64.0);
            }
            rgba.extend(sum.map(|c| (srgb_from_linear(c).clamp(0.0, 1.0) * 255.0).round() as u8));
            rgba.push(255);
        }
    }
    Frame { width: SIZE[0], height: SIZE[1], rgba }
}

/// Reference linear light along the ray through a pixel position.
fn reference_light(x: f64, y: f64) -> [f64; 3] {
    let [half, tall, distance, eye, fov] = DOOR_AND_CAMERA;
    let [width, height] = SIZE.map(f64::from);
    let scale = libm::tan(fov.to_radians() * 0.5) * 2.0 / height;
    let (right, up) = ((x - width * 0.5) * scale, (height * 0.5 - y) * scale);
    // Distance t along the view axis; the ray is offset by (right, up) · t.
    let mut met: Vec<(f64, usize)> = Vec::new();
    for (i, (turn, ..)) in PANES.iter().enumerate() {
        let (sin, cos) = libm::sincos(turn.to_radians());
        // The pane's plane: x·sin + z·cos = 0, with z = distance − t.
        let t = distance * cos / (cos - right * sin);
        let across = right * t * cos - (distance - t) * sin;
        let over = eye + up * t;
        if t > 0.0 && across.abs() < half && (0.0..tall).contains(&over) {
            met.push((t, i));
        }
    }
    met.sort_by(|a, b| b.0.total_cmp(&a.0));
    met.iter().fold([0.0; 3], |below, (_, i)| {
        let (_, color, alpha) = PANES[*i];
        std::array::from_fn(|c| below[c] * (1.0 - alpha) + color[c] * alpha)
    })
}
