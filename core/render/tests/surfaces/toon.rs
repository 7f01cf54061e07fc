//! Toon shading: MToon's formulas (VRMC_materials_mtoon 1.0) in f64 against both renderers, and no cost for other materials.

use crate::common::*;
use choreo_asset::*;
use choreo_image_diff::compare;
use choreo_render::plan::Features;
use choreo_render::*;
use choreo_stage::*;
use glam::{DAffine3, DQuat, DVec3, Vec3, Vec4};
use std::sync::Arc;

fn toon_of(toon: Toon, base: Vec3) -> Material {
    Material { shading: Shading::Toon, toon: Some(Arc::new(toon)), ..matte(base.extend(1.0)) }
}

/// A quad seen by an orthographic camera along −Z, turned about +Y by `yaw`: N = (sin yaw, 0, cos yaw), V = +Z.
fn scene_with_turned_quad(material: Material, images: Vec<Arc<Image>>, yaw: f64) -> Scene {
    let mut scene = Scene::ortho(2.0);
    let a = asset(vec![quad(4.0, 4.0)], vec![material], images);
    scene.add(&a, DAffine3::from_quat(DQuat::from_rotation_y(yaw)));
    scene
}

/// One channel of MToon's "Lighting", "Global Illumination" and "Rim Lighting" in f64, for the normal `n` and a sun in direction `to_light`.
struct Truth {
    base: f64,
    shade: f64,
    shift: f64,
    toony: f64,
    equalization: f64,
    up: f64,
    down: f64,
    sun: f64,
    rim: f64,
    power: f64,
    lift: f64,
    mix: f64,
}

impl Truth {
    fn color(&self, n: DVec3, to_light: DVec3) -> f64 {
        let linearstep = |a: f64, b: f64, t: f64| ((t - a) / (b - a)).clamp(0.0, 1.0);
        let share = linearstep(-1.0 + self.toony, 1.0 - self.toony, n.dot(to_light) + self.shift);
        let direct = (self.shade + (self.base - self.shade) * share) * self.sun;
        let raw = self.down + (self.up - self.down) * (n.y * 0.5 + 0.5);
        let gi = raw + ((self.up + self.down) / 2.0 - raw) * self.equalization;
        let rim = (1.0 - n.z + self.lift).clamp(0.0, 1.0).powf(self.power) * self.rim;
        direct + gi * self.base + rim * (1.0 + (self.sun + gi - 1.0) * self.mix)
    }
}

fn middle_pixel(scene: &Scene) -> [u8; 4] {
    pixel(&draw_at(scene, [5, 5], 1), 2, 2)
}

#[test]
fn toon_shading_matches_the_mtoon_formulas() {
    let truth = |shift, toony, mix| Truth {
        base: 0.5,
        shade: 0.1,
        shift,
        toony,
        equalization: 0.25,
        up: 0.3,
        down: 0.1,
        sun: 0.8,
        rim: 0.2,
        power: 3.0,
        lift: 0.1,
        mix,
    };
    let to_light = DVec3::new(0.6, 0.0, 0.8);
    let mut worst_without_toon = 0.0f64;
    for (shift, toony, mix) in
        [(0.0, 0.0, 1.0), (0.0, 0.9, 0.5), (-0.3, 0.5, 0.0), (0.4, 0.7, 1.0), (0.0, 1.0, 1.0)]
    {
        for degrees in [-75.0f64, -60.0, -45.0, 0.0, 40.0, 70.0] {
            let yaw = degrees.to_radians();
            let t = truth(shift, toony, mix);
            let toon = Toon {
                shade_color: Vec3::splat(t.shade as f32),
                shading_shift: shift as f32,
                shading_toony: toony as f32,
                gi_equalization: t.equalization as f32,
                rim_color: Vec3::splat(t.rim as f32),
                rim_fresnel_power: t.power as f32,
                rim_lift: t.lift as f32,
                rim_lighting_mix: mix as f32,
                ..Toon::default()
            };
            let mut scene = scene_with_turned_quad(toon_of(toon, Vec3::splat(0.5)), vec![], yaw);
            scene.sun(-to_light.as_vec3(), Vec3::ONE, t.sun as f32);
            (scene.snapshot.ambient_up, scene.snapshot.ambient_down) = (Vec3::splat(0.3), Vec3::splat(0.1));
            let n = DVec3::new(yaw.sin(), 0.0, yaw.cos());
            let what = format!("shift {shift}, toony {toony}, mix {mix}, {degrees}°");
            let expected = t.color(n, to_light);
            assert_color(middle_pixel(&scene), [expected; 3], &what);
            let lambert = 0.5 * (n.dot(to_light).max(0.0) * t.sun + 0.2);
            worst_without_toon = worst_without_toon.max((expected - lambert).abs());
        }
    }
    // The comparison can fail: plain Lambert shading differs.
    assert!(worst_without_toon > 0.2, "{worst_without_toon}");
}

