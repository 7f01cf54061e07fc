//! Deferred shading gives the image of forward shading.

use crate::common::layered::{bulge, layered_scene};
use crate::common::*;
use choreo_asset::*;
use choreo_image_diff::{Comparison, compare};
use choreo_plugin::{Effect, Frame};
use choreo_render::commands::{Command, RecordOptions, record};
use choreo_render::plan::{DeferredCause, Features};
use choreo_render::vulkan::Ability;
use choreo_render::*;
use choreo_stage::{Pipeline, *};
use glam::{DAffine3, DQuat, DVec3, Vec3, Vec4};

const SIZE: [u32; 2] = [192, 128];

fn effects() -> Vec<Effect> {
    effects::named(&["fog", "bloom", "wireframe"])
}

fn options(effects: &[Effect]) -> PlanOptions<'_> {
    PlanOptions { effects, ..PlanOptions::new(SIZE, 1) }
}

fn add_lamp(scene: &mut Scene, kind: LightKind, position: DVec3, range: Option<f32>, shadow: bool) {
    let light = Light { kind, color: Vec3::new(1.0, 0.8, 0.6), intensity: 1.5, range };
    let shadow = shadow.then_some(Shadow { size: 512, softness: Some(0.02) });
    let direction = Vec3::new(-0.2, -0.9, -0.4).normalize();
    scene.snapshot.lights.push(LightState { light, position, direction, shadow, attenuation: None });
}

/// A bulge with textures of every kind, emission and cut-outs, a skinned and a morphed mesh, on a floor.
fn scene_of_props() -> Scene {
    let mut scene = Scene::perspective(0.8, 7.0);
    scene.snapshot.camera.world_from_view.translation.y = 0.7;
    (scene.snapshot.ambient_up, scene.snapshot.ambient_down) = (Vec3::splat(0.3), Vec3::splat(0.1));
    scene.snapshot.background =
        Background::Gradient { top: Vec3::new(0.1, 0.3, 0.6), bottom: Vec3::new(0.6, 0.5, 0.4) };
    let map = image(16, 16, |x, y| [(x * 16) as u8, (y * 16) as u8, (255 - x * 8) as u8, (x * 16) as u8]);
    let bumps = image(8, 8, |x, y| [(96 + x * 8) as u8, (96 + y * 8) as u8, 240, 255]);
    let on = |on: bool, i: u32| on.then(|| texture(i));
    for i in 0..8usize {
        let material = Material {
            base_color_texture: on(i % 2 == 0, 0),
            normal_texture: on(i % 3 != 1, 1),
            metallic_roughness_texture: on(i % 4 == 1, 0),
            occlusion_texture: on(i % 4 == 2, 0),
            emissive: if i % 3 == 2 { Vec3::new(0.5, 0.2, 2.0) } else { Vec3::ZERO },
            emissive_texture: on(i == 5, 0),
            specular_texture: on(i == 6, 0),
            specular_color: Vec3::new(1.0, 0.7, 0.4),
            specular_color_texture: on(i == 7, 0),
            alpha_mode: if i == 4 { AlphaMode::Mask(0.4) } else { AlphaMode::Opaque },
            double_sided: i % 2 == 1,
            metallic: (i % 3) as f32 * 0.5,
            roughness: 0.15 + 0.1 * i as f32,
            ..matte(Vec4::new(0.9, 0.8, 0.7, 1.0))
        };
        let a = asset(vec![bulge(0.6)], vec![material], vec![map.clone(), bumps.clone()]);
        let turn = DQuat::from_euler(glam::EulerRot::YXZ, i as f64 * 0.5 - 1.7, 0.2, 0.3);
        let at = DVec3::new((i % 4) as f64 * 1.5 - 2.2, (i / 4) as f64 * 1.4, 0.3 * (i % 3) as f64);
        scene.add(&a, DAffine3::from_rotation_translation(turn, at));
    }
    let skinned = scene.at(
        &skinned_asset(vec![quad(0.5, 0.7)], vec![matte(Vec4::new(0.3, 0.9, 0.4, 1.0))]),
        -1.0,
        0.4,
        1.4,
    );
    scene.snapshot.actors[skinned].model_from_joint[1].translation.x += 0.3;
    let mut p = bulge(0.4);
    p.morphs = vec![MorphTarget {
        positions: p.positions.iter().map(|at| Vec3::new(0.0, at.x, 0.2)).collect(),
        normals: vec![Vec3::new(0.4, 0.0, 0.0); p.positions.len()],
        tangents: vec![],
    }];
    let morphed =
        scene.at(&asset(vec![p], vec![matte(Vec4::new(0.9, 0.3, 0.3, 1.0))], vec![]), 1.2, 0.2, 1.5);
    scene.snapshot.actors[morphed].morph_weights[0] = vec![0.7];
    let flat = DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    let floor = asset(vec![quad(6.0, 6.0)], vec![matte(Vec4::splat(0.8))], vec![]);
    scene.add(&floor, DAffine3::from_rotation_translation(flat, DVec3::new(0.0, -0.8, 0.0)));
    scene
}

