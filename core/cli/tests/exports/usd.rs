//! `choreo export -o scene.usdc`: usd-core reads the file without warnings, its validators report nothing, and joints, vertices, blend
//! shapes and cameras are as in the scene. `cargo test -p choreo --test exports usd -- --nocapture` prints the table.

use crate::exported;

use crate::common::*;
use choreo_asset::Projection;
use choreo_motion::Time;
use choreo_stage::{Evaluator, Snapshot, Stage};
use exported::*;
use glam::{DAffine3, DMat4, DVec3};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// The allowed position error of a joint at a frame, in metres, with the default tolerance.
const MAX_ERROR_AT_FRAMES_M: f64 = 1e-5;

/// The version of usd-core whose validators this test was written for.
const USD: &str = "usd-core==26.5";

/// Scripts with fades, layers, IK, root motion, callbacks, attached props, several cameras, springs, faces and other characters.
const LESSONS: [&str; 7] = [
    "01_first_dance.rhai",
    "07_keys_and_frames.rhai",
    "11_root_motion.rhai",
    "12_together.rhai",
    "15_reaching.rhai",
    "19_faces.rhai",
    "38_bodies_and_chains.rhai",
];

/// The contents of an exported file, as usd-core reads them.
trait Usd {
    fn read(&self, python: &Path, times: &[Time]) -> Value;
}

impl Usd for Exported {
    /// The values that usd-core reads at some times.
    fn read(&self, python: &Path, times: &[Time]) -> Value {
        let rate = self.stage.settings.fps;
        let per_second = f64::from(rate.num) / f64::from(rate.den);
        let codes: Vec<f64> = times.iter().map(|time| time.as_secs() * per_second).collect();
        read_by_usd_core(python, &self.path(), &codes)
    }
}

/// The values that usd-core reads from a file at some time codes. Neither usd-core nor its validators may report anything.
fn read_by_usd_core(python: &Path, path: &Path, codes: &[f64]) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/common/usd.py");
    let codes = serde_json::to_string(codes).unwrap();
    let run = Command::new(python).arg(script).arg(path).arg(codes).output().unwrap();
    let (text, warnings) = (String::from_utf8_lossy(&run.stdout), String::from_utf8_lossy(&run.stderr));
    let result = text.lines().find_map(|line| line.strip_prefix("RESULT "));
    let result = result.unwrap_or_else(|| panic!("{text}{warnings}"));
    assert!(warnings.trim().is_empty(), "usd-core warns: {warnings}");
    let mut value: Value = serde_json::from_str(result).unwrap();
    // If the strength of a normal map is not 1, it is part of the scale and bias.
    let problems = value["problems"].as_array_mut().unwrap();
    problems.retain(|problem| !problem.as_str().unwrap().starts_with("NonCompliantBiasAndScale"));
    assert!(problems.is_empty(), "{problems:?}");
    value
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap_or_else(|| panic!("{value}")).iter().map(|v| v.as_f64().unwrap()).collect()
}

fn matrix(value: &Value) -> DMat4 {
    DMat4::from_cols_slice(&numbers(value))
}

/// The largest of several errors, and where it is.
#[derive(Default)]
struct Worst {
    metres: f64,
    place: String,
    count: usize,
}

impl Worst {
    fn add(&mut self, metres: f64, place: impl FnOnce() -> String) {
        self.count += 1;
        if metres > self.metres || metres.is_nan() {
            (self.metres, self.place) = (metres, place());
        }
    }
}

