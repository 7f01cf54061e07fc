//! Passes of image effects that write their own textures: closed forms in both renderers, unread passes that are left out, the number of images that
//! hold the textures, and single frames against those of a sequence.

use crate::common::*;
use choreo_motion::Time;
use choreo_plugin::{
    Effect, EffectImages, EffectPlugin, EffectShader, Frame, ImageEffect, ImagePass, Manifest,
};
use choreo_render::commands::{Command, Target, record};
use choreo_render::plan::motion_blur::plan_with;
use choreo_render::*;
use choreo_wgsl_effect::WgslEffect;
use glam::{DAffine3, Vec4};

fn effect(text: &str) -> Effect {
    WgslEffect::from_text("my.wgsl", text).unwrap_or_else(|e| panic!("{e}")).into()
}

/// Textures of 1/2 and 1/4 of the image's size; the second is computed from the first and the image.
const MIXED: &str = "// effect: mixed
// hook: image
// param level = 1 in 0..1: how much of it
// pass ramp = 1/2: grows to the right and down
// pass mean = 1/4: of four pixels of ramp, times the image
fn effect(at: vec2<i32>, p: Parameters) -> vec4<f32> {
    let uv = uv_at(at);
    return p.level * vec4(ramp_uv(uv).x, mean_uv(uv).y, picture_uv(uv).z, 1.0);
}
fn ramp(at: vec2<i32>, p: Parameters) -> vec4<f32> {
    return vec4(vec2<f32>(at + 8) / 128.0, f32(ramp_size().x) / 128.0, 1.0);
}
fn four(at: vec2<i32>) -> vec4<f32> {
    return 0.25 * (ramp_at(at) + ramp_at(at + vec2(1, 0)) + ramp_at(at + vec2(0, 1)) + ramp_at(at + vec2(1, 1)));
}
fn mean(at: vec2<i32>, p: Parameters) -> vec4<f32> {
    return four(2 * at) * picture(4 * at) * original(4 * at).w;
}
";

/// Four textures of one size, of which at most three are needed at the same time.
const CHAIN: &str = "// effect: chain
// hook: image
// pass a = 1/2: 0.8
// pass b = 1/2: half of a
// pass c = 1/2: half of b
// pass d = 1/2: a without c
fn a(at: vec2<i32>, p: Parameters) -> vec4<f32> { return vec4(0.8); }
fn b(at: vec2<i32>, p: Parameters) -> vec4<f32> { return 0.5 * a_at(at); }
fn c(at: vec2<i32>, p: Parameters) -> vec4<f32> { return 0.5 * b_at(at); }
fn d(at: vec2<i32>, p: Parameters) -> vec4<f32> { return a_at(at) - c_at(at); }
fn effect(at: vec2<i32>, p: Parameters) -> vec4<f32> { return vec4(d_at(at / 2).xy, picture(at).z, 1.0); }
";

/// Writes the sizes of the images that passes write and read as colors. The texture `small` is halved four times.
const SIZES: &str = "// effect: sizes
// hook: image
// param length = 0.5 in 0..1: share of the height
// pass small = halve length to 8: its own size
fn small(at: vec2<i32>, p: Parameters) -> vec4<f32> {
    return vec4(vec2<f32>(small_size()), vec2<f32>(picture_size())) / 256.0;
}
fn effect(at: vec2<i32>, p: Parameters) -> vec4<f32> {
    let made = small_at(vec2(0));
    return vec4(made.x, made.w, f32(small_size().y) / 256.0, 1.0);
}
";

/// The same sizes without named textures: `picture` is the output of the pass before.
const SHRUNK: &str = "// effect: shrunk
// hook: image
// passes: 2
// halve: length to 8
// param length = 0.5 in 0..1: share of the height
fn effect(at: vec2<i32>, pass_number: u32, p: Parameters) -> vec4<f32> {
    if (pass_number == 0u) { return vec4(vec2<f32>(picture_size()) / 256.0, 0.0, 1.0); }
    return vec4(picture(vec2(0)).xy, f32(picture_size().x) / 256.0, 1.0);
}
";

fn test_effects() -> Vec<Effect> {
    [MIXED, CHAIN, SIZES, SHRUNK].iter().map(|text| effect(text)).collect()
}

/// A wall of one color over the whole image.
fn wall(effects: &[&str]) -> Scene {
    let mut scene = Scene::ortho(2.0);
    let material = unlit(Vec4::new(0.6, 0.5, 0.7, 1.0));
    scene.add(&asset(vec![quad(3.0, 3.0)], vec![material], vec![]), DAffine3::IDENTITY);
    effects.iter().for_each(|name| use_effect(&mut scene, name, &[], &[]));
    scene
}

fn options(effects: &[Effect], size: [u32; 2]) -> PlanOptions<'_> {
    PlanOptions { effects, ..PlanOptions::new(size, 1) }
}

