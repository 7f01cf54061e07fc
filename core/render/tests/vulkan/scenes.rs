//! The Vulkan renderer with validation: closed-form colors, images of the CPU reference, reproducible bytes, left-out commands.
//! Each test prints that it is skipped if there is no Vulkan driver.

use crate::common;
use crate::common::{draw as draw_cpu, *};
use choreo_asset::*;
use choreo_image_diff::{Comparison, compare};
use choreo_plugin::{Effect, Frame};
use choreo_render::commands::{CommandCounts, RecordOptions, Recording};
use choreo_render::*;
use choreo_stage::*;
use glam::{DAffine3, DVec3, Vec2, Vec3, Vec4};
use std::sync::{Mutex, MutexGuard};

/// One renderer for all tests of this file: creating one takes longer than most tests.
fn renderer() -> Option<MutexGuard<'static, Option<VulkanRenderer>>> {
    static SHARED: Mutex<Option<VulkanRenderer>> = Mutex::new(None);
    let mut shared = SHARED.lock().unwrap_or_else(|e| e.into_inner());
    if shared.is_none() {
        *shared = new_renderer();
    }
    shared.is_some().then_some(shared)
}

fn new_renderer() -> Option<VulkanRenderer> {
    vulkan(GpuOptions { effects: effects(), ..GpuOptions::default() })
}

macro_rules! vulkan {
    () => {
        match renderer() {
            Some(r) => r,
            None => return,
        }
    };
}

/// The vignette, and an effect that swaps red and blue, so that the order of a chain shows.
fn effects() -> Vec<Effect> {
    let swap = "// effect: swap
fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> { return color.bgra; }";
    let mut all = effects::named(&["vignette"]);
    all.push(choreo_wgsl_effect::WgslEffect::from_text("swap.wgsl", swap).unwrap().into());
    all
}

/// The plan, and its recording for a GPU.
fn record(plan: &Plan) -> Recording {
    choreo_render::commands::record(plan, RecordOptions::default(), |_| 2)
}

fn wall(material: Material) -> Scene {
    let mut scene = Scene::ortho(2.0);
    scene.at(&asset(vec![quad(2.0, 2.0)], vec![material], vec![]), 0.0, 0.0, 0.0);
    scene
}

#[test]
fn vulkan_colors_match_closed_forms() {
    let mut guard = vulkan!();
    let r = guard.as_mut().unwrap();
    let mut middle = |scene: &Scene| pixel(&draw_with(r, scene, &PlanOptions::new([5, 5], 1)), 2, 2);

    let unlit_wall = wall(unlit(Vec4::new(0.5, 0.25, 1.0, 1.0)));
    assert_color(middle(&unlit_wall), [0.5, 0.25, 1.0], "unlit");
    let mut lambert = wall(Material { specular: 0.0, ..matte(Vec4::ONE) });
    lambert.sun(-Vec3::Z, Vec3::new(1.0, 0.5, 0.25), 1.0);
    assert_color(middle(&lambert), [1.0, 0.5, 0.25], "a white diffuse wall that faces light 1 is white");
    let mut slanted = wall(Material { specular: 0.0, ..matte(Vec4::ONE) });
    slanted.sun(Vec3::new(0.0, -0.6, -0.8), Vec3::ONE, 0.5);
    assert_color(middle(&slanted), [0.4; 3], "cosine of the angle");
    // A surface that faces a lamp of 2 candela at two metres receives 2 / 2².
    let mut lamp = wall(Material { specular: 0.0, ..matte(Vec4::ONE) });
    lamp.snapshot.lights.push(LightState {
        light: Light { kind: LightKind::Point, color: Vec3::ONE, intensity: 2.0, range: None },
        position: DVec3::new(0.0, 0.0, 2.0),
        direction: Vec3::NEG_Y,
        shadow: None,
        attenuation: None,
    });
    assert_color(middle(&lamp), [0.5; 3], "inverse square");
    let mut phong = wall(Material {
        shading: Shading::BlinnPhong,
        specular_color: Vec3::splat(0.1),
        shininess: 8.0,
        ..matte(Vec4::splat(0.3))
    });
    phong.sun(-Vec3::Z, Vec3::ONE, 1.0);
    assert_color(middle(&phong), [0.5; 3], "0.3 + 0.1 · (8 + 8) / 8");
    let mut sky = wall(Material { specular: 0.0, ..matte(Vec4::ONE) });
    (sky.snapshot.ambient_up, sky.snapshot.ambient_down) = (Vec3::splat(0.6), Vec3::splat(0.2));
    assert_color(middle(&sky), [0.4; 3], "half of the sky, half of the ground");
    // Half-transparent white over black, mixed in linear light.
    let glass = wall(Material { alpha_mode: AlphaMode::Blend, ..unlit(Vec4::new(1.0, 1.0, 1.0, 0.5)) });
    assert_color(middle(&glass), [0.5; 3], "source over");
    let mut tinted = wall(unlit(Vec4::ONE));
    tinted.snapshot.actors[0].tint = Vec4::new(0.5, 1.0, 0.25, 1.0);
    assert_color(middle(&tinted), [0.5, 1.0, 0.25], "tint");
}

