//! Positions of joints in the file, read by the importer of BVH, against those of the stage at every frame.

use choreo_importer_kit_testing::{Companions, options, pose, source};
use choreo_plugin::glam::{Affine3A, DQuat, DVec3, Quat, Vec3};
use choreo_plugin::motion::{Curve, FrameRate, Interpolation, Path, Time, Transform};
use choreo_plugin::stage::{Cue, Placement, Stage};
use choreo_plugin::{
    AssetBuilder, ExportedScene, ImportScope, Importer, MemoryFiles, OptionValue, SceneExporter,
};
use export_bvh::BvhExporter;
use import_bvh::BvhImporter;
use std::sync::Arc;

fn curve(joint: u32, path: Path, values: Vec<f32>) -> Curve {
    let keys = values.len() / if path == Path::Rotation { 4 } else { 3 };
    let times = (0..keys).map(|key| Time::from_secs(key as f64 * 0.5)).collect();
    Curve { joint, path, interpolation: Interpolation::Linear, times, values: values.into() }
}

fn rotations(all: &[Quat]) -> Vec<f32> {
    all.iter().flat_map(|q| q.to_array()).collect()
}

/// An armature in centimetres with an arm whose rest pose is turned, a forearm that turns through all of a circle, straight up and down,
/// and a hand that slides. The actor stands beside the origin, turned and enlarged.
fn stage(roots: usize) -> Stage {
    let mut builder = AssetBuilder::default();
    let place = |x: f32, y: f32, z: f32| Transform { translation: Vec3::new(x, y, z), ..Transform::IDENTITY };
    let armature = Transform {
        scale: Vec3::splat(0.01),
        rotation: Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2),
        ..Transform::IDENTITY
    };
    let root = builder.joint("Arm ature", None, armature).unwrap();
    let turned =
        Transform { rotation: Quat::from_euler(glam_order(), 0.4, -1.1, 0.7), ..place(0.0, 10.0, 90.0) };
    let arm = builder.joint("arm", Some(root), turned).unwrap();
    let fore = builder.joint("forearm", Some(arm), place(30.0, 0.0, 0.0)).unwrap();
    let hand = builder.joint("hand", Some(fore), place(0.0, 25.0, 5.0)).unwrap();
    let finger = builder.joint("finger", Some(hand), place(0.0, 8.0, 0.0)).unwrap();
    builder.joint("other", Some(arm), place(-30.0, 0.0, 0.0)).unwrap();
    for extra in 1..roots {
        builder.joint(&format!("prop{extra}"), None, place(0.0, 0.5, extra as f32)).unwrap();
    }
    let circle: Vec<Quat> = (0..5).map(|key| Quat::from_rotation_x(key as f32 * 1.9)).collect();
    let around: Vec<Quat> = (0..5).map(|key| Quat::from_rotation_z(key as f32 * 1.3)).collect();
    builder.clip(
        "wave",
        vec![
            curve(arm, Path::Rotation, rotations(&around)),
            curve(fore, Path::Rotation, rotations(&circle)),
            curve(hand, Path::Translation, vec![0.0, 25.0, 5.0, 3.0, 30.0, 0.0, 0.0, 25.0, 5.0]),
            curve(finger, Path::Rotation, rotations(&circle)),
        ],
    );
    let asset = Arc::new(builder.finish("arm").unwrap());
    let mut stage = Stage::default();
    let ada = stage.cast("ada", asset.clone());
    stage.actors[ada].transform = Placement {
        translation: DVec3::new(2.0, 0.1, -3.0),
        rotation: DQuat::from_rotation_y(2.1),
        scale: DVec3::splat(1.25),
    };
    stage.play(ada, Cue::new(asset.clips[0].clone()));
    stage.settings.fps = FrameRate { num: 24, den: 1 };
    stage.settings.length = Time::from_secs(2.0);
    stage
}

fn glam_order() -> choreo_plugin::glam::EulerRot {
    choreo_plugin::glam::EulerRot::YXZ
}

