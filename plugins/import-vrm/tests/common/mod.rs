//! A tiny character as VRM 0.x and as VRM 1.0, and an animation, made here so that these tests need no file.
#![allow(dead_code)]

#[path = "../../../import-gltf/tests/common/glb.rs"]
mod glb;

pub(crate) use glb::glb_of;
use serde_json::{Value, json};

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Version {
    V0,
    V1,
}

/// Nodes by name; their order is the file's.
pub(crate) const NODES: [&str; 13] = [
    "hips",
    "spine",
    "head",
    "left upper arm",
    "thumb a",
    "thumb b",
    "thumb c",
    "hair 1",
    "hair 2",
    "hair 3",
    "body",
    "hat",
    "left eye",
];

pub(crate) fn node(name: &str) -> usize {
    NODES.iter().position(|n| *n == name).unwrap()
}

pub(crate) fn floats(out: &mut Vec<u8>, values: &[f32]) {
    values.iter().for_each(|v| out.extend(v.to_le_bytes()));
}

/// Views of parts of these lengths that follow each other.
fn views(lengths: &[usize]) -> Vec<Value> {
    let mut offset = 0;
    lengths
        .iter()
        .map(|length| {
            let view = json!({ "buffer": 0, "byteOffset": offset, "byteLength": length });
            offset += length;
            view
        })
        .collect()
}

/// The character as JSON and binary chunk. In 1.0 it looks along +Z, in 0.x along −Z: the same body, turned.
pub(crate) fn character(version: Version) -> (Value, Vec<u8>) {
    let s: f32 = if version == Version::V1 { 1.0 } else { -1.0 };
    let at = |x: f32, y: f32, z: f32| json!([s * x, y, s * z]);
    let mut bin = Vec::new();
    // A nose that points forward, with a morph that lengthens it and one that lifts it.
    let v = |x: f32, y: f32, z: f32| [s * x, y, s * z];
    floats(&mut bin, &[v(-0.1, 1.5, 0.1), v(0.1, 1.5, 0.1), v(0.0, 1.5, 0.4)].concat());
    floats(&mut bin, &[v(0.0, 0.0, 0.0), v(0.0, 0.0, 0.0), v(0.0, 0.0, 0.2)].concat());
    floats(&mut bin, &[v(0.0, 0.0, 0.0), v(0.0, 0.0, 0.0), v(0.0, 0.1, 0.0)].concat());
    // Bound to the head, which rests at (0, 1.5, 0).
    bin.extend([0u8, 0, 0, 0].repeat(3));
    floats(&mut bin, &[1.0, 0.0, 0.0, 0.0].repeat(3));
    floats(&mut bin, &[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.5, 0.0, 1.0]);
    // A clip: the head nods forward by 60°, its axis is the body's left (+X of a body that looks along +Z).
    floats(&mut bin, &[0.0, 1.0]);
    let half = 0.5f32;
    floats(&mut bin, &[0.0, 0.0, 0.0, 1.0, s * half, 0.0, 0.0, 0.866_025_4]);
    floats(&mut bin, &[0.0, 0.0, 1.0, 0.5]);
    let views = views(&[36, 36, 36, 12, 48, 64, 8, 32, 16]);
    let accessor = |view: usize, component: u32, count: usize, shape: &str| json!({ "bufferView": view, "componentType": component, "count": count, "type": shape });
    let mut json = json!({
        "asset": { "version": "2.0", "generator": "choreo's tests" },
        "scene": 0,
        "scenes": [{ "nodes": [0, 10] }],
        "nodes": [
            { "name": "hips", "translation": at(0.0, 1.0, 0.0), "children": [1] },
            { "name": "spine", "translation": at(0.0, 0.25, 0.0), "children": [2, 3] },
            { "name": "head", "translation": at(0.0, 0.25, 0.0), "children": [7, 11, 12] },
            { "name": "left upper arm", "translation": at(0.2, 0.1, 0.0), "children": [4] },
            { "name": "thumb a", "translation": at(0.5, 0.0, 0.05), "children": [5] },
            { "name": "thumb b", "translation": at(0.03, 0.0, 0.0), "children": [6] },
            { "name": "thumb c", "translation": at(0.02, 0.0, 0.0) },
            { "name": "hair 1", "translation": at(0.0, 0.1, -0.1), "children": [8] },
            { "name": "hair 2", "translation": at(0.0, -0.1, -0.05), "children": [9] },
            { "name": "hair 3", "translation": at(0.0, -0.1, 0.0) },
            { "name": "body", "mesh": 0, "skin": 0 },
            { "name": "hat", "mesh": 1, "translation": at(0.0, 0.2, 0.0) },
            { "name": "left eye", "translation": at(0.03, 0.05, 0.08) }
        ],
        "skins": [{ "joints": [2], "inverseBindMatrices": 5 }],
        "meshes": [
            { "name": "face", "extras": { "targetNames": ["long", "up"] }, "primitives": [{
                "attributes": { "POSITION": 0, "JOINTS_0": 3, "WEIGHTS_0": 4 },
                "targets": [{ "POSITION": 1 }, { "POSITION": 2 }], "material": 0
            }] },
            { "name": "hat", "primitives": [{ "attributes": { "POSITION": 0 }, "targets": [{ "POSITION": 1 }] }] }
        ],
        "materials": [{ "name": "skin", "pbrMetallicRoughness": { "baseColorFactor": [0.8, 0.6, 0.5, 1.0] } }],
        "animations": [{ "name": "nod",
            "samplers": [{ "input": 6, "output": 7 }, { "input": 6, "output": 8 }],
            "channels": [
                { "sampler": 0, "target": { "node": 2, "path": "rotation" } },
                { "sampler": 1, "target": { "node": 10, "path": "weights" } }
            ]
        }],
        "buffers": [{ "byteLength": bin.len() }],
        "bufferViews": views,
        "accessors": [
            accessor(0, 5126, 3, "VEC3"), accessor(1, 5126, 3, "VEC3"), accessor(2, 5126, 3, "VEC3"),
            accessor(3, 5121, 3, "VEC4"), accessor(4, 5126, 3, "VEC4"), accessor(5, 5126, 1, "MAT4"),
            accessor(6, 5126, 2, "SCALAR"), accessor(7, 5126, 2, "VEC4"), accessor(8, 5126, 4, "SCALAR")
        ]
    });
    let extensions = if version == Version::V1 { v1() } else { v0() };
    json["extensionsUsed"] = extensions.as_object().unwrap().keys().cloned().collect();
    json["extensions"] = extensions;
    (json, bin)
}

