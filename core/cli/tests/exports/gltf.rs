//! `choreo export -o scene.glb`: if the file is imported again, its joints at times between frames and its images are those of the scene,
//! also in other programs. `cargo test -p choreo --test exports gltf -- --nocapture` prints the table.
//!
//! `--ignored` tests the images of all lessons.

use crate::exported;
use crate::gltf_validator;

use crate::common::*;
use choreo_asset::Asset;
use choreo_image_diff::{Comparison, compare};
use choreo_importer_kit_testing::npm::Packages;
use choreo_motion::Time;
use choreo_plugin::{Frame, OptionValue};
use choreo_render::{CpuRenderer, Plan, PlanOptions, Renderer, SceneResources};
use choreo_stage::{Camera, Cue, Cut, Evaluator, Repeat, Rig, Stage};
use exported::*;
use gltf_validator::validate;
use serde_json::Value;
use std::path::Path;
use std::sync::Arc;

const SIZE: [u32; 2] = [320, 180];

/// Scripts with fades, layers, IK, root motion, callbacks, attached props, several cameras, springs and other characters.
const LESSONS: [&str; 6] = [
    "01_first_dance.rhai",
    "07_keys_and_frames.rhai",
    "11_root_motion.rhai",
    "12_together.rhai",
    "15_reaching.rhai",
    "38_bodies_and_chains.rhai",
];

/// The parts of an exported glTF file that the tests read.
trait Gltf {
    fn json(&self) -> Value;
    fn imported_stage(&self) -> Stage;
}

impl Gltf for Exported {
    /// The JSON of the file.
    fn json(&self) -> Value {
        let main = &self.files.main;
        match main.strip_prefix(b"glTF") {
            Some(rest) => {
                let length = u32::from_le_bytes(rest[8..12].try_into().unwrap()) as usize;
                serde_json::from_slice(&main[20..20 + length]).unwrap()
            }
            None => serde_json::from_slice(main).unwrap(),
        }
    }

    /// The imported file as a scene with one actor that plays the timeline, with the settings and cuts of the original.
    fn imported_stage(&self) -> Stage {
        let asset = import(&self.path());
        let mut stage = Stage { settings: self.stage.settings.clone(), ..Stage::default() };
        let shots: Vec<Value> =
            self.json()["nodes"].as_array().unwrap().iter().map(|n| n["extras"].clone()).collect();
        let starts = shots.iter().filter_map(|extras| extras["start"].as_f64());
        let actor = stage.cast("again", asset.clone());
        for (camera, start) in starts.enumerate() {
            stage.cameras.push(Camera::new("", Rig::File { actor, camera: camera as u32 }));
            stage.cuts.push(Cut::new(Time::from_secs(start), camera));
        }
        if let Some(clip) = asset.clips.first() {
            stage.play(actor, Cue { repeat: Repeat::Once, ..Cue::new(clip.clone()) });
        }
        stage
    }
}

fn import(path: &Path) -> Arc<Asset> {
    let asset = exported::import(path);
    assert!(asset.warnings.iter().all(|w| w.text.contains("thin, rough wall")), "{:?}", asset.warnings);
    asset
}

/// Maps the joints of each actor to joints of the imported file: the importer numbers nodes depth first.
struct Joints {
    of_node: Vec<usize>,
    /// The node of the first joint of each exported actor.
    actors: Vec<Option<usize>>,
}

impl Joints {
    fn of(exported: &Exported) -> Joints {
        let json = exported.json();
        let nodes = json["nodes"].as_array().unwrap();
        let numbers = |list: &Value| -> Vec<usize> {
            list.as_array().into_iter().flatten().map(|n| n.as_u64().unwrap() as usize).collect()
        };
        let roots = numbers(&json["scenes"][0]["nodes"]);
        let (mut of_node, mut count) = (vec![usize::MAX; nodes.len()], 0);
        let mut stack: Vec<usize> = roots.iter().rev().copied().collect();
        while let Some(node) = stack.pop() {
            of_node[node] = count;
            count += 1;
            stack.extend(numbers(&nodes[node]["children"]).into_iter().rev());
        }
        let mut left = roots.into_iter().filter(|r| nodes[*r]["mesh"].is_null()).peekable();
        let actors = exported
            .stage
            .actors
            .iter()
            .map(|actor| left.next_if(|root| nodes[*root]["name"] == *actor.name).map(|root| root + 1));
        Joints { actors: actors.collect(), of_node }
    }
}

