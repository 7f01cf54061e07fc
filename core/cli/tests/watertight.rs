//! Back faces of watertight meshes are not drawn (`choreo_render::scene_resources::watertight`). The test counts the pixels that this changes
//! in every deforming sample, in its clips and in poses in which the mesh intersects itself.
//! `cargo test -p choreo --test watertight -- --nocapture` prints the table.

mod common;
#[path = "../../render/tests/common/holes.rs"]
mod holes;

use choreo_asset::*;
use choreo_motion::Time;
use choreo_plugin::{ImportScope, Registry};
use choreo_render::{GpuOptions, Plan, PlanOptions, RenderError, Renderer, SceneResources, VulkanRenderer};
use choreo_script::{Limits, Loader};
use choreo_stage::*;
use glam::{Affine3A, Vec4};
use holes::count_holes;
use std::path::Path;
use std::sync::Arc;

const SIZE: [u32; 2] = [240, 240];
/// Angle in radians by which one joint after the other is turned, so that limbs intersect the body.
const TURN: f32 = 2.5;
const JOINTS: usize = 10;

const FILES: [&str; 9] = [
    "choreo:mannequin",
    "gltf/Knight.glb",
    "gltf/CesiumMan.glb",
    "gltf/Fox.glb",
    "gltf/RobotExpressive.glb",
    "gltf/AnimatedMorphCube.glb",
    "fbx/pab/arnaud.fbx",
    "fbx/spider.fbx",
    "vrm/Godette_vrm_v4.vrm",
];

fn load(folder: &Path, name: &str, registry: &Registry) -> Arc<Asset> {
    let file = folder.join("none");
    let loader = Loader::for_file(&file, &[], registry, ImportScope::ALL, Limits::default().file).unwrap();
    let loader = Arc::new(loader);
    loader.load(name, &Default::default()).unwrap_or_else(|e| panic!("{name}: {}", e.message))
}

/// The snapshot with a joint and all its descendants turned about the joint's own x.
fn with_joint_turned(snapshot: &Snapshot, asset: &Asset, joint: usize) -> Snapshot {
    let mut turned = snapshot.clone();
    let of = &mut turned.actors[0].model_from_joint;
    let at = of[joint];
    let map = at * Affine3A::from_rotation_x(TURN) * at.inverse();
    let mut below = vec![false; of.len()];
    for (i, parent) in asset.skeleton.parents().iter().enumerate() {
        below[i] = i == joint || parent.is_some_and(|p| below[p as usize]);
        if below[i] {
            of[i] = map * of[i];
        }
    }
    turned
}

/// The rest pose, poses in the middle of the first clips, and poses with one joint turned.
fn clip_and_turned_poses(asset: &Arc<Asset>) -> (Stage, Vec<Snapshot>) {
    let mut stage = Stage::default();
    stage.settings.size = SIZE;
    stage.cast("body", asset.clone());
    let mut poses = vec![stage.at(Time::ZERO).unwrap()];
    for clip in asset.clips.iter().take(6) {
        let mut playing = stage.clone();
        playing.settings.length = clip.duration.max(playing.settings.length);
        playing.play(0, Cue { repeat: Repeat::Once, ..Cue::new(clip.clone()) });
        poses.push(playing.at(Time(clip.duration.0 / 2)).unwrap());
    }
    let parents = asset.skeleton.parents();
    let bends = |joint: &u32| parents.contains(&Some(*joint));
    let joints: Vec<u32> = asset.skins.iter().flat_map(|s| s.joints.iter().copied()).filter(bends).collect();
    let step = joints.len().div_ceil(JOINTS).max(1);
    let more: Vec<Snapshot> = joints
        .iter()
        .step_by(step)
        .map(|joint| with_joint_turned(&poses[0], asset, *joint as usize))
        .collect();
    poses.extend(more);
    for pose in &mut poses {
        pose.background = Background::Color(Vec4::new(1.0, 0.0, 1.0, 1.0));
        pose.sky = None;
    }
    (stage, poses)
}

#[test]
fn meshes_that_bend_have_no_holes() {
    let Some(folder) = common::sample_assets_folder() else { return };
    let registry = choreo::registry();
    let effects = registry.effects().to_vec();
    let options = GpuOptions { validation: true, effects, ..GpuOptions::default() };
    let mut renderer = match VulkanRenderer::new(options) {
        Ok(renderer) => renderer,
        Err(RenderError::NoVulkan { why }) => {
            println!("SKIP 1: {}", why.lines().next().unwrap_or_default());
            return;
        }
        Err(e) => panic!("{e}"),
    };
    println!("{:<32} triangles closed  poses  lost  beyond 2: mean, worst", "");
    let mut without = 0;
    for name in FILES {
        let asset = load(&folder, name, &registry);
        let (stage, poses) = clip_and_turned_poses(&asset);
        let resources = Arc::new(SceneResources::new(&stage));
        renderer.load(resources.clone()).unwrap();
        let (mut closed, mut worst_lost, mut shares) = (0, 0, Vec::new());
        for pose in &poses {
            let plan = Plan::new(&resources, &stage, pose, &PlanOptions::new(SIZE, 1));
            closed = closed.max(plan.draws.iter().map(|d| d.watertight / 3).sum());
            let mut both = plan.clone();
            both.draws.iter_mut().for_each(|d| d.watertight = 0);
            let mut draw = |plan: Plan| {
                renderer.submit(plan).unwrap();
                renderer.collect(None).unwrap()
            };
            let [covered, lost, other] = count_holes(&draw(plan), &draw(both));
            assert!(covered > 100, "{name}: {covered} pixels");
            worst_lost = worst_lost.max(lost);
            shares.push(other as f64 / covered as f64);
        }
        let (worst, mean) = (
            shares.iter().copied().fold(0.0, f64::max) * 100.0,
            shares.iter().sum::<f64>() / shares.len() as f64 * 100.0,
        );
        println!("{name:<32} {closed:>16} {:>6} {worst_lost:>5} {mean:>8.3} %, {worst:.3} %", poses.len());
        assert!(worst_lost <= 2, "{name}: {worst_lost} pixels are a hole");
        without += usize::from(closed > 0);
    }
    assert!(without >= 3, "of {} models {without} have watertight meshes", FILES.len());
}
