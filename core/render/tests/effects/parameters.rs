//! Parameters of every type, 64 numbers in all, in every hook that shaders run: closed forms in both renderers.

use crate::common::*;
use choreo_asset::Material;
use choreo_plugin::{Effect, Frame};
use choreo_render::*;
use choreo_wgsl_effect::WgslEffect;
use glam::{DAffine3, DVec3, Vec3, Vec4};

/// 64 numbers: 1 + 1 + 1 + 1 + 3 + 2 + 3 + 4 + 16 + 16 + 1 + 15.
const HEAD: &str = "\
// param gain = 0.5 m in 0..1: a number
// param count = int(3) in 0..9: a whole number
// param on = true: a flag
// param mode = soft of soft|hard: a text
// param tint = color(#ff8000): a color
// param drift = vec2(0.25, -0.5) in -1..1: two numbers
// param way = vec3(0, 1, 0) in -1..1: three numbers
// param mask = vec4(0.1, 0.2, 0.3, 0.4) in 0..1: four numbers
// param fall = curve(0 0, 0.2 0.9, 1 0.1) in 0..1: a curve
// param rise = curve(0 0.25, 1 0.75) in 0..1: another curve
// param show = int(0) in 0..99: which of them is shown
// param a = vec4(0, 0, 0, 0) in 0..1: room
// param b = vec4(0, 0, 0, 0) in 0..1: room
// param c = vec4(0, 0, 0, 0) in 0..1: room
// param d = vec3(0, 0, 0.3) in 0..1: room
";

const VALUE: &str = "
fn value(index: u32, p: Parameters) -> f32 {
    switch index {
        case 0u: { return p.gain; }
        case 1u: { return f32(p.count) / 9.0; }
        case 2u: { return select(0.125, 1.0, p.on); }
        case 3u: { return select(0.2, 0.7, p.mode == MODE_HARD); }
        case 4u, 5u, 6u: { return p.tint[index - 4u]; }
        case 7u, 8u: { return 0.5 + 0.5 * p.drift[index - 7u]; }
        case 9u, 10u, 11u: { return 0.5 + 0.5 * p.way[index - 9u]; }
        case 12u, 13u, 14u, 15u: { return p.mask[index - 12u]; }
        case 16u: { return curve_at(p.fall, 0.25); }
        case 17u: { return curve_at(p.rise, 0.4); }
        case 18u: { return p.d.z; }
        default: { return 0.0; }
    }
}
";

const GIVEN: [(&str, f64); 9] = [
    ("gain", 0.8),
    ("count", 7.0),
    ("on", 0.0),
    ("mode", 1.0),
    ("tint_g", 0.6),
    ("drift_y", 1.0),
    ("way_z", -1.0),
    ("mask_w", 0.9),
    ("d_z", 0.7),
];

/// Value of each index, with the given or the default parameters. sRGB is decoded by IEC 61966-2-1.
fn expected(is_given: bool) -> [f64; 19] {
    let orange = ((128.0 / 255.0 + 0.055f64) / 1.055).powf(2.4);
    let mut all = [
        0.5,
        3.0 / 9.0,
        1.0,
        0.2,
        1.0,
        orange,
        0.0,
        0.625,
        0.25,
        0.5,
        1.0,
        0.5,
        0.1,
        0.2,
        0.3,
        0.4,
        0.9 - 0.8 * 0.05 / 0.8,
        0.25 + 0.4 * 0.5,
        0.3,
    ];
    if is_given {
        let changes = [
            (0, 0.8),
            (1, 7.0 / 9.0),
            (2, 0.125),
            (3, 0.7),
            (5, 0.6),
            (8, 1.0),
            (11, 0.0),
            (15, 0.9),
            (18, 0.7),
        ];
        changes.into_iter().for_each(|(index, value)| all[index] = value);
    }
    all
}

fn effect(name: &str, head: &str, function: &str) -> Effect {
    let text = format!("// effect: {name}\n{head}{HEAD}{VALUE}{function}\n");
    WgslEffect::from_text("my.wgsl", &text).unwrap_or_else(|e| panic!("{e}\n{text}")).into()
}

fn effects() -> Vec<Effect> {
    vec![
        effect(
            "on_pixels",
            "",
            "fn effect(color: vec4<f32>, uv: vec2<f32>, p: Parameters) -> vec4<f32> {
    return vec4(vec3(value(u32(uv.x * 20.0), p)), 1.0); }",
        ),
        effect(
            "on_image",
            "// hook: image\n",
            "fn effect(at: vec2<i32>, pass_number: u32, p: Parameters) -> vec4<f32> {
    return vec4(vec3(value(u32(at.x) / 10u, p)), 1.0); }",
        ),
        // This effect's parameters come before those of the other effects on surfaces.
        effect(
            "before",
            "// hook: surface\n",
            "fn effect(color: vec4<f32>, surface: SurfaceSample, p: Parameters) -> vec4<f32> { return color * p.d.z; }",
        ),
        effect(
            "on_surfaces",
            "// hook: surface\n",
            "fn effect(color: vec4<f32>, surface: SurfaceSample, p: Parameters) -> vec4<f32> {
    return vec4(vec3(value(u32((surface.world.x + 4.0 / 3.0) * 7.5), p)), 1.0); }",
        ),
        effect(
            "on_light",
            "// hook: lighting\n",
            "fn effect(sample: LightSample, p: Parameters) -> vec3<f32> { return vec3(value(u32(p.show), p)); }",
        ),
        effect(
            "on_vertices",
            "// hook: vertex\n// reach: 1\n",
            "fn effect(vertex: VertexSample, p: Parameters) -> vec3<f32> { return vec3(0.0, 0.5 * value(u32(p.show), p), 0.0); }",
        ),
    ]
}

