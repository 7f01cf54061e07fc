//! Image-based light of the CPU renderer against integrals in f64, and of the Vulkan renderer against it.

use crate::common;
use crate::common::*;
use choreo_asset::*;
use choreo_image_diff::compare;
use choreo_render::plan::Features;
use choreo_render::sky::prefilter::radiance;
use choreo_render::{GpuOptions, PlanOptions};
use choreo_stage::*;
use glam::{DVec3, Vec3, Vec4};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

fn panorama(width: u32, color: impl Fn(DVec3) -> DVec3) -> Arc<Panorama> {
    let height = width / 2;
    let mut rgb = Vec::new();
    for y in 0..height {
        let polar = (f64::from(y) + 0.5) / f64::from(height) * PI;
        for x in 0..width {
            let turn = ((f64::from(x) + 0.5) / f64::from(width) - 0.5) * TAU;
            let way = DVec3::new(turn.sin() * polar.sin(), polar.cos(), -turn.cos() * polar.sin());
            rgb.extend(color(way).as_vec3().to_array());
        }
    }
    Arc::new(Panorama::new("test", width, height, rgb).unwrap())
}

/// A smooth panorama that differs in every direction.
fn smooth_panorama() -> Arc<Panorama> {
    panorama(128, |way| DVec3::new(0.30 + 0.2 * way.x, 0.30 + 0.2 * way.y, 0.30 + 0.25 * way.z * way.x))
}

/// A quad that fills the image, facing an orthographic camera (N = V = +Z), under a sky.
fn wall(material: Material, sky: Sky) -> Scene {
    let mut scene = Scene::ortho(2.0);
    scene.at(&asset(vec![quad(2.0, 2.0)], vec![material], vec![]), 0.0, 0.0, 0.0);
    with_sky(scene, sky)
}

fn with_sky(mut scene: Scene, sky: Sky) -> Scene {
    let Sky { panorama, turn, strength, background, .. } = sky.clone();
    scene.snapshot.sky = Some(SkyState { panorama, turn, strength, background });
    scene.stage.sky = Some(sky);
    scene
}

fn middle_pixel(scene: &Scene) -> [u8; 4] {
    pixel(&draw_at(scene, [5, 5], 1), 2, 2)
}

fn turned_sky(degrees: f64) -> Sky {
    Sky { turn: degrees.to_radians(), ..Sky::new(smooth_panorama()) }
}

/// Direction in the panorama of a turned sky for a direction in the world.
fn panorama_direction(way: DVec3, degrees: f64) -> DVec3 {
    let (s, c) = degrees.to_radians().sin_cos();
    DVec3::new(c * way.x - s * way.z, way.y, s * way.x + c * way.z)
}

/// ∫ radiance · weight over directions about +Z, by the midpoint rule in the azimuth and in √(1 − cosine), which is finer about the middle.
fn integral(sky: &Panorama, degrees: f64, weight: impl Fn(DVec3) -> f64) -> DVec3 {
    let (rings, sectors) = (256, 256);
    let mut sum = DVec3::ZERO;
    for i in 0..rings {
        let u = (f64::from(i) + 0.5) / f64::from(rings);
        let z = 1.0 - u * u;
        let flat = (1.0 - z * z).sqrt();
        for j in 0..sectors {
            let (s, c) = ((f64::from(j) + 0.5) / f64::from(sectors) * TAU).sin_cos();
            let way = DVec3::new(c * flat, s * flat, z);
            sum +=
                radiance(sky, panorama_direction(way, degrees).as_vec3()).as_dvec3() * weight(way) * 2.0 * u;
        }
    }
    sum * TAU / f64::from(rings) / f64::from(sectors)
}

fn assert_near(got: [u8; 4], linear: DVec3, steps: f64, what: &str) {
    for c in 0..3 {
        let e = encode(linear[c]);
        assert!(
            (f64::from(got[c]) - e).abs() <= steps,
            "{what}: channel {c} is {} instead of {e:.2}",
            got[c]
        );
    }
}

#[test]
fn diffuse_sky_light_is_the_cosine_weighted_integral() {
    // Blinn–Phong without a specular color is purely diffuse.
    let dull = Material {
        shading: Shading::BlinnPhong,
        specular_color: Vec3::ZERO,
        ..matte(Vec4::new(1.0, 1.0, 1.0, 1.0))
    };
    for degrees in [0.0, 90.0, -135.0] {
        let expected = integral(&smooth_panorama(), degrees, |way| way.z) / PI;
        assert_near(
            middle_pixel(&wall(dull.clone(), turned_sky(degrees))),
            expected,
            1.0,
            &format!("turned by {degrees}°"),
        );
    }
}

#[test]
fn specular_sky_light_is_the_integral_of_the_ggx_lobe() {
    for roughness in [0.2, 0.4, 0.7, 1.0] {
        let alpha2 = f64::powi(roughness, 4);
        // A white metal shows the whole reflection: D · G2 / (4 NV) with N = V, Fresnel 1.
        let lobe = |l: DVec3| {
            let h = (l + DVec3::Z).normalize();
            let d = alpha2 / (PI * (h.z * h.z * (alpha2 - 1.0) + 1.0).powi(2));
            let smith = l.z + (l.z * l.z * (1.0 - alpha2) + alpha2).sqrt();
            d * 0.5 / smith * l.z
        };
        let metal = Material { metallic: 1.0, roughness: roughness as f32, ..matte(Vec4::ONE) };
        for degrees in [0.0, 90.0] {
            // The second half of the split sum is Karis' fit, 1 − 0.55 · roughness of a white metal seen straight on.
            let white = panorama(16, |_| DVec3::ONE);
            let share = (1.0 - 0.55 * roughness) / integral(&white, 0.0, lobe);
            let expected = integral(&smooth_panorama(), degrees, lobe) * share;
            let got = middle_pixel(&wall(metal.clone(), turned_sky(degrees)));
            // Prefiltered maps weight the lobe by its cosine only, without the shadowing term.
            assert_near(got, expected, 3.0, &format!("roughness {roughness}, turned by {degrees}°"));
        }
    }
}

