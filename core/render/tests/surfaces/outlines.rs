//! Outlines of MToon and of the effect, and UV animation masks: widths in pixels, equal images in both renderers, no cost without them.

use crate::common;
use crate::common::layered::bulge;
use crate::common::*;
use choreo_asset::*;
use choreo_image_diff::compare;
use choreo_plugin::{Effect, Frame};
use choreo_render::plan::Features;
use choreo_render::*;
use choreo_stage::*;
use glam::{DAffine3, DQuat, DVec3, Vec3, Vec4};
use std::sync::Arc;

fn ball(radius: f32) -> Primitive {
    let (rings, sectors) = (48u32, 96u32);
    let mut ball = Primitive { material: Some(0), ..Primitive::default() };
    for i in 0..=rings {
        let (s, c) = (i as f32 / rings as f32 * std::f32::consts::PI).sin_cos();
        for j in 0..=sectors {
            let (sj, cj) = (j as f32 / sectors as f32 * std::f32::consts::TAU).sin_cos();
            let n = Vec3::new(s * sj, c, s * cj);
            ball.positions.push(n * radius);
            ball.normals.push(n);
        }
    }
    for i in 0..rings {
        for j in 0..sectors {
            let a = i * (sectors + 1) + j;
            ball.indices.extend([a, a + sectors + 1, a + 1, a + 1, a + sectors + 1, a + sectors + 2]);
        }
    }
    ball
}

fn effects() -> Vec<Effect> {
    effects::named(&["outline"])
}

fn add_outline(scene: &mut Scene, width: f64, actors: Vec<usize>) {
    common::use_effect(scene, "outline", &[("color_g", 1.0), ("width", width)], &actors);
}

const GREEN: [u8; 4] = [0, 255, 0, 255];

/// Lengths of the runs of a color in a row of pixels.
fn run_lengths(frame: &Frame, y: u32, color: [u8; 4]) -> Vec<u32> {
    let mut out = Vec::new();
    let mut run = 0;
    for x in 0..=frame.width {
        if x < frame.width && pixel(frame, x, y) == color {
            run += 1;
        } else if run > 0 {
            out.push(std::mem::take(&mut run));
        }
    }
    out
}

#[test]
fn outlines_in_pixels_have_the_same_width_at_any_distance() {
    for distance in [4.0, 8.0, 20.0, 80.0] {
        for (what, mesh) in [("ball", ball(1.0)), ("cube", cube(0.8))] {
            for width in [2.0, 5.0] {
                let mut scene = Scene::perspective(0.7, distance);
                scene.at(&asset(vec![mesh.clone()], vec![unlit(Vec4::ONE)], vec![]), 0.0, 0.0, 0.0);
                add_outline(&mut scene, width, vec![]);
                let all = effects();
                let options = PlanOptions { effects: &all, ..PlanOptions::new([301, 301], 1) };
                let runs = run_lengths(&draw(&scene, &options), 150, GREEN);
                // A cube's corner is pushed out along its diagonal, so that its sides move by 1/√2 or 1/√3 of the width at least.
                let least = if what == "cube" { width / 3f64.sqrt() } else { width };
                let fits = |r: &u32| (least - 1.2..=width + 1.2).contains(&f64::from(*r));
                assert!(
                    runs.len() == 2 && runs.iter().all(fits),
                    "{what} at {distance} m: {width} px as {runs:?}"
                );
            }
        }
    }
}

/// A preview of a quarter of the sides, or of four times as many pixels, has lines of the same share of its height.
#[test]
fn previews_keep_the_outline_width_relative_to_the_height() {
    let all = effects();
    for (side, width) in [(301, 8.0), (75, 2.0), (1204, 32.0)] {
        let mut scene = Scene::perspective(0.7, 8.0);
        scene.at(&asset(vec![ball(1.0)], vec![unlit(Vec4::ONE)], vec![]), 0.0, 0.0, 0.0);
        add_outline(&mut scene, 8.0, vec![]);
        let preview_of = Some([301, 301]);
        let options = PlanOptions { effects: &all, preview_of, ..PlanOptions::new([side, side], 1) };
        let runs = run_lengths(&draw(&scene, &options), side / 2, GREEN);
        let fits = |r: &u32| (f64::from(*r) - width).abs() <= 1.2;
        assert!(runs.len() == 2 && runs.iter().all(fits), "{side}: {width} px as {runs:?}");
    }
}