/// The props with a sun, a spot light and a lamp that cast shadows, and a lamp with polynomial falloff.
fn scene_with_shadows() -> Scene {
    let mut scene = scene_of_props();
    scene.sun(Vec3::new(-0.4, -0.8, -0.5), Vec3::ONE, 0.7);
    scene.snapshot.lights[0].shadow = Some(Shadow { size: 1024, softness: Some(0.02) });
    add_lamp(
        &mut scene,
        LightKind::Spot { inner: 0.4, outer: 0.7 },
        DVec3::new(1.0, 3.0, 2.0),
        Some(9.0),
        true,
    );
    add_lamp(&mut scene, LightKind::Point, DVec3::new(-1.5, 1.5, 2.5), None, true);
    add_lamp(&mut scene, LightKind::Point, DVec3::new(2.5, 0.5, 2.5), None, false);
    scene.snapshot.lights[3].attenuation = Some([1.0, 0.1, 0.4]);
    scene
}

fn scene_with_lamps(lamps: usize) -> Scene {
    let mut scene = scene_of_props();
    for i in 0..lamps {
        let place = |k: usize| (i * k % 97) as f64 / 97.0;
        let at = DVec3::new(8.0 * place(31) - 4.0, 3.0 * place(53) - 0.6, 5.0 * place(71) - 2.0);
        let spot = LightKind::Spot { inner: 0.3, outer: 0.9 };
        add_lamp(&mut scene, if i % 3 == 0 { spot } else { LightKind::Point }, at, Some(1.2), false);
        scene.snapshot.lights[i].light.intensity = 0.15;
    }
    scene
}

fn under_a_sky(mut scene: Scene) -> Scene {
    let sky = Sky { background: true, turn: 0.4, ..Sky::new(Panorama::studio()) };
    let Sky { panorama, turn, strength, background, .. } = sky.clone();
    scene.snapshot.sky = Some(SkyState { panorama, turn, strength, background });
    scene.stage.sky = Some(sky);
    scene
}

/// The scene with another pipeline.
fn with_pipeline(mut scene: Scene, pipeline: Pipeline) -> Scene {
    scene.stage.settings.pipeline = pipeline;
    scene
}

