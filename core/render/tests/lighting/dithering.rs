//! Dithering of background gradients and of images after effects, by both renderers: means are exact, and exact 8-bit colors stay.

use crate::common::*;
use choreo_plugin::{Effect, Frame};
use choreo_render::{CpuRenderer, GpuOptions, Plan, PlanOptions, Renderer};
use choreo_stage::Background;
use choreo_wgsl_effect::WgslEffect;
use glam::{Vec3, Vec4};

const SIZE: [u32; 2] = [64, 512];
const BLOCK: usize = 8;
/// sRGB codes of the gradient at the upper and at the lower edge.
const TOP: [f64; 3] = [100.0, 60.0, 20.0];
const BOTTOM: [f64; 3] = [104.0, 61.0, 28.0];

fn linear_from_codes(codes: [f64; 3]) -> [f64; 3] {
    codes.map(|code| choreo_asset::linear_from_srgb(code / 255.0))
}

/// The exact code of a row: interpolated in linear light between both edges.
fn code_at(y: usize) -> [f64; 3] {
    let t = (y as f64 + 0.5) / f64::from(SIZE[1]);
    let (top, bottom) = (linear_from_codes(TOP), linear_from_codes(BOTTOM));
    std::array::from_fn(|i| encode(top[i] * (1.0 - t) + bottom[i] * t))
}

/// Largest distance of the mean code of 8 × 8 pixels from the exact one.
fn worst_mean(frame: &Frame) -> f64 {
    worst_mean_of(frame, code_at)
}

/// `exact`: the codes of a row.
fn worst_mean_of(frame: &Frame, exact: impl Fn(usize) -> [f64; 3]) -> f64 {
    let [width, height] = SIZE.map(|n| n as usize);
    let mut worst = 0.0f64;
    for y in (0..height).step_by(BLOCK) {
        for x in (0..width).step_by(BLOCK) {
            let pixels = || (0..BLOCK * BLOCK).map(move |i| [x + i % BLOCK, y + i / BLOCK]);
            for channel in 0..3 {
                let shown = |[x, y]: [usize; 2]| f64::from(frame.rgba[4 * (y * width + x) + channel]);
                let exact = |[_, y]: [usize; 2]| exact(y)[channel];
                let off: f64 = pixels().map(|at| shown(at) - exact(at)).sum::<f64>() / (BLOCK * BLOCK) as f64;
                worst = worst.max(off.abs());
            }
        }
    }
    worst
}

fn gradient(samples: u32) -> (Scene, PlanOptions<'static>) {
    let mut scene = Scene::ortho(2.0);
    let color = |codes| Vec3::from_array(linear_from_codes(codes).map(|c| c as f32));
    scene.snapshot.background = Background::Gradient { top: color(TOP), bottom: color(BOTTOM) };
    (scene, PlanOptions::new(SIZE, samples))
}

fn renderers() -> Vec<Box<dyn Renderer>> {
    renderers_with(&[])
}

fn renderers_with(effects: &[Effect]) -> Vec<Box<dyn Renderer>> {
    let options = GpuOptions { effects: effects.to_vec(), ..GpuOptions::default() };
    let gpu = vulkan(options).map(|gpu| Box::new(gpu) as Box<dyn Renderer>);
    std::iter::once(Box::new(CpuRenderer::new(effects)) as Box<dyn Renderer>).chain(gpu).collect()
}

