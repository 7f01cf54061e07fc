//! Inputs of effects on images against closed forms in f64, on both renderers: depth, normals, motion vectors, actors, camera, time
//! and sun; with one and four samples, in tiles, with motion blur; and which inputs a frame leaves out.

use crate::common::*;
use choreo_asset::*;
use choreo_motion::Time;
use choreo_plugin::{Effect, Frame};
use choreo_render::plan::motion_blur::plan_with;
use choreo_render::*;
use choreo_stage::*;
use choreo_wgsl_effect::WgslEffect;
use glam::{DAffine3, DQuat, DVec2, DVec3, Vec3, Vec4};
use std::sync::Arc;

const SIZE: [u32; 2] = [120, 90];
const YFOV: f64 = 0.9;
const DISTANCE: f64 = 5.0;

/// An effect that writes a number from 0 to 1 as 24 bits in the three color channels of a pixel.
fn probe(name: &str, number: &str) -> Effect {
    let text = format!(
        "// effect: {name}\n// hook: image\n// off: amount = 0\n// param amount = 1 in 0..1: on or off\n\
         fn byte(b: f32) -> f32 {{ let c = b / 255.0; return select(pow((c + 0.055) / 1.055, 2.4), c / 12.92, c <= 0.04045); }}\n\
         fn effect(at: vec2<i32>, pass_number: u32, p: array<f32, 8>) -> vec4<f32> {{\n\
         let x = floor(clamp({number}, 0.0, 0.9999999) * 16777216.0);\n\
         let r = floor(x / 65536.0);\nlet g = floor((x - r * 65536.0) / 256.0);\n\
         return vec4(byte(r), byte(g), byte(x - r * 65536.0 - g * 256.0), 1.0);\n}}\n"
    );
    WgslEffect::from_text("probe.wgsl", &text).unwrap_or_else(|e| panic!("{e}\n{text}")).into()
}

fn read_number(frame: &Frame, x: u32, y: u32) -> f64 {
    let [r, g, b, _] = pixel(frame, x, y).map(f64::from);
    (r * 65536.0 + g * 256.0 + b + 0.5) / 16_777_216.0
}

fn probes() -> Vec<Effect> {
    let mut all = vec![
        probe("depth", "depth_at(at) / 16.0"),
        probe("normal_x", "normal_at(at).x * 0.5 + 0.5"),
        probe("normal_y", "normal_at(at).y * 0.5 + 0.5"),
        probe("normal_z", "normal_at(at).z * 0.5 + 0.5"),
        probe("view_x", "view_at(at).x / 16.0 + 0.5"),
        probe("view_y", "view_at(at).y / 16.0 + 0.5"),
        probe("moved_x", "motion_at(at).x / 64.0 + 0.5"),
        probe("moved_y", "motion_at(at).y / 64.0 + 0.5"),
        probe("actor", "f32(actor_at(at)) / 16.0"),
        probe("beyond", "depth_at(at + vec2<i32>(100000, 0)) / 16.0"),
        probe("round", "distance(pixel_of(view_at(at)), vec2<f32>(at) + 0.5) * 4.0"),
        probe("world_z", "(world_from_view() * vec4<f32>(view_at(at), 1.0)).z / 16.0 + 0.5"),
        probe(
            "inverse",
            "length(view_from_clip() * clip_from_view() * vec4<f32>(0.1, 0.2, -0.3, 1.0) - vec4<f32>(0.1, 0.2, -0.3, 1.0))",
        ),
        probe("clock", "time() / 8.0"),
        probe("number", "(f32(frame()) + delta()) / 256.0"),
        probe("sun", "sun_at().x / 256.0 * sun_at().z"),
    ];
    all.extend(effects::named(&["motion_blur"]));
    all
}

/// The frame of one probe effect in each renderer.
fn draw_probe(
    scene: &Scene,
    name: &str,
    options: &PlanOptions,
    before: Option<&Snapshot>,
) -> Vec<(&'static str, Frame)> {
    let effects = probes();
    let mut scene = Scene { stage: scene.stage.clone(), snapshot: scene.snapshot.clone() };
    use_effect(&mut scene, name, &[("amount", 1.0)], &[]);
    let options = PlanOptions { effects: &effects, moved_from: before, ..options.clone() };
    let mut out = vec![("CPU", draw_with(&mut CpuRenderer::new(&effects), &scene, &options))];
    if let Some(mut renderer) = vulkan(GpuOptions { effects: effects.clone(), ..GpuOptions::default() }) {
        out.push(("Vulkan", draw_with(&mut renderer, &scene, &options)));
    }
    out
}