/// Compares the joints and vertices of the scene with those that usd-core reads.
fn joint_and_vertex_errors(exported: &Exported, read: &Value, times: &[Time]) -> [Worst; 2] {
    let stage = &exported.stage;
    let mut evaluator = Evaluator::new(stage.clone()).posing_hidden();
    let (mut joints, mut points) = (Worst::default(), Worst::default());
    for (number, time) in times.iter().enumerate() {
        let truth: Snapshot = evaluator.at(*time).unwrap();
        for (actor, state) in stage.actors.iter().zip(&truth.actors) {
            let found = &read["prims"][&actor.name];
            if found.is_null() {
                assert!(!state.visible, "{} is seen, and not there", actor.name);
                continue;
            }
            assert_eq!(found["visible"][number], state.visible, "{} at {} s", actor.name, time.as_secs());
            if !state.visible || !actor.asset.placements.is_empty() {
                continue;
            }
            let place = |what: &str| format!("{} {what} at {:.4} s", actor.name, time.as_secs());
            let origin = matrix(&found["world"][number]).w_axis.truncate();
            joints.add(origin.distance(state.world_from_model.translation), || place("itself"));
            for (joint, name) in actor.asset.skeleton.names().iter().enumerate() {
                let (Some(own), Some(found)) =
                    (state.world_from_joint(joint), found["joints"][name][number].as_array())
                else {
                    continue;
                };
                let found: Vec<f64> = found.iter().map(|v| v.as_f64().unwrap()).collect();
                joints.add(own.translation.distance(DVec3::from_slice(&found)), || place(name));
            }
            // Placements are instances of one mesh.
            if number + 1 == times.len() && !actor.asset.has_copies() {
                let own = world_vertices(&actor.asset, state);
                let lists = found["points"].as_array().unwrap();
                assert_eq!(own.len(), lists.len(), "meshes of {}", actor.name);
                for (own, list) in own.iter().zip(lists) {
                    let list = list.as_array().unwrap();
                    let step = (own.len() / 60).max(1);
                    assert_eq!(own.iter().step_by(step).count(), list.len());
                    for (own, found) in own.iter().step_by(step).zip(list) {
                        points.add(own.distance(DVec3::from_slice(&numbers(found))), || place("vertex"));
                    }
                }
            }
        }
    }
    [joints, points]
}

fn spread_frames(stage: &Stage, count: u64) -> Vec<Time> {
    let all = stage.settings.fps.frames_in(stage.settings.length).max(1) as u64;
    (0..count).map(|i| stage.settings.fps.time_of(((i * all + all / 3) / count) as _)).collect()
}

#[test]
fn exported_joints_and_vertices_of_lessons_match_the_scene() {
    let Some(python) = python_with("pxr", USD) else { return };
    for name in LESSONS {
        let exported =
            Exported::from_lesson(&scripts().join(name), "usdc", &tolerance(MAX_ERROR_AT_FRAMES_M));
        let times = spread_frames(&exported.stage, 8);
        let read = exported.read(&python, &times);
        let [joints, points] = joint_and_vertex_errors(&exported, &read, &times);
        println!(
            "{name}: {} joints {:.1e} m, {}; {} vertices {:.1e} m, {}",
            joints.count, joints.metres, joints.place, points.count, points.metres, points.place
        );
        assert!(
            joints.count > 8 && joints.metres < MAX_ERROR_AT_FRAMES_M,
            "{name}: {:e} m, {}",
            joints.metres,
            joints.place
        );
        assert!(
            points.metres < 2.0 * MAX_ERROR_AT_FRAMES_M,
            "{name}: {:e} m, {}",
            points.metres,
            points.place
        );
    }
}

/// Joints are in the right place also at times between frames, in all three file formats.
#[test]
fn text_crate_files_and_packages_hold_the_same_scene() {
    let Some(python) = python_with("pxr", USD) else { return };
    let mut known: Option<Value> = None;
    for extension in ["usda", "usdc", "usdz"] {
        let exported = Exported::from_script(SCENE, extension, &[]);
        let times: Vec<Time> =
            times_between_frames(&exported.stage).into_iter().map(Time::from_secs).collect();
        let mut read = exported.read(&python, &times);
        let [joints, points] = joint_and_vertex_errors(&exported, &read, &times);
        println!("{extension}: {:.1e} m, {}; vertices {:.1e} m", joints.metres, joints.place, points.metres);
        assert!(joints.metres < TOLERANCE && points.metres < 2.0 * TOLERANCE, "{:e}", joints.metres);
        assert_cameras_match(&exported, &read, &times);
        assert_eq!((&read["up"], &read["metres"]), (&"Y".into(), &1.0.into()));
        assert_eq!((&read["rate"], &read["end"]), (&24.0.into(), &72.0.into()));
        let lamp = numbers(&read["lights"]["point_2"]["intensity"]);
        let mut evaluator = Evaluator::new(exported.stage.clone());
        for (time, found) in times.iter().zip(lamp) {
            let truth = &evaluator.at(*time).unwrap().lights;
            let candela = truth.iter().map(|l| l.light).find(|l| !l.kind.is_directional());
            let candela = candela.map_or(0.0, |l| f64::from(l.intensity));
            assert!((found / 4.0 - candela).abs() < 0.02, "{found} / 4 is not {candela} cd");
        }
        // The three files have the same contents, except for file names.
        read["problems"].take();
        let known = known.get_or_insert_with(|| read.clone());
        assert_eq!(*known, read, "{extension} differs from usda");
    }
}

