//! A skinned, morphed, animated triangle made here, so that these tests need no file.

use serde_json::{Value, json};

/// Byte offsets of the parts of the binary chunk.
pub(crate) const POSITIONS: usize = 0;
pub(crate) const INDICES: usize = 36;
pub(crate) const TIMES: usize = 44;
pub(crate) const ROTATIONS: usize = 56;
pub(crate) const JOINTS: usize = 104;
pub(crate) const WEIGHTS: usize = 116;
pub(crate) const BINDS: usize = 164;
pub(crate) const MORPH: usize = 292;
pub(crate) const LENGTH: usize = 328;

fn floats(out: &mut Vec<u8>, values: &[f32]) {
    values.iter().for_each(|v| out.extend(v.to_le_bytes()));
}

pub(crate) fn sample() -> (Value, Vec<u8>) {
    let mut bin = Vec::new();
    floats(&mut bin, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    bin.extend([0, 0, 1, 0, 2, 0, 0, 0]);
    floats(&mut bin, &[0.0, 0.5, 1.0]);
    floats(&mut bin, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.6, 0.8, 0.0, 0.0, 0.0, 1.0]);
    bin.extend([0, 1, 0, 0].repeat(3));
    floats(&mut bin, &[0.75, 0.25, 0.0, 0.0].repeat(3));
    let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    floats(&mut bin, &identity.repeat(2));
    floats(&mut bin, &[0.0, 0.0, 1.0].repeat(3));
    assert_eq!(bin.len(), LENGTH);

    let view =
        |offset: usize, length: usize| json!({"buffer": 0, "byteOffset": offset, "byteLength": length});
    let accessor = |view: usize, component: u32, count: usize, shape: &str| json!({"bufferView": view, "componentType": component, "count": count, "type": shape});
    let json = json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [
            {"name": "body", "mesh": 0, "skin": 0},
            {"name": "hip", "children": [2]},
            {"name": "hand", "translation": [0, 1, 0]}
        ],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": 6}],
        "meshes": [{"primitives": [{
            "attributes": {"POSITION": 0, "JOINTS_0": 4, "WEIGHTS_0": 5},
            "indices": 1,
            "targets": [{"POSITION": 7}],
            "material": 0
        }]}],
        "materials": [{"name": "skin"}],
        "animations": [{"name": "turn",
            "samplers": [{"input": 2, "output": 3}],
            "channels": [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}]
        }],
        "buffers": [{"byteLength": LENGTH}],
        "bufferViews": [
            view(POSITIONS, 36), view(INDICES, 6), view(TIMES, 12), view(ROTATIONS, 48),
            view(JOINTS, 12), view(WEIGHTS, 48), view(BINDS, 128), view(MORPH, 36)
        ],
        "accessors": [
            accessor(0, 5126, 3, "VEC3"), accessor(1, 5123, 3, "SCALAR"), accessor(2, 5126, 3, "SCALAR"),
            accessor(3, 5126, 3, "VEC4"), accessor(4, 5121, 3, "VEC4"), accessor(5, 5126, 3, "VEC4"),
            accessor(6, 5126, 2, "MAT4"), accessor(7, 5126, 3, "VEC3")
        ]
    });
    (json, bin)
}