/// Ray of a pixel in view space, with a depth of one metre.
fn view_ray_of_pixel(x: u32, y: u32) -> DVec3 {
    let t = (YFOV * 0.5).tan();
    let [w, h] = SIZE.map(f64::from);
    let ndc = DVec2::new((f64::from(x) + 0.5) / w * 2.0 - 1.0, 1.0 - (f64::from(y) + 0.5) / h * 2.0);
    DVec3::new(ndc.x * t * w / h, ndc.y * t, -1.0)
}

/// World position at which a pixel's ray meets a plane. The camera is at (0, 0, `DISTANCE`).
fn intersect_plane(x: u32, y: u32, point: DVec3, normal: DVec3) -> DVec3 {
    let eye = DVec3::new(0.0, 0.0, DISTANCE);
    let way = view_ray_of_pixel(x, y);
    eye + way * ((point - eye).dot(normal) / way.dot(normal))
}

fn pixel_of(world: DVec3, eye: DVec3) -> DVec2 {
    let v = world - eye;
    let t = (YFOV * 0.5).tan();
    let [w, h] = SIZE.map(f64::from);
    let ndc = DVec2::new(v.x / (-v.z * t * w / h), -v.y / (-v.z * t));
    (ndc * 0.5 + 0.5) * DVec2::new(w, h)
}

fn scene_with_tilted_plane() -> (Scene, DVec3, DVec3) {
    let mut scene = Scene::perspective(YFOV as f32, DISTANCE);
    let asset = asset(vec![quad(1.2, 0.9)], vec![matte(Vec4::ONE)], vec![]);
    let turn = DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(0.3);
    let at = DVec3::new(0.2, -0.1, 0.5);
    scene.at(&self::asset_of_triangle(), -50.0, 0.0, 0.0);
    scene.add(&asset, DAffine3::from_rotation_translation(turn, at));
    (scene, at, turn * DVec3::Z)
}

/// A mesh for an actor out of view, so that the actor in view is the second one.
fn asset_of_triangle() -> Arc<Asset> {
    asset(vec![triangle(Vec3::ZERO, Vec3::X, Vec3::Y)], vec![matte(Vec4::ONE)], vec![])
}

/// Pixels that the plane covers.
const INSIDE: [[u32; 2]; 5] = [[60, 45], [52, 38], [70, 50], [55, 55], [66, 35]];

#[track_caller]
fn assert_near(frames: &[(&str, Frame)], what: &str, bound: f64, expected: impl Fn(u32, u32) -> f64) {
    for (renderer, frame) in frames {
        for [x, y] in INSIDE {
            let (is, should) = (read_number(frame, x, y), expected(x, y));
            assert!((is - should).abs() < bound, "{what} on {renderer} at {x}, {y}: {is}, not {should}");
        }
    }
}

#[test]
fn depth_and_normals_of_a_plane_match_closed_forms() {
    let (scene, at, n) = scene_with_tilted_plane();
    let n = if n.z < 0.0 { -n } else { n };
    for samples in [1, 4] {
        let options = PlanOptions::new(SIZE, samples);
        let probe = |name: &str| draw_probe(&scene, name, &options, None);
        let depth = probe("depth");
        assert_near(&depth, "depth", 1e-6, |x, y| (DISTANCE - intersect_plane(x, y, at, n).z) / 16.0);
        assert_near(&probe("view_x"), "view x", 1e-6, |x, y| intersect_plane(x, y, at, n).x / 16.0 + 0.5);
        assert_near(&probe("view_y"), "view y", 1e-6, |x, y| intersect_plane(x, y, at, n).y / 16.0 + 0.5);
        assert_near(&probe("world_z"), "world z", 1e-6, |x, y| intersect_plane(x, y, at, n).z / 16.0 + 0.5);
        // Stored normals have 16 bits.
        assert_near(&probe("normal_x"), "normal x", 1e-4, |_, _| n.x * 0.5 + 0.5);
        assert_near(&probe("normal_y"), "normal y", 1e-4, |_, _| n.y * 0.5 + 0.5);
        assert_near(&probe("normal_z"), "normal z", 1e-4, |_, _| n.z * 0.5 + 0.5);
        assert_near(&probe("actor"), "actor", 1e-6, |_, _| 2.0 / 16.0);
        assert_near(&probe("round"), "a pixel's place", 4e-3, |_, _| 0.0);
        assert_near(&probe("inverse"), "inverse projection", 1e-5, |_, _| 0.0);
        for (renderer, frame) in &depth {
            assert!(read_number(frame, 1, 1) > 0.99, "{renderer}: nothing is there");
        }
        // Outside of the image the nearest pixel is read, which shows no surface here.
        assert_near(&probe("beyond"), "beyond the border", 1e-6, |_, _| 1.0);
    }
    // The comparison finds a plane at another distance.
    let (scene, ..) = scene_with_tilted_plane();
    let frames = draw_probe(&scene, "depth", &PlanOptions::new(SIZE, 1), None);
    let off = |x, y| (DISTANCE - intersect_plane(x, y, at + DVec3::Z * 0.001, n).z) / 16.0;
    let (_, frame) = &frames[0];
    assert!(INSIDE.iter().all(|[x, y]| (read_number(frame, *x, *y) - off(*x, *y)).abs() > 1e-6));
}

