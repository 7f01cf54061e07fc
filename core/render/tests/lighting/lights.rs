//! Clustered lighting: light clusters cull most of hundreds of lights, and change no pixel.

use crate::common::*;
use choreo_asset::*;
use choreo_image_diff::compare;
use choreo_render::plan::light_clusters::{LightClusters, MAX_LIGHTS, MIN_RANGED_LIGHTS};
use choreo_render::*;
use choreo_stage::*;
use glam::{DAffine3, DQuat, DVec3, Vec3, Vec4};

const SIZE: [u32; 2] = [320, 180];

/// A floor of tiles with `lamps` lamps over it, every third a spot light; a sun, and one lamp without a range.
fn hall_with_lamps(lamps: usize) -> Scene {
    let mut scene = Scene::perspective(0.9, 9.0);
    scene.snapshot.camera.world_from_view.translation.y = 3.0;
    let tile = asset(vec![quad(0.95, 0.95)], vec![matte(Vec4::ONE)], vec![]);
    let flat = DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    for i in 0..400 {
        let at = DVec3::new(2.0 * f64::from(i % 20) - 19.0, 0.0, 6.0 - 2.0 * f64::from(i / 20));
        scene.add(&tile, DAffine3::from_rotation_translation(flat, at));
    }
    scene.sun(Vec3::new(-0.3, -0.7, -0.6), Vec3::ONE, 0.02);
    let mut lamp = |kind, position, intensity, range| {
        scene.snapshot.lights.push(LightState {
            light: Light { kind, color: Vec3::new(1.0, 0.8, 0.6), intensity, range },
            position,
            direction: Vec3::new(0.0, -0.8, -0.6),
            shadow: None,
            attenuation: None,
        });
    };
    for i in 0..lamps {
        let place = |k: usize| (i * k % 97) as f64 / 97.0;
        let at = DVec3::new(36.0 * place(31) - 18.0, 0.4 + place(53), 6.0 - 38.0 * place(71));
        let spot = LightKind::Spot { inner: 0.3, outer: if i % 2 == 0 { 0.6 } else { 1.1 } };
        lamp(if i % 3 == 0 { spot } else { LightKind::Point }, at, 1.0 + i as f32 * 0.01, Some(2.5));
    }
    lamp(LightKind::Point, DVec3::new(0.0, 3.0, 2.0), 0.5, None);
    scene
}

fn plan_without_light_clusters(scene: &Scene) -> Plan {
    scene.plan(&PlanOptions { no_light_clusters: true, ..PlanOptions::new(SIZE, 1) }).1
}

fn frame(r: &mut dyn Renderer, plan: Plan) -> choreo_plugin::Frame {
    r.submit(plan).unwrap();
    r.collect(None).unwrap()
}

#[test]
fn light_clusters_cull_most_lights_and_change_no_pixel() {
    let scene = hall_with_lamps(250);
    let (resources, plan) = scene.plan(&PlanOptions::new(SIZE, 1));
    let lists = plan.light_clusters.as_ref().unwrap();
    assert_eq!(lists.unlimited(), 2, "the sun and the lamp without a range");
    // Sum over several pixels of the number of lamps that each evaluates.
    let (mut asked, mut places) = (0, 0);
    for i in 0..400 {
        let at = Vec3::new((i % 20) as f32 - 9.5, -3.0, 6.0 - (i / 20) as f32 * 2.0 - 9.0);
        if at.z < -1.0 {
            asked += lists.of(at, &plan.view.clip_from_relative, SIZE).len();
            places += 1;
        }
    }
    let mean = asked as f64 / f64::from(places);
    println!("{mean:.1} of 250 lamps a place, {} bytes of lists", 4 * lists.0.len());
    assert!(mean > 0.5 && mean < 50.0, "{mean}");

    let wrong = {
        let mut plan = plan.clone();
        let view = &plan.view;
        let mut short = plan.lights.clone();
        short.iter_mut().for_each(|l| l.inverse_range_squared *= 16.0);
        plan.light_clusters = Some(LightClusters::new(&short, view, SIZE));
        plan
    };
    let mut cpu = CpuRenderer::new(&[]);
    cpu.load(resources.clone()).unwrap();
    let (all, listed) = (frame(&mut cpu, plan_without_light_clusters(&scene)), frame(&mut cpu, plan.clone()));
    assert_eq!(all.rgba, listed.rgba);
    assert!(
        compare(&all, &frame(&mut cpu, wrong.clone()), 1).unwrap().worst > 8,
        "lists of a quarter of the range"
    );

    let Some(mut gpu) = vulkan(GpuOptions::default()) else { return };
    gpu.load(resources).unwrap();
    let there = frame(&mut gpu, plan);
    assert_eq!(frame(&mut gpu, plan_without_light_clusters(&scene)).rgba, there.rgba);
    assert_ne!(frame(&mut gpu, wrong).rgba, there.rgba);
    let c = compare(&listed, &there, 2).unwrap();
    println!("twin: {c:?}");
    assert!(c.mean < 0.05 && c.share_beyond < 0.002, "{c:?}");
}

#[test]
fn few_lights_get_no_light_clusters() {
    for (lamps, lists) in [(1, false), (MIN_RANGED_LIGHTS - 1, false), (MIN_RANGED_LIGHTS, true)] {
        let (_, plan) = hall_with_lamps(lamps).plan(&PlanOptions::new(SIZE, 1));
        assert_eq!(plan.light_clusters.is_some(), lists, "{lamps}");
        assert_eq!(plan.left_out.iter().any(|l| l.part == "clustered lighting"), !lists, "{lamps}");
        assert_eq!(plan.lights.len(), lamps + 2);
    }
}

#[test]
fn both_renderers_refuse_more_lights_than_the_limit() {
    let said = |r: &mut dyn Renderer, lamps: usize| {
        let (resources, plan) = hall_with_lamps(lamps).plan(&PlanOptions::new([16, 16], 1));
        r.load(resources).unwrap();
        match r.submit(plan) {
            Ok(()) => r.collect(None).map(|_| String::new()).unwrap(),
            Err(e) => e.to_string(),
        }
    };
    let mut cpu = CpuRenderer::new(&[]);
    assert_eq!(said(&mut cpu, MAX_LIGHTS - 2), "");
    let refused = said(&mut cpu, MAX_LIGHTS - 1);
    assert!(refused.contains("257 lights shine"), "{refused}");
    assert!(refused.contains("256"), "{refused}");
    let Some(mut gpu) = vulkan(GpuOptions::default()) else { return };
    assert_eq!(said(&mut gpu, MAX_LIGHTS - 2), "");
    assert_eq!(said(&mut gpu, MAX_LIGHTS - 1), refused);
}
