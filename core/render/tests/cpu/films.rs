//! Thin films, anisotropy and diffuse transmission of the CPU renderer against spectra, other forms of the formulas, and energy conservation.

use crate::common::layered::layered;
use crate::common::*;
use choreo_asset::*;
use glam::{DVec3, Vec3, Vec4};
use std::f64::consts::PI;

/// A quad that fills the image, facing an orthographic camera: N = V = +Z, tangent +X.
fn wall(material: Material) -> Scene {
    let mut wall = quad(2.0, 2.0);
    wall.tangents = vec![Vec4::new(1.0, 0.0, 0.0, 1.0); wall.positions.len()];
    let mut scene = Scene::ortho(2.0);
    scene.at(&asset(vec![wall], vec![material], vec![]), 0.0, 0.0, 0.0);
    scene
}

fn middle_color(scene: &Scene) -> [f64; 3] {
    let p = pixel(&draw_at(scene, [5, 5], 1), 2, 2);
    [p[0], p[1], p[2]].map(decode)
}

/// GGX distribution times visibility at N = V = L, times π: α⁴ … = 1 / (4 α²).
fn ggx_at_normal_incidence(roughness: f64) -> f64 {
    0.25 / roughness.powi(4)
}

/// Response of the eye's receptors (Wyman, Sloan & Shirley, "Simple Analytic Approximations to the CIE XYZ Color Matching Functions", 2013).
fn eye_response(nm: f64) -> [f64; 3] {
    let lobe = |height: f64, at: f64, below: f64, above: f64| {
        let t = (nm - at) * if nm < at { below } else { above };
        height * (-0.5 * t * t).exp()
    };
    [
        lobe(0.362, 442.0, 0.0624, 0.0374)
            + lobe(1.056, 599.8, 0.0264, 0.0323)
            + lobe(-0.065, 501.1, 0.0490, 0.0382),
        lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
        lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725),
    ]
}

/// Airy's reflectance of a film between air and a base at normal incidence, all orders, by phase.
fn airy(film: f64, base: f64, phase: f64) -> f64 {
    let (r12, r23) = ((1.0 - film) / (1.0 + film), (film - base) / (film + base));
    let c = phase.cos();
    let cross = 2.0 * r12 * r23 * c;
    (r12 * r12 + r23 * r23 + cross) / (1.0 + r12 * r12 * r23 * r23 + cross)
}

/// Perceived reflectance of the film in linear sRGB: the mean over all phases, plus the deviation weighted by the receptors.
fn perceived_reflectance(film: f64, base: f64, nanometres: f64) -> [f64; 3] {
    let mean = (0..720).map(|i| airy(film, base, f64::from(i) * PI / 360.0)).sum::<f64>() / 720.0;
    let (mut xyz, mut whole) = ([0.0; 3], 0.0);
    for nm in (360..=830).map(f64::from) {
        let rest = airy(film, base, 4.0 * PI * film * nanometres / nm) - mean;
        let weights = eye_response(nm);
        for (sum, w) in xyz.iter_mut().zip(weights) {
            *sum += rest * w;
        }
        whole += weights[1];
    }
    let [x, y, z] = xyz.map(|v| v / whole);
    [
        mean + 3.2404542 * x - 1.5371385 * y - 0.4985314 * z,
        mean - 0.9692660 * x + 1.8760108 * y + 0.0415560 * z,
        mean + 0.0556434 * x - 0.2040259 * y + 1.0572252 * z,
    ]
}

/// Color of a film on a black surface, lit so that it shows the reflectance times `gain`.
fn rendered_film_color(base_f0: f32, ior: f32, nanometres: f32, gain: f64) -> [f64; 3] {
    let layers = MaterialLayers {
        iridescence: 1.0,
        iridescence_ior: ior,
        iridescence_thickness: [0.0, nanometres],
        ..MaterialLayers::default()
    };
    let black = Material {
        roughness: 0.7,
        specular_color: Vec3::splat(base_f0 / 0.04),
        ..matte(Vec4::new(0.0, 0.0, 0.0, 1.0))
    };
    let mut scene = wall(layered(layers, black));
    scene.sun(Vec3::NEG_Z, Vec3::ONE, (gain / ggx_at_normal_incidence(0.7)) as f32);
    middle_color(&scene).map(|c| c / gain)
}

