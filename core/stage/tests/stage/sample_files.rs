//! Sample files of other authors: every clip stays in its bounds and in the framed image, and look-at turns the head to its target.

use crate::support::*;
use choreo_asset::*;
use choreo_plugin::{Files, ImportOptions, ImportScope, Importer, Source};
use choreo_stage::*;
use glam::{DAffine3, DVec3};
use std::path::PathBuf;
use std::sync::Arc;

struct NoFiles;
impl Files for NoFiles {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        Err(format!("{relative}: these tests read single files"))
    }
}

/// `None` where the sample files are missing.
fn load(name: &str) -> Option<Arc<Asset>> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/assets");
    let folder = std::env::var_os("CHOREO_ASSETS").map_or(beside, PathBuf::from);
    let Ok(bytes) = std::fs::read(folder.join("gltf").join(name)) else {
        println!("SKIP 1: no {name} in {} ($CHOREO_ASSETS)", folder.display());
        return None;
    };
    let source = Source { name: name.to_string(), bytes: Arc::new(bytes) };
    let needs =
        ImportScope { geometry: true, clips: true, textures: false, pixels: false, image_files: false };
    let importer = import_gltf::GltfImporter::new();
    Some(Arc::new(importer.import(&source, &NoFiles, needs, &ImportOptions::default()).unwrap()))
}

const FILES: [&str; 6] = [
    "Knight.glb",
    "Fox.glb",
    "CesiumMan.glb",
    "RobotExpressive.glb",
    "RiggedSimple.glb",
    "AnimatedMorphCube.glb",
];

#[test]
fn vertices_of_sample_files_stay_in_their_bounds_and_in_the_frame() {
    for name in FILES {
        let Some(asset) = load(name) else { continue };
        let (mut widest, mut slack, mut clips) = (0f64, 0f64, 0);
        for clip in asset.clips.iter().step_by(asset.clips.len().div_ceil(8)) {
            let mut stage = Stage::default();
            stage.cast("a", asset.clone());
            stage.settings.length = clip.duration;
            stage.play(0, Cue::new(clip.clone()));
            assert_eq!(stage.check().len(), 0, "{:?}", stage.check());
            let mut evaluator = Evaluator::new(Arc::new(stage));
            let mut reach = 0f64;
            for i in 0..7 {
                // Between the times that framing looks at, too.
                let t = clip.duration.scaled(f64::from(i) / 6.7);
                let snapshot = evaluator.at(t).unwrap();
                let state = &snapshot.actors[0];
                let view = snapshot.camera.world_from_view.inverse();
                let Projection::Perspective { yfov, near, .. } = snapshot.camera.projection else { panic!() };
                let tan = (f64::from(yfov) / 2.0).tan();
                let posed = posed_meshes_in(
                    &asset,
                    &state.model_from_joint,
                    &state.morph_weights,
                    DAffine3::IDENTITY,
                );
                for (instance, mesh) in posed.iter().enumerate() {
                    let weights = &state.morph_weights[instance];
                    let bounds = asset.instance_bounds()[instance].posed(&state.model_from_joint, weights);
                    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
                    for p in mesh.primitives.iter().flat_map(|p| &p.positions) {
                        (min, max) = (min.min(*p), max.max(*p));
                        let v = view.transform_point3(*p);
                        assert!(-v.z > f64::from(near), "{name} {}: clipped", clip.name);
                        reach =
                            reach.max((v.x / -v.z / tan / (16.0 / 9.0)).abs()).max((v.y / -v.z / tan).abs());
                    }
                    let inside = min.cmpge(bounds.min.as_dvec3()) & max.cmple(bounds.max.as_dvec3());
                    assert!(inside.all(), "{name} {}: {min} {max} leaves {bounds:?}", clip.name);
                    let size = (bounds.max - bounds.min).as_dvec3();
                    slack = slack.max(size.length() / (max - min).length());
                }
            }
            assert!(reach < 1.0, "{name} {}: reaches {reach}", clip.name);
            widest = widest.max(reach);
            clips += 1;
        }
        println!(
            "{name}: {clips} clips, reach {widest:.3} of the half image, boxes up to {slack:.2} times as large"
        );
        assert!(widest > 0.6, "{name} is framed from too far: {widest}");
    }
}

#[test]
fn look_at_turns_the_head_of_a_sample_file_to_its_target() {
    let Some(asset) = load("Knight.glb") else { return };
    let head = (0..asset.skeleton.len()).find(|j| asset.skeleton.names()[*j].eq_ignore_ascii_case("head"));
    let head = head.expect("the Knight has a head") as u32;
    let mut stage = Stage::default();
    stage.cast("knight", asset.clone());
    stage.actors[0].transform = Placement::at(2.0, 0.0, 1.0).turned(0.4);
    let before = stage.at(secs(0.0)).unwrap();
    let from = joint_world(&before, 0, head);
    let target = from + before.actors[0].world_from_model.transform_vector3(v(1.0, 0.5, 1.5));
    stage.actors[0].look_at.push(LookAt::new(head, Target::Point(target)));
    let after = stage.at(secs(0.0)).unwrap();
    // The direction that is the model's +Z at rest points at the target now.
    let turn = joint_axes(&after.actors[0].model_from_joint[head as usize])
        * joint_axes(&before.actors[0].model_from_joint[head as usize]).inverse();
    let facing = (after.actors[0].world_from_model.matrix3 * turn * DVec3::Z).normalize();
    assert_close(facing, (target - from).normalize(), 1e-5);
}

#[test]
fn attached_sword_stays_at_the_hand_joint_of_a_sample_file() {
    let Some(asset) = load("Knight.glb") else { return };
    let named = |name: &str| asset.skeleton.find(name);
    let hand = named("handslot.r").or(named("hand.r")).expect("the Knight has a right hand") as u32;
    let mut stage = Stage::default();
    stage.cast("knight", asset.clone());
    stage.cast("sword", stick());
    stage.play(0, Cue::new(asset.clips[asset.clips.len() / 2].clone()));
    stage.actors[0].transform = Placement::at(1e5, 0.0, 0.0);
    stage.actors[1].parents = vec![Parenting::always(Attachment { actor: 0, joint: Some(hand) })];
    for i in 0..20 {
        let snapshot = stage.at(secs(f64::from(i) * 0.13)).unwrap();
        assert_close(snapshot.actors[1].world_from_model.translation, joint_world(&snapshot, 0, hand), 1e-9);
    }
}
