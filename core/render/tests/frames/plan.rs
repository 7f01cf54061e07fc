//! Contents of a plan: its instances, features, left-out parts and the order of draws.

use crate::common::*;
use choreo_asset::*;
use choreo_render::plan::shader_features;
use choreo_render::plan::*;
use choreo_render::{Plan, PlanOptions};
use glam::{DAffine3, DVec3, Vec3, Vec4};

fn options() -> PlanOptions<'static> {
    PlanOptions::new([200, 100], 1)
}

fn left_out_parts(plan: &Plan) -> Vec<&str> {
    plan.left_out.iter().map(|l| l.part.as_str()).collect()
}

#[test]
fn an_unlit_static_scene_requests_positions_only() {
    let mut scene = Scene::ortho(4.0);
    scene.sun(-Vec3::Z, Vec3::ONE, 1.0);
    scene.snapshot.ambient_up = Vec3::ONE;
    // A normal map, emissive and roughness textures that unlit shading does not read.
    let material = Material {
        normal_texture: Some(texture(0)),
        emissive_texture: Some(texture(0)),
        metallic_roughness_texture: Some(texture(0)),
        ..unlit(Vec4::ONE)
    };
    let a = asset(vec![quad(1.0, 1.0)], vec![material], vec![image(1, 1, |_, _| [255; 4])]);
    scene.at(&a, 0.0, 0.0, 0.0);
    let (resources, plan) = scene.plan(&options());
    assert_eq!(plan.draws.len(), 1);
    assert_eq!(plan.draws[0].pipeline.features, Features::default(), "no feature at all");
    assert!(plan.lights.is_empty() && plan.joint_matrices.is_empty() && plan.morphs.is_empty());
    assert_eq!(plan.ambient_up, Vec3::ZERO);
    assert!(resources.textures.is_empty(), "nothing to upload");
    let out = left_out_parts(&plan);
    for what in ["skinning", "morph targets", "normals, lights and ambient light", "alpha test"] {
        assert!(out.contains(&what), "{what} is missing in {out:?}");
    }
    assert!(
        out.contains(&"blending and sorting back to front")
            && out.contains(&"full-screen passes and float target")
    );
}

#[test]
fn a_lit_skinned_scene_requests_lighting_and_skinning() {
    let mut scene = Scene::ortho(4.0);
    scene.sun(-Vec3::Z, Vec3::ONE, 1.0);
    let a = skinned_asset(vec![quad(1.0, 1.0)], vec![matte(Vec4::ONE)]);
    scene.at(&a, 0.0, 0.0, 0.0);
    let (_, plan) = scene.plan(&options());
    let f = plan.draws[0].pipeline.features;
    assert_eq!(f, Features::SKIN.with(Features::METALLIC_ROUGHNESS));
    assert_eq!(plan.lights.len(), 1);
    assert_eq!(plan.joint_matrices.len(), 2);
    assert!(!left_out_parts(&plan).contains(&"skinning"));
}

#[test]
fn equal_content_of_two_files_shares_resources_and_draws() {
    let make = || {
        let material = Material { base_color_texture: Some(texture(0)), ..unlit(Vec4::ONE) };
        asset(vec![quad(0.1, 0.1)], vec![material], vec![image(2, 2, |x, y| [x as u8, y as u8, 0, 255])])
    };
    let mut scene = Scene::ortho(4.0);
    let (a, b) = (make(), make());
    assert!(!std::sync::Arc::ptr_eq(&a, &b));
    for i in 0..3 {
        scene.at(&a, f64::from(i) * 0.3, 0.0, 0.0);
        scene.at(&b, f64::from(i) * 0.3, 1.0, 0.0);
    }
    let (resources, plan) = scene.plan(&options());
    let counts = (resources.primitives.len(), resources.materials.len(), resources.textures.len());
    assert_eq!(counts, (1, 1, 1));
    assert_eq!(plan.draws.len(), 1);
    assert_eq!(plan.draws[0].instance_count, 6);
    let (_, single) = scene.plan(&PlanOptions { no_instancing: true, ..options() });
    assert_eq!(single.draws.len(), 6);
    // One different texel gives another texture and another material, but the same primitive.
    let other = asset(
        vec![quad(0.1, 0.1)],
        vec![Material { base_color_texture: Some(texture(0)), ..unlit(Vec4::ONE) }],
        vec![image(2, 2, |x, y| [x as u8, y as u8, 1, 255])],
    );
    scene.at(&other, 0.0, 0.5, 0.0);
    let (resources, plan) = scene.plan(&options());
    let counts = (resources.primitives.len(), resources.materials.len(), resources.textures.len());
    assert_eq!(counts, (1, 2, 2));
    assert_eq!(plan.draws.len(), 2);
}

