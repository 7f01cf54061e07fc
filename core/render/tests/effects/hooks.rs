//! Effects that displace vertices, replace lighting, and read textures or previous frames: closed forms, the CPU reference, and their cost.

use crate::common::*;
use choreo_asset::*;
use choreo_image_diff::compare;
use choreo_motion::Time;
use choreo_plugin::{Effect, EffectTexture, Frame};
use choreo_render::plan::motion_blur::plan_with;
use choreo_render::*;
use choreo_stage::*;
use choreo_wgsl_effect::{TextureImage, WgslEffect};
use glam::{DAffine3, DQuat, DVec3, Vec2, Vec3, Vec4};

fn effect(name: &str, head: &str, gives: &str, body: &str) -> Effect {
    let text = format!(
        "// effect: {name}\n// param amount = 0.5 in -10..10: how much\n{head}\n{gives} {{\n{body}\n}}\n"
    );
    let paper = |_: &str| {
        let rgba = (0..16u8).flat_map(|i| [i * 16, 255 - i * 16, (i % 4) * 80, 255]).collect();
        Ok(TextureImage { size: [4, 4], rgba, file: None })
    };
    WgslEffect::with_textures("my.wgsl", &text, paper).unwrap_or_else(|e| panic!("{e}\n{text}")).into()
}

const VERTEX: &str = "fn effect(vertex: VertexSample, p: array<f32, 8>) -> vec3<f32>";
const LIGHTING: &str = "fn effect(sample: LightSample, p: array<f32, 8>) -> vec3<f32>";
const PIXEL: &str = "fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32>";
const SURFACE: &str = "fn effect(color: vec4<f32>, surface: SurfaceSample, p: array<f32, 8>) -> vec4<f32>";
const PICTURE: &str = "fn effect(at: vec2<i32>, pass_number: u32, p: array<f32, 8>) -> vec4<f32>";

fn test_effects() -> Vec<Effect> {
    let vertex = "// hook: vertex\n// reach: 0.4";
    vec![
        effect("lift", vertex, VERTEX, "return vec3(0.0, p[amount], 0.0);"),
        effect("slope", vertex, VERTEX, "return vec3(0.0, 0.0, p[amount] * vertex.world.x);"),
        effect(
            "along",
            &format!("{vertex}\n// space: model"),
            VERTEX,
            "return vec3(0.0, 0.0, p[amount] * vertex.model.x);",
        ),
        effect(
            "waves",
            vertex,
            VERTEX,
            "return vertex.normal * 0.1 * sin(9.0 * vertex.world.x + 7.0 * vertex.world.y) + vec3(0.02 * vertex.uv, 0.0);",
        ),
        effect(
            "half",
            "// hook: lighting",
            LIGHTING,
            "let h = 0.5 * sample.cosine + 0.5;\nreturn sample.base * sample.color * sample.share * h * h;",
        ),
        effect(
            "rim",
            "// hook: lighting",
            LIGHTING,
            "return sample.lit + p[amount] * (1.0 - clamp(dot(sample.normal, sample.viewer), 0.0, 1.0)) * sample.light;",
        ),
        effect(
            "paper_on_picture",
            "// texture paper = paper.png: t",
            PIXEL,
            "return color * paper(3.0 * uv);",
        ),
        effect(
            "paper_on_surface",
            "// hook: surface\n// texture paper = paper.png as data: t",
            SURFACE,
            "return vec4(color.rgb * paper(surface.world.xy).rgb, color.a);",
        ),
        effect(
            "smear",
            "// hook: image\n// passes: 2",
            PICTURE,
            "let step = select(vec2(0, 5), vec2(5, 0), pass_number == 0u);\n\
             return 0.25 * (picture(at - step) + picture(at + step)) + 0.5 * original(at) * f32(picture_size().x) / 200.0;",
        ),
        effect("before", "// hook: image\n// history: 2", PICTURE, "return previous(u32(p[amount]), at);"),
    ]
}

