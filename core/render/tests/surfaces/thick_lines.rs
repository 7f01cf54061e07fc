//! Thick lines and points: areas against closed forms, equal images in both renderers, and extreme cases.

use crate::common::*;
use choreo_asset::*;
use choreo_image_diff::compare;
use choreo_plugin::Frame;
use choreo_render::plan::Features;
use choreo_render::*;
use glam::{DAffine3, DVec3, Vec3, Vec4};
use std::sync::Arc;

fn asset_of_lines(topology: Topology, positions: Vec<Vec3>, pen: LineStyle) -> Arc<Asset> {
    let indices = (0..positions.len() as u32).collect();
    let primitive = Primitive { topology, indices, positions, material: Some(0), ..Primitive::default() };
    let white = Material { line_style: Some(pen), ..unlit(Vec4::ONE) };
    asset(vec![primitive], vec![white], vec![])
}

fn round_style(width: f32) -> LineStyle {
    LineStyle { width, metres: false, round: true }
}

fn square_style(width: f32) -> LineStyle {
    LineStyle { round: false, ..round_style(width) }
}

/// Covered area in pixels.
fn area(frame: &Frame) -> f64 {
    frame.rgba.chunks_exact(4).map(|p| decode(p[0])).sum()
}

/// A view 6.4 m high for images of 64 × 64 pixels: ten pixels per metre.
fn scene_of_ten_pixels_per_metre(asset: &Arc<Asset>) -> Scene {
    let mut scene = Scene::ortho(6.4);
    scene.at(asset, 0.0, 0.0, 0.0);
    scene
}

#[test]
fn lines_and_points_on_the_pixel_grid_cover_exact_areas() {
    // The line runs from the pixel corner (22, 32) to (42, 32), and the square is centered on the corner (32, 32): no pixel is partly
    // covered.
    let line = asset_of_lines(Topology::Lines, vec![Vec3::X * -1.0, Vec3::X], square_style(4.0));
    let point = asset_of_lines(Topology::Points, vec![Vec3::ZERO], square_style(6.0));
    for samples in [1, 4] {
        let of_line = draw_at(&scene_of_ten_pixels_per_metre(&line), [64, 64], samples);
        let of_point = draw_at(&scene_of_ten_pixels_per_metre(&point), [64, 64], samples);
        for y in 0..64 {
            for x in 0..64 {
                let inside = |on: bool| if on { [255, 255, 255, 255] } else { [0, 0, 0, 255] };
                let on_line = (22..42).contains(&x) && (30..34).contains(&y);
                let on_point = (29..35).contains(&x) && (29..35).contains(&y);
                assert_eq!(pixel(&of_line, x, y), inside(on_line), "{samples} {x} {y}");
                assert_eq!(pixel(&of_point, x, y), inside(on_point), "{samples} {x} {y}");
            }
        }
    }
}

#[test]
fn round_lines_and_points_have_the_area_of_stadiums_and_discs() {
    let pi = std::f64::consts::PI;
    let way = Vec3::new(1.3, 0.7, 0.0);
    let length = 20.0 * f64::from(way.length());
    // Samples are points, so the area inside a boundary of B pixels is accurate to about √B/4 pixels.
    for width in [3.0f64, 8.0, 17.0] {
        let line = asset_of_lines(Topology::Lines, vec![-way, way], round_style(width as f32));
        let got = area(&draw_at(&scene_of_ten_pixels_per_metre(&line), [64, 64], 4));
        let exact = length * width + pi * width * width / 4.0;
        assert!((got - exact).abs() < 0.02 * exact, "line {width}: {got} {exact}");
        let flat = asset_of_lines(Topology::Lines, vec![-way, way], square_style(width as f32));
        let got = area(&draw_at(&scene_of_ten_pixels_per_metre(&flat), [64, 64], 4));
        assert!((got - length * width).abs() < 0.02 * exact, "flat {width}: {got}");
        let point =
            asset_of_lines(Topology::Points, vec![Vec3::new(0.013, 0.021, 0.0)], round_style(width as f32));
        let got = area(&draw_at(&scene_of_ten_pixels_per_metre(&point), [64, 64], 4));
        let exact = pi * width * width / 4.0;
        assert!((got - exact).abs() < 0.06 * exact, "point {width}: {got} {exact}");
        // The bound is smaller than a tenth of the width.
        assert!((got * 1.21 - exact).abs() > 0.06 * exact);
    }
    // A line of zero length is a disc with round ends, and nothing with flat ones.
    let nowhere = vec![Vec3::ZERO; 2];
    let dot = area(&draw_at(
        &scene_of_ten_pixels_per_metre(&asset_of_lines(Topology::Lines, nowhere.clone(), round_style(10.0))),
        [64, 64],
        4,
    ));
    assert!((dot - pi * 25.0).abs() < 3.0, "{dot}");
    let none = draw_at(
        &scene_of_ten_pixels_per_metre(&asset_of_lines(Topology::Lines, nowhere, square_style(10.0))),
        [64, 64],
        4,
    );
    assert_eq!(area(&none), 0.0);
}

