//! USD files written by our exporter, by usd-core and by Blender: imported joints and vertices are where usd-core has them. The cameras
//! of FBX files are compared with Blender.

use crate::exported;

use crate::common::*;
use choreo_asset::{Asset, Projection};
use choreo_motion::Time;
use choreo_stage::{Camera, Cue, Evaluator, Repeat, Rig, Stage};
use exported::*;
use glam::{DMat4, DVec3};
use serde_json::Value;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

const USD: &str = "usd-core==26.5";
/// Largest allowed distance between the import and usd-core, in metres.
const MAX_ERROR_M: f64 = 1e-5;

/// The imported asset with a clip for its poses.
fn stage_playing_clip(asset: &Arc<Asset>) -> Arc<Stage> {
    let mut stage = Stage::default();
    let actor = stage.cast("again", asset.clone());
    if let Some(clip) = asset.clips.first() {
        stage.play(actor, Cue { repeat: Repeat::Once, ..Cue::new(clip.clone()) });
    }
    Arc::new(stage)
}

/// The values that usd-core reads from a file at some time codes, in metres with +Y up.
fn read_with_usd_core(python: &Path, path: &Path, codes: &[f64]) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/common/usd.py");
    let codes = serde_json::to_string(codes).unwrap();
    let run = Command::new(python).arg(script).arg(path).arg(codes).output().unwrap();
    let text = String::from_utf8_lossy(&run.stdout);
    let result = text.lines().find_map(|line| line.strip_prefix("RESULT "));
    let result = result.unwrap_or_else(|| panic!("{text}{}", String::from_utf8_lossy(&run.stderr)));
    serde_json::from_str(result).unwrap()
}

