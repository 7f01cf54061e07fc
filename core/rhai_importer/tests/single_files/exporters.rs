//! Exporters in Rhai on a scene made here: the written files, and the error messages.

use choreo_motion::{FrameRate, Time, Transform};
use choreo_plugin::stage::Stage;
use choreo_plugin::{AssetBuilder, ExportError, ExportedScene, MemoryFiles, SceneExporter, SceneFiles};
use choreo_rhai_importer::RhaiExporter;
use glam::{DVec3, Quat, Vec3};
use std::io::{Error, Write};
use std::sync::Arc;

/// An upper arm, turned upwards by 90°, with a hand 0.5 m along it, 2 m beside the origin: two frames.
fn scene() -> ExportedScene {
    let mut builder = AssetBuilder::default();
    let up = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    let arm = builder.joint("arm", None, Transform { rotation: up, ..Transform::IDENTITY }).unwrap();
    let hand = Transform { translation: Vec3::X * 0.5, ..Transform::IDENTITY };
    builder.joint("hand", Some(arm), hand).unwrap();
    let mut stage = Stage::default();
    let ada = stage.cast("ada", Arc::new(builder.finish("arm").unwrap()));
    stage.actors[ada].transform.translation = DVec3::X * 2.0;
    stage.settings.fps = FrameRate { num: 4, den: 1 };
    stage.settings.length = Time::from_secs(0.5);
    ExportedScene::new("a.rhai", Arc::new(stage))
}

fn exporter(body: &str) -> RhaiExporter {
    let text =
        format!("fn manifest() {{ #{{ name: \"t\", extensions: \"t\" }} }}\nfn save(scene) {{\n{body}\n}}\n");
    RhaiExporter::from_text("t.exporter.rhai", &text).unwrap()
}

fn export_files(body: &str) -> MemoryFiles {
    let mut files = MemoryFiles::default();
    exporter(body).export(&scene(), &mut files).unwrap();
    files
}

fn export_error(body: &str) -> String {
    exporter(body).export(&scene(), &mut MemoryFiles::default()).unwrap_err().to_string()
}

#[test]
fn exported_joints_have_world_positions_and_rotations() {
    let files = export_files(
        "for seconds in scene.times { for actor in pose(seconds).actors { for joint in actor.joints {
            let angle = 2.0 * asin(joint.rotation[2]) / radians(1.0);
            let rounded = [];
            for v in [joint.x, joint.y, joint.z, angle] { rounded.push(round(v * 1000.0).to_int()); }
            writeln(`${seconds} ${actor.name} ${joint.name} ${joint.parent} ${rounded}`);
        } } }",
    );
    let expected = "0.0 ada arm -1 [2000, 0, 0, 90000]\n0.0 ada hand 0 [2000, 500, 0, 90000]\n\
        0.25 ada arm -1 [2000, 0, 0, 90000]\n0.25 ada hand 0 [2000, 500, 0, 90000]\n";
    assert_eq!(String::from_utf8(files.main).unwrap(), expected);
}

#[test]
fn exporter_writes_extra_files_and_notes() {
    let text = "for i in 0..20000 { write(\"0123456789\"); }\nwrite_to(\"_2.txt\", scene.stem + scene.actors[0].joints);\nnote(\"no colors\");";
    let mut files = MemoryFiles::default();
    let notes = exporter(text).export(&scene(), &mut files).unwrap();
    assert_eq!((files.main.len(), notes), (200_000, vec!["no colors".to_string()]));
    assert_eq!(files.beside["_2.txt"], b"out[\"arm\", \"hand\"]");
}

#[test]
fn exporter_errors_state_their_place() {
    assert_eq!(
        export_error("writeln(jointless);"),
        "t.exporter.rhai:3:9: unknown variable jointless\n    writeln(jointless);\n            ^"
    );
    assert_eq!(
        export_error("notes(\"a\");"),
        "t.exporter.rhai:3:1: unknown function notes; did you mean \"note\"?\n    notes(\"a\");\n    ^"
    );
    assert!(export_error("loop { }").contains("which is the limit"));
    let faulty =
        RhaiExporter::from_text("t.exporter.rhai", "fn manifest() { #{ name: \"t\" } }").err().unwrap();
    assert_eq!(faulty.to_string(), "t.exporter.rhai:1:1: an exporter needs fn save(scene)");
}

/// A disk that is full.
struct FullDisk;

impl Write for FullDisk {
    fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
        Err(Error::other("no space left"))
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl SceneFiles for FullDisk {
    fn main(&mut self) -> &mut dyn Write {
        self
    }
    fn beside(&mut self, _: &str) -> Result<&mut dyn Write, ExportError> {
        Ok(self)
    }
}

#[test]
fn write_error_ends_an_endless_exporter() {
    let endless = exporter("loop { writeln(\"0123456789\"); }");
    let error = endless.export(&scene(), &mut FullDisk).unwrap_err().to_string();
    assert_eq!(error, "cannot write: no space left");
}