#[test]
fn a_mesh_without_normals_uses_triangle_normals() {
    let mut scene = Scene::perspective(YFOV as f32, DISTANCE);
    let bare = Primitive { normals: Vec::new(), ..quad(1.2, 0.9) };
    let material = Material { double_sided: true, ..unlit(Vec4::ONE) };
    let turn = DQuat::from_rotation_y(0.6 + std::f64::consts::PI);
    scene.add(&asset(vec![bare], vec![material], vec![]), DAffine3::from_quat(turn));
    // Normals point towards the viewer on both sides.
    let n = -(turn * DVec3::Z);
    let options = PlanOptions::new(SIZE, 1);
    assert_near(&draw_probe(&scene, "normal_x", &options, None), "normal x", 1e-4, |_, _| n.x * 0.5 + 0.5);
    assert_near(&draw_probe(&scene, "normal_z", &options, None), "normal z", 1e-4, |_, _| n.z * 0.5 + 0.5);
}

#[test]
fn motion_vectors_of_a_moving_plane_and_camera_match_closed_forms() {
    let (mut scene, at, n) = scene_with_tilted_plane();
    let before = scene.snapshot.clone();
    // The plane moves to the right and away, the camera moves up.
    let (moved, eye) = (DVec3::new(0.11, 0.0, -0.2), DVec3::new(0.0, -0.05, DISTANCE));
    let mut then = before;
    then.actors[1].world_from_model.translation -= moved;
    then.camera.world_from_view.translation = eye;
    for samples in [1, 4] {
        let options = PlanOptions::new(SIZE, samples);
        let vector = |x: u32, y: u32| {
            let now = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            now - pixel_of(intersect_plane(x, y, at, n) - moved, eye)
        };
        let [right, down] =
            ["moved_x", "moved_y"].map(|name| draw_probe(&scene, name, &options, Some(&then)));
        assert_near(&right, "x", 3e-6, |x, y| vector(x, y).x / 64.0 + 0.5);
        assert_near(&down, "y", 3e-6, |x, y| vector(x, y).y / 64.0 + 0.5);
        // The comparison finds motion vectors that ignore the camera.
        let (_, frame) = &down[0];
        let faulty =
            |x, y| f64::from(y) + 0.5 - pixel_of(intersect_plane(x, y, at, n) - moved, DVec3::Z * DISTANCE).y;
        assert!(
            INSIDE
                .iter()
                .all(|[x, y]| (read_number(frame, *x, *y) - faulty(*x, *y) / 64.0 - 0.5).abs() > 1e-4)
        );
    }
    // Motion is zero without a previous frame, and where there is no surface.
    scene.snapshot.time = Time::ZERO;
    assert_near(&draw_probe(&scene, "moved_x", &PlanOptions::new(SIZE, 1), None), "rest", 1e-6, |_, _| 0.5);
}

