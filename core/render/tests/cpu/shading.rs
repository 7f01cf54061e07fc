//! Shading of the CPU renderer against the formulas in f64; textures, effects and reproducible bits.

use crate::common;
use crate::common::*;
use crate::wall::{middle_pixel, wall};
use choreo_asset::*;
use choreo_image_diff::compare;
use choreo_render::{CpuRenderer, PlanOptions, Renderer};
use choreo_stage::*;
use glam::{Affine2, DVec3, Vec2, Vec3, Vec4};
use std::sync::Arc;

/// glTF 2.0 Appendix B in f64 for N = V = +Z, one channel, times π.
fn metallic_roughness(base: f64, metallic: f64, roughness: f64, specular: f64, l: DVec3) -> f64 {
    let h = (l + DVec3::Z).normalize();
    let (nl, nh, vh) = (l.z, h.z, h.z);
    let a2 = roughness.powi(4);
    let d = a2 / (nh * nh * (a2 - 1.0) + 1.0).powi(2);
    let v = 0.5 / (nl * 1.0 + (a2 + (1.0 - a2) * nl * nl).sqrt());
    let f0 = 0.04 * specular * (1.0 - metallic) + base * metallic;
    let f90 = specular * (1.0 - metallic) + metallic;
    let f = f0 + (f90 - f0) * (1.0 - vh).powi(5);
    (base * (1.0 - metallic) * (1.0 - f) + f * v * d) * nl
}

#[test]
fn metallic_roughness_matches_its_formula_under_one_sun() {
    for (metallic, roughness, specular) in
        [(0.0, 1.0, 1.0), (0.0, 0.3, 1.0), (0.0, 0.5, 0.0), (1.0, 0.4, 1.0), (0.5, 0.7, 0.5)]
    {
        for degrees in [0.0f64, 20.0, 55.0, 80.0] {
            let (s, c) = degrees.to_radians().sin_cos();
            let to_light = DVec3::new(s, 0.0, c);
            let base = [0.6, 0.3, 0.1];
            let color = Vec4::new(0.6, 0.3, 0.1, 1.0);
            let mut scene = wall(Material {
                metallic: metallic as f32,
                roughness: roughness as f32,
                specular: specular as f32,
                ..matte(color)
            });
            scene.sun(-to_light.as_vec3(), Vec3::ONE, 0.8);
            // 1 − max F equals 1 − F of a channel only if F is gray or that channel has the largest F.
            let expected = base.map(|b| 0.8 * metallic_roughness(b, metallic, roughness, specular, to_light));
            let got = middle_pixel(&scene);
            if metallic == 0.0 {
                assert_color(got, expected, &format!("roughness {roughness}, {degrees}°"));
            } else {
                assert!((f64::from(got[0]) - encode(expected[0])).abs() < 0.75, "largest channel: {got:?}");
            }
        }
    }
}

#[test]
fn a_white_diffuse_wall_facing_light_one_is_white() {
    // Without specular reflection only Lambertian shading remains.
    let mut scene = wall(Material { specular: 0.0, ..matte(Vec4::ONE) });
    scene.sun(-Vec3::Z, Vec3::new(1.0, 0.5, 0.25), 1.0);
    assert_color(middle_pixel(&scene), [1.0, 0.5, 0.25], "lux times color");
    // The planted fault, a light a tenth weaker, is found.
    let a = draw_at(&scene, [5, 5], 1);
    scene.snapshot.lights[0].light.intensity = 0.9;
    let c = compare(&a, &draw_at(&scene, [5, 5], 1), 1).unwrap();
    assert!(c.share_beyond == 1.0 && c.worst >= 12, "{c}");
}

#[test]
fn point_and_spot_light_falloff_matches_closed_forms() {
    let light = |kind, range| LightState {
        light: Light { kind, color: Vec3::ONE, intensity: 3.0, range },
        position: DVec3::new(0.0, 0.0, 2.0),
        direction: Vec3::NEG_Z,
        shadow: None,
        attenuation: None,
    };
    let mut scene = wall(Material { specular: 0.0, ..matte(Vec4::ONE) });
    for (kind, range, expected) in [
        (LightKind::Point, None, 0.75),
        (LightKind::Point, Some(3.0), 0.75 * (1.0 - (2.0f64 / 3.0).powi(4))),
        (LightKind::Point, Some(2.0), 0.0),
        (LightKind::Spot { inner: 0.2, outer: 0.5 }, None, 0.75),
    ] {
        scene.snapshot.lights = vec![light(kind, range)];
        assert_color(middle_pixel(&scene), [expected; 3], &format!("{kind:?} {range:?}"));
    }
    // 0.3 rad off the axis, between the inner and the outer cone. The center pixel shows x = 0.
    let mut spot = light(LightKind::Spot { inner: 0.2, outer: 0.5 }, None);
    let x = 2.0 * 0.3f64.tan();
    spot.position.x = x;
    scene.snapshot.lights = vec![spot];
    let (cos, d2) = (0.3f64.cos(), 4.0 + x * x);
    let cone = ((cos - 0.5f64.cos()) / (0.2f64.cos() - 0.5f64.cos())).powi(2);
    assert_color(middle_pixel(&scene), [3.0 / d2 * cos * cone; 3], "between the cones");
}

