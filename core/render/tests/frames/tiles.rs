//! Images that are drawn in tiles equal those drawn whole; a test option limits the size of a tile.

use crate::common::layered::{bulge, layered};
use crate::common::*;
use choreo_asset::*;
use choreo_image_diff::compare;
use choreo_plugin::{Effect, Frame};
use choreo_render::plan::tiles::{MAX_TILED_SIDE, tiles};
use choreo_render::*;
use choreo_stage::*;
use glam::{DAffine3, DQuat, DVec3, Vec3, Vec4};
use std::sync::Arc;

const SIZE: [u32; 2] = [200, 150];

fn effects() -> Vec<Effect> {
    effects::named(&["fog", "fxaa", "bloom", "wireframe", "grid", "outline"])
}

/// The busy scene seen from the side, with a shadow, many lamps and a background gradient.
fn scene() -> Scene {
    let mut scene = busy_scene(DVec3::ZERO);
    scene.snapshot.camera.world_from_view =
        DAffine3::from_rotation_translation(DQuat::from_rotation_y(0.3), DVec3::new(1.5, 0.6, 5.5));
    scene.snapshot.background =
        Background::Gradient { top: Vec3::new(0.1, 0.3, 0.9), bottom: Vec3::new(0.7, 0.4, 0.2) };
    scene.snapshot.lights[0].shadow = Some(Shadow::default());
    for i in 0..9 {
        let (x, y) = (f64::from(i % 3) - 1.0, f64::from(i / 3) - 1.0);
        let light = Light { kind: LightKind::Point, color: Vec3::Y, intensity: 0.2, range: Some(0.8) };
        let position = DVec3::new(1.4 * x, y, 1.2);
        scene.snapshot.lights.push(LightState {
            light,
            position,
            direction: Vec3::NEG_Y,
            shadow: None,
            attenuation: None,
        });
    }
    scene
}

fn scene_with_effects(uses: &[(&str, &[(&str, f64)])]) -> Scene {
    let mut scene = scene();
    uses.iter().for_each(|(plugin, parameters)| use_effect(&mut scene, plugin, parameters, &[]));
    scene
}

fn compare_frames(a: &Frame, b: &Frame) -> choreo_image_diff::Comparison {
    assert_eq!((a.width, a.height), (b.width, b.height));
    compare(a, b, 2).unwrap()
}

#[test]
fn tiled_images_equal_images_drawn_whole() {
    let effects = effects();
    let given = || GpuOptions { effects: effects.clone(), ..GpuOptions::default() };
    let Some(mut whole) = vulkan(given()) else { return };
    let mut tiled = vulkan(GpuOptions { longest_side: Some(100), ..given() }).unwrap();
    let mut under_a_sky = scene();
    let rgb = (0..32 * 16 * 3).map(|i| ((i * 37) % 101) as f32 / 100.0).collect();
    let panorama = Arc::new(Panorama::new("noise", 32, 16, rgb).unwrap());
    let sky = Sky { background: true, ..Sky::new(panorama) };
    let Sky { panorama, turn, strength, background, .. } = sky.clone();
    under_a_sky.snapshot.sky = Some(SkyState { panorama, turn, strength, background });
    under_a_sky.stage.sky = Some(sky);
    let mut parallel = scene();
    parallel.snapshot.camera.projection = Projection::Orthographic { height: 4.0, near: 0.1, far: 100.0 };
    use_effect(&mut parallel, "fog", &[("density", 0.05), ("falloff", 0.2), ("sky", 0.0)], &[]);
    let scenes = [
        ("gradient, shadow, lamps", scene()),
        ("sky", under_a_sky),
        ("parallel rays, fog", parallel),
        (
            "fog over the horizon",
            scene_with_effects(&[("fog", &[("density", 0.05), ("falloff", 0.2), ("sky", 0.0)])]),
        ),
        ("bloom and fxaa", scene_with_effects(&[("bloom", &[("strength", 0.6)]), ("fxaa", &[])])),
        (
            "lines and lattices",
            scene_with_effects(&[("wireframe", &[]), ("grid", &[("cell", 0.3), ("height", -1.0)])]),
        ),
        ("outlines on the screen", scene_with_effects(&[("outline", &[])])),
    ];
    for (i, (what, scene)) in scenes.iter().enumerate() {
        let samples = if i % 2 == 0 { 4 } else { 1 };
        let options = PlanOptions { effects: &effects, ..PlanOptions::new(SIZE, samples) };
        let c =
            compare_frames(&draw_with(&mut tiled, scene, &options), &draw_with(&mut whole, scene, &options));
        println!("{what}, {samples} samples: {c}");
        // Vertices may be rounded differently, which moves edges by a pixel; passes on the host have no 16-bit intermediate images.
        assert!(c.mean < 0.1 && c.share_beyond < 2e-3, "{what}, {samples} samples: {c}");
    }
    // Tiled and whole frames in turns, with several in flight.
    let (resources, large) = scenes[0].1.plan(&PlanOptions::new(SIZE, 1));
    let (_, small) = scenes[0].1.plan(&PlanOptions::new([60, 45], 1));
    tiled.load(resources).unwrap();
    tiled.submit(large).unwrap();
    tiled.submit(small).unwrap();
    let sizes = [0, 1].map(|_| tiled.collect(None).map(|f| [f.width, f.height]).unwrap());
    assert_eq!(sizes, [SIZE, [60, 45]]);
}