fn exported(scene: &ExportedScene) -> String {
    let mut files = MemoryFiles::default();
    BvhExporter.export(scene, &mut files).unwrap_or_else(|e| panic!("{e}"));
    String::from_utf8(files.main).unwrap()
}

/// Worst distance in metres of a joint of the file from that of the same name on stage, at any frame.
fn worst_joint_distance(text: &str, scene: &ExportedScene) -> f64 {
    let given = options(&BvhImporter, &[("scale", OptionValue::Number(0.01))]);
    let file = source("a.bvh", text.as_bytes());
    let asset = BvhImporter.import(&file, &Companions::none(), ImportScope::ALL, &given).unwrap();
    let names = asset.skeleton.names();
    let mut evaluator = scene.evaluator();
    let mut worst = 0.0f64;
    for time in &scene.times {
        let state = &evaluator.at(*time).unwrap().actors[0];
        let read: Vec<Affine3A> = pose::at(&asset, Some(0), time.as_secs());
        for (joint, name) in scene.stage.actors[0].asset.skeleton.names().iter().enumerate() {
            let name = name.replace(' ', "_");
            let index = names.iter().position(|known| *known == name).unwrap_or_else(|| panic!("{name}"));
            let truth = state.world_from_joint(joint).unwrap().translation;
            worst = worst.max((Vec3::from(read[index].translation).as_dvec3() - truth).length());
        }
    }
    worst
}

#[test]
fn exported_joints_are_where_the_stage_has_them() {
    for roots in [1, 3] {
        let scene = ExportedScene::new("a.rhai", Arc::new(stage(roots)));
        let text = exported(&scene);
        let error = worst_joint_distance(&text, &scene);
        println!("{roots} roots: {error:.1e} m");
        assert!(error < 3e-6, "{roots} roots: {error}");
        // A fault is seen: the last number of a frame in the middle is the finger's angle about y, the one before the last about x.
        let mut lines: Vec<String> = text.lines().map(str::to_string).collect();
        let middle = lines.len() - 20;
        lines[middle] = lines[middle - 1].clone();
        assert!(worst_joint_distance(&(lines.join("\n") + "\n"), &scene) > 1e-3);
    }
}

#[test]
fn angles_are_continuous_and_only_moving_joints_have_positions() {
    let scene = ExportedScene::new("a.rhai", Arc::new(stage(1)));
    let text = exported(&scene);
    // The root and the hand.
    assert_eq!(text.matches("CHANNELS 6").count(), 2, "{text}");
    let frames: Vec<Vec<f64>> = text
        .lines()
        .skip_while(|line| !line.starts_with("Frame Time"))
        .skip(1)
        .map(|line| line.split(' ').map(|number| number.parse().unwrap()).collect())
        .collect();
    assert_eq!(frames.len(), 48);
    // The forearm's turn of 1.9 rad in half a second is 9.1 degrees a frame; through gimbal lock angles may change faster.
    let steps = frames.windows(2).flat_map(|pair| pair[0].iter().zip(&pair[1]).map(|(a, b)| (a - b).abs()));
    assert!(steps.fold(0.0, f64::max) < 120.0);
}

#[test]
fn the_actor_is_chosen_by_name() {
    let mut stage = stage(1);
    let asset = stage.actors[0].asset.clone();
    stage.cast("boris", asset);
    let mut scene = ExportedScene::new("a.rhai", Arc::new(stage));
    let refused = |scene: &ExportedScene| {
        BvhExporter.export(scene, &mut MemoryFiles::default()).unwrap_err().to_string()
    };
    assert_eq!(refused(&scene), "BVH holds one actor; choose it with --export actor=NAME: ada, boris");
    scene.options.0.insert("actor".into(), OptionValue::Text("bors".into()));
    assert_eq!(refused(&scene), "no actor is called \"bors\"; did you mean \"boris\"?");
    scene.options.0.insert("actor".into(), OptionValue::Text("boris".into()));
    assert!(exported(&scene).contains("ROOT Arm_ature"));
    scene.times.remove(3);
    assert_eq!(refused(&scene), "BVH has one frame time; give --frames in even steps");
}
