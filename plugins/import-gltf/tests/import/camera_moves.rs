//! A camera move and a lamp that Blender exported (`scripts/models/camera_move.py`), on a stage: compared with Blender's matrices.
//!
//! The file is regenerated where Blender (PyPI `bpy`) is available.

use choreo_asset::{LightKind, Projection};
use choreo_motion::Time;
use choreo_stage::{Camera, Cue, Repeat, Rig, Snapshot, Stage};
use glam::{DAffine3, DMat4, DVec3};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The largest differences: of the camera's matrix, of its field of view, of the lamp's place, intensity (as a share) and color.
#[derive(Debug, Default)]
struct CameraError([f64; 5]);

impl CameraError {
    /// Blender's numbers are f32.
    fn is_small(&self) -> bool {
        self.0.iter().all(|d| *d < 5e-6)
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

/// The move in the scene, `delay_secs` seconds later, against Blender's.
fn camera_error(glb: &Path, truth: &Path, delay_secs: f64) -> CameraError {
    let asset = Arc::new(crate::common::import_path(glb).unwrap_or_else(|e| panic!("{e}")));
    assert_eq!(asset.warnings, []);
    let mut stage = Stage::default();
    let actor = stage.cast("move", asset.clone());
    stage.actors[actor].file_lights = true;
    stage.play(actor, Cue { repeat: Repeat::Once, ..Cue::new(asset.clips[0].clone()) });
    stage.cameras.push(Camera::new("", Rig::File { actor, camera: 0 }));
    let truth: Vec<Value> = serde_json::from_slice(&std::fs::read(truth).unwrap()).unwrap();
    assert!(truth.len() >= 13);
    let mut out = CameraError::default();
    for blender in &truth {
        let time = Time::from_secs(blender["secs"].as_f64().unwrap() + delay_secs);
        let snapshot: Snapshot = stage.at(time).unwrap();
        let camera = DAffine3::from_mat4(DMat4::from_cols_slice(&numbers(&blender["camera"])));
        let matrix = snapshot.camera.world_from_view.to_cols_array();
        let matrix =
            matrix.iter().zip(camera.to_cols_array()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let Projection::Perspective { yfov, .. } = snapshot.camera.projection else {
            panic!("no perspective")
        };
        let lamp = &snapshot.lights[0];
        assert!(matches!(lamp.light.kind, LightKind::Point));
        // "Raw": Blender converts a lamp's power, but not its keys.
        let candela = blender["energy"].as_f64().unwrap();
        let color = DVec3::from_slice(&numbers(&blender["color"]));
        let found = [
            matrix,
            (f64::from(yfov) - blender["yfov"].as_f64().unwrap()).abs(),
            lamp.position.distance(DVec3::from_slice(&numbers(&blender["bulb"]))),
            (f64::from(lamp.light.intensity) / candela - 1.0).abs(),
            f64::from((lamp.light.color - color.as_vec3()).abs().max_element()),
        ];
        out.0.iter_mut().zip(found).for_each(|(worst, found)| *worst = worst.max(found));
    }
    out
}

#[test]
fn an_imported_camera_move_equals_blenders() {
    let crate_folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let models = crate_folder.join("../../scripts/models");
    let sample = [models.join("camera_move.glb"), crate_folder.join("tests/samples/camera_move.json")];
    let mut files: Vec<[PathBuf; 2]> = vec![sample.clone()];
    if let Some(python) = choreo_importer_kit_testing::pypi::blender(env!("CARGO_TARGET_TMPDIR")) {
        let made = ["camera_move.glb", "camera_move.json"];
        let made = made.map(|name| Path::new(env!("CARGO_TARGET_TMPDIR")).join(name));
        let run = std::process::Command::new(python).arg(models.join("camera_move.py")).args(&made).output();
        let run = run.unwrap();
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
        files.push(made);
    }
    for [glb, truth] in &files {
        let found = camera_error(glb, truth, 0.0);
        println!("{found:?}");
        assert!(found.is_small(), "{found:?}");
    }
    // A frame late is found in each of them.
    let late = camera_error(&sample[0], &sample[1], 1.0 / 24.0);
    assert!(late.0.iter().all(|d| *d > 1e-3), "{late:?}");
}
