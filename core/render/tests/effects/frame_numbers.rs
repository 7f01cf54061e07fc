//! `time()`, `delta()`, `frame()` and `resolution()` in effects on pixels, surfaces, vertices and light: closed forms in both renderers;
//! and frames that read none of them.

use crate::common::*;
use choreo_asset::Material;
use choreo_motion::Time;
use choreo_plugin::{Effect, EffectFrame, Frame};
use choreo_render::plan::frame_key::frame_key;
use choreo_render::*;
use choreo_wgsl_effect::WgslEffect;
use glam::{DAffine3, Vec3, Vec4};

const SIZE: [u32; 2] = [200, 150];

/// Three seconds, and a time whose frame number has more than 16 bits.
const SECONDS: [f64; 2] = [3.0, 70_000.5 / 30.0];

const VALUE: &str = "
fn value(index: u32) -> f32 {
    switch index {
        case 0u: { return time() / 4000.0; }
        case 1u: { return delta() * 10.0; }
        case 2u: { return f32(frame() % 256u) / 256.0; }
        case 3u: { return f32(frame() / 256u) / 512.0; }
        case 4u: { return resolution().x / 400.0; }
        case 5u: { return resolution().y / 400.0; }
        default: { return 0.0; }
    }
}
";

/// The value of each index at 30 frames per second.
fn expected(seconds: f64) -> [f64; 6] {
    let frame = (seconds * 30.0 + 1e-6).floor();
    [
        seconds / 4000.0,
        10.0 / 30.0,
        frame.rem_euclid(256.0) / 256.0,
        (frame / 256.0).floor() / 512.0,
        f64::from(SIZE[0]) / 400.0,
        f64::from(SIZE[1]) / 400.0,
    ]
}

fn effect(name: &str, head: &str, function: &str) -> Effect {
    let text = format!("// effect: {name}\n{head}{VALUE}{function}\n");
    WgslEffect::from_text("my.wgsl", &text).unwrap_or_else(|e| panic!("{e}\n{text}")).into()
}

fn effects() -> Vec<Effect> {
    let still = |name: &str, text: &str| -> Effect {
        WgslEffect::from_text("my.wgsl", &format!("// effect: {name}\n{text}")).unwrap().into()
    };
    vec![
        effect(
            "on_pixels",
            "",
            "fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {
    return vec4(vec3(value(u32(uv.x * 20.0))), 1.0); }",
        ),
        // The first effect has more than eight parameters, which shifts the uniform rows of the others.
        effect(
            "before",
            "// hook: surface\n// param a = vec4(1, 1, 1, 1) in 0..1: a\n// param b = vec4(1, 1, 1, 1) in 0..1: b\n\
             // param c = vec3(1, 1, 1) in 0..1: c\n",
            "fn effect(color: vec4<f32>, surface: SurfaceSample, p: Parameters) -> vec4<f32> {
    return color * p.c.z * step(0.1, value(1u)); }",
        ),
        effect(
            "on_surfaces",
            "// hook: surface\n// param gain = 1 in 0..1: gain\n",
            "fn effect(color: vec4<f32>, surface: SurfaceSample, p: Parameters) -> vec4<f32> {
    return vec4(color.xyz * p.gain * value(u32((surface.world.x + 4.0 / 3.0) * 7.5)), 1.0); }",
        ),
        effect(
            "on_light",
            "// hook: lighting\n// param show = int(0) in 0..9: which\n",
            "fn effect(sample: LightSample, p: Parameters) -> vec3<f32> { return vec3(value(u32(p.show))); }",
        ),
        effect(
            "on_vertices",
            "// hook: vertex\n// reach: 1\n// param show = int(0) in 0..9: which\n",
            "fn effect(vertex: VertexSample, p: Parameters) -> vec3<f32> { return vec3(0.0, 0.5 * value(u32(p.show)), 0.0); }",
        ),
        still(
            "still",
            "fn effect(color: vec4<f32>, uv: vec2<f32>, p: Parameters) -> vec4<f32> { return color; } // time()",
        ),
        still(
            "still_surface",
            "// hook: surface\nfn time() -> f32 { return 1.0; }\n\
             fn effect(color: vec4<f32>, surface: SurfaceSample, p: Parameters) -> vec4<f32> { return color * time(); }",
        ),
    ]
}

/// A white square of half width `half` in front of a camera along −z whose view is 2 m high.
fn wall(half: f32, seconds: f64, material: Material) -> Scene {
    let mut scene = Scene::ortho(2.0);
    scene.snapshot.time = Time::from_secs(seconds);
    scene.sun(Vec3::NEG_Z, Vec3::ONE, 1.0);
    scene.add(&asset(vec![quad(half, half)], vec![material], vec![]), DAffine3::IDENTITY);
    scene
}

