//! Transparency in both renderers, against ray intersections in f64 that are blended by depth.

use crate::common::*;
use choreo_asset::*;
use choreo_plugin::Effect;
use choreo_plugin::Frame;
use choreo_render::plan::PeelCause;
use choreo_render::vulkan::Ability;
use choreo_render::*;
use choreo_stage::*;
use choreo_wgsl_effect::WgslEffect;
use glam::{DAffine3, DQuat, DVec3, DVec4, EulerRot, Vec3, Vec4};

const SIDE: u32 = 96;

/// A square pane of one color, rotated and moved.
#[derive(Clone, Copy)]
struct Pane {
    /// Degrees about y, then x.
    turn: [f64; 2],
    at: [f64; 3],
    half: f64,
    color: [f32; 4],
}

impl Pane {
    fn placed(&self) -> DAffine3 {
        let [y, x] = self.turn.map(f64::to_radians);
        DAffine3::from_rotation_translation(DQuat::from_euler(EulerRot::YXZ, y, x, 0.0), DVec3::from(self.at))
    }

    /// The z at which a ray along −z at (x, y) meets the pane.
    fn depth_at(&self, x: f64, y: f64) -> Option<f64> {
        let back = self.placed().inverse();
        let (from, way) =
            (back.transform_point3(DVec3::new(x, y, 0.0)), back.transform_vector3(DVec3::NEG_Z));
        let t = -from.z / way.z;
        let hit = from + way * t;
        (hit.x.abs() < self.half && hit.y.abs() < self.half).then_some(-t)
    }
}

fn pane(turn: [f64; 2], at: [f64; 3], half: f64, color: [f32; 4]) -> Pane {
    Pane { turn, at, half, color }
}

const RED: [f32; 4] = [0.9, 0.1, 0.05, 0.6];
const GREEN: [f32; 4] = [0.1, 0.8, 0.1, 0.5];
const BLUE: [f32; 4] = [0.1, 0.2, 0.9, 0.7];

/// Two intersecting panes.
fn crossing_panes() -> Vec<Pane> {
    vec![pane([50.0, 0.0], [0.0; 3], 0.7, RED), pane([-40.0, 10.0], [0.05, 0.0, 0.1], 0.7, BLUE)]
}

/// Five panes that intersect in one line.
fn fanned_panes() -> Vec<Pane> {
    let colors = [RED, GREEN, BLUE, GREEN, RED];
    (0..5).map(|i| pane([20.0 + 34.0 * i as f64, 0.0], [0.0; 3], 0.8, colors[i])).collect()
}

/// A large pane whose center is nearer than a small pane in front of its far part.
fn panes_of_two_sizes() -> Vec<Pane> {
    vec![pane([60.0, 0.0], [0.0, 0.0, 0.0], 0.9, GREEN), pane([0.0, 0.0], [0.35, 0.0, -0.3], 0.15, RED)]
}

fn scene(panes: &[Pane], how: Transparency) -> Scene {
    let mut scene = Scene::ortho(2.0);
    scene.stage.settings.transparency = how;
    for p in panes {
        let material =
            Material { alpha_mode: AlphaMode::Blend, double_sided: true, ..unlit(Vec4::from_array(p.color)) };
        scene.add(&asset(vec![quad(p.half as f32, p.half as f32)], vec![material], vec![]), p.placed());
    }
    scene
}

/// Samples of a pixel in 1/256 of it (Vulkan 1.3, "Standard sample locations").
fn sample_positions(samples: u32) -> &'static [[f64; 2]] {
    match samples {
        1 => &[[128.0, 128.0]],
        _ => &[[96.0, 32.0], [224.0, 96.0], [32.0, 160.0], [160.0, 224.0]],
    }
}

fn exact_color(panes: &[Pane], x: u32, y: u32, samples: u32) -> [f64; 3] {
    let mut mean = DVec3::ZERO;
    for [dx, dy] in sample_positions(samples) {
        let metres = |pixel: u32, d: f64| (f64::from(pixel) + d / 256.0) / f64::from(SIDE) * 2.0 - 1.0;
        let (px, py) = (metres(x, *dx), -metres(y, *dy));
        let mut met: Vec<(f64, DVec4)> = Vec::new();
        for p in panes {
            met.extend(p.depth_at(px, py).map(|z| (z, Vec4::from_array(p.color).as_dvec4())));
        }
        met.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mixed = met.iter().fold(DVec3::ZERO, |below, (_, c)| below * (1.0 - c.w) + c.truncate() * c.w);
        mean += mixed / sample_positions(samples).len() as f64;
    }
    mean.to_array()
}

/// Pixels more than two steps of 8 bits off: each mix is rounded to 8 bits.
fn wrong_pixels(frame: &Frame, panes: &[Pane], samples: u32) -> usize {
    let off = |i: &u32| {
        let (x, y) = (i % SIDE, i / SIDE);
        let (got, exact) = (pixel(frame, x, y), exact_color(panes, x, y, samples));
        (0..3).any(|c| (f64::from(got[c]) - encode(exact[c])).abs() > 2.0)
    };
    (0..SIDE * SIDE).filter(off).count()
}