fn scenes() -> Vec<(&'static str, Scene)> {
    let with = |mut scene: Scene, effect: &str, parameters: &[(&str, f64)]| {
        use_effect(&mut scene, effect, parameters, &[]);
        scene
    };
    let mut parallel = scene_with_shadows();
    parallel.snapshot.camera.projection = Projection::Orthographic { height: 5.0, near: 0.1, far: 40.0 };
    let mut far = scene_with_shadows();
    far.snapshot.camera.projection = Projection::Perspective { yfov: 0.8, near: 0.001, far: Some(30.0) };
    let mut layers = layered_scene();
    layers.at(&asset(vec![bulge(0.8)], vec![matte(Vec4::new(0.8, 0.4, 0.1, 1.0))], vec![]), 0.0, 0.0, 0.4);
    let mut glass = scene_with_shadows();
    let clear = Material { alpha_mode: AlphaMode::Blend, ..matte(Vec4::new(0.2, 0.5, 0.9, 0.4)) };
    let bent = Material {
        layers: Some(Box::new(MaterialLayers {
            transmission: 0.9,
            thickness: 0.3,
            ..MaterialLayers::default()
        })),
        ..matte(Vec4::ONE)
    };
    glass.at(&asset(vec![quad(1.0, 0.8)], vec![clear], vec![]), 0.5, 0.6, 2.0);
    glass.at(&asset(vec![bulge(0.5)], vec![bent], vec![]), -1.3, 0.5, 2.2);
    let mut peeled = scene_with_shadows();
    peeled.stage.settings.transparency = Transparency::Independent;
    for z in [1.8, 2.0] {
        let clear = Material { alpha_mode: AlphaMode::Blend, ..matte(Vec4::new(0.9, 0.2, 0.3, 0.5)) };
        peeled.at(&asset(vec![quad(1.0, 0.8)], vec![clear], vec![]), 0.2, 0.6, z);
    }
    let mut unlit_too = scene_with_shadows();
    unlit_too.at(
        &asset(vec![quad(0.4, 0.4)], vec![unlit(Vec4::new(1.0, 0.5, 0.0, 1.0))], vec![]),
        0.0,
        1.0,
        2.5,
    );
    vec![
        ("shadows", scene_with_shadows()),
        ("one light", scene_with_lamps(1)),
        ("256 lamps", scene_with_lamps(256)),
        ("no light but the sky's", under_a_sky(scene_of_props())),
        ("sky and shadows", under_a_sky(scene_with_shadows())),
        ("parallel rays", parallel),
        ("near plane at 1 mm, far plane", far),
        ("all kinds of materials", busy_scene(DVec3::ZERO)),
        ("ten thousand kilometres away", busy_scene(DVec3::splat(1e7))),
        ("layers", layers),
        ("glass after it", glass),
        ("peeled panes after it", peeled),
        ("unlit beside it", unlit_too),
        ("fog on everything", with(scene_with_shadows(), "fog", &[("density", 0.1)])),
        (
            "fog under a sky",
            with(under_a_sky(scene_with_shadows()), "fog", &[("density", 0.1), ("sky", 1.0)]),
        ),
        ("bloom", with(scene_with_shadows(), "bloom", &[("strength", 0.6)])),
        ("wireframe", with(scene_with_shadows(), "wireframe", &[])),
    ]
}

/// The G-buffer stores 16 bits per number, so highlights and shadow edges may differ by a few steps.
fn assert_same(c: &Comparison, what: &str) {
    println!("{what}: {c}");
    assert!(c.mean < 0.05 && c.share_beyond < 0.002, "{what}: {c}");
}

#[test]
fn deferred_and_forward_shading_draw_the_same() {
    let effects = effects();
    let Some(mut gpu) = vulkan(GpuOptions { effects: effects.clone(), ..GpuOptions::default() }) else {
        return;
    };
    for (what, scene) in scenes() {
        let options = options(&effects);
        let forward = with_pipeline(scene, Pipeline::Forward);
        let here = what.contains("shadows").then(|| draw(&forward, &options));
        let there = draw_with(&mut gpu, &forward, &options);
        let scene = with_pipeline(forward, Pipeline::Deferred);
        let (_, plan) = scene.plan(&options);
        let (kept, all) = (plan.draws.iter().filter(|d| d.deferred).count(), plan.draws.len());
        assert!(kept > 0, "{what}: {:?}", plan.left_out);
        let deferred = draw_with(&mut gpu, &scene, &options);
        println!("{kept} of {all} draws");
        assert_same(&compare(&there, &deferred, 2).unwrap(), what);
        let Some(here) = here else { continue };
        // The difference from the CPU reference, which shades forward, is within the bound of forward shading.
        let c = compare(&here, &deferred, 2).unwrap();
        println!("  twin: {c}");
        assert!(c.mean < 0.15 && c.share_beyond < 0.01, "{what}, twin: {c}");
    }
}

