//! Coverage, interpolation, depth and blending of the CPU renderer against closed forms.

use crate::common::*;
use choreo_asset::*;
use choreo_render::PlanOptions;
use choreo_stage::*;
use glam::{DAffine3, DQuat, DVec3, Vec2, Vec3, Vec4};

const WHITE: [u8; 4] = [255; 4];
const BLACK: [u8; 4] = [0, 0, 0, 255];

/// An orthographic scene in which a metre is a pixel and (0, 0) the top left corner of an 8×8 image.
fn pixel_scene(primitives: Vec<Primitive>, material: Material) -> Scene {
    let mut scene = Scene::ortho(8.0);
    scene.at(&asset(primitives, vec![material], vec![]), -4.0, 4.0, 0.0);
    scene
}

fn at(x: f32, y: f32) -> Vec3 {
    Vec3::new(x, -y, 0.0)
}

#[test]
fn an_edge_through_pixel_centers_belongs_to_one_triangle() {
    let lower = triangle(at(0.0, 0.0), at(0.0, 8.0), at(8.0, 8.0));
    let upper = triangle(at(0.0, 0.0), at(8.0, 8.0), at(8.0, 0.0));
    let count = |p: &Primitive| {
        let f = draw_at(&pixel_scene(vec![p.clone()], unlit(Vec4::ONE)), [8, 8], 1);
        f.rgba.chunks_exact(4).filter(|p| *p == WHITE).count()
    };
    // The diagonal is a right edge of the lower triangle and a left edge of the upper one, which owns it.
    assert_eq!((count(&lower), count(&upper)), (28, 36));
    // Every pixel is covered once; otherwise half-transparent white would be brighter along the diagonal.
    let glass = Material { alpha_mode: AlphaMode::Blend, ..unlit(Vec4::new(1.0, 1.0, 1.0, 0.5)) };
    let f = draw_at(&pixel_scene(vec![lower, upper], glass), [8, 8], 1);
    assert!(f.rgba.chunks_exact(4).all(|p| p == [188, 188, 188, 255]), "{:?}", &f.rgba[..16]);
}

#[test]
fn four_samples_are_at_the_standard_positions() {
    let positions = [(0.375, 0.125), (0.875, 0.375), (0.125, 0.625), (0.625, 0.875)];
    // Multiples of 1/256 pixel, so that snapping changes nothing.
    let vertices = [(0.6171875, 0.40625), (1.2109375, 7.1015625), (7.4296875, 4.59375)];
    let p = triangle(at(0.6171875, 0.40625), at(1.2109375, 7.1015625), at(7.4296875, 4.59375));
    let f = draw_at(&pixel_scene(vec![p], unlit(Vec4::ONE)), [8, 8], 4);
    let mut partly = 0;
    for (i, got) in f.rgba.chunks_exact(4).enumerate() {
        let inside = |(sx, sy): &(f64, f64)| {
            let (x, y) = ((i % 8) as f64 + sx, (i / 8) as f64 + sy);
            (0..3).all(|e| {
                let ((ax, ay), (bx, by)) = (vertices[e], vertices[(e + 1) % 3]);
                (bx - ax) * (y - ay) - (by - ay) * (x - ax) < 0.0
            })
        };
        let covered = positions.iter().filter(|p| inside(p)).count();
        partly += usize::from(covered % 4 != 0);
        let e = encode(covered as f64 / 4.0).round() as u8;
        assert_eq!(got[..3], [e; 3], "pixel ({}, {}): {covered} samples", i % 8, i / 8);
    }
    assert!(partly >= 8, "the case has edges in it: {partly}");
}