/// Allowed difference from the CPU reference: mean, and share of pixels beyond two steps. Edges differ because the rasterizer's fixed point is
/// the driver's own, and textures because filter weights have 8 bits.
fn assert_like_reference(c: &Comparison, what: &str) {
    println!("{what}: {c}");
    assert!(c.mean < 0.15 && c.share_beyond < 0.01, "{what}: {c}");
}

#[test]
fn vulkan_and_the_cpu_reference_draw_the_same() {
    let mut guard = vulkan!();
    let r = guard.as_mut().unwrap();
    let mut scene = busy_scene(DVec3::ZERO);
    scene.snapshot.background =
        Background::Gradient { top: Vec3::new(0.1, 0.2, 0.4), bottom: Vec3::splat(0.7) };
    scene.snapshot.actors[3].tint = Vec4::new(1.0, 0.5, 0.5, 0.7);
    for samples in [1, 4] {
        let options = PlanOptions::new([320, 240], samples);
        let vulkan = draw_with(r, &scene, &options);
        let cpu = draw_cpu(&scene, &options);
        assert_like_reference(&compare(&vulkan, &cpu, 2).unwrap(), &format!("{samples} samples"));
        let colors: std::collections::BTreeSet<_> = vulkan.rgba.chunks_exact(4).collect();
        assert!(colors.len() > 500, "there is something in the picture: {} colors", colors.len());
    }
    // The planted fault, one actor a fifth darker, is found.
    let options = PlanOptions::new([320, 240], 1);
    let cpu = draw_cpu(&scene, &options);
    scene.snapshot.actors[0].tint = Vec4::new(0.8, 0.8, 0.8, 1.0);
    let c = compare(&draw_with(r, &scene, &options), &cpu, 2).unwrap();
    assert!(c.share_beyond > 0.01, "the comparison can fail: {c}");
}

#[test]
fn material_layers_match_the_cpu_reference() {
    let mut guard = vulkan!();
    let r = guard.as_mut().unwrap();
    let mut scene = common::layered::layered_scene();
    for samples in [1, 4] {
        let options = PlanOptions::new([320, 240], samples);
        let (vulkan, cpu) = (draw_with(r, &scene, &options), draw_cpu(&scene, &options));
        let c = compare(&vulkan, &cpu, 2).unwrap();
        assert_like_reference(&c, &format!("layers, {samples} samples"));
        // The layered surfaces cover few pixels of the image.
        assert!(c.share_beyond < 0.001, "{c}");
    }
    // The planted faults: without one of the coats, sheens or glasses the images differ.
    let options = PlanOptions::new([320, 240], 1);
    let cpu = draw_cpu(&scene, &options);
    for actor in [0, 5, 10] {
        let whole = scene.stage.actors[actor].asset.clone();
        let mut bare = (*whole).clone();
        bare.materials[0].layers = None;
        scene.stage.actors[actor].asset = std::sync::Arc::new(bare);
        let c = compare(&draw_with(r, &scene, &options), &cpu, 2).unwrap();
        assert!(c.share_beyond > 0.004, "the comparison can fail: {c}");
        scene.stage.actors[actor].asset = whole;
    }
}

