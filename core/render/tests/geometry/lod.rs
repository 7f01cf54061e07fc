//! Levels of detail: small copies are drawn at coarser levels with an error of at most a pixel, where that pays.

use crate::common::*;
use choreo_asset::*;
use choreo_motion::Time;
use choreo_render::scene_resources::lod::MIN_SMALL_COPIES;
use choreo_render::{CpuRenderer, Plan, PlanOptions, Renderer, SceneResources};
use choreo_stage::{Camera, Rig};
use glam::{DQuat, DVec3, Vec3, Vec4};
use std::sync::Arc;

const SIZE: [u32; 2] = [320, 180];

const RADIUS: f32 = 0.4;

/// A sphere of 16 rings of quads.
fn ball() -> Primitive {
    let n = 16;
    let (rows, columns) = (n + 1, 2 * n + 1);
    let at = |i: usize| {
        let a = (i / columns) as f32 / n as f32 * std::f32::consts::PI;
        // The last column of vertices coincides with the first.
        let b = (i % columns % (2 * n)) as f32 / n as f32 * std::f32::consts::PI;
        Vec3::new(libm::sinf(a) * libm::cosf(b), libm::cosf(a), libm::sinf(a) * libm::sinf(b))
    };
    let normals: Vec<Vec3> = (0..rows * columns).map(at).collect();
    let corner = |row: usize, column: usize| (row * columns + column) as u32;
    let indices = (0..2 * n * n).flat_map(|i| {
        let (r, c) = (i / (2 * n), i % (2 * n));
        let [a, b, c, d] = [corner(r, c), corner(r + 1, c), corner(r, c + 1), corner(r + 1, c + 1)];
        [a, c, b, b, c, d]
    });
    Primitive {
        indices: indices.collect(),
        positions: normals.iter().map(|n| *n * RADIUS).collect(),
        normals,
        material: Some(0),
        ..Primitive::default()
    }
}

/// Balls in rows of ten, each row farther from the camera.
fn crowd(count: usize) -> Scene {
    let mut scene = Scene::perspective(0.8, 3.0);
    scene.stage.settings.size = SIZE;
    let ball = asset(vec![ball()], vec![unlit(Vec4::ONE)], vec![]);
    for i in 0..count {
        let at = DVec3::new((i % 10) as f64 - 4.5, -0.5, -2.0 * (i / 10) as f64);
        let actor = scene.at(&ball, at.x, at.y, at.z);
        scene.stage.actors[actor].transform.translation = at;
    }
    let rig = Rig::Fixed { position: DVec3::Z * 3.0, rotation: DQuat::IDENTITY, look_at: None };
    scene.stage.shoot(Camera { projection: scene.snapshot.camera.projection, ..Camera::new("front", rig) });
    scene
}

fn triangle_count(resources: &SceneResources, plan: &Plan) -> usize {
    let of = |p: u32| resources.primitives[p as usize].primitive().indices.len() / 3;
    plan.draws.iter().map(|d| of(d.primitive) * d.instance_count as usize).sum()
}

fn draw_plan(resources: &Arc<SceneResources>, plan: &Plan) -> Vec<u8> {
    let mut renderer = CpuRenderer::new(&[]);
    renderer.load(resources.clone()).unwrap();
    renderer.submit(plan.clone()).unwrap();
    renderer.collect(None).unwrap().rgba
}

/// Number of pixels of `b` that differ from `a` and are more than a pixel away from any edge in `a`.
fn differing_pixels_off_edges(a: &[u8], b: &[u8]) -> usize {
    let [w, h] = SIZE.map(|n| n as i32);
    let of = |p: &[u8], x: i32, y: i32| p[4 * (y * w + x) as usize];
    let pixels = (0..h).flat_map(|y| (0..w).map(move |x| (x, y)));
    let off = pixels.filter(|&(x, y)| {
        let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (x + dx, y + dy)));
        let mut inside = around.filter(|(x, y)| (0..w).contains(x) && (0..h).contains(y));
        of(a, x, y) != of(b, x, y) && inside.all(|(i, j)| of(a, i, j) == of(a, x, y))
    });
    off.count()
}

#[test]
fn smaller_copies_of_a_crowd_get_coarser_levels() {
    let scene = crowd(200);
    let options = PlanOptions::new(SIZE, 1);
    let (resources, plan) = scene.plan(&options);
    let (_, full) = scene.plan(&PlanOptions { full_detail: true, ..options.clone() });
    let (few, all) = (triangle_count(&resources, &plan), triangle_count(&resources, &full));
    println!(
        "{few} triangles instead of {all}, in {} draws instead of {}",
        plan.draws.len(),
        full.draws.len()
    );
    assert!(3 * few < all, "{few} of {all}");
    assert!(plan.draws.len() <= 1 + resources.assets[0].levels.len(), "one a level at most");
    assert!(plan.left_out.iter().any(|l| l.part == "triangles too small to see"));
    // Nearer copies are never coarser.
    let depth = |d: &choreo_render::plan::Draw| {
        let of = &plan.instances[d.first_instance as usize..][..d.instance_count as usize];
        let depths = of.iter().map(|i| -i.relative_from_mesh.0[2].w);
        (depths.clone().fold(f32::MAX, f32::min), depths.fold(f32::MIN, f32::max))
    };
    let mut draws: Vec<_> = plan.draws.iter().map(|d| (d.primitive, depth(d))).collect();
    draws.sort_by_key(|d| d.0);
    assert!(draws.len() >= 2 && draws.windows(2).all(|d| d[0].1.1 <= d[1].1.0 + 1.0), "{draws:?}");

    let (a, b) = (draw_plan(&resources, &full), draw_plan(&resources, &plan));
    assert!(a != b, "coarser balls are not the same to the last pixel");
    assert_eq!(differing_pixels_off_edges(&a, &b), 0, "pixels off by more than one");
    // The comparison fails if all copies are drawn at the coarsest level.
    let mut wrong = (*resources).clone();
    wrong.assets[0].levels.iter_mut().for_each(|level| level.error = 0.0);
    let plan = Plan::new(&wrong, &scene.stage, &scene.snapshot, &options);
    assert!(differing_pixels_off_edges(&a, &draw_plan(&Arc::new(wrong), &plan)) > 0);
}