#[test]
fn widths_in_metres_shrink_with_distance_and_widths_in_pixels_do_not() {
    let heights = |pen: LineStyle, distance: f64, scale: f64| {
        let line = asset_of_lines(Topology::Lines, vec![Vec3::X * -1e3, Vec3::X * 1e3], pen);
        let mut scene = Scene::perspective(1.0, distance);
        scene.add(&line, DAffine3::from_scale(DVec3::splat(scale)));
        let frame = draw_at(&scene, [64, 64], 4);
        (0..64).map(|y| decode(pixel(&frame, 32, y)[0])).sum::<f64>()
    };
    let metres = LineStyle { width: 0.3, metres: true, round: true };
    for distance in [2.0, 8.0, 50.0] {
        assert!((heights(round_style(6.0), distance, 1.0) - 6.0).abs() < 0.1, "{distance}");
        for scale in [1.0, 2.0] {
            let exact = 0.3 * scale * 32.0 / (distance * libm::tan(0.5));
            let got = heights(metres, distance, scale);
            assert!((got - exact.max(1.0)).abs() < 0.3, "{distance} {scale}: {got} {exact}");
        }
    }
}

#[test]
fn previews_keep_the_line_width_relative_to_the_height() {
    let line = asset_of_lines(Topology::Lines, vec![Vec3::X * -1e3, Vec3::X * 1e3], square_style(8.0));
    for (side, width) in [(64, 8.0), (16, 2.0), (256, 32.0)] {
        let preview_of = Some([64, 64]);
        let options = PlanOptions { preview_of, ..PlanOptions::new([side, side], 4) };
        let frame = draw(&scene_of_ten_pixels_per_metre(&line), &options);
        let got = (0..side).map(|y| decode(pixel(&frame, side / 2, y)[0])).sum::<f64>();
        assert!((got - width).abs() < 0.1, "{side}: {got} {width}");
    }
}

/// Lines through the camera, along the view, of zero length, huge, colored and mirrored.
fn scene_of_extreme_lines() -> Scene {
    let mut scene = Scene::perspective(1.0, 4.0);
    let segments = |points: &[[f32; 3]], pen| {
        asset_of_lines(Topology::Lines, points.iter().map(|p| Vec3::from_array(*p)).collect(), pen)
    };
    let through = segments(
        &[[0.5, -0.6, -30.0], [0.5, -0.6, 30.0], [-0.2, 0.4, 3.0], [-1.5, 0.9, 40.0]],
        round_style(9.0),
    );
    let metres = LineStyle { width: 0.2, metres: true, round: true };
    let thick = segments(&[[-0.7, -0.5, -9.0], [-0.7, -0.5, 9.0]], metres);
    let none = segments(&[[0.3, 0.3, 0.0], [0.3, 0.3, 0.0]], round_style(12.0));
    let along = segments(&[[0.0, 0.0, 0.0], [0.0, 0.0, -5.0]], square_style(7.0));
    let mut star = (*asset_of_lines(
        Topology::Points,
        (0..40).map(|i| Vec3::new(i as f32 * 0.1 - 2.0, 1.0, i as f32 * 0.2 - 4.0)).collect(),
        round_style(11.0),
    ))
    .clone();
    let mut mesh = (*star.meshes[0]).clone();
    mesh.primitives[0].colors = (0..40).map(|i| Vec4::new(1.0, i as f32 / 40.0, 0.2, 1.0)).collect();
    star.meshes = vec![Arc::new(mesh)];
    for asset in [&through, &thick, &none, &along] {
        scene.at(asset, 0.0, 0.0, 0.0);
    }
    scene.add(&Arc::new(star), DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)));
    scene
}