fn toon(outline: Outline, base: Vec4) -> Material {
    let toon = Toon { outline: Some(outline), gi_equalization: 0.0, ..Toon::default() };
    Material { shading: Shading::Toon, toon: Some(Arc::new(toon)), ..matte(base) }
}

fn outline_of_width(width: f32, on_screen: bool) -> Outline {
    Outline { width, on_screen, width_texture: None, color: Vec3::Y, lighting_mix: 0.0 }
}

#[test]
fn mtoon_outline_widths_in_metres_and_image_shares_match_formulas() {
    // Two metres in 200 pixels: 0.05 m and 2.5 % are 5 pixels, at any scale of the model.
    for (outline, pixels) in [
        (outline_of_width(0.05, false), 5),
        (outline_of_width(0.025, true), 5),
        (outline_of_width(0.1, false), 10),
    ] {
        for scale in [0.5, 1.5] {
            let mut scene = Scene::ortho(2.0);
            let a = asset(vec![ball(0.4)], vec![toon(outline.clone(), Vec4::ONE)], vec![]);
            scene.add(&a, DAffine3::from_scale(DVec3::splat(scale)));
            scene.snapshot.ambient_up = Vec3::ONE;
            scene.snapshot.ambient_down = Vec3::ONE;
            let runs = run_lengths(&draw_at(&scene, [201, 200], 1), 100, GREEN);
            let fits = |r: &u32| r.abs_diff(pixels) <= 1;
            assert!(runs.len() == 2 && runs.iter().all(fits), "{outline:?} × {scale}: {runs:?}");
        }
    }
    // Half of the lighting of a surface with half the light: ½ · 1 + ½ · ½.
    let mixed = Outline { lighting_mix: 0.5, color: Vec3::ONE, ..outline_of_width(0.2, false) };
    let mut scene = Scene::ortho(2.0);
    scene.at(
        &asset(vec![ball(0.5)], vec![toon(mixed, Vec4::new(0.5, 0.5, 0.5, 1.0))], vec![]),
        0.0,
        0.0,
        0.0,
    );
    scene.snapshot.ambient_up = Vec3::ONE;
    scene.snapshot.ambient_down = Vec3::ONE;
    let frame = draw_at(&scene, [201, 200], 1);
    assert_color(pixel(&frame, 100 + 60, 100), [0.75; 3], "mixed with the light on the surface");
    assert_color(pixel(&frame, 100, 100), [0.5; 3], "the surface itself");
}

#[test]
fn transparent_surfaces_are_outlined_only_outside() {
    // The outline and the surface are half transparent over a black background.
    let mut scene = Scene::ortho(2.0);
    let base = Vec4::new(1.0, 1.0, 1.0, 0.5);
    let veil = Material { alpha_mode: AlphaMode::Blend, ..toon(outline_of_width(0.1, false), base) };
    scene.at(&asset(vec![ball(0.5)], vec![veil], vec![]), 0.0, 0.0, 0.0);
    scene.snapshot.ambient_up = Vec3::ONE;
    scene.snapshot.ambient_down = Vec3::ONE;
    let frame = draw_at(&scene, [201, 200], 1);
    let half = encode(0.5).round() as u8;
    let found = run_lengths(&frame, 100, [0, half, 0, pixel(&frame, 100 + 55, 100)[3]]);
    assert!(found.len() == 2 && found.iter().all(|r| r.abs_diff(10) <= 1), "{found:?}");
    // The surface lies over the far side of its hull: ½ white + ½ (½ green).
    assert_color(pixel(&frame, 100, 100), [0.5, 0.75, 0.5], "the surface before its hull");
    // An opaque surface hides the hull.
    let solid = toon(outline_of_width(0.1, false), Vec4::ONE);
    let mut scene = Scene::ortho(2.0);
    scene.at(&asset(vec![ball(0.5)], vec![solid], vec![]), 0.0, 0.0, 0.0);
    (scene.snapshot.ambient_up, scene.snapshot.ambient_down) = (Vec3::ONE, Vec3::ONE);
    assert_color(pixel(&draw_at(&scene, [201, 200], 1), 100, 100), [1.0; 3], "solid");
}

