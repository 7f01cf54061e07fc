//! Triplanar mapping: closed forms for each side, equal images in both renderers, and no cost for other materials.

use crate::common::*;
use choreo_asset::*;
use choreo_image_diff::compare;
use choreo_render::plan::Features;
use choreo_render::*;
use glam::{DAffine3, DQuat, DVec3, Vec2, Vec3, Vec4};
use std::sync::Arc;

/// A sphere of radius 0.5 m about the origin, whose triangles share no vertices; tangents are orthogonal to the normals.
fn ball() -> Primitive {
    let (rings, sectors) = (16u32, 32u32);
    let at = |i: u32, j: u32| {
        let (s, c) = (i as f32 / rings as f32 * std::f32::consts::PI).sin_cos();
        let (sj, cj) = (j as f32 / sectors as f32 * std::f32::consts::TAU).sin_cos();
        Vec3::new(s * sj, c, s * cj)
    };
    let mut p = Primitive { material: Some(0), ..Primitive::default() };
    for i in 0..rings {
        for j in 0..sectors {
            for (i, j) in [(i, j), (i + 1, j), (i, j + 1), (i, j + 1), (i + 1, j), (i + 1, j + 1)] {
                let n = at(i, j);
                p.indices.push(p.positions.len() as u32);
                p.positions.push(n * 0.5);
                p.normals.push(n);
                p.tangents.push(Vec3::new(0.3, 0.9, 0.1).cross(n).normalize_or(Vec3::X).extend(1.0));
            }
        }
    }
    p
}

fn material(sharpness: f32) -> Material {
    Material {
        base_color_texture: Some(texture(0)),
        normal_texture: Some(texture(1)),
        triplanar: Some(Triplanar { middle: Vec3::ZERO, size: 1.0, sharpness }),
        ..matte(Vec4::ONE)
    }
}

fn pattern_images() -> Vec<Arc<Image>> {
    vec![
        image(16, 16, |x, y| [(x * 17) as u8, (y * 17) as u8, if x > 7 { 255 } else { 0 }, 255]),
        image(16, 16, |x, y| [128 + 6 * (x % 8) as u8, 128 - 5 * (y % 8) as u8, 240, 255]),
    ]
}

fn scene(sharpness: f32, mirrored: f64) -> Scene {
    let mut scene = Scene::perspective(0.5, 3.0);
    scene.snapshot.ambient_up = Vec3::splat(0.2);
    scene.sun(Vec3::new(-0.4, -0.6, -0.7), Vec3::ONE, 0.9);
    let turn = DQuat::from_euler(glam::EulerRot::YXZ, 0.6, 0.4, 0.2);
    let scale = DVec3::new(mirrored, 1.0, 1.2);
    let asset = asset(vec![ball()], vec![material(sharpness)], pattern_images());
    scene.add(&asset, DAffine3::from_scale_rotation_translation(scale, turn, DVec3::ZERO));
    scene
}

#[test]
fn triplanar_mapping_shows_each_side_upright() {
    // Faces of a box of one metre, viewed perpendicularly: u to the right, v down, on every face.
    for (normal, right) in [
        (Vec3::X, Vec3::NEG_Z),
        (Vec3::NEG_X, Vec3::Z),
        (Vec3::Z, Vec3::X),
        (Vec3::NEG_Z, Vec3::NEG_X),
        (Vec3::Y, Vec3::X),
        (Vec3::NEG_Y, Vec3::X),
    ] {
        let up = normal.cross(right);
        let corner = |x: f32, y: f32| (normal + right * x + up * y) * 0.5;
        let face = Primitive {
            indices: vec![0, 1, 2, 0, 2, 3],
            positions: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
            normals: vec![normal; 4],
            material: Some(0),
            ..Primitive::default()
        };
        let look = Material { normal_texture: None, shading: Shading::Unlit, ..material(4.0) };
        let nearest =
            Sampler { mag_linear: false, min_linear: false, mip_linear: None, ..Sampler::default() };
        let map = TextureRef { sampler: nearest, ..texture(0) };
        let look = Material { base_color_texture: Some(map), ..look };
        let mut scene = Scene::ortho(1.0);
        let turn = glam::DMat3::from_cols(right.as_dvec3(), up.as_dvec3(), normal.as_dvec3()).transpose();
        scene.add(&asset(vec![face], vec![look], pattern_images()), DAffine3::from_mat3(turn));
        let frame = draw_at(&scene, [16, 16], 1);
        let picture = &pattern_images()[0];
        for y in 0..16 {
            for x in 0..16 {
                let at = (y * 16 + x) as usize * 4;
                assert_eq!(pixel(&frame, x, y)[..3], picture.rgba[at..at + 3], "{normal} at {x} {y}");
            }
        }
    }
}

#[test]
fn both_renderers_draw_the_same_triplanar_mapping() {
    for mirrored in [1.0, -1.0] {
        let options = PlanOptions::new([80, 80], 1);
        let cpu = draw(&scene(4.0, mirrored), &options);
        assert!(compare(&cpu, &draw(&scene(12.0, mirrored), &options), 2).unwrap().share_beyond > 0.02);
        let Some(mut gpu) = vulkan(GpuOptions::default()) else { return };
        let vulkan = draw_with(&mut gpu, &scene(4.0, mirrored), &options);
        let alike = compare(&vulkan, &cpu, 3).unwrap();
        assert!(alike.share_beyond < 0.01, "{mirrored}: {alike}");
        let forced = PlanOptions { force_all: true, ..options };
        let forced = draw_with(&mut gpu, &scene(4.0, mirrored), &forced);
        assert!(compare(&vulkan, &forced, 1).unwrap().share_beyond < 0.002);
    }
}

#[test]
fn a_flat_triplanar_normal_map_changes_nothing() {
    let flat = |normal: bool| {
        let mut s = scene(4.0, -1.0);
        let mut asset = (*s.stage.actors[0].asset).clone();
        asset.images[1] = image(2, 2, |_, _| [128, 128, 255, 255]);
        if !normal {
            asset.materials[0].normal_texture = None;
        }
        s.stage.actors[0].asset = Arc::new(asset);
        draw_at(&s, [80, 80], 1)
    };
    // Code 128 is not exactly the middle of the range, so the normals are tilted slightly.
    let alike = compare(&flat(true), &flat(false), 3).unwrap();
    assert!(alike.share_beyond < 0.01, "{alike}");
    let bent = compare(&draw_at(&scene(4.0, -1.0), [80, 80], 1), &flat(false), 3).unwrap();
    assert!(bent.share_beyond > 0.05, "{bent}");
}

#[test]
fn only_triplanar_materials_request_the_feature() {
    let (_, plan) = scene(4.0, 1.0).plan(&PlanOptions::new([64, 64], 1));
    let features = plan.draws[0].pipeline.features;
    assert!(
        features.has(Features::TRIPLANAR)
            && !features.has(Features::UV0)
            && features.has(Features::NORMAL_TEXTURE)
    );
    let mut plain = quad(1.0, 1.0);
    plain.uvs[0] = vec![Vec2::ZERO; 4];
    let material = Material { base_color_texture: Some(texture(0)), ..matte(Vec4::ONE) };
    let mut other = Scene::ortho(2.0);
    other.at(&asset(vec![plain], vec![material], pattern_images()), 0.0, 0.0, 0.0);
    let (_, plan) = other.plan(&PlanOptions::new([64, 64], 1));
    assert!(!plan.draws[0].pipeline.features.has(Features::TRIPLANAR));
}