#[test]
fn blinn_phong_and_ambient_light_match_closed_forms() {
    let material = Material {
        shading: Shading::BlinnPhong,
        specular_color: Vec3::splat(0.05),
        shininess: 20.0,
        ..matte(Vec4::new(0.5, 0.25, 0.125, 1.0))
    };
    let mut scene = wall(material.clone());
    let to_light = DVec3::new(0.6, 0.0, 0.8);
    scene.sun(-to_light.as_vec3(), Vec3::ONE, 1.0);
    let nh = (to_light + DVec3::Z).normalize().z;
    let highlight = 0.05 * 28.0 / 8.0 * nh.powi(20);
    assert_color(middle_pixel(&scene), [0.5, 0.25, 0.125].map(|b| (b + highlight) * 0.8), "Blinn–Phong");
    // A wall's normal is horizontal, so it gets the mean of the upper and the lower ambient light.
    let mut scene = wall(material);
    scene.snapshot.ambient_up = Vec3::new(1.0, 0.5, 0.0);
    scene.snapshot.ambient_down = Vec3::new(0.0, 0.5, 1.0);
    assert_color(middle_pixel(&scene), [0.25, 0.125, 0.0625], "hemisphere");
}

#[test]
fn ambient_of_metallic_roughness_is_the_fitted_brdf() {
    let mut scene = wall(Material { metallic: 1.0, roughness: 0.4, ..matte(Vec4::new(0.9, 0.6, 0.3, 1.0)) });
    scene.snapshot.ambient_up = Vec3::splat(0.8);
    scene.snapshot.ambient_down = Vec3::splat(0.8);
    let r: f64 = 0.4;
    let (x, y) = (1.0 - r, 0.0425 - 0.0275 * r);
    let a = (x * x).min((-9.28f64).exp2()) * x + y;
    let (scale, bias) = (-1.04 * a + 1.04 - 0.572 * r, 1.04 * a + 0.022 * r - 0.04);
    assert_color(middle_pixel(&scene), [0.9, 0.6, 0.3].map(|f0| 0.8 * (f0 * scale + bias)), "Karis 2014");
}

fn textured_wall(material: Material, image: Arc<Image>, half: f32, height: f32) -> Scene {
    let mut scene = Scene::ortho(height);
    let material =
        Material { base_color_texture: material.base_color_texture.or(Some(texture(0))), ..material };
    scene.at(&asset(vec![quad(half, half)], vec![material], vec![image]), 0.0, 0.0, 0.0);
    scene
}

#[test]
fn the_first_texel_is_top_left() {
    let colors = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 0, 255]];
    let image = image(2, 2, |x, y| colors[(y * 2 + x) as usize]);
    let f = draw_at(&textured_wall(unlit(Vec4::ONE), image.clone(), 1.0, 2.0), [2, 2], 1);
    assert_eq!([pixel(&f, 0, 0), pixel(&f, 1, 0), pixel(&f, 0, 1), pixel(&f, 1, 1)], colors);
    // KHR_texture_transform: an offset of half a texture to the right.
    let moved = TextureRef { uv_transform: Affine2::from_translation(Vec2::new(0.5, 0.0)), ..texture(0) };
    let m = Material { base_color_texture: Some(moved), ..unlit(Vec4::ONE) };
    let f = draw_at(&textured_wall(m, image, 1.0, 2.0), [2, 2], 1);
    assert_eq!([pixel(&f, 0, 0), pixel(&f, 1, 0)], [colors[1], colors[0]]);
}

