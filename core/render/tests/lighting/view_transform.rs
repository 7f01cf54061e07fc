//! Exposure and view transform: closed forms in f64 by both renderers, the colors that stay as they are, and where the transform
//! runs when effects on images need light.

use crate::common::layered::layered;
use crate::common::*;
use choreo_asset::*;
use choreo_plugin::Frame;
use choreo_render::plan::Features;
use choreo_render::*;
use choreo_stage::*;
use glam::{Vec3, Vec4};
use std::sync::Arc;

const COLUMNS: usize = 24;
const HUES: [[f64; 3]; 6] =
    [[1.0, 1.0, 1.0], [1.0, 0.62, 0.48], [0.1, 0.8, 0.2], [0.0, 0.0, 1.0], [1.0, 0.9, 0.0], [0.35, 0.6, 1.0]];

/// Light of a column: from 1/64 to 16, so that it covers all parts of the tone curves.
fn light_of_column(column: usize) -> f64 {
    2.0_f64.powf(-6.0 + 10.0 * column as f64 / (COLUMNS - 1) as f64)
}

/// A table of quads that emit light, a row for each hue; at 24 × 6 pixels each quad is one pixel.
fn table_of_emissive_quads(view: ViewTransform, exposure: f32) -> Scene {
    let mut scene = Scene::ortho(HUES.len() as f32);
    scene.stage.settings.view_transform = view;
    scene.stage.settings.exposure = exposure;
    for (row, hue) in HUES.iter().enumerate() {
        for column in 0..COLUMNS {
            let emissive = hue.map(|c| (c * light_of_column(column)) as f32);
            let material = Material { emissive: emissive.into(), ..matte(Vec4::new(0.0, 0.0, 0.0, 1.0)) };
            let x = column as f64 + 0.5 - COLUMNS as f64 / 2.0;
            let y = HUES.len() as f64 / 2.0 - row as f64 - 0.5;
            scene.at(&asset(vec![quad(0.5, 0.5)], vec![material], vec![]), x, y, 0.0);
        }
    }
    scene
}

/// The Khronos PBR Neutral Tone Mapper as its specification writes it. `offset` is 0.04 there.
fn neutral(color: [f64; 3], offset: f64) -> [f64; 3] {
    let start = 0.8 - offset;
    let least = color[0].min(color[1]).min(color[2]);
    let taken = if least < 2.0 * offset { least - least * least / (4.0 * offset) } else { offset };
    let color = color.map(|c| c - taken);
    let peak = color[0].max(color[1]).max(color[2]);
    if peak < start {
        return color;
    }
    let d = 1.0 - start;
    let shown = 1.0 - d * d / (peak + d - start);
    let pale = 1.0 - 1.0 / (0.15 * (peak - shown) + 1.0);
    color.map(|c| c * shown / peak * (1.0 - pale) + shown * pale)
}