#[test]
fn both_renderers_draw_the_same_and_a_planted_fault_shows() {
    let scene = scene_of_extreme_lines();
    for samples in [1, 4] {
        let options = PlanOptions::new([96, 80], samples);
        let cpu = draw(&scene, &options);
        assert!(area(&cpu) > 500.0);
        let Some(mut gpu) = vulkan(GpuOptions::default()) else { return };
        let vulkan = draw_with(&mut gpu, &scene, &options);
        let alike = compare(&vulkan, &cpu, 2).unwrap();
        assert!(alike.share_beyond < 0.005, "{samples}: {alike}");
        let mut wider = scene_of_extreme_lines();
        wider.snapshot.actors[0].line_width = Some(10.0);
        let apart = compare(&vulkan, &draw(&wider, &options), 2).unwrap();
        assert!(apart.share_beyond > 0.005, "a pixel more is not seen");
        // Forcing all features in changes nothing.
        let forced = draw_with(&mut gpu, &scene, &PlanOptions { force_all: true, ..options });
        assert_eq!(forced.rgba, vulkan.rgba);
    }
}

#[test]
fn huge_widths_and_many_points_are_drawn() {
    for width in [16384.0, 1e30, f32::INFINITY] {
        let scene = scene_of_ten_pixels_per_metre(&asset_of_lines(
            Topology::Lines,
            vec![Vec3::NEG_X, Vec3::X],
            round_style(width),
        ));
        let whole = area(&draw_at(&scene, [64, 64], 1));
        let expected = if width.is_finite() { 64.0 * 64.0 } else { 0.0 };
        assert_eq!(whole, expected, "{width}");
    }
    let broken = vec![Vec3::NAN, Vec3::X, Vec3::splat(f32::INFINITY), Vec3::Y];
    draw_at(
        &scene_of_ten_pixels_per_metre(&asset_of_lines(Topology::Lines, broken, round_style(3.0))),
        [64, 64],
        4,
    );
    let many: Vec<Vec3> = (0..100_000u32)
        .map(|i| Vec3::new((i % 316) as f32 * 0.02 - 3.16, (i / 316) as f32 * 0.02 - 3.16, 0.0))
        .collect();
    let frame = draw_at(
        &scene_of_ten_pixels_per_metre(&asset_of_lines(Topology::Points, many, round_style(2.0))),
        [64, 64],
        1,
    );
    assert!(area(&frame) > 60.0 * 60.0);
}

/// Plan of a vertical line at x, in an image of ten pixels per metre. `width`: width of the actor's lines, in place of the style's.
fn plan_of_line(style: Option<LineStyle>, width: Option<f32>, x: f64) -> Plan {
    let mut made = (*asset_of_lines(Topology::Lines, vec![Vec3::NEG_Y, Vec3::Y], square_style(1.0))).clone();
    made.materials[0].line_style = style;
    let mut scene = Scene::ortho(6.4);
    let actor = scene.at(&Arc::new(made), x, 0.0, 0.0);
    scene.snapshot.actors[actor].line_width = width;
    scene.plan(&PlanOptions::new([64, 64], 1)).1
}

#[test]
fn only_thick_lines_request_the_thick_line_feature() {
    let thick =
        |plan: &Plan| plan.draws.iter().filter(|d| d.pipeline.features.has(Features::THICK_LINES)).count();
    let thin = plan_of_line(None, None, 0.0);
    assert_eq!((thin.draws.len(), thick(&thin)), (1, 0));
    let drawn = plan_of_line(Some(round_style(4.0)), None, 0.0);
    assert_eq!((drawn.draws.len(), thick(&drawn), drawn.instances[0].width), (1, 1, 4.0));
}

#[test]
fn lines_of_zero_width_are_not_drawn() {
    assert_eq!(plan_of_line(Some(round_style(4.0)), Some(0.0), 0.0).draws.len(), 0);
}

/// The line is a tenth of a metre, or a pixel, outside the image.
#[test]
fn a_line_outside_the_image_is_drawn_if_its_width_reaches_into_it() {
    assert_eq!(plan_of_line(Some(round_style(1.0)), None, 3.5).draws.len(), 0);
    assert_eq!(plan_of_line(Some(round_style(9.0)), None, 3.5).draws.len(), 1);
}
