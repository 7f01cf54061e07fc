//! Cross dissolves between cameras: a frame is the mix of the images of both cameras, in both renderers.

use crate::common::*;
use choreo_image_diff::compare;
use choreo_motion::Time;
use choreo_plugin::{Effect, Frame};
use choreo_render::plan::frame_key::frame_key;
use choreo_render::plan::motion_blur::plan_at;
use choreo_render::{CpuRenderer, GpuOptions, PlanOptions, Renderer, SceneResources};
use choreo_stage::{Camera, Cut, EffectUse, Evaluator, Layer2d, Layer2dContent, Rig, Stage};
use choreo_wgsl_effect::WgslEffect;
use glam::{DQuat, DVec2, DVec3, Vec4};
use std::sync::Arc;

const SIZE: [u32; 2] = [64, 64];

fn effects() -> Vec<Effect> {
    let by_depth = "// effect: by_depth\n// hook: image\n\
        fn effect(at: vec2<i32>, pass_number: u32, p: Parameters) -> vec4<f32> { return vec4(vec3(depth_at(at) / 16.0), 1.0); }";
    let by_depth = WgslEffect::from_text("by_depth.wgsl", by_depth).unwrap_or_else(|e| panic!("{e}"));
    let mut all = effects::named(&["motion_blur", "vignette"]);
    all.push(by_depth.into());
    all
}

/// Two cameras that show a red and a green quad, a vignette on the second camera's frames, and a white panel over both.
fn scene() -> Stage {
    let mut scene = Scene::ortho(8.0);
    for (x, color) in [(-20.0, Vec4::new(1.0, 0.1, 0.1, 1.0)), (20.0, Vec4::new(0.1, 0.8, 0.2, 1.0))] {
        let quad = asset(vec![quad(2.0, 2.0)], vec![unlit(color)], vec![]);
        let actor = scene.at(&quad, x, 0.0, 0.0);
        scene.stage.actors[actor].transform.translation.x = x;
    }
    let mut stage = scene.stage;
    for x in [-20.0, 20.5] {
        let position = DVec3::new(x, 0.0, 8.0);
        let rig = Rig::Fixed { position, rotation: DQuat::IDENTITY, look_at: None };
        stage.shoot(Camera::new("c", rig));
    }
    stage.effects.push(EffectUse {
        plugin: "vignette".into(),
        parameters: vec![("strength".into(), 1.0)],
        cameras: vec![1],
        ..EffectUse::default()
    });
    let panel = Layer2dContent::Panel { size: DVec2::new(0.25, 0.25), color: Vec4::ONE };
    stage.layers_2d.push(Layer2d { at: DVec2::new(0.125, 0.125), ..Layer2d::new(panel) });
    stage.cuts = vec![Cut { dissolve: Time::from_secs(2.0), ..Cut::new(Time::from_secs(1.0), 1) }];
    stage
}

fn draw_at_time(stage: &Stage, secs: f64, renderer: &mut dyn Renderer) -> Frame {
    let effects = effects();
    let options = PlanOptions { effects: &effects, ..PlanOptions::new(SIZE, 4) };
    let resources = Arc::new(SceneResources::new(stage));
    let mut evaluator = Evaluator::new(Arc::new(stage.clone()));
    let (_, plan) = plan_at(&resources, &mut evaluator, Time::from_secs(secs), &options, None).unwrap();
    renderer.load(resources).unwrap();
    renderer.submit(plan).unwrap();
    renderer.collect(None).unwrap()
}

/// The frame of the stage with a single camera and without cuts.
fn draw_camera_alone(stage: &Stage, camera: usize, secs: f64, renderer: &mut dyn Renderer) -> Frame {
    let cuts = vec![Cut::new(Time::ZERO, camera)];
    draw_at_time(&Stage { cuts, ..stage.clone() }, secs, renderer)
}

/// Largest difference of any channel from the mix of two opaque images.
fn largest_difference_to_mix(frame: &Frame, a: &Frame, b: &Frame, share_of_a: f64) -> f64 {
    let mixed = a
        .rgba
        .iter()
        .zip(&b.rgba)
        .map(|(a, b)| f64::from(*a) * share_of_a + f64::from(*b) * (1.0 - share_of_a));
    frame.rgba.iter().zip(mixed).map(|(got, mixed)| (f64::from(*got) - mixed).abs()).fold(0.0, f64::max)
}