fn check_all_renderers(mut check: impl FnMut(&mut dyn Renderer, &str, u32)) {
    let mut all: Vec<(Box<dyn Renderer>, &str)> = vec![(Box::new(CpuRenderer::new(&[])), "CPU")];
    all.extend(vulkan(GpuOptions::default()).map(|r| (Box::new(r) as Box<dyn Renderer>, "Vulkan")));
    for (renderer, name) in &mut all {
        for samples in [1, 4] {
            check(renderer.as_mut(), name, samples);
        }
    }
}

#[test]
fn depth_peeling_blends_crossing_panes_by_depth() {
    for (what, panes) in
        [("crossing", crossing_panes()), ("fan", fanned_panes()), ("large and small", panes_of_two_sizes())]
    {
        check_all_renderers(|renderer, who, samples| {
            let options = PlanOptions::new([SIDE; 2], samples);
            let mut off =
                |how| wrong_pixels(&draw_with(renderer, &scene(&panes, how), &options), &panes, samples);
            let [chosen, sorted] = [Transparency::Auto, Transparency::Sorted].map(&mut off);
            println!("{what}, {who}, {samples} samples: {chosen} pixels off, {sorted} where sorted");
            // Some samples lie on an edge, or on the line where two panes intersect.
            assert!(chosen < 12, "{what}, {who}, {samples} samples: {chosen} pixels off");
            assert!(sorted > 100, "{what}, {who}: sorting would have done, {sorted}");
        });
    }
}

/// More surfaces than peeled layers: the farthest are exact, and nearer ones are blended over them in sorted order.
#[test]
fn surfaces_beyond_the_peeled_layers_are_sorted() {
    let many: Vec<Pane> = (0..12)
        .map(|i| {
            pane(
                [if i % 2 == 0 { 12.0 } else { -12.0 }, 0.0],
                [0.0, 0.0, 0.05 * i as f64],
                0.8,
                [0.2, 0.5, 0.9, 0.2],
            )
        })
        .collect();
    check_all_renderers(|renderer, who, samples| {
        let all = scene(&many, Transparency::Auto);
        let options = PlanOptions::new([SIDE; 2], samples);
        let frame = draw_with(renderer, &all, &options);
        // All panes have the same color and alpha, so that the order does not matter, but no surface may be missing.
        let off = wrong_pixels(&frame, &many, samples);
        assert!(off < 60, "{who}, {samples} samples: {off} pixels off");
        assert!(wrong_pixels(&frame, &many[1..], samples) > 1000, "a lost surface is seen");
    });
}

fn peel_cause(scene: &Scene) -> Result<PeelCause, String> {
    let (_, plan) = scene.plan(&PlanOptions::new([SIDE; 2], 1));
    let said = plan.left_out.iter().find(|l| l.part == "order-independent transparency");
    plan.depth_peeling.map(|p| p.cause).ok_or_else(|| said.map_or(String::new(), |l| l.why.clone()))
}

#[test]
fn the_plan_peels_where_sorting_fails_and_gives_the_cause() {
    let auto = |panes: &[Pane]| peel_cause(&scene(panes, Transparency::Auto));
    assert_eq!(auto(&crossing_panes()), Ok(PeelCause::Order(0, 1)));
    assert!(matches!(auto(&fanned_panes()), Ok(PeelCause::Order(..))));
    assert!(matches!(auto(&panes_of_two_sizes()), Ok(PeelCause::Order(..))));
    // One pane behind the other, beside it, or in the same plane.
    let behind =
        [pane([20.0, 0.0], [0.0, 0.0, -1.0], 0.7, RED), pane([20.0, 0.0], [0.1, 0.0, 0.0], 0.7, BLUE)];
    let beside =
        [pane([50.0, 0.0], [-0.6, 0.0, 0.0], 0.3, RED), pane([-50.0, 0.0], [0.6, 0.0, 0.0], 0.3, BLUE)];
    let in_line =
        [pane([50.0, 0.0], [0.0, 0.0, 0.0], 0.3, RED), pane([50.0, 0.0], [0.0, 0.7, 0.0], 0.3, BLUE)];
    for panes in [&behind[..], &beside, &in_line, &crossing_panes()[..1]] {
        assert!(auto(panes).is_err_and(|why| why.contains("can be sorted")));
    }
    assert!(auto(&[]).is_err_and(|why| why.contains("opaque")));
    let sorted = peel_cause(&scene(&crossing_panes(), Transparency::Sorted));
    assert!(sorted.is_err_and(|why| why.contains("\"sorted\"")));
    assert_eq!(peel_cause(&scene(&behind, Transparency::Independent)), Ok(PeelCause::Requested));
    // A double-sided box.
    let mut bent = Scene::ortho(2.0);
    let mut roof = quad(0.5, 0.5);
    roof.positions[2].z = 0.4;
    let glass = Material { alpha_mode: AlphaMode::Blend, double_sided: true, ..unlit(Vec4::splat(0.5)) };
    bent.at(&asset(vec![roof], vec![glass], vec![]), 0.0, 0.0, 0.0);
    assert_eq!(peel_cause(&bent), Ok(PeelCause::SelfOverlap(0)));
}

