//! Lines, triangles and hulls of effects: positions, order, and equal images in both renderers.

use crate::common;
use crate::common::*;
use choreo_asset::*;
use choreo_image_diff::compare;
use choreo_motion::Time;
use choreo_plugin::Effect;
use choreo_render::plan::OverlayVertex;
use choreo_render::plan::motion_blur::plan_with;
use choreo_render::*;
use choreo_stage::*;
use choreo_wgsl_effect::WgslEffect;
use glam::{DAffine3, DQuat, DVec3, Vec3, Vec4};
use std::sync::Arc;

const LINE: &str = "fn effect(index: u32, actor: ActorSample, p: array<f32, 8>) -> Line";
const TRIANGLE: &str = "fn effect(index: u32, actor: ActorSample, p: array<f32, 8>) -> Triangle";
const RED: [f64; 3] = [1.0, 0.0, 0.0];
const GREEN: [f64; 3] = [0.0, 1.0, 0.0];

fn effect(name: &str, head: &str, gives: &str, body: &str) -> Effect {
    let text = format!(
        "// effect: {name}\n// param amount = 0.5 in -10..10: how much\n{head}\n{gives} {{\n{body}\n}}\n"
    );
    WgslEffect::from_text("my.wgsl", &text).unwrap_or_else(|e| panic!("{e}\n{text}")).into()
}

fn test_effects() -> Vec<Effect> {
    // A square metre in two triangles, the first index nearer by `amount`, red and green.
    let square = "let half = index / 2u;\n\
        let z = actor.position.z + select(0.0, p[amount], half == 0u);\n\
        let color = select(vec4(0.0, 1.0, 0.0, 1.0), vec4(1.0, 0.0, 0.0, 1.0), half == 0u);\n\
        let side = select(-0.5, 0.5, index % 2u == 0u);\n\
        return Triangle(actor.position.xyz * vec3(1.0, 1.0, 0.0) + vec3(-0.5, -0.5, z), \
            actor.position.xyz * vec3(1.0, 1.0, 0.0) + vec3(0.5, 0.5, z), \
            actor.position.xyz * vec3(1.0, 1.0, 0.0) + vec3(side, -side, z), color);";
    let fan = "let t = 6.2831853 * f32(index) / 24.0;\n\
        let at = actor.position + vec3(0.9 * cos(t), 0.7 * sin(t), 0.6 * sin(2.0 * t));\n\
        let next = actor.position + vec3(0.9 * cos(t + 0.3), 0.7 * sin(t + 0.3), 0.2);\n\
        return Triangle(actor.position, at, next, vec4(0.5 + 0.5 * cos(t), 0.4, 0.5 + 0.5 * sin(t), p[amount]));";
    vec![
        effect("square", "// hook: overlay\n// count: 4", TRIANGLE, square),
        effect("square_over", "// hook: overlay\n// count: 4\n// over: true", TRIANGLE, square),
        effect("fan", "// hook: overlay\n// count: 24", TRIANGLE, fan),
        // A triangle from behind the camera to far in front of it.
        effect(
            "long",
            "// hook: overlay\n// count: 2\n// of: scene",
            TRIANGLE,
            "return Triangle(vec3(-9.0, -0.6, 20.0), vec3(9.0, -0.6, 20.0), vec3(f32(index), -0.6, -60.0), vec4(0.3, 0.3, 0.1, 0.5));",
        ),
        effect(
            "ring",
            "// hook: overlay\n// count: 40",
            LINE,
            "let t = 6.2831853 * f32(index) / 40.0;\n\
             return Line(actor.position + 0.8 * vec3(cos(t), 0.0, sin(t)), actor.position + 0.8 * vec3(cos(t + 0.15), 0.0, sin(t + 0.15)), 3.0, vec4(1.0, 0.9, 0.2, p[amount]));",
        ),
        effect(
            "wake",
            "// hook: overlay\n// count: 4\n// history: 3",
            LINE,
            "let at = previous_in_world(index, vec3(0.0)); return Line(at, at, 3.0, vec4(1.0));",
        ),
        effect(
            "hull",
            "// hook: outline",
            "fn effect(p: array<f32, 8>) -> InvertedHull",
            "return InvertedHull(8.0 * p[amount], vec3(0.1, 0.8, 0.2), 0.0);",
        ),
        effect(
            "net",
            "// hook: outline",
            "fn effect(p: array<f32, 8>) -> Wireframe",
            "return Wireframe(vec3(p[amount], 0.0, 1.0));",
        ),
    ]
}