#[test]
fn motion_vectors_follow_joints_and_morph_targets() {
    let options = PlanOptions::new(SIZE, 1);
    let eye = DVec3::Z * DISTANCE;
    let offset = DVec3::new(0.4, 0.25, 0.0);
    // A morph target that moves all vertices: weight ½ now, ¼ in the frame before.
    let mut shape = quad(1.2, 0.9);
    shape.morphs = vec![MorphTarget { positions: vec![offset.as_vec3(); 4], ..MorphTarget::default() }];
    let mut scene = Scene::perspective(YFOV as f32, DISTANCE);
    scene.at(&asset(vec![shape], vec![matte(Vec4::ONE)], vec![]), 0.0, 0.0, 0.0);
    scene.snapshot.actors[0].morph_weights = vec![vec![0.5]];
    let mut then = scene.snapshot.clone();
    then.actors[0].morph_weights = vec![vec![0.25]];
    let expected = |moved: DVec3| {
        move |x: u32, y: u32| {
            let place = intersect_plane(x, y, DVec3::ZERO, DVec3::Z);
            (f64::from(x) + 0.5 - pixel_of(place - moved, eye).x) / 64.0 + 0.5
        }
    };
    assert_near(
        &draw_probe(&scene, "moved_x", &options, Some(&then)),
        "morph",
        3e-6,
        expected(offset * 0.25),
    );
    // A joint that only translates; all vertices are bound to it.
    let raised = Primitive {
        positions: quad(1.2, 0.9).positions.iter().map(|p| *p + Vec3::Y).collect(),
        ..quad(1.2, 0.9)
    };
    let mut scene = Scene::perspective(YFOV as f32, DISTANCE);
    scene.at(&skinned_asset(vec![raised], vec![matte(Vec4::ONE)]), 0.0, -1.0, 0.0);
    let mut then = scene.snapshot.clone();
    then.actors[0].model_from_joint[1].translation.x -= 0.3;
    assert_near(
        &draw_probe(&scene, "moved_x", &options, Some(&then)),
        "joint",
        3e-6,
        expected(DVec3::X * 0.3),
    );
}

#[test]
fn scene_inputs_skip_holes_of_cut_outs_and_glass() {
    let mut scene = Scene::perspective(YFOV as f32, DISTANCE);
    // The right half is cut out.
    let picture = image(2, 1, |x, _| [255, 255, 255, if x == 0 { 255 } else { 0 }]);
    let nearest = Sampler { mag_linear: false, min_linear: false, ..Sampler::default() };
    let cut = Material {
        base_color_texture: Some(TextureRef { sampler: nearest, ..texture(0) }),
        alpha_mode: AlphaMode::Mask(0.5),
        ..matte(Vec4::ONE)
    };
    scene.at(&asset(vec![quad(1.0, 1.0)], vec![cut], vec![picture]), 0.0, 0.0, 1.0);
    scene.at(&asset(vec![quad(3.0, 3.0)], vec![matte(Vec4::ONE)], vec![]), 0.0, 0.0, -1.0);
    let glass = Material { alpha_mode: AlphaMode::Blend, ..matte(Vec4::new(1.0, 1.0, 1.0, 0.5)) };
    scene.at(&asset(vec![quad(3.0, 3.0)], vec![glass], vec![]), 0.0, 0.0, 2.0);
    for (renderer, frame) in draw_probe(&scene, "depth", &PlanOptions::new(SIZE, 4), None) {
        let depth = |x: u32| read_number(&frame, x, 45) * 16.0;
        assert!((depth(52) - 4.0).abs() < 1e-4, "{renderer}: kept, {}", depth(52));
        assert!((depth(68) - 6.0).abs() < 1e-4, "{renderer}: cut out, {}", depth(68));
    }
}

#[test]
fn time_frame_and_sun_match_the_stage() {
    let (mut scene, ..) = scene_with_tilted_plane();
    scene.stage.settings.fps = choreo_motion::FrameRate { num: 24, den: 1 };
    scene.snapshot.time = scene.stage.settings.fps.time_of(77);
    let options = PlanOptions::new(SIZE, 1);
    assert_near(&draw_probe(&scene, "clock", &options, None), "time", 1e-6, |_, _| 77.0 / 24.0 / 8.0);
    assert_near(&draw_probe(&scene, "number", &options, None), "frame", 1e-6, |_, _| {
        (77.0 + 1.0 / 24.0) / 256.0
    });
    assert_near(&draw_probe(&scene, "sun", &options, None), "no sun", 1e-6, |_, _| 0.0);
    // The brighter of two suns counts.
    let way = DVec3::new(0.2, 0.1, -1.0).normalize();
    scene.sun(Vec3::NEG_Y, Vec3::ONE, 0.5);
    scene.sun(-way.as_vec3(), Vec3::ONE, 2.0);
    let x = pixel_of(DVec3::Z * DISTANCE + way * 1e6, DVec3::Z * DISTANCE).x;
    assert_near(&draw_probe(&scene, "sun", &options, None), "sun", 1e-5, |_, _| x / 256.0);
}

