//! Dual-quaternion skinning: a twisted limb keeps its width in both renderers, bounds contain all vertices, and other skins cost nothing.

use crate::common::{draw as draw_cpu, *};
use choreo_asset::*;
use choreo_image_diff::compare;
use choreo_motion::Skinning;
use choreo_plugin::Frame;
use choreo_render::affine::Affine3x4;
use choreo_render::plan::Features;
use choreo_render::scene_resources::bounds::PrimitiveInfo;
use choreo_render::*;
use choreo_stage::*;
use glam::{Affine3A, DAffine3, DVec3, EulerRot, Quat, Vec3, Vec4};
use std::f32::consts::PI;

/// A tube about y from −1 to 1, radius 0.5, whose weights blend from the lower joint to the upper one.
fn tube(influences: usize) -> Primitive {
    let mut p = Primitive { influences, ..Primitive::default() };
    let (rings, around) = (41, 24);
    for ring in 0..rings {
        let s = ring as f32 / (rings - 1) as f32;
        for i in 0..around {
            let angle = i as f32 / around as f32 * 2.0 * PI;
            let normal = Vec3::new(angle.sin(), 0.0, angle.cos());
            p.positions.push(normal * 0.5 + Vec3::Y * (2.0 * s - 1.0));
            p.normals.push(normal);
            let (mut joints, mut weights) = (vec![0; influences], vec![0.0; influences]);
            // The first and the last influence have weights; those between have weight 0.
            (joints[0], weights[0]) = (0, 1.0 - s);
            (joints[influences - 1], weights[influences - 1]) = (1, s);
            p.joint_indices.extend(joints);
            p.joint_weights.extend(weights);
            if ring + 1 < rings {
                let next = (i + 1) % around;
                let at = |r: usize, i: usize| (r * around + i) as u32;
                let quad = [at(ring, i), at(ring, next), at(ring + 1, next), at(ring + 1, i)];
                p.indices.extend([0, 1, 2, 0, 2, 3].map(|c: usize| quad[c]));
            }
        }
    }
    p
}

fn scene(influences: usize, upper: Affine3A, skinning: Skinning, world: DAffine3) -> Scene {
    let mut scene = Scene::ortho(3.0);
    scene.sun(Vec3::new(-0.3, -0.4, -1.0), Vec3::ONE, 1.0);
    let mut asset = (*skinned_asset(vec![quad(1.0, 1.0)], vec![matte(Vec4::ONE)])).clone();
    std::sync::Arc::make_mut(&mut asset.meshes[0]).primitives = vec![tube(influences)];
    asset.skins[0].inverse_bind[1] = glam::Mat4::IDENTITY;
    let actor = scene.add(&std::sync::Arc::new(asset), world);
    let state = &mut scene.snapshot.actors[actor];
    state.model_from_joint = vec![Affine3A::IDENTITY, upper];
    state.skinning = skinning;
    scene
}

fn lit_pixels_of_row(frame: &Frame, row: u32) -> usize {
    (0..frame.width).filter(|x| pixel(frame, *x, row)[0] > 8).count()
}

/// A tube is turned by θ at one end: linear blending leaves cos(θ/2) of the width in the middle, dual quaternions all of it.
#[test]
fn dual_quaternions_keep_the_width_of_a_twisted_tube() {
    let options = PlanOptions::new([201, 201], 1);
    let mut device = vulkan(GpuOptions::default());
    for influences in [4, 8] {
        for degrees in [0.0f32, 90.0, 150.0] {
            let turn = Affine3A::from_rotation_y(degrees.to_radians());
            let thin = 67.0 * (degrees.to_radians() / 2.0).cos();
            for (skinning, width) in [(Skinning::Linear, thin), (Skinning::DualQuaternion, 67.0)] {
                let mut frames =
                    vec![draw_cpu(&scene(influences, turn, skinning, DAffine3::IDENTITY), &options)];
                if let Some(device) = &mut device {
                    let (resources, plan) =
                        scene(influences, turn, skinning, DAffine3::IDENTITY).plan(&options);
                    device.load(resources).unwrap();
                    device.submit(plan).unwrap();
                    frames.push(device.collect(None).unwrap());
                    let c = compare(&frames[0], &frames[1], 2).unwrap();
                    assert!(c.mean < 0.15 && c.share_beyond < 0.01, "{skinning:?} {degrees}: {c}");
                }
                for frame in &frames {
                    let got = lit_pixels_of_row(frame, 100) as f32;
                    assert!((got - width).abs() <= 2.0, "{skinning:?} {degrees}: {got}, must be {width}");
                }
            }
        }
    }
}