#[test]
fn the_comparison_finds_a_missing_part_of_the_lighting() {
    let Some(mut gpu) = vulkan(GpuOptions::default()) else { return };
    let scene = with_pipeline(under_a_sky(scene_with_shadows()), Pipeline::Deferred);
    let (resources, plan) = scene.plan(&options(&[]));
    gpu.load(resources).unwrap();
    let mut drawn = |plan: Plan| {
        gpu.submit(plan).unwrap();
        gpu.collect(None).unwrap()
    };
    let whole = drawn(plan.clone());
    for (what, bit) in [
        ("shadows", Features::SHADOW),
        ("sky", Features::SKY),
        ("lamps", Features::LOCAL_LIGHTS),
        ("polynomials", Features::POLYNOMIAL_FALLOFF),
        ("emission", Features::EMISSIVE),
    ] {
        let mut fault = plan.clone();
        let deferred = fault.deferred.as_mut().unwrap();
        assert!(deferred.features.has(bit), "{what}");
        deferred.features = deferred.features.without(bit);
        let c = compare(&whole, &drawn(fault), 2).unwrap();
        assert!(c.share_beyond > 0.004, "without {what}: {c}");
    }
    // Half of the deferred draws are missing.
    let mut fault = plan.clone();
    fault.draws.retain(|d| !d.deferred || d.first_instance % 2 == 0);
    assert!(compare(&whole, &drawn(fault), 2).unwrap().share_beyond > 0.01);
}

#[test]
fn forcing_all_features_in_changes_no_deferred_pixel() {
    let Some(mut gpu) = vulkan(GpuOptions::default()) else { return };
    let of = |what: &str| match what {
        "busy" => busy_scene(DVec3::ZERO),
        "props" => scene_with_shadows(),
        _ => under_a_sky(scene_of_props()),
    };
    for what in ["busy", "props", "sky"] {
        let options = options(&[]);
        let lean = draw_with(&mut gpu, &with_pipeline(of(what), Pipeline::Forward), &options);
        let all = PlanOptions { force_all: true, ..options };
        let forced = draw_with(&mut gpu, &with_pipeline(of(what), Pipeline::Deferred), &all);
        assert_same(&compare(&lean, &forced, 2).unwrap(), what);
    }
}

#[test]
fn deferred_tiles_and_frames_in_flight_draw_the_same() {
    let Some(mut whole) = vulkan(GpuOptions::default()) else { return };
    let mut tiled = vulkan(GpuOptions { longest_side: Some(100), ..GpuOptions::default() }).unwrap();
    let options = options(&[]);
    let scene = with_pipeline(scene_with_shadows(), Pipeline::Deferred);
    let one = draw_with(&mut whole, &scene, &options);
    let c = compare(&draw_with(&mut tiled, &scene, &options), &one, 2).unwrap();
    println!("tiles: {c}");
    assert!(c.mean < 0.1 && c.share_beyond < 2e-3, "{c}");
    // Deferred and forward frames in flight at the same time have the bytes that they have alone.
    let (resources, deferred) = scene.plan(&options);
    let (_, forward) = with_pipeline(scene_with_shadows(), Pipeline::Forward).plan(&options);
    whole.load(resources).unwrap();
    let alone: Vec<Frame> = [&deferred, &forward]
        .map(|plan| {
            whole.submit(plan.clone()).unwrap();
            whole.collect(None).unwrap()
        })
        .into();
    assert!(alone[0] == one);
    for _ in 0..3 {
        whole.submit(deferred.clone()).unwrap();
        whole.submit(forward.clone()).unwrap();
        assert!(whole.collect(None).unwrap() == alone[0]);
        assert!(whole.collect(None).unwrap() == alone[1]);
    }
}