#[test]
fn forcing_all_features_in_draws_the_same() {
    let mut guard = vulkan!();
    let r = guard.as_mut().unwrap();
    let scene = busy_scene(DVec3::ZERO);
    let options = PlanOptions::new([160, 120], 1);
    let lean = draw_with(r, &scene, &options);
    let forced = draw_with(r, &scene, &PlanOptions { force_all: true, ..options.clone() });
    let c = compare(&lean, &forced, 1).unwrap();
    println!("forced: {c}");
    // The driver's compiler may reorder additions.
    assert!(c.share_beyond < 0.002, "{c}");
}

#[test]
fn equal_plans_give_equal_bytes_in_any_order() {
    let mut guard = vulkan!();
    let r = guard.as_mut().unwrap();
    let mut scene = busy_scene(DVec3::ZERO);
    let resources = scene.resources();
    r.load(resources.clone()).unwrap();
    let options = PlanOptions::new([96, 64], 4);
    let plans: Vec<Plan> = (0..6)
        .map(|i| {
            scene.snapshot.actors[3].world_from_model = DAffine3::from_rotation_y(i as f64);
            Plan::new(&resources, &scene.stage, &scene.snapshot, &options)
        })
        .collect();
    let mut run = |order: &[usize]| -> Vec<(usize, Frame)> {
        let mut out = Vec::new();
        // The largest possible number of frames is in flight.
        for chunk in order.chunks(r.frames_in_flight()) {
            chunk.iter().for_each(|i| r.submit(plans[*i].clone()).unwrap());
            out.extend(chunk.iter().map(|i| (*i, r.collect(None).unwrap())));
        }
        out.sort_by_key(|(i, _)| *i);
        out
    };
    let forward = run(&[0, 1, 2, 3, 4, 5]);
    assert!(forward == run(&[0, 1, 2, 3, 4, 5]), "twice");
    assert!(forward == run(&[4, 2, 5, 0, 3, 1]), "in another order");
    assert!(forward[0].1 != forward[1].1, "and the frames differ");
}

#[test]
fn recordings_have_only_the_commands_that_a_scene_needs() {
    let scene = wall(unlit(Vec4::ONE));
    let (_, plan) = scene.plan(&PlanOptions::new([8, 8], 1));
    let recording = record(&plan);
    let counts = CommandCounts {
        passes: 1,
        pipeline_binds: 1,
        distinct_pipelines: 1,
        material_binds: 1,
        mesh_binds: 1,
        draws: 1,
        post_passes: 0,
        shadow_views: 0,
        preskinned: 0,
    };
    assert_eq!(recording.counts(), counts, "{recording}");
    let text = recording.to_string();
    assert!(text.contains("upload 1 instances, 0 joints, 0 morphs, 0 lights"), "{text}");
    assert!(!text.contains("SKIN") && !text.contains("LIT") && !text.contains("background"), "{text}");

    // Sixteen copies: one draw. Two more materials: two more binds, no more pipelines.
    let mut scene = Scene::ortho(8.0);
    let materials: Vec<_> = [Vec4::ONE, Vec4::X, Vec4::Y].into_iter().map(unlit).collect();
    for (i, material) in materials.iter().enumerate() {
        let copies = asset(vec![quad(0.1, 0.1)], vec![material.clone()], vec![]);
        (0..16).for_each(|k| {
            scene.at(&copies, k as f64 * 0.2 - 1.5, i as f64, 0.0);
        });
    }
    let (_, plan) = scene.plan(&PlanOptions::new([8, 8], 1));
    let counts = record(&plan).counts();
    assert_eq!([counts.draws, counts.material_binds, counts.pipeline_binds, counts.mesh_binds], [3, 3, 1, 1]);

    let mut guard = vulkan!();
    let r = guard.as_mut().unwrap();
    let before = r.pipeline_count();
    draw_with(r, &scene, &PlanOptions::new([8, 8], 1));
    let after = r.pipeline_count();
    assert!(after - before <= 1, "one pipeline for three materials");
    draw_with(r, &scene, &PlanOptions::new([16, 16], 1));
    assert_eq!(r.pipeline_count(), after, "another size needs none");
}