/// Compares all contents of a text file, as usd-core reads them, with a crate file: values, samples, types, targets and metadata.
const COMPARE: &str = "import sys
from pxr import Sdf
text, crate = (Sdf.Layer.FindOrOpen(path) for path in sys.argv[1:])
count, wrong = 0, []
def look(path):
    global count
    if path.IsTargetPath(): return
    a, b = text.GetObjectAtPath(path), crate.GetObjectAtPath(path)
    if b is None: return wrong.append((path, 'is not there'))
    for key in a.ListInfoKeys():
        count += 1
        x, y = a.GetInfo(key), b.GetInfo(key)
        if type(x) != type(y) or x != y: wrong.append((path, key, str(x)[:80], str(y)[:80]))
text.Traverse('/', look)
assert count > 500 and not wrong, (count, len(wrong), wrong[:5])
print('compared', count)
";

/// Values of each type are equal in the text format and the crate format, including those of materials.
#[test]
fn usdc_files_have_the_same_values_as_usda() {
    let Some(python) = python_with("pxr", USD) else { return };
    for name in
        ["01_first_dance.rhai", "19_faces.rhai", "20_materials.rhai", "32_crowd.rhai", "42_lanterns.rhai"]
    {
        let stage = stage_of(&scripts().join(name));
        let files = ["usda", "usdc"].map(|extension| Exported::of(stage.clone(), extension, &[]));
        let mut compare = Command::new(&python);
        let run = run_result(
            compare.args(["-c", COMPARE]).args(files.each_ref().map(Exported::path)).output().unwrap(),
        );
        println!("{name}: {}", run.out);
        assert_eq!(run.code, 0, "{name}: {}{}", run.out, run.err);
    }
}

/// The active camera has the matrix and angle of the scene.
fn assert_cameras_match(exported: &Exported, read: &Value, times: &[Time]) {
    let mut evaluator = Evaluator::new(exported.stage.clone());
    let all = read["cameras"].as_object().unwrap();
    let rate = f64::from(exported.stage.settings.fps.num);
    for (number, time) in times.iter().enumerate() {
        let truth = evaluator.at(*time).unwrap().camera;
        let code = time.as_secs() * rate;
        let on = |c: &&Value| {
            c["shot"]["start"].as_f64().unwrap() <= code && code < c["shot"]["end"].as_f64().unwrap()
        };
        let camera = all.values().find(on).unwrap();
        let world = DAffine3::from_mat4(matrix(&camera["world"][number]));
        let apart = world.translation.distance(truth.world_from_view.translation);
        let turned = (world.matrix3.z_axis - truth.world_from_view.matrix3.z_axis).length()
            + (world.matrix3.y_axis - truth.world_from_view.matrix3.y_axis).length();
        assert!(apart < TOLERANCE && turned < 3e-4, "{apart:e} m, {turned:e} rad at {} s", time.as_secs());
        let Projection::Perspective { yfov, .. } = truth.projection else { panic!("no perspective") };
        let found = camera["yfov"][number].as_f64().unwrap();
        assert!((found - f64::from(yfov)).abs() < 3e-4, "{found} is not {yfov} at {} s", time.as_secs());
    }
}