#[test]
fn toon_textures_match_the_mtoon_formulas() {
    let flat = |r: u8, g: u8, b: u8| image(1, 1, move |_, _| [r, g, b, 255]);
    let light_off = Toon { shade_color: Vec3::ONE, shading_toony: 0.5, ..Toon::default() };
    let draw = |toon: Toon, images: Vec<Arc<Image>>, yaw: f64| {
        let mut scene = scene_with_turned_quad(toon_of(toon, Vec3::splat(0.5)), images, yaw);
        scene.sun(-Vec3::Z, Vec3::ONE, 1.0);
        middle_pixel(&scene)
    };
    // The quad is turned so far that N·L = 0.26, between −0.5 and 0.5: a mix of light and shade; with a shift of −1 all is shade.
    let yaw = 75.0f64.to_radians();
    let shaded = Toon { shade_texture: Some(texture(0)), shading_shift: -1.0, ..light_off.clone() };
    assert_color(draw(shaded, vec![flat(188, 0, 255)], yaw), [decode(188), 0.0, 1.0], "shade texture");
    // The red channel of a linear texture, times its scale: 128/255 · −2 ≈ −1.
    let shifted =
        Toon { shading_shift_texture: Some(texture(0)), shading_shift_scale: -2.0, ..light_off.clone() };
    assert_color(draw(shifted, vec![flat(128, 0, 0)], yaw), [1.0; 3], "shift texture");
    // A surface that faces up and left shows the upper left quarter of a matcap.
    let ball = image(2, 2, |x, y| [if x == 0 { 255 } else { 0 }, if y == 0 { 255 } else { 0 }, 0, 255]);
    let nearest = Sampler { mag_linear: false, min_linear: false, mip_linear: None, ..Sampler::default() };
    let matcap = TextureRef { sampler: nearest, ..texture(0) };
    let capped = Toon { matcap_texture: Some(matcap), rim_lighting_mix: 0.0, ..Toon::default() };
    let material =
        Material { base_color: Vec4::new(0.0, 0.0, 0.0, 1.0), ..toon_of(capped.clone(), Vec3::ZERO) };
    let mut left_up = Scene::ortho(2.0);
    let a = asset(vec![quad(4.0, 4.0)], vec![material], vec![ball.clone()]);
    left_up.add(&a, DAffine3::from_quat(DQuat::from_rotation_y(-0.5) * DQuat::from_rotation_x(-0.5)));
    assert_color(middle_pixel(&left_up), [1.0, 1.0, 0.0], "matcap, up and left");
    let mut right_down = Scene::ortho(2.0);
    right_down.add(&a, DAffine3::from_quat(DQuat::from_rotation_y(0.5) * DQuat::from_rotation_x(0.5)));
    assert_color(middle_pixel(&right_down), [0.0; 3], "matcap, down and right");
    let masked = Toon { rim_texture: Some(texture(1)), ..capped };
    let material = toon_of(masked, Vec3::ZERO);
    let mut scene = Scene::ortho(2.0);
    let a = asset(vec![quad(4.0, 4.0)], vec![material], vec![ball, flat(0, 188, 0)]);
    scene.add(&a, DAffine3::from_quat(DQuat::from_rotation_y(-0.5) * DQuat::from_rotation_x(-0.5)));
    assert_color(middle_pixel(&scene), [0.0, decode(188), 0.0], "rim mask");
}