#[test]
fn skinned_copies_share_one_draw_and_a_skin_is_computed_once_per_actor() {
    let mut scene = Scene::ortho(4.0);
    let mut second = quad(0.2, 0.2);
    second.material = Some(1);
    let a = skinned_asset(vec![quad(0.1, 0.1), second], vec![unlit(Vec4::ONE), unlit(Vec4::splat(0.5))]);
    for i in 0..4 {
        scene.at(&a, f64::from(i) * 0.3, 0.0, 0.0);
    }
    let (_, plan) = scene.plan(&options());
    assert_eq!(plan.joint_matrices.len(), 4 * 2, "2 joints an actor, though two primitives use them");
    assert_eq!(plan.draws.len(), 2);
    let first: Vec<u32> = plan.instances.iter().map(|i| i.first_joint).collect();
    assert_eq!(first, [0, 2, 4, 6, 0, 2, 4, 6]);
}

#[test]
fn a_thousand_copies_are_one_draw_and_culled_one_by_one() {
    let mut scene = Scene::ortho(4.0);
    let mut a = (*asset(vec![quad(0.1, 0.1)], vec![matte(Vec4::ONE)], vec![])).clone();
    let place = |i: u16| Vec3::new(f32::from(i % 40) * 0.3 - 6.0, f32::from(i / 40) * 0.15 - 1.8, 0.0);
    a.instances[0].copies = (0..1000).map(|i| glam::Affine3A::from_translation(place(i))).collect();
    let index = scene.at(&std::sync::Arc::new(a), 0.0, 0.0, 0.0);
    let (resources, plan) = scene.plan(&options());
    assert_eq!((resources.primitives.len(), plan.draws.len()), (1, 1));
    // The view is 8 m wide, from −4 to 4, and a copy reaches 0.1 m beyond its center.
    let seen = (0..1000).filter(|i| place(*i).x.abs() < 4.1).count();
    assert_eq!((plan.draws[0].instance_count as usize, plan.instances.len()), (seen, seen));
    let said = plan.left_out.iter().find(|l| l.part == "primitives outside the view").unwrap();
    assert_eq!(said.why, format!("bounds outside the frustum: {} of 1000", 1000 - seen));
    // Copies move with their joint.
    scene.snapshot.actors[index].model_from_joint[0].translation.x += 100.0;
    assert!(scene.plan(&options()).1.draws.is_empty());
}

#[test]
fn an_animated_base_color_becomes_the_instance_tint() {
    use choreo_motion::{Clip, Interpolation, PropertyCurve, PropertyTarget, Time};
    let mut a = (*asset(vec![quad(1.0, 1.0)], vec![matte(Vec4::new(0.5, 0.0, 0.5, 1.0))], vec![])).clone();
    let curve = PropertyCurve {
        target: PropertyTarget::BaseColor(0),
        interpolation: Interpolation::Linear,
        times: vec![Time::ZERO].into(),
        values: vec![0.0; 4].into(),
    };
    let clip = Clip::new("c".into(), 1, vec![]).unwrap().with_properties(vec![curve]).unwrap();
    a.clips.push(std::sync::Arc::new(clip));
    let mut scene = Scene::ortho(4.0);
    let index = scene.at(&std::sync::Arc::new(a), 0.0, 0.0, 0.0);
    let tint = |scene: &Scene| {
        let (resources, plan) = scene.plan(&options());
        (resources.materials[0].material.base_color, plan.instances[0].tint)
    };
    // At rest the tint is the material's color; with the clip it is the clip's color, which is green although the material has no green.
    assert_eq!(tint(&scene), (Vec4::ONE, Vec4::new(0.5, 0.0, 0.5, 1.0)));
    scene.snapshot.actors[index].base_colors = vec![Vec4::new(0.0, 1.0, 0.0, 1.0)];
    scene.snapshot.actors[index].tint = Vec4::new(1.0, 0.5, 1.0, 1.0);
    assert_eq!(tint(&scene), (Vec4::ONE, Vec4::new(0.0, 0.5, 0.0, 1.0)));
}