/// AgX with its exact sigmoid (Sobotka, AgX-S2O3: slope 2 at the pivot, powers 3 and 3.25), which the program approximates by a polynomial.
fn agx(color: [f64; 3]) -> [f64; 3] {
    let rows = |m: [[f64; 3]; 3], v: [f64; 3]| m.map(|r| r[0] * v[0] + r[1] * v[1] + r[2] * v[2]);
    let inset = [
        [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
        [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
        [0.0423756549057051, 0.0784336, 0.879142973793104],
    ];
    let outset = [
        [1.19687900512017, -0.0980208811401368, -0.0990297440797205],
        [-0.0528968517574562, 1.15190312990417, -0.0989611768448433],
        [-0.0529716355144438, -0.0980434501171241, 1.15107367264116],
    ];
    let curve = |c: f64| {
        let x = ((c.max(1e-10).log2() + 12.47393) / 16.5).clamp(0.0, 1.0);
        let (pivot_x, pivot_y) = (10.0 / 16.5, 0.5);
        let side = |limit_x: f64, limit_y: f64, power: f64| {
            let scale = ((2.0 * limit_x).powf(-power) * ((2.0 * limit_x / limit_y).powf(power) - 1.0))
                .powf(-1.0 / power);
            let t = 2.0 * (x - pivot_x).abs() / scale;
            scale * t / (1.0 + t.powf(power)).powf(1.0 / power)
        };
        match x < pivot_x {
            true => pivot_y - side(pivot_x, pivot_y, 3.0),
            false => pivot_y + side(1.0 - pivot_x, 1.0 - pivot_y, 3.25),
        }
    };
    rows(outset, rows(inset, color).map(curve)).map(|c| c.max(0.0).powf(2.2).min(1.0))
}

/// Largest difference between a drawn table and a formula, in codes.
fn worst_difference(frame: &Frame, exposure: f64, of: impl Fn([f64; 3]) -> [f64; 3]) -> f64 {
    let mut worst: f64 = 0.0;
    for (row, hue) in HUES.iter().enumerate() {
        for column in 0..COLUMNS {
            let got = pixel(frame, column as u32, row as u32);
            let expected = of(hue.map(|c| c * light_of_column(column) * exposure.exp2()));
            for c in 0..3 {
                worst = worst.max((f64::from(got[c]) - encode(expected[c])).abs());
            }
        }
    }
    worst
}

fn renderers(effects: &[choreo_plugin::Effect]) -> Vec<(Box<dyn Renderer>, &'static str)> {
    let mut all: Vec<(Box<dyn Renderer>, &str)> = vec![(Box::new(CpuRenderer::new(effects)), "CPU")];
    if let Some(r) = vulkan(GpuOptions { effects: effects.to_vec(), ..GpuOptions::default() }) {
        all.push((Box::new(r), "Vulkan"));
    }
    all
}

#[test]
fn view_transforms_match_their_closed_forms() {
    for (mut renderer, name) in renderers(&[]) {
        let mut draw = |view, exposure, pipeline| {
            let mut scene = table_of_emissive_quads(view, exposure);
            scene.stage.settings.pipeline = pipeline;
            draw_with(renderer.as_mut(), &scene, &PlanOptions::new([COLUMNS as u32, HUES.len() as u32], 1))
        };
        for pipeline in [Pipeline::Forward, Pipeline::Deferred] {
            // The G-buffer keeps emission in 16-bit floats.
            let most = if pipeline == Pipeline::Deferred { 1.0 } else { 0.75 };
            for exposure in [0.0, -1.5] {
                let stops = f64::from(exposure);
                let raw = worst_difference(&draw(ViewTransform::None, exposure, pipeline), stops, |c| c);
                assert!(raw <= most, "{name} {pipeline:?} none {exposure}: {raw}");
                let frame = draw(ViewTransform::Neutral, exposure, pipeline);
                let apart = worst_difference(&frame, stops, |c| neutral(c, 0.04));
                assert!(apart <= most, "{name} {pipeline:?} neutral {exposure}: {apart}");
                // Planted faults, which the comparison must find: another offset, and another exposure.
                assert!(worst_difference(&frame, stops, |c| neutral(c, 0.05)) > 3.0, "{name}");
                assert!(worst_difference(&frame, stops + 0.1, |c| neutral(c, 0.04)) > 3.0, "{name}");
                // The polynomial of AgX is at most 3 codes from its sigmoid (tests/report, "Tone mapping").
                let apart = worst_difference(&draw(ViewTransform::Agx, exposure, pipeline), stops, agx);
                assert!(apart <= 3.5, "{name} {pipeline:?} agx {exposure}: {apart}");
            }
        }
    }
}

/// Unlit and toon quads, a quad of refracting glass in front of an unlit one, and a background. `lit` adds a lit quad.
fn scene_of_display_colors(view: ViewTransform, lit: bool) -> Scene {
    let mut scene = Scene::ortho(8.0);
    scene.stage.settings.view_transform = view;
    scene.snapshot.background =
        Background::Gradient { top: Vec3::new(0.9, 0.2, 0.1), bottom: Vec3::new(0.1, 0.5, 1.0) };
    scene.sun(Vec3::NEG_Z, Vec3::ONE, 0.8);
    let toon = Toon { shade_color: Vec3::new(0.5, 0.2, 0.2), ..Toon::default() };
    let of_toon = Material {
        shading: Shading::Toon,
        toon: Some(Arc::new(toon)),
        ..matte(Vec4::new(0.95, 0.7, 0.6, 1.0))
    };
    let dark = Material { specular: 0.0, ..matte(Vec4::ONE) };
    let volume = MaterialLayers { transmission: 1.0, thickness: 0.1, ..MaterialLayers::default() };
    let materials = [
        (unlit(Vec4::new(1.0, 0.2, 0.05, 1.0)), -3.0, 0.0),
        (of_toon, -1.0, 0.0),
        (unlit(Vec4::new(0.9, 0.9, 0.2, 1.0)), 1.0, -1.0),
        (layered(volume, dark), 1.0, 0.0),
    ];
    let lit = lit.then(|| (matte(Vec4::ONE), 3.0, 0.0));
    for (material, x, z) in materials.into_iter().chain(lit) {
        scene.at(&asset(vec![quad(0.9, 0.9)], vec![material], vec![]), x, 0.0, z);
    }
    scene
}

#[test]
fn view_transform_changes_lit_surfaces_only() {
    for (mut renderer, name) in renderers(&[]) {
        let mut draw = |view, lit| {
            draw_with(renderer.as_mut(), &scene_of_display_colors(view, lit), &PlanOptions::new([64, 32], 4))
                .rgba
        };
        for view in [ViewTransform::Neutral, ViewTransform::Agx] {
            // The sun shines on the toon quad and on the glass, which emits no light.
            assert_eq!(draw(view, false), draw(ViewTransform::None, false), "{name} {view:?}");
            assert_ne!(draw(view, true), draw(ViewTransform::None, true), "{name} {view:?}");
        }
    }
}

/// Names of the full-screen passes of a lit scene with these effects, and whether surface shaders apply the view transform.
fn passes_and_surface_transform(view: ViewTransform, effects: &[&str]) -> (Vec<String>, bool) {
    let known = effects::all();
    let mut scene = scene_of_display_colors(view, true);
    for name in effects {
        use_effect(&mut scene, name, &[], &[]);
    }
    let options = PlanOptions { effects: &known, ..PlanOptions::new([64, 32], 1) };
    let (_, plan) = scene.plan(&options);
    let transformed = plan.draws.iter().any(|d| d.pipeline.features.has(Features::VIEW_TRANSFORM));
    assert_eq!(transformed, plan.display.has(Features::VIEW_TRANSFORM));
    let mut names: Vec<String> = plan.post.iter().map(|pass| pass.effect.clone()).collect();
    names.dedup();
    (names, transformed)
}

#[test]
fn view_transform_runs_in_surface_shaders_or_as_a_pass_after_effects() {
    let case = |view, effects: &[&str], passes_expected: &[&str], of_surfaces: bool| {
        let (names, transformed) = passes_and_surface_transform(view, effects);
        assert_eq!(
            (names, transformed),
            (passes_expected.iter().map(|s| s.to_string()).collect(), of_surfaces)
        );
    };
    let neutral = ViewTransform::Neutral;
    case(neutral, &[], &[], true);
    case(neutral, &["vignette"], &["vignette"], true);
    case(neutral, &["tonemap"], &["tonemap"], false);
    case(neutral, &["vignette", "bloom", "fxaa"], &["vignette", "bloom", "tonemap", "fxaa"], false);
    case(neutral, &["bloom", "tonemap"], &["bloom", "tonemap"], false);
    case(ViewTransform::None, &["bloom"], &["bloom"], false);
    // The pass applies the curve that the stage's settings name.
    let known = effects::all();
    for (view, curve) in [(neutral, "neutral"), (ViewTransform::Agx, "agx")] {
        let mut scene = scene_of_display_colors(view, true);
        use_effect(&mut scene, "bloom", &[], &[]);
        let (_, plan) = scene.plan(&PlanOptions { effects: &known, ..PlanOptions::new([64, 32], 1) });
        let tonemap = &effects::named(&["tonemap"])[0];
        let choreo_plugin::OptionKind::Text { one_of, .. } = &tonemap.manifest().options[0].kind else {
            panic!("curve is a text");
        };
        assert_eq!(one_of[plan.post.last().unwrap().parameters[0] as usize], curve);
    }
}

#[test]
fn view_transform_pass_matches_the_one_in_surface_shaders() {
    let known = effects::all();
    for (mut renderer, name) in renderers(&known) {
        for view in [ViewTransform::Neutral, ViewTransform::Agx] {
            let mut scene = table_of_emissive_quads(view, 0.0);
            let options =
                PlanOptions { effects: &known, ..PlanOptions::new([COLUMNS as u32, HUES.len() as u32], 1) };
            let of_surfaces = draw_with(renderer.as_mut(), &scene, &options);
            // No pixel is as bright as the threshold of bloom.
            use_effect(&mut scene, "bloom", &[("threshold", 100.0)], &[]);
            let of_pass = draw_with(renderer.as_mut(), &scene, &options);
            let apart = of_surfaces.rgba.iter().zip(&of_pass.rgba).map(|(a, b)| a.abs_diff(*b)).max();
            // The image between the passes is of 16-bit floats.
            assert!(apart <= Some(1), "{name} {view:?}: {apart:?}");
        }
    }
}
