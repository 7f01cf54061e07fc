//! Models that a file places several times: they share one set of skin matrices, and have the image, bounds and shadows of separate actors.

use crate::common::*;
use choreo_asset::*;
use choreo_image_diff::compare;
use choreo_motion::Skinning;
use choreo_plugin::Frame;
use choreo_render::plan::Features;
use choreo_render::*;
use choreo_stage::*;
use glam::{Affine3A, DAffine3, DQuat, DVec3, EulerRot, Quat, Vec3, Vec4};
use std::sync::Arc;

/// A beam along y whose upper part is bound to a second joint, and a rigid hat on that joint.
fn beam_with_hat() -> Asset {
    let mut beam = Primitive::default();
    for (at, normal) in [(0.0f32, Vec3::Z), (1.0, Vec3::X), (2.0, Vec3::NEG_Z), (3.0, Vec3::NEG_X)] {
        let turn = Quat::from_rotation_y(at * std::f32::consts::FRAC_PI_2);
        let first = beam.positions.len() as u32;
        for (x, y) in [(-0.2, -0.4), (0.2, -0.4), (0.2, 0.2), (-0.2, 0.2), (0.2, 0.7), (-0.2, 0.7)] {
            beam.positions.push(turn * Vec3::new(x, y, 0.2));
            beam.normals.push(normal);
        }
        beam.indices.extend([0, 1, 2, 0, 2, 3, 3, 2, 4, 3, 4, 5].map(|i| first + i));
    }
    let mut asset = (*skinned_asset(vec![beam], vec![matte(Vec4::new(0.9, 0.7, 0.3, 1.0))])).clone();
    asset.skins[0].inverse_bind[1] = glam::Mat4::IDENTITY;
    asset.meshes.push(Arc::new(Mesh { primitives: vec![quad(0.3, 0.1)], ..Mesh::default() }));
    asset.instances.push(MeshInstance { joint: 1, mesh: 1, ..MeshInstance::default() });
    asset
}

fn places() -> Vec<Affine3A> {
    let place = |i: usize| {
        let at = Vec3::new((i % 4) as f32 * 0.9 - 1.4, (i / 4) as f32 * 1.3 - 1.2, (i % 3) as f32 * -0.4);
        let scale = if i == 5 { Vec3::new(-1.0, 1.1, 0.8) } else { Vec3::splat(0.7 + 0.05 * i as f32) };
        let turn = Quat::from_euler(EulerRot::YXZ, i as f32, 0.2 * i as f32, 0.0);
        Affine3A::from_scale_rotation_translation(scale, turn, at)
    };
    (0..11).map(place).collect()
}

/// A scene with one actor at many placements, or with one actor per placement. `upper`: model-from-joint of the second joint.
fn scene(as_one: bool, skinning: Skinning, upper: Affine3A) -> Scene {
    let mut scene = Scene::ortho(4.0);
    scene.sun(Vec3::new(-0.4, -0.5, -1.0), Vec3::ONE, 1.0);
    scene.snapshot.lights[0].shadow = Some(Shadow { size: 512, softness: Some(0.0) });
    scene.snapshot.ambient_up = Vec3::splat(0.1);
    scene.at(&asset(vec![quad(3.0, 3.0)], vec![matte(Vec4::ONE)], vec![]), 0.0, 0.0, -1.5);
    let world = DAffine3::from_rotation_z(0.1);
    let wide = |a: &Affine3A| DAffine3::from_cols_array(&a.to_cols_array().map(f64::from));
    if as_one {
        scene.add(&Arc::new(Asset { placements: places().into(), ..beam_with_hat() }), world);
    } else {
        let asset = Arc::new(beam_with_hat());
        for place in &places() {
            scene.add(&asset, world * wide(place));
        }
    }
    for state in &mut scene.snapshot.actors[1..] {
        (state.model_from_joint, state.skinning) = (vec![Affine3A::IDENTITY, upper], skinning);
    }
    scene
}

fn bent_joint() -> Affine3A {
    Affine3A::from_rotation_translation(Quat::from_rotation_z(0.7), Vec3::new(0.1, 0.0, 0.05))
}

fn draw_on_both(device: &mut Option<VulkanRenderer>, scene: &Scene, options: &PlanOptions) -> Vec<Frame> {
    let mut frames = vec![draw(scene, options)];
    if let Some(device) = device {
        let (resources, plan) = scene.plan(options);
        device.load(resources).unwrap();
        device.submit(plan).unwrap();
        frames.push(device.collect(None).unwrap());
    }
    frames
}

