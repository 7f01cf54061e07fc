//! Clearcoat, sheen, transmission and volume of the CPU renderer against the extensions' formulas in f64.

use crate::common::layered::{bulge, layered, layered_scene};
use crate::common::*;
use crate::wall::{middle_pixel, wall};
use choreo_asset::*;
use choreo_render::plan::{Features, Glass};
use choreo_render::{CpuRenderer, PlanOptions, Renderer};
use choreo_stage::*;
use glam::{DVec3, Vec3, Vec4};
use std::f64::consts::PI;

/// glTF 2.0 Appendix B, GGX distribution times visibility at N = V, times π.
fn ggx(roughness: f64, l: DVec3) -> f64 {
    let h = (l + DVec3::Z).normalize();
    let a2 = roughness.powi(4);
    let d = a2 / (h.z * h.z * (a2 - 1.0) + 1.0).powi(2);
    d * 0.5 / (l.z + (a2 + (1.0 - a2) * l.z * l.z).sqrt())
}

/// Gray dielectric at N = V, one channel, times π.
fn dielectric(base: f64, roughness: f64, l: DVec3) -> f64 {
    let h = (l + DVec3::Z).normalize();
    let f = 0.04 + 0.96 * (1.0 - h.z).powi(5);
    base * (1.0 - f) + f * ggx(roughness, l)
}

fn light_direction(degrees: f64) -> DVec3 {
    let (s, c) = degrees.to_radians().sin_cos();
    DVec3::new(s, 0.0, c)
}

#[test]
fn clearcoat_matches_its_formula() {
    for (coat, roughness) in [(1.0, 0.3), (0.5, 0.6), (0.0, 0.3)] {
        for degrees in [0.0, 15.0, 50.0] {
            let layers = MaterialLayers {
                clearcoat: coat as f32,
                clearcoat_roughness: roughness as f32,
                ..MaterialLayers::default()
            };
            let mut scene =
                wall(layered(layers, Material { roughness: 0.8, ..matte(Vec4::new(0.4, 0.4, 0.4, 1.0)) }));
            let l = light_direction(degrees);
            scene.sun(-l.as_vec3(), Vec3::ONE, 0.6);
            // KHR_materials_clearcoat: mix(base, coat, clearcoat · Schlick(0.04, N·V)), at N = V 4 %.
            let share = coat * 0.04;
            let base = dielectric(0.4, 0.8, l);
            let expected = 0.6 * l.z * (base * (1.0 - share) + ggx(roughness, l) * share);
            assert_color(
                middle_pixel(&scene),
                [expected; 3],
                &format!("coat {coat} {roughness} at {degrees}°"),
            );
        }
    }
}

/// Charlie sheen distribution with Neubelt's visibility, times π.
fn sheen(roughness: f64, n: DVec3, v: DVec3, l: DVec3) -> f64 {
    let h = (l + v).normalize();
    let inverse = 1.0 / (roughness * roughness);
    let sine2 = (1.0 - n.dot(h).powi(2)).max(0.0);
    let (nl, nv) = (n.dot(l), n.dot(v));
    (2.0 + inverse) * sine2.powf(inverse * 0.5) / 2.0 / (4.0 * (nl + nv - nl * nv))
}

/// Integral of the sheen over the hemisphere by the midpoint rule, clamped to 1.
fn sheen_albedo(roughness: f64, nv: f64) -> f64 {
    let v = DVec3::new((1.0 - nv * nv).sqrt(), 0.0, nv);
    let (rings, sectors) = (200, 120);
    let mut sum = 0.0;
    for i in 0..rings {
        let c = (f64::from(i) + 0.5) / f64::from(rings);
        let s = (1.0 - c * c).sqrt();
        for j in 0..sectors {
            let phi = (f64::from(j) + 0.5) / f64::from(sectors) * 2.0 * PI;
            sum += sheen(roughness, DVec3::Z, v, DVec3::new(s * phi.cos(), s * phi.sin(), c)) / PI * c;
        }
    }
    (sum * 2.0 * PI / f64::from(rings * sectors)).min(1.0)
}

