//! EXT_meshopt_compression and EXT_mesh_gpu_instancing: an own sample, packed by meshoptimizer's encoders, against the
//! formulas that its numbers were made of.

use crate::common;
use choreo_asset::{Topology, posed_meshes_in};
use choreo_motion::Time;
use glam::{DAffine3, DQuat, DVec3, Vec3};
use serde_json::json;

fn sample() -> Vec<u8> {
    include_bytes!("../samples/packed.glb").to_vec()
}

/// The bowl over a unit square: height and normal.
fn bowl(x: f64, z: f64) -> (f64, DVec3) {
    let (x, z) = (x - 0.5, z - 0.5);
    (x * x + z * z, DVec3::new(-2.0 * x, 1.0, -2.0 * z).normalize())
}

#[test]
fn compressed_vertices_and_indices_are_decoded() {
    let asset = common::import_bytes("packed.glb", sample()).unwrap();
    assert_eq!(asset.warnings, []);
    let [surface, rim] = &asset.meshes[0].primitives[..] else { panic!("two primitives") };
    assert_eq!(surface.positions.len(), 81);
    for (v, (position, normal)) in surface.positions.iter().zip(&surface.normals).enumerate() {
        let (x, z) = ((v % 9) as f64 / 8.0, (v / 9) as f64 / 8.0);
        let (y, n) = bowl(x, z);
        assert!((position.as_dvec3() - DVec3::new(x, y, z)).length() < 2e-5, "{v}: {position}");
        // 8 bits of an octahedron.
        assert!(normal.as_dvec3().dot(n) > 0.9998, "{v}: {normal} {n}");
    }
    let mut cells: Vec<[u32; 3]> = surface.indices.as_chunks::<3>().0.to_vec();
    for t in &mut cells {
        let first = (0..3).min_by_key(|i| t[*i]).unwrap_or(0);
        t.rotate_left(first);
    }
    cells.sort_unstable();
    let mut expected: Vec<[u32; 3]> = Vec::new();
    for cell in 0..64 {
        let a = cell / 8 * 9 + cell % 8;
        expected.extend([[a, a + 9, a + 1], [a + 1, a + 9, a + 10]]);
    }
    expected.sort_unstable();
    assert_eq!(cells, expected);
    assert_eq!(rim.topology, Topology::Lines);
    let corners: Vec<u32> = (0..9).chain((1..9).map(|j| j * 9 + 8)).collect();
    assert_eq!(rim.indices, corners.windows(2).flatten().copied().collect::<Vec<_>>());
}

#[test]
fn compressed_keys_are_decoded() {
    let asset = common::import_bytes("packed.glb", sample()).unwrap();
    let curve = &asset.clips[0].curves()[0];
    assert_eq!(curve.times.to_vec(), [0.0, 0.5, 1.0, 1.5, 2.0].map(Time::from_secs));
    for (k, value) in curve.values.chunks(4).enumerate() {
        let half = k as f64 * std::f64::consts::FRAC_PI_8;
        let expected = [0.0, half.sin(), 0.0, half.cos()];
        let dot: f64 = value.iter().zip(expected).map(|(a, b)| f64::from(*a) * b).sum();
        assert!(dot.abs() > 1.0 - 1e-7, "key {k}: {value:?}");
    }
}