#[test]
fn one_model_at_many_places_looks_like_many_actors() {
    let mut device = vulkan(GpuOptions::default());
    for skinning in [Skinning::Linear, Skinning::DualQuaternion] {
        let options = PlanOptions::new([160, 160], 4);
        let forced = PlanOptions { force_all: true, no_culling: true, ..PlanOptions::new([160, 160], 4) };
        let casts = draw(&scene(false, skinning, bent_joint()), &options);
        let one = scene(true, skinning, bent_joint());
        for options in [&options, &forced] {
            for frame in draw_on_both(&mut device, &one, options) {
                let c = compare(&casts, &frame, 2).unwrap();
                assert!(c.mean < 0.1 && c.share_beyond < 0.004, "{skinning:?}: {c}");
            }
        }
        // The comparison finds another pose, and a missing placement.
        let other = draw(&scene(true, skinning, Affine3A::IDENTITY), &options);
        assert!(compare(&casts, &other, 2).unwrap().share_beyond > 0.02);
        let mut fewer = one;
        fewer.snapshot.actors[1].copies = Some(10);
        assert!(compare(&casts, &draw(&fewer, &options), 2).unwrap().share_beyond > 0.01);
    }
}

#[test]
fn a_thousand_placements_share_one_skin_and_are_culled_one_by_one() {
    let options = PlanOptions { full_detail: true, ..PlanOptions::new([64, 64], 1) };
    let at = |i: u16| Vec3::new(f32::from(i % 40) * 0.5 - 9.8, f32::from(i / 40) * 0.1 - 1.2, 0.0);
    let crowd = |count: u16| {
        let mut body = beam_with_hat();
        body.instances.truncate(1);
        body.placements = (0..count).map(|i| Affine3A::from_translation(at(i))).collect();
        let mut scene = Scene::ortho(4.0);
        scene.at(&Arc::new(body), 0.0, 0.0, 0.0);
        scene
    };
    let mut scene = crowd(1000);
    let plan = scene.plan(&options).1;
    assert_eq!((plan.joint_matrices.len(), plan.draws.len()), (2, 1), "one pose and one draw");
    let features = plan.draws[0].pipeline.features;
    assert!(features.has(Features::SKIN.with(Features::SKIN_INSTANCED)));
    // The view reaches 2 m to each side, and a model 0.2 m.
    let seen = (0..1000).filter(|i| at(*i).x.abs() < 2.2).count();
    assert_eq!(plan.instances.len(), seen);
    assert!(plan.instances.iter().all(|i| i.first_joint == 0));
    scene.snapshot.actors[0].copies = Some(3);
    assert!(scene.plan(&options).1.draws.is_empty(), "the first three stand on the left");
    let single = crowd(0).plan(&options).1;
    assert!(!single.draws[0].pipeline.features.has(Features::SKIN_INSTANCED));
    assert!(single.left_out.iter().any(|l| l.part == "copies of skinned meshes"));
}

#[test]
fn far_placements_get_coarser_levels() {
    // A sphere, which can be simplified.
    let mut ball = Primitive::default();
    let (rings, around) = (24u32, 32u32);
    for ring in 0..=rings {
        let polar = ring as f32 / rings as f32 * std::f32::consts::PI;
        for i in 0..=around {
            let angle = i as f32 / around as f32 * std::f32::consts::TAU;
            let n = Vec3::new(polar.sin() * angle.sin(), polar.cos(), polar.sin() * angle.cos());
            ball.positions.push(n * 0.4);
            ball.normals.push(n);
            if ring < rings && i < around {
                let at = |r: u32, i: u32| r * (around + 1) + i;
                ball.indices.extend([at(ring, i), at(ring + 1, i), at(ring + 1, i + 1)]);
                ball.indices.extend([at(ring, i), at(ring + 1, i + 1), at(ring, i + 1)]);
            }
        }
    }
    let mut body = (*skinned_asset(vec![ball], vec![matte(Vec4::ONE)])).clone();
    let place = |i: u8| Affine3A::from_translation(Vec3::new(0.0, 0.0, -2.0 * f32::from(i)));
    body.placements = (0..80).map(place).collect();
    let mut scene = Scene::perspective(0.6, 3.0);
    scene.at(&Arc::new(body), 0.0, 0.0, 0.0);
    let options = PlanOptions::new([128, 128], 1);
    scene.stage.settings.size = options.size;
    let rig = Rig::Fixed { position: DVec3::Z * 3.0, rotation: DQuat::IDENTITY, look_at: None };
    scene.stage.shoot(Camera { projection: scene.snapshot.camera.projection, ..Camera::new("front", rig) });
    let (resources, plan) = scene.plan(&options);
    assert!(resources.assets.iter().any(|asset| !asset.levels.is_empty()));
    let sizes: Vec<usize> = (plan.draws.iter())
        .map(|d| resources.primitives[d.primitive as usize].primitive().indices.len() / 3)
        .collect();
    assert!(sizes.len() > 1 && sizes.iter().min() < sizes.iter().max(), "{sizes:?}");
    assert_eq!(plan.joint_matrices.len(), 2);
}