fn options(effects: &[Effect], samples: u32) -> PlanOptions<'_> {
    PlanOptions { effects, ..PlanOptions::new([200, 150], samples) }
}

fn add_effect(scene: &mut Scene, name: &str, amount: f64) {
    use_effect(scene, name, &[("amount", amount)], &[]);
}

/// A white square in front of a camera along −z whose view is 2 m high, lit from the front and above.
fn wall(turned: DQuat) -> Scene {
    let mut scene = Scene::ortho(2.0);
    scene.sun(Vec3::new(0.0, -0.6, -0.8), Vec3::ONE, 1.0);
    let asset = asset(vec![quad(0.5, 0.5)], vec![matte(Vec4::ONE)], vec![]);
    scene.add(&asset, DAffine3::from_quat(turned));
    scene
}

fn draw_with_effects(scene: &Scene) -> Frame {
    draw(scene, &options(&test_effects(), 1))
}

#[test]
fn a_displaced_square_equals_a_moved_one() {
    let mut lifted = wall(DQuat::IDENTITY);
    add_effect(&mut lifted, "lift", 0.25);
    let mut put = wall(DQuat::IDENTITY);
    put.snapshot.actors[0].world_from_model.translation += DVec3::new(0.0, 0.25, 0.0);
    assert_eq!(draw_with_effects(&lifted).rgba, draw_with_effects(&put).rgba);
    assert_ne!(draw_with_effects(&wall(DQuat::IDENTITY)).rgba, draw_with_effects(&put).rgba);
    // A displacement beyond the effect's reach is clamped to it.
    let mut far = wall(DQuat::IDENTITY);
    add_effect(&mut far, "lift", 9.0);
    put.snapshot.actors[0].world_from_model.translation.y = f64::from(0.4f32);
    assert_eq!(draw_with_effects(&far).rgba, draw_with_effects(&put).rgba);
}

#[test]
fn culling_counts_displacement_and_unlit_surfaces_read_no_normals() {
    let mut scene = wall(DQuat::IDENTITY);
    scene.snapshot.actors[0].world_from_model.translation.y = -1.6;
    let all = test_effects();
    let count = |scene: &Scene| scene.plan(&options(&all, 1)).1.draws.len();
    assert_eq!(count(&scene), 0);
    add_effect(&mut scene, "lift", 0.3);
    assert_eq!(count(&scene), 1, "it may be seen: its reach is 0.4 m");
}

/// A surface that a displacement tilts is lit as a tilted surface.
#[test]
fn normals_follow_displacement() {
    for (name, turned) in
        [("slope", DQuat::IDENTITY), ("along", DQuat::IDENTITY), ("along", DQuat::from_rotation_z(1.0))]
    {
        let mut scene = wall(turned);
        scene.snapshot.lights.clear();
        // The light comes from the right, so that a tilt towards −x changes the shading.
        scene.sun(Vec3::new(-0.6, 0.0, -0.8), Vec3::ONE, 1.0);
        add_effect(&mut scene, name, 0.5);
        let frame = draw_with_effects(&scene);
        // z = x / 2: the normal is (−½, 0, 1) / √(5/4), turned with the square.
        let normal = turned * (DVec3::new(-0.5, 0.0, 1.0) / 1.25f64.sqrt());
        let light = normal.dot(DVec3::new(0.6, 0.0, 0.8));
        let [r, ..] = pixel(&frame, 100, 75);
        // The diffuse color, without the share that the specular layer reflects.
        let flat = {
            let mut flat = wall(DQuat::from_rotation_arc(DVec3::Z, normal.normalize()));
            flat.snapshot.lights = scene.snapshot.lights.clone();
            pixel(&draw_with_effects(&flat), 100, 75)[0]
        };
        assert!(r.abs_diff(flat) <= 1, "{name}: {r} {flat} of {light}");
        assert!(flat.abs_diff(pixel(&draw_with_effects(&wall(turned)), 100, 75)[0]) > 3, "it can fail");
    }
}