/// White furnace test: in a uniformly white room, white materials have the color of the room.
#[test]
fn materials_in_a_white_room_reflect_its_light() {
    let white = Sky { strength: 0.5, ..Sky::new(panorama(16, |_| DVec3::ONE)) };
    for roughness in [0.0, 0.3, 0.6, 1.0] {
        let metal = Material { metallic: 1.0, roughness, ..matte(Vec4::ONE) };
        let got = decode(middle_pixel(&wall(metal, white.clone()))[0]);
        // The fitted BRDF loses energy, and more at higher roughness.
        assert!((0.48 - 0.275 * f64::from(roughness)..=0.505).contains(&got), "roughness {roughness}: {got}");
    }
}

#[test]
fn the_sky_background_turns_with_the_sky() {
    let stripe = panorama(256, |way| if way.x > 0.0 { DVec3::X * 0.5 } else { DVec3::Z * 0.5 });
    let draw_turned = |turn: f64| {
        let scene = Scene::perspective(0.9, 6.0);
        let sky = Sky { turn, background: true, ..Sky::new(stripe.clone()) };
        draw_at(&with_sky(scene, sky), [64, 36], 1)
    };
    // The camera looks along −Z, with +X to the right. The sky turns counter-clockwise seen from above, so its right part moves to the front.
    let straight = draw_turned(0.0);
    assert_color(pixel(&straight, 60, 18), [0.5, 0.0, 0.0], "right");
    assert_color(pixel(&straight, 4, 18), [0.0, 0.0, 0.5], "left");
    assert_color(pixel(&draw_turned(PI / 2.0), 4, 18), [0.5, 0.0, 0.0], "turned");
    assert_color(pixel(&draw_turned(-PI / 2.0), 60, 18), [0.0, 0.0, 0.5], "turned the other way");
}

/// Spheres of several shading models, each lit by the sky.
fn scene_of_lit_spheres(sky: Sky) -> Scene {
    let mut scene = Scene::perspective(0.9, 6.0);
    for (i, shading) in
        [Shading::MetallicRoughness, Shading::BlinnPhong, Shading::MetallicRoughness].into_iter().enumerate()
    {
        let material = Material {
            shading,
            metallic: i as f32 * 0.5,
            roughness: 0.1 + 0.3 * i as f32,
            layers: (i == 0).then(|| Box::new(MaterialLayers { clearcoat: 1.0, ..Default::default() })),
            double_sided: true,
            ..matte(Vec4::new(0.9, 0.8, 0.7, 1.0))
        };
        let bulge = common::layered::bulge(1.0);
        scene.at(&asset(vec![bulge], vec![material], vec![]), 2.2 * i as f64 - 2.2, 0.0, 0.0);
    }
    with_sky(scene, sky)
}

#[test]
fn only_scenes_with_a_sky_request_sky_features() {
    let options = PlanOptions::new([32, 18], 1);
    let mut scene = scene_of_lit_spheres(Sky::new(smooth_panorama()));
    let (resources, plan) = scene.plan(&options);
    assert!(plan.draws.iter().all(|d| d.pipeline.features.has(Features::SKY)));
    assert!(plan.sky.is_some() && resources.sky.is_some());
    scene.snapshot.sky.as_mut().unwrap().strength = 0.0;
    let (_, dark) = scene.plan(&options);
    assert!(dark.draws.iter().all(|d| !d.pipeline.features.has(Features::SKY)));
    assert!(dark.sky.is_none());
    let why = |plan: &choreo_render::Plan| {
        plan.left_out.iter().find(|l| l.part == "image-based light").map(|l| l.why.clone())
    };
    assert_eq!(why(&plan), None);
    assert_eq!(why(&dark).as_deref(), Some("its strength is zero"));
    scene.snapshot.sky = None;
    assert_eq!(why(&scene.plan(&options).1).as_deref(), Some("the stage has no sky"));
}

#[test]
fn both_renderers_draw_the_same_sky_light() {
    let Some(mut renderer) = vulkan(GpuOptions::default()) else { return };
    let size = [160, 90];
    let mut on_vulkan =
        |scene: &Scene, samples| draw_with(&mut renderer, scene, &PlanOptions::new(size, samples));
    let scene = |turn: f64, background| {
        scene_of_lit_spheres(Sky { turn, background, ..Sky::new(Panorama::studio()) })
    };
    for (turn, background, samples) in [(0.0, false, 1), (1.2, true, 1), (-2.0, true, 4), (0.3, false, 4)] {
        let scene = scene(turn, background);
        let c = compare(&on_vulkan(&scene, samples), &draw_at(&scene, size, samples), 2).unwrap();
        println!("turn {turn}, background {background}, {samples} samples: {c:?}");
        assert!(c.mean < 0.16 && c.share_beyond < 0.003, "turn {turn}: {c:?}");
    }
    // The planted fault: on one renderer the sky is turned the other way.
    let c = compare(&on_vulkan(&scene(0.5, true), 1), &draw_at(&scene(-0.5, true), size, 1), 2).unwrap();
    assert!(c.share_beyond > 0.1, "{c:?}");
}
