//! Our skinned vertices against those that the authoring program exported at a frame.

use crate::common;
use choreo_asset::Asset;
use choreo_motion::{PropertyTarget, Time};
use glam::DVec3;
use std::path::Path;

struct Case {
    fbx: &'static str,
    stack: &'static str,
    obj: &'static str,
    /// Frames of 1/24 s after the stack's start. The names of the files count from the start of the program's time line: the
    /// stacks "wiggle" and Blender's start at its frame 1, "spin" and "deform" are counted from their own.
    frame: f64,
    /// Metres a unit of the OBJ.
    unit: f64,
}

const fn case(fbx: &'static str, stack: &'static str, obj: &'static str, frame: f64) -> Case {
    Case { fbx, stack, obj, frame, unit: 0.01 }
}

const MAYA: [Case; 14] = [
    case("maya_game_sausage_7500_binary_wiggle", "wiggle", "maya_game_sausage_wiggle_10", 9.0),
    case("maya_game_sausage_7500_binary_wiggle", "wiggle", "maya_game_sausage_wiggle_18", 17.0),
    case("maya_game_sausage_7500_binary_combined", "wiggle", "maya_game_sausage_wiggle_10", 9.0),
    case("maya_game_sausage_7500_binary_combined", "wiggle", "maya_game_sausage_wiggle_18", 17.0),
    case("maya_game_sausage_7500_binary_combined", "spin", "maya_game_sausage_spin_7", 7.0),
    case("maya_game_sausage_7500_binary_combined", "spin", "maya_game_sausage_spin_15", 15.0),
    case("maya_game_sausage_7500_binary_combined", "deform", "maya_game_sausage_deform_8", 8.0),
    case("maya_game_sausage_7500_binary_combined", "deform", "maya_game_sausage_deform_15", 15.0),
    case("maya_game_sausage_6100_ascii_combined", "wiggle", "maya_game_sausage_wiggle_10", 9.0),
    case("maya_game_sausage_6100_ascii_combined", "wiggle", "maya_game_sausage_wiggle_18", 17.0),
    case("maya_game_sausage_6100_ascii_combined", "spin", "maya_game_sausage_spin_15", 15.0),
    case("maya_game_sausage_6100_ascii_combined", "spin", "maya_game_sausage_spin_7", 7.0),
    case("maya_game_sausage_6100_ascii_combined", "deform", "maya_game_sausage_deform_8", 8.0),
    case("maya_game_sausage_6100_ascii_combined", "deform", "maya_game_sausage_deform_15", 15.0),
];

fn blender(stack: &'static str, obj: &'static str, frame: f64) -> Case {
    Case { unit: 1.0, ..case("blender_279_sausage_7400_binary", stack, obj, frame) }
}

fn obj_vertices(path: &Path) -> Vec<DVec3> {
    let text = std::fs::read_to_string(path).unwrap();
    let vertex = |line: &str| {
        let mut numbers = line.split_whitespace().map(|n| n.parse::<f64>().unwrap());
        DVec3::from_array(std::array::from_fn(|_| numbers.next().unwrap()))
    };
    text.lines().filter_map(|l| l.strip_prefix("v ")).map(vertex).collect()
}

/// Symmetric Hausdorff distance between two lists of vertices.
fn hausdorff_distance(a: &[DVec3], b: &[DVec3]) -> f64 {
    let nearest =
        |p: &DVec3, list: &[DVec3]| list.iter().map(|q| p.distance(*q)).fold(f64::INFINITY, f64::min);
    let one_way = |a: &[DVec3], b: &[DVec3]| a.iter().map(|p| nearest(p, b)).fold(0.0, f64::max);
    one_way(a, b).max(one_way(b, a))
}

fn error(asset: &Asset, case: &Case, folder: &Path, delay_secs: f64) -> f64 {
    let theirs: Vec<DVec3> =
        obj_vertices(&folder.join(format!("{}.obj", case.obj))).iter().map(|v| *v * case.unit).collect();
    let clip = asset.clips.iter().find(|c| c.name.ends_with(case.stack)).unwrap_or_else(|| {
        panic!(
            "{}: no {} among {:?}",
            case.fbx,
            case.stack,
            asset.clips.iter().map(|c| &c.name).collect::<Vec<_>>()
        )
    });
    let ours = common::posed_vertices(asset, Some((clip, case.frame / 24.0 + delay_secs)));
    hausdorff_distance(&ours, &theirs) / case.unit
}