/// The comparison with the scene finds each planted fault of the file.
#[test]
fn planted_faults_are_found() {
    let Some(python) = python_with("pxr", USD) else { return };
    let exported = Exported::from_script(SCENE, "usda", &[]);
    let times = spread_frames(&exported.stage, 6);
    let worst = |text: &str| {
        exported.write(text.as_bytes());
        let read = exported.read(&python, &times);
        let [joints, points] = joint_and_vertex_errors(&exported, &read, &times);
        (joints.metres, points.metres)
    };
    let text = String::from_utf8(exported.files.main.clone()).unwrap();
    let (joints, points) = worst(&text);
    assert!(joints < TOLERANCE && points < 2.0 * TOLERANCE, "{joints:e} m, {points:e} m");
    // Keys that are half a frame late.
    let mut shifted = String::new();
    for line in text.lines() {
        let key = line
            .trim_start()
            .split_once(": ")
            .and_then(|(time, rest)| Some((time.parse::<f64>().ok()?, rest)));
        match key {
            Some((time, rest)) if rest.starts_with("[(") => {
                shifted.push_str(&format!("{}: {rest}\n", time + 0.5));
            }
            _ => shifted.push_str(&format!("{line}\n")),
        }
    }
    let (joints, _) = worst(&shifted);
    println!("late keys: {joints:.1e} m");
    assert!(joints > 2.0 * TOLERANCE, "late keys are not found: {joints:e} m");
    // Two joints of an animation are exchanged.
    let start = text.find("def SkelAnimation").unwrap();
    let list = start + text[start..].find("joints = [").unwrap() + "joints = [".len();
    let end = list + text[list..].find(']').unwrap();
    let mut names: Vec<&str> = text[list..end].split(", ").collect();
    names.swap(3, 14);
    let swapped = format!("{}{}{}", &text[..list], names.join(", "), &text[end..]);
    let (joints, points) = worst(&swapped);
    println!("joints in the wrong order: {joints:.1e} m, vertices {points:.1e} m");
    assert!(joints > 2.0 * TOLERANCE && points > 2.0 * TOLERANCE, "swapped joints are not found");
    // Vertices that follow the wrong joints, while the joints themselves are right.
    let from = text.find("int[] primvars:skel:jointIndices = [").unwrap();
    let list = from + text[from..].find('[').unwrap() + 3;
    let list = list + text[list..].find('[').unwrap() + 1;
    let end = list + text[list..].find(']').unwrap();
    let moved: Vec<String> =
        text[list..end].split(", ").map(|joint| (joint.parse::<u32>().unwrap() / 2).to_string()).collect();
    let (joints, points) = worst(&format!("{}{}{}", &text[..list], moved.join(", "), &text[end..]));
    println!("other influences: {joints:.1e} m, vertices {points:.1e} m");
    assert!(joints < TOLERANCE && points > 2.0 * TOLERANCE, "other influences are not found");
}

/// Blender's importer converts joints to bones and blend shapes to shape keys, with the same positions.
#[test]
fn joints_imported_by_blender_match_the_scene() {
    let Some(python) = blender() else { return };
    for (lesson, extension) in [("01_first_dance.rhai", "usdc"), ("19_faces.rhai", "usdz")] {
        let exported =
            Exported::from_lesson(&scripts().join(lesson), extension, &tolerance(MAX_ERROR_AT_FRAMES_M));
        let stage = &exported.stage;
        let last = stage.settings.fps.frames_in(stage.settings.length) as usize;
        let frames: Vec<usize> = (0..20).map(|i| i * (last - 1) / 19).collect();
        let names: Vec<&str> = stage.actors.iter().map(|a| a.name.as_str()).collect();
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/common/blender_usd.py");
        let mut blender = Command::new(&python);
        blender.arg(script).arg(exported.path()).arg(serde_json::to_string(&frames).unwrap());
        let run = blender.arg(serde_json::to_string(&names).unwrap()).output().unwrap();
        let text = String::from_utf8_lossy(&run.stdout);
        let result = text.lines().find_map(|line| line.strip_prefix("RESULT "));
        let result = result.unwrap_or_else(|| panic!("{text}{}", String::from_utf8_lossy(&run.stderr)));
        let read: Value = serde_json::from_str(result).unwrap();
        // Shots are custom properties, from which the script in the guide makes cuts.
        let mut starts: Vec<f64> = stage.cuts.iter().map(|cut| cut.at.as_secs()).collect();
        starts.insert(0, 0.0);
        let apart =
            numbers(&read["starts"]).iter().zip(&starts).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(numbers(&read["starts"]).len() == starts.len() && apart < 1e-6, "{}", read["starts"]);
        let worst_of = |delay: usize| {
            let (mut evaluator, mut worst) = (Evaluator::new(stage.clone()), Worst::default());
            for (number, frame) in frames.iter().enumerate() {
                let truth = evaluator.at(stage.settings.fps.time_of((*frame + delay) as _)).unwrap();
                for (actor, state) in
                    stage.actors.iter().zip(&truth.actors).filter(|(_, state)| state.visible)
                {
                    for (joint, name) in actor.asset.skeleton.names().iter().enumerate() {
                        let bone = name.replace(':', "_");
                        let found = &read["joints"][&actor.name][bone][number];
                        let (Some(place), false) = (state.world_from_joint(joint), found.is_null()) else {
                            continue;
                        };
                        let apart = place.translation.distance(DVec3::from_slice(&numbers(found)));
                        worst.add(apart, || format!("{} {name} at frame {frame}", actor.name));
                    }
                }
            }
            worst
        };
        let worst = worst_of(0);
        println!(
            "Blender, {lesson}: {} places, {:.1e} m, {}; {}",
            worst.count, worst.metres, worst.place, read["kinds"]
        );
        assert!(worst.count > 20 * 8 && worst.metres < TOLERANCE, "{:e} m, {}", worst.metres, worst.place);
        let delayed = worst_of(1).metres;
        assert!(
            lesson != LESSONS[0] || delayed > 10.0 * TOLERANCE,
            "a frame late is not found: {delayed:e} m"
        );
        let shaped =
            stage.actors.iter().flat_map(|a| &a.asset.meshes).filter(|m| m.morph_targets > 0).count();
        assert!(shaped == 0 || !read["shapes"].as_object().unwrap().is_empty(), "no shape keys");
    }
}