#[test]
fn actors_outside_the_view_are_culled() {
    let mut scene = Scene::perspective(1.0, 5.0);
    let a = asset(vec![quad(0.5, 0.5)], vec![unlit(Vec4::ONE)], vec![]);
    scene.at(&a, 0.0, 0.0, 0.0);
    for (x, y, z) in [(50.0, 0.0, 0.0), (0.0, -50.0, 0.0), (0.0, 0.0, 8.0), (0.0, 0.0, 1e9)] {
        scene.at(&a, x, y, z);
    }
    let (_, plan) = scene.plan(&options());
    assert_eq!(plan.instances.len(), 1);
    assert!(plan.left_out.iter().any(|l| l.why == "bounds outside the frustum: 4 of 5"));
    let (_, all) = scene.plan(&PlanOptions { no_culling: true, ..options() });
    assert_eq!(all.instances.len(), 5);
}

#[test]
fn a_skinned_limb_that_reaches_into_view_is_drawn() {
    let mut scene = Scene::ortho(2.0);
    let a = skinned_asset(vec![quad(0.1, 0.5)], vec![unlit(Vec4::ONE)]);
    let actor = scene.at(&a, 30.0, 0.0, 0.0);
    assert_eq!(scene.plan(&options()).1.instances.len(), 0);
    // The upper joint moves 30 m to the left: half the quad with it.
    scene.snapshot.actors[actor].model_from_joint[1].translation.x = -30.0;
    assert_eq!(scene.plan(&options()).1.instances.len(), 1);
}

#[test]
fn morph_targets_widen_bounds_and_zero_weights_request_nothing() {
    let mut scene = Scene::ortho(2.0);
    let mut p = quad(0.1, 0.1);
    p.morphs = vec![
        MorphTarget::default(),
        MorphTarget { positions: vec![Vec3::new(-30.0, 0.0, 0.0); 4], ..MorphTarget::default() },
    ];
    let a = asset(vec![p], vec![unlit(Vec4::ONE)], vec![]);
    let actor = scene.at(&a, 30.0, 0.0, 0.0);
    assert_eq!(scene.plan(&options()).1.instances.len(), 0);
    scene.snapshot.actors[actor].morph_weights[0] = vec![0.0, 1.0];
    let plan = scene.plan(&options()).1;
    assert_eq!(plan.morphs, [ActiveMorph { target: 1, weight: 1.0 }]);
    assert!(plan.draws[0].pipeline.features.has(Features::MORPH));
    scene.snapshot.actors[actor].world_from_model = DAffine3::IDENTITY;
    scene.snapshot.actors[actor].morph_weights[0] = vec![0.0, 0.0];
    let plan = scene.plan(&options()).1;
    assert!(plan.morphs.is_empty() && !plan.draws[0].pipeline.features.has(Features::MORPH));
}

#[test]
fn draws_are_opaque_then_masked_then_blended_back_to_front() {
    let mut scene = Scene::ortho(4.0);
    let blend = Material { alpha_mode: AlphaMode::Blend, ..unlit(Vec4::splat(0.5)) };
    let mask = Material { alpha_mode: AlphaMode::Mask(0.5), ..unlit(Vec4::ONE) };
    let make = |m: Material| asset(vec![quad(0.5, 0.5)], vec![m], vec![]);
    let (blend, mask, opaque) = (make(blend), make(mask), make(unlit(Vec4::ONE)));
    for z in [2.0, -1.0, 0.5] {
        scene.at(&blend, 0.0, 0.0, z);
    }
    scene.at(&mask, 0.0, 0.0, 0.0);
    scene.at(&opaque, 0.0, 0.0, 0.0);
    let (_, plan) = scene.plan(&options());
    assert!(!plan.draws[0].pipeline.blend && !plan.draws[0].pipeline.features.has(Features::ALPHA_MASK));
    assert!(plan.draws[1].pipeline.features.has(Features::ALPHA_MASK));
    let blended = plan.draws[2];
    assert!(blended.pipeline.blend && blended.instance_count == 3);
    let z: Vec<f32> = plan.instances[2..].iter().map(|i| i.relative_from_mesh.0[2].w).collect();
    assert_eq!(z, [-11.0, -9.5, -8.0], "farthest first; relative to the camera at z = 10");
}