#[test]
fn thin_film_colors_match_the_spectral_integral() {
    let mut worst = 0.0f64;
    for (ior, f0) in [(1.33f64, 0.2f64), (1.6, 0.04), (1.8, 0.3), (1.3, 0.5)] {
        let root = f0.sqrt();
        let base = (1.0 + root) / (1.0 - root);
        for nanometres in [120.0, 200.0, 300.0, 400.0, 550.0, 800.0] {
            let gain = 1.2;
            let got = rendered_film_color(f0 as f32, ior as f32, nanometres as f32, gain);
            for (got, expected) in got.iter().zip(perceived_reflectance(ior, base, nanometres)) {
                // Reflectances outside of the display range are clamped in both.
                let expected = expected.clamp(0.0, 1.0 / gain);
                worst = worst.max((got - expected).abs());
                assert!((got - expected).abs() < 0.06, "{ior} {f0} {nanometres} nm: {got} {expected}");
            }
        }
    }
    println!("films: worst reflectance error {worst:.4}");
    // The colors are not gray, so the comparison is meaningful.
    let [r, _, b] = rendered_film_color(0.2, 1.33, 200.0, 1.2);
    let [r2, _, b2] = rendered_film_color(0.2, 1.33, 300.0, 1.2);
    assert!((r - b) * (r2 - b2) < 0.0, "{r} {b} {r2} {b2}");
}

#[test]
fn a_film_of_zero_thickness_changes_nothing() {
    for f0 in [0.04, 0.3] {
        let got = rendered_film_color(f0, 1.8, 0.0, 1.5);
        got.iter().for_each(|g| assert!((g - f64::from(f0)).abs() < 0.006, "{f0}: {g}"));
    }
}

/// Distribution and masking in the form of PBRT (4th ed., eq. 9.16, 9.22): slopes and Λ, not the extension's vectors. Times π.
fn anisotropic_ggx(alpha: [f64; 2], l: DVec3) -> f64 {
    let h = (l + DVec3::Z).normalize();
    let (cos2, sin2) = (h.z * h.z, 1.0 - h.z * h.z);
    let (c, s) = if sin2 > 0.0 { (h.x * h.x / sin2, h.y * h.y / sin2) } else { (1.0, 0.0) };
    let e = sin2 / cos2 * (c / alpha[0].powi(2) + s / alpha[1].powi(2));
    let d = 1.0 / (alpha[0] * alpha[1] * cos2 * cos2 * (1.0 + e).powi(2));
    let lambda = |w: DVec3| {
        let slope2 = ((alpha[0] * w.x).powi(2) + (alpha[1] * w.y).powi(2)) / (w.z * w.z);
        ((1.0 + slope2).sqrt() - 1.0) / 2.0
    };
    d / (1.0 + lambda(l) + lambda(DVec3::Z)) / (4.0 * l.z)
}

fn brushed_wall(strength: f32, rotation: f32, roughness: f32) -> Scene {
    let layers =
        MaterialLayers { anisotropy: strength, anisotropy_rotation: rotation, ..MaterialLayers::default() };
    wall(layered(layers, Material { metallic: 1.0, roughness, ..matte(Vec4::ONE) }))
}

