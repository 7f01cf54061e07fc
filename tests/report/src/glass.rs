//! Thick glass: refraction of the background behind a pane.

use crate::images::{draw_frame, srgb_from_linear, stage};
use crate::{BUDGET_SECS, Section};
use choreo_asset::Image;
use choreo_bench::plots::{Cell, Choice, Row, Table, quantity};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_motion::Time;
use choreo_render::{CpuRenderer, Plan, PlanOptions, Renderer, SceneResources};
use glam::{DVec2, DVec3};
use std::cell::RefCell;
use std::f64::consts::TAU;
use std::sync::Arc;

const SIZE: [u32; 2] = [320, 180];
const WALL_SIDE_TEXELS: usize = 1024;
/// Side of the wall in metres, and number of waves over it.
const WALL_SIDE: f64 = 6.0;
const WAVE_COUNT: f64 = 24.0;
/// Distance of the camera from the middle of the pane in metres, its field of view in degrees, and rotation of the pane about y in degrees.
const CAMERA_DISTANCE: f64 = 3.0;
const FOV: f64 = 22.0;
const PANE_YAW_DEGREES: f64 = 35.0;
const PANE_THICKNESS: f64 = 0.25;
const IOR: f64 = 1.5;
/// Distances in metres from the middle of the pane to the wall.
const WALL_DISTANCES: [f64; 4] = [1.0, 1.5, 2.5, 4.0];
const RAYS_PER_PIXEL_SIDE: usize = 4;
const METHODS: [&str; 3] = ["not bent", "bent once, scene color copy", "no pane: the texture alone"];

fn wall_light(at: DVec2) -> f64 {
    let wave = |x: f64| libm::sin(TAU * WAVE_COUNT * x / WALL_SIDE);
    0.5 + 0.45 * wave(at.x) * wave(at.y)
}

/// Point on the wall that a camera ray through a pixel position reaches.
fn wall_at(x: f64, y: f64, wall: f64, pane: bool) -> DVec2 {
    let [width, height] = SIZE.map(f64::from);
    let scale = 2.0 * libm::tan(FOV.to_radians() * 0.5) / height;
    let direction = DVec3::new((x - 0.5 * width) * scale, (0.5 * height - y) * scale, -1.0).normalize();
    let mut from = DVec3::new(0.0, 0.0, CAMERA_DISTANCE);
    if pane {
        let (sin, cos) = libm::sincos(PANE_YAW_DEGREES.to_radians());
        let normal = DVec3::new(sin, 0.0, cos);
        let cosine = -normal.dot(direction);
        // Snell's law. The second face is parallel, so the ray leaves in its original direction.
        let inside = (1.0 - (1.0 - cosine * cosine) / (IOR * IOR)).sqrt();
        let bent = direction / IOR + normal * (cosine / IOR - inside);
        from = from + direction * (from.dot(normal) / cosine) + bent * (PANE_THICKNESS / inside);
    }
    (from + direction * ((-wall - from.z) / direction.z)).truncate()
}

/// Reference linear light of a pixel, averaged over rays.
fn reference_light(pixel: [u32; 2], wall: f64, pane: bool) -> f64 {
    let place = |pixel: u32, ray: usize| f64::from(pixel) + (ray as f64 + 0.5) / RAYS_PER_PIXEL_SIDE as f64;
    let sum = (0..RAYS_PER_PIXEL_SIDE * RAYS_PER_PIXEL_SIDE).map(|ray| {
        wall_light(wall_at(
            place(pixel[0], ray % RAYS_PER_PIXEL_SIDE),
            place(pixel[1], ray / RAYS_PER_PIXEL_SIDE),
            wall,
            pane,
        ))
    });
    sum.sum::<f64>() / (RAYS_PER_PIXEL_SIDE * RAYS_PER_PIXEL_SIDE) as f64
}

struct Scene {
    resources: Arc<SceneResources>,
    plan: Plan,
}

