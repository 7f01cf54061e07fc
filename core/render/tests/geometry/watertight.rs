//! Back faces of watertight meshes are culled while the camera is outside: the images stay the same, and the commands show it.

use crate::common::*;
use choreo_asset::*;
use choreo_image_diff::compare;
use choreo_render::commands::{Command, Cull, RecordOptions, record};
use choreo_render::plan::Draw;
use choreo_render::{GpuOptions, Plan, PlanOptions, Renderer, SceneResources, VulkanRenderer};
use choreo_stage::*;
use glam::{DAffine3, DQuat, DVec3, Vec3, Vec4};
use std::sync::Arc;

const SIZE: [u32; 2] = [200, 150];

fn two_sided(color: Vec4) -> Material {
    Material { double_sided: true, ..matte(color) }
}

/// A box with flat faces, without the faces whose indices are in `without`.
fn crate_of(half: Vec3, without: &[usize]) -> Primitive {
    let mut p = Primitive { material: Some(0), ..Primitive::default() };
    for face in (0..6).filter(|face| !without.contains(face)) {
        let (axis, side) = (face / 2, if face % 2 == 0 { -1.0f32 } else { 1.0 });
        let first = p.positions.len() as u32;
        for (u, v) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            let mut corner = [0.0; 3];
            (corner[axis], corner[(axis + 1) % 3], corner[(axis + 2) % 3]) = (side, u, v);
            let mut normal = [0.0; 3];
            normal[axis] = side;
            p.positions.push(Vec3::from(corner) * half);
            p.normals.push(Vec3::from(normal));
        }
        let corners: [u32; 6] = if side < 0.0 { [0, 2, 1, 0, 3, 2] } else { [0, 1, 2, 0, 2, 3] };
        p.indices.extend(corners.map(|i| first + i));
    }
    p
}

/// A closed box, a box without top and front that holds a closed one, and a mirrored box, under a sun with shadows.
fn boxes() -> Scene {
    let mut scene = Scene::perspective(0.8, 6.0);
    let closed = asset(vec![crate_of(Vec3::splat(0.5), &[])], vec![two_sided(Vec4::ONE)], vec![]);
    let yellow = two_sided(Vec4::new(1.0, 0.7, 0.2, 1.0));
    // An open box with a closed one in the same mesh.
    let mut mixed = crate_of(Vec3::splat(0.6), &[3, 5]);
    let small = crate_of(Vec3::splat(0.2), &[]);
    let first = mixed.positions.len() as u32;
    mixed.indices.extend(small.indices.iter().map(|i| i + first));
    mixed.positions.extend(&small.positions);
    mixed.normals.extend(&small.normals);
    let mixed = asset(vec![mixed], vec![yellow], vec![]);
    let turned = |x: f64| {
        DAffine3::from_rotation_translation(DQuat::from_euler(glam::EulerRot::YXZ, x, 0.5, 0.1), DVec3::X * x)
    };
    scene.add(&closed, turned(-1.6));
    scene.add(&mixed, turned(0.1));
    scene.add(&closed, turned(1.7) * DAffine3::from_scale(DVec3::new(-1.0, 0.7, 1.0)));
    scene.sun(Vec3::new(0.6, -0.8, -0.4), Vec3::ONE, 0.8);
    scene.snapshot.lights[0].shadow = Some(Shadow::default());
    scene.snapshot.ambient_up = Vec3::splat(0.3);
    scene.snapshot.ambient_down = Vec3::splat(0.1);
    scene
}

fn draw_plan(
    renderer: &mut VulkanRenderer,
    resources: &Arc<SceneResources>,
    plan: Plan,
) -> choreo_plugin::Frame {
    renderer.load(resources.clone()).unwrap();
    renderer.submit(plan).unwrap();
    renderer.collect(None).unwrap()
}

#[test]
fn back_faces_of_watertight_meshes_are_culled() {
    let scene = boxes();
    let (resources, plan) = scene.plan(&PlanOptions::new(SIZE, 1));
    let closed = |d: &Draw| d.watertight;
    let mut counts: Vec<u32> = plan.draws.iter().map(closed).collect();
    counts.sort_unstable();
    assert_eq!(counts, [36, 36, 36], "all of the boxes, and what is closed in the open one");
    assert!(plan.shadow_draws().all(|d| d.watertight == 36));
    let said = plan.left_out.iter().find(|l| l.part == "back faces of watertight meshes").unwrap();
    assert!(said.why.starts_with("36 triangles"), "{said:?}");
    // Front faces of the closed boxes, and both faces of the eight open triangles, once in the map and once in the image.
    let triangles = |p: u32| resources.primitives[p as usize].primitive().indices.len() / 3;
    let recording = record(&plan, RecordOptions::default(), triangles);
    let mut cull = None;
    let mut drawn = Vec::new();
    for command in &recording.commands {
        match command {
            Command::SetCull(c) => cull = Some(*c),
            Command::Draw { indices, .. } => drawn.push((cull.unwrap(), *indices)),
            _ => {}
        }
    }
    let of = |cull, indices| drawn.iter().filter(|d| **d == (cull, indices)).count();
    assert_eq!(of(Cull::Back, None), 4, "{drawn:?}");
    assert_eq!(of(Cull::Back, Some([0, 36])), 2, "{drawn:?}");
    assert_eq!(of(Cull::None, Some([36, 24])), 2, "{drawn:?}");
    assert_eq!(drawn.len(), 8, "{drawn:?}");
}