#[test]
fn the_comparison_finds_a_misplaced_tile() {
    let Some(mut whole) = vulkan(GpuOptions::default()) else { return };
    let options = PlanOptions::new(SIZE, 1);
    let (resources, plan) = scene().plan(&options);
    whole.load(resources.clone()).unwrap();
    let mut draw = |plan: Plan| {
        whole.submit(plan).unwrap();
        whole.collect(None).unwrap()
    };
    let all = draw(plan.clone());
    let tile = tiles(SIZE, 100)[1];
    let part = |x: u32, y: u32| pixel(&all, tile.at[0] + x, tile.at[1] + y);
    let mut off = |tile| {
        let drawn = draw(plan.tile(tile, &resources).unwrap());
        let pixels = (0..drawn.height).flat_map(|y| (0..drawn.width).map(move |x| (x, y)));
        pixels
            .filter(|(x, y)| {
                pixel(&drawn, *x, *y)[..3].iter().zip(part(*x, *y)).any(|(a, b)| a.abs_diff(b) > 2)
            })
            .count()
    };
    let right = off(tile);
    let mut wrong = tile;
    wrong.at[0] -= 1;
    let moved = off(wrong);
    assert!(right < 20 && moved > 200, "{right} and {moved} pixels");
}

#[test]
fn features_that_tiles_do_not_support_are_reported() {
    let Some(mut tiled) = vulkan(GpuOptions { longest_side: Some(64), ..GpuOptions::default() }) else {
        return;
    };
    let mut scene = scene();
    let glass = MaterialLayers { transmission: 0.9, thickness: 0.2, ..MaterialLayers::default() };
    let glass = layered(glass, matte(Vec4::ONE));
    scene.at(&asset(vec![bulge(0.6)], vec![glass], vec![]), 0.3, -0.2, 2.2);
    let (resources, plan) = scene.plan(&PlanOptions::new(SIZE, 1));
    assert!(plan.scene_color_copy.is_some());
    tiled.load(resources).unwrap();
    tiled.submit(plan).unwrap();
    let said = tiled.collect(None).unwrap_err().to_string();
    assert!(
        said.starts_with("an image of 200×150 is drawn in tiles") && said.contains("refraction"),
        "{said}"
    );
    let (_, plan) = scene.plan(&PlanOptions::new([MAX_TILED_SIDE + 1, 8], 1));
    let said = tiled.submit(plan).unwrap_err().to_string();
    assert_eq!(
        said,
        format!("image width is {}, the limit of this device is {MAX_TILED_SIDE}", MAX_TILED_SIDE + 1)
    );
}
