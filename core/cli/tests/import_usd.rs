//! USD files by our exporter, by usd-core and by Blender: joints and vertices are where usd-core has them.

mod common;
#[path = "common/unhurried.rs"]
mod unhurried;

use choreo_asset::Asset;
use choreo_motion::Time;
use choreo_plugin::{ExportedScene, ImportScope, MemoryFiles, OptionValue};
use choreo_script::{Limits, Loader, run_file};
use choreo_stage::{Cue, Evaluator, Repeat, Stage};
use common::*;
use glam::{DMat4, DVec3};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

const USD: &str = "usd-core==26.5";
/// Metres between what is imported and what usd-core has.
const SAME: f64 = 1e-5;

fn scripts() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts")
}

fn import(path: &Path) -> Arc<Asset> {
    let registry = choreo::registry();
    let limits = Limits::default();
    let loader = Arc::new(Loader::for_file(path, &[], &registry, ImportScope::ALL, limits.file).unwrap());
    let name = path.file_name().unwrap().to_str().unwrap();
    loader.load(name, &Default::default()).unwrap_or_else(|e| panic!("{name}: {}", e.message))
}

/// The asset, which plays its clip.
fn staged(asset: &Arc<Asset>) -> Arc<Stage> {
    let mut stage = Stage::default();
    let actor = stage.cast("again", asset.clone());
    if let Some(clip) = asset.clips.first() {
        stage.play(actor, Cue { repeat: Repeat::Once, ..Cue::new(clip.clone()) });
    }
    Arc::new(stage)
}

/// World positions of all vertices of triangles, in f64.
fn vertices(asset: &Asset, state: &choreo_stage::ActorState) -> Vec<DVec3> {
    let in_world = |joint: u32| DMat4::from(state.world_from_joint(joint as usize).unwrap());
    let mut out = Vec::new();
    for (number, instance) in asset.instances.iter().enumerate() {
        for primitive in &asset.meshes[instance.mesh as usize].primitives {
            let skin = instance.skin.filter(|_| primitive.influences > 0).map(|s| &asset.skins[s as usize]);
            for vertex in 0..primitive.positions.len() {
                let mut at = primitive.positions[vertex].as_dvec3();
                for (morph, weight) in primitive.morphs.iter().zip(&state.morph_weights[number]) {
                    at += morph.positions.get(vertex).map_or(DVec3::ZERO, |o| o.as_dvec3())
                        * f64::from(*weight);
                }
                let Some(skin) = skin else {
                    out.push(in_world(instance.joint).transform_point3(at));
                    continue;
                };
                let range = vertex * primitive.influences..(vertex + 1) * primitive.influences;
                let influences = range.map(|i| (primitive.joint_indices[i], primitive.joint_weights[i]));
                let moved = influences.filter(|(_, weight)| *weight != 0.0).map(|(joint, weight)| {
                    let joint = usize::from(joint);
                    let map = in_world(skin.joints[joint]) * skin.inverse_bind[joint].as_dmat4();
                    map.transform_point3(at) * f64::from(weight)
                });
                out.push(moved.sum());
            }
        }
    }
    out
}

/// What usd-core has in a file at some time codes, in metres with +Y up.
fn read(python: &Path, path: &Path, codes: &[f64]) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/common/usd.py");
    let codes = serde_json::to_string(codes).unwrap();
    let run = Command::new(python).arg(script).arg(path).arg(codes).output().unwrap();
    let text = String::from_utf8_lossy(&run.stdout);
    let result = text.lines().find_map(|line| line.strip_prefix("RESULT "));
    let result = result.unwrap_or_else(|| panic!("{text}{}", String::from_utf8_lossy(&run.stderr)));
    serde_json::from_str(result).unwrap()
}

/// The farthest that some of usd-core's vertices are from any vertex of the import, at a time code; how many were compared.
fn farthest(asset: &Arc<Asset>, truth: &Value, secs: f64) -> (f64, usize) {
    let state = Evaluator::new(staged(asset)).at(Time::from_secs(secs)).unwrap().actors.remove(0);
    let own = vertices(asset, &state);
    let (metres, is_z) = (truth["metres"].as_f64().unwrap(), truth["up"] == "Z");
    let (mut worst, mut count) = (0.0f64, 0);
    for prim in truth["prims"].as_object().unwrap().values() {
        for point in prim["points"].as_array().unwrap().iter().flat_map(|mesh| mesh.as_array().unwrap()) {
            let p: Vec<f64> = point.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
            let p = if is_z { DVec3::new(p[0], p[2], -p[1]) } else { DVec3::from_slice(&p) } * metres;
            let nearest = own.iter().map(|v| v.distance_squared(p)).fold(f64::INFINITY, f64::min);
            worst = worst.max(nearest.sqrt());
            count += 1;
        }
    }
    (worst, count)
}