fn v1() -> Value {
    json!({
        "VRMC_vrm": {
            "specVersion": "1.0",
            "meta": { "name": "Tiny", "version": "2", "authors": ["Ada", "Bo"], "licenseUrl": "https://vrm.dev/licenses/1.0/",
                "commercialUsage": "corporation", "allowRedistribution": true },
            "humanoid": { "humanBones": {
                "hips": { "node": 0 }, "spine": { "node": 1 }, "head": { "node": 2 }, "leftUpperArm": { "node": 3 },
                "leftThumbMetacarpal": { "node": 4 }, "leftThumbProximal": { "node": 5 }, "leftThumbDistal": { "node": 6 },
                "leftEye": { "node": 12 }
            } },
            "expressions": {
                "preset": {
                    "happy": { "overrideBlink": "block", "morphTargetBinds": [{ "node": 10, "index": 1, "weight": 0.5 }] },
                    "blink": { "isBinary": true, "morphTargetBinds": [{ "node": 10, "index": 0, "weight": 1.0 }] }
                },
                "custom": { "liar": { "morphTargetBinds": [{ "node": 10, "index": 0, "weight": 1.0 }] } }
            },
            "lookAt": { "type": "bone", "offsetFromHeadBone": [0.0, 0.06, 0.1],
                "rangeMapHorizontalInner": { "inputMaxValue": 90.0, "outputScale": 8.0 } },
            "firstPerson": { "meshAnnotations": [{ "node": 10, "type": "thirdPersonOnly" }] }
        },
        "VRMC_springBone": {
            "specVersion": "1.0",
            "colliders": [{ "node": 2, "shape": { "sphere": { "offset": [0.01, 0.05, -0.02], "radius": 0.1 } } }],
            "colliderGroups": [{ "name": "head", "colliders": [0] }],
            "springs": [{ "name": "hair", "colliderGroups": [0], "center": 0, "joints": [
                { "node": 7, "stiffness": 0.5, "dragForce": 0.25, "hitRadius": 0.02, "gravityPower": 0.1, "gravityDir": [0.0, -2.0, 0.0] },
                { "node": 8, "stiffness": 0.75 }, { "node": 9 }
            ] }]
        }
    })
}

