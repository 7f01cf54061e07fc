//! Texture filtering: minification and magnification.

use crate::images::{draw_frame, error_and_cost_rows, srgb_from_linear, stage};
use crate::{BUDGET_SECS, Section};
use choreo_asset::Image;
use choreo_bench::plots::{Cell, Choice, Table, quantity};
use choreo_bench::timing::Clock;
use choreo_motion::Time;
use choreo_plugin::{Frame, Registry};
use choreo_render::{CpuRenderer, GpuOptions, Plan, PlanOptions, Renderer, SceneResources, VulkanRenderer};
use choreo_stage::Stage;
use std::f64::consts::TAU;
use std::sync::Arc;

const SIZE: [u32; 2] = [320, 180];
/// Texels along a side, and number of waves over it.
const GROUND_SIDE_TEXELS: usize = 1024;
const WAVE_COUNT: f64 = 64.0;
/// Side of the ground in metres; height in metres and field of view in degrees of the camera above its near edge.
const GROUND_SIDE: f64 = 60.0;
const CAMERA_HEIGHT: f64 = 1.5;
const FOV: f64 = 40.0;
/// Number of rays along a side of a pixel.
const RAYS_PER_PIXEL_SIDE: usize = 16;
/// Rows of the image from the top, grouped by distance.
const BANDS: [(&str, std::ops::Range<u32>); 3] =
    [("far, 19 m to 52 m", 94..102), ("middle, 6 m to 19 m", 102..130), ("near, below 6 m", 130..180)];

/// Light of the ground at positions given as fractions of its sides.
fn ground_light(u: f64, v: f64) -> f64 {
    0.5 + 0.45 * libm::sin(TAU * WAVE_COUNT * u) * libm::sin(TAU * WAVE_COUNT * v)
}

/// Reference: averages of the pixels below the horizon that show only the ground; alpha is 0 elsewhere.
fn reference_image() -> Frame {
    let [width, height] = SIZE.map(f64::from);
    let scale = 2.0 * libm::tan(FOV.to_radians() * 0.5) / height;
    let mut rgba = Vec::new();
    for (y, x) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (y, x))) {
        let (mut sum, mut met) = (0.0, 0);
        for ray in 0..RAYS_PER_PIXEL_SIDE * RAYS_PER_PIXEL_SIDE {
            let place =
                |pixel: u32, ray: usize| f64::from(pixel) + (ray as f64 + 0.5) / RAYS_PER_PIXEL_SIDE as f64;
            let right = (place(x, ray % RAYS_PER_PIXEL_SIDE) - 0.5 * width) * scale;
            let down = (place(y, ray / RAYS_PER_PIXEL_SIDE) - 0.5 * height) * scale;
            let ahead = CAMERA_HEIGHT / down;
            let (u, v) = (0.5 + ahead * right / GROUND_SIDE, 1.0 - ahead / GROUND_SIDE);
            if down > 0.0 && (0.0..1.0).contains(&u) && (0.0..1.0).contains(&v) {
                (sum, met) = (sum + ground_light(u, v), met + 1);
            }
        }
        let all = met == RAYS_PER_PIXEL_SIDE * RAYS_PER_PIXEL_SIDE;
        let code = (srgb_from_linear(sum / (RAYS_PER_PIXEL_SIDE * RAYS_PER_PIXEL_SIDE) as f64) * 255.0)
            .round() as u8;
        rgba.extend(if all { [code, code, code, 255] } else { [0; 4] });
    }
    Frame { width: SIZE[0], height: SIZE[1], rgba }
}