/// The largest error of a joint at 20 times between frames, with the joint and the time. Invisible actors are ignored.
fn worst_joint_error(exported: &Exported) -> (f64, String) {
    let stage = &exported.stage;
    let imported = Arc::new(exported.imported_stage());
    let joints = Joints::of(exported);
    let (mut one, mut other) = (Evaluator::new(stage.clone()), Evaluator::new(imported).posing_hidden());
    let mut worst = (0.0, String::new());
    for time in times_between_frames(stage).into_iter().map(Time::from_secs) {
        let (truth, found) = (one.at(time).unwrap(), other.at(time).unwrap());
        for ((actor, state), first) in stage.actors.iter().zip(&truth.actors).zip(&joints.actors) {
            // An actor with placements has nodes for these instead of joints.
            if !state.visible || !actor.asset.placements.is_empty() {
                continue;
            }
            let first = first.unwrap_or_else(|| panic!("\"{}\" is seen, but not there", actor.name));
            for (joint, name) in actor.asset.skeleton.names().iter().enumerate() {
                let Some(a) = state.world_from_joint(joint) else { continue };
                let b = found.actors[0].world_from_joint(joints.of_node[first + joint]).unwrap();
                let apart = a.translation.distance(b.translation);
                if apart > worst.0 {
                    worst = (apart, format!("{} {name} at {:.4} s", actor.name, time.as_secs()));
                }
            }
        }
    }
    worst
}

fn draw(stage: &Stage, time: Time) -> Frame {
    let mut renderer = CpuRenderer::new(&[]);
    let snapshot = stage.at(time).unwrap();
    let resources = Arc::new(SceneResources::new(stage));
    renderer.load(resources.clone()).unwrap();
    let plan = Plan::new(&resources, stage, &snapshot, &PlanOptions::new(SIZE, 1));
    renderer.submit(plan).unwrap();
    renderer.collect(None).unwrap()
}

/// Images of the scene without the features that glTF cannot express, and images of the file.
fn compare_images(exported: &Exported, share: f64) -> (Comparison, Frame, Frame) {
    let mut own = Stage::clone(&exported.stage);
    (own.effects, own.layers_2d, own.settings.size) = (Vec::new(), Vec::new(), SIZE);
    own.lights.iter_mut().for_each(|light| light.shadow = None);
    let mut imported = exported.imported_stage();
    // The sky is not exported, and levels of detail differ because the file is a single model.
    imported.sky = own.sky.clone();
    own.settings.levels_of_detail = false;
    (imported.settings.levels_of_detail, imported.settings.size) = (false, SIZE);
    let time = Time::from_secs(own.settings.length.as_secs() * share);
    let (a, b) = (draw(&own, time), draw(&imported, time));
    (compare(&a, &b, 3).unwrap(), a, b)
}

fn is_same(c: &Comparison) -> bool {
    c.mean < 0.3 && c.share_beyond < 0.006
}

#[test]
fn exported_joints_of_lessons_match_the_scene_between_frames() {
    for name in LESSONS {
        let exported = Exported::from_lesson(&scripts().join(name), "glb", &[]);
        let (metres, place) = worst_joint_error(&exported);
        let stated = exported.files.deviation.clone().unwrap();
        println!(
            "{name}: {metres:.1e} m, {place}; it states {:.1e} m, {} {}",
            stated.metres, stated.actor, stated.joint
        );
        assert!(metres < TOLERANCE && stated.metres < TOLERANCE, "{name}: {metres:e} m, {place}; {stated:?}");
    }
}