/// The largest distance from a vertex of usd-core to the nearest vertex of the import, at a time code, and the number of vertices compared.
fn farthest_vertex(asset: &Arc<Asset>, truth: &Value, secs: f64) -> (f64, usize) {
    let state = Evaluator::new(stage_playing_clip(asset)).at(Time::from_secs(secs)).unwrap().actors.remove(0);
    let own = world_vertices(asset, &state).concat();
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

/// The largest error of the camera's matrix (metres) and angle (radians) against usd-core at a time code, and of the values of the lights
/// against closed forms for the file that `usd_write.py` wrote. The import is evaluated `delay` seconds later.
fn camera_and_light_errors(asset: &Arc<Asset>, truth: &Value, code: f64, delay: f64) -> [f64; 2] {
    let mut stage = Stage::clone(&stage_playing_clip(asset));
    stage.cameras.push(Camera::new("", Rig::File { actor: 0, camera: 0 }));
    let snapshot = stage.at(Time::from_secs((code - 1.0) / 24.0 + delay)).unwrap();
    let camera = &truth["cameras"]["lens"];
    let world: Vec<f64> =
        camera["world"][0].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    let world = DMat4::from_cols_slice(&world);
    // +Z up and centimetres become +Y up and metres.
    let upright = |v: DVec3| DVec3::new(v.x, v.z, -v.y);
    let view = snapshot.camera.world_from_view;
    let apart = [
        view.translation.distance(upright(world.w_axis.truncate()) * 0.01),
        (view.matrix3.z_axis - upright(world.z_axis.truncate().normalize())).length(),
        (view.matrix3.y_axis - upright(world.y_axis.truncate().normalize())).length(),
    ];
    let Projection::Perspective { yfov, .. } = snapshot.camera.projection else { panic!("no perspective") };
    let angle = (f64::from(yfov) - camera["yfov"][0].as_f64().unwrap()).abs();
    let lens = apart.into_iter().fold(angle, f64::max);
    let share = (code - 1.0) / 24.0;
    let [panel, disk, spot] = [0, 1, 2].map(|index| snapshot.lights[index].light);
    let outer = spot.kind.cone().unwrap()[1];
    let off = [
        // The rectangle has 2 m × 0.5 m; a normalized disk has its nominal intensity, and a sphere four times as much.
        f64::from(panel.intensity) / (10.0 + 20.0 * share) - 1.0,
        f64::from(panel.color.y) - (1.0 - 0.5 * share),
        f64::from(panel.color.z) - (1.0 - share),
        f64::from(disk.intensity) / 7.0 - 1.0,
        f64::from(spot.intensity) / 4.0 - 1.0,
        f64::from(outer) - (20.0 + 24.0 * share).to_radians(),
    ];
    [lens, off.into_iter().map(f64::abs).fold(0.0, f64::max)]
}

#[test]
fn vertices_of_our_exports_match_usd_core() {
    let Some(python) = python_with("pxr", USD) else { return };
    for (name, extension) in [
        ("01_first_dance.rhai", "usdc"),
        ("01_first_dance.rhai", "usda"),
        ("19_faces.rhai", "usdz"),
        ("20_materials.rhai", "usdc"),
    ] {
        let exported = Exported::from_lesson(&scripts().join(name), extension, &[]);
        let path = exported.path();
        let asset = import(&path);
        let truth = read_with_usd_core(&python, &path, &[37.0]);
        let secs = 37.0 / truth["rate"].as_f64().unwrap();
        let (metres, count) = farthest_vertex(&asset, &truth, secs);
        println!("{name} as {extension}: {count} vertices, {metres:.1e} m; {:?}", asset.warnings);
        assert!(count > 100 && metres < MAX_ERROR_M, "{name}: {metres:e} m of {count} vertices");
        // The comparison finds an error in the time.
        let (delayed, _) = farthest_vertex(&asset, &truth, secs + 0.1);
        assert!(
            name != "01_first_dance.rhai" || delayed > 100.0 * MAX_ERROR_M,
            "a late clip is not found: {delayed:e} m"
        );
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
        let lights = ["/world/panel: is a RectLight", "/world/disk: is a DiskLight"];
        assert_eq!(
            warnings,
            lights.map(|light| format!("{light}, which becomes a light at its center")),
            "{name}"
        );
        for code in [1.0, 7.5, 25.0] {
            let truth = read_with_usd_core(&python, &path, &[code]);
            let (metres, count) = farthest_vertex(&asset, &truth, (code - 1.0) / 24.0);
            println!("{name} at {code}: {count} vertices, {metres:.1e} m");
            assert!(count >= 36 && metres < MAX_ERROR_M, "{name} at {code}: {metres:e} m of {count}");
            let [lens, lights] = camera_and_light_errors(&asset, &truth, code, 0.0);
            println!("{name} at {code}: the lens {lens:.1e}, lights {lights:.1e}");
            assert!(lens < 1e-4 && lights < 1e-4, "{name} at {code}: {lens:e}, {lights:e}");
            let delayed = camera_and_light_errors(&asset, &truth, code, if code < 13.0 { 0.1 } else { -0.1 });
            assert!(delayed.iter().all(|off| *off > 1e-3), "a late lens or light is not found: {delayed:?}");
        }
        assert!((asset.ambient - glam::Vec3::new(0.2, 0.1, 0.4)).length() < 1e-6, "{}", asset.ambient);
        assert_eq!(asset.materials[0].base_color_texture.as_ref().map(|t| t.uv_set), Some(0));
        assert_eq!((asset.images.len(), asset.images[0].width), (1, 2));
        assert_eq!(asset.meshes.iter().map(|m| m.primitives.len()).max(), Some(2), "parts of a mesh");
    }
}

#[test]
fn a_dome_light_sets_the_ambient_light_unless_the_script_does() {
    let folder = tempfile::tempdir().unwrap();
    let dome = "#usda 1.0\ndef DomeLight \"sky\" {\n color3f inputs:color = (0.5, 1, 0.25)\n float inputs:intensity = 0.4\n}\n";
    std::fs::write(folder.path().join("a.usda"), dome).unwrap();
    let ambient = |more: &str| {
        let text = format!("stage(#{{ length: 1.0 }}); cast(\"a\", load(\"a.usda\")){more};");
        let run =
            choreo_script::run_text("s.rhai", &text, folder.path(), &choreo::registry(), &Default::default());
        let settings = run.unwrap_or_else(|e| panic!("{e:?}")).stage.settings;
        [settings.ambient_up, settings.ambient_down]
    };
    let [default, file] = [Stage::default().settings.ambient_up, glam::Vec3::new(0.2, 0.4, 0.1)];
    assert_eq!(ambient(""), [file; 2]);
    assert_eq!(ambient("; ambient(\"white\", 0.3)"), [glam::Vec3::splat(0.3); 2]);
    assert_eq!(ambient(".file_lights(false)")[0], default);
}

/// The largest errors of a camera and a lamp against Blender: of the matrix of the camera, of its angle, and of the position of the lamp.
/// The import is evaluated `delay` seconds later.
fn camera_move_errors(asset: &Arc<Asset>, truth: &[Value], delay: f64) -> [f64; 3] {
    let mut stage = Stage::clone(&stage_playing_clip(asset));
    stage.actors[0].file_lights = true;
    stage.cameras.push(Camera::new("", Rig::File { actor: 0, camera: 0 }));
    let numbers =
        |value: &Value| value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect::<Vec<f64>>();
    let mut out = [0.0f64; 3];
    for blender in truth {
        let snapshot = stage.at(Time::from_secs(blender["secs"].as_f64().unwrap() + delay)).unwrap();
        let matrix = DMat4::from(snapshot.camera.world_from_view).to_cols_array();
        let apart = matrix.iter().zip(numbers(&blender["camera"])).map(|(a, b)| (a - b).abs());
        let Projection::Perspective { yfov, .. } = snapshot.camera.projection else {
            panic!("no perspective")
        };
        let angle = (f64::from(yfov) - blender["yfov"].as_f64().unwrap()).abs();
        let lamp = snapshot.lights[0].position.distance(DVec3::from_slice(&numbers(&blender["bulb"])));
        out.iter_mut()
            .zip([apart.fold(0.0, f64::max), angle, lamp])
            .for_each(|(worst, off)| *worst = worst.max(off));
    }
    out
}

/// A camera move and a lamp of Blender (lesson 49), as FBX and as USD. The glTF importer has its own test.
#[test]
fn imported_camera_moves_match_blender() {
    let Some(blender) = blender() else { return };
    let folder = tempfile::tempdir().unwrap();
    let files = ["move.glb", "move.json", "move.fbx", "move.usdc"].map(|name| folder.path().join(name));
    let run =
        Command::new(blender).arg(scripts().join("models/camera_move.py")).args(&files).output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let truth: Vec<Value> = serde_json::from_slice(&std::fs::read(&files[1]).unwrap()).unwrap();
    assert!(truth.len() >= 13);
    for file in [&files[0], &files[2], &files[3]] {
        let asset = import(file);
        let found = camera_move_errors(&asset, &truth, 0.0);
        println!("{}: {found:?}", file.display());
        assert!(found.iter().all(|off| *off < 1e-5), "{}: {found:?}", file.display());
        let delayed = camera_move_errors(&asset, &truth, 1.0 / 24.0);
        assert!(delayed.iter().all(|off| *off > 1e-3), "a frame late is not found: {delayed:?}");
    }
}

#[test]
fn files_by_blender_are_read() {
    let (Some(python), Some(blender)) = (python_with("pxr", USD), blender()) else { return };
    let exported = Exported::from_lesson(&scripts().join("01_first_dance.rhai"), "usdc", &[]);
    let (path, again) = (exported.path(), exported.folder.path().join("blender.usdc"));
    let code = "import bpy, sys\nbpy.ops.wm.read_factory_settings(use_empty=True)\nbpy.context.scene.render.fps = 30\n\
                bpy.ops.wm.usd_import(filepath=sys.argv[1])\nbpy.context.scene.frame_end = 60\n\
                bpy.ops.wm.usd_export(filepath=sys.argv[2], export_animation=True)";
    let run = Command::new(blender).args(["-c", code]).arg(&path).arg(&again).output().unwrap();
    assert!(again.is_file(), "{}", String::from_utf8_lossy(&run.stderr));
    let asset = import(&again);
    let truth = read_with_usd_core(&python, &again, &[30.0]);
    let start = 0.0;
    let (metres, count) = farthest_vertex(&asset, &truth, (30.0 - start) / truth["rate"].as_f64().unwrap());
    println!("Blender: {count} vertices, {metres:.1e} m; {:?}", asset.warnings);
    assert!(count > 300 && metres < MAX_ERROR_M, "{metres:e} m of {count} vertices");
}