/// A scene with every kind of outline on every kind of surface.
fn scene_of_all() -> Scene {
    let mut scene = Scene::perspective(0.9, 6.0);
    scene.snapshot.background = Background::Color(Vec4::new(0.2, 0.3, 0.4, 1.0));
    scene.snapshot.ambient_up = Vec3::splat(0.4);
    scene.snapshot.ambient_down = Vec3::splat(0.2);
    scene.sun(Vec3::new(-0.3, -0.7, -0.6), Vec3::ONE, 0.8);
    let picture = image(16, 16, |x, y| [(x * 16) as u8, (y * 16) as u8, (255 - x * 16) as u8, 255]);
    for i in 0..9u32 {
        let outline = Outline {
            width: if i % 2 == 0 { 0.04 } else { 0.012 },
            on_screen: i % 2 == 1,
            width_texture: (i % 3 == 1).then(|| texture(0)),
            color: Vec3::new(0.9, 0.5, 0.1),
            lighting_mix: [0.0, 0.5, 1.0][i as usize % 3],
        };
        let motion = UvMotion { scroll: glam::Vec2::new(0.3, 0.1), rotation: 0.5 };
        let toon = Toon {
            shade_color: Vec3::new(0.3, 0.2, 0.4),
            outline: (i != 4).then_some(outline),
            uv_motion: (i % 3 == 0).then_some(motion),
            uv_mask: Some(texture(0)),
            uv_moved: Vec3::new(0.4, 0.2, 0.7),
            ..Toon::default()
        };
        let material = Material {
            shading: if i == 8 { Shading::MetallicRoughness } else { Shading::Toon },
            base_color_texture: Some(texture(0)),
            toon: Some(Arc::new(toon)),
            double_sided: i == 2,
            alpha_mode: match i {
                5 => AlphaMode::Mask(0.5),
                1 | 6 => AlphaMode::Blend,
                _ => AlphaMode::Opaque,
            },
            ..matte(Vec4::new(0.9, 0.8, 0.7, if i == 1 || i == 6 { 0.6 } else { 1.0 }))
        };
        let mut mesh = if i % 3 == 2 { cube(0.35) } else { bulge(0.5) };
        if mesh.uvs[0].is_empty() {
            mesh.uvs[0] = mesh.positions.iter().map(|p| glam::Vec2::new(p.x, p.y) + 0.5).collect();
        }
        let mut a = (*asset(vec![mesh.clone()], vec![material.clone()], vec![picture.clone()])).clone();
        if i % 4 == 3 {
            a = (*skinned_asset(vec![mesh], vec![material])).clone();
            a.images = vec![picture.clone()];
        }
        let turn = DQuat::from_euler(glam::EulerRot::YXZ, f64::from(i) * 0.3 - 1.0, 0.3, 0.1);
        let place = DVec3::new(f64::from(i % 3) * 1.5 - 1.5, f64::from(i / 3) * 1.4 - 1.4, 0.0);
        scene.add(&Arc::new(a), DAffine3::from_rotation_translation(turn, place));
    }
    add_outline(&mut scene, 3.0, vec![4, 8]);
    scene
}

#[test]
fn vulkan_and_the_cpu_reference_draw_the_same_outlines() {
    let all = effects();
    let Some(mut renderer) = vulkan(GpuOptions { effects: all.clone(), ..GpuOptions::default() }) else {
        return;
    };
    let mut draw_with = |scene: &Scene, options: &PlanOptions| draw_with(&mut renderer, scene, options);
    let options = PlanOptions { effects: &all, ..PlanOptions::new([320, 240], 1) };
    let mut scene = scene_of_all();
    let (vulkan, cpu) = (draw_with(&scene, &options), draw(&scene, &options));
    let c = compare(&vulkan, &cpu, 2).unwrap();
    println!("{c}");
    assert!(c.mean < 0.2 && c.share_beyond < 0.01, "{c}");
    let forced = PlanOptions { force_all: true, ..options.clone() };
    let c = compare(&vulkan, &draw_with(&scene, &forced), 0).unwrap();
    assert!(c.share_beyond < 0.001, "forced in: {c}");
    // The planted fault, an outline a pixel wider, is found.
    scene.snapshot.effects[0].parameters[1].1 = 4.0;
    let c = compare(&draw_with(&scene, &options), &cpu, 2).unwrap();
    assert!(c.share_beyond > 0.002, "the comparison can fail: {c}");
}

