//! Gradients behind everything are dithered: means are exact, and codes stay codes. Both renderers.

mod common;

use choreo_plugin::Frame;
use choreo_render::{CpuRenderer, GpuOptions, PlanOptions, Renderer};
use choreo_stage::Background;
use common::*;
use glam::{Vec3, Vec4};

const SIZE: [u32; 2] = [64, 512];
const BLOCK: usize = 8;
/// Codes at the upper and the lower edge.
const TOP: [f64; 3] = [100.0, 60.0, 20.0];
const BOTTOM: [f64; 3] = [104.0, 61.0, 28.0];

fn light(codes: [f64; 3]) -> [f64; 3] {
    codes.map(|code| choreo_asset::linear_from_srgb(code / 255.0))
}

/// The exact code of a row: linear light between both edges.
fn code_at(y: usize) -> [f64; 3] {
    let t = (y as f64 + 0.5) / f64::from(SIZE[1]);
    let (top, bottom) = (light(TOP), light(BOTTOM));
    std::array::from_fn(|i| encode(top[i] * (1.0 - t) + bottom[i] * t))
}

/// Largest distance of the mean code of 8 × 8 pixels from the exact one.
fn worst_mean(frame: &Frame) -> f64 {
    let [width, height] = SIZE.map(|n| n as usize);
    let mut worst = 0.0f64;
    for y in (0..height).step_by(BLOCK) {
        for x in (0..width).step_by(BLOCK) {
            let pixels = || (0..BLOCK * BLOCK).map(move |i| [x + i % BLOCK, y + i / BLOCK]);
            for channel in 0..3 {
                let shown = |[x, y]: [usize; 2]| f64::from(frame.rgba[4 * (y * width + x) + channel]);
                let exact = |[_, y]: [usize; 2]| code_at(y)[channel];
                let off: f64 = pixels().map(|at| shown(at) - exact(at)).sum::<f64>() / (BLOCK * BLOCK) as f64;
                worst = worst.max(off.abs());
            }
        }
    }
    worst
}

fn gradient(samples: u32) -> (Scene, PlanOptions<'static>) {
    let mut scene = Scene::ortho(2.0);
    let color = |codes| Vec3::from_array(light(codes).map(|c| c as f32));
    scene.snapshot.background = Background::Gradient { top: color(TOP), bottom: color(BOTTOM) };
    (scene, PlanOptions::new(SIZE, samples))
}

fn renderers() -> Vec<Box<dyn Renderer>> {
    let gpu = vulkan(GpuOptions::default()).map(|gpu| Box::new(gpu) as Box<dyn Renderer>);
    std::iter::once(Box::new(CpuRenderer::new(&[])) as Box<dyn Renderer>).chain(gpu).collect()
}

#[test]
fn means_of_a_slow_gradient_are_exact() {
    for samples in [1, 4] {
        let mut first: Option<Frame> = None;
        for mut renderer in renderers() {
            let (mut scene, options) = gradient(samples);
            let empty = draw_with(&mut *renderer, &scene, &options);
            let worst = worst_mean(&empty);
            assert!(worst <= 0.1, "{worst} codes");
            // With something in every tile.
            scene.at(&asset(vec![quad(0.01, 1.0)], vec![unlit(Vec4::ONE)], vec![]), 0.0, 0.0, 0.0);
            let beside = draw_with(&mut *renderer, &scene, &options);
            let differ = empty.rgba.chunks(4).zip(beside.rgba.chunks(4)).filter(|(a, b)| a != b).count();
            // The quad's six columns, and few pixels at the edge of a step, where both ways of drawing round differently.
            assert!(differ <= 6 * SIZE[1] as usize + SIZE[1] as usize / 8, "{differ} pixels");
            // Both renderers: but for rounding at the edge of a step.
            let other = first.get_or_insert_with(|| empty.clone());
            let differ = empty.rgba.iter().zip(&other.rgba).filter(|(a, b)| a != b).count();
            println!("{} samples: {worst:.3} codes, {differ} bytes differ", samples);
            assert!(differ <= empty.rgba.len() / 200, "{differ} bytes");
        }
    }
    // Rounded codes are off by half a code.
    let rounded: Vec<u8> = (0..SIZE[1] as usize)
        .flat_map(|y| {
            let [r, g, b] = code_at(y).map(|code| code.round() as u8);
            [r, g, b, 255].repeat(SIZE[0] as usize)
        })
        .collect();
    let worst = worst_mean(&Frame { width: SIZE[0], height: SIZE[1], rgba: rounded });
    assert!(worst > 0.3, "{worst} codes");
}

#[test]
fn codes_stay_codes() {
    let gray = Vec3::splat(choreo_asset::linear_from_srgb(128.0 / 255.0) as f32);
    for mut renderer in renderers() {
        for background in [
            Background::Color(gray.extend(1.0)),
            Background::Color(Vec4::new(0.2, 0.3, 0.4, 1.0)),
            Background::Gradient { top: gray, bottom: gray },
        ] {
            let mut scene = Scene::ortho(2.0);
            scene.snapshot.background = background;
            scene.at(
                &asset(vec![quad(0.5, 0.5)], vec![unlit(Vec4::new(0.3, 0.5, 0.7, 1.0))], vec![]),
                0.0,
                0.0,
                0.0,
            );
            let frame = draw_with(&mut *renderer, &scene, &PlanOptions::new([64, 64], 4));
            let colors: std::collections::BTreeSet<&[u8]> = frame.rgba.chunks(4).collect();
            assert!(colors.len() == 2, "{background:?}: {colors:?}");
        }
    }
}