/// The frame on both devices.
fn draw_on_both(scene: &Scene, effects: &[Effect], size: [u32; 2]) -> Vec<(&'static str, Frame)> {
    let options = options(effects, size);
    let mut out = vec![("CPU", draw_with(&mut CpuRenderer::new(effects), scene, &options))];
    let gpu = GpuOptions { effects: effects.to_vec(), ..GpuOptions::default() };
    out.extend(vulkan(gpu).map(|mut renderer| ("Vulkan", draw_with(&mut renderer, scene, &options))));
    out
}

/// Linear interpolation between values that each cover `scale` pixels, clamped at both ends.
fn interpolate(values: &[f64], pixel: u32, scale: f64) -> f64 {
    let place = (f64::from(pixel) + 0.5) / scale - 0.5;
    let at = |i: f64| values[i.clamp(0.0, values.len() as f64 - 1.0) as usize];
    let share = place - place.floor();
    at(place.floor()) * (1.0 - share) + at(place.floor() + 1.0) * share
}

/// The ramp texture and the mean texture of each pixel of one side, before the image's 0.5 is multiplied in.
fn ramp_and_mean(side: u32) -> [Vec<f64>; 2] {
    let ramp: Vec<f64> = (0..side.div_ceil(2)).map(|i| f64::from(i + 8) / 128.0).collect();
    let at = |i: u32| ramp[(i as usize).min(ramp.len() - 1)];
    let mean = (0..side.div_ceil(4)).map(|i| 0.25 * (at(2 * i) + at(2 * i + 1))).collect();
    [ramp, mean]
}

#[test]
fn pass_textures_have_their_scale_and_are_interpolated() {
    let effects = test_effects();
    // Also sides that are not multiples of 4: the last pixel of a texture then covers fewer pixels of the image.
    for size in [[200, 152], [201, 151]] {
        let ([ramp, _], [_, mean]) = (ramp_and_mean(size[0]), ramp_and_mean(size[1]));
        for (device, frame) in draw_on_both(&wall(&["mixed"]), &effects, size) {
            for x in [0, 1, 2, 3, 57, 100, size[0] - 2, size[0] - 1] {
                for y in [0, 1, 3, 42, 75, size[1] - 3, size[1] - 1] {
                    let expected = [interpolate(&ramp, x, 2.0), interpolate(&mean, y, 4.0), 0.7];
                    let what = format!("{x}, {y} of {size:?} on {device}");
                    assert_dithered_color(pixel(&frame, x, y), expected, &what);
                }
            }
        }
    }
}

#[test]
fn pass_textures_share_images_and_keep_the_input_readable() {
    let effects = test_effects();
    let size = [64, 48];
    // Three uses of effects with textures, one after the other.
    let scene = wall(&["mixed", "chain", "chain"]);
    for (device, frame) in draw_on_both(&scene, &effects, size) {
        assert_dithered_color(pixel(&frame, 30, 20), [0.6, 0.6, 0.7], device);
    }
    let (_, plan) = wall(&["chain"]).plan(&options(&effects, size));
    let recording = record(&plan, Default::default(), |_| 2);
    let targets = |command: &Command| match command {
        Command::PostPass { textures, to, size, .. } => Some((textures.clone(), *to, *size)),
        _ => None,
    };
    let texture = Target::Texture;
    let passes: Vec<_> = recording.commands.iter().filter_map(targets).collect();
    assert_eq!(
        passes,
        [
            (vec![], texture(0), [32, 24]),
            (vec![texture(0)], texture(1), [32, 24]),
            (vec![texture(1)], texture(2), [32, 24]),
            // Nothing reads b after c, so its image is reused; a is still read here.
            (vec![texture(0), texture(2)], texture(1), [32, 24]),
            (vec![texture(1)], Target::Image, size),
        ]
    );
    let costs = explain::frame_costs(&wall(&["chain"]).resources(), &plan, &recording);
    let what: Vec<&str> = costs.iter().map(|cost| cost.what.as_str()).collect();
    let has = |text: &str| assert!(what.contains(&text), "{text} is not among {what:#?}");
    has("effect chain, pass a: linear image 0 → texture a, 32×24");
    has("effect chain, pass d: linear image 0, a, c → texture d, 32×24");
    has("effect chain: linear image 0, d → image, 64×48");
    has("texture b, d 32×24, 16-bit floats");
    assert_eq!(what.iter().filter(|what| what.starts_with("texture ")).count(), 3);
}

#[test]
fn size_functions_return_the_sizes_of_pass_textures() {
    let effects = test_effects();
    let size = [201, 151];
    let share = |pixels: f64| pixels / 256.0;
    // 75.5 pixels are halved four times to at most 8: 201 / 16 and 151 / 16, rounded up.
    for (name, expected) in [
        ("sizes", [share(13.0), share(151.0), share(10.0)]),
        ("shrunk", [share(201.0), share(151.0), share(13.0)]),
    ] {
        for (device, frame) in draw_on_both(&wall(&[name]), &effects, size) {
            assert_color(pixel(&frame, 100, 70), expected, &format!("{name} on {device}"));
        }
    }
}

/// An effect in Rust with passes that nothing reads.
struct Counting(Manifest, Vec<ImagePass>);

impl EffectPlugin for Counting {
    fn manifest(&self) -> &Manifest {
        &self.0
    }
}