#[test]
fn images_of_the_exported_file_match_the_scene() {
    let exported = Exported::from_script(SCENE, "glb", &[]);
    let (metres, place) = worst_joint_error(&exported);
    assert!(metres < TOLERANCE, "{metres:e} m, {place}");
    for share in [0.1, 0.35, 0.5, 0.8] {
        let (c, own, imported) = compare_images(&exported, share);
        println!("at {share} of the scene: {c}");
        assert!(is_same(&c), "at {share} of the scene: {c}");
        save_images(&format!("{share}"), [&own, &imported]);
    }
    let stated: Vec<f64> = exported.json()["nodes"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|n| n["extras"]["end"].as_f64())
        .collect();
    assert_eq!(stated, [2.0, 3.0], "the ends of the shots");
}

/// Writes the images of a scene and of its file into the folder that the environment variable names, for inspection.
fn save_images(name: &str, images: [&Frame; 2]) {
    let Some(folder) = std::env::var_os("CHOREO_KEEP_IMAGES") else { return };
    std::fs::create_dir_all(&folder).unwrap();
    for (frame, whose) in images.into_iter().zip(["own", "again"]) {
        let path = Path::new(&folder).join(format!("{name}_{whose}.png"));
        image::save_buffer(path, &frame.rgba, frame.width, frame.height, image::ColorType::Rgba8).unwrap();
    }
}

/// The comparison with the scene finds each planted fault of the file.
#[test]
fn planted_faults_are_found() {
    let exported = Exported::from_script(SCENE, "gltf", &[]);
    assert!(worst_joint_error(&exported).0 < TOLERANCE);
    assert!(is_same(&compare_images(&exported, 0.35).0));
    let json = exported.json();
    // A key time that is 20 ms late.
    let sampler = &json["animations"][0]["samplers"][1];
    let accessor = &json["accessors"][sampler["input"].as_u64().unwrap() as usize];
    let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let offset = |v: &Value| v["byteOffset"].as_u64().unwrap_or(0) as usize;
    let at = offset(accessor) + offset(view) + 4 * (accessor["count"].as_u64().unwrap() as usize - 1);
    let mut bytes = exported.files.beside[".bin"].clone();
    for key in (offset(accessor) + offset(view) + 4..=at).step_by(4) {
        let time = f32::from_le_bytes(bytes[key..key + 4].try_into().unwrap());
        bytes[key..key + 4].copy_from_slice(&(time + 0.02).to_le_bytes());
    }
    std::fs::write(exported.folder.path().join("out.bin"), &bytes).unwrap();
    let (metres, place) = worst_joint_error(&exported);
    println!("late keys: {metres:.1e} m, {place}");
    assert!(metres > 2.0 * TOLERANCE, "late keys are not found: {metres:e} m");
    exported.write(&exported.files.main);
    // Two joints of a skin are exchanged: the joints stay in place, the vertices do not.
    let mut wrong = json.clone();
    wrong["skins"][0]["joints"].as_array_mut().unwrap().swap(3, 14);
    std::fs::write(exported.path(), wrong.to_string()).unwrap();
    let c = compare_images(&exported, 0.35).0;
    println!("joints in the wrong order: {c}");
    assert!(!is_same(&c), "joints in the wrong order are not found: {c}");
}

/// An importer for a format in which the file is the image.
const TILE: &str = "fn manifest() { #{ name: \"tile\", extensions: \"tile\" } }\n\n\
    fn load(file) {\n    let look = material(#{ image: image(#{ file: file.bytes }) });\n    \
    mesh(#{ positions: [0, 0, 0, 1, 0, 0, 0, 1, 0], uvs: [0, 1, 1, 1, 0, 0], indices: [0, 1, 2], material: look });\n}\n";