#[test]
fn the_same_scene_has_the_same_bytes() {
    for extension in ["usda", "usdc", "usdz"] {
        let [one, other] = [(); 2].map(|()| Exported::from_script(SCENE, extension, &[]).files);
        assert_eq!((one.main, one.beside), (other.main, other.beside), "{extension}");
    }
}

#[test]
fn the_summary_states_the_largest_error_and_what_is_left_out() {
    let dir = tempfile::tempdir().unwrap();
    check_summaries(dir.path(), &["a.usdc"], &["b.usdz"]);
    assert_eq!(file_names(dir.path()), ["a.rhai", "a.usdc", "a_0.png", "a_1.png", "b.usdz"]);
    // Files of a package begin at multiples of 64 bytes (the USDZ specification).
    let package = std::fs::read(dir.path().join("b.usdz")).unwrap();
    let mut found = 0;
    for at in (0..package.len() - 30).filter(|at| &package[*at..at + 4] == b"PK\x03\x04") {
        let word = |i: usize| usize::from(u16::from_le_bytes([package[at + i], package[at + i + 1]]));
        assert_eq!((at + 30 + word(26) + word(28)) % 64, 0, "the file at {at}");
        assert_eq!(word(8), 0, "it is compressed");
        found += 1;
    }
    assert_eq!(found, 3);
}

/// A Radiance file without compression in which each texel has a different color: red counts columns, green rows.
fn radiance([width, height]: [u32; 2]) -> Vec<u8> {
    let mut bytes = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
    (0..height).for_each(|y| (0..width).for_each(|x| bytes.extend([8 * x as u8, 8 * y as u8, 200, 129])));
    bytes
}

/// Prints the red and green of the texels that usd-core's dome light has in some directions, according to the specification of its image
/// ("latlong" as in OpenEXR), and its intensity. The script itself reads .hdr files; the OpenEXR library reads the others.
const SKY: &str = "import sys, json, math, zipfile, io
from pxr import Usd, UsdLux, UsdGeom, Gf
path, width, height = sys.argv[1], 32, 16
stage = Usd.Stage.Open(path)
dome = next(UsdLux.DomeLight(p) for p in stage.Traverse() if p.IsA(UsdLux.DomeLight))
file = dome.GetTextureFileAttr().Get()
assert dome.GetTextureFormatAttr().Get() == 'latlong' and file.resolvedPath, file
local = UsdGeom.Xformable(dome).ComputeLocalToWorldTransform(0).GetInverse()
found = []
for d in json.loads(sys.argv[2]):
    x, y, z = local.TransformDir(Gf.Vec3d(*d)).GetNormalized()
    longitude, latitude = math.atan2(x, z), math.asin(y)
    column = int((0.5 - longitude / (2 * math.pi)) * width) % width
    found.append([column, int((0.5 - latitude / math.pi) * height)])
print('RESULT ' + json.dumps([found, dome.GetIntensityAttr().Get(), file.path]))
";

