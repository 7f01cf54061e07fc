//! Levels of detail of whole models: distant crowds look as with all triangles, and the cost per copy does not depend on their number.
//! `LEVELS_OUT=FOLDER cargo test -p choreo --test renders levels_of_detail -- --nocapture` writes the images.

use crate::common;
use choreo_motion::Time;
use choreo_plugin::Frame;
use choreo_render::{CpuRenderer, Plan, PlanOptions, Renderer, SceneResources};
use choreo_script::{ScriptOptions, run_text};
use choreo_stage::{Snapshot, Stage};
use std::path::Path;
use std::sync::Arc;

const SIZE: [u32; 2] = [640, 360];

fn stage(script: &str, folder: &Path) -> Stage {
    match run_text("test.rhai", script, folder, &choreo::registry(), &ScriptOptions::default()) {
        Ok(script) => script.stage,
        Err(errors) => panic!("{errors:?}"),
    }
}

/// Walkers in rows of ten.
fn crowd(model: &str, clip: &str, count: usize, distance: f64) -> String {
    format!(
        r##"
        stage(#{{ size: [640, 360], length: 2.0, background: "#8fa0b0" }});
        let model = load("{model}");
        for i in 0..{count} {{
            let x = i % 10;
            let z = i / 10;
            let w = cast("walker " + i, model).at(2.2 * (x - 4.5), 0.0, -3.0 * z).turn(23 * x + 61 * z);
            w.play(model.clip("{clip}")).from(-0.07 * i).loop();
        }}
        sun(#{{ direction: [-1.0, -1.6, -0.8] }});
        camera("front").fov(28).at(0.0, {height}, {distance}).look_at([0.0, 0.9, -6.0]);
        "##,
        height = 0.35 * distance
    )
}

fn draw(resources: &Arc<SceneResources>, plan: &Plan) -> Frame {
    let mut renderer = CpuRenderer::new(&[]);
    renderer.load(resources.clone()).unwrap();
    renderer.submit(plan.clone()).unwrap();
    renderer.collect(None).unwrap()
}

fn triangles(resources: &SceneResources, plan: &Plan) -> usize {
    let of = |p: u32| resources.primitives[p as usize].primitive().indices.len() / 3;
    plan.draws.iter().map(|d| of(d.primitive) * d.instance_count as usize).sum()
}

/// Images and numbers of triangles, with and without levels of detail.
fn draw_with_and_without_levels(
    stage: &Stage,
    resources: &Arc<SceneResources>,
    snapshot: &Snapshot,
) -> ([Frame; 2], [usize; 2]) {
    let plan = |full_detail| {
        let options = PlanOptions { full_detail, ..PlanOptions::new(SIZE, 4) };
        Plan::new(resources, stage, snapshot, &options)
    };
    let [levels, full] = [plan(false), plan(true)];
    let count = [triangles(resources, &levels), triangles(resources, &full)];
    ([draw(resources, &levels), draw(resources, &full)], count)
}

/// The mean color of the pixels that are not background, from 0 to 255.
fn mean_color(frame: &Frame) -> [f64; 3] {
    let ground = frame.rgba[..3].to_vec();
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    for p in frame.rgba.chunks_exact(4).filter(|p| p[..3] != ground[..]) {
        (0..3).for_each(|i| sum[i] += f64::from(p[i]));
        count += 1.0;
    }
    sum.map(|s| s / count)
}

fn save_image(name: &str, frame: &Frame) {
    if let Ok(folder) = std::env::var("LEVELS_OUT") {
        let path = Path::new(&folder).join(name);
        image::save_buffer(path, &frame.rgba, frame.width, frame.height, image::ColorType::Rgba8).unwrap();
    }
}

/// Model, clip, distance, and the largest allowed share of the triangles.
const CROWDS: [(&str, &str, f64, f64); 4] = [
    ("gltf/Knight.glb", "Walking_A", 40.0, 0.75),
    ("gltf/Knight.glb", "Walking_A", 80.0, 0.5),
    ("choreo:mannequin", "Walk", 40.0, 0.75),
    ("choreo:mannequin", "Walk", 80.0, 0.5),
];
/// Limits for the mean FLIP error of the image, and for the error of the mean color of the crowd on the scale to 255.
const FLIP: f64 = 0.012;
const COLOR: f64 = 2.5;

#[test]
fn crowds_from_afar_look_as_with_all_triangles() {
    let Some(folder) = common::sample_assets_folder() else { return };
    for (model, clip, distance, most) in CROWDS {
        let stage = stage(&crowd(model, clip, 60, distance), &folder);
        let resources = Arc::new(SceneResources::new(&stage));
        let snapshot = stage.at(Time::from_secs(0.4)).unwrap();
        let different = |resources: &Arc<SceneResources>, name: &str| {
            let ([levels, full], [few, all]) = draw_with_and_without_levels(&stage, resources, &snapshot);
            let flip = choreo_image_diff::flip(&levels, &full).unwrap().mean;
            let [a, b] = [mean_color(&levels), mean_color(&full)];
            let color = (0..3).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max);
            println!(
                "{model} at {distance} m, {name}: {few} of {all} triangles, FLIP {flip:.4}, color {color:.2}"
            );
            let file = model.rsplit(['/', ':']).next().unwrap();
            save_image(&format!("{file}-{distance}-{name}.png"), &levels);
            save_image(&format!("{file}-{distance}-full.png"), &full);
            (few as f64 / all as f64, flip, color)
        };
        let (left, flip, color) = different(&resources, "levels");
        assert!(left <= most, "{model} at {distance} m: {left} of the triangles");
        assert!(flip <= FLIP && color <= COLOR, "{model} at {distance} m: FLIP {flip}, color {color}");
        // If the coarsest level is used everywhere, the comparison finds it.
        let mut wrong = (*resources).clone();
        wrong.assets[0].levels.iter_mut().for_each(|level| level.error = 0.0);
        let (_, flip, color) = different(&Arc::new(wrong), "coarsest");
        assert!(flip > FLIP || color > COLOR, "{model} at {distance} m: FLIP {flip}, color {color}");
    }
}

/// The number of triangles per actor does not depend on the number of actors.
#[test]
fn costs_do_not_jump_at_a_number_of_copies() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let of_one = |count: usize| {
        let stage = stage(&crowd("choreo:mannequin", "Walk", count, 80.0), folder);
        let resources = SceneResources::new(&stage);
        let snapshot = stage.at(Time::from_secs(0.4)).unwrap();
        let plan = Plan::new(&resources, &stage, &snapshot, &PlanOptions::new(SIZE, 1));
        triangles(&resources, &plan) as f64 / count as f64
    };
    let counts = [10, 40, 63, 64, 100].map(|count| (count, of_one(count)));
    println!("triangles a walker: {counts:?}");
    for pair in counts.windows(2) {
        assert!((0.7..1.4).contains(&(pair[0].1 / pair[1].1)), "{pair:?}");
    }
    let levels_off = crowd("choreo:mannequin", "Walk", 64, 80.0)
        .replace("length: 2.0", "length: 2.0, levels_of_detail: false");
    let resources = SceneResources::new(&stage(&levels_off, folder));
    assert!(resources.assets.iter().all(|asset| asset.levels.is_empty()));
}