#[test]
fn half_lambert_lighting_matches_its_formula() {
    for turn in [0.0, 0.7, 1.2] {
        let mut scene = wall(DQuat::from_rotation_x(turn));
        add_effect(&mut scene, "half", 0.0);
        let normal = DQuat::from_rotation_x(turn) * DVec3::Z;
        let cosine = normal.dot(DVec3::new(0.0, 0.6, 0.8));
        let h = 0.5 * cosine + 0.5;
        assert_color(pixel(&draw_with_effects(&scene), 100, 75), [h * h; 3], "half-Lambert");
    }
}

#[test]
fn effect_textures_are_read_at_the_given_position() {
    let mut scene = Scene::ortho(2.0);
    scene.snapshot.background = Background::Color(Vec4::ONE);
    add_effect(&mut scene, "paper_on_picture", 0.0);
    let frame = draw_with_effects(&scene);
    let rgba: Vec<u8> = (0..16u8).flat_map(|i| [i * 16, 255 - i * 16, (i % 4) * 80, 255]).collect();
    let paper = EffectTexture::new("paper", [4, 4], &rgba, true).unwrap();
    for (x, y) in [(0, 0), (57, 33), (140, 149), (199, 80)] {
        let uv = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / Vec2::new(200.0, 150.0);
        let expected = paper.sample(3.0 * uv).as_dvec4();
        assert_color(pixel(&frame, x, y), [expected.x, expected.y, expected.z], &format!("{x} {y}"));
    }
}

/// A square turned about two axes, whose texture encodes the position; its height map has a constant depth of a share of `relief`.
fn scene_with_relief(relief: f32, behind: f64) -> Scene {
    let turned = DQuat::from_rotation_y(0.6) * DQuat::from_rotation_x(-0.4);
    let mut primitive = quad(0.5, 0.5);
    primitive.tangents = vec![Vec4::new(1.0, 0.0, 0.0, 1.0); 4];
    let colors = image(64, 64, |x, y| [40 + 3 * x as u8, 20 + 3 * y as u8, 90, 255]);
    let level = image(1, 1, |_, _| [128, 128, 255, 102]);
    let material = Material {
        base_color_texture: Some(texture(0)),
        normal_texture: Some(texture(1)),
        relief,
        ..matte(Vec4::ONE)
    };
    let asset = asset(vec![primitive], vec![material], vec![colors, level]);
    let mut scene = Scene::ortho(1.2);
    scene.sun(Vec3::new(0.0, 0.0, -1.0), Vec3::ONE, 1.0);
    let at = turned * DVec3::new(0.0, 0.0, -behind);
    scene.add(&asset, DAffine3::from_rotation_translation(turned, at));
    scene
}

/// A constant parallax depth of 0.6 · 0.2 m gives the image of a square that lies that much farther back, in both renderers.
#[test]
fn parallax_mapping_equals_a_square_farther_back() {
    let effects = test_effects();
    let at = |relief: f32, behind: f64| draw(&scene_with_relief(relief, behind), &options(&effects, 1));
    let (shifted, back, flat) = (at(0.2, 0.0), at(0.0, 0.12), at(0.0, 0.0));
    let mut apart = 0;
    for (x, y) in [(100, 75), (80, 60), (115, 95), (90, 85)] {
        let (a, b, c) = (pixel(&shifted, x, y), pixel(&back, x, y), pixel(&flat, x, y));
        for channel in 0..2 {
            assert!(a[channel].abs_diff(b[channel]) <= 2, "{x} {y}: {a:?} {b:?}");
            apart += u32::from(c[channel].abs_diff(b[channel]));
        }
    }
    assert!(apart > 60, "it can fail: {apart}");
    let Some(mut renderer) = vulkan(GpuOptions { effects: effects.clone(), ..GpuOptions::default() }) else {
        return;
    };
    let gpu = draw_with(&mut renderer, &scene_with_relief(0.2, 0.0), &options(&effects, 1));
    let c = compare(&gpu, &shifted, 3).unwrap();
    assert!(c.mean < 0.35 && c.share_beyond < 0.01, "{c}");
}