/// A white square of half width `half` in front of a camera along −z whose view is 2 m high.
fn wall(half: f32, material: Material) -> Scene {
    let mut scene = Scene::ortho(2.0);
    scene.sun(Vec3::NEG_Z, Vec3::ONE, 1.0);
    scene.add(&asset(vec![quad(half, half)], vec![material], vec![]), DAffine3::IDENTITY);
    scene
}

fn draw_scene(renderer: &mut dyn Renderer, scene: &Scene) -> Frame {
    let effects = effects();
    draw_with(renderer, scene, &PlanOptions { effects: &effects, ..PlanOptions::new([200, 150], 1) })
}

/// Calls a check with both renderers.
fn check_both_renderers(check: impl Fn(&mut dyn Renderer, &str)) {
    check(&mut CpuRenderer::new(&effects()), "CPU");
    if let Some(mut renderer) = vulkan(GpuOptions { effects: effects(), ..GpuOptions::default() }) {
        check(&mut renderer, "Vulkan");
    }
}

#[test]
fn pixel_image_and_surface_effects_get_parameters_of_each_type() {
    check_both_renderers(|renderer, device| {
        for (name, is_given) in ["on_pixels", "on_image", "on_surfaces"]
            .into_iter()
            .flat_map(|name| [(name, false), (name, true)])
        {
            let mut scene = wall(2.0, unlit(Vec4::ONE));
            if name == "on_surfaces" {
                use_effect(&mut scene, "before", &[("count", 9.0), ("fall_3", 0.1)], &[]);
            }
            use_effect(&mut scene, name, if is_given { &GIVEN } else { &[] }, &[]);
            let frame = draw_scene(renderer, &scene);
            for (index, value) in expected(is_given).into_iter().enumerate() {
                let got = pixel(&frame, 10 * index as u32 + 5, 75);
                let what = format!("{name} on {device}, value {index}, given {is_given}");
                assert_dithered_color(got, [value; 3], &what);
            }
        }
    });
}

#[test]
fn light_and_vertex_effects_get_parameters_of_each_type() {
    check_both_renderers(|renderer, device| {
        for (index, value) in expected(true).into_iter().enumerate() {
            let given: Vec<(&str, f64)> = GIVEN.into_iter().chain([("show", index as f64)]).collect();
            let mut scene = wall(0.5, matte(Vec4::ONE));
            use_effect(&mut scene, "before", &[("d_z", 1.0)], &[]);
            use_effect(&mut scene, "on_light", &given, &[]);
            use_effect(&mut scene, "on_vertices", &given, &[]);
            let frame = draw_scene(renderer, &scene);
            let what = format!("{device}, value {index}");
            // The square's center is 0.5 m · value above the center of the image, at 75 pixels per metre.
            let middle = 75 - (37.5 * value) as u32;
            assert_color(pixel(&frame, 100, middle), [value; 3], &what);
            let mut put = wall(0.5, unlit(Vec4::new(1.0, 0.0, 0.0, 1.0)));
            put.snapshot.actors[0].world_from_model.translation += DVec3::new(0.0, 0.5 * value, 0.0);
            let put = draw_scene(renderer, &put);
            let background = pixel(&frame, 5, 75);
            let covers = |frame: &Frame, y: u32| pixel(frame, 100, y) != background;
            // A value equal to the background's color cannot be distinguished from it.
            if value > 0.0 {
                let rows = (0..150).filter(|y| covers(&frame, *y) != covers(&put, *y)).count();
                assert!(rows <= 1, "{what}: {rows} rows differ");
            }
        }
    });
}

/// The uniform data of surface effects and of a pass depend only on the number of declared parameters.
#[test]
fn uniform_bytes_grow_with_declared_parameters() {
    let small = WgslEffect::from_text(
        "small.wgsl",
        "// effect: small\n// hook: surface\n// param gain = 0.5 in 0..1: a number\n\
         fn effect(color: vec4<f32>, surface: SurfaceSample, p: Parameters) -> vec4<f32> { return color * p.gain; }",
    );
    let mut effects = effects();
    effects.push(small.unwrap().into());
    let rows = |names: &[&str]| {
        let mut scene = wall(0.5, unlit(Vec4::ONE));
        names.iter().for_each(|name| use_effect(&mut scene, name, &[], &[]));
        let (_, plan) = scene.plan(&PlanOptions { effects: &effects, ..PlanOptions::new([200, 150], 1) });
        let post = plan.post.iter().map(|pass| pass.parameters.len()).sum::<usize>();
        (plan.surface_rows(), post)
    };
    assert_eq!(rows(&[]), (0, 0));
    assert_eq!(rows(&["small"]), (2 + 2, 0));
    assert_eq!(rows(&["on_surfaces", "small", "on_pixels"]), (2 + 16 + 2, 64));
}

/// Edge steps have the same width in pixels in every image, so FXAA's search distance does not scale with a preview; film grain does.
#[test]
fn previews_smooth_edges_at_their_own_size() {
    let all = effects::named(&["fxaa", "film_grain"]);
    let bytes = |effect: &str, preview_of: Option<[u32; 2]>| {
        let mut scene = wall(0.5, unlit(Vec4::new(0.3, 0.3, 0.3, 1.0)));
        scene.snapshot.actors[0].world_from_model *= DAffine3::from_rotation_z(0.2);
        use_effect(&mut scene, effect, &[], &[]);
        let options = PlanOptions { effects: &all, preview_of, ..PlanOptions::new([200, 150], 1) };
        draw(&scene, &options).rgba
    };
    assert_eq!(bytes("fxaa", Some([800, 600])), bytes("fxaa", None));
    assert_ne!(bytes("film_grain", Some([800, 600])), bytes("film_grain", None));
}
