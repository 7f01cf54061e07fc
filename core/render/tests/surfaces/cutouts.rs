//! Cut-outs with several samples per pixel in both renderers, against the exact coverage of each pixel.

use crate::common::*;
use choreo_asset::*;
use choreo_image_diff::compare;
use choreo_plugin::Frame;
use choreo_render::vulkan::Ability;
use choreo_render::*;
use choreo_stage::*;
use glam::{Vec4, vec4};

const SIDE: u32 = 96;
/// Side of the texture, and radius of the disc that is cut out of it, in texels.
const TEXELS: u32 = 32;
const RADIUS: f64 = 11.0;

/// A white disc on black; alpha falls by a tenth per texel, so that the edge is several pixels wide.
fn scene_with_disc() -> Scene {
    let mut scene = Scene::ortho(2.0);
    let alpha = |x: u32, y: u32| {
        let away = (f64::from(x) + 0.5 - 16.0).hypot(f64::from(y) + 0.5 - 16.0);
        [255, 255, 255, ((0.5 + (RADIUS - away) * 0.1).clamp(0.0, 1.0) * 255.0).round() as u8]
    };
    let material = Material {
        alpha_mode: AlphaMode::Mask(0.5),
        base_color_texture: Some(texture(0)),
        ..unlit(Vec4::ONE)
    };
    scene.at(&asset(vec![quad(1.0, 1.0)], vec![material], vec![image(TEXELS, TEXELS, alpha)]), 0.0, 0.0, 0.0);
    scene
}

/// Share of a pixel that the disc covers, from 16 × 16 samples.
fn exact_coverage(x: u32, y: u32) -> f64 {
    let texel = |pixel: u32, i: u32| {
        (f64::from(pixel) + (f64::from(i) + 0.5) / 16.0) * f64::from(TEXELS) / f64::from(SIDE) - 16.0
    };
    let inside = (0..256).filter(|i| texel(x, i % 16).hypot(texel(y, i / 16)) < RADIUS);
    inside.count() as f64 / 256.0
}

/// Root mean square error over the pixels of the edge.
fn edge_error(frame: &Frame) -> f64 {
    let pixels = (0..SIDE * SIDE).map(|i| (i % SIDE, i / SIDE)).map(|(x, y)| (exact_coverage(x, y), x, y));
    let edge: Vec<f64> = pixels
        .filter(|(share, ..)| *share > 0.0 && *share < 1.0)
        .map(|(share, x, y)| (decode(pixel(frame, x, y)[0]) - share).powi(2))
        .collect();
    assert!(edge.len() > 100);
    (edge.iter().sum::<f64>() / edge.len() as f64).sqrt()
}

#[test]
fn multisampling_smooths_the_edges_of_cut_outs() {
    let scene = scene_with_disc();
    let (one, four) = (draw_at(&scene, [SIDE; 2], 1), draw_at(&scene, [SIDE; 2], 4));
    println!(
        "off the exact share: {:.3} with one sample, {:.3} with four",
        edge_error(&one),
        edge_error(&four)
    );
    assert!(edge_error(&one) > 0.2, "a cut at whole pixels");
    assert!(edge_error(&four) < 0.12, "{}", edge_error(&four));
    // Without a cut-out nothing changes.
    assert_eq!(pixel(&four, 48, 48), [255; 4]);
    assert_eq!(pixel(&four, 2, 2), [0, 0, 0, 255]);

    let Some(mut gpu) = vulkan(GpuOptions::default()) else { return };
    let there = draw_with(&mut gpu, &scene, &PlanOptions::new([SIDE; 2], 4));
    let c = compare(&four, &there, 2).unwrap();
    println!("twin: {c:?}");
    assert!(c.share_beyond < 0.005 && edge_error(&there) < 0.12, "{c:?}");
    assert!(compare(&one, &there, 2).unwrap().share_beyond > 0.01, "the comparison sees an edge");
    // The alpha that gives the coverage is not stored in the image.
    assert!([&four, &there].iter().all(|f| f.rgba.iter().skip(3).step_by(4).all(|a| *a == 255)));

    // A device without alpha-to-one keeps or loses whole pixels: only the edges of the mesh are smooth.
    let Some(mut gpu) = vulkan(GpuOptions { without: vec![Ability::AlphaToOne], ..GpuOptions::default() })
    else {
        return;
    };
    let whole = draw_with(&mut gpu, &scene, &PlanOptions::new([SIDE; 2], 4));
    let hard = {
        let mut scene = scene_with_disc();
        scene.stage.settings.cutouts = Cutouts::Hard;
        draw_at(&scene, [SIDE; 2], 4)
    };
    assert!(compare(&hard, &whole, 2).unwrap().share_beyond < 0.005);
    assert!(compare(&four, &whole, 2).unwrap().share_beyond > 0.01);
}

#[test]
fn only_multisampled_cut_outs_request_alpha_to_coverage() {
    let text = |scene: &Scene, samples: u32| {
        let (_, plan) = scene.plan(&PlanOptions::new([SIDE; 2], samples));
        commands::record(&plan, Default::default(), |_| 2).to_string()
    };
    assert!(text(&scene_with_disc(), 4).contains(" COVERAGE"));
    assert!(!text(&scene_with_disc(), 1).contains(" COVERAGE"));
    let mut hard = scene_with_disc();
    hard.stage.settings.cutouts = Cutouts::Hard;
    assert!(!text(&hard, 4).contains(" COVERAGE"));
    let said = |scene: &Scene, samples: u32| {
        let (_, plan) = scene.plan(&PlanOptions::new([SIDE; 2], samples));
        plan.left_out.iter().find(|l| l.part == "alpha to coverage").map(|l| l.why.clone())
    };
    assert_eq!(said(&scene_with_disc(), 4), None);
    assert!(said(&scene_with_disc(), 1).is_some_and(|why| why.contains("one sample")));
    assert!(said(&hard, 4).is_some_and(|why| why.contains("hard")));
    let mut whole = Scene::ortho(2.0);
    whole.at(&asset(vec![quad(1.0, 1.0)], vec![unlit(vec4(1.0, 1.0, 1.0, 1.0))], vec![]), 0.0, 0.0, 0.0);
    assert!(!text(&whole, 4).contains(" COVERAGE"));
}