#[test]
fn a_dissolve_mixes_the_images_of_both_cameras() {
    let stage = scene();
    let mut renderer = CpuRenderer::new(&effects());
    let [first, second] = [0, 1].map(|camera| draw_camera_alone(&stage, camera, 1.5, &mut renderer));
    assert!(compare(&first, &second, 20).unwrap().share_beyond > 0.2, "the images differ");
    for (secs, share) in [(1.0, 1.0), (1.5, 0.75), (2.0, 0.5), (2.9, 0.05)] {
        let frame = draw_at_time(&stage, secs, &mut renderer);
        // Half a step of rounding.
        assert!(
            largest_difference_to_mix(&frame, &first, &second, share) <= 0.5001,
            "at {secs} s: {}",
            largest_difference_to_mix(&frame, &first, &second, share)
        );
        assert!(
            largest_difference_to_mix(&frame, &first, &second, share - 0.1) > 5.0,
            "the comparison can fail"
        );
    }
    assert_eq!(draw_at_time(&stage, 0.9, &mut renderer).rgba, first.rgba);
    assert_eq!(draw_at_time(&stage, 3.0, &mut renderer).rgba, second.rgba);
}

#[test]
fn a_dissolve_mixes_motion_blurred_images() {
    let mut stage = scene();
    stage.effects.push(EffectUse {
        plugin: "motion_blur".into(),
        cameras: Vec::new(),
        ..stage.effects[0].clone()
    });
    stage.effects[1].parameters = vec![("samples".into(), 3.0), ("shutter".into(), 360.0)];
    // The shutter is still open when the dissolve ends.
    let mut renderer = CpuRenderer::new(&effects());
    let time = 2.99;
    let [first, second] = [0, 1].map(|camera| draw_camera_alone(&stage, camera, time, &mut renderer));
    let frame = draw_at_time(&stage, time, &mut renderer);
    assert!(
        largest_difference_to_mix(&frame, &first, &second, 0.005) <= 0.51,
        "{}",
        largest_difference_to_mix(&frame, &first, &second, 0.005)
    );
}

#[test]
fn both_renderers_draw_the_same_dissolve() {
    let Some(mut renderer) = vulkan(GpuOptions { effects: effects(), ..GpuOptions::default() }) else {
        return;
    };
    let stage = scene();
    let cpu = draw_at_time(&stage, 1.7, &mut CpuRenderer::new(&effects()));
    let c = compare(&draw_at_time(&stage, 1.7, &mut renderer), &cpu, 2).unwrap();
    assert!(c.share_beyond == 0.0, "{c}");
    assert!(
        compare(&draw_at_time(&stage, 1.2, &mut renderer), &cpu, 2).unwrap().share_beyond > 0.1,
        "it can fail"
    );
}

/// An effect that reads depth gets the depth of its own camera's image.
#[test]
fn effects_read_the_scene_inputs_of_their_own_camera() {
    let mut stage = scene();
    stage.actors[1].transform.translation.z = 4.0;
    stage.effects = vec![EffectUse { plugin: "by_depth".into(), ..EffectUse::default() }];
    stage.layers_2d.clear();
    let check = |renderer: &mut dyn Renderer, bound: f64| {
        let [first, second] = [0, 1].map(|camera| draw_camera_alone(&stage, camera, 1.5, renderer));
        // The quads are 8 m and 4 m in front of their cameras.
        assert_color(pixel(&first, 32, 32), [0.5; 3], "the first camera");
        assert_color(pixel(&second, 32, 32), [0.25; 3], "the second camera");
        let frame = draw_at_time(&stage, 1.5, renderer);
        let apart = largest_difference_to_mix(&frame, &first, &second, 0.75);
        assert!(apart <= bound, "{apart}");
        assert!(largest_difference_to_mix(&frame, &first, &first, 0.75) > 5.0, "the comparison can fail");
    };
    check(&mut CpuRenderer::new(&effects()), 0.5001);
    if let Some(mut renderer) = vulkan(GpuOptions { effects: effects(), ..GpuOptions::default() }) {
        check(&mut renderer, 1.0);
    }
}

#[test]
fn frames_of_a_dissolve_have_different_keys() {
    let stage = scene();
    let resources = SceneResources::new(&stage);
    let effects = effects();
    let options = PlanOptions { effects: &effects, ..PlanOptions::new(SIZE, 4) };
    let mut evaluator = Evaluator::new(Arc::new(stage));
    let mut key = |secs: f64| {
        let (_, plan) = plan_at(&resources, &mut evaluator, Time::from_secs(secs), &options, None).unwrap();
        frame_key(&plan, &resources, &effects)
    };
    assert!(key(1.5) != key(1.6) && key(3.5) == key(3.6));
}