fn options(effects: &[Effect], samples: u32) -> PlanOptions<'_> {
    PlanOptions { effects, ..PlanOptions::new([200, 150], samples) }
}

/// A scene with an effect, and a white wall at depth `z` behind it, in front of it, or far away.
fn with_wall(z: f64, name: &str, amount: f64) -> Scene {
    let mut scene = Scene::ortho(2.0);
    let nothing = Arc::new(Asset::default());
    scene.at(&nothing, 0.0, 0.0, 0.0);
    scene.at(&asset(vec![quad(2.0, 2.0)], vec![unlit(Vec4::ONE)], vec![]), 0.0, 0.0, z);
    use_effect(&mut scene, name, &[("amount", amount)], &[0]);
    scene
}

#[test]
fn overlay_triangles_are_depth_tested_and_sorted() {
    let effects = test_effects();
    let middle = |scene: &Scene| {
        let frame = draw(scene, &options(&effects, 1));
        let [at, outside] = [(100, 75), (20, 75)].map(|(x, y)| pixel(&frame, x, y));
        assert_eq!(outside, [255; 4], "a square metre of two");
        at
    };
    for samples in [1, 4] {
        let scene = with_wall(-1.0, "square", 0.5);
        let frame = draw(&scene, &options(&effects, samples));
        // At 75 pixels per metre the square ends 37.5 pixels from the center, and its diagonal has no seam.
        for (x, y) in [(63, 75), (136, 75), (100, 38), (100, 111), (100, 75), (90, 65), (110, 85)] {
            assert_color(pixel(&frame, x, y), RED, &format!("{x} {y}"));
        }
        for (x, y) in [(61, 75), (138, 75), (100, 36), (100, 113)] {
            assert_eq!(pixel(&frame, x, y), [255; 4], "{x} {y}");
        }
    }
    // The nearer triangle is visible whether it is drawn first or last.
    assert_color(middle(&with_wall(-1.0, "square", 0.5)), RED, "red is nearer");
    assert_color(middle(&with_wall(-1.0, "square", -0.5)), GREEN, "green is nearer");
    assert_eq!(middle(&with_wall(1.0, "square", 0.5)), [255; 4], "behind the wall");
    assert_color(middle(&with_wall(0.25, "square", 0.5)), RED, "half of it behind the wall");
    assert_color(middle(&with_wall(1.0, "square_over", 0.5)), RED, "over the wall");
}

#[test]
fn scenes_without_visible_overlays_plan_no_triangles() {
    let effects = test_effects();
    let vertices = |scene: &Scene| scene.plan(&options(&effects, 1)).1.overlay.vertices.len();
    let mut scene = with_wall(-1.0, "square", 0.5);
    assert_eq!(vertices(&scene), 12);
    scene.snapshot.actors[0].world_from_model.translation.x = 3.0;
    assert_eq!(vertices(&scene), 0);
    scene.snapshot.actors[0].visible = false;
    scene.snapshot.actors[0].world_from_model.translation.x = 0.0;
    assert_eq!(vertices(&scene), 0);
    // A hull without width, and one with a width.
    let hulls = |amount: f64| {
        let mut scene = Scene::ortho(2.0);
        scene.at(&asset(vec![quad(0.5, 0.5)], vec![matte(Vec4::ONE)], vec![]), 0.0, 0.0, 0.0);
        use_effect(&mut scene, "hull", &[("amount", amount)], &[]);
        scene.plan(&options(&effects, 1)).1.draws.len()
    };
    assert_eq!([hulls(0.0), hulls(0.5)], [1, 2]);
}

