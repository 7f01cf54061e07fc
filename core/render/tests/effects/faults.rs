//! Faulty effects: results that are NaN or infinite, and endless loops. Both renderers draw the same image and give the same
//! warning; effects without faults give none.

use crate::common::*;
use choreo_plugin::{Effect, EffectPlugin, EffectShader, Frame, Manifest, PixelEffect};
use choreo_render::*;
use choreo_wgsl_effect::WgslEffect;
use glam::{DAffine3, Vec3, Vec4};

const PIXEL: &str = "fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32>";
const SURFACE: &str = "fn effect(color: vec4<f32>, surface: SurfaceSample, p: array<f32, 8>) -> vec4<f32>";
const LIGHTING: &str = "fn effect(sample: LightSample, p: array<f32, 8>) -> vec3<f32>";
const VERTEX: &str = "fn effect(vertex: VertexSample, p: array<f32, 8>) -> vec3<f32>";
const IMAGE: &str = "fn effect(at: vec2<i32>, pass_number: u32, p: array<f32, 8>) -> vec4<f32>";

/// Name, lines of the header, declaration, body (on line 5), and the warning, in which `PIXEL` stands for the first magenta pixel.
type Case = (&'static str, &'static str, &'static str, &'static str, &'static str);

const NOT_FINITE: &str = "the result at PIXEL is NaN or infinite; such pixels are magenta";
const ENDLESS: &str = "this loop takes more than 100000 steps at PIXEL; such pixels are magenta";

const CASES: &[Case] = &[
    ("nan", "", PIXEL, "return vec4(sqrt(uv.x - 0.3), color.gba);", NOT_FINITE),
    ("infinite", "", PIXEL, "return color / max(uv.y - 0.5, 0.0);", NOT_FINITE),
    ("alpha", "", PIXEL, "return vec4(color.rgb, log(uv.y - 0.5));", NOT_FINITE),
    ("image", "// hook: image", IMAGE, "return picture(at) / f32(max(at.x - 100, 0));", NOT_FINITE),
    (
        "two_passes",
        "// hook: image\n// passes: 2",
        IMAGE,
        "return picture(at) / f32(max(at.y - 9, 0));",
        NOT_FINITE,
    ),
    ("surface", "// hook: surface", SURFACE, "return vec4(color.rgb, sqrt(surface.world.y));", NOT_FINITE),
    (
        "background",
        "// hook: surface\n// background: true",
        SURFACE,
        "return sqrt(-surface.world.x) * color;",
        NOT_FINITE,
    ),
    ("light", "// hook: lighting", LIGHTING, "return sample.lit * sqrt(sample.light.x - 0.1);", NOT_FINITE),
    (
        "moved",
        "// hook: vertex\n// reach: 0.4",
        VERTEX,
        "return vec3(sqrt(-vertex.world.x), 0.0, 0.0);",
        "the result at a vertex is NaN or infinite; such vertices are not moved",
    ),
    ("endless", "", PIXEL, "loop { if uv.x < 0.6 || uv.x > 0.62 { break; } }\nreturn color;", ENDLESS),
    (
        "second_loop",
        "",
        PIXEL,
        "for (var i = 0; i < 4; i++) { } var x = uv.x; while x > 0.6 && x < 0.62 { x = x * 1.0; }\nreturn color * x;",
        ENDLESS,
    ),
    (
        "endless_surface",
        "// hook: surface",
        SURFACE,
        "var x = surface.world.x; loop { if x < 0.11 || x > 0.187 { break; } }\nreturn vec4(x, color.gba);",
        ENDLESS,
    ),
    (
        "endless_image",
        "// hook: image",
        IMAGE,
        "var x = at.x; while x > 100 && x < 104 { x = x | 1; }\nreturn picture(at);",
        ENDLESS,
    ),
    (
        "endless_light",
        "// hook: lighting",
        LIGHTING,
        "var x = sample.light.y; while x > 0.55 && x < 0.65 { x *= 1.0; }\nreturn sample.lit;",
        ENDLESS,
    ),
];

fn effect((name, head, gives, body, _): &Case) -> Effect {
    let text = format!("// effect: {name}\n{head}\n{gives} {{\n{body}\n}}\n");
    WgslEffect::from_text("my.wgsl", &text).unwrap_or_else(|e| panic!("{e}\n{text}")).into()
}

/// A white wall in front of a dark background, with an effect.
fn wall(name: &str) -> Scene {
    let mut scene = Scene::ortho(2.0);
    scene.sun(Vec3::new(0.0, -0.6, -0.8), Vec3::ONE, 1.0);
    scene.sun(Vec3::new(-0.6, 0.0, -0.8), Vec3::ONE, 1.0);
    scene.add(&asset(vec![quad(0.5, 0.5)], vec![matte(Vec4::ONE)], vec![]), DAffine3::IDENTITY);
    use_effect(&mut scene, name, &[], &[]);
    scene
}

fn is_magenta(pixel: &[u8]) -> bool {
    pixel[..3] == [255, 0, 255]
}

/// The image and its warnings.
fn draw_with_warnings(
    renderer: &mut dyn Renderer,
    scene: &Scene,
    effects: &[Effect],
    samples: u32,
) -> (Frame, Vec<String>) {
    let options = PlanOptions { effects, ..PlanOptions::new([200, 150], samples) };
    let frame = draw_with(renderer, scene, &options);
    (frame, renderer.take_notes())
}

/// Pixels that are magenta on one device only.
fn magenta_difference(a: &Frame, b: &Frame) -> usize {
    let pixels = a.rgba.as_chunks::<4>().0.iter().zip(b.rgba.as_chunks::<4>().0);
    pixels.filter(|(a, b)| is_magenta(*a) != is_magenta(*b)).count()
}

/// The warning of a case for an image.
fn expected_warning(case: &Case, frame: &Frame) -> String {
    let (name, .., warning) = case;
    let first = frame.rgba.as_chunks::<4>().0.iter().position(|pixel| is_magenta(pixel)).unwrap_or_default();
    let at = format!("pixel ({}, {})", first % 200, first / 200);
    let place = if *warning == ENDLESS {
        let head = case.1.lines().count().max(1);
        let keyword = ["loop", "while"].iter().find_map(|word| case.3.find(word)).unwrap();
        format!("my.wgsl:{}:{}: ", head + 3, keyword + 1)
    } else {
        String::new()
    };
    format!("{place}warning: effect \"{name}\": {}", warning.replace("PIXEL", &at))
}

#[test]
fn both_renderers_draw_faulty_pixels_magenta_and_report_them() {
    let effects: Vec<Effect> = CASES.iter().map(effect).collect();
    let mut gpu = vulkan(GpuOptions { effects: effects.clone(), ..GpuOptions::default() });
    for case in CASES {
        // Endless loops are slow, so they are drawn with one sample only.
        let is_slow = case.4 == ENDLESS;
        for samples in if is_slow { &[1][..] } else { &[1, 4] } {
            let samples = *samples;
            let scene = wall(case.0);
            let mut cpu = CpuRenderer::new(&effects);
            let (reference, notes) = draw_with_warnings(&mut cpu, &scene, &effects, samples);
            let magenta = reference.rgba.as_chunks::<4>().0.iter().filter(|pixel| is_magenta(*pixel)).count();
            assert_eq!(magenta > 0, case.2 != VERTEX, "{}: {magenta}", case.0);
            assert!(magenta < 200 * 150, "{}", case.0);
            // With several samples, the mean of a pixel need not be magenta if only some samples are faulty.
            let known = if samples == 1 { vec![expected_warning(case, &reference)] } else { notes.clone() };
            assert_eq!((notes.len(), &notes), (1, &known), "{}", case.0);
            // Once.
            assert!(
                is_slow || draw_with_warnings(&mut cpu, &scene, &effects, samples).1.is_empty(),
                "{}",
                case.0
            );
            let Some(gpu) = &mut gpu else { continue };
            gpu.set_effects(&effects).unwrap();
            let (frame, notes) = draw_with_warnings(gpu, &scene, &effects, samples);
            assert_eq!(magenta_difference(&frame, &reference), 0, "{} with {samples} samples", case.0);
            assert_eq!(notes, known, "{} with {samples} samples", case.0);
        }
    }
}

/// Name, lines of the header, declaration, body (faulty if `p[0]` is ½), the warning, and whether the faulty image equals that without the effect.
type PartCase = (&'static str, &'static str, &'static str, &'static str, &'static str, bool);

/// Effects that run while a frame is planned, for both renderers.
const PARTS: &[PartCase] = &[
    (
        "hull",
        "// hook: outline",
        "fn effect(p: array<f32, 8>) -> InvertedHull",
        "return InvertedHull(9.0, vec3(1.0, 0.0, sqrt(-p[0])), 0.0);",
        "the result for the outline is NaN or infinite; no outline is drawn",
        true,
    ),
    (
        "wide",
        "// hook: outline",
        "fn effect(p: array<f32, 8>) -> InvertedHull",
        "return InvertedHull(9.0 / (0.5 - p[0]), vec3(1.0, 0.0, 0.0), 0.0);",
        "",
        false,
    ),
    (
        "width",
        "// hook: outline",
        "fn effect(p: array<f32, 8>) -> InvertedHull",
        "return InvertedHull(9.0 + sqrt(-p[0]), vec3(1.0, 0.0, 0.0), 0.0);",
        "the result for the outline is NaN or infinite; no outline is drawn",
        true,
    ),
    (
        "edges",
        "// hook: outline",
        "fn effect(p: array<f32, 8>) -> Wireframe",
        "return Wireframe(vec3(1.0, sqrt(-p[0]), 0.0));",
        "the result for the wireframe is NaN or infinite; no wireframe is drawn",
        true,
    ),
    (
        "blur",
        "// hook: shutter",
        "fn effect(p: array<f32, 8>) -> Shutter",
        "return Shutter(4u, 180.0 * sqrt(-p[0]), 0.5);",
        "the result for the shutter is NaN or infinite; there is no motion blur",
        true,
    ),
    (
        "lines",
        "// hook: overlay\n// count: 3",
        "fn effect(index: u32, actor: ActorSample, p: array<f32, 8>) -> Line",
        "let bad = select(0.0, sqrt(-p[0]), index == 1u);\nreturn Line(vec3(f32(index) * 0.1 + bad, -1.0, 0.0), vec3(f32(index) * 0.1, 1.0, 0.0), 2.0, vec4(1.0, 0.0, 0.0, 1.0));",
        "the result for a line or point is NaN or infinite; such lines are not drawn",
        false,
    ),
    (
        "fan",
        "// hook: overlay\n// count: 3",
        "fn effect(index: u32, actor: ActorSample, p: array<f32, 8>) -> Triangle",
        "return Triangle(vec3(0.0), vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), vec4(1.0, 0.0, 0.0, 1.0 + sqrt(-p[0])));",
        "the result for a triangle is NaN or infinite; such triangles are not drawn",
        true,
    ),
    (
        "slow_hull",
        "// hook: outline",
        "fn effect(p: array<f32, 8>) -> InvertedHull",
        "var x = 0.0; loop { x += 1.0; if x > 3.0 && abs(p[0] - 0.5) > 0.2 { break; } }\nreturn InvertedHull(9.0, vec3(x, 0.0, 0.0), 0.0);",
        "this loop takes more than 100000 steps for the outline; no outline is drawn",
        true,
    ),
];

#[test]
fn faults_of_effects_that_run_while_planning_are_reported() {
    let text = |(name, head, gives, body, ..): &PartCase| {
        format!("// effect: {name}\n{head}\n// param bad = 0 in 0..1: ½ = faulty\n{gives} {{\n{body}\n}}\n")
    };
    let effects: Vec<Effect> = PARTS
        .iter()
        .map(|case| WgslEffect::from_text("my.wgsl", &text(case)).unwrap_or_else(|e| panic!("{e}")).into())
        .collect();
    let mut devices: Vec<Box<dyn Renderer>> = vec![Box::new(CpuRenderer::new(&effects))];
    let gpu = vulkan(GpuOptions { effects: effects.clone(), ..GpuOptions::default() });
    devices.extend(gpu.map(|gpu| Box::new(gpu) as Box<dyn Renderer>));
    let scene = |name: &str, bad: f64| {
        let mut scene = Scene::ortho(2.0);
        scene.add(&asset(vec![cube(0.5)], vec![matte(Vec4::ONE)], vec![]), DAffine3::IDENTITY);
        use_effect(&mut scene, name, &[("bad", bad)], &[]);
        scene
    };
    for device in &mut devices {
        device.set_effects(&effects).unwrap();
        let plain = draw_with_warnings(&mut **device, &scene("unknown", 0.0), &effects, 1).0;
        for (name, _, _, _, warning, nothing) in PARTS {
            let (good, notes) = draw_with_warnings(&mut **device, &scene(name, 0.0), &effects, 1);
            assert_eq!(notes, Vec::<String>::new(), "{name}");
            // Motion blur of a static scene gives the same image.
            assert!(*name == "blur" || good.rgba != plain.rgba, "{name} shows");
            let (bad, notes) = draw_with_warnings(&mut **device, &scene(name, 0.5), &effects, 1);
            let loops = if warning.starts_with("this loop") { "my.wgsl:5:14: " } else { "" };
            let known = format!("{loops}warning: effect \"{name}\": {warning}");
            let known = if warning.is_empty() { Vec::new() } else { vec![known] };
            assert_eq!(notes, known, "{name}");
            assert_eq!(bad.rgba == plain.rgba, *nothing, "{name}");
            assert!(
                draw_with_warnings(&mut **device, &scene(name, 0.5), &effects, 1).1.is_empty(),
                "{name}: once"
            );
        }
    }
}

/// The comparison finds a shader that does not check for NaN, and one that records no fault.
#[test]
fn the_comparison_fails_without_the_fault_check_in_shaders() {
    let folder = std::env::temp_dir().join(format!("choreo_effect_faults_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let (_, text) = choreo_shaders::MODULES.iter().find(|(name, _)| *name == "effect_faults.wgsl").unwrap();
    let case = &CASES[0];
    let effects = [effect(case)];
    let scene = wall(case.0);
    let (reference, _) = draw_with_warnings(&mut CpuRenderer::new(&effects), &scene, &effects, 1);
    for (line, planted) in [
        (
            "let failed = effect_loop != 0u || any(exponents == vec4(0x7f800000u));",
            "let failed = effect_loop != 0u;",
        ),
        ("atomicMin(&effect_faults[", "atomicMax(&effect_faults["),
    ] {
        let faulty = text.replace(line, planted);
        assert_ne!(faulty, *text);
        std::fs::write(folder.join("effect_faults.wgsl"), faulty).unwrap();
        let options = GpuOptions {
            effects: effects.to_vec(),
            shader_dir: Some(folder.clone()),
            ..GpuOptions::default()
        };
        let Some(mut gpu) = vulkan(options) else { break };
        let (frame, notes) = draw_with_warnings(&mut gpu, &scene, &effects, 1);
        assert!(magenta_difference(&frame, &reference) > 0 || notes.is_empty(), "{planted}");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

/// An effect in Rust that paints everything red. Its trait requires both the CPU function and the WGSL.
struct Red(Manifest);

impl EffectPlugin for Red {
    fn manifest(&self) -> &Manifest {
        &self.0
    }
}

impl EffectShader for Red {
    fn wgsl(&self) -> &str {
        "fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> { return vec4(1.0, 0.0, 0.0, 1.0); }"
    }
}

impl PixelEffect for Red {
    fn pixels(&self, colors: &mut [Vec4], _: &[glam::Vec2], _: &[f32]) {
        colors.fill(Vec4::new(1.0, 0.0, 0.0, 1.0));
    }
}

#[test]
fn an_effect_in_rust_is_drawn_by_both_renderers() {
    let effects = [Effect::pixel(Red(Manifest::new("red", "1", "")))];
    let mut devices: Vec<Box<dyn Renderer>> = vec![Box::new(CpuRenderer::new(&effects))];
    let gpu = vulkan(GpuOptions { effects: effects.to_vec(), ..GpuOptions::default() });
    devices.extend(gpu.map(|gpu| Box::new(gpu) as Box<dyn Renderer>));
    for device in &mut devices {
        let red = draw_with_warnings(&mut **device, &wall("red"), &effects, 1).0;
        assert!(red.rgba.as_chunks::<4>().0.iter().all(|pixel| *pixel == [255, 0, 0, 255]));
        let plain = draw_with_warnings(&mut **device, &wall("unknown"), &effects, 1).0;
        assert_ne!(red.rgba, plain.rgba, "it can fail");
    }
}