#[test]
fn distant_checkerboard_is_gray_in_linear_light() {
    let board = image(64, 64, |x, y| if (x + y) % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] });
    let f = draw_at(&textured_wall(unlit(Vec4::ONE), board.clone(), 1.0, 2.0), [8, 8], 1);
    assert!(f.rgba.chunks_exact(4).all(|p| p == [188, 188, 188, 255]), "{:?}", pixel(&f, 3, 3));
    // Without mipmaps the texture is not filtered to the mean.
    let sampler = Sampler { mip_linear: None, min_linear: false, mag_linear: false, ..Sampler::default() };
    let m = Material { base_color_texture: Some(TextureRef { sampler, ..texture(0) }), ..unlit(Vec4::ONE) };
    let f = draw_at(&textured_wall(m, board, 1.0, 2.0), [8, 8], 1);
    assert!(f.rgba.chunks_exact(4).all(|p| p[0] == 0 || p[0] == 255));
}

#[test]
fn alpha_masks_cut_holes_that_show_the_background() {
    let image = image(2, 1, |x, _| [255, 255, 255, if x == 0 { 100 } else { 200 }]);
    let m = Material { alpha_mode: AlphaMode::Mask(0.5), ..unlit(Vec4::ONE) };
    let mut scene = textured_wall(m, image, 1.0, 2.0);
    let red = asset(vec![quad(1.0, 1.0)], vec![unlit(Vec4::new(1.0, 0.0, 0.0, 1.0))], vec![]);
    scene.at(&red, 0.0, 0.0, -1.0);
    // With four samples, smooth cut-outs (cutouts.rs) keep single samples.
    scene.stage.settings.cutouts = Cutouts::Hard;
    for samples in [1, 4] {
        let f = draw_at(&scene, [2, 2], samples);
        assert_eq!([pixel(&f, 0, 0), pixel(&f, 1, 0)], [[255, 0, 0, 255], [255; 4]], "{samples} samples");
    }
}

#[test]
fn normal_maps_change_the_shading_normal() {
    let mut p = quad(2.0, 2.0);
    // u to the right, v downwards: the bitangent N × T · w must point up (−v).
    p.tangents = vec![Vec4::new(1.0, 0.0, 0.0, 1.0); 4];
    // x = 153/255·2 − 1 = 0.2, y = −0.6 …: tilted to the right and down.
    let image = image(1, 1, |_, _| [153, 51, 230, 255]);
    let n = DVec3::new(153.0, 51.0, 230.0) / 255.0 * 2.0 - 1.0;
    let m = Material { normal_texture: Some(texture(0)), specular: 0.0, ..matte(Vec4::ONE) };
    let mut scene = Scene::ortho(2.0);
    scene.at(&asset(vec![p], vec![m], vec![image]), 0.0, 0.0, 0.0);
    let to_light = DVec3::new(0.3, 0.4, 0.866).normalize();
    scene.sun(-to_light.as_vec3(), Vec3::ONE, 1.0);
    assert_color(middle_pixel(&scene), [n.normalize().dot(to_light); 3], "Lambert with the map's normal");
}

#[test]
fn skin_and_morphs_move_vertices_and_normals() {
    // The upper half is bound to a joint that is turned by 90° about X: its normals face up.
    let mut scene = Scene::ortho(4.0);
    let a = skinned_asset(vec![quad(1.0, 1.0)], vec![Material { specular: 0.0, ..matte(Vec4::ONE) }]);
    let actor = scene.at(&a, 0.0, 0.0, 0.0);
    scene.snapshot.actors[actor].model_from_joint[1].translation = glam::Vec3A::new(0.0, 0.5, 0.0);
    scene.sun(-Vec3::Z, Vec3::ONE, 1.0);
    let f = draw_at(&scene, [64, 64], 1);
    let rows: Vec<u32> = (0..64).filter(|y| pixel(&f, 32, *y)[0] == 255).collect();
    // The strip covers y = 0.5 (the upper edge, half a metre lower than at rest) to −1.
    assert_eq!((rows.first(), rows.last(), rows.len()), (Some(&24), Some(&47), 24));
    let mut p = quad(1.0, 1.0);
    p.morphs = vec![MorphTarget {
        positions: vec![Vec3::new(1.0, 0.0, 0.0); 4],
        normals: vec![Vec3::new(1.0, 0.0, 0.0); 4],
        tangents: vec![],
    }];
    let mut scene = Scene::ortho(4.0);
    let actor = scene.at(
        &asset(vec![p], vec![Material { specular: 0.0, ..matte(Vec4::ONE) }], vec![]),
        0.0,
        0.0,
        0.0,
    );
    scene.snapshot.actors[actor].morph_weights[0] = vec![0.5];
    scene.sun(-Vec3::Z, Vec3::ONE, 1.0);
    let f = draw_at(&scene, [64, 64], 1);
    let columns: Vec<u32> = (0..64).filter(|x| pixel(&f, *x, 32)[0] > 0).collect();
    assert_eq!((columns.first(), columns.last()), (Some(&24), Some(&55)), "half a metre to the right");
    assert_color(pixel(&f, 32, 32), [1.0 / 1.25f64.sqrt(); 3], "the normal (0.5, 0, 1), made unit");
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let scene = busy_scene(DVec3::ZERO);
    for samples in [1, 4] {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| draw_at(&scene, [201, 133], samples))
        };
        let one = with(1);
        assert!(one == with(2) && one == with(8), "{samples} samples");
        let colors: std::collections::BTreeSet<_> = one.rgba.chunks_exact(4).collect();
        assert!(colors.len() > 500, "there is something in the picture: {} colors", colors.len());
    }
}

