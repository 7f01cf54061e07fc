//! Choices about skies: the reflection maps, and the form in which diffuse light is stored.

use super::{MeasuredScene, SceneChoices};
use crate::plots::{Choice, Row};
use crate::reference::ErrorStats;
use crate::timing::{Case, Clock, interleaved};
use choreo_asset::Panorama;
use choreo_render::sky::harmonics::harmonics;
use choreo_render::sky::octahedral::OctahedralMap;
use choreo_render::sky::prefilter::{base, radiance};
use choreo_render::sky::{SkyMaps, SkyOptions};
use glam::{DVec3, Vec3};
use std::f64::consts::{PI, TAU};
use std::hint::black_box;

pub fn choices(scene: &MeasuredScene) -> SceneChoices {
    let Some(sky) = &scene.stage.sky else {
        return SceneChoices::None("the scene has no sky".into());
    };
    let (sky, budget) = (&*sky.panorama, scene.budget_secs);
    SceneChoices::Choices(vec![mirrored(sky, budget), diffuse(sky, budget)])
}

/// Evenly distributed directions: a spiral of equal areas.
fn directions(count: u32) -> Vec<DVec3> {
    let direction = |i: u32| {
        let y = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count);
        let (flat, turn) = ((1.0 - y * y).sqrt(), f64::from(i) * PI * (3.0 - 5f64.sqrt()));
        DVec3::new(libm::cos(turn) * flat, y, libm::sin(turn) * flat)
    };
    (0..count).map(direction).collect()
}

/// Reference reflections: (direction, roughness, mean light of the GGX lobe around the direction, weighted with the cosine), for N = V, in
/// f64, by 2^14 points of each lobe.
fn reference_reflections(sky: &Panorama) -> Vec<(DVec3, f64, DVec3)> {
    let normals = directions(40);
    let mut all = Vec::new();
    for roughness in [0.05, 0.15, 0.3, 0.5, 0.7, 0.9, 1.0] {
        for &n in &normals {
            let across = n.any_orthonormal_vector();
            let along = n.cross(across);
            let a2 = f64::powi(roughness, 4);
            let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
            let count = 1u32 << 14;
            for i in 0..count {
                let u = (f64::from(i) + 0.5) / f64::from(count);
                let turn = TAU * f64::from(i.reverse_bits()) / 4_294_967_296.0;
                let cos2 = (1.0 - u) / (1.0 + (a2 - 1.0) * u);
                let (nh, sin) = (cos2.sqrt(), (1.0 - cos2).max(0.0).sqrt());
                let h = across * (sin * libm::cos(turn)) + along * (sin * libm::sin(turn)) + n * nh;
                let l = h * (2.0 * nh) - n;
                let nl = l.dot(n);
                if nl > 0.0 {
                    sum += radiance(sky, l.as_vec3()).as_dvec3() * nl;
                    weight += nl;
                }
            }
            all.push((n, roughness, sum / weight));
        }
    }
    all
}

/// Compares sizes and sample counts of the reflection maps of a sky.
pub fn mirrored(sky: &Panorama, budget_secs: f64) -> Choice {
    let mut choice =
        Choice::new("sky_maps", "How large are the reflection maps of a sky, with how many samples a texel?");
    choice.error_unit = "of the sky's mean radiance";
    choice.by_mean = true;
    choice.reference =
        "the light of the specular lobe in f64 from 16 384 samples each, at 7 roughnesses and 40 directions"
            .into();
    choice.per = "sky".into();
    let truth = reference_reflections(sky);
    let mean =
        truth.iter().map(|(.., light)| light.dot(DVec3::splat(1.0 / 3.0))).sum::<f64>() / truth.len() as f64;
    let methods = [
        (64, 4, 16),
        (64, 6, 32),
        (128, 6, 16),
        (128, 6, 64),
        (256, 6, 16),
        (256, 6, 64),
        (256, 8, 64),
        (256, 8, 256),
        (512, 8, 64),
    ];
    let mut cases: Vec<Case> = Vec::new();
    for (size, levels, samples) in methods {
        let options = SkyOptions { size, levels, samples, ..SkyOptions::default() };
        let maps = SkyMaps::new(sky, &options);
        let mut error = ErrorStats::default();
        for (direction, roughness, light) in &truth {
            let got = maps.specular(direction.as_vec3(), *roughness as f32).as_dvec3();
            error.add((got - *light).abs().dot(DVec3::splat(1.0 / 3.0)) / mean);
        }
        let bytes = (maps.texels.len() * 8) as f64;
        let row = Row::new(maps_name(&options)).error(error.worst, error.mean()).bytes(bytes);
        choice.rows.push(row);
        cases.push(Case::new(1, move || drop(black_box(SkyMaps::new(sky, &options)))));
    }
    let nanos = interleaved(Clock::Process, 4.0 * budget_secs, &mut cases);
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    let why =
        "made once for each sky, in less than 0.2 s; sharper reflections or more samples are seldom noticed";
    choice.choose(&maps_name(&SkyOptions::default()), why);
    choice
}