/// Scene for a method; the pane is large enough to fill the image.
fn scene(method: usize, wall: f64) -> Result<Scene, String> {
    let thickness = if method == 1 { PANE_THICKNESS } else { 0.0 };
    // The pane transmits all light, since reflection is not measured here.
    let pane = format!(
        "cast(\"pane\", shape(\"quad\", #{{ size: 8.0, color: \"white\", transmission: 1.0, roughness: 0.0, thickness: {thickness:?}, ior: {IOR:?} }})).at(0.0, -4.0, 0.0).turn({PANE_YAW_DEGREES:?});"
    );
    let text = format!(
        "stage(#{{ background: \"black\", view: \"none\" }});
         cast(\"wall\", shape(\"quad\", #{{ size: {WALL_SIDE:?}, image: image(1, 1, [0, 0, 0, 255]), unlit: true }})).at(0.0, {:?}, {:?});
         {}
         ambient(\"black\");
         camera(\"c\").fov({FOV:?}).at(0.0, 0.0, {CAMERA_DISTANCE:?}).look_at([0.0, 0.0, 0.0]);",
        -0.5 * WALL_SIDE,
        -wall,
        if method == 2 { "" } else { &pane },
    );
    let mut stage = stage(&text, &choreo::registry())?;
    let actors = &mut Arc::make_mut(&mut stage).actors;
    let asset = Arc::make_mut(&mut actors[0].asset);
    let place = |i: usize| (i as f64 + 0.5) / WALL_SIDE_TEXELS as f64 * WALL_SIDE - 0.5 * WALL_SIDE;
    let mut rgba = Vec::with_capacity(WALL_SIDE_TEXELS * WALL_SIDE_TEXELS * 4);
    for (y, x) in (0..WALL_SIDE_TEXELS).flat_map(|y| (0..WALL_SIDE_TEXELS).map(move |x| (y, x))) {
        let code = (srgb_from_linear(wall_light(DVec2::new(place(x), -place(y)))) * 255.0).round() as u8;
        rgba.extend([code, code, code, 255]);
    }
    let side = WALL_SIDE_TEXELS as u32;
    asset.images[0] = Arc::new(Image { name: "waves".into(), width: side, height: side, rgba, file: None });
    asset.derived = Default::default();
    for actor in &mut actors[1..] {
        let asset = Arc::make_mut(&mut actor.asset);
        asset.materials.iter_mut().for_each(|material| material.specular = 0.0);
        asset.derived = Default::default();
    }
    let resources = Arc::new(SceneResources::new(&stage));
    let snapshot = stage.at(Time::ZERO).map_err(|e| e.to_string())?;
    let plan = Plan::new(&resources, &stage, &snapshot, &PlanOptions::new(SIZE, 1));
    Ok(Scene { resources, plan })
}

pub(crate) fn section() -> Result<Section, String> {
    let mut choice = Choice::new("glass", "Where is the background read behind a pane 0.25 m thick?");
    choice.error_unit = "steps of 255";
    choice.by_mean = true;
    choice.reference = format!(
        "Snell's law at both faces in f64, {} rays a pixel; walls with waves {} to {} m behind the pane, which is turned by {PANE_YAW_DEGREES}°",
        RAYS_PER_PIXEL_SIDE * RAYS_PER_PIXEL_SIDE,
        WALL_DISTANCES[0],
        WALL_DISTANCES[3],
    );
    choice.per = format!("image of {}×{}, CPU renderer, {}", SIZE[0], SIZE[1], Clock::Process.words());
    let titles: Vec<String> = WALL_DISTANCES.iter().map(|wall| format!(">{wall} m")).collect();
    let mut columns: Vec<(&str, &'static str)> = vec![("mean steps of 255, wall behind the pane at", "way")];
    columns.extend(titles.iter().map(|title| (title.as_str(), "wall")));
    let mut table = Table::new("By the distance of the wall behind the pane", &columns);
    let mut timed = Vec::new();
    for (method, name) in METHODS.into_iter().enumerate() {
        let (mut all, mut cells) = (ErrorStats::default(), vec![Cell::text(name)]);
        for wall in WALL_DISTANCES {
            let scene = scene(method, wall)?;
            let mut renderer = CpuRenderer::new(&[]);
            renderer.load(scene.resources.clone()).map_err(|e| e.to_string())?;
            let frame = draw_frame(&mut renderer, &scene.plan)?;
            let mut error = ErrorStats::default();
            for (i, got) in (0..).zip(frame.rgba.chunks_exact(4)) {
                let truth =
                    (srgb_from_linear(reference_light([i % SIZE[0], i / SIZE[0]], wall, method != 2))
                        * 255.0)
                        .round();
                error.add((f64::from(got[0]) - truth).abs());
                all.add((f64::from(got[0]) - truth).abs());
            }
            cells.push(Cell::number(quantity(error.mean()), error.mean()));
            if wall == WALL_DISTANCES[0] && method < 2 {
                timed.push((RefCell::new(renderer), scene.plan));
            }
        }
        table.rows.push(cells);
        if method < 2 {
            choice.rows.push(Row::new(name).error(all.worst, all.mean()));
        }
    }
    let mut cases = Vec::new();
    for (renderer, plan) in &timed {
        cases.push(Case::new(1, move || {
            drop(std::hint::black_box(draw_frame(&mut *renderer.borrow_mut(), plan)));
        }));
    }
    let nanos = interleaved(Clock::Process, 2.0 * BUDGET_SECS, &mut cases);
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    choice.choose(METHODS[1], "the only one that bends the view, with one lookup in the copy");
    Ok(Section {
        title: "Glass",
        text: "The renderer bends a ray once, follows it through the thickness, and reads the scene color \
               copy at that place. That is exact where the wall touches the pane; farther away the ray \
               leaves the pane in a direction that the copy does not contain, and slanted rays travel a \
               little farther inside. The last row shows the error of the texture itself, without a pane."
            .into(),
        choices: vec![choice],
        tables: vec![table],
        off_front: Vec::new(),
    })
}