impl EffectShader for Counting {
    fn wgsl(&self) -> &str {
        "fn effect(at: vec2<i32>, pass_number: u32, p: array<f32, 8>) -> vec4<f32> {
    if (pass_number < 3u) { return vec4(0.25); }
    return picture(at) * wanted_at(at) + idle_at(at) + base_uv(vec2(0.5));
}"
    }
}

impl ImageEffect for Counting {
    fn named_passes(&self) -> &[ImagePass] {
        &self.1
    }

    fn image_row(&self, images: &EffectImages, y: u32, pass: u32, _: &[f32], row: &mut [Vec4]) {
        let texture = |number: usize, at: [u32; 2]| {
            let image = images.passes.get(number).copied().flatten();
            image.map_or(Vec4::ZERO, |image| image.at(at[0] as i32, at[1] as i32))
        };
        for (x, color) in (0..).zip(row) {
            *color = match pass {
                0..3 => Vec4::splat(0.25),
                _ => {
                    let here = images.now.at(x as i32, y as i32);
                    here * texture(2, [x, y]) + texture(1, [x, y]) + texture(0, [0, 0])
                }
            };
        }
    }
}

/// `base` is read by `idle` alone, which nothing reads: both are left out, and reading them gives 0.
#[test]
fn unread_passes_are_left_out() {
    let passes = [("base", &[][..]), ("idle", &[0]), ("wanted", &[]), ("effect", &[2])];
    let passes = passes.map(|(name, reads)| ImagePass::new(name, reads)).to_vec();
    let effects = [Effect::image(Counting(Manifest::new("counting", "1", "an example"), passes))];
    let scene = wall(&["counting"]);
    let (_, plan) = scene.plan(&options(&effects, [40, 30]));
    let numbers: Vec<u32> = plan.post.iter().map(|pass| pass.number).collect();
    assert_eq!(numbers, [2, 3]);
    for name in ["base", "idle"] {
        let what = format!("pass {name} of the effect \"counting\"");
        assert!(plan.left_out.iter().any(|out| out.part == what && out.why == "nothing reads its texture"));
    }
    for (device, frame) in draw_on_both(&scene, &effects, [40, 30]) {
        assert_color(pixel(&frame, 20, 10), [0.15, 0.125, 0.175], device);
    }
}

/// A texture of the two previous frames, a quarter as wide and high.
const TRAIL: &str = "// effect: trail
// hook: image
// history: 2
// pass old = 1/4: the two frames before
fn old(at: vec2<i32>, p: Parameters) -> vec4<f32> {
    return 0.5 * (previous(1u, 4 * at) + previous(2u, 4 * at));
}
fn effect(at: vec2<i32>, p: Parameters) -> vec4<f32> { return 0.5 * (picture(at) + old_uv(uv_at(at))); }
";

/// A frame of a square that moves to the right at 1 m/s, at ten frames per second.
fn draw_trail(renderer: &mut dyn Renderer, effects: &[Effect], frame: u32) -> Vec<u8> {
    let at = |time: Time| {
        let mut scene = Scene::ortho(2.0);
        scene.add(&asset(vec![quad(0.2, 0.2)], vec![unlit(Vec4::ONE)], vec![]), DAffine3::IDENTITY);
        (scene.stage.settings.fps.num, scene.stage.settings.fps.den) = (10, 1);
        scene.snapshot.actors[0].world_from_model.translation.x = time.as_secs() - 0.5;
        use_effect(&mut scene, "trail", &[], &[]);
        scene
    };
    let time = Time::from_secs(f64::from(frame) / 10.0);
    let scene = at(time);
    let resources = scene.resources();
    let options = options(effects, [96, 64]);
    let made = plan_with::<()>(&resources, &scene.stage, time, &options, |time| Ok(at(time).snapshot));
    renderer.load(resources).unwrap();
    renderer.submit(made.unwrap().1).unwrap();
    renderer.collect(None).unwrap().rgba
}

/// Pass textures keep nothing between frames: history comes from the scene, so a frame does not depend on the frames drawn before it.
#[test]
fn a_single_frame_equals_that_frame_of_a_sequence() {
    let effects = [effect(TRAIL)];
    let cpu = || Some(Box::new(CpuRenderer::new(&effects)) as Box<dyn Renderer>);
    let gpu = || {
        let options = GpuOptions { effects: effects.to_vec(), ..GpuOptions::default() };
        vulkan(options).map(|renderer| Box::new(renderer) as Box<dyn Renderer>)
    };
    for make in [&cpu as &dyn Fn() -> Option<Box<dyn Renderer>>, &gpu] {
        let Some(mut renderer) = make() else { continue };
        let frames: Vec<Vec<u8>> =
            (0..5).map(|frame| draw_trail(renderer.as_mut(), &effects, frame)).collect();
        for (frame, expected) in frames.iter().enumerate().rev() {
            let Some(mut alone) = make() else { continue };
            assert!(draw_trail(alone.as_mut(), &effects, frame as u32) == *expected, "frame {frame}");
        }
        assert!(frames.windows(2).all(|pair| pair[0] != pair[1]), "it can fail");
    }
}
