//! Effects on surfaces, on images and with geometry: both renderers draw the same, each effect is visible, and actors without effects cost nothing.

use crate::common;
use crate::common::layered::{bulge, layered_scene};
use crate::common::*;
use choreo_asset::*;
use choreo_image_diff::compare;
use choreo_plugin::{Effect, Frame, Hook};
use choreo_render::plan::{Features, TopologyKey};
use choreo_render::*;
use choreo_stage::*;
use glam::{DAffine3, DQuat, DVec3, Vec3, Vec4};

fn all() -> Vec<Effect> {
    effects::named(&[
        "fog",
        "toon",
        "views",
        "xray",
        "wireframe",
        "fxaa",
        "bloom",
        "vignette",
        "skeleton",
        "grid",
        "shadow_catcher",
    ])
}

fn add_effect(scene: &mut Scene, plugin: &str, parameters: &[(&str, f64)], actors: &[usize]) {
    common::use_effect(scene, plugin, parameters, actors);
}

/// Lit, unlit, textured, skinned, alpha-tested, blended and glass surfaces.
fn scene() -> Scene {
    let mut scene = busy_scene(DVec3::ZERO);
    scene.snapshot.background =
        Background::Gradient { top: Vec3::new(0.1, 0.3, 0.6), bottom: Vec3::new(0.6, 0.5, 0.4) };
    let glass = MaterialLayers { transmission: 0.7, ..MaterialLayers::default() };
    let glass = common::layered::layered(glass, matte(Vec4::new(0.6, 0.9, 0.8, 1.0)));
    scene.at(&asset(vec![bulge(0.6)], vec![glass], vec![]), 0.3, -0.2, 2.2);
    let bright = Material { emissive: Vec3::new(3.0, 2.0, 0.5), ..matte(Vec4::ONE) };
    scene.at(&asset(vec![bulge(0.4)], vec![bright], vec![]), -1.6, 1.2, 1.0);
    scene
}

