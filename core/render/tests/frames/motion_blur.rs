//! Motion blur by accumulation, against closed forms; both renderers.

use crate::common::*;
use choreo_asset::Projection;
use choreo_image_diff::compare;
use choreo_motion::{Interpolation, Time};
use choreo_plugin::{Effect, EffectPlugin, EffectScene, Frame, Manifest, Overlay, OverlayEffect, Stroke};
use choreo_render::plan::motion_blur::plan_at;
use choreo_render::{CpuRenderer, GpuOptions, Plan, PlanOptions, Renderer, SceneResources};
use choreo_stage::{Camera, Channel, Evaluator, Property, Rig, Shadow, StageLight};
use glam::{DAffine3, DQuat, DVec3, Vec3, Vec4};
use std::sync::{Arc, LazyLock};

fn effects() -> Vec<Effect> {
    let mut all = effects::named(&["motion_blur", "vignette"]);
    all.push(Effect::overlay(Line));
    all
}

/// A bright quad, two metres wide, that crosses 64 pixels of an eighth of a metre in one second, which is one frame.
fn scene_with_crossing_quad() -> Scene {
    scene_with_crossing_quad_of_color(Vec4::new(4.0, 1.0, 0.25, 1.0))
}

fn scene_with_crossing_quad_of_color(color: Vec4) -> Scene {
    let mut scene = Scene::ortho(8.0);
    let quad = asset(vec![quad(1.0, 4.0)], vec![unlit(color)], vec![]);
    scene.at(&quad, 0.0, 0.0, 0.0);
    scene.stage.settings.fps.num = 1;
    scene.stage.settings.background = scene.snapshot.background;
    scene.stage.actors[0].channels.push(Channel {
        property: Property::Translation,
        interpolation: Interpolation::Linear,
        times: vec![Time::ZERO, Time::from_secs(1.0)],
        values: vec![-3.0, 0.0, 0.0, 3.0, 0.0, 0.0],
    });
    scene
}

/// The image of a stage at half a second.
fn draw_at_half_a_second(scene: &Scene, renderer: &mut dyn Renderer, samples: u32) -> Frame {
    let effects = effects();
    let options = PlanOptions { effects: &effects, ..PlanOptions::new([64, 64], samples) };
    let resources = Arc::new(SceneResources::new(&scene.stage));
    let mut evaluator = Evaluator::new(Arc::new(scene.stage.clone()));
    let camera = Some(scene.snapshot.camera);
    let (_, plan) = plan_at(&resources, &mut evaluator, Time::from_secs(0.5), &options, camera).unwrap();
    renderer.load(resources).unwrap();
    renderer.submit(plan).unwrap();
    renderer.collect(None).unwrap()
}

#[test]
fn pixel_brightness_is_the_share_of_covered_sub_frames() {
    let mut scene = scene_with_crossing_quad();
    use_effect(&mut scene, "motion_blur", &[("samples", 12.0), ("shutter", 180.0)], &[]);
    let frame = draw_at_half_a_second(&scene, &mut CpuRenderer::new(&effects()), 1);
    // The shutter is open from 0.25 s to 0.75 s: the quad's center moves from −1.5 m to 1.5 m.
    let covered = |x: u32| {
        let at = (f64::from(x) + 0.5) / 8.0 - 4.0;
        let middles = (0..12).map(|i| -1.5 + 3.0 * (f64::from(i) + 0.5) / 12.0);
        middles.filter(|middle| (at - middle).abs() < 1.0).count() as f64 / 12.0
    };
    let mut shares = std::collections::BTreeSet::new();
    for x in 0..64 {
        let share = covered(x);
        shares.insert((share * 12.0) as u32);
        // Sub-frames are not clamped before they are averaged, though the quad is brighter than white.
        let expected = [4.0 * share, share, 0.25 * share].map(|c| c.min(1.0));
        assert_dithered_color(pixel(&frame, x, 30), expected, &format!("column {x}"));
    }
    assert!(shares.len() > 5, "{shares:?}");
}