#[test]
fn cpu_devices_copy_background_rows_and_draw_back_faces_last() {
    let mut scene = Scene::ortho(2.0);
    scene.snapshot.background = Background::Gradient { top: Vec3::X, bottom: Vec3::Y };
    let double_sided = Material { double_sided: true, ..unlit(Vec4::ONE) };
    scene.at(&asset(vec![quad(0.5, 0.5)], vec![double_sided], vec![]), 0.0, 0.0, 0.0);
    let text = |samples, cpu_device, triangles| {
        let (_, plan) = scene.plan(&PlanOptions::new([64, 64], samples));
        choreo_render::commands::record(
            &plan,
            RecordOptions { cpu_device, ..RecordOptions::default() },
            |_| triangles,
        )
        .to_string()
    };
    let gpu = text(1, false, 2);
    assert!(gpu.contains("clear") && gpu.contains("  background\n") && gpu.contains("cull None"), "{gpu}");
    let cpu = text(1, true, 2);
    assert!(cpu.contains("copy background\nbegin Image, 1 samples, load"), "{cpu}");
    assert!(!cpu.contains("  background"), "{cpu}");
    let (front, back) = (cpu.find("cull Back").unwrap(), cpu.find("cull Front").unwrap());
    assert!(
        front < back && cpu.matches("draw 1 from 0").count() == 2 && cpu.matches("pipeline").count() == 1
    );
    // With small triangles, running the vertex shader twice costs more than culling saves.
    assert!(!text(1, true, 4000).contains("cull Front"));
    // Copies cannot write multisampled targets: the background is copied into the image, and the dirty rectangle is resolved over it.
    let samples = text(4, true, 2);
    assert!(samples.contains("copy background\nbegin Image, 4 samples, clear"), "{samples}");
    assert!(samples.contains(", 40×40 at 12, 12\n") && samples.contains("  background\n"), "{samples}");
    assert!(!text(4, false, 2).contains(" at 12, 12\n"));
    // If draws cover most of the image, the whole image is drawn.
    scene.at(&asset(vec![quad(1.9, 1.9)], vec![unlit(Vec4::ONE)], vec![]), 0.0, 0.0, 0.0);
    let (_, plan) = scene.plan(&PlanOptions::new([64, 64], 4));
    let cpu = RecordOptions { cpu_device: true, ..RecordOptions::default() };
    let whole = choreo_render::commands::record(&plan, cpu, |_| 2).to_string();
    assert!(!whole.contains("copy background") && whole.contains("  background\n"), "{whole}");
}

#[test]
fn multisampling_only_the_dirty_rectangle_changes_no_pixel() {
    let mut guard = vulkan!();
    let r = guard.as_mut().unwrap();
    let gradient = Background::Gradient { top: Vec3::new(0.1, 0.3, 0.9), bottom: Vec3::new(0.8, 0.5, 0.1) };
    for background in [gradient, Background::Color(Vec4::new(0.2, 0.4, 0.1, 1.0))] {
        let mut scene = Scene::ortho(2.0);
        scene.snapshot.background = background;
        let leaf = triangle(Vec3::new(-0.5, -0.4, 0.0), Vec3::new(0.6, -0.1, 0.0), Vec3::new(0.0, 0.7, 0.0));
        scene.at(&asset(vec![leaf], vec![unlit(Vec4::ONE)], vec![]), 0.3, 0.2, 0.0);
        let (resources, plan) = scene.plan(&PlanOptions::new([120, 90], 4));
        r.load(resources).unwrap();
        let mut frame = |plan: Plan| {
            r.submit(plan).unwrap();
            r.collect(None).unwrap()
        };
        let part = frame(plan.clone());
        let whole = frame(Plan {
            dirty_rect: choreo_render::plan::dirty_rect::DirtyRect::EVERYTHING,
            ..plan.clone()
        });
        let c = compare(&part, &whole, 1).unwrap();
        println!("{}", c.worst);
        assert!(c.worst <= 1, "{c:?}");
        // Pixels outside the dirty rectangle are not drawn.
        let wrong = frame(Plan { dirty_rect: choreo_render::plan::dirty_rect::DirtyRect::NOTHING, ..plan });
        assert!(compare(&wrong, &whole, 1).unwrap().worst > 50);
    }
}