/// Stretched, mirrored and bent tubes: both renderers match the f64 evaluation, and linear skinning does not.
#[test]
fn both_renderers_draw_the_same_stretched_and_mirrored_tubes() {
    let Some(mut device) = vulkan(GpuOptions::default()) else { return };
    let options = PlanOptions::new([160, 160], 4);
    let worlds = [
        DAffine3::from_scale(DVec3::new(1.2, 0.7, 1.0)),
        DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)) * DAffine3::from_rotation_z(0.4),
    ];
    for world in worlds {
        let upper = Affine3A::from_scale_rotation_translation(
            Vec3::new(1.3, 0.8, 1.0),
            Quat::from_euler(EulerRot::YXZ, 1.8, 0.6, 0.2),
            Vec3::new(0.2, 0.1, 0.0),
        );
        let cpu = draw_cpu(&scene(4, upper, Skinning::DualQuaternion, world), &options);
        let (resources, plan) = scene(4, upper, Skinning::DualQuaternion, world).plan(&options);
        device.load(resources).unwrap();
        device.submit(plan).unwrap();
        let gpu = device.collect(None).unwrap();
        let c = compare(&cpu, &gpu, 2).unwrap();
        assert!(c.mean < 0.15 && c.share_beyond < 0.01, "{c}");
        let linear = draw_cpu(&scene(4, upper, Skinning::Linear, world), &options);
        assert!(
            compare(&linear, &gpu, 2).unwrap().share_beyond > 0.02,
            "the comparison must see another skinning"
        );
    }
}

#[test]
fn dual_quaternion_bounds_contain_every_vertex_tightly() {
    let primitive = tube(4);
    let info = PrimitiveInfo::new(&primitive);
    let mut largest: f32 = 0.0;
    for i in 0..60 {
        let t = i as f32;
        let upper = Affine3A::from_scale_rotation_translation(
            Vec3::new(1.0 + 0.3 * (t * 0.7).sin(), 1.0, 1.0 - 0.2 * (t * 0.3).cos()),
            Quat::from_euler(EulerRot::YXZ, t * 1.1, t * 0.37, t * 0.23),
            Vec3::new((t * 0.9).sin(), (t * 0.4).cos(), 0.2),
        );
        let scene = scene(4, upper, Skinning::DualQuaternion, DAffine3::IDENTITY);
        let carriers = [Affine3A::IDENTITY, upper].map(|m| {
            let m = Affine3x4::from_affine3a(m);
            let [x, y, z] = m.0.map(|r| r.as_dvec4());
            choreo_motion::StretchedDualQuaternion::of(DAffine3 {
                matrix3: glam::DMat3::from_cols(x.truncate(), y.truncate(), z.truncate()).transpose(),
                translation: DVec3::new(x.w, y.w, z.w),
            })
        });
        let rows = Affine3x4::from_affine(DAffine3::IDENTITY);
        let none = Aabb { min: Vec3::ZERO, max: Vec3::ZERO };
        let bounds = info.dual_quaternion_bounds(&primitive, &carriers, &rows, none);
        let mut tight = Aabb::EMPTY;
        for posed in posed_meshes(&scene.stage.actors[0].asset, &scene.snapshot.actors[0]) {
            for p in posed.primitives.iter().flat_map(|p| &p.positions) {
                tight.add(p.as_vec3());
                let inside =
                    bounds.min.cmple(p.as_vec3() + 1e-5).all() && bounds.max.cmpge(p.as_vec3() - 1e-5).all();
                assert!(inside, "{i}: {p} is outside of {bounds:?}");
            }
        }
        largest = largest.max((bounds.max - bounds.min).length() / (tight.max - tight.min).length());
    }
    assert!(largest < 6.0, "boxes are up to {largest} times as large");
}

#[test]
fn only_dual_quaternion_skins_request_the_feature() {
    let options = PlanOptions::new([64, 64], 1);
    let plan = |skinning| scene(4, Affine3A::IDENTITY, skinning, DAffine3::IDENTITY).plan(&options).1;
    let (linear, dual) = (plan(Skinning::Linear), plan(Skinning::DualQuaternion));
    let without = |plan: &Plan| plan.left_out.iter().any(|l| l.part == "dual quaternions");
    assert!(without(&linear) && !without(&dual));
    assert_eq!((linear.joint_matrices.len(), dual.joint_matrices.len()), (2, 4));
    let features = dual.draws[0].pipeline.features;
    assert!(
        features.has(Features::DUAL_QUATERNIONS)
            && !linear.draws[0].pipeline.features.has(Features::DUAL_QUATERNIONS)
    );
    let recording =
        |plan: &Plan| format!("{}", commands::record(plan, commands::RecordOptions::default(), |_| 2));
    assert!(recording(&linear).contains("2 joints") && recording(&dual).contains("4 joints"));
}