#[test]
fn back_faces_are_drawn_where_the_inside_may_be_visible() {
    let closed = |scene: &Scene| scene.plan(&PlanOptions::new(SIZE, 1)).1.draws[0].watertight;
    let alone = |material: Material, primitive: Primitive| {
        let mut scene = Scene::perspective(0.8, 6.0);
        scene.at(&asset(vec![primitive], vec![material], vec![]), 0.0, 0.0, 0.0);
        scene
    };
    let cube = || crate_of(Vec3::splat(0.5), &[]);
    let mut scene = alone(two_sided(Vec4::ONE), cube());
    assert_eq!(closed(&scene), 36);
    // The near plane, 0.1 m in front of the camera, cuts a box whose center is 0.55 m away; and the camera is inside a box.
    for z in [0.55, 0.2] {
        scene.snapshot.camera.world_from_view.translation.z = z;
        assert_eq!(closed(&scene), 0, "{z}");
    }
    let holes = Material { alpha_mode: AlphaMode::Mask(0.5), ..two_sided(Vec4::ONE) };
    assert_eq!(closed(&alone(holes, cube())), 0);
    let glassy = Material { alpha_mode: AlphaMode::Blend, ..two_sided(Vec4::splat(0.5)) };
    assert_eq!(closed(&alone(glassy, cube())), 0);
    assert_eq!(closed(&alone(matte(Vec4::ONE), cube())), 0, "one side is drawn as it is");
    assert_eq!(closed(&alone(two_sided(Vec4::ONE), crate_of(Vec3::splat(0.5), &[2]))), 0);
    // One joint mirrors and its neighbor does not.
    let mut skin = Scene::perspective(0.8, 6.0);
    let weld = skinned_asset(vec![cube()], vec![two_sided(Vec4::ONE)]);
    skin.at(&weld, 0.0, 0.0, 0.0);
    assert_eq!(closed(&skin), 36);
    skin.snapshot.actors[0].model_from_joint[1] *= glam::Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    assert_eq!(closed(&skin), 0);
    // The walls around a lamp inside a box must be drawn into the shadow map, so that no light leaks out.
    let mut lamp = boxes();
    lamp.snapshot.lights[0].shadow = None;
    let light = Light { kind: LightKind::Point, color: Vec3::ONE, intensity: 5.0, range: None };
    let at = DVec3::new(-1.6, 0.0, 0.0);
    let shadow = Some(Shadow::default());
    let state = LightState { light, position: at, direction: Vec3::NEG_Y, shadow, attenuation: None };
    lamp.snapshot.lights.push(state);
    let (_, plan) = lamp.plan(&PlanOptions::new(SIZE, 1));
    let around = plan.shadow_draws().filter(|d| plan.instance_actors[d.first_instance as usize] == 0);
    let walls: Vec<u32> = around.map(|d| d.watertight).collect();
    assert!(!walls.is_empty() && walls.iter().all(|closed| *closed == 0), "{walls:?}");
}

#[test]
fn vulkan_draws_the_same_without_back_faces() {
    let Some(mut renderer) = vulkan(GpuOptions::default()) else { return };
    for samples in [1, 4] {
        let (resources, plan) = boxes().plan(&PlanOptions::new(SIZE, samples));
        let mut both = plan.clone();
        let views = both.shadow_maps.iter_mut().flat_map(|s| &mut s.views).flat_map(|v| &mut v.draws);
        both.draws.iter_mut().chain(views).for_each(|d| d.watertight = 0);
        let front = draw_plan(&mut renderer, &resources, plan.clone());
        let whole = draw_plan(&mut renderer, &resources, both);
        // Where a silhouette edge passes through a pixel's center, either face may win.
        let c = compare(&front, &whole, 2).unwrap();
        println!("{samples} samples, against both faces: {c}");
        assert!(c.share_beyond < 3e-4, "{c}");
        let twin = draw_at(&boxes(), SIZE, samples);
        let c = compare(&front, &twin, 2).unwrap();
        println!("{samples} samples, against the CPU: {c}");
        assert!(c.mean < 0.15 && c.share_beyond < 0.01, "{c}");
        // The comparison finds an open mesh that is treated as watertight.
        let mut wrong = plan;
        wrong.draws.iter_mut().for_each(|d| d.watertight = 60);
        let wrong = draw_plan(&mut renderer, &resources, wrong);
        assert!(compare(&wrong, &whole, 2).unwrap().share_beyond > 0.01);
    }
    renderer.load(Arc::default()).unwrap();
}