#[test]
fn equal_content_is_uploaded_once_and_kept() {
    let mut guard = vulkan!();
    let r = guard.as_mut().unwrap();
    let picture = || image(4, 4, |x, y| [x as u8 * 60, y as u8 * 60, 9, 255]);
    let with = |color| Material { base_color_texture: Some(texture(0)), ..unlit(color) };
    let mut scene = Scene::ortho(4.0);
    // Two files with equal meshes and images, but different colors.
    scene.at(&asset(vec![quad(0.5, 0.5)], vec![with(Vec4::ONE)], vec![picture()]), -1.0, 0.0, 0.0);
    scene.at(&asset(vec![quad(0.5, 0.5)], vec![with(Vec4::X + Vec4::W)], vec![picture()]), 1.0, 0.0, 0.0);
    let options = PlanOptions::new([32, 32], 1);
    let first = draw_with(r, &scene, &options);
    assert_eq!(r.resource_counts(), [1, 1, 2]);
    let bytes = r.allocated_bytes();
    assert!(first == draw_with(r, &scene, &options), "loaded again");
    assert_eq!((r.resource_counts(), r.allocated_bytes()), ([1, 1, 2], bytes));
    draw_with(r, &wall(unlit(Vec4::ONE)), &options);
    assert_eq!(r.resource_counts(), [1, 0, 1], "what the new scene resources lack is gone");
}

#[test]
fn effects_run_in_order_on_linear_light() {
    let mut guard = vulkan!();
    let r = guard.as_mut().unwrap();
    let effects = effects();
    let mut scene = busy_scene(DVec3::ZERO);
    scene.snapshot.background = Background::Gradient { top: Vec3::X, bottom: Vec3::new(0.5, 0.2, 0.1) };
    for chain in [&["vignette"][..], &["swap", "vignette"], &["vignette", "swap", "swap", "vignette"]] {
        scene.stage.effects.clear();
        scene.snapshot.effects.clear();
        for name in chain {
            let parameters = if *name == "vignette" { &[("strength", 0.8)][..] } else { &[] };
            common::use_effect(&mut scene, name, parameters, &[]);
        }
        for samples in [1, 4] {
            let options = PlanOptions { effects: &effects, ..PlanOptions::new([160, 120], samples) };
            let vulkan = draw_with(r, &scene, &options);
            let cpu = draw_cpu(&scene, &options);
            let c = compare(&vulkan, &cpu, 2).unwrap();
            assert_like_reference(&c, &format!("{chain:?}, {samples} samples"));
        }
    }
}

