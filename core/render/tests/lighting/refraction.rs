//! Refracting glass in both renderers, against Snell's law in closed form; and when the scene color copy is made.

use crate::common::layered::layered;
use crate::common::*;
use choreo_asset::*;
use choreo_plugin::Frame;
use choreo_render::commands::{Command, RecordOptions, record};
use choreo_render::plan::Glass;
use choreo_render::*;
use choreo_stage::*;
use glam::{DAffine3, DQuat, DVec3, Vec3, Vec4};

const SIDE: u32 = 128;

/// Linear light at the left and at the right border of the background.
const RAMP: [f64; 2] = [0.3, 0.6];

/// A ramp of light over the whole image, 2 m wide, seen without perspective.
fn ramp() -> Scene {
    let mut scene = Scene::ortho(2.0);
    let mut back = quad(1.0, 1.0);
    let end = |x: f32| (RAMP[0] + RAMP[1] * f64::from(x * 0.5 + 0.5)) as f32;
    back.colors = back.positions.iter().map(|p| Vec3::splat(end(p.x)).extend(1.0)).collect();
    scene.at(&asset(vec![back], vec![unlit(Vec4::ONE)], vec![]), 0.0, 0.0, -10.0);
    scene
}

fn glass(layers: MaterialLayers) -> Material {
    // The glass reflects nothing, so that all light is transmitted.
    let base = Material { specular: 0.0, roughness: 0.0, ..matte(Vec4::ONE) };
    layered(MaterialLayers { transmission: 1.0, ..layers }, base)
}

fn scene_with_slab(degrees: f64, layers: MaterialLayers) -> Scene {
    let mut scene = ramp();
    let a = asset(vec![quad(0.4, 0.4)], vec![glass(layers)], vec![]);
    let turn = DQuat::from_rotation_y(degrees.to_radians());
    scene.add(&a, DAffine3::from_scale_rotation_translation(DVec3::splat(1.5), turn, DVec3::ZERO));
    scene
}

/// Displacement of the ray to the left in metres after `depth` metres in the slab, by Snell's law.
fn displacement_by_snell(degrees: f64, depth: f64, ior: f64) -> f64 {
    let outside = degrees.to_radians();
    let inside = (outside.sin() / ior).asin();
    depth * (outside - inside).sin()
}

/// Light of the ramp at a distance of `x` metres from the middle.
fn light_of_ramp(x: f64) -> f64 {
    RAMP[0] + RAMP[1] * (x * 0.5 + 0.5).clamp(0.5 / f64::from(SIDE), 1.0 - 0.5 / f64::from(SIDE))
}

/// Position of a pixel's center in metres.
fn pixel_center_metres(pixel: u32) -> f64 {
    (f64::from(pixel) + 0.5) / f64::from(SIDE) * 2.0 - 1.0
}

/// Largest difference in 8-bit steps over the middle row of the slab.
fn worst_difference(frame: &Frame, expected: impl Fn(f64) -> [f64; 3]) -> f64 {
    let pixels = SIDE / 2 - 16..SIDE / 2 + 16;
    let of_pixel = |x: u32| {
        let (got, expected) = (pixel(frame, x, SIDE / 2), expected(pixel_center_metres(x)));
        (0..3).map(|c| (f64::from(got[c]) - encode(expected[c])).abs()).fold(0.0, f64::max)
    };
    pixels.map(of_pixel).fold(0.0, f64::max)
}

/// Calls `check` for the CPU renderer and, where it is available, the Vulkan renderer, with one and four samples per pixel.
fn check_all_renderers(mut check: impl FnMut(&mut dyn FnMut(&Scene) -> Frame, &str)) {
    let mut all: Vec<(Box<dyn Renderer>, &str)> = vec![(Box::new(CpuRenderer::new(&[])), "CPU")];
    if let Some(r) = vulkan(GpuOptions::default()) {
        all.push((Box::new(r), "Vulkan"));
    }
    for (renderer, name) in &mut all {
        for samples in [1, 4] {
            let options = PlanOptions::new([SIDE; 2], samples);
            let mut draw = |scene: &Scene| draw_with(renderer.as_mut(), scene, &options);
            check(&mut draw, &format!("{name}, {samples} samples"));
        }
    }
}

#[test]
fn a_slab_displaces_its_background_by_snells_law() {
    check_all_renderers(|draw, who| {
        for (degrees, thickness, ior) in
            [(0.0, 0.4, 1.5), (30.0, 0.4, 1.5), (-50.0, 0.2, 1.33), (40.0, 0.3, 2.4)]
        {
            let layers = MaterialLayers { thickness, ior, ..MaterialLayers::default() };
            let frame = draw(&scene_with_slab(degrees, layers));
            // The actor is 1.5 times as large, and so is the thickness.
            let depth = 1.5 * f64::from(thickness);
            let by =
                |ior: f64| move |x: f64| [light_of_ramp(x - displacement_by_snell(degrees, depth, ior)); 3];
            let error = worst_difference(&frame, by(f64::from(ior)));
            println!("{who}, {degrees}°, {thickness} m, index {ior}: {error:.2} of 255");
            assert!(error < 1.0, "{who}: {degrees}° {thickness} {ior}: {error}");
            // The planted fault, another index of refraction, is found.
            assert!(
                degrees == 0.0 || worst_difference(&frame, by(f64::from(ior) * 0.85)) > 1.5,
                "{who} {degrees}"
            );
        }
    });
}