#[test]
fn sheen_matches_its_formula() {
    for roughness in [0.3, 0.5, 0.9] {
        // The fit against the integral, at N = V.
        let albedo = sheen_albedo(roughness, 1.0);
        for degrees in [10.0, 40.0, 75.0] {
            let layers = MaterialLayers {
                sheen_color: Vec3::ONE,
                sheen_roughness: roughness as f32,
                ..MaterialLayers::default()
            };
            let mut scene =
                wall(layered(layers, Material { roughness: 1.0, ..matte(Vec4::new(0.2, 0.2, 0.2, 1.0)) }));
            let l = light_direction(degrees);
            scene.sun(-l.as_vec3(), Vec3::ONE, 0.9);
            let base = dielectric(0.2, 1.0, l);
            let expected = 0.9 * l.z * (base * (1.0 - albedo) + sheen(roughness, DVec3::Z, DVec3::Z, l));
            let got = decode(middle_pixel(&scene)[0]);
            // The fitted albedo may be off by 0.07, which scales this dark surface.
            let bound = 0.9 * l.z * base * 0.07 + 0.004;
            assert!((got - expected).abs() < bound, "{roughness} {degrees}°: {got} {expected} ± {bound}");
        }
    }
}

#[test]
fn the_fitted_sheen_albedo_is_near_its_integral() {
    // Under a white sky without lights, a black cloth with white sheen shows the sheen's albedo.
    let mut worst = 0.0f64;
    for roughness in [0.1, 0.2, 0.3, 0.5, 0.7, 1.0] {
        for degrees in [0.0f64, 30.0, 50.0, 70.0, 80.0, 86.0] {
            let layers = MaterialLayers {
                sheen_color: Vec3::ONE,
                sheen_roughness: roughness as f32,
                ..MaterialLayers::default()
            };
            let black = Material { specular: 0.0, ..matte(Vec4::new(0.0, 0.0, 0.0, 1.0)) };
            let mut scene = Scene::ortho(0.02);
            let a = asset(vec![quad(2.0, 2.0)], vec![layered(layers, black)], vec![]);
            scene.add(&a, glam::DAffine3::from_rotation_y(degrees.to_radians()));
            scene.snapshot.ambient_up = Vec3::ONE;
            scene.snapshot.ambient_down = Vec3::ONE;
            let got = decode(middle_pixel(&scene)[0]);
            let expected = sheen_albedo(roughness, degrees.to_radians().cos());
            worst = worst.max((got - expected).abs());
        }
    }
    println!("sheen albedo: worst {worst:.3}");
    assert!(worst < 0.08, "{worst}");
    assert!(worst > 0.0, "8 bits and a fit are never exact");
}

/// Karis' fit of the environment BRDF at N = V for F0 0.04: what a dielectric reflects of the sky.
fn environment_reflectance(roughness: f64) -> f64 {
    let r = [-1.0, -0.0275, -0.572, 0.022].map(|k| k * roughness);
    let r = [r[0] + 1.0, r[1] + 0.0425, r[2] + 1.04, r[3] - 0.04];
    let a = (r[0] * r[0]).min((-9.28f64).exp2()) * r[0] + r[1];
    0.04 * (-1.04 * a + r[2]) + 1.04 * a + r[3]
}

#[test]
fn thin_glass_multiplies_its_background_and_adds_reflections() {
    for (transmission, roughness, thickness) in
        [(1.0, 0.0, 0.0), (1.0, 0.5, 0.0), (0.6, 0.0, 0.5), (1.0, 0.0, 2.0)]
    {
        let layers = MaterialLayers {
            transmission: transmission as f32,
            thickness: thickness as f32,
            ior: 1.0,
            attenuation_distance: 1.0,
            attenuation_color: Vec3::new(0.25, 0.5, 0.81),
            ..MaterialLayers::default()
        };
        let base = [0.9, 0.8, 0.7];
        let material = Material { roughness: roughness as f32, ..matte(Vec4::new(0.9, 0.8, 0.7, 1.0)) };
        let mut scene = wall(layered(layers, material));
        scene.snapshot.background = Background::Color(Vec4::new(0.5, 0.6, 0.7, 1.0));
        // The scale of the actor also scales the thickness.
        scene.snapshot.actors[0].world_from_model = glam::DAffine3::from_scale(DVec3::splat(2.0));
        let behind = [0.5, 0.6, 0.7];
        let taken = [0.25f64, 0.5, 0.81].map(|c| c.powf(2.0 * thickness));
        let clear = transmission
            * (1.0 - environment_reflectance(f64::max(roughness, 0.045)))
            * (1.0 - roughness * roughness);
        let expected: [f64; 3] = std::array::from_fn(|c| behind[c] * base[c] * taken[c] * clear);
        assert_color(
            middle_pixel(&scene),
            expected,
            &format!("{transmission} {roughness} {thickness} m in the dark"),
        );
        // In the light, the part that is not transmitted is scattered back.
        scene.sun(Vec3::NEG_Z, Vec3::ONE, 0.3);
        let l = DVec3::Z;
        let diffuse = 0.96 * (1.0 - transmission);
        let lit: [f64; 3] = std::array::from_fn(|c| {
            let highlight = 0.04 * ggx(f64::max(roughness, 0.045), l);
            // The results of both draws are rounded to 8 bits.
            expected[c] + 0.3 * (base[c] * diffuse + highlight)
        });
        let got = middle_pixel(&scene);
        for c in 0..3 {
            let e = encode(lit[c]);
            assert!((f64::from(got[c]) - e).abs() <= 2.0, "{transmission} {roughness}: {got:?} {e}");
        }
    }
}