#[test]
fn interpolation_is_perspective_correct_even_behind_the_camera() {
    // A floor from 20 m in front of the camera to 5 m behind it, colored by place.
    let mut scene = Scene::perspective(1.0, 0.0);
    let mut floor = Primitive {
        indices: vec![0, 1, 2, 0, 2, 3],
        positions: vec![
            Vec3::new(-12.0, -1.0, 5.0),
            Vec3::new(12.0, -1.0, 5.0),
            Vec3::new(12.0, -1.0, -20.0),
            Vec3::new(-12.0, -1.0, -20.0),
        ],
        material: Some(0),
        ..Primitive::default()
    };
    let color = |x: f64, z: f64| [(x + 12.0) / 24.0, (5.0 - z) / 25.0, 0.25];
    floor.colors = floor
        .positions
        .iter()
        .map(|p| {
            let [r, g, b] = color(p.x.into(), p.z.into());
            Vec4::new(r as f32, g as f32, b as f32, 1.0)
        })
        .collect();
    scene.at(&asset(vec![floor], vec![unlit(Vec4::ONE)], vec![]), 0.0, 0.0, 0.0);
    let f = draw_at(&scene, [90, 60], 1);
    let tan = 0.5f64.tan();
    let mut checked = 0;
    for y in 0..60 {
        for x in 0..90 {
            let dx = ((f64::from(x) + 0.5) / 45.0 - 1.0) * tan * 1.5;
            let dy = -((f64::from(y) + 0.5) / 30.0 - 1.0) * tan;
            let (px, pz) = (-dx / dy, 1.0 / dy);
            let got = pixel(&f, x, y);
            if dy < 0.0 && px.abs() < 11.9 && pz > -19.5 {
                assert_color(got, color(px, pz), &format!("({x}, {y})"));
                checked += 1;
            } else if dy > 0.0 || px.abs() > 12.1 || pz < -20.5 {
                assert_eq!(got, BLACK, "({x}, {y})");
            }
        }
    }
    assert!(checked > 1500, "{checked}");
}

#[test]
fn the_nearer_surface_is_visible_in_either_order() {
    for flip in [false, true] {
        let mut scene = Scene::perspective(1.0, 5.0);
        let red = asset(vec![quad(1.0, 1.0)], vec![unlit(Vec4::new(1.0, 0.0, 0.0, 1.0))], vec![]);
        let blue = asset(vec![quad(1.0, 1.0)], vec![unlit(Vec4::new(0.0, 0.0, 1.0, 1.0))], vec![]);
        let (first, second) = if flip { (&blue, &red) } else { (&red, &blue) };
        scene.at(first, 0.0, 0.0, if flip { 0.0 } else { 0.01 });
        scene.at(second, 0.0, 0.0, if flip { 0.01 } else { 0.0 });
        for samples in [1, 4] {
            assert_eq!(pixel(&draw_at(&scene, [9, 9], samples), 4, 4), [255, 0, 0, 255]);
        }
    }
}

#[test]
fn blending_is_linear_back_to_front_and_depth_tested() {
    let glass = |r: f32, g: f32, b: f32| {
        let m = Material { alpha_mode: AlphaMode::Blend, ..unlit(Vec4::new(r, g, b, 0.5)) };
        asset(vec![quad(2.0, 2.0)], vec![m], vec![])
    };
    let mut scene = Scene::ortho(2.0);
    scene.snapshot.background = Background::Color(Vec4::new(0.0, 0.0, 1.0, 1.0));
    // The surfaces are added front to back.
    scene.at(&glass(1.0, 0.0, 0.0), 0.0, 0.0, 2.0);
    scene.at(&glass(0.0, 1.0, 0.0), 0.0, 0.0, 1.0);
    let step = |below: f64, c: f64| decode(encode(c * 0.5 + below * 0.5).round() as u8);
    let expected = [step(step(0.0, 0.0), 1.0), step(step(0.0, 1.0), 0.0), step(step(1.0, 0.0), 0.0)];
    assert_color(pixel(&draw_at(&scene, [4, 4], 1), 1, 1), expected, "red over green over blue");
    assert_color(pixel(&draw_at(&scene, [4, 4], 4), 1, 1), expected, "with four samples");
    let wall = asset(vec![quad(2.0, 2.0)], vec![unlit(Vec4::ONE)], vec![]);
    scene.at(&wall, 0.0, 0.0, 1.5);
    let expected = [1.0, step(1.0, 0.0), step(1.0, 0.0)];
    assert_color(pixel(&draw_at(&scene, [4, 4], 1), 1, 1), expected, "red over white; green is behind");
}

#[test]
fn back_faces_are_culled_unless_double_sided_or_mirrored() {
    let shown = |double_sided: bool, mirror: bool, turned: bool| {
        let mut scene = Scene::ortho(2.0);
        let m = Material { double_sided, ..unlit(Vec4::ONE) };
        let a = asset(vec![quad(2.0, 2.0)], vec![m], vec![]);
        let turn = DQuat::from_rotation_y(if turned { std::f64::consts::PI } else { 0.0 });
        let scale = DVec3::new(if mirror { -1.0 } else { 1.0 }, 1.0, 1.0);
        scene.add(&a, DAffine3::from_scale_rotation_translation(scale, turn, DVec3::ZERO));
        pixel(&draw_at(&scene, [4, 4], 1), 1, 1) == WHITE
    };
    assert!(shown(false, false, false) && !shown(false, false, true));
    assert!(shown(false, true, false) && !shown(false, true, true), "mirrored: still seen from its front");
    assert!(shown(true, false, true) && shown(true, true, true));
}

