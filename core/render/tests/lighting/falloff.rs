//! Polynomial light falloff, and the highlights of Blinn–Phong and Phong, against closed forms in f64.

use crate::common::*;
use choreo_asset::*;
use choreo_render::PlanOptions;
use choreo_render::plan::Features;
use choreo_stage::*;
use glam::{DVec3, Vec3, Vec4};

/// A wall that faces an orthographic camera (N = V = +Z).
fn wall(material: Material) -> Scene {
    let mut scene = Scene::ortho(2.0);
    scene.at(&asset(vec![quad(2.0, 2.0)], vec![material], vec![]), 0.0, 0.0, 0.0);
    scene
}

fn shiny_material(shading: Shading, shininess: f32) -> Material {
    Material { shading, shininess, specular_color: Vec3::splat(0.2), ..matte(Vec4::new(0.3, 0.3, 0.3, 1.0)) }
}

fn add_lamp(scene: &mut Scene, place: DVec3, attenuation: Option<[f32; 3]>) {
    scene.snapshot.lights.push(LightState {
        light: Light { kind: LightKind::Point, color: Vec3::ONE, intensity: 2.0, range: None },
        position: place,
        direction: Vec3::NEG_Y,
        shadow: None,
        attenuation,
    });
}

fn middle_pixel(scene: &Scene) -> [u8; 4] {
    pixel(&draw_at(scene, [5, 5], 1), 2, 2)
}

#[test]
fn light_falloff_matches_its_polynomial() {
    let dull = Material { specular_color: Vec3::ZERO, ..shiny_material(Shading::BlinnPhong, 8.0) };
    for distance in [0.5, 1.0, 2.0, 5.0] {
        for [c, l, q] in [[1.0, 0.0, 0.0], [1.0, 0.35, 0.44], [0.0, 1.0, 0.0], [3.0, 0.0, 2.0]] {
            let mut scene = wall(dull.clone());
            add_lamp(&mut scene, DVec3::new(0.0, 0.0, distance), Some([c as f32, l as f32, q as f32]));
            let expected = 0.3 * 2.0 / (c + l * distance + q * distance * distance);
            assert_color(middle_pixel(&scene), [expected; 3], &format!("{c} {l} {q} at {distance} m"));
        }
        // Without a polynomial the falloff is the inverse square.
        let mut scene = wall(dull.clone());
        add_lamp(&mut scene, DVec3::new(0.0, 0.0, distance), None);
        assert_color(
            middle_pixel(&scene),
            [0.3 * 2.0 / (distance * distance); 3],
            &format!("physical at {distance} m"),
        );
    }
}

#[test]
fn blinn_and_phong_highlights_match_their_formulas() {
    for degrees in [0.0f64, 10.0, 30.0, 50.0] {
        let (s, c) = degrees.to_radians().sin_cos();
        for n in [2.0f64, 12.0, 60.0] {
            for (shading, lobe) in [
                (Shading::BlinnPhong, (n + 8.0) / 8.0 * (degrees.to_radians() * 0.5).cos().powf(n)),
                (Shading::Phong, (n + 2.0) / 2.0 * c.powf(n)),
            ] {
                let mut scene = wall(shiny_material(shading, n as f32));
                scene.sun(-Vec3::new(s as f32, 0.0, c as f32), Vec3::ONE, 0.25);
                let expected = 0.25 * c * (0.3 + 0.2 * lobe);
                assert_color(middle_pixel(&scene), [expected; 3], &format!("{shading:?} {n} at {degrees}°"));
            }
        }
    }
}

#[test]
fn only_scenes_with_polynomial_falloff_or_phong_request_these_features() {
    let features = |scene: &Scene| scene.plan(&PlanOptions::new([5, 5], 1)).1.draws[0].pipeline.features;
    let mut scene = wall(shiny_material(Shading::BlinnPhong, 8.0));
    add_lamp(&mut scene, DVec3::Z, None);
    assert!(!features(&scene).has(Features::POLYNOMIAL_FALLOFF) && !features(&scene).has(Features::PHONG));
    add_lamp(&mut scene, DVec3::Z, Some([1.0, 0.0, 0.0]));
    assert!(features(&scene).has(Features::POLYNOMIAL_FALLOFF));
    let scene = wall(shiny_material(Shading::Phong, 8.0));
    assert!(features(&scene).has(Features::PHONG) && features(&scene).has(Features::BLINN_PHONG));
}