fn v0() -> Value {
    json!({ "VRM": {
        "exporterVersion": "choreo's tests", "specVersion": "0.0",
        "meta": { "title": "Tiny", "version": "2", "author": "Ada", "licenseName": "CC0", "allowedUserName": "Everyone" },
        "humanoid": { "humanBones": [
            { "bone": "hips", "node": 0 }, { "bone": "spine", "node": 1 }, { "bone": "head", "node": 2 },
            { "bone": "leftUpperArm", "node": 3 }, { "bone": "leftThumbProximal", "node": 4 },
            { "bone": "leftThumbIntermediate", "node": 5 }, { "bone": "leftThumbDistal", "node": 6 },
            { "bone": "leftEye", "node": 12 }, { "bone": "jaw", "node": -1 }
        ] },
        "blendShapeMaster": { "blendShapeGroups": [
            { "name": "Joy", "presetName": "joy", "binds": [{ "mesh": 0, "index": 1, "weight": 50.0 }] },
            { "name": "Blink", "presetName": "blink", "isBinary": true, "binds": [{ "mesh": 0, "index": 0, "weight": 100 }] },
            { "name": "liar", "presetName": "unknown", "binds": [{ "mesh": 0, "index": 0, "weight": 100 }] }
        ] },
        "firstPerson": { "firstPersonBone": 2, "firstPersonBoneOffset": { "x": 0.0, "y": 0.06, "z": 0.1 },
            "lookAtTypeName": "Bone", "lookAtHorizontalInner": { "xRange": 90.0, "yRange": 8.0 } },
        "secondaryAnimation": {
            "colliderGroups": [{ "node": 2, "colliders": [{ "offset": { "x": -0.01, "y": 0.05, "z": -0.02 }, "radius": 0.1 }] }],
            "boneGroups": [{ "comment": "hair", "bones": [7], "colliderGroups": [0], "center": 0, "stiffiness": 0.5,
                "dragForce": 0.25, "hitRadius": 0.02, "gravityPower": 0.2, "gravityDir": { "x": 0, "y": -1, "z": 0 } }]
        }
    } })
}

pub(crate) fn glb(version: Version) -> Vec<u8> {
    let (json, bin) = character(version);
    glb_of(&json, &bin)
}

/// The character with its JSON changed.
pub(crate) fn edited(version: Version, edit: impl FnOnce(&mut Value)) -> Vec<u8> {
    let (mut json, bin) = character(version);
    edit(&mut json);
    glb_of(&json, &bin)
}

/// The human bones of the character nod by 60° and rise by half a hip's height, on a rig that rests in other axes: the head's x
/// axis points forward. `happy` comes in.
pub(crate) fn animation() -> (Value, Vec<u8>) {
    let mut bin = Vec::new();
    floats(&mut bin, &[0.0, 1.0]);
    // The head rests turned by −90° about y: its x axis points forward (+Z), its z axis to −X. Left is −z.
    let (sin, cos) = (0.5f32, 0.866_025_4f32);
    let rest = [0.0f32, -std::f32::consts::FRAC_1_SQRT_2, 0.0, std::f32::consts::FRAC_1_SQRT_2];
    floats(&mut bin, &rest);
    // rest · nod, a nod about the joint's own −z by 60° = about the body's left.
    let nod = glam::Quat::from_array(rest) * glam::Quat::from_xyzw(0.0, 0.0, -sin, cos);
    floats(&mut bin, &nod.to_array());
    floats(&mut bin, &[0.0, 2.0, 0.0, 0.0, 3.0, 0.0]);
    floats(&mut bin, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    let views = views(&[8, 32, 24, 24]);
    let accessor = |view: usize, count: usize, shape: &str| json!({ "bufferView": view, "componentType": 5126, "count": count, "type": shape });
    let json = json!({
        "asset": { "version": "2.0", "generator": "choreo's tests" },
        "scene": 0,
        "scenes": [{ "nodes": [0, 3, 4] }],
        "nodes": [
            { "name": "H", "translation": [0.0, 2.0, 0.0], "children": [1] },
            { "name": "S", "translation": [0.0, 0.5, 0.0], "children": [2] },
            { "name": "K", "translation": [0.0, 0.5, 0.0], "rotation": rest },
            { "name": "happy" }, { "name": "gaze" }
        ],
        "animations": [{ "name": "yes",
            "samplers": [{ "input": 0, "output": 1 }, { "input": 0, "output": 2 }, { "input": 0, "output": 3 }],
            "channels": [
                { "sampler": 0, "target": { "node": 2, "path": "rotation" } },
                { "sampler": 1, "target": { "node": 0, "path": "translation" } },
                { "sampler": 2, "target": { "node": 3, "path": "translation" } }
            ]
        }],
        "buffers": [{ "byteLength": bin.len() }],
        "bufferViews": views,
        "accessors": [accessor(0, 2, "SCALAR"), accessor(1, 2, "VEC4"), accessor(2, 2, "VEC3"), accessor(3, 2, "VEC3")],
        "extensionsUsed": ["VRMC_vrm_animation"],
        "extensions": { "VRMC_vrm_animation": {
            "specVersion": "1.0",
            "humanoid": { "humanBones": { "hips": { "node": 0 }, "spine": { "node": 1 }, "head": { "node": 2 } } },
            "expressions": { "preset": { "happy": { "node": 3 } } },
            "lookAt": { "node": 4 }
        } }
    });
    (json, bin)
}