#[test]
fn thin_glass_is_drawn_last_in_two_draws() {
    let scene = layered_scene();
    let (_, plan) = scene.plan(&PlanOptions::new([200, 150], 1));
    let glass: Vec<Glass> = plan.draws.iter().map(|d| d.pipeline.glass).collect();
    let first = glass.iter().position(|g| *g != Glass::No).unwrap();
    assert!(glass[..first].iter().all(|g| *g == Glass::No));
    let thin: Vec<Glass> = glass[first..].iter().copied().filter(|g| *g != Glass::Refract).collect();
    assert_eq!(thin, [Glass::Filter, Glass::Light].repeat(2), "each pair in its order");
    assert_eq!(glass[first..].len(), 4 + 2, "what bends light is drawn once");
    let features = plan.draws.iter().fold(Features::default(), |all, d| all.with(d.pipeline.features));
    let bent = Features::REFRACTION.with(Features::DISPERSION);
    for f in [Features::CLEARCOAT, Features::SHEEN, Features::TRANSMISSION, Features::VOLUME, bent] {
        assert!(features.has(f));
    }
}

#[test]
fn materials_without_layers_request_no_layer_features() {
    let what = |material: Material| {
        let mut scene = wall(material);
        scene.sun(Vec3::NEG_Z, Vec3::ONE, 0.5);
        let (resources, plan) = scene.plan(&PlanOptions::new([8, 8], 1));
        let left_out: Vec<String> = plan.left_out.iter().map(|l| l.part.clone()).collect();
        (resources.textures.len(), plan.draws[0].pipeline, left_out)
    };
    let plain = what(matte(Vec4::ONE));
    assert!(
        ["clear coats", "sheen", "transmission", "absorption"]
            .iter()
            .all(|w| plain.2.contains(&w.to_string()))
    );
    // Layers without a visible effect request nothing.
    assert_eq!(
        what(layered(
            MaterialLayers { thickness: 1.0, sheen_roughness: 0.5, ..MaterialLayers::default() },
            matte(Vec4::ONE)
        )),
        plain
    );
    assert_ne!(
        what(layered(MaterialLayers { clearcoat: 0.1, ..MaterialLayers::default() }, matte(Vec4::ONE))).1,
        plain.1
    );
    // A material with another shading model ignores its layers, too.
    let unlit_glass =
        layered(MaterialLayers { transmission: 1.0, ..MaterialLayers::default() }, unlit(Vec4::ONE));
    assert_eq!(what(unlit_glass).1, what(unlit(Vec4::ONE)).1);
}

#[test]
fn forcing_all_features_in_changes_no_layered_pixel() {
    let scene = layered_scene();
    let options = PlanOptions::new([160, 120], 1);
    let lean = draw(&scene, &options);
    let forced = draw(&scene, &PlanOptions { force_all: true, ..options });
    let worst = lean.rgba.iter().zip(&forced.rgba).map(|(a, b)| a.abs_diff(*b)).max();
    assert!(worst <= Some(1), "{worst:?}");
}

#[test]
fn extreme_material_values_give_finite_colors() {
    for extreme in [0.0, 1e-30, 1e30, f32::MAX, f32::INFINITY] {
        let layers = MaterialLayers {
            clearcoat: 1.0,
            sheen_color: Vec3::ONE,
            transmission: 1.0,
            thickness: extreme,
            ior: if extreme == 0.0 { 1.5 } else { extreme },
            dispersion: extreme,
            attenuation_distance: extreme,
            attenuation_color: Vec3::ZERO,
            ..MaterialLayers::default()
        };
        assert!(layers.extinction().is_finite());
        let mut scene = Scene::perspective(0.9, 2.0);
        scene.at(&asset(vec![bulge(1.0)], vec![layered(layers, matte(Vec4::ONE))], vec![]), 0.0, 0.0, 0.0);
        scene.sun(Vec3::NEG_Z, Vec3::ONE, 1.0);
        let (resources, plan) = scene.plan(&PlanOptions::new([32, 32], 4));
        let mut renderer = CpuRenderer::new(&[]);
        renderer.load(resources).unwrap();
        renderer.submit(plan).unwrap();
        renderer.collect(None).unwrap();
    }
}