/// The ground with these settings for linear filtering and mipmaps.
fn ground(registry: &Registry, linear: bool, mip_linear: Option<bool>) -> Result<Arc<Stage>, String> {
    let text = format!(
        "stage(#{{ background: \"black\", view: \"none\" }});
         cast(\"ground\", shape(\"plane\", #{{ size: {GROUND_SIDE:?}, image: image(1, 1, [0, 0, 0, 255]), unlit: true }})).at(0.0, 0.0, {:?});
         camera(\"c\").fov({FOV:?}).at(0.0, {CAMERA_HEIGHT:?}, 0.0).look_at([0.0, {CAMERA_HEIGHT:?}, -10.0]);",
        -0.5 * GROUND_SIDE
    );
    let mut stage = stage(&text, registry)?;
    let asset = Arc::make_mut(&mut Arc::make_mut(&mut stage).actors[0].asset);
    let mut rgba = Vec::with_capacity(GROUND_SIDE_TEXELS * GROUND_SIDE_TEXELS * 4);
    let share = |i: usize| (i as f64 + 0.5) / GROUND_SIDE_TEXELS as f64;
    for (y, x) in (0..GROUND_SIDE_TEXELS).flat_map(|y| (0..GROUND_SIDE_TEXELS).map(move |x| (y, x))) {
        let code = (srgb_from_linear(ground_light(share(x), share(y))) * 255.0).round() as u8;
        rgba.extend([code, code, code, 255]);
    }
    let side = GROUND_SIDE_TEXELS as u32;
    asset.images[0] = Arc::new(Image { name: "waves".into(), width: side, height: side, rgba, file: None });
    let texture = asset.materials[0].base_color_texture.as_mut().ok_or("the ground has no texture")?;
    let sampler = &mut texture.sampler;
    (sampler.mag_linear, sampler.min_linear, sampler.mip_linear) = (linear, linear, mip_linear);
    asset.derived = Default::default();
    Ok(stage)
}

fn plan(stage: &Arc<Stage>, resources: &SceneResources) -> Result<Plan, String> {
    let snapshot = stage.at(Time::ZERO).map_err(|e| e.to_string())?;
    Ok(Plan::new(resources, stage, &snapshot, &PlanOptions::new(SIZE, 1)))
}

/// Mean error in steps of 255 over the reference pixels in some rows.
fn mean_band_error(frame: &Frame, truth: &Frame, rows: &std::ops::Range<u32>) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    let bytes = |row: u32| (row * SIZE[0] * 4) as usize;
    let range = bytes(rows.start)..bytes(rows.end);
    for (got, exact) in frame.rgba[range.clone()].chunks_exact(4).zip(truth.rgba[range].chunks_exact(4)) {
        if exact[3] == 255 {
            (sum, count) = (sum + f64::from(got[0].abs_diff(exact[0])), count + 1);
        }
    }
    sum / f64::from(count.max(1))
}

/// The image where the reference has a value, and the reference elsewhere.
fn mask_with_reference(frame: &Frame, truth: &Frame) -> Frame {
    let pixels = frame.rgba.chunks_exact(4).zip(truth.rgba.chunks_exact(4));
    let rgba = pixels.flat_map(|(got, exact)| if exact[3] == 255 { got } else { exact }).copied().collect();
    Frame { rgba, ..truth.clone() }
}

pub(crate) fn section() -> Result<Section, String> {
    let registry = choreo::registry();
    let truth = reference_image();
    let mut choice =
        Choice::new("texture_filters", "How is a texture read? (waves on a ground to the horizon)");
    choice.error_unit = "steps of 255";
    choice.by_mean = true;
    choice.reference = format!(
        "the waves themselves by {} rays a pixel in f64; mean over all channels of the pixels that see nothing but the ground",
        RAYS_PER_PIXEL_SIDE * RAYS_PER_PIXEL_SIDE
    );
    choice.per = format!("image of {}×{}, {}", SIZE[0], SIZE[1], Clock::Process.words());
    let mut table = Table::new(
        "By the distance, mean steps of 255",
        &[
            ("way", "way"),
            (">far, 19 m to 52 m", "far"),
            (">middle, 6 m to 19 m", "middle"),
            (">near, below 6 m", "near"),
        ],
    );
    let methods: [(&str, bool, Option<bool>, Option<f32>); 6] = [
        ("nearest texel", false, None, None),
        ("bilinear", true, None, None),
        ("bilinear, nearest level", true, Some(false), None),
        ("trilinear, CPU renderer", true, Some(true), None),
        ("trilinear, Vulkan", true, Some(true), Some(1.0)),
        ("anisotropic, at most 16 times, Vulkan", true, Some(true), Some(16.0)),
    ];
    for (name, linear, mip_linear, anisotropy) in methods {
        let stage = ground(&registry, linear, mip_linear)?;
        let resources = Arc::new(SceneResources::new(&stage));
        let mut renderer: Box<dyn Renderer> = match anisotropy {
            None => Box::new(CpuRenderer::new(&[])),
            Some(_) => match VulkanRenderer::new(GpuOptions { anisotropy, ..GpuOptions::default() }) {
                Ok(vulkan) => Box::new(vulkan),
                Err(_) => continue,
            },
        };
        renderer.load(resources.clone()).map_err(|e| e.to_string())?;
        let plan = plan(&stage, &resources)?;
        let frame = mask_with_reference(&draw_frame(&mut *renderer, &plan)?, &truth);
        let mut row =
            error_and_cost_rows(&mut *renderer, &[(name.into(), plan)], &truth, BUDGET_SECS)?.remove(0);
        let of_ground = crate::images::error_row(name.into(), &frame, &truth)?;
        (row.worst, row.mean, row.at, row.note) =
            (of_ground.worst, of_ground.mean, of_ground.at, String::new());
        choice.rows.push(row);
        let number = |n: f64| Cell::number(quantity(n), n);
        let cells = BANDS.iter().map(|(_, rows)| number(mean_band_error(&frame, &truth, rows)));
        table.rows.push([Cell::text(name)].into_iter().chain(cells).collect());
    }
    choice.choose(
        "anisotropic, at most 16 times, Vulkan",
        "on GPUs, which read sixteen texels at once; the CPU renderer and drivers that draw on the CPU read trilinear",
    );
    Ok(Section {
        title: "Texture filters",
        text: "Far away a pixel covers many texels, and along the view ten times as many as across. Without \
               mipmaps it reads one of them (aliasing); a level as coarse as the longer side of the pixel \
               blurs along the shorter one; anisotropic filtering reads the level of the shorter side \
               several times along the longer one."
            .into(),
        choices: vec![choice],
        tables: vec![table],
        off_front: Vec::new(),
    })
}