#[test]
fn a_see_through_tint_blends_and_a_mirror_flips_front_faces() {
    let mut scene = Scene::ortho(4.0);
    let a = asset(vec![quad(0.5, 0.5)], vec![unlit(Vec4::ONE)], vec![]);
    let faded = scene.at(&a, 0.0, 0.0, 0.0);
    scene.snapshot.actors[faded].tint.w = 0.25;
    scene.add(&a, DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)));
    let (_, plan) = scene.plan(&options());
    let keys: Vec<_> = plan.draws.iter().map(|d| (d.pipeline.mirrored, d.pipeline.blend)).collect();
    assert_eq!(keys, [(true, false), (false, true)]);
}

#[test]
fn the_plan_is_the_same_10000_km_from_the_origin() {
    let plan_at = |offset: DVec3| {
        let mut scene = Scene::perspective(1.0, 5.0);
        scene.snapshot.camera.world_from_view.translation += offset;
        let a = skinned_asset(vec![quad(0.5, 0.5)], vec![matte(Vec4::ONE)]);
        scene.add(&a, DAffine3::from_translation(DVec3::new(0.25, 0.5, 0.125) + offset));
        scene.plan(&options()).1
    };
    let (near, far) = (plan_at(DVec3::ZERO), plan_at(DVec3::splat(1e7)));
    assert_eq!(near.joint_matrices, far.joint_matrices);
    assert_eq!(near.instances, far.instances);
}

#[test]
fn force_all_requests_every_additive_feature() {
    let mut scene = Scene::ortho(4.0);
    let a = asset(vec![quad(0.5, 0.5)], vec![matte(Vec4::ONE)], vec![]);
    scene.at(&a, 0.0, 0.0, 0.0);
    let (_, plan) = scene.plan(&PlanOptions { force_all: true, ..options() });
    let f = plan.draws[0].pipeline.features;
    // Every feature of metallic-roughness surfaces without layers, except alternative ways of drawing, which are never forced in.
    let surface = [Features::SKIN, Features::SKIN_8, Features::MORPH, Features::VERTEX_COLOR, Features::UV0];
    let surface = surface.into_iter().chain([Features::UV1, Features::UV_TRANSFORM, Features::ALPHA_MASK]);
    let surface = surface.chain([Features::METALLIC_ROUGHNESS, Features::EMISSIVE, Features::LOCAL_LIGHTS]);
    let textures = (0..7).filter_map(|slot| {
        let read = |f: &&shader_features::Feature| {
            f.texture.is_some_and(|t| t.slot == slot) && !f.needs.contains(&"TOON")
        };
        shader_features::FEATURES.iter().find(read).map(|f| f.bit)
    });
    for feature in surface.chain(textures) {
        assert!(f.has(feature), "{:?}", shader_features::names(feature).collect::<Vec<_>>());
    }
    assert_eq!(plan.joint_matrices.len(), 1);
}

#[test]
fn broken_primitives_are_never_drawn() {
    let mut scene = Scene::ortho(4.0);
    let mut out_of_range = quad(0.5, 0.5);
    out_of_range.indices[2] = 4;
    let mut short = quad(0.5, 0.5);
    short.normals.pop();
    let a = asset(vec![out_of_range, short, Primitive::default()], vec![unlit(Vec4::ONE)], vec![]);
    scene.at(&a, 0.0, 0.0, 0.0);
    assert!(scene.plan(&options()).1.draws.is_empty());
}

#[test]
fn the_plan_of_the_same_snapshot_is_the_same() {
    let build = || {
        let mut scene = Scene::ortho(4.0);
        for i in 0..20 {
            let m =
                if i % 3 == 0 { matte(Vec4::ONE) } else { unlit(Vec4::splat(1.0 / f32::from(i as u8 + 1))) };
            let a = asset(vec![quad(0.1 + f32::from(i as u8 % 4), 0.5)], vec![m], vec![]);
            scene.at(&a, 0.0, 0.0, 0.0);
        }
        format!("{:?}", scene.plan(&options()).1)
    };
    assert_eq!(build(), build());
}