fn draw_scene(renderer: &mut dyn Renderer, scene: &Scene) -> Frame {
    let effects = effects();
    draw_with(renderer, scene, &PlanOptions { effects: &effects, ..PlanOptions::new(SIZE, 1) })
}

/// Calls a check with both renderers, at both times.
fn check_both_renderers(check: impl Fn(&mut dyn Renderer, &str, f64)) {
    let mut renderers: Vec<(&str, Box<dyn Renderer>)> = vec![("CPU", Box::new(CpuRenderer::new(&effects())))];
    let options = GpuOptions { effects: effects(), ..GpuOptions::default() };
    renderers.extend(vulkan(options).map(|renderer| ("Vulkan", Box::new(renderer) as Box<dyn Renderer>)));
    for (device, renderer) in &mut renderers {
        SECONDS.into_iter().for_each(|seconds| check(&mut **renderer, device, seconds));
    }
}

#[test]
fn pixel_and_surface_effects_read_the_frame_numbers() {
    check_both_renderers(|renderer, device, seconds| {
        for name in ["on_pixels", "on_surfaces"] {
            let mut scene = wall(2.0, seconds, unlit(Vec4::ONE));
            if name == "on_surfaces" {
                use_effect(&mut scene, "before", &[], &[]);
            }
            use_effect(&mut scene, name, &[], &[]);
            let frame = draw_scene(renderer, &scene);
            for (index, value) in expected(seconds).into_iter().enumerate() {
                let got = pixel(&frame, 10 * index as u32 + 5, 75);
                assert_color(got, [value; 3], &format!("{name} on {device}, value {index} at {seconds} s"));
            }
        }
    });
}

#[test]
fn light_effects_read_the_frame_numbers() {
    check_both_renderers(|renderer, device, seconds| {
        for (index, value) in expected(seconds).into_iter().enumerate() {
            let mut scene = wall(2.0, seconds, matte(Vec4::ONE));
            use_effect(&mut scene, "on_light", &[("show", index as f64)], &[]);
            let got = pixel(&draw_scene(renderer, &scene), 100, 75);
            assert_color(got, [value; 3], &format!("on {device}, value {index} at {seconds} s"));
        }
    });
}

#[test]
fn vertex_effects_read_the_frame_numbers() {
    check_both_renderers(|renderer, device, seconds| {
        for (index, value) in expected(seconds).into_iter().enumerate() {
            let mut scene = wall(0.25, seconds, unlit(Vec4::ONE));
            use_effect(&mut scene, "on_vertices", &[("show", index as f64)], &[]);
            let frame = draw_scene(renderer, &scene);
            // 75 pixels a metre, y down: the lower edge, at −0.25 m, rises by half the value.
            let bottom = 75.0 + 75.0 * (0.25 - 0.5 * value);
            let mut rows = (0..SIZE[1]).filter(|y| pixel(&frame, 100, *y)[0] > 128);
            let last = rows.next_back().map_or(0.0, f64::from);
            assert!(
                (last + 1.0 - bottom).abs() <= 0.51,
                "on {device}, value {index} at {seconds} s: {last} {bottom}"
            );
        }
    });
}

#[test]
fn frames_that_read_no_numbers_have_equal_keys() {
    let effects = effects();
    let options = PlanOptions { effects: &effects, ..PlanOptions::new(SIZE, 1) };
    let key = |name: &str, seconds: f64| {
        let mut scene = wall(1.0, seconds, matte(Vec4::ONE));
        use_effect(&mut scene, name, &[], &[]);
        let (resources, plan) = scene.plan(&options);
        let numbers = plan.post.iter().chain(&plan.scene_effects).map(|pass| pass.parameters.len()).sum();
        (frame_key(&plan, &resources, &effects), numbers)
    };
    for (name, parameters) in
        [("on_pixels", 8), ("on_surfaces", 8), ("on_light", 8), ("on_vertices", 8), ("before", 12)]
    {
        let ((early, numbers), (late, _)) = (key(name, 1.0), key(name, 2.0));
        assert!(early != late, "{name} changes with the time");
        assert_eq!(numbers, parameters + EffectFrame::NUMBERS, "{name}");
    }
    // The name occurs only in a comment, or is a function of the author's own.
    for name in ["still", "still_surface"] {
        let ((early, numbers), (late, _)) = (key(name, 1.0), key(name, 2.0));
        assert_eq!((early, numbers), (late, 8), "{name}");
    }
}