#[test]
fn a_device_without_g_buffer_formats_draws_forward_with_a_note() {
    let without = vec![Ability::ColorAttachments];
    let Some(mut gpu) = vulkan(GpuOptions { without, ..GpuOptions::default() }) else { return };
    let options = options(&[]);
    let forward = draw_with(&mut gpu, &with_pipeline(scene_with_shadows(), Pipeline::Forward), &options);
    assert_eq!(gpu.take_notes(), Vec::<String>::new());
    let scene = with_pipeline(scene_with_shadows(), Pipeline::Deferred);
    for said in [1, 0] {
        assert!(draw_with(&mut gpu, &scene, &options) == forward);
        let notes = gpu.take_notes();
        assert_eq!(notes.len(), said, "{notes:?}");
        if said == 1 {
            assert!(
                notes[0].contains("\"deferred\"") && notes[0].contains("maxColorAttachments"),
                "{notes:?}"
            );
        }
    }
}

/// The plan, and its recording for a GPU.
fn plan_and_recording(scene: &Scene, samples: u32) -> (Plan, commands::Recording) {
    let (_, plan) = scene.plan(&PlanOptions::new(SIZE, samples));
    let recording = record(&plan, RecordOptions::default(), |_| 2);
    (plan, recording)
}

fn reason_against_deferred(plan: &Plan) -> &str {
    let out = plan.left_out.iter().find(|l| l.part == "deferred shading");
    out.map_or("", |l| &l.why)
}

#[test]
fn deferred_shading_is_left_out_with_a_reason() {
    let scene = scene_with_shadows();
    let (plan, recording) = plan_and_recording(&scene, 1);
    assert!(plan.deferred.is_none() && plan.draws.iter().all(|d| !d.deferred));
    assert!(!recording.commands.contains(&Command::BeginGBuffer));
    // Few lights and little overdraw: the reason gives the numbers.
    assert!(
        reason_against_deferred(&plan).contains("lights per surface"),
        "{}",
        reason_against_deferred(&plan)
    );
    let counts = recording.counts();
    let forward = with_pipeline(scene, Pipeline::Forward);
    let (plan, recording) = plan_and_recording(&forward, 1);
    assert_eq!(
        (reason_against_deferred(&plan), recording.counts()),
        ("the stage's pipeline is \"forward\"", counts)
    );
    let asked = with_pipeline(forward, Pipeline::Deferred);
    let (plan, recording) = plan_and_recording(&asked, 4);
    assert!(
        plan.deferred.is_none() && reason_against_deferred(&plan).starts_with("4 samples per pixel"),
        "{}",
        reason_against_deferred(&plan)
    );
    assert_eq!(recording.counts().passes, counts.passes);
    // One more pass, and each draw once: in the G-buffer pass, unless the G-buffer cannot hold its surface.
    let (plan, recording) = plan_and_recording(&asked, 1);
    assert_eq!(plan.deferred.as_ref().map(|d| d.cause), Some(DeferredCause::Requested));
    assert_eq!(reason_against_deferred(&plan), "");
    assert_eq!((recording.counts().passes, recording.counts().draws), (counts.passes + 1, counts.draws));
    let mut nothing = Scene::ortho(2.0);
    nothing.at(&asset(vec![quad(1.0, 1.0)], vec![unlit(Vec4::ONE)], vec![]), 0.0, 0.0, 0.0);
    let (plan, _) = plan_and_recording(&with_pipeline(nothing, Pipeline::Deferred), 1);
    assert!(
        reason_against_deferred(&plan).starts_with("no opaque metallic-roughness surface"),
        "{}",
        reason_against_deferred(&plan)
    );
}

#[test]
fn surfaces_that_do_not_fit_the_g_buffer_are_shaded_forward() {
    let (_, plan) = with_pipeline(layered_scene(), Pipeline::Deferred).plan(&options(&[]));
    assert!(plan.draws.iter().filter(|d| d.deferred).all(|d| !d.pipeline.features.has(Features::LAYERS)));
    let (_, plan) = with_pipeline(busy_scene(DVec3::ZERO), Pipeline::Deferred).plan(&options(&[]));
    for d in &plan.draws {
        let opaque = d.pipeline.features.has(Features::METALLIC_ROUGHNESS) && !d.pipeline.is_transparent();
        assert_eq!(d.deferred, opaque, "{:?}", d.pipeline);
    }
}
