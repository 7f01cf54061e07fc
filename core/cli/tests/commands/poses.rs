//! Joints and posed meshes that `choreo pose` gives for third-party files, against an f64 implementation of the glTF specification that
//! shares no code with the program.

#[path = "../../../../plugins/import-gltf/tests/oracle/mod.rs"]
#[allow(dead_code)]
mod oracle;

use crate::common::*;
use glam::{DMat4, DVec3};
use oracle::{Fault, Oracle};
use serde_json::Value;

/// Files with a skin, with a skin and morph targets, and with morph targets alone; a clip, and a time between two keys.
const CASES: &[(&str, &str, f64)] = &[
    ("Knight.glb", "Walking_A", 0.4321),
    ("Fox.glb", "Run", 0.777),
    ("RobotExpressive.glb", "Dance", 1.2345),
    ("AnimatedMorphCube.glb", "Square", 1.3),
];

/// Largest difference relative to the size of the model: the error of f32 along a chain of a dozen joints.
const MAX_RELATIVE_ERROR: f64 = 1e-6;

struct PoseOutput {
    joints: Vec<DVec3>,
    vertices: Vec<DVec3>,
}

/// The output of the program and the text of the OBJ file that it writes.
fn pose_output(file: &str, clip: &str, at: f64) -> PoseOutput {
    let folder = tempfile::tempdir().unwrap();
    let file = sample_assets_folder().unwrap().join("gltf").join(file);
    let args = ["pose", file.to_str().unwrap(), "--clip", clip, "--json", "--mesh", "posed.obj", "--at"];
    let run = choreo(folder.path(), &[&args[..], &[&at.to_string()]].concat());
    assert_eq!(run.code, 0, "{}", run.err);
    let json: Value = serde_json::from_str(&run.out).unwrap();
    let joint = |j: &Value| {
        let m: Vec<f64> =
            j["world_from_joint"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
        DMat4::from_cols_slice(&m).w_axis.truncate()
    };
    let joints = json["actors"][0]["joints"].as_array().unwrap().iter().map(joint).collect();
    let obj = String::from_utf8(read_file(folder.path(), "posed.obj")).unwrap();
    let vertex = |l: &str| {
        let n: Vec<f64> = l.strip_prefix("v ")?.split(' ').map(|n| n.parse().unwrap()).collect();
        Some(DVec3::from_slice(&n))
    };
    PoseOutput { joints, vertices: obj.lines().filter_map(vertex).collect() }
}

/// The largest errors of joints and of vertices, relative to the size of the model. Joints are the nodes of the scene, parents first;
/// vertices are in the order of the instances.
fn worst_distances(output: &PoseOutput, oracle: &Oracle, clip: &str, at: f64) -> (f64, f64) {
    let names = oracle::list(&oracle.json, "animations");
    let clip = names.iter().position(|a| a["name"] == clip).unwrap();
    let (world, weights) = oracle.pose(Some(clip), at);
    let nodes = oracle::list(&oracle.json, "nodes");
    let mut vertices = Vec::new();
    for node in oracle.order.iter().filter(|n| nodes[**n]["mesh"].is_u64()) {
        let mesh = &oracle.json["meshes"][oracle::index(&nodes[*node]["mesh"])];
        let rest = || oracle::list(mesh, "weights").iter().map(|w| w.as_f64().unwrap()).collect();
        let weights = weights.iter().find(|(n, _)| n == node).map_or_else(rest, |(_, w)| w.clone());
        vertices.extend(oracle.vertices(*node, &world, &weights).into_iter().flatten());
    }
    let joints: Vec<DVec3> = oracle.order.iter().map(|n| world[*n].w_axis.truncate()).collect();
    let (low, high) =
        vertices.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
    let apart = |a: &[DVec3], b: &[DVec3]| {
        assert_eq!(a.len(), b.len());
        a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max) / (high - low).length()
    };
    (apart(&output.joints, &joints), apart(&output.vertices, &vertices))
}

#[test]
fn posed_joints_and_vertices_match_the_gltf_specification() {
    let Some(folder) = sample_assets_folder() else { return };
    for (file, clip, at) in CASES {
        let output = pose_output(file, clip, *at);
        let mut oracle = Oracle::open(&folder.join("gltf").join(file));
        let (joints, vertices) = worst_distances(&output, &oracle, clip, *at);
        println!(
            "{file} {clip} {at} s: joints {joints:.1e}, {} vertices {vertices:.1e}",
            output.vertices.len()
        );
        assert!(
            joints < MAX_RELATIVE_ERROR && vertices < MAX_RELATIVE_ERROR,
            "{file}: joints {joints:e}, vertices {vertices:e}"
        );
        // An error of 0.02 s in the time must be found.
        oracle.fault = Some(Fault::Late { secs: 0.02 });
        let (joints, vertices) = worst_distances(&output, &oracle, clip, *at);
        assert!(joints.max(vertices) > 100.0 * MAX_RELATIVE_ERROR, "{file}: a late pose passes");
    }
}

/// An actor that is not visible has joints, but its mesh is not written.
#[test]
fn hidden_actors_have_joints_and_no_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let script = "stage(#{ length: 2.0 }); let m = load(\"choreo:mannequin\");\n\
        let anna = cast(\"anna\", m); anna.play(m.clip(\"Walk\")); anna.key(\"visible\", [[0.0, false], [1.0, true]]);";
    std::fs::write(folder.path().join("hidden.rhai"), script).unwrap();
    let mut vertices = Vec::new();
    for at in ["0.5", "1.5"] {
        let run = choreo(folder.path(), &["pose", "hidden.rhai", "--at", at, "--json", "--mesh", "o.obj"]);
        assert_eq!(run.code, 0, "{}", run.err);
        let json: Value = serde_json::from_str(&run.out).unwrap();
        assert_eq!(json["actors"][0]["visible"], at == "1.5");
        assert!(json["actors"][0]["joints"].as_array().unwrap().len() > 20, "at {at}");
        let obj = String::from_utf8(read_file(folder.path(), "o.obj")).unwrap();
        vertices.push(obj.lines().filter(|l| l.starts_with("v ")).count());
    }
    assert!(vertices[0] == 0 && vertices[1] > 1000, "{vertices:?}");
}
