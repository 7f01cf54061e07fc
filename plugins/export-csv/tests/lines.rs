//! The lines of a scene whose positions are known.

use choreo_plugin::glam::{DVec3, Quat, Vec3};
use choreo_plugin::motion::{FrameRate, Time, Transform};
use choreo_plugin::stage::Stage;
use choreo_plugin::{AssetBuilder, ExportedScene, MemoryFiles, OptionValue, SceneExporter};
use export_csv::CsvExporter;
use std::sync::Arc;

/// An upper arm, turned upwards by 90°, with a hand 0.5 m along it, 2 m beside the origin: two frames.
fn scene() -> ExportedScene {
    let mut builder = AssetBuilder::default();
    let up = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    let arm = builder.joint("arm", None, Transform { rotation: up, ..Transform::IDENTITY }).unwrap();
    let hand = Transform { translation: Vec3::X * 0.5, ..Transform::IDENTITY };
    builder.joint("hand, left", Some(arm), hand).unwrap();
    let mut stage = Stage::default();
    let ada = stage.cast("ada", Arc::new(builder.finish("arm").unwrap()));
    stage.actors[ada].transform.translation = DVec3::X * 2.0;
    stage.settings.fps = FrameRate { num: 4, den: 1 };
    stage.settings.length = Time::from_secs(0.5);
    ExportedScene::new("a.rhai", Arc::new(stage))
}

fn exported(scene: &ExportedScene) -> String {
    let mut files = MemoryFiles::default();
    assert!(CsvExporter.export(scene, &mut files).unwrap().is_empty() && files.beside.is_empty());
    String::from_utf8(files.main).unwrap()
}

#[test]
fn each_frame_has_a_line_for_each_joint() {
    let expected = "seconds,actor,joint,x,y,z\n\
        0.000000,ada,arm,2.000000,0.000000,0.000000\n\
        0.000000,ada,\"hand, left\",2.000000,0.500000,0.000000\n\
        0.250000,ada,arm,2.000000,0.000000,0.000000\n\
        0.250000,ada,\"hand, left\",2.000000,0.500000,0.000000\n";
    assert_eq!(exported(&scene()), expected);
}

#[test]
fn the_digits_option_sets_the_decimal_places() {
    let mut scene = scene();
    scene.options.0.insert("digits".into(), OptionValue::Number(1.0));
    scene.times.truncate(1);
    assert!(exported(&scene).ends_with("hand, left\",2.0,0.5,0.0\n"), "{}", exported(&scene));
}