#[test]
fn full_screen_passes_and_layers_are_applied_to_the_mean() {
    let mut scene = scene_with_crossing_quad();
    use_effect(&mut scene, "motion_blur", &[("samples", 4.0), ("shutter", 360.0)], &[]);
    let plain = draw_at_half_a_second(&scene, &mut CpuRenderer::new(&effects()), 1);
    use_effect(&mut scene, "vignette", &[("strength", 1.0)], &[]);
    let dark = draw_at_half_a_second(&scene, &mut CpuRenderer::new(&effects()), 1);
    assert!(pixel(&dark, 10, 2)[0] < pixel(&plain, 10, 2)[0]);
    let resources = SceneResources::new(&scene.stage);
    let mut evaluator = Evaluator::new(Arc::new(scene.stage.clone()));
    let effects = effects();
    let options = PlanOptions { effects: &effects, ..PlanOptions::new([64, 64], 1) };
    let (_, plan) = plan_at(&resources, &mut evaluator, Time::ZERO, &options, None).unwrap();
    assert_eq!((plan.subframes.len(), plan.post.len()), (4, 1));
    assert!(plan.subframes.iter().all(|part| part.post.is_empty() && part.linear));
}

#[test]
fn both_renderers_accumulate_the_same_image() {
    let Some(mut renderer) = vulkan(GpuOptions { effects: effects(), ..GpuOptions::default() }) else {
        return;
    };
    let mut scene = scene_with_crossing_quad();
    let still = draw_at_half_a_second(&scene, &mut renderer, 4);
    use_effect(&mut scene, "motion_blur", &[("samples", 7.0)], &[]);
    use_effect(&mut scene, "vignette", &[], &[]);
    let cpu = draw_at_half_a_second(&scene, &mut CpuRenderer::new(&effects()), 4);
    let c = compare(&draw_at_half_a_second(&scene, &mut renderer, 4), &cpu, 2).unwrap();
    assert!(c.share_beyond == 0.0, "{c}");
    assert!(compare(&still, &cpu, 2).unwrap().share_beyond > 0.1, "the comparison can fail");
    // Frames with and without motion blur in one queue are collected in order.
    let all = effects();
    let options = PlanOptions { effects: &all, ..PlanOptions::new([64, 64], 4) };
    let resources = Arc::new(SceneResources::new(&scene.stage));
    renderer.load(resources.clone()).unwrap();
    let mut evaluator = Evaluator::new(Arc::new(scene.stage.clone()));
    let camera = Some(scene.snapshot.camera);
    let (_, blurred) = plan_at(&resources, &mut evaluator, Time::from_secs(0.5), &options, camera).unwrap();
    let mut plain = blurred.clone();
    plain.subframes.clear();
    plain.post.clear();
    for pair in [[&plain, &blurred], [&blurred, &plain]] {
        pair.iter().for_each(|plan| renderer.submit_plan(plan).unwrap());
        for plan in pair {
            let got = renderer.collect(None).unwrap();
            let expected = if plan.subframes.is_empty() { &still } else { &cpu };
            assert!(compare(&got, expected, 2).unwrap().share_beyond == 0.0);
        }
    }
}

static LINE: LazyLock<Manifest> = LazyLock::new(|| Manifest::new("line", "1", "for tests"));

/// Horizontal lines, five pixels wide, through the middle of the image and behind the quad.
struct Line;

impl EffectPlugin for Line {
    fn manifest(&self) -> &Manifest {
        &LINE
    }
}

impl OverlayEffect for Line {
    fn overlay(&self, _: &EffectScene, _: &[f32]) -> Overlay {
        let line = |x: f64, y: f64, z: f64| Stroke {
            from: DVec3::new(-x, y, z),
            to: DVec3::new(x, y, z),
            width: 5.0,
            color: Vec3::Y.extend(0.5),
        };
        // The last line reaches from behind the camera far beyond the image.
        let beyond = Stroke { from: DVec3::new(0.0, 0.0, 1e9), ..line(1e9, 0.0, -1e9) };
        Overlay {
            strokes: vec![line(3.0, 0.0625, 1.0), line(3.0, 2.0625, -1.0), beyond],
            ..Overlay::default()
        }
    }
}

#[test]
fn overlay_lines_cover_their_pixels_and_are_depth_tested() {
    let mut scene = scene_with_crossing_quad();
    scene.stage.actors[0].channels.clear();
    use_effect(&mut scene, "line", &[], &[]);
    let frame = draw_at_half_a_second(&scene, &mut CpuRenderer::new(&effects()), 1);
    let green = |x: u32, y: u32| decode(pixel(&frame, x, y)[1]);
    // The line's center runs through the center of row 31; on black, half of its color shows.
    for (y, share) in [(27, 0.0), (28, 0.0), (29, 0.5), (31, 0.5), (33, 0.5), (34, 0.0)] {
        assert!((green(12, y) - share).abs() < 0.01, "row {y}: {}", green(12, y));
    }
    // Over the quad, whose red is clamped to 1, the mix has half of that red.
    assert_color(pixel(&frame, 32, 31), [0.5, 1.0, 0.125], "over the quad");
    assert_color(pixel(&frame, 32, 15), [1.0, 1.0, 0.25], "the other is behind it");
    assert!((green(12, 15) - 0.5).abs() < 0.01, "and seen beside it");
    assert!(green(4, 31) < 0.01, "it ends");
    if let Some(mut renderer) = vulkan(GpuOptions { effects: effects(), ..GpuOptions::default() }) {
        let c = compare(&draw_at_half_a_second(&scene, &mut renderer, 1), &frame, 2).unwrap();
        assert!(c.share_beyond < 0.002, "{c}");
    }
}