#[test]
fn a_ball_displaces_its_background_towards_its_middle() {
    let (radius, thickness, ior) = (0.6f64, 0.7, 1.5);
    let (rings, sectors) = (96u32, 192u32);
    let mut ball = Primitive { material: Some(0), ..Primitive::default() };
    for i in 0..=rings {
        for j in 0..=sectors {
            let [a, b] = [i as f32 / rings as f32, 2.0 * j as f32 / sectors as f32]
                .map(|turn| turn * std::f32::consts::PI);
            let n = Vec3::new(a.sin() * b.sin(), a.cos(), a.sin() * b.cos());
            ball.positions.push(n * radius as f32);
            ball.normals.push(n);
            let at = i * (sectors + 1) + j;
            if i < rings && j < sectors {
                let below = at + sectors + 1;
                ball.indices.extend([at, below, at + 1, at + 1, below, below + 1]);
            }
        }
    }
    let layers = MaterialLayers { thickness: thickness as f32, ior: ior as f32, ..MaterialLayers::default() };
    let mut scene = ramp();
    scene.at(&asset(vec![ball], vec![glass(layers)], vec![]), 0.0, 0.0, 0.0);
    check_all_renderers(|draw, who| {
        let by = |ior: f64| {
            move |x: f64| {
                // The row lies half a pixel below the middle. In the image, the background is displaced towards the middle.
                let y = -1.0 / f64::from(SIDE);
                let r = x.hypot(y);
                let inwards = displacement_by_snell((r / radius).asin().to_degrees(), thickness, ior);
                [light_of_ramp(x * (1.0 - inwards / r)); 3]
            }
        };
        let frame = draw(&scene);
        let error = worst_difference(&frame, by(ior));
        println!("{who}, ball: {error:.2} of 255");
        // Vulkan stores tessellated normals in 16 bits.
        assert!(error < 1.25, "{who}: {error}");
        assert!(worst_difference(&frame, by(1.2)) > 2.0, "{who}: the planted fault is seen");
    });
}

#[test]
fn dispersion_displaces_red_green_and_blue_differently() {
    let (degrees, thickness, ior, dispersion) = (50.0, 0.5, 1.5, 8.0);
    let layers = MaterialLayers {
        thickness: thickness as f32,
        ior: ior as f32,
        dispersion: dispersion as f32,
        ..MaterialLayers::default()
    };
    let scene = scene_with_slab(degrees, layers);
    check_all_renderers(|draw, who| {
        let frame = draw(&scene);
        // KHR_materials_dispersion: half the spread of the indices is 0.025 · (n − 1) · dispersion.
        let by = |dispersion: f64| {
            move |x: f64| {
                let half = 0.025 * (ior - 1.0) * dispersion;
                [ior - half, ior, ior + half]
                    .map(|n| light_of_ramp(x - displacement_by_snell(degrees, 1.5 * thickness, n)))
            }
        };
        let error = worst_difference(&frame, by(dispersion));
        println!("{who}, dispersion: {error:.2} of 255");
        assert!(error < 1.0, "{who}: {error}");
        assert!(worst_difference(&frame, by(0.0)) > 2.0, "{who}: the planted fault is seen");
    });
}

/// A background with a black left and a white right half, behind a slab that faces the camera.
fn scene_with_edge(roughness: f32, ior: f32) -> Scene {
    let mut scene = Scene::ortho(2.0);
    let mut right = quad(0.5, 1.0);
    right.positions.iter_mut().for_each(|p| p.x += 0.5);
    scene.at(&asset(vec![right], vec![unlit(Vec4::ONE)], vec![]), 0.0, 0.0, -10.0);
    let layers = MaterialLayers { thickness: 0.1, ior, ..MaterialLayers::default() };
    let rough = Material { roughness, ..glass(layers) };
    scene.at(&asset(vec![quad(0.5, 0.5)], vec![rough], vec![]), 0.0, 0.0, 0.0);
    scene
}