/// Image size at which all copies have triangles smaller than pixels.
const SMALL: [u32; 2] = [96, 54];

/// A stage whose copies are drawn small `images` times in all, summed over all frames.
fn crowd_seen_small(images: f64, count: usize) -> Scene {
    let mut scene = crowd(count);
    scene.stage.settings.size = SMALL;
    scene.stage.cameras[0].rig =
        Rig::Fixed { position: DVec3::Z * 30.0, rotation: DQuat::IDENTITY, look_at: None };
    scene.stage.settings.fps = choreo_motion::FrameRate { num: 10, den: 1 };
    scene.stage.settings.length = Time::from_secs(images / count as f64 / 10.0);
    scene
}

#[test]
fn levels_of_detail_are_made_only_where_they_pay() {
    let levels = |scene: &Scene| scene.resources().assets[0].levels.len();
    for count in [1, 10, 50] {
        assert_eq!(levels(&crowd_seen_small(0.9 * MIN_SMALL_COPIES, count)), 0, "{count}");
        assert!(
            levels(&crowd_seen_small(1.1 * MIN_SMALL_COPIES, count)) > 1,
            "{count}: by images and not by copies"
        );
    }
    let scene = crowd_seen_small(2.0 * MIN_SMALL_COPIES, 50);
    // Near copies need all triangles.
    let mut near = crowd_seen_small(2.0 * MIN_SMALL_COPIES, 50);
    near.stage.settings.size = [4000, 2250];
    assert_eq!(levels(&near), 0);
    let mut off = crowd_seen_small(2.0 * MIN_SMALL_COPIES, 50);
    off.stage.settings.levels_of_detail = false;
    assert_eq!(levels(&off), 0);
    // Resources built after others reuse their levels.
    let first = scene.resources();
    let next = SceneResources::new_reusing(&first, &scene.stage);
    assert_eq!(first.assets[0].levels, next.assets[0].levels);
    let level = first.assets[0].levels[0].primitives[0][0].unwrap() as usize;
    assert!(Arc::ptr_eq(&first.primitives[level].mesh, &next.primitives[level].mesh));
    // Without levels, the plan reports where they would be used.
    let without = SceneResources::without_levels(&scene.stage);
    let snapshot = scene.stage.at(Time::ZERO).unwrap();
    let plan = Plan::new(&without, &scene.stage, &snapshot, &PlanOptions::new(SMALL, 1));
    let said = plan.left_out.iter().find(|l| l.part == "triangles too small to see").unwrap();
    assert!(said.why.contains("about 50 models"), "{said:?}");
    assert!(without.primitives.len() == 1 && plan.draws.iter().all(|d| d.primitive == 0));
}

/// Largest depth of the triangles of a ball below its surface, at their centers.
fn largest_depth(ball: &Primitive) -> f32 {
    let depths = ball.indices.chunks_exact(3).map(|t| {
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| ball.positions[i as usize]);
        RADIUS - (a + b + c).length() / 3.0
    });
    depths.fold(0.0, f32::max)
}

#[test]
fn levels_of_detail_have_their_stated_error_and_keep_attributes() {
    let scene = crowd(100);
    let resources = scene.resources();
    let levels = &resources.assets[0].levels;
    assert!(levels.len() >= 2);
    let fine = ball();
    let (mut before, mut error) = (fine.indices.len() / 3, 0.0);
    for level in levels {
        let coarse = resources.primitives[level.primitives[0][0].unwrap() as usize].primitive();
        let triangles = coarse.indices.len() / 3;
        let depth = largest_depth(coarse) - largest_depth(&fine);
        println!("{triangles} triangles, {} m stated, {depth} m deep", level.error);
        assert!(
            4 * triangles <= 3 * before && level.error > error,
            "{triangles} of {before}, {}",
            level.error
        );
        assert!(depth < level.error && level.error < RADIUS, "{depth} m, stated {}", level.error);
        for (position, normal) in coarse.positions.iter().zip(&coarse.normals) {
            let was = fine.positions.iter().position(|p| p == position).unwrap();
            assert_eq!(fine.normals[was], *normal);
        }
        (before, error) = (triangles, level.error);
    }
}