/// Files hold six decimals of a unit.
const TOLERANCE: f64 = 5e-6;

#[test]
fn vertices_equal_the_authoring_programs_export() {
    let mut cases: Vec<Case> = MAYA.into();
    cases.push(blender("Base", "blender_279_sausage_base_0", 0.0));
    cases.push(blender("Spin", "blender_279_sausage_spin_15", 15.0));
    cases.push(blender("Wiggle", "blender_279_sausage_wiggle_20", 19.0));
    let Some(folder) = common::assets(cases.len()).map(|f| f.join("fbx/ufbx")) else { return };
    let mut bad = Vec::new();
    for case in &cases {
        let asset = common::import_path(&folder.join(format!("{}.fbx", case.fbx)));
        let error = error(&asset, case, &folder, 0.0);
        println!("{} {} frame {}: worst vertex off by {error:.2e} units", case.fbx, case.stack, case.frame);
        if error.is_nan() || error >= TOLERANCE {
            bad.push(case.obj);
        }
    }
    assert!(bad.is_empty(), "{bad:?}");
}

/// The comparison can fail: a fiftieth of a frame late, or one weight of one vertex wrong, is seen.
#[test]
fn the_comparison_detects_planted_faults() {
    let Some(folder) = common::assets(2).map(|f| f.join("fbx/ufbx")) else { return };
    let case = &MAYA[0];
    let mut asset = common::import_path(&folder.join(format!("{}.fbx", case.fbx)));
    let late = error(&asset, case, &folder, 0.02 / 24.0);
    assert!(late > 10.0 * TOLERANCE, "{late}");
    let mut mesh = (*asset.meshes[0]).clone();
    let p = &mut mesh.primitives[0];
    // A hundredth of the first vertex goes to another joint.
    p.joint_indices[1] = if p.joint_indices[0] == 0 { 2 } else { 0 };
    p.joint_weights[0] -= 0.01;
    p.joint_weights[1] += 0.01;
    asset.meshes[0] = mesh.into();
    let wrong = error(&asset, case, &folder, 0.0);
    assert!(wrong > 10.0 * TOLERANCE, "{wrong}");
}

/// Maya's values of its light at frames of 1/24 s (ufbx, test/test_animation.h): intensity, red, green, blue.
const LIGHT: [(f64, [f64; 4]); 8] = [
    (0.0, [3.072, 0.148, 0.095, 0.440]),
    (12.0, [1.638, 0.102, 0.136, 0.335]),
    (24.0, [1.948, 0.020, 0.208, 0.149]),
    (32.0, [3.676, 0.010, 0.220, 0.113]),
    (40.0, [4.801, 0.118, 0.195, 0.115]),
    (48.0, [3.690, 0.288, 0.155, 0.117]),
    (56.0, [1.565, 0.421, 0.124, 0.119]),
    (60.0, [1.145, 0.442, 0.119, 0.119]),
];

/// Largest error of the values of the light, read `delay_frames` frames late.
fn light_error(asset: &Asset, delay_frames: f64) -> f64 {
    // The light's unit is that of its intensity at rest, frame 0.
    let unit = f64::from(asset.lights[0].light.intensity) / LIGHT[0].1[0];
    let off = |(frame, wanted): &(f64, [f64; 4])| {
        // The stack begins with frame 1.
        let time = Time::from_secs((frame - 1.0 + delay_frames) / 24.0);
        let (mut intensity, mut color) = ([0.0], [0.0; 3]);
        assert!(asset.clips[0].sample_property(PropertyTarget::LightIntensity(0), time, &mut intensity));
        assert!(asset.clips[0].sample_property(PropertyTarget::LightColor(0), time, &mut color));
        let got = [f64::from(intensity[0]) / unit, color[0].into(), color[1].into(), color[2].into()];
        got.iter().zip(wanted).map(|(g, w)| (g - w).abs()).fold(0.0, f64::max)
    };
    LIGHT.iter().filter(|f| f.0 + delay_frames >= 1.0).map(off).fold(0.0, f64::max)
}

#[test]
fn an_animated_light_equals_mayas_values() {
    let Some(folder) = common::assets(1) else { return };
    let asset = common::import_path(&folder.join("fbx/ufbx/maya_anim_light_7500_binary.fbx"));
    println!("{} at worst", light_error(&asset, 0.0));
    assert!(light_error(&asset, 0.0) < 2e-3, "{}", light_error(&asset, 0.0));
    assert!(light_error(&asset, 0.1) > 5e-3, "a tenth of a frame late is seen");
}