#[test]
fn roughness_blurs_refraction_by_mip_levels() {
    check_all_renderers(|draw, who| {
        let at = |scene: &Scene, x: u32, draw: &mut dyn FnMut(&Scene) -> Frame| {
            decode(pixel(&draw(scene), x, SIDE / 2)[0])
        };
        // log₂ 128 · 1 = level 7: one texel, the mean of the image. The glass reflects nothing: f0 = f90 = 0.
        let mean = at(&scene_with_edge(1.0, 1.5), SIDE / 2 - 20, draw);
        assert!((mean - 0.5).abs() < 0.01, "{who}: {mean}");
        // An index of 1.25 halves the blur: level 3.5 of texels of 8 and 16 pixels.
        let near = at(&scene_with_edge(1.0, 1.25), SIDE / 2 - 3, draw);
        let far = at(&scene_with_edge(1.0, 1.25), SIDE / 2 - 28, draw);
        assert!((0.1..0.5).contains(&near) && far < 0.002, "{who}: {near} {far}");
        let sharp = at(&scene_with_edge(0.0, 1.5), SIDE / 2 - 3, draw);
        assert!(sharp < 0.002, "{who}: {sharp}");
    });
    let levels = |roughness, ior| {
        let (_, plan) = scene_with_edge(roughness, ior).plan(&PlanOptions::new([SIDE, SIDE], 1));
        plan.scene_color_copy.map(|b| b.levels)
    };
    // Only the levels that are read exist: for a smooth material, level 0 alone.
    assert_eq!(levels(0.0, 1.5), Some(1));
    assert_eq!(levels(1.0, 1.25), Some(5));
    assert_eq!(levels(1.0, 1.5), Some(8));
    assert_eq!(levels(1.0, 1.0), None);
}

#[test]
fn only_refracting_materials_request_the_scene_color_copy() {
    let what = |layers: MaterialLayers| {
        let (_, plan) = scene_with_slab(20.0, layers).plan(&PlanOptions::new([SIDE; 2], 1));
        let recording = record(&plan, RecordOptions::default(), |_| 2);
        let copies =
            recording.commands.iter().filter(|c| matches!(c, Command::CopySceneColor { .. })).count();
        let glass: Vec<Glass> = plan.draws.iter().map(|d| d.pipeline.glass).collect();
        let left_out = plan.left_out.iter().any(|l| l.part == "refraction");
        (recording.counts().passes, copies, glass, left_out)
    };
    let thin = (1, 0, vec![Glass::No, Glass::Filter, Glass::Light], true);
    assert_eq!(what(MaterialLayers::default()), thin, "no thickness");
    assert_eq!(what(MaterialLayers { thickness: 0.5, ior: 1.0, ..MaterialLayers::default() }), thin);
    let bent = (2, 1, vec![Glass::No, Glass::Refract], false);
    assert_eq!(what(MaterialLayers { thickness: 0.5, ..MaterialLayers::default() }), bent);
}

#[test]
fn transparent_surfaces_around_refracting_glass_are_in_order() {
    // Half-transparent red behind the glass, half-transparent blue in front of it; within one mesh the nearer sheet comes first in the index order.
    let veil = |color: Vec4| Material { alpha_mode: AlphaMode::Blend, ..unlit(color) };
    let sheet = |z: f32, x: f32| {
        let mut p = quad(0.3, 0.8);
        p.positions.iter_mut().for_each(|v| *v += Vec3::new(x, 0.0, z));
        p
    };
    let mut two = sheet(0.1, 0.0);
    let far = sheet(-0.1, 0.0);
    two.indices.extend(far.indices.iter().map(|i| i + 4));
    two.positions.extend(far.positions);
    two.normals.extend(far.normals);
    let uvs = far.uvs[0].clone();
    two.uvs[0].extend(uvs);
    two.colors = [[Vec4::new(1.0, 1.0, 0.5, 1.0); 4], [Vec4::new(0.5, 1.0, 1.0, 1.0); 4]].concat();
    let layers = MaterialLayers { thickness: 0.1, ior: 1.5, ..MaterialLayers::default() };
    let mut scene = Scene::ortho(2.0);
    scene.snapshot.background = Background::Color(Vec4::new(0.8, 0.8, 0.8, 1.0));
    scene.at(&asset(vec![two], vec![glass(layers)], vec![]), 0.0, 0.0, 0.0);
    let red = asset(vec![sheet(0.0, 0.0)], vec![veil(Vec4::new(1.0, 0.0, 0.0, 0.5))], vec![]);
    scene.at(&red, 0.0, 0.0, -2.0);
    let mut blue = sheet(0.0, 0.0);
    blue.positions.iter_mut().for_each(|p| p.y *= 0.25);
    scene.at(&asset(vec![blue], vec![veil(Vec4::new(0.0, 0.0, 1.0, 0.5))], vec![]), 0.0, 0.0, 2.0);
    check_all_renderers(|draw, who| {
        let frame = draw(&scene);
        // Only the nearer sheet refracts: the half-transparent red over the background.
        let through = [0.9, 0.4, 0.4 * 0.5];
        let got = pixel(&frame, SIDE / 2, SIDE / 4);
        for c in 0..3 {
            assert!((f64::from(got[c]) - encode(through[c])).abs() <= 1.0, "{who}: {got:?}");
        }
        let got = pixel(&frame, SIDE / 2, SIDE / 2);
        let veiled = [0.45, 0.2, 0.1 + 0.5];
        for c in 0..3 {
            assert!((f64::from(got[c]) - encode(veiled[c])).abs() <= 1.5, "{who} before: {got:?}");
        }
    });
}
