//! Levels of detail: crowds are drawn coarser far away, with an error of at most a pixel.

mod common;

use choreo_asset::*;
use choreo_render::scene_resources::lod::{CROWD, TOLERANCE};
use choreo_render::{CpuRenderer, Plan, PlanOptions, Renderer, SceneResources};
use common::*;
use glam::{Vec3, Vec4};
use std::sync::Arc;

const SIZE: [u32; 2] = [320, 180];

const RADIUS: f32 = 0.4;

/// A ball of 16 rings of quads.
fn ball() -> Primitive {
    let n = 16;
    let (rows, columns) = (n + 1, 2 * n + 1);
    let at = |i: usize| {
        let a = (i / columns) as f32 / n as f32 * std::f32::consts::PI;
        // The last column lies exactly on the first.
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

/// So many balls, ten abreast, the rows going away from the camera.
fn crowd(count: usize) -> Scene {
    let mut scene = Scene::perspective(0.8, 3.0);
    let ball = asset(vec![ball()], vec![unlit(Vec4::ONE)], vec![]);
    for i in 0..count {
        scene.at(&ball, (i % 10) as f64 - 4.5, -0.5, -2.0 * (i / 10) as f64);
    }
    scene
}

fn triangles(resources: &SceneResources, plan: &Plan) -> usize {
    let of = |p: u32| resources.primitives[p as usize].primitive().indices.len() / 3;
    plan.draws.iter().map(|d| of(d.primitive) * d.instance_count as usize).sum()
}

fn image(resources: &Arc<SceneResources>, plan: &Plan) -> Vec<u8> {
    let mut renderer = CpuRenderer::new(&[]);
    renderer.load(resources.clone()).unwrap();
    renderer.submit(plan.clone()).unwrap();
    renderer.collect(None).unwrap().rgba
}

/// Pixels of b that differ from a, more than a pixel away from any edge in a.
fn far_off(a: &[u8], b: &[u8]) -> usize {
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
fn copies_of_a_crowd_are_coarser_the_smaller_they_are() {
    let scene = crowd(200);
    let options = PlanOptions::new(SIZE, 1);
    let (resources, plan) = scene.plan(&options);
    let (_, full) = scene.plan(&PlanOptions { full_detail: true, ..options.clone() });
    let (few, all) = (triangles(&resources, &plan), triangles(&resources, &full));
    println!(
        "{few} triangles instead of {all}, in {} draws instead of {}",
        plan.draws.len(),
        full.draws.len()
    );
    assert!(3 * few < all, "{few} of {all}");
    assert!(plan.draws.len() <= 1 + resources.lods[0].len(), "one a level at most");
    let said = plan.left_out.iter().find(|l| l.what == "triangles too small to see").unwrap();
    assert!(said.why.contains(&format!("at most {TOLERANCE} pixel")), "{said:?}");
    // Nearer copies are never coarser.
    let depth = |d: &choreo_render::plan::Draw| {
        let of = &plan.instances[d.first_instance as usize..][..d.instance_count as usize];
        let depths = of.iter().map(|i| -i.relative_from_mesh.0[2].w);
        (depths.clone().fold(f32::MAX, f32::min), depths.fold(f32::MIN, f32::max))
    };
    let mut draws: Vec<_> = plan.draws.iter().map(|d| (d.primitive, depth(d))).collect();
    draws.sort_by_key(|d| d.0);
    assert!(draws.len() >= 2 && draws.windows(2).all(|d| d[0].1.1 <= d[1].1.0 + 1.0), "{draws:?}");

    let (a, b) = (image(&resources, &full), image(&resources, &plan));
    assert!(a != b, "coarser balls are not the same to the last pixel");
    assert_eq!(far_off(&a, &b), 0, "pixels off by more than one");
    // All by the coarsest, the comparison fails.
    let mut wrong = (*resources).clone();
    wrong.lods.iter_mut().flatten().for_each(|level| level.error = 0.0);
    let plan = Plan::new(&wrong, &scene.stage, &scene.snapshot, &options);
    assert!(far_off(&a, &image(&Arc::new(wrong), &plan)) > 0);
}

#[test]
fn few_are_drawn_as_they_are() {
    let options = PlanOptions::new(SIZE, 1);
    let (resources, plan) = crowd(CROWD - 1).plan(&options);
    assert!(resources.lods.iter().all(Vec::is_empty) && resources.primitives.len() == 1);
    assert!(plan.draws.iter().all(|d| d.primitive == 0));
    assert!(plan.left_out.iter().all(|l| l.what != "triangles too small to see"));
    // A catalogue made after another takes the levels from there.
    let scene = crowd(CROWD);
    let first = scene.resources();
    let next = SceneResources::after(&first, &scene.stage);
    assert_eq!(first.lods, next.lods);
    let level = first.lods[0][0].primitive as usize;
    assert!(Arc::ptr_eq(&first.primitives[level].mesh, &next.primitives[level].mesh));
}

#[test]
fn levels_are_off_by_what_they_say_and_keep_what_vertices_have() {
    let scene = crowd(CROWD);
    let resources = scene.resources();
    let levels = &resources.lods[0];
    assert!(levels.len() >= 2);
    let fine = ball();
    let (mut before, mut error) = (fine.indices.len() / 3, 0.0);
    for level in levels {
        let coarse = resources.primitives[level.primitive as usize].primitive();
        let triangles = coarse.indices.len() / 3;
        // The deepest place of a triangle with its corners on the ball lies before its middle.
        let depths = coarse.indices.chunks_exact(3).map(|t| {
            let [a, b, c] = [t[0], t[1], t[2]].map(|i| coarse.positions[i as usize]);
            RADIUS - (a + b + c).length() / 3.0
        });
        let depth = depths.fold(0.0f32, f32::max);
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