#[test]
fn instances_are_where_the_formula_places_them() {
    let asset = common::import_bytes("packed.glb", sample()).unwrap();
    assert_eq!(asset.instances.len(), 2, "a field is one instance, whatever it holds");
    assert!(asset.instances[0].copies.is_empty());
    assert_eq!((asset.instances[1].copies.len(), asset.times(&asset.instances[1])), (12, 12));
    let joints = asset.rest_model_from_joint();
    let posed = posed_meshes_in(&asset, joints, &[], DAffine3::IDENTITY);
    assert_eq!(posed.iter().map(|p| p.instance).collect::<Vec<_>>(), [vec![0], vec![1; 12]].concat());
    let corner = 8;
    for (k, copy) in posed[1..].iter().enumerate() {
        let scaled = DVec3::new(1.0, 1.0 + k as f64 * 0.125, 1.0) * DVec3::new(1.0, bowl(1.0, 0.0).0, 0.0);
        let turned = DQuat::from_rotation_y(k as f64 * std::f64::consts::PI / 6.0) * scaled;
        let expected = turned + DVec3::new(k as f64 * 1.25, 0.0, (k % 3) as f64 * 1.5 - 8.0);
        let got = copy.primitives[0].positions[corner];
        assert!((got - expected).length() < 2e-4, "copy {k}: {got} {expected}");
    }
    // The boxes hold every copy, and one of half the size does not.
    let rest = asset.rest_bounds();
    let reach = asset.instance_bounds()[1].posed(joints, &[]);
    let points = || posed[1..].iter().flat_map(|p| p.primitives.iter().flat_map(|p| &p.positions));
    let inside = |min: Vec3, max: Vec3| {
        points().all(|p| p.cmpge(min.as_dvec3()).all() && p.cmple(max.as_dvec3()).all())
    };
    assert!(inside(rest.min, rest.max) && inside(reach.min, reach.max));
    assert!(!inside(reach.center().lerp(reach.min, 0.5), reach.center().lerp(reach.max, 0.5)));
    assert!((reach.max - reach.min).x < 16.0, "{reach:?} is not much too large");
}

#[test]
fn errors_name_the_compressed_element() {
    let edited = |edit: &dyn Fn(&mut serde_json::Value)| {
        common::error_text(common::import_bytes("bad.glb", common::edited(&sample(), |json, _| edit(json))))
    };
    let said = |view: usize, key: &str, value: serde_json::Value| {
        edited(&|json| {
            json["bufferViews"][view]["extensions"]["EXT_meshopt_compression"][key] = value.clone()
        })
    };
    let at = "bufferViews[0].EXT_meshopt_compression";
    let text = said(0, "mode", json!("CUBES"));
    assert!(text.contains(at), "{text}");
    assert!(text.ends_with("has mode \"CUBES\"; ATTRIBUTES, TRIANGLES and INDICES are known"), "{text}");
    for (key, value, tail) in [
        (
            "filter",
            json!("SEPIA"),
            "has filter \"SEPIA\"; NONE, OCTAHEDRAL, QUATERNION, EXPONENTIAL and COLOR are known",
        ),
        ("byteStride", json!(6), "has a byteStride of 6; multiples of 4 up to 256 are allowed"),
        ("count", json!(1e12 as u64), "unpacks to 8000000000000 bytes, but the view has 648"),
        ("count", json!(-1), "has a count of -1; whole numbers from 0 are allowed"),
        ("byteLength", json!(1 << 30), "ends at byte 1073741824 of buffers[0], which has 1002 bytes"),
        ("buffer", json!(1), "has neither a uri nor a binary chunk of a GLB"),
        ("byteOffset", json!(1), "begins with "),
    ] {
        let text = said(0, key, value);
        assert!(text.contains("bufferViews[0]") || text.contains("buffers["), "{text}");
        assert!(text.contains(tail), "{text}");
    }
    let text = edited(&|json| {
        json["nodes"][1]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["SCALE"] = json!(1);
    });
    assert_eq!(
        text,
        "bad.glb: nodes[1].extensions.EXT_mesh_gpu_instancing: SCALE has 81 elements, but the attribute before it has 12"
    );
}

#[test]
fn fallback_buffers_are_not_needed_and_too_many_instances_exceed_the_budget() {
    // The second buffer has no data: the compressed views replace it. It is not requested even with a uri.
    let bytes = common::edited(&sample(), |json, _| json["buffers"][1]["uri"] = json!("missing.bin"));
    assert!(common::import_bytes("sample.glb", bytes).is_ok());
    let many = common::edited(&sample(), |json, _| {
        let accessor = json!({"componentType": 5126, "count": 16_000_000, "type": "VEC3"});
        for i in [6, 8] {
            json["accessors"][i] = accessor.clone();
        }
        let attributes = &mut json["nodes"][1]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
        attributes.as_object_mut().unwrap().remove("ROTATION");
        for _ in 0..3 {
            let node = json["nodes"][1].clone();
            json["nodes"].as_array_mut().unwrap().push(node);
        }
        json["scenes"][0]["nodes"] = json!([0, 1, 2, 3, 4]);
    });
    let text = common::error_text(common::import_bytes("many.glb", many));
    assert!(
        text.ends_with("the file's data take more than 2048 MiB when decoded, which is the limit"),
        "{text}"
    );
}
