//! Scenes exported to memory and to a folder, for tests of scene exporters.
#![allow(dead_code)]

#[path = "long_time_limits.rs"]
pub(crate) mod long_time_limits;

use crate::common::choreo;
use choreo_asset::{Asset, Topology};
use choreo_plugin::{ExportedScene, ImportScope, MemoryFiles, OptionValue};
use choreo_script::{Limits, Loader, run_file, run_text};
use choreo_stage::{ActorState, Stage};
use glam::{DMat4, DVec3};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The default tolerance of exporters: the allowed position error of a joint, in metres.
pub(crate) const TOLERANCE: f64 = 1e-4;

/// A scene with an actor that is invisible for 0.1 s, a loop, a fade, a rotating texture, a camera that zooms, a cut, and a light that
/// is switched on.
pub(crate) const SCENE: &str = r##"
    stage(#{ size: [320, 180], fps: 24, length: 3.0, background: "#203040" });
    let m = load("choreo:mannequin", #{ color: "coral" });
    let anna = cast("anna", m).at(-0.6, 0, 0);
    anna.play(m.clip("Walk")).until(1.3).then(m.clip("Wave"), #{ fade: 0.4 });
    let ben = cast("ben", load("choreo:mannequin", #{ color: "teal" })).at(0.6, 0, 0).tint("#ffd0d0");
    ben.play(m.clip("Run"), #{ speed: 0.7 });
    ben.key("visible", [[0.0, true], [1.0, false], [1.1, true]]);
    let box = cast("box", shape("box", #{ size: 0.3, checker: "white", color: "navy" }));
    box.attach(anna.joint("RightHand"));
    cast("wheel", shape("quad", #{ size: 0.7, checker: "gold", color: "maroon", spin: 90.0 })).at(-1.5, 0.2, 0);
    camera("wide").fov(40).at(0, 1.2, 4).look_at([0, 0.9, 0]).key("fov", [[0, 40], [1.5, 25]]);
    camera("side").at(3, 1.5, 2.5).look_at([0, 0.9, 0]).cut(2.0);
    sun(#{ direction: [-1, -2, -1] });
    let lamp = point(#{ position: [1, 2, 1], color: "#ffcc88" }).key("intensity", [[0, 0], [2, 12]]);
    ambient("white", 0.3);
"##;

pub(crate) fn scripts() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts")
}

/// All lessons. A lesson in its own folder has plugins beside it, which the program finds.
pub(crate) fn lessons() -> Vec<PathBuf> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(scripts()).unwrap().map(|e| e.unwrap().path()) {
        let inside = entry.join("lesson.rhai");
        if entry.extension().is_some_and(|e| e == "rhai") {
            all.push(entry);
        } else if inside.is_file() {
            all.push(inside);
        }
    }
    all.sort();
    assert!(all.len() >= 45, "{all:?}");
    all
}

/// Imports a file with the built-in importers.
pub(crate) fn import(path: &Path) -> Arc<Asset> {
    let registry = choreo::registry();
    let limits = Limits::default();
    let loader = Arc::new(Loader::for_file(path, &[], &registry, ImportScope::ALL, limits.file).unwrap());
    let name = path.file_name().unwrap().to_str().unwrap();
    loader.load(name, &Default::default()).unwrap_or_else(|e| panic!("{name}: {}", e.message))
}

pub(crate) fn tolerance(metres: f64) -> [(&'static str, OptionValue); 1] {
    [("tolerance", OptionValue::Number(metres))]
}

/// The stage of a lesson.
pub(crate) fn stage_of(lesson: &Path) -> Stage {
    let run = run_file(lesson, &choreo::registry(), &long_time_limits::script_options());
    run.unwrap_or_else(|e| panic!("{}: {e:?}", lesson.display())).stage
}

/// Exports `a.rhai` of the folder, a scene with an effect, which no format supports, with these arguments. Both the JSON summary and the
/// text summary must state the largest error, where it is, and what is left out.
pub(crate) fn check_summaries(dir: &Path, as_json: &[&str], for_people: &[&str]) {
    std::fs::write(dir.join("a.rhai"), format!("{SCENE}\neffect(\"vignette\");")).unwrap();
    let export = |args: &[&str]| choreo(dir, &[&["export", "a.rhai", "-o"], args].concat());
    let run = export(&[as_json, &["--tolerance", "0.001", "--json"]].concat());
    assert_eq!(run.code, 0, "{}", run.err);
    let printed: Value = serde_json::from_str(&run.out).unwrap();
    let worst = &printed["worst_error"];
    let metres = worst["metres"].as_f64().unwrap();
    assert!(
        metres > 1e-6 && metres < 1e-3 && worst["actor"].is_string() && worst["seconds"].is_f64(),
        "{worst}"
    );
    assert!(printed["notes"][0].as_str().unwrap().contains("left out: effects"), "{}", printed["notes"]);
    let run = export(for_people);
    assert!(run.code == 0 && run.err.contains("largest error: "), "{}", run.err);
}

/// The files of an export, in memory and in a folder, in which the main file is `out.EXTENSION`.
pub(crate) struct Exported {
    pub stage: Arc<Stage>,
    pub files: MemoryFiles,
    pub folder: tempfile::TempDir,
    extension: String,
}

impl Exported {
    pub(crate) fn of(stage: Stage, extension: &str, options: &[(&str, OptionValue)]) -> Exported {
        let registry = choreo::registry();
        let exporter = registry.scene_exporter_for(&format!("out.{extension}")).unwrap();
        let mut scene = ExportedScene::new("scene.rhai", Arc::new(stage));
        scene.extension = extension.into();
        scene.options = exporter.manifest().complete(&scene.options).unwrap();
        for (name, value) in options {
            scene.options.0.insert((*name).into(), value.clone());
        }
        let mut files = MemoryFiles::default();
        exporter.export(&scene, &mut files).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let exported = Exported { stage: scene.stage, files, folder, extension: extension.into() };
        exported.write(&exported.files.main);
        exported
    }

    pub(crate) fn from_lesson(path: &Path, extension: &str, options: &[(&str, OptionValue)]) -> Exported {
        Exported::of(stage_of(path), extension, options)
    }

    pub(crate) fn from_script(text: &str, extension: &str, options: &[(&str, OptionValue)]) -> Exported {
        let run = run_text(
            "scene.rhai",
            text,
            &scripts(),
            &choreo::registry(),
            &long_time_limits::script_options(),
        );
        Exported::of(run.unwrap_or_else(|e| panic!("{e:?}")).stage, extension, options)
    }

    pub(crate) fn path(&self) -> PathBuf {
        self.folder.path().join(format!("out.{}", self.extension))
    }

    /// Writes the files into the folder, with these bytes as the main file.
    pub(crate) fn write(&self, main: &[u8]) {
        std::fs::write(self.path(), main).unwrap();
        for (ending, bytes) in &self.files.beside {
            std::fs::write(self.folder.path().join(format!("out{ending}")), bytes).unwrap();
        }
    }
}

/// Times between frames, spread over the stage.
pub(crate) fn times_between_frames(stage: &Stage) -> Vec<f64> {
    (0..20).map(|i| stage.settings.length.as_secs() * (f64::from(i) + 0.377) / 20.0).collect()
}

/// World positions of the vertices of each primitive of triangles, in f64.
pub(crate) fn world_vertices(asset: &Asset, state: &ActorState) -> Vec<Vec<DVec3>> {
    let in_world = |joint: u32| -> DMat4 { DMat4::from(state.world_from_joint(joint as usize).unwrap()) };
    let mut out = Vec::new();
    for (number, instance) in asset.instances.iter().enumerate() {
        for primitive in &asset.meshes[instance.mesh as usize].primitives {
            if primitive.indices.is_empty() || primitive.topology != Topology::Triangles {
                continue;
            }
            let skin = instance.skin.filter(|_| primitive.influences > 0).map(|s| &asset.skins[s as usize]);
            let weights = state.morph_weights.get(number);
            let place = |vertex: usize| -> DVec3 {
                let mut at = primitive.positions[vertex].as_dvec3();
                for (morph, weight) in primitive.morphs.iter().zip(weights.into_iter().flatten()) {
                    let offset = morph.positions.get(vertex).map_or(DVec3::ZERO, |o| o.as_dvec3());
                    at += offset * f64::from(*weight);
                }
                let Some(skin) = skin else { return in_world(instance.joint).transform_point3(at) };
                let range = vertex * primitive.influences..(vertex + 1) * primitive.influences;
                let influences =
                    primitive.joint_indices[range.clone()].iter().zip(&primitive.joint_weights[range]);
                influences
                    .filter(|(_, weight)| **weight != 0.0)
                    .map(|(joint, weight)| {
                        let index = usize::from(*joint);
                        let map = in_world(skin.joints[index]) * skin.inverse_bind[index].as_dmat4();
                        map.transform_point3(at) * f64::from(*weight)
                    })
                    .sum()
            };
            out.push((0..primitive.positions.len()).map(place).collect());
        }
    }
    out
}