/// A scene with five images from files, one of them read by an importer beside it and one changed by the script. Returns the exported
/// files, and the bytes of the unchanged images.
fn script_with_image_files() -> (tempfile::TempDir, [Vec<u8>; 4]) {
    let dir = tempfile::tempdir().unwrap();
    let image = image::RgbImage::from_fn(32, 16, |x, y| image::Rgb([(8 * x) as u8, (16 * y) as u8, 99]));
    let names = ["a.png", "b.jpg", "c.webp"];
    names.iter().for_each(|name| image.save(dir.path().join(name)).unwrap());
    image::imageops::rotate180(&image).save(dir.path().join("d.jpg")).unwrap();
    std::fs::rename(dir.path().join("d.jpg"), dir.path().join("d.tile")).unwrap();
    std::fs::write(dir.path().join("tile.importer.rhai"), TILE).unwrap();
    let mut text = String::from("stage(#{ length: 0.1 });\n");
    for name in names {
        text += &format!("cast(\"{name}\", shape(\"quad\", #{{ image: image(\"{name}\") }}));\n");
    }
    text += "cast(\"tile\", load(\"d.tile\"));\n\
             cast(\"holes\", shape(\"quad\", #{ image: image(\"a.png\"), opacity_map: image(\"b.jpg\") }));\n\
             sun(); camera(\"c\").at(0, 0, 3);\n";
    std::fs::write(dir.path().join("s.rhai"), text).unwrap();
    let bytes = ["a.png", "b.jpg", "c.webp", "d.tile"].map(|name| read_file(dir.path(), name));
    (dir, bytes)
}

/// If the scene uses an image unchanged, the export contains its file unchanged.
#[test]
fn unchanged_image_files_are_exported_byte_for_byte() {
    let (dir, originals) = script_with_image_files();
    let d = dir.path();
    for (output, endings) in [
        ("s.gltf", ["s_0.png", "s_1.jpg", "s_2.webp", "s_3.jpg", "s_4.png"]),
        // USDZ and usd-core do not support WebP.
        ("s.usda", ["s_0.png", "s_1.jpg", "s_2.png", "s_3.jpg", "s_4.png"]),
    ] {
        let run = choreo(d, &["export", "s.rhai", "-o", output]);
        assert_eq!(run.code, 0, "{}", run.err);
        for (number, ending) in endings.iter().enumerate() {
            let written = read_file(d, ending);
            let same = originals.get(number).is_some_and(|original| *original == written);
            assert_eq!(same, [0, 1, 3].contains(&number) || ending.ends_with("webp"), "{ending} of {output}");
            // An image that is encoded again has the same size, and transparent pixels if the script adds them.
            let image = image::load_from_memory(&written).unwrap();
            assert_eq!((image.width(), image.height()), (32, 16));
            assert_eq!(image.color().has_alpha(), number == 4, "{ending} of {output}");
        }
        endings.iter().for_each(|ending| std::fs::remove_file(d.join(ending)).unwrap());
    }
    for output in ["s.glb", "t.gltf"] {
        assert_eq!(choreo(d, &["export", "s.rhai", "-o", output]).code, 0);
    }
    validate(&[d.join("s.glb"), d.join("t.gltf")]);
    let glb = read_file(d, "s.glb");
    let is_there = |original: &Vec<u8>| glb.windows(original.len()).any(|part| part == original);
    assert!(originals.iter().all(is_there));
    // The images of the file are those of the scene, including WebP.
    let imported = import(&d.join("s.glb"));
    let sizes: Vec<(u32, u32)> = imported.images.iter().map(|image| (image.width, image.height)).collect();
    assert_eq!(sizes, [(32, 16); 5]);
    // For a render, only the pixels are kept in memory, not the file.
    assert!(imported.images.iter().all(|image| image.file.is_none()));
}