/// A square that moves from left to right.
fn scene_with_moving_square(time: Time) -> Scene {
    let mut scene = wall(DQuat::IDENTITY);
    (scene.stage.settings.fps.num, scene.stage.settings.fps.den) = (10, 1);
    scene.snapshot.actors[0].world_from_model.translation.x = time.as_secs() - 0.5;
    scene
}

fn draw_at_time(renderer: &mut dyn Renderer, effects: &[Effect], time: f64, back: Option<f64>) -> Frame {
    let at = |time: Time| {
        let mut scene = scene_with_moving_square(time);
        if let Some(back) = back {
            add_effect(&mut scene, "before", back);
        }
        scene
    };
    let time = Time::from_secs(time);
    let scene = at(time);
    let resources = scene.resources();
    let made = plan_with::<()>(&resources, &scene.stage, time, &options(effects, 1), |t| Ok(at(t).snapshot));
    let (_, plan) = made.unwrap();
    assert_eq!((plan.history.len(), plan.subframes.len()), back.map_or((0, 0), |_| (2, 1)));
    renderer.load(resources).unwrap();
    renderer.submit(plan).unwrap();
    renderer.collect(None).unwrap()
}

#[test]
fn previous_frames_equal_the_frames_at_those_times() {
    let effects = test_effects();
    let mut renderers: Vec<Box<dyn Renderer>> = vec![Box::new(CpuRenderer::new(&effects))];
    let gpu = vulkan(GpuOptions { effects: effects.clone(), ..GpuOptions::default() });
    renderers.extend(gpu.map(|r| Box::new(r) as Box<dyn Renderer>));
    for renderer in &mut renderers {
        let r = renderer.as_mut();
        for (time, back, then) in [(0.5, 1.0, 0.4), (0.5, 2.0, 0.3), (0.1, 2.0, 0.0), (0.0, 1.0, 0.0)] {
            let (seen, was) =
                (draw_at_time(r, &effects, time, Some(back)), draw_at_time(r, &effects, then, None));
            let c = compare(&seen, &was, 1).unwrap();
            assert!(c.share_beyond == 0.0, "{time} {back}: {c}");
        }
        let (seen, other) = (draw_at_time(r, &effects, 0.5, Some(1.0)), draw_at_time(r, &effects, 0.5, None));
        assert!(compare(&seen, &other, 1).unwrap().share_beyond > 0.01, "it can fail");
    }
}

#[test]
fn vulkan_and_the_cpu_reference_draw_the_same_hooks() {
    let effects = test_effects();
    let Some(mut renderer) = vulkan(GpuOptions { effects: effects.clone(), ..GpuOptions::default() }) else {
        return;
    };
    let mut pictures: Vec<Frame> = vec![draw(&busy_scene(DVec3::ZERO), &options(&effects, 1))];
    let mixed: &[&str] = &["waves", "half", "paper_on_surface", "smear", "paper_on_picture"];
    let single = ["lift", "waves", "along", "half", "rim", "paper_on_picture", "paper_on_surface", "smear"];
    for names in single.iter().map(std::slice::from_ref).chain([mixed]) {
        let mut scene = busy_scene(DVec3::ZERO);
        names.iter().for_each(|name| add_effect(&mut scene, name, 0.3));
        let samples = if names.len() > 1 { 4 } else { 1 };
        let (gpu, cpu) = (
            draw_with(&mut renderer, &scene, &options(&effects, samples)),
            draw(&scene, &options(&effects, samples)),
        );
        let c = compare(&gpu, &cpu, 3).unwrap();
        println!("{names:?}: {c}");
        assert!(c.mean < 0.35 && c.share_beyond < 0.02, "{names:?}: {c}");
        for other in &pictures {
            assert!(compare(other, &cpu, 3).unwrap().share_beyond > 0.004, "{names:?} is seen, and no other");
        }
        pictures.push(cpu);
    }
}