#[test]
fn odd_sizes_are_drawn_and_misuse_is_an_error() {
    let mut guard = vulkan!();
    let r = guard.as_mut().unwrap();
    let scene = wall(unlit(Vec4::new(0.5, 0.25, 1.0, 1.0)));
    for size in [[1, 1], [1, 300], [257, 131]] {
        let f = draw_with(r, &scene, &PlanOptions::new(size, 4));
        assert_eq!(f.rgba.len() as u32, size[0] * size[1] * 4);
        assert_color(pixel(&f, size[0] - 1, size[1] - 1), [0.5, 0.25, 1.0], &format!("{size:?}"));
    }
    let (_, mut plan) = scene.plan(&PlanOptions::new([8, 8], 1));
    let mut refused = |plan: &Plan| r.submit(plan.clone()).unwrap_err().to_string();
    plan.size = [70_000, 8];
    let e = refused(&plan);
    assert!(e.starts_with("image width is 70000, the limit of this device is "), "{e}");
    plan.size = [8, 0];
    assert_eq!(refused(&plan), "the image height is 0");
    plan.size = [8, 8];
    plan.samples = 3;
    assert_eq!(refused(&plan), "number of samples is 3, the limit of this device is 4");
    plan.samples = 1;
    let light = choreo_render::plan::PlanLight {
        position: Vec3::ZERO,
        kind: choreo_render::plan::LightType::Directional,
        direction: Vec3::NEG_Y,
        shadow_views: [0; 2],
        color: Vec3::ONE,
        inverse_range_squared: 0.0,
        cone: Vec2::ZERO,
        polynomial: choreo_render::plan::PlanLight::INVERSE_SQUARE,
    };
    plan.lights = vec![light; 257];
    assert!(refused(&plan).starts_with("257 lights shine at once; 256 are drawn at most"));
    plan.lights.clear();
    plan.post.push(choreo_render::plan::PostPass::only("blur".into(), vec![0.0; 8]));
    let e = refused(&plan);
    assert_eq!(
        e,
        "the plan uses the effect \"blur\", which the renderer was not given; known: vignette, swap"
    );
    plan.post.clear();
    plan.draws[0].primitive = 7;
    assert_eq!(refused(&plan), "the plan draws primitive 7, which the loaded scene resources lack");
    // The renderer still draws afterwards.
    plan.draws[0].primitive = 0;
    for _ in 0..r.frames_in_flight() {
        r.submit(plan.clone()).unwrap();
    }
    let full = format!("{} frames are in flight; collect one first", r.frames_in_flight());
    assert_eq!(r.submit(plan.clone()).unwrap_err().to_string(), full);
    for _ in 0..r.frames_in_flight() {
        assert_color(pixel(&r.collect(None).unwrap(), 4, 4), [0.5, 0.25, 1.0], "after refusals");
    }
    assert!(r.collect(None).is_err());
}

#[test]
fn a_thousand_frames_of_changing_size_leak_nothing() {
    let mut guard = vulkan!();
    let r = guard.as_mut().unwrap();
    let scenes = [wall(unlit(Vec4::ONE)), busy_scene(DVec3::ZERO)];
    let mut after_warm_up = 0;
    let mut reuse = None;
    for i in 0..1000u32 {
        let scene = &scenes[(i / 100) as usize % 2];
        if i % 100 == 0 {
            r.load(scene.resources()).unwrap();
        }
        let (_, plan) = scene.plan(&PlanOptions::new([16 + i % 2, 16], 1));
        r.submit(plan).unwrap();
        reuse = Some(r.collect(reuse.take()).unwrap());
        if i == 399 {
            after_warm_up = r.allocated_bytes();
        }
    }
    assert_eq!(r.allocated_bytes(), after_warm_up);
}

#[test]
fn dropping_the_renderer_with_frames_in_flight_is_valid() {
    let Some(mut r) = new_renderer() else { return };
    let (resources, plan) = busy_scene(DVec3::ZERO).plan(&PlanOptions::new([64, 64], 4));
    r.load(resources).unwrap();
    r.submit(plan.clone()).unwrap();
    r.submit(plan).unwrap();
    let messages = r.validation_messages();
    drop(r);
    assert_eq!(*messages.lock().unwrap(), Vec::<String>::new());
}

#[test]
fn the_pipeline_cache_changes_no_pixel_and_may_be_damaged() {
    if new_renderer().is_none() {
        return;
    }
    let folder = std::env::temp_dir().join(format!("choreo-cache-{}", std::process::id()));
    // A failed run may have left the folder, and process numbers are reused.
    let _ = std::fs::remove_dir_all(&folder);
    let options = GpuOptions { validation: true, cache_dir: Some(folder.clone()), ..GpuOptions::default() };
    let picture = |_: &str| {
        let mut r = VulkanRenderer::new(options.clone()).unwrap();
        draw_with(&mut r, &busy_scene(DVec3::ZERO), &PlanOptions::new([32, 32], 1))
    };
    let first = picture("cold");
    let files: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|f| f.unwrap().path()).collect();
    assert_eq!(files.len(), 1, "{files:?}");
    let warm = picture("warm");
    std::fs::write(&files[0], b"not a cache").unwrap();
    let damaged = picture("damaged");
    assert!(std::fs::metadata(&files[0]).unwrap().len() > 32, "written anew");
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(first == warm && first == damaged);
}