#[test]
fn each_actor_can_have_an_animation() {
    let exported =
        Exported::from_script(SCENE, "gltf", &[("animations", OptionValue::Text("actors".into()))]);
    let json = exported.json();
    let names: Vec<&str> =
        json["animations"].as_array().unwrap().iter().map(|a| a["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["anna", "ben", "box", "wheel", "cameras and lights"]);
    // The buffer and the images are separate files beside the JSON.
    let beside: Vec<&str> = exported.files.beside.keys().map(String::as_str).collect();
    assert_eq!(beside, [".bin", "_0.png", "_1.png"]);
}

#[test]
fn a_larger_tolerance_gives_smaller_files_within_the_tolerance() {
    let sizes = [1e-5, 1e-4, 1e-2].map(|tolerance| {
        let exported = Exported::from_script(SCENE, "glb", &exported::tolerance(tolerance));
        let (metres, place) = worst_joint_error(&exported);
        println!("{tolerance} m: {} bytes, {metres:.1e} m, {place}", exported.files.main.len());
        assert!(metres <= tolerance, "{tolerance} m: {metres:e} m, {place}");
        exported.files.main.len()
    });
    assert!(sizes[0] > sizes[1] && sizes[1] > sizes[2], "{sizes:?}");
}

#[test]
fn clips_that_play_unchanged_keep_their_keys() {
    let text = r#"
        stage(#{ length: 2.0 });
        let m = load("choreo:mannequin");
        for i in 0..20 { cast("dancer " + i, m).at(0.05 * i, 0, 0).play(m.clip("Walk")).from(-0.5 * (i % 2)); }
        camera("c").at(0, 1, 5);"#;
    let exported = Exported::from_script(text, "glb", &[]);
    let (metres, place) = worst_joint_error(&exported);
    // The keys are as exact as f32 times.
    assert!(metres < 2e-6, "{metres:e} m, {place}");
    let json = exported.json();
    let count = |name: &str| json[name].as_array().unwrap().len();
    assert_eq!((count("meshes"), count("skins")), (1, 20));
    // There are only two motions, however many actors play them.
    let channels = json["animations"][0]["channels"].as_array().unwrap().len();
    let samplers = json["animations"][0]["samplers"].as_array().unwrap().len();
    assert_eq!(channels, 10 * samplers);
}

/// A clip in place, whose feet move backwards over the floor at 1.2 m/s.
#[test]
fn clips_become_animations_with_the_requested_root_motion() {
    let text = r#"
        stage(#{ length: 2.0 });
        let m = load("choreo:mannequin");
        let ada = cast("ada", m).at(1.0, 0, 0);
        ada.play(m.clip("Walk")).until(1.0).then(m.clip("Wave"), #{ fade: 0.3 });
        cast("ben", m).play(m.clip("Walk"));
        let small = load("choreo:mannequin", #{ height: 1.2 });
        cast("cleo", small).play(m.clip("Walk"));
        camera("c").at(0, 1, 5);"#;
    let moved = |root: &str| {
        let options = [("animations", "clips"), ("root_motion", root)];
        let options = options.map(|(name, value)| (name, OptionValue::Text(value.into())));
        let exported = Exported::from_script(text, "glb", &options);
        let asset = import(&exported.path());
        let names: Vec<&str> = asset.clips.iter().map(|clip| clip.name.as_str()).collect();
        assert_eq!(names, ["Walk", "Wave", "cleo Walk"]);
        let mut stage = Stage::default();
        let actor = stage.cast("again", asset.clone());
        stage.play(actor, Cue { repeat: Repeat::Once, ..Cue::new(asset.clips[0].clone()) });
        let state = stage.at(Time::from_secs(0.999)).unwrap().actors.remove(0);
        let own = exported.stage.actors[0].asset.skeleton.names();
        // Compared with the clip itself: the joints of the first actor come first in the file, after its node.
        let mut truth = Stage::default();
        let ada = truth.cast("ada", exported.stage.actors[0].asset.clone());
        truth.play(ada, Cue::new(exported.stage.actors[0].layers[0].cues[0].clip.clone()));
        let truth = truth.at(Time::from_secs(0.999)).unwrap().actors.remove(0);
        let hips = own.iter().position(|name| name.ends_with("Hips")).unwrap();
        let [a, b] =
            [truth.world_from_joint(hips), state.world_from_joint(hips + 1)].map(|m| m.unwrap().translation);
        b - a
    };
    for (root, z) in [("clip", 0.0), ("in_place", 0.0), ("traveling", 1.2)] {
        let way = moved(root);
        println!("{root}: {way}");
        assert!(
            (way.x - 1.0).abs() < 2e-3 && way.y.abs() < 1e-3 && (way.z - z).abs() < 0.02,
            "{root}: {way}"
        );
    }
}

#[test]
fn the_summary_states_the_largest_error_and_what_is_left_out() {
    let dir = tempfile::tempdir().unwrap();
    check_summaries(dir.path(), &["a.glb"], &["b.gltf", "--split", "actors"]);
    assert_eq!(file_names(dir.path()), ["a.glb", "a.rhai", "b.bin", "b.gltf", "b_0.png", "b_1.png"]);
}

#[test]
fn the_khronos_validator_accepts_a_gltf_file_with_separate_buffers() {
    validate(&[Exported::from_script(SCENE, "gltf", &[]).path()]);
}

/// The largest distance in metres of a joint in three.js from its position in the scene `delay` seconds later, and where it is.
fn worst_joint_error_in_three_js(three: &Packages, exported: &Exported, delay: f64) -> (f64, String) {
    let stage = &exported.stage;
    let times = times_between_frames(stage);
    let file = exported.folder.path().join("times.json");
    std::fs::write(&file, serde_json::to_string(&times).unwrap()).unwrap();
    let text = three.run("three.mjs", include_str!("../common/three.mjs"), &[&exported.path(), &file]);
    // The position of each node at each time.
    let places: Vec<Vec<[f64; 3]>> = serde_json::from_str(&text).unwrap();
    let joints = Joints::of(exported);
    let mut evaluator = Evaluator::new(stage.clone());
    let (mut worst, mut count) = ((0.0, String::new()), 0);
    for (secs, places) in times.iter().zip(&places) {
        let truth = evaluator.at(Time::from_secs(secs + delay)).unwrap();
        for ((actor, state), first) in stage.actors.iter().zip(&truth.actors).zip(&joints.actors) {
            let Some(first) = first.filter(|_| state.visible && actor.asset.placements.is_empty()) else {
                continue;
            };
            for (joint, name) in actor.asset.skeleton.names().iter().enumerate() {
                let place = state.world_from_joint(joint).unwrap().translation;
                let apart = place.distance(glam::DVec3::from_array(places[first + joint]));
                count += 1;
                if apart > worst.0 {
                    worst = (apart, format!("{} {name} at {secs:.4} s", actor.name));
                }
            }
        }
    }
    assert!(count > 20 * 2 * 50, "{count} places");
    worst
}

/// The loader and the mixer of three.js, in Node.js, give the same positions. An error of 20 ms is found.
#[test]
fn joints_imported_by_three_js_match_the_scene() {
    let packages = ["three@0.187.0"];
    let Some(three) = Packages::install(env!("CARGO_TARGET_TMPDIR"), "three", &packages) else { return };
    let lesson = |name: &str| Exported::from_lesson(&scripts().join(name), "glb", &[]);
    for exported in
        [lesson("01_first_dance.rhai"), lesson("12_together.rhai"), Exported::from_script(SCENE, "glb", &[])]
    {
        let (metres, place) = worst_joint_error_in_three_js(&three, &exported, 0.0);
        println!("three.js: {metres:.1e} m, {place}");
        assert!(metres < TOLERANCE, "{metres:e} m, {place}");
    }
    let delayed = worst_joint_error_in_three_js(&three, &Exported::from_script(SCENE, "glb", &[]), 0.02).0;
    assert!(delayed > 10.0 * TOLERANCE, "20 ms late is not found: {delayed:e} m");
}

/// Blender's importer converts joints to bones at the same positions.
#[test]
fn joints_imported_by_blender_match_the_scene() {
    let Some(python) = blender() else { return };
    let exported = Exported::from_lesson(&scripts().join("01_first_dance.rhai"), "glb", &[]);
    let stage = &exported.stage;
    let times = times_between_frames(stage);
    let actors: Vec<&str> = stage.actors.iter().map(|a| a.name.as_str()).collect();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/common/blender.py");
    let mut blender = std::process::Command::new(python);
    blender.arg(script).arg(exported.path()).arg(serde_json::to_string(&times).unwrap());
    let run = blender.arg(serde_json::to_string(&actors).unwrap()).output().unwrap();
    let text = String::from_utf8_lossy(&run.stdout);
    let result = text.lines().find_map(|line| line.strip_prefix("RESULT "));
    let result = result.unwrap_or_else(|| panic!("{text}{}", String::from_utf8_lossy(&run.stderr)));
    let bones: Value = serde_json::from_str(result).unwrap();
    let worst = |delay: f64| {
        let (mut evaluator, mut worst, mut count) = (Evaluator::new(stage.clone()), (0.0, String::new()), 0);
        for (number, secs) in times.iter().enumerate() {
            let truth = evaluator.at(Time::from_secs(*secs + delay)).unwrap();
            for (actor, state) in stage.actors.iter().zip(&truth.actors) {
                for (joint, name) in actor.asset.skeleton.names().iter().enumerate() {
                    let found = &bones[&actor.name][name][number];
                    let Some(found) = found.as_array() else { continue };
                    let found: Vec<f64> = found.iter().map(|v| v.as_f64().unwrap()).collect();
                    let place = state.world_from_joint(joint).unwrap().translation;
                    let apart = place.distance(glam::DVec3::from_slice(&found));
                    count += 1;
                    if apart > worst.0 {
                        worst = (apart, format!("{} {name} at {secs:.4} s", actor.name));
                    }
                }
            }
        }
        (worst, count)
    };
    let (found, count) = worst(0.0);
    println!("Blender: {count} places, {:.1e} m, {}", found.0, found.1);
    assert!(count > 20 * 3 * 50 && found.0 < TOLERANCE, "{count} places, {found:?}");
    let delayed = worst(0.02).0.0;
    assert!(delayed > 10.0 * TOLERANCE, "20 ms late is not found: {delayed:e} m");
}

/// Lessons that need plugins, which lie beside them.
fn has_plugins(lesson: &Path) -> bool {
    lesson.ends_with("lesson.rhai")
}

#[test]
fn all_exported_lessons_are_valid_and_their_joints_match() {
    let dir = tempfile::tempdir().unwrap();
    let (mut wrong, mut files) = (Vec::new(), Vec::new());
    for (number, path) in lessons().into_iter().enumerate() {
        let name = path.strip_prefix(scripts()).unwrap().display().to_string();
        let out = dir.path().join(format!("{number}.glb"));
        if has_plugins(&path) {
            let args = ["export", "lesson.rhai", "--json", "-o", out.to_str().unwrap()];
            let run = choreo(path.parent().unwrap(), &args);
            assert_eq!(run.code, 0, "{}", run.err);
            let printed: Value = serde_json::from_str(&run.out).unwrap();
            println!("{name}: it states {}", printed["worst_error"]);
            assert!(printed["worst_error"]["metres"].as_f64().unwrap() < TOLERANCE);
        } else {
            let exported = Exported::from_lesson(&path, "glb", &[]);
            std::fs::write(&out, &exported.files.main).unwrap();
            let (metres, place) = worst_joint_error(&exported);
            println!("{name}: {metres:.1e} m, {place}");
            if metres > TOLERANCE {
                wrong.push(format!("{name}: {metres:e} m, {place}"));
            }
        }
        files.push(out);
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    validate(&files);
}

#[test]
#[ignore = "drawing takes minutes; cargo test -p choreo --test exports gltf -- --ignored --nocapture"]
fn images_of_all_lessons() {
    for path in lessons().into_iter().filter(|path| !has_plugins(path)) {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let (c, own, imported) = compare_images(&Exported::from_lesson(&path, "glb", &[]), 0.45);
        save_images(&name, [&own, &imported]);
        println!("{name}: {c}");
    }
}