/// The plan of a stage at half a second, with a shutter of 180° and at most 16 sub-frames.
fn plan_at_half_a_second(scene: &Scene, samples: u32, all_sub_frames: bool) -> (Arc<SceneResources>, Plan) {
    let effects = effects();
    let options = PlanOptions { effects: &effects, all_sub_frames, ..PlanOptions::new([64, 64], samples) };
    let resources = Arc::new(SceneResources::new(&scene.stage));
    let mut evaluator = Evaluator::new(Arc::new(scene.stage.clone()));
    let camera = Some(scene.snapshot.camera);
    let (_, plan) = plan_at(&resources, &mut evaluator, Time::from_secs(0.5), &options, camera).unwrap();
    (resources, plan)
}

/// Number of sub-frames of a scene, and the reason why not all are drawn.
fn sub_frames_and_reason(scene: &Scene) -> (usize, Option<String>) {
    let (_, plan) = plan_at_half_a_second(scene, 1, false);
    let why = plan.left_out.iter().find(|l| l.part == "sub-frames").map(|l| l.why.clone());
    (plan.subframes.len(), why)
}

/// A white quad that moves by `metres` while the shutter is open for half a second; a metre is eight pixels.
fn scene_with_moving_quad(metres: f64) -> Scene {
    let mut scene = scene_with_crossing_quad_of_color(Vec4::ONE);
    scene.stage.actors[0].channels[0].values = vec![-metres, 0.0, 0.0, metres, 0.0, 0.0];
    use_effect(&mut scene, "motion_blur", &[("samples", 16.0)], &[]);
    scene
}

#[test]
fn the_fastest_pixel_decides_the_number_of_sub_frames() {
    let still = Some("1 of 16: nothing visible moves while the shutter is open".to_string());
    assert_eq!(sub_frames_and_reason(&scene_with_moving_quad(0.0)), (1, still));
    let slow = Some("4 of 16: nothing moves by more than 3.2 pixels while the shutter is open".to_string());
    assert_eq!(sub_frames_and_reason(&scene_with_moving_quad(0.4)), (4, slow));
    assert_eq!(sub_frames_and_reason(&scene_with_moving_quad(0.05)).0, 1, "less than a pixel");
    assert_eq!(sub_frames_and_reason(&scene_with_moving_quad(3.0)), (16, None));
    let (_, all) = plan_at_half_a_second(&scene_with_moving_quad(0.0), 1, true);
    assert_eq!((all.subframes.len(), all.shutter_motion), (16, None));
    // A moving quad outside of the image does not count.
    let mut beside = scene_with_moving_quad(3.0);
    let values = &mut beside.stage.actors[0].channels[0].values;
    (values[1], values[4]) = (40.0, 40.0);
    assert_eq!(sub_frames_and_reason(&beside).0, 1);
}