#[test]
fn both_renderers_agree_on_skins_cut_outs_and_displaced_surfaces() {
    let mut effects = probes();
    let waves = "// effect: waves\n// hook: vertex\n// reach: 0.2\n\
        fn effect(vertex: VertexSample, p: array<f32, 8>) -> vec3<f32> { return vertex.normal * 0.1 * sin(9.0 * vertex.world.x); }";
    effects.push(WgslEffect::from_text("waves.wgsl", waves).unwrap().into());
    let given = GpuOptions { effects: effects.clone(), ..GpuOptions::default() };
    let Some(mut renderer) = vulkan(given) else { return };
    for (name, once) in [
        ("depth", PreSkinning::Never),
        ("depth", PreSkinning::Always),
        ("normal_x", PreSkinning::Always),
        ("moved_x", PreSkinning::Never),
        ("moved_y", PreSkinning::Always),
        ("actor", PreSkinning::Always),
    ] {
        let mut scene = busy_scene(DVec3::ZERO);
        scene.stage.settings.pre_skinning = once;
        let mut then = scene.snapshot.clone();
        for (i, actor) in then.actors.iter_mut().enumerate() {
            actor.world_from_model.translation += DVec3::new(0.02, -0.01, 0.03) * i as f64;
            if let Some(top) = actor.model_from_joint.get_mut(1) {
                top.translation.x += 0.1;
            }
        }
        use_effect(&mut scene, "waves", &[], &[0, 2]);
        use_effect(&mut scene, name, &[("amount", 1.0)], &[]);
        let options = PlanOptions { effects: &effects, moved_from: Some(&then), ..PlanOptions::new(SIZE, 1) };
        let cpu = draw_with(&mut CpuRenderer::new(&effects), &scene, &options);
        let gpu = draw_with(&mut renderer, &scene, &options);
        let differ = |a: &Frame, b: &Frame| {
            let pixels = (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y)));
            pixels.filter(|(x, y)| (read_number(a, *x, *y) - read_number(b, *x, *y)).abs() > 2e-5).count()
        };
        // A few pixels, whose centers lie on an edge, may differ.
        let off = differ(&cpu, &gpu);
        println!("{name}, {once:?}: {off} of {} pixels differ", SIZE[0] * SIZE[1]);
        assert!(off < 12, "{name}, {once:?}: {off}");
        // The comparison finds an actor a millimetre farther away.
        scene.snapshot.actors.iter_mut().for_each(|a| a.world_from_model.translation.z -= 0.001);
        if name == "depth" {
            let other = draw_with(&mut CpuRenderer::new(&effects), &scene, &options);
            assert!(differ(&other, &gpu) > 1000);
        }
    }
}

#[test]
fn tiles_and_motion_blur_have_the_scene_inputs_of_the_frame() {
    let effects = probes();
    let (scene, at, n) = scene_with_tilted_plane();
    let mut then = scene.snapshot.clone();
    then.actors[1].world_from_model.translation.x -= 0.1;
    for name in ["depth", "moved_x", "actor"] {
        let mut scene = Scene { stage: scene.stage.clone(), snapshot: scene.snapshot.clone() };
        use_effect(&mut scene, name, &[("amount", 1.0)], &[]);
        let options = PlanOptions { effects: &effects, moved_from: Some(&then), ..PlanOptions::new(SIZE, 1) };
        let whole = draw_with(&mut CpuRenderer::new(&effects), &scene, &options);
        let given = GpuOptions { effects: effects.clone(), longest_side: Some(50), ..GpuOptions::default() };
        let Some(mut tiled) = vulkan(given) else { return };
        let frame = draw_with(&mut tiled, &scene, &options);
        for [x, y] in INSIDE {
            let (is, should) = (read_number(&frame, x, y), read_number(&whole, x, y));
            assert!((is - should).abs() < 3e-6, "{name} in tiles at {x}, {y}: {is}, not {should}");
        }
    }
    // With motion blur of a static scene the mean is the frame, and effects read their inputs on the host.
    let mut scene = Scene { stage: scene.stage.clone(), snapshot: scene.snapshot.clone() };
    use_effect(&mut scene, "motion_blur", &[("samples", 2.0)], &[]);
    use_effect(&mut scene, "depth", &[("amount", 1.0)], &[]);
    let options = PlanOptions { effects: &effects, all_sub_frames: true, ..PlanOptions::new(SIZE, 4) };
    let resources = scene.resources();
    let made =
        plan_with(&resources, &scene.stage, Time::ZERO, &options, |_| Ok::<_, ()>(scene.snapshot.clone()));
    let (_, plan) = made.unwrap();
    assert_eq!(plan.subframes.len(), 2);
    let mut frames = vec![];
    let mut draw = |renderer: &mut dyn Renderer, name| {
        renderer.load(resources.clone()).unwrap();
        renderer.submit(plan.clone()).unwrap();
        frames.push((name, renderer.collect(None).unwrap()));
    };
    draw(&mut CpuRenderer::new(&effects), "CPU");
    if let Some(mut renderer) = vulkan(GpuOptions { effects: effects.clone(), ..GpuOptions::default() }) {
        draw(&mut renderer, "Vulkan");
    }
    assert_near(&frames, "depth, open shutter", 1e-6, |x, y| {
        (DISTANCE - intersect_plane(x, y, at, n).z) / 16.0
    });
}