/// The sky is a dome light with its image, rotated as in the scene. The image file is unchanged if USD supports its format.
#[test]
fn the_sky_becomes_a_dome_light_with_its_image_file() {
    let Some(python) = python_with("pxr", USD) else { return };
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let [width, height] = [32, 16];
    std::fs::write(d.join("env.hdr"), radiance([width, height])).unwrap();
    let script = "stage(#{ length: 0.1 });\ncast(\"box\", shape(\"box\"));\n\
                  sky(\"env.hdr\", #{ turn: 30, strength: 2.0, background: true });\n";
    std::fs::write(d.join("s.rhai"), script).unwrap();
    let directions =
        [[0.1, 0.2, -1.0], [1.0, -0.3, 0.2], [-0.6, 0.9, 0.4], [0.3, -0.8, 0.7]].map(DVec3::from_array);
    // Without the rotation, the middle of the image is in the direction −Z, and +X is to the right of it.
    let texel = |direction: &DVec3, turn: f64| {
        let d = glam::DQuat::from_rotation_y(-turn.to_radians()) * direction.normalize();
        let column = (0.5 + d.x.atan2(-d.z) / std::f64::consts::TAU) * f64::from(width);
        [column as u32 % width, ((0.5 - d.y.asin() / std::f64::consts::PI) * f64::from(height)) as u32]
    };
    let lists: Vec<[f64; 3]> = directions.iter().map(|d| d.to_array()).collect();
    for (output, file) in [("a.usda", "./a_sky.hdr"), ("b.usdc", "./b_sky.hdr"), ("c.usdz", "./c_sky.exr")] {
        let run = choreo(d, &["export", "s.rhai", "-o", output]);
        assert!(run.code == 0 && !run.err.contains("the sky"), "{}", run.err);
        let mut read = Command::new(&python);
        read.args(["-c", SKY, output]).arg(serde_json::to_string(&lists).unwrap()).current_dir(d);
        let run = run_result(read.output().unwrap());
        let result = run.out.lines().find_map(|line| line.strip_prefix("RESULT "));
        let result: Value =
            serde_json::from_str(result.unwrap_or_else(|| panic!("{}{}", run.out, run.err))).unwrap();
        let expected = |turn: f64| serde_json::json!([directions.map(|d| texel(&d, turn)), 2.0, file]);
        assert_eq!(result, expected(30.0), "{output}");
        assert_ne!(result, expected(-30.0), "a turn the other way is found");
        read_by_usd_core(&python, &d.join(output), &[0.0]);
    }
    assert!(["a_sky.hdr", "b_sky.hdr"].iter().all(|name| read_file(d, name) == radiance([width, height])));
    let Some(openexr) = python_with("OpenEXR", "OpenEXR==3.4.4") else { return };
    let code = "import OpenEXR, zipfile\nopen('c.exr', 'wb').write(zipfile.ZipFile('c.usdz').read('c_sky.exr'))\n\
                pixels = OpenEXR.File('c.exr').channels()['RGB'].pixels\nassert pixels.shape == (16, 32, 3), pixels.shape\n\
                wrong = lambda rows: [1 for y in range(16) for x in range(32) if abs(pixels[y][x][0] - x / 16) + abs(pixels[y][x][1] - rows(y) / 16) > 1e-2]\n\
                assert not wrong(lambda y: y) and wrong(lambda y: 15 - y), pixels\n";
    let run = run_result(Command::new(openexr).args(["-c", code]).current_dir(d).output().unwrap());
    assert_eq!(run.code, 0, "{}{}", run.out, run.err);
}

#[test]
fn all_exported_lessons_are_valid_and_their_vertices_match() {
    let Some(python) = python_with("pxr", USD) else { return };
    let mut wrong = Vec::new();
    for path in lessons() {
        let name = path.strip_prefix(scripts()).unwrap().display().to_string();
        if name.ends_with("lesson.rhai") {
            // The program finds the plugins.
            let dir = tempfile::tempdir().unwrap();
            let out = dir.path().join("out.usdc");
            let args = ["export", "lesson.rhai", "--json", "-o", out.to_str().unwrap()];
            let run = choreo(path.parent().unwrap(), &args);
            assert_eq!(run.code, 0, "{}", run.err);
            let printed: Value = serde_json::from_str(&run.out).unwrap();
            println!("{name}: it states {}", printed["worst_error"]);
            assert!(printed["worst_error"]["metres"].as_f64().unwrap() < TOLERANCE);
            read_by_usd_core(&python, &out, &[0.0]);
            continue;
        }
        let exported = Exported::from_lesson(&path, "usdc", &[]);
        let times = spread_frames(&exported.stage, 5);
        let read = exported.read(&python, &times);
        let [joints, points] = joint_and_vertex_errors(&exported, &read, &times);
        println!(
            "{name}: {} joints {:.1e} m, {}; {} vertices {:.1e} m, {}",
            joints.count, joints.metres, joints.place, points.count, points.metres, points.place
        );
        if joints.metres > TOLERANCE || points.metres > 2.0 * TOLERANCE {
            wrong.push(name);
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}