/// A device without sample-rate shading sorts transparent surfaces if there are several samples per pixel.
#[test]
fn devices_without_sample_rate_shading_sort_transparent_surfaces() {
    let without = vec![Ability::SampleRateShading];
    let Some(mut gpu) = vulkan(GpuOptions { without, ..GpuOptions::default() }) else { return };
    for (samples, fails) in [(1, false), (4, true)] {
        let options = PlanOptions::new([SIDE; 2], samples);
        let frame = draw_with(&mut gpu, &scene(&crossing_panes(), Transparency::Auto), &options);
        assert_eq!(wrong_pixels(&frame, &crossing_panes(), samples) > 100, fails, "{samples} samples");
    }
}

/// Two skinned or morphed meshes that overlap by a third of their size, or are `apart`.
fn scene_with_two_meshes(morphed: bool, apart: f64) -> Scene {
    let mut scene = Scene::ortho(4.0);
    let glass = Material { alpha_mode: AlphaMode::Blend, ..unlit(Vec4::splat(0.5)) };
    let mut shape = quad(0.5, 0.5);
    shape.positions[2].z = 0.3;
    let mut shapes = vec![shape];
    let made = if morphed {
        let positions = vec![Vec3::new(0.0, 0.0, 0.1); 4];
        shapes[0].morphs.push(MorphTarget { positions, ..MorphTarget::default() });
        let mut made = (*asset(shapes, vec![glass], vec![])).clone();
        made.instances[0].weights = vec![1.0];
        made
    } else {
        (*skinned_asset(shapes, vec![glass])).clone()
    };
    let made = std::sync::Arc::new(made);
    scene.at(&made, 0.0, 0.0, 0.0);
    scene.at(&made, apart, 0.0, 0.1);
    scene
}

#[test]
fn bounds_of_deformed_meshes_decide_about_peeling() {
    for morphed in [false, true] {
        assert_eq!(peel_cause(&scene_with_two_meshes(morphed, 0.6)), Ok(PeelCause::Order(0, 1)), "{morphed}");
        assert!(
            peel_cause(&scene_with_two_meshes(morphed, 1.4)).is_err_and(|why| why.contains("can be sorted"))
        );
    }
}

/// Two adjacent panes that a displacing effect may move into each other.
#[test]
fn displacement_counts_in_the_decision_about_peeling() {
    let why = |apart: f64, reach: Option<f64>| {
        let mut scene = Scene::ortho(4.0);
        let glass = Material { alpha_mode: AlphaMode::Blend, ..unlit(Vec4::splat(0.5)) };
        let made = asset(vec![quad(0.5, 0.5)], vec![glass], vec![]);
        scene.at(&made, 0.0, 0.0, 0.0);
        scene.at(&made, apart, 0.0, 0.0);
        let text = "// effect: sway\n// hook: vertex\n// reach: far\n// param far = 0 in 0..1: metres\n\
            fn effect(vertex: VertexSample, p: array<f32, 8>) -> vec3<f32> { return vec3(0.0, 0.0, p[far]); }";
        let all: [Effect; 1] = [WgslEffect::from_text("s", text).unwrap().into()];
        if let Some(far) = reach {
            use_effect(&mut scene, "sway", &[("far", far)], &[]);
        }
        let options = PlanOptions { effects: &all, ..PlanOptions::new([64; 2], 1) };
        let plan = scene.plan(&options).1;
        let peeled = plan.depth_peeling.map(|p| (p.cause, p.layers));
        let out = plan.left_out.iter().any(|l| l.why.contains("can be sorted"));
        assert_eq!(peeled.is_none(), out);
        peeled
    };
    // Each may move 0.3 m towards the other, and a displaced mesh may overlap itself.
    assert_eq!(why(1.4, Some(0.3)), Some((PeelCause::Order(0, 1), 8)));
    assert_eq!(why(1.4, Some(0.1)), None);
    assert_eq!(why(1.4, Some(0.0)), None);
    assert_eq!(why(1.4, None), None);
}

#[test]
fn the_transparency_of_an_actor_overrides_that_of_the_stage() {
    let says = |scene: &mut Scene, actor: usize, how, material| {
        let rule = SurfaceRule { material, cutouts: None, transparency: Some(how) };
        scene.stage.actors[actor].surfaces.push(rule);
    };
    let mut one = scene_with_two_meshes(false, 0.6);
    says(&mut one, 1, Transparency::Sorted, None);
    assert!(peel_cause(&one).is_err_and(|why| why.contains("can be sorted")), "it is no reason");
    says(&mut one, 0, Transparency::Sorted, Some(0));
    assert!(peel_cause(&one).is_err_and(|why| why == "the actors' transparency is \"sorted\""));
    says(&mut one, 0, Transparency::Independent, Some(0));
    assert_eq!(peel_cause(&one), Ok(PeelCause::RequestedBy(0)));
    // A setting of another material does not apply.
    let mut other = scene_with_two_meshes(false, 1.4);
    says(&mut other, 0, Transparency::Independent, Some(1));
    assert!(peel_cause(&other).is_err());
}