#[test]
fn inputs_are_drawn_only_for_effects_that_read_them() {
    let effects = probes();
    let (scene, ..) = scene_with_tilted_plane();
    let commands = |name: Option<(&str, f64)>| {
        let mut scene = Scene { stage: scene.stage.clone(), snapshot: scene.snapshot.clone() };
        name.iter().for_each(|(name, amount)| use_effect(&mut scene, name, &[("amount", *amount)], &[]));
        let options = PlanOptions { effects: &effects, ..PlanOptions::new(SIZE, 1) };
        let (_, plan) = scene.plan(&options);
        let recording = choreo_render::commands::record(&plan, Default::default(), |_| 2);
        let text = recording.to_string();
        let left_out = plan.left_out.iter().map(|l| l.part.clone()).collect::<Vec<_>>().join(", ");
        (text.contains("begin inputs"), text.contains("inputs of effects, motion"), left_out)
    };
    let (drawn, motion, left_out) = commands(Some(("depth", 1.0)));
    assert!(drawn && !motion && left_out.contains("motion vectors for effects"), "{left_out}");
    assert!(!left_out.contains("depth and normals for effects"), "{left_out}");
    let (drawn, motion, left_out) = commands(Some(("moved_x", 1.0)));
    assert!(drawn && motion && !left_out.contains("motion vectors"), "{left_out}");
    let (drawn, _, left_out) = commands(Some(("clock", 1.0)));
    assert!(!drawn && left_out.contains("depth and normals for effects"), "{left_out}");
    // An effect that is off requests nothing.
    assert!(!commands(Some(("depth", 0.0))).0 && !commands(None).0);
}

#[test]
fn explain_names_the_inputs_and_the_effects_that_read_them() {
    let effects = probes();
    let (scene, ..) = scene_with_tilted_plane();
    let rows = |name: &str| {
        let mut scene = Scene { stage: scene.stage.clone(), snapshot: scene.snapshot.clone() };
        use_effect(&mut scene, name, &[("amount", 1.0)], &[]);
        let options = PlanOptions { effects: &effects, ..PlanOptions::new(SIZE, 1) };
        let (_, plan) = scene.plan(&options);
        let recording = choreo_render::commands::record(&plan, Default::default(), |_| 2);
        let costs = explain::frame_costs(&scene.resources(), &plan, &recording).into_iter();
        let of_inputs = costs.filter(|cost| cost.what.contains(" for effects"));
        of_inputs.map(|cost| (cost.what, format!("{:?}", cost.requested_by.effects))).collect::<Vec<_>>()
    };
    for (name, pass, target) in [
        ("depth", "depth and normals for effects: 1 draw", "normals and depth for effects 120×90"),
        (
            "moved_x",
            "depth, normals, motion vectors and actors for effects: 1 draw",
            "normals, depth, motion and actors for effects 120×90",
        ),
    ] {
        let rows = rows(name);
        for start in [pass, target] {
            let found = rows.iter().find(|(what, _)| what.starts_with(start));
            assert!(found.is_some_and(|(_, by)| by.contains(&format!("{name:?}"))), "{start}: {rows:#?}");
        }
    }
    assert_eq!(rows("clock"), []);
}