#[test]
fn lines_and_points_are_a_pixel_wide() {
    let white = |f: choreo_plugin::Frame| -> Vec<usize> {
        f.rgba.chunks_exact(4).enumerate().filter(|(_, p)| *p == WHITE).map(|(i, _)| i).collect()
    };
    let line = Primitive {
        topology: Topology::Lines,
        indices: vec![0, 1],
        positions: vec![at(1.0, 2.5), at(6.0, 2.5)],
        material: Some(0),
        ..Primitive::default()
    };
    let f = draw_at(&pixel_scene(vec![line.clone()], matte(Vec4::ONE)), [8, 8], 1);
    assert_eq!(white(f), (17..22).collect::<Vec<_>>(), "row 2, columns 1 to 5; unlit for lack of normals");
    let points =
        Primitive { topology: Topology::Points, positions: vec![at(0.5, 0.5), at(7.5, 7.5)], ..line };
    for samples in [1, 4] {
        let f = draw_at(&pixel_scene(vec![points.clone()], unlit(Vec4::ONE)), [8, 8], samples);
        assert_eq!(white(f), [0, 63], "{samples} samples");
    }
}

#[test]
fn degenerate_triangles_and_odd_image_sizes_are_drawn() {
    let mut bad = quad(2.0, 2.0);
    bad.positions.extend([Vec3::NAN, Vec3::splat(f32::INFINITY), Vec3::splat(3e38), Vec3::splat(-3e38)]);
    bad.normals.extend([Vec3::Z; 4]);
    bad.uvs[0].extend([Vec2::splat(f32::NAN); 4]);
    bad.indices.extend([0, 1, 4, 0, 5, 2, 1, 1, 1, 0, 1, 0]);
    // Vertices so far away that rounding decides whether they cover everything or nothing: drawing must not panic.
    let huge = Primitive { indices: vec![6, 7, 0, 6, 7, 6, 1, 6, 2], ..bad.clone() };
    let huge = asset(vec![huge], vec![unlit(Vec4::ONE)], vec![]);
    let image = image(4, 4, |_, _| [255; 4]);
    let m = Material { base_color_texture: Some(texture(0)), ..matte(Vec4::ONE) };
    let a = asset(vec![bad], vec![m], vec![image]);
    let mut scene = Scene::perspective(1.0, 3.0);
    scene.snapshot.ambient_up = Vec3::ONE;
    scene.snapshot.ambient_down = Vec3::ONE;
    scene.at(&a, 0.0, 0.0, 0.0);
    scene.at(&a, 0.0, 0.0, 10.0);
    scene.add(&a, DAffine3::from_scale(DVec3::ZERO));
    scene.add(&a, DAffine3::from_scale(DVec3::splat(f64::NAN)));
    for samples in [1, 4] {
        for size in [[1, 1], [1, 300], [8192, 3], [65, 17]] {
            for no_culling in [false, true] {
                let f = draw(&scene, &PlanOptions { no_culling, ..PlanOptions::new(size, samples) });
                assert_eq!(f.rgba.len() as u32, size[0] * size[1] * 4);
                let middle = pixel(&f, size[0] / 2, size[1] / 2);
                assert!(middle[0] > 200, "the quad in the middle is there: {size:?} {samples} {middle:?}");
                let mut beyond = Scene::perspective(1.0, 3.0);
                beyond.at(&huge, 0.0, 0.0, 0.0);
                draw(&beyond, &PlanOptions { no_culling, ..PlanOptions::new(size, samples) });
            }
        }
    }
}

#[test]
fn the_gradient_runs_from_the_first_row_to_the_last() {
    let mut scene = Scene::ortho(2.0);
    let (top, bottom) = (Vec3::new(0.1, 0.2, 0.9), Vec3::new(0.8, 0.4, 0.0));
    scene.snapshot.background = Background::Gradient { top, bottom };
    let f = draw_at(&scene, [3, 40], 4);
    for y in 0..40 {
        let t = (f64::from(y) + 0.5) / 40.0;
        for c in 0..3 {
            let exact = encode(f64::from(top[c]) * (1.0 - t) + f64::from(bottom[c]) * t);
            // Gradients are dithered, so each pixel has one of the two nearest codes.
            let shown = f64::from(pixel(&f, 1, y)[c]);
            assert!((shown - exact).abs() < 1.0, "row {y}: channel {c} is {shown} instead of {exact:.2}");
        }
    }
}