#[test]
fn camera_motion_counts_for_static_meshes() {
    // A ground below the camera, of which only the part in view counts.
    let mut scene = Scene::perspective(0.8, 0.0);
    let ground = asset(vec![quad(500.0, 500.0)], vec![unlit(Vec4::ONE)], vec![]);
    scene.add(&ground, DAffine3::IDENTITY);
    scene.stage.actors[0].transform.rotation = DQuat::from_rotation_x(-0.5 * std::f64::consts::PI);
    scene.stage.settings.fps.num = 1;
    use_effect(&mut scene, "motion_blur", &[("samples", 16.0)], &[]);
    let counted = |rig: Rig, channels: Vec<Channel>| {
        let mut stage = scene.stage.clone();
        let projection = Projection::Perspective { yfov: 0.8, near: 0.05, far: None };
        stage.shoot(Camera { projection, channels, ..Camera::new("camera", rig) });
        let effects = effects();
        let options = PlanOptions { effects: &effects, ..PlanOptions::new([64, 64], 1) };
        let resources = SceneResources::new(&stage);
        let mut evaluator = Evaluator::new(Arc::new(stage));
        let (_, plan) = plan_at(&resources, &mut evaluator, Time::from_secs(0.5), &options, None).unwrap();
        (plan.subframes.len(), plan.shutter_motion.unwrap().found.unwrap())
    };
    let at =
        |y: f64| Rig::Fixed { position: DVec3::new(0.0, y, 0.0), rotation: DQuat::IDENTITY, look_at: None };
    let moved = |metres: f64| Channel {
        property: Property::Translation,
        interpolation: Interpolation::Linear,
        times: vec![Time::ZERO, Time::from_secs(1.0)],
        values: vec![0.0, 1.5, 0.0, metres, 1.5, 0.0],
    };
    assert_eq!(counted(at(1.5), vec![]), (1, 0.0));
    // The lowest row shows the ground at a distance of 1.5 / tan 0.4 m, which gives the motion in pixels of the nearest visible point.
    let (count, pixels) = counted(at(1.5), vec![moved(0.2)]);
    let exact = 0.1 * 32.0 / 1.5;
    println!("{count} sub-frames, {pixels} pixels, exactly {exact}");
    assert!(count == 3 && (pixels - exact).abs() < 1e-3, "{count}, {pixels} instead of {exact}");
    assert_eq!(counted(at(1.5), vec![moved(4.0)]).0, 16);
}

#[test]
fn shadows_of_hidden_casters_and_moving_lights_add_sub_frames() {
    let mut scene = Scene::ortho(8.0);
    scene.add(&asset(vec![quad(4.0, 4.0)], vec![matte(Vec4::ONE)], vec![]), DAffine3::IDENTITY);
    // The box is above the image, and its shadow falls into it.
    scene.at(&asset(vec![quad(1.0, 1.0)], vec![matte(Vec4::ONE)], vec![]), 0.0, 0.0, 0.0);
    scene.stage.settings.fps.num = 1;
    let key = |values: Vec<f64>| Channel {
        property: Property::Translation,
        interpolation: Interpolation::Linear,
        times: vec![Time::ZERO, Time::from_secs(1.0)],
        values,
    };
    scene.stage.actors[1].channels.push(key(vec![-0.3, 7.0, 6.0, 0.3, 7.0, 6.0]));
    let sun = StageLight::sun("sun", Vec3::new(0.0, -1.0, -1.0).normalize(), 3.0);
    scene.stage.lights.push(StageLight { shadow: Some(Shadow::default()), ..sun });
    use_effect(&mut scene, "motion_blur", &[("samples", 16.0)], &[]);
    let (count, why) = sub_frames_and_reason(&scene);
    println!("{count}, {why:?}");
    // The shadow moves by 0.3 m, which are 2.4 pixels; texels are as large or smaller.
    assert!((3..16).contains(&count), "{count}, {why:?}");
    scene.stage.lights[0].shadow = None;
    assert_eq!(sub_frames_and_reason(&scene).0, 1, "without a shadow nothing is seen of it");
    scene.stage.actors[1].channels.clear();
    scene.stage.lights[0].channels.push(Channel {
        property: Property::Intensity,
        interpolation: Interpolation::Linear,
        times: vec![Time::ZERO, Time::from_secs(1.0)],
        values: vec![1.0, 9.0],
    });
    assert_eq!(sub_frames_and_reason(&scene).0, 16, "a light that changes");
}

#[test]
fn few_sub_frames_give_nearly_the_image_of_many() {
    let mut renderer = CpuRenderer::new(&effects());
    let mut image = |metres: f64, count: f64, all: bool| {
        let mut scene = scene_with_moving_quad(metres);
        scene.stage.effects[0].parameters = vec![("samples".into(), count)];
        let (resources, plan) = plan_at_half_a_second(&scene, 4, all);
        renderer.load(resources).unwrap();
        renderer.submit(plan).unwrap();
        renderer.collect(None).unwrap()
    };
    for metres in [0.05, 0.4, 1.2] {
        let truth = image(metres, 64.0, true);
        let off = |image: Frame| {
            let light = |frame: &Frame| frame.rgba.iter().map(|v| decode(*v)).collect::<Vec<f64>>();
            let pairs = light(&image).into_iter().zip(light(&truth));
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        let (drawn, once) = (off(image(metres, 16.0, false)), off(image(metres, 1.0, true)));
        println!("{metres} m: {drawn:.3} of white at worst; once: {once:.3}");
        assert!(drawn < 0.08, "{metres} m: {drawn}");
        assert!(metres < 0.1 || once > 0.3, "the comparison can fail: {once}");
    }
}