#[test]
fn dithered_gradients_have_exact_means() {
    for samples in [1, 4] {
        let mut first: Option<Frame> = None;
        for mut renderer in renderers() {
            let (mut scene, options) = gradient(samples);
            let empty = draw_with(&mut *renderer, &scene, &options);
            let worst = worst_mean(&empty);
            assert!(worst <= 0.1, "{worst} codes");
            // A mesh in every tile.
            scene.at(&asset(vec![quad(0.01, 1.0)], vec![unlit(Vec4::ONE)], vec![]), 0.0, 0.0, 0.0);
            let beside = draw_with(&mut *renderer, &scene, &options);
            let differ = empty.rgba.chunks(4).zip(beside.rgba.chunks(4)).filter(|(a, b)| a != b).count();
            // The quad's six columns differ, and a few pixels at the border of a step, which are rounded differently.
            assert!(differ <= 6 * SIZE[1] as usize + SIZE[1] as usize / 8, "{differ} pixels");
            // Both renderers agree, except for rounding at the border of a step.
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
fn dithering_keeps_exactly_representable_colors() {
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

/// An effect on pixels, an effect on images, and motion blur.
const AFTER: [&str; 3] = ["shade", "look", "blur"];

fn effects() -> Vec<Effect> {
    let texts = [
        "// effect: shade\nfn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {\n\
             return vec4<f32>(color.rgb * (1.0 - 0.125 * uv.y), color.a);\n}",
        "// effect: look\n// hook: image\n\
         fn effect(at: vec2<i32>, pass_number: u32, p: array<f32, 8>) -> vec4<f32> {\n\
             let uv = (vec2<f32>(at) + 0.5) / vec2<f32>(picture_size());\n\
             let color = picture(at);\n\
             return vec4<f32>(color.rgb * (1.0 - 0.125 * uv.y), color.a);\n}",
    ];
    texts.map(|text| WgslEffect::from_text("test.wgsl", text).unwrap().into()).into()
}

/// The image of a scene after an effect of [`AFTER`].
fn frame_after_effect(
    name: &str,
    effects: &[Effect],
    renderer: &mut dyn Renderer,
    mut scene: Scene,
    samples: u32,
) -> Frame {
    if name != "blur" {
        use_effect(&mut scene, name, &[], &[]);
    }
    let (resources, mut plan) = scene.plan(&PlanOptions { effects, ..PlanOptions::new(SIZE, samples) });
    if name == "blur" {
        plan.subframes = vec![Plan { linear: true, ..plan.clone() }; 2];
    }
    renderer.load(resources).unwrap();
    renderer.submit(plan).unwrap();
    renderer.collect(None).unwrap()
}

/// A plain color that an effect turns into a gradient, and a gradient under motion blur: means are exact within the margin, in both renderers.
#[test]
fn images_after_effects_are_dithered() {
    let effects = effects();
    for (name, samples) in AFTER.into_iter().flat_map(|name| [(name, 1), (name, 4)]) {
        let mut first: Option<Frame> = None;
        for mut renderer in renderers_with(&effects) {
            let mut scene = gradient(samples).0;
            if name != "blur" {
                scene.snapshot.background = Background::Color(Vec3::splat(0.02).extend(1.0));
            }
            let frame = frame_after_effect(name, &effects, &mut *renderer, scene, samples);
            let exact = |y: usize| match name {
                "blur" => code_at(y),
                _ => [encode(0.02 * (1.0 - 0.125 * (y as f64 + 0.5) / f64::from(SIZE[1]))); 3],
            };
            let worst = worst_mean_of(&frame, exact);
            assert!(worst <= 0.15, "{name}: {worst} codes");
            let runs = longest_run(|[x, y]| frame.rgba[4 * (y * SIZE[0] as usize + x)]);
            let rounded = longest_run(|[_, y]| exact(y)[0].round() as u8);
            let other = first.get_or_insert_with(|| frame.clone());
            let differ = frame.rgba.iter().zip(&other.rgba).filter(|(a, b)| a != b).count();
            let apart = frame.rgba.iter().zip(&other.rgba).map(|(a, b)| a.abs_diff(*b)).max();
            println!("{name}, {samples} samples: {worst:.3} codes, runs of {runs}, {differ} bytes differ");
            assert!(apart <= Some(1) && differ <= frame.rgba.len() / 20, "{name}: {differ} bytes, {apart:?}");
            assert!(
                4 * runs < 3 * rounded,
                "{name}: {runs} pixels below each other are equal, {rounded} if rounded"
            );
        }
    }
}

/// The longest vertical run of pixels with the same code.
fn longest_run(code: impl Fn([usize; 2]) -> u8) -> usize {
    let [width, height] = SIZE.map(|n| n as usize);
    let column = |x: usize| (0..height).map(|y| code([x, y])).collect::<Vec<u8>>();
    let runs = (0..width).map(|x| column(x).chunk_by(|a, b| a == b).map(<[u8]>::len).max().unwrap_or(0));
    runs.max().unwrap_or(0)
}

/// Colors that are exact 8-bit codes are not dithered by an effect that leaves them unchanged, whatever the format of the intermediate target.
#[test]
fn dithering_after_effects_keeps_exactly_representable_colors() {
    let keep = [
        "// effect: shade\nfn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> { return color; }",
        "// effect: look\n// hook: image\n\
         fn effect(at: vec2<i32>, pass_number: u32, p: array<f32, 8>) -> vec4<f32> { return picture(at); }",
    ];
    let effects: Vec<Effect> =
        keep.map(|text| WgslEffect::from_text("test.wgsl", text).unwrap().into()).into();
    for name in AFTER {
        for mut renderer in renderers_with(&effects) {
            for code in (0..=255u8).step_by(3) {
                let codes = [code, 255 - code, code / 2];
                let color = |code: u8| choreo_asset::linear_from_srgb(f64::from(code) / 255.0) as f32;
                let mut scene = Scene::ortho(2.0);
                scene.snapshot.background = Background::Color(Vec4::new(0.0, 0.0, 0.0, 1.0));
                let unlit = unlit(Vec3::from_array(codes.map(color)).extend(1.0));
                scene.at(&asset(vec![quad(9.0, 9.0)], vec![unlit], vec![]), 0.0, 0.0, 0.0);
                let frame = frame_after_effect(name, &effects, &mut *renderer, scene, 1);
                let [r, g, b] = codes;
                let exact = frame.rgba.as_chunks::<4>().0.iter().all(|pixel| *pixel == [r, g, b, 255]);
                assert!(exact, "{name}: {codes:?} became {:?}", &frame.rgba[..64]);
            }
        }
    }
}