/// Toon materials with every feature, at many angles.
fn toon_scene() -> Scene {
    let mut scene = Scene::perspective(0.9, 6.0);
    scene.snapshot.ambient_up = Vec3::splat(0.3);
    scene.snapshot.ambient_down = Vec3::splat(0.1);
    scene.sun(Vec3::new(-0.3, -0.7, -0.6), Vec3::new(1.0, 0.9, 0.8), 0.9);
    scene.snapshot.lights.push(LightState {
        light: Light { kind: LightKind::Point, color: Vec3::X, intensity: 2.0, range: Some(9.0) },
        position: DVec3::new(1.0, 1.0, 2.0),
        direction: Vec3::NEG_Y,
        shadow: None,
        attenuation: None,
    });
    let picture = image(16, 16, |x, y| [(x * 16) as u8, (y * 16) as u8, 128, 255]);
    for i in 0..16 {
        let on = |bit: usize| (i >> bit & 1 == 1).then(|| texture(0));
        let toon = Toon {
            shade_color: Vec3::new(0.3, 0.2, 0.4),
            shade_texture: on(0),
            shading_shift: i as f32 * 0.05 - 0.3,
            shading_shift_texture: on(1),
            shading_toony: 0.3 + i as f32 * 0.04,
            matcap_texture: on(2),
            matcap: Vec3::splat(0.4),
            rim_color: Vec3::new(0.2, 0.3, 0.1),
            rim_texture: on(3),
            rim_lighting_mix: 0.5,
            ..Toon::default()
        };
        let emissive = Vec3::splat(if i == 5 { 0.2 } else { 0.0 });
        let material = Material { emissive, ..toon_of(toon, Vec3::new(0.9, 0.8, 0.7)) };
        let a = asset(vec![quad(0.6, 0.5)], vec![material], vec![picture.clone()]);
        let turn = DQuat::from_euler(glam::EulerRot::YXZ, i as f64 * 0.37 - 2.0, i as f64 * 0.21 - 1.0, 0.1);
        let place = DVec3::new((i % 4) as f64 - 1.5, (i / 4) as f64 - 1.5, (i % 3) as f64 * 0.5);
        scene.add(&a, DAffine3::from_rotation_translation(turn, place));
    }
    scene.snapshot.actors[3].tint = Vec4::new(1.0, 0.5, 0.5, 1.0);
    scene
}

#[test]
fn vulkan_and_the_cpu_reference_draw_the_same_toon() {
    let Some(mut renderer) = vulkan(GpuOptions::default()) else { return };
    let mut draw_with = |scene: &Scene, options: &PlanOptions| draw_with(&mut renderer, scene, options);
    let options = PlanOptions::new([320, 240], 1);
    let mut scene = toon_scene();
    let (vulkan, cpu) = (draw_with(&scene, &options), draw(&scene, &options));
    let c = compare(&vulkan, &cpu, 2).unwrap();
    println!("{c}");
    assert!(c.mean < 0.15 && c.share_beyond < 0.01, "{c}");
    // Forcing all features in gives the same pixels.
    let forced = draw_with(&scene, &PlanOptions { force_all: true, ..PlanOptions::new([320, 240], 1) });
    let c = compare(&vulkan, &forced, 0).unwrap();
    assert!(c.share_beyond < 0.001, "forced in: {c}");
    // The planted fault, one actor a fifth darker, is found.
    scene.snapshot.actors[5].tint = Vec4::new(0.8, 0.8, 0.8, 1.0);
    let c = compare(&draw_with(&scene, &options), &cpu, 2).unwrap();
    assert!(c.share_beyond > 0.005, "the comparison can fail: {c}");
}

#[test]
fn only_toon_materials_request_toon_features() {
    let features = |material: Material| {
        let mut scene = scene_with_turned_quad(material, vec![image(1, 1, |_, _| [255; 4])], 0.0);
        scene.sun(-Vec3::Z, Vec3::ONE, 1.0);
        let (resources, plan) = scene.plan(&PlanOptions::new([8, 8], 1));
        (plan.draws[0].pipeline.features, resources.textures.len())
    };
    let plain = matte(Vec4::ONE);
    let unused = Material {
        toon: Some(Arc::new(Toon { matcap_texture: Some(texture(0)), ..Toon::default() })),
        ..plain.clone()
    };
    assert_eq!(features(unused), (Features::METALLIC_ROUGHNESS, 0));
    assert_eq!(features(toon_of(Toon::default(), Vec3::ONE)), (Features::TOON, 0));
    // Toon shading reads no metallic-roughness textures, and no rim mask if there is no rim.
    let other = Material {
        metallic_roughness_texture: Some(texture(0)),
        occlusion_texture: Some(texture(0)),
        specular_color_texture: Some(texture(0)),
        ..toon_of(Toon { rim_texture: Some(texture(0)), ..Toon::default() }, Vec3::ONE)
    };
    assert_eq!(features(other), (Features::TOON, 0));
    let matcap = toon_of(Toon { matcap_texture: Some(texture(0)), ..Toon::default() }, Vec3::ONE);
    assert_eq!(features(matcap), (Features::TOON.with(Features::MATCAP_TEXTURE), 1));
}