fn maps_name(o: &SkyOptions) -> String {
    format!("{} texels a side, {} roughnesses, {} samples", o.size, o.levels, o.samples)
}

/// Compares forms in which the diffuse light of a sky is stored.
pub fn diffuse(sky: &Panorama, budget_secs: f64) -> Choice {
    let mut choice = Choice::new("sky_diffuse", "How is the diffuse light of a sky stored?");
    choice.error_unit = "of the sky's mean radiance";
    choice.by_mean = true;
    choice.reference = "the cosine's integral in f64 over 32 768 directions, for 200 normals".into();
    choice.per = "lookup".into();
    let map = base(sky, 256);
    let h = harmonics(&map);
    let lights: Vec<(DVec3, DVec3)> = directions(32_768)
        .into_iter()
        .map(|direction| (direction, radiance(sky, direction.as_vec3()).as_dvec3()))
        .collect();
    let irradiance = |n: DVec3| -> DVec3 {
        let sum = lights
            .iter()
            .fold(DVec3::ZERO, |sum, (direction, light)| sum + *light * direction.dot(n).max(0.0));
        sum * 4.0 / lights.len() as f64
    };
    let truth: Vec<(DVec3, DVec3)> = directions(200).into_iter().map(|n| (n, irradiance(n))).collect();
    let mean = truth.iter().map(|(_, light)| light.dot(DVec3::splat(1.0 / 3.0))).sum::<f64>() / 200.0;
    let to_order = |bands: usize| {
        move |n: Vec3| {
            let (x, y, z) = (n.x, n.y, n.z);
            let p = [1.0, y, z, x, x * y, y * z, 3.0 * z * z - 1.0, x * z, x * x - y * y];
            (0..bands * bands).fold(Vec3::ZERO, |sum, i| sum + h[i] * p[i]).max(Vec3::ZERO)
        }
    };
    let of_map = |size: u32| {
        let map = OctahedralMap::from_fn(size, |_, _, n| irradiance(n.as_dvec3()).as_vec3());
        move |n: Vec3| map.sample(n)
    };
    type Lookup = Box<dyn Fn(Vec3) -> Vec3>;
    let methods: [(&str, f64, Lookup); 6] = [
        ("constant in all directions", 12.0, Box::new(to_order(1))),
        ("harmonics to order 1", 48.0, Box::new(to_order(2))),
        ("harmonics to order 2", 108.0, Box::new(to_order(3))),
        ("a map of 8 texels a side", 8.0 * 100.0, Box::new(of_map(8))),
        ("a map of 16 texels a side", 8.0 * 324.0, Box::new(of_map(16))),
        ("a map of 32 texels a side", 8.0 * 1156.0, Box::new(of_map(32))),
    ];
    let mut cases: Vec<Case> = Vec::new();
    for (name, bytes, lookup) in &methods {
        let mut error = ErrorStats::default();
        for (n, light) in &truth {
            error.add((lookup(n.as_vec3()).as_dvec3() - *light).abs().dot(DVec3::splat(1.0 / 3.0)) / mean);
        }
        choice.rows.push(Row::new(*name).error(error.worst, error.mean()).bytes(*bytes));
        let normals: Vec<Vec3> = truth.iter().map(|(n, _)| n.as_vec3()).collect();
        cases.push(Case::new(normals.len(), move || {
            normals.iter().for_each(|n| {
                black_box(lookup(black_box(*n)));
            });
        }));
    }
    let nanos = interleaved(Clock::Thread, budget_secs, &mut cases);
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    choice
        .choose("harmonics to order 2", "needs no texture, and its error is not visible on shaped surfaces");
    choice
}