/// Each case: its name, and the effects in order with their parameters and actors.
type Case = (&'static str, Vec<(&'static str, Vec<(&'static str, f64)>, Vec<usize>)>);

fn effect_cases() -> Vec<Case> {
    vec![
        ("fog", vec![("fog", vec![("density", 0.2), ("falloff", 0.5)], vec![])]),
        ("colored fog", vec![("fog", vec![("density", 0.3), ("start", 3.0), ("sky", 0.0)], vec![])]),
        (
            "fog over the horizon",
            vec![("fog", vec![("density", 0.05), ("falloff", 0.2), ("sky", 0.0)], vec![])],
        ),
        ("toon", vec![("toon", vec![("steps", 4.0)], vec![])]),
        ("normals", vec![("views", vec![("show", 0.0)], vec![])]),
        ("uvs of some", vec![("views", vec![("show", 1.0)], vec![0, 2, 4])]),
        ("joints", vec![("views", vec![("show", 2.0)], vec![])]),
        ("x-ray", vec![("xray", vec![], vec![1, 3, 12])]),
        ("wireframe", vec![("wireframe", vec![("color_g", 1.0)], vec![])]),
        ("bloom", vec![("bloom", vec![("strength", 0.6)], vec![])]),
        ("fxaa", vec![("fxaa", vec![], vec![])]),
        ("skeletons", vec![("skeleton", vec![("width", 3.0), ("over", 0.0)], vec![])]),
        ("skeletons over all", vec![("skeleton", vec![("opacity", 0.7)], vec![])]),
        ("grid", vec![("grid", vec![("cell", 0.2), ("height", -1.0), ("color_r", 1.0)], vec![])]),
        (
            "several of every kind",
            vec![
                ("toon", vec![], vec![0, 1, 2, 3]),
                ("fog", vec![("density", 0.1)], vec![]),
                ("bloom", vec![], vec![]),
                ("vignette", vec![], vec![]),
                ("fxaa", vec![], vec![]),
                ("wireframe", vec![], vec![3]),
            ],
        ),
    ]
}

fn draw_case(case: &Case, drawn: &mut dyn FnMut(&Scene, &PlanOptions) -> Frame, samples: u32) -> Frame {
    let mut scene = scene();
    for (plugin, parameters, actors) in &case.1 {
        add_effect(&mut scene, plugin, parameters, actors);
    }
    let effects = all();
    drawn(&scene, &PlanOptions { effects: &effects, ..PlanOptions::new([200, 150], samples) })
}

#[test]
fn vulkan_and_the_cpu_reference_draw_the_same_effects() {
    let Some(mut renderer) = vulkan(GpuOptions { effects: all(), ..GpuOptions::default() }) else { return };
    let mut vulkan = |scene: &Scene, options: &PlanOptions| draw_with(&mut renderer, scene, options);
    let mut cpu = |scene: &Scene, options: &PlanOptions| draw(scene, options);
    let plain = [1, 4].map(|samples| draw_case(&("none", Vec::new()), &mut cpu, samples));
    let mut pictures: Vec<Frame> = Vec::new();
    for (i, case) in effect_cases().iter().enumerate() {
        let samples = if i % 3 == 2 { 4 } else { 1 };
        let (a, b) = (draw_case(case, &mut vulkan, samples), draw_case(case, &mut cpu, samples));
        let c = compare(&a, &b, 3).unwrap();
        println!("{}: {c}", case.0);
        assert!(c.mean < 0.35 && c.share_beyond < 0.02, "{}: {c}", case.0);
        // The comparison can fail: each effect changes the image, and no two give the same one.
        let seen = compare(&plain[usize::from(samples == 4)], &b, 3).unwrap();
        assert!(seen.share_beyond > 0.004, "{} changes the picture: {seen}", case.0);
        for other in &pictures {
            assert!(compare(other, &b, 3).unwrap().share_beyond > 0.004, "{}", case.0);
        }
        pictures.push(b);
    }
}

#[test]
fn actors_without_effects_request_no_effect_features() {
    let keys = |effects_on: &[(&str, &[usize])]| {
        let mut scene = Scene::perspective(0.7, 6.0);
        let a = asset(vec![bulge(0.5)], vec![unlit(Vec4::ONE)], vec![]);
        scene.at(&a, -1.0, 0.0, 0.0);
        scene.add(&a, DAffine3::from_rotation_translation(DQuat::from_rotation_y(0.3), DVec3::X));
        effects_on.iter().for_each(|(name, actors)| add_effect(&mut scene, name, &[], actors));
        let effects = all();
        let (_, plan) = scene.plan(&PlanOptions { effects: &effects, ..PlanOptions::new([64, 64], 1) });
        let out = |what: &str| plan.left_out.iter().any(|l| l.part == what);
        let draws: Vec<(Features, u8, u32, TopologyKey)> = plan
            .draws
            .iter()
            .map(|d| {
                let key = d.pipeline;
                (key.features, key.surface, d.instance_count, key.topology)
            })
            .collect();
        (draws, out("effects on surfaces"), out("edges"), plan.post.len())
    };
    let (none, triangles) = (Features::default(), TopologyKey::Triangles);
    assert_eq!(keys(&[]), (vec![(none, 0, 2, triangles)], true, true, 0));
    // Fog requests no vertex data and a view of normals requests normals, each only of its own actors.
    assert_eq!(keys(&[("fog", &[])]), (vec![(none, 1, 2, triangles)], false, true, 0));
    let views = keys(&[("views", &[1])]).0;
    assert_eq!(views, [(none, 0, 1, triangles), (Features::EFFECT_NORMALS, 1, 1, triangles)]);
    let lines = keys(&[("wireframe", &[0])]);
    assert!(lines.0.contains(&(Features::WIREFRAME, 0, 1, TopologyKey::Lines)) && !lines.2, "{lines:?}");
    assert_eq!(keys(&[("bloom", &[]), ("fxaa", &[])]).3, 5, "bloom runs four times");
}

#[test]
fn fog_matches_its_formula() {
    // Ten metres in front of the camera: exp(−0.1 · 10) of white remains, and the rest is the sky.
    let mut scene = Scene::ortho(2.0);
    scene.snapshot.background = Background::Color(Vec4::new(0.2, 0.4, 0.6, 1.0));
    scene.at(&asset(vec![quad(0.5, 0.5)], vec![unlit(Vec4::ONE)], vec![]), 0.0, 0.0, 0.0);
    add_effect(&mut scene, "fog", &[("density", 0.1)], &[]);
    let effects = all();
    let frame = draw(&scene, &PlanOptions { effects: &effects, ..PlanOptions::new([21, 21], 1) });
    let left = (-1.0f64).exp();
    let expected = [0.2, 0.4, 0.6].map(|sky: f64| sky + (1.0 - sky) * left);
    assert_color(pixel(&frame, 10, 10), expected, "a wall in fog");
    assert_color(pixel(&frame, 1, 1), [0.2, 0.4, 0.6], "the sky is its color");
    // Colored fog replaces the background, which is infinitely far away; fog on a single actor leaves the background as it is.
    for (on, expected) in [(&[][..], [1.0, 0.0, 0.0]), (&[0][..], [0.2, 0.4, 0.6])] {
        let mut scene = Scene::ortho(2.0);
        scene.snapshot.background = Background::Color(Vec4::new(0.2, 0.4, 0.6, 1.0));
        scene.at(&asset(vec![quad(0.5, 0.5)], vec![unlit(Vec4::ONE)], vec![]), 0.0, 0.0, 0.0);
        let red = [("color_r", 1.0), ("color_g", 0.0), ("color_b", 0.0), ("density", 0.1), ("sky", 0.0)];
        add_effect(&mut scene, "fog", &red, on);
        let frame = draw(&scene, &PlanOptions { effects: &effects, ..PlanOptions::new([21, 21], 1) });
        assert_color(pixel(&frame, 1, 1), expected, "the background");
        assert_color(pixel(&frame, 10, 10), [1.0, left, left], "the wall");
    }
}

#[test]
fn wireframe_edges_are_drawn_once_and_depth_tested() {
    assert_eq!(
        scene_resources::vertex_layout::unique_edges(&[0, 1, 2, 2, 1, 3]),
        [0, 1, 1, 2, 0, 2, 1, 3, 2, 3]
    );
    // Edges behind a wall are hidden, and edges beside it are visible.
    let mut scene = Scene::ortho(2.0);
    scene.at(&asset(vec![quad(0.9, 0.9)], vec![unlit(Vec4::ONE)], vec![]), 0.0, 0.0, 0.0);
    add_effect(&mut scene, "wireframe", &[("color_r", 1.0), ("color_g", 0.0), ("color_b", 0.0)], &[0]);
    let effects = all();
    let options = PlanOptions { effects: &effects, ..PlanOptions::new([41, 41], 1) };
    let red = |frame: &Frame| frame.rgba.chunks_exact(4).filter(|p| p[0] == 255 && p[1] < 8).count();
    // Four sides and a diagonal of 37 pixels each.
    let seen = red(&draw(&scene, &options));
    assert!((170..=190).contains(&seen), "{seen}");
    scene.at(&asset(vec![quad(1.0, 1.0)], vec![unlit(Vec4::new(0.0, 0.0, 1.0, 1.0))], vec![]), 0.0, 0.0, 0.5);
    assert_eq!(red(&draw(&scene, &options)), 0);
}

#[test]
fn only_effects_that_read_joints_get_them() {
    assert_eq!(all()[0].hook(), Hook::Surface);
    let mut scene = layered_scene();
    add_effect(&mut scene, "views", &[("show", 2.0)], &[]);
    let effects = all();
    let (_, plan) = scene.plan(&PlanOptions { effects: &effects, ..PlanOptions::new([64, 64], 1) });
    // No actor is skinned.
    assert!(plan.draws.iter().all(|d| !d.pipeline.features.has(Features::EFFECT_JOINTS)));
    assert!(plan.draws.iter().all(|d| d.pipeline.surface == 1));
}

/// An effect with the value that its header declares as off is left out, and the pixels are those without the effect.
#[test]
fn effects_without_strength_change_nothing() {
    let effects = effects::named(&["bloom", "vignette", "fog", "outline", "grid"]);
    let options = PlanOptions { effects: &effects, ..PlanOptions::new([96, 64], 4) };
    let mut renderer = CpuRenderer::new(&effects);
    let plain = scene();
    let expected = draw_with(&mut renderer, &plain, &options);
    let off = [
        ("bloom", "strength"),
        ("vignette", "strength"),
        ("fog", "density"),
        ("outline", "width"),
        ("grid", "opacity"),
    ];
    for (effect, parameter) in off {
        let mut scene = scene();
        add_effect(&mut scene, effect, &[(parameter, 0.0)], &[]);
        let (_, plan) = scene.plan(&options);
        let reported = plan.left_out.iter().find(|l| l.part == format!("effect \"{effect}\""));
        assert_eq!(reported.map(|l| l.why.clone()), Some(format!("{parameter} is 0")));
        assert!(plan.post.is_empty() && plan.scene_effects.is_empty() && plan.overlay.parts.is_empty());
        assert!(draw_with(&mut renderer, &scene, &options) == expected, "{effect}");
        // With another value it changes the image.
        let mut seen = self::scene();
        let floor = (effect == "grid").then_some(("height", -1.0));
        let on: Vec<_> = [(parameter, 1.0)].into_iter().chain(floor).collect();
        add_effect(&mut seen, effect, &on, &[]);
        assert!(draw_with(&mut renderer, &seen, &options) != expected, "{effect} does nothing");
    }
}