fn exported(name: &str, extension: &str) -> (tempfile::TempDir, PathBuf) {
    let registry = choreo::registry();
    let exporter = registry.scene_exporter_for(&format!("out.{extension}")).unwrap();
    let stage = run_file(&scripts().join(name), &registry, &unhurried::unhurried()).unwrap().stage;
    let mut scene = ExportedScene::new("scene.rhai", Arc::new(stage));
    scene.extension = extension.into();
    scene.options = exporter.manifest().complete(&scene.options).unwrap();
    scene.options.0.insert("tolerance".into(), OptionValue::Number(1e-4));
    let mut files = MemoryFiles::default();
    exporter.export(&scene, &mut files).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("out.{extension}"));
    std::fs::write(&path, &files.main).unwrap();
    for (ending, bytes) in &files.beside {
        std::fs::write(folder.path().join(format!("out{ending}")), bytes).unwrap();
    }
    (folder, path)
}

#[test]
fn our_own_files_have_their_vertices_where_usd_core_has_them() {
    let Some(python) = python_with("pxr", USD) else { return };
    for (name, extension) in [
        ("01_first_dance.rhai", "usdc"),
        ("01_first_dance.rhai", "usda"),
        ("19_faces.rhai", "usdz"),
        ("20_materials.rhai", "usdc"),
    ] {
        let (_folder, path) = exported(name, extension);
        let asset = import(&path);
        let truth = read(&python, &path, &[37.0]);
        let secs = 37.0 / truth["rate"].as_f64().unwrap();
        let (metres, count) = farthest(&asset, &truth, secs);
        println!("{name} as {extension}: {count} vertices, {metres:.1e} m; {:?}", asset.warnings);
        assert!(count > 100 && metres < SAME, "{name}: {metres:e} m of {count} vertices");
        // The comparison finds what is late.
        let (late, _) = farthest(&asset, &truth, secs + 0.1);
        assert!(name != "01_first_dance.rhai" || late > 100.0 * SAME, "a late clip is not found: {late:e} m");
    }
}

#[test]
fn files_by_usd_core_are_read_in_all_formats() {
    let Some(python) = python_with("pxr", USD) else { return };
    let folder = tempfile::tempdir().unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/common/usd_write.py");
    let run = Command::new(&python).arg(script).arg(folder.path()).output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    for name in ["scene.usda", "scene.usdc", "scene.usdz"] {
        let path = folder.path().join(name);
        let asset = import(&path);
        let warnings: Vec<String> =
            asset.warnings.iter().map(|w| format!("{}: {}", w.place, w.text)).collect();
        assert_eq!(warnings, ["/world/panel: is a RectLight, which is left out"], "{name}");
        for code in [1.0, 7.5, 25.0] {
            let truth = read(&python, &path, &[code]);
            let (metres, count) = farthest(&asset, &truth, (code - 1.0) / 24.0);
            println!("{name} at {code}: {count} vertices, {metres:.1e} m");
            assert!(count >= 36 && metres < SAME, "{name} at {code}: {metres:e} m of {count}");
        }
        assert_eq!(asset.materials[0].base_color_texture.as_ref().map(|t| t.uv_set), Some(0));
        assert_eq!((asset.images.len(), asset.images[0].width), (1, 2));
        assert_eq!(asset.meshes.iter().map(|m| m.primitives.len()).max(), Some(2), "parts of a mesh");
    }
}

#[test]
fn files_by_blender_are_read() {
    let (Some(python), Some(blender)) = (python_with("pxr", USD), std::env::var_os("CHOREO_BPY")) else {
        println!("SKIP 1: CHOREO_BPY names no Python that has bpy");
        return;
    };
    let (folder, path) = exported("01_first_dance.rhai", "usdc");
    let again = folder.path().join("blender.usdc");
    let code = "import bpy, sys\nbpy.ops.wm.read_factory_settings(use_empty=True)\nbpy.context.scene.render.fps = 30\n\
                bpy.ops.wm.usd_import(filepath=sys.argv[1])\nbpy.context.scene.frame_end = 60\n\
                bpy.ops.wm.usd_export(filepath=sys.argv[2], export_animation=True)";
    let run = Command::new(blender).args(["-c", code]).arg(&path).arg(&again).output().unwrap();
    assert!(again.is_file(), "{}", String::from_utf8_lossy(&run.stderr));
    let asset = import(&again);
    let truth = read(&python, &again, &[30.0]);
    let start = 0.0;
    let (metres, count) = farthest(&asset, &truth, (30.0 - start) / truth["rate"].as_f64().unwrap());
    println!("Blender: {count} vertices, {metres:.1e} m; {:?}", asset.warnings);
    assert!(count > 300 && metres < SAME, "{metres:e} m of {count} vertices");
}