#[test]
fn anisotropy_stretches_highlights() {
    for (strength, rotation, roughness) in
        [(0.0, 0.0, 0.5), (0.6, 0.0, 0.4), (0.9, 0.7, 0.4), (1.0, 1.2, 0.3)]
    {
        for degrees in [0.0f64, 20.0, 45.0] {
            for around in [0.0f64, 40.0, 90.0] {
                let (s, c) = degrees.to_radians().sin_cos();
                let (sa, ca) = around.to_radians().sin_cos();
                let l = DVec3::new(s * ca, s * sa, c);
                let across = f64::from(roughness).powi(2);
                let along = across + (1.0 - across) * f64::from(strength).powi(2);
                // Axes of the highlight.
                let (sr, cr) = f64::from(rotation).sin_cos();
                let own = DVec3::new(l.x * cr + l.y * sr, l.y * cr - l.x * sr, l.z);
                let expected = anisotropic_ggx([along, across], own) * l.z;
                let gain = 0.7 / expected.max(0.05);
                let mut scene = brushed_wall(strength, rotation, roughness);
                scene.sun(-l.as_vec3(), Vec3::ONE, gain as f32);
                let got = middle_color(&scene)[0];
                let what = format!("{strength} {rotation} {roughness} at {degrees}°, {around}°");
                assert!((got - expected * gain).abs() < 0.006, "{what}: {got} {}", expected * gain);
            }
        }
    }
}

/// Share of a uniform sky that a white surface reflects in one bounce, by the formulas of PBRT.
fn reflected_energy(alpha: [f64; 2]) -> f64 {
    let (rings, sectors) = (400, 400);
    let mut sum = 0.0;
    for i in 0..rings {
        let z = (f64::from(i) + 0.5) / f64::from(rings);
        for j in 0..sectors {
            let (s, c) = ((f64::from(j) + 0.5) / f64::from(sectors) * 2.0 * PI).sin_cos();
            let r = (1.0 - z * z).sqrt();
            sum += anisotropic_ggx(alpha, DVec3::new(r * c, r * s, z)) * z;
        }
    }
    2.0 * sum / f64::from(rings * sectors)
}

/// The rendered ∫ f cos dω, with 250 suns distributed evenly over the sky.
#[test]
fn anisotropic_metal_reflects_no_more_light_than_it_gets() {
    for (strength, roughness) in [(0.0f64, 0.7f64), (0.5, 0.6), (0.9, 0.7)] {
        let mut scene = brushed_wall(strength as f32, 0.3, roughness as f32);
        let count = 250;
        for i in 0..count {
            let z = (f64::from(i) + 0.5) / f64::from(count);
            let (s, c) = (f64::from(i) * 2.399_963_229_728_653).sin_cos();
            let r = (1.0 - z * z).sqrt();
            let l = DVec3::new(r * c, r * s, z);
            // Each stands for 2π / count of solid angle; π is in the convention of the light.
            scene.sun(-l.as_vec3(), Vec3::ONE, 2.0 / count as f32);
        }
        let got = middle_color(&scene)[0];
        let across = roughness.powi(2);
        let expected = reflected_energy([across + (1.0 - across) * strength * strength, across]);
        assert!(expected <= 1.0 && (got - expected).abs() < 0.01, "{strength} {roughness}: {got} {expected}");
    }
}

#[test]
fn diffuse_transmission_shows_light_from_behind() {
    for share in [0.0, 0.4, 1.0] {
        for degrees in [0.0f64, 35.0, 70.0] {
            let layers = MaterialLayers {
                diffuse_transmission: share,
                diffuse_transmission_color: Vec3::new(0.25, 1.0, 0.5),
                ..MaterialLayers::default()
            };
            let mut scene = wall(layered(layers, Material { roughness: 1.0, ..matte(Vec4::ONE) }));
            let (s, c) = degrees.to_radians().sin_cos();
            scene.sun(Vec3::new(s as f32, 0.0, c as f32), Vec3::ONE, 0.9);
            for (got, color) in middle_color(&scene).into_iter().zip([0.25, 1.0, 0.5]) {
                // At N = V, 4 % are reflected.
                let expected = 0.9 * c * color * f64::from(share) * 0.96;
                assert!((got - expected).abs() < 0.005, "{share} {degrees}° {color}: {got} {expected}");
            }
        }
    }
}