/// Centers in metres, from left to right, of the points around a character that moves at 1 m/s.
fn positions_of_history_lines(time: Time) -> Vec<f64> {
    let effects = test_effects();
    let at = |time: Time| {
        let mut scene = Scene::ortho(2.0);
        scene.at(&Arc::new(Asset::default()), time.as_secs(), 0.0, 0.0);
        use_effect(&mut scene, "wake", &[], &[0]);
        scene.snapshot.time = time;
        scene
    };
    let scene = at(time);
    let (resources, options) = (scene.resources(), options(&effects, 1));
    let made = plan_with::<()>(&resources, &scene.stage, time, &options, |time| Ok(at(time).snapshot));
    let corners = made.unwrap().1.overlay.vertices;
    // Four of six corners of each; the image is 8/3 m wide.
    let middle = |c: &[OverlayVertex]| [0, 1, 2, 5].map(|i| f64::from(c[i].clip.x)).iter().sum::<f64>() / 3.0;
    corners.chunks_exact(6).map(middle).collect()
}

#[test]
fn overlays_read_the_history_of_actors() {
    let near = |got: Vec<f64>, expected: [f64; 4]| {
        assert!(got.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{got:?} {expected:?}");
    };
    let frames = |n: f64| Time::from_secs(n / 30.0);
    near(positions_of_history_lines(frames(12.0)), [12.0, 11.0, 10.0, 9.0].map(|n| n / 30.0));
    // Before the first frame, the first one is used.
    near(positions_of_history_lines(frames(2.0)), [2.0, 1.0, 0.0, 0.0].map(|n| n / 30.0));
}

fn scene_of_all(amount: f64) -> Scene {
    let mut scene = Scene::perspective(0.9, 5.0);
    scene.snapshot.background = Background::Color(Vec4::new(0.2, 0.3, 0.4, 1.0));
    scene.snapshot.ambient_up = Vec3::splat(0.6);
    scene.snapshot.ambient_down = Vec3::splat(0.3);
    let cube = |x: f64, turn: f64| (DVec3::new(x, 0.1, 0.0), turn);
    for (at, turn) in [cube(-1.3, 0.4), cube(0.0, 0.9), cube(1.3, -0.5)] {
        let mesh = common::layered::bulge(0.5);
        let a = asset(vec![mesh], vec![matte(Vec4::new(0.9, 0.8, 0.7, 1.0))], vec![]);
        scene.add(&a, DAffine3::from_rotation_translation(DQuat::from_rotation_y(turn), at));
    }
    use_effect(&mut scene, "fan", &[("amount", amount)], &[0, 1]);
    use_effect(&mut scene, "ring", &[("amount", 1.0)], &[1, 2]);
    use_effect(&mut scene, "long", &[], &[]);
    use_effect(&mut scene, "hull", &[], &[1]);
    use_effect(&mut scene, "net", &[], &[2]);
    scene
}

#[test]
fn vulkan_and_the_cpu_reference_draw_the_same_geometry() {
    let effects = test_effects();
    let Some(mut renderer) = vulkan(GpuOptions { effects: effects.clone(), ..GpuOptions::default() }) else {
        return;
    };
    let scene = scene_of_all(0.7);
    for samples in [1, 4] {
        let options = options(&effects, samples);
        let (vulkan, cpu) = (draw_with(&mut renderer, &scene, &options), draw(&scene, &options));
        let c = compare(&vulkan, &cpu, 2).unwrap();
        println!("{c}");
        assert!(c.mean < 0.2 && c.share_beyond < 0.01, "{samples}: {c}");
        // The planted fault, slightly more opaque triangles, is found.
        let other = draw(&scene_of_all(0.8), &options);
        let c = compare(&vulkan, &other, 2).unwrap();
        assert!(c.share_beyond > 0.02, "the comparison can fail: {c}");
    }
    let whole = PlanOptions { force_all: true, ..options(&effects, 1) };
    let c =
        compare(&draw_with(&mut renderer, &scene, &whole), &draw(&scene, &options(&effects, 1)), 2).unwrap();
    assert!(c.share_beyond < 0.01, "forced in: {c}");
}