#[test]
fn only_outlined_actors_request_outline_features() {
    let draws = |effect: Option<Vec<usize>>| {
        let mut scene = Scene::perspective(0.7, 4.0);
        let a = asset(vec![ball(0.5)], vec![matte(Vec4::ONE)], vec![]);
        scene.at(&a, -0.7, 0.0, 0.0);
        scene.at(&a, 0.7, 0.0, 0.0);
        effect.into_iter().for_each(|actors| add_outline(&mut scene, 2.0, actors));
        let all = effects();
        let (_, plan) = scene.plan(&PlanOptions { effects: &all, ..PlanOptions::new([64, 64], 1) });
        let out = plan.left_out.iter().any(|l| l.part == "outlines");
        let shells: Vec<_> =
            plan.draws.iter().filter(|d| d.pipeline.features.has(Features::OUTLINE)).collect();
        let copies: u32 = shells.iter().map(|d| d.instance_count).sum();
        // An unlit outline depends on the shape only.
        assert!(shells.iter().all(|d| d.pipeline.features == Features::OUTLINE));
        (plan.draws.len(), shells.len(), copies, plan.material_overrides.len(), out)
    };
    assert_eq!(draws(None), (1, 0, 0, 0, true));
    assert_eq!(draws(Some(vec![1])), (2, 1, 1, 1, false));
    assert_eq!(draws(Some(vec![])), (2, 1, 2, 1, false));
}

#[test]
fn the_uv_animation_mask_selects_the_moving_texels() {
    // The left half is static; the right half moves by half the texture, so that its stripes swap.
    let stripes = image(8, 1, |x, _| if x % 4 < 2 { [255, 0, 0, 255] } else { [0, 0, 255, 255] });
    let mask = image(8, 1, |x, _| [0, 0, if x < 4 { 0 } else { 255 }, 255]);
    let nearest = Sampler { mag_linear: false, min_linear: false, mip_linear: None, ..Sampler::default() };
    let motion = UvMotion { scroll: glam::Vec2::X, rotation: 0.0 };
    let toon = Toon {
        uv_motion: Some(motion),
        uv_mask: Some(TextureRef { sampler: nearest, ..texture(1) }),
        uv_moved: Vec3::new(0.25, 0.0, 0.0),
        ..Toon::default()
    };
    let material = Material {
        shading: Shading::Toon,
        toon: Some(Arc::new(toon)),
        base_color_texture: Some(TextureRef { sampler: nearest, ..texture(0) }),
        ..matte(Vec4::ONE)
    };
    let mut scene = Scene::ortho(2.0);
    scene.at(&asset(vec![quad(1.0, 1.0)], vec![material], vec![stripes, mask]), 0.0, 0.0, 0.0);
    scene.snapshot.ambient_up = Vec3::ONE;
    scene.snapshot.ambient_down = Vec3::ONE;
    let frame = draw_at(&scene, [8, 8], 1);
    let row: Vec<bool> = (0..8).map(|x| pixel(&frame, x, 4)[0] > 128).collect();
    assert_eq!(row, [true, true, false, false, false, false, true, true]);
}

#[test]
fn an_outline_reaches_into_the_image_from_outside() {
    // The rim of a ball is two pixels left of the image, and its outline of eight pixels reaches into the image.
    let drawn = |width: f64, x: f64| {
        let mut scene = Scene::ortho(2.0);
        scene.at(&asset(vec![ball(0.5)], vec![unlit(Vec4::ONE)], vec![]), x, 0.0, 0.0);
        add_outline(&mut scene, width, vec![0]);
        let effects = effects();
        let options = PlanOptions { effects: &effects, ..PlanOptions::new([100, 100], 1) };
        draw(&scene, &options).rgba.chunks_exact(4).filter(|p| *p == &GREEN[..]).count()
    };
    assert!(drawn(8.0, -1.54) > 20, "{}", drawn(8.0, -1.54));
    assert_eq!((drawn(1.0, -1.54), drawn(8.0, -1.8)), (0, 0));
}