#[test]
fn the_image_is_the_same_10000_km_from_the_origin() {
    let near = draw_at(&busy_scene(DVec3::ZERO), [160, 120], 4);
    let far = draw_at(&busy_scene(DVec3::new(1e7, -1e7, 1e7)), [160, 120], 4);
    // Positions are rounded to 2 nm at this distance.
    let c = compare(&near, &far, 2).unwrap();
    assert!(c.share_beyond < 0.001, "{c}");
}

#[test]
fn forcing_all_features_in_changes_no_pixel() {
    let scene = busy_scene(DVec3::ZERO);
    for samples in [1, 4] {
        let options = PlanOptions::new([160, 120], samples);
        let lean = draw(&scene, &options);
        let forced = draw(&scene, &PlanOptions { force_all: true, ..options.clone() });
        let c = compare(&lean, &forced, 0).unwrap();
        assert!(c.worst == 0, "{samples} samples, forced: {c}");
        let all = draw(&scene, &PlanOptions { no_culling: true, no_instancing: true, ..options });
        assert!(compare(&lean, &all, 0).unwrap().worst == 0, "without culling and instancing");
    }
}

#[test]
fn an_effect_changes_each_pixel_by_its_function() {
    let effects = effects::named(&["vignette"]);
    let mut scene = busy_scene(DVec3::ZERO);
    scene.snapshot.background = Background::Color(Vec4::new(0.5, 0.5, 0.5, 1.0));
    let options = PlanOptions { effects: &effects, ..PlanOptions::new([64, 48], 4) };
    let plain = draw(&scene, &options);
    common::use_effect(&mut scene, "vignette", &[("strength", 0.8)], &[]);
    let dark = draw(&scene, &options);
    let corner = pixel(&dark, 0, 0);
    let uv = Vec2::new(0.5 / 64.0, 0.5 / 48.0);
    let parameters = [0.8f32, 0.5];
    // The vignette in f64: half a smoothstep of the distance from the center relative to that of the corner.
    let from_center = f64::from((uv * 2.0 - 1.0).length()) * std::f64::consts::FRAC_1_SQRT_2;
    let x = ((from_center - f64::from(parameters[1])) / (1.0 - f64::from(parameters[1]))).clamp(0.0, 1.0);
    let expected = 0.5 * (1.0 - f64::from(parameters[0]) * x * x * (3.0 - 2.0 * x));
    assert_color(corner, [expected; 3], "the corner");
    // Float samples are averaged before they are rounded: one step of difference.
    let center = (pixel(&plain, 32, 24), pixel(&dark, 32, 24));
    assert!(center.0.iter().zip(center.1).all(|(a, b)| a.abs_diff(b) <= 1), "{center:?}");
}

#[test]
fn misuse_of_the_renderer_is_an_error_with_a_message() {
    let scene = wall(unlit(Vec4::ONE));
    let (resources, plan) = scene.plan(&PlanOptions::new([4, 4], 1));
    let mut r = CpuRenderer::new(&[]);
    let error_text = |e: Result<(), choreo_render::RenderError>| e.unwrap_err().to_string();
    assert_eq!(
        error_text(r.submit(plan.clone())),
        "the plan belongs to scene resources that are not loaded: load them before you submit it"
    );
    r.load(resources).unwrap();
    assert_eq!(
        r.collect(None).unwrap_err().to_string(),
        "no frame is submitted: submit a plan before you collect a frame"
    );
    let wide = choreo_render::Plan { size: [16385, 4], ..plan.clone() };
    assert_eq!(error_text(r.submit(wide)), "image width is 16385, the limit of this device is 16384");
    assert!(
        error_text(r.submit(choreo_render::Plan { samples: 2, ..plan.clone() }))
            .starts_with("number of samples (1 or 4) is 2")
    );
    r.submit(plan.clone()).unwrap();
    r.submit(plan.clone()).unwrap();
    assert_eq!(error_text(r.submit(plan)), "two frames are already submitted: collect one first");
}
