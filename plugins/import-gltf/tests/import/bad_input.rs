//! Damaged and hostile files give an error with place and reason; they never cause a panic, a hang or exhausted memory.

use crate::common;
use crate::common::sample::{POSITIONS, ROTATIONS, TIMES, WEIGHTS, sample};
use choreo_asset::Asset;
use choreo_importer_kit_testing::{damage::random, own_process};
use choreo_plugin::{Claim, Files, ImportOptions, ImportScope, Importer};
use import_gltf::GltfImporter;
use serde_json::{Value, json};
use std::sync::Arc;

fn import(json: &Value, bin: &[u8]) -> Result<Asset, choreo_plugin::ImportError> {
    common::import_bytes("bad.glb", common::glb_of(json, bin))
}

/// The error text of the sample with its JSON changed.
fn with_json(edit: impl FnOnce(&mut Value)) -> String {
    let (mut json, bin) = sample();
    edit(&mut json);
    common::error_text(import(&json, &bin))
}

/// The same with a float of its buffer changed.
fn with_float(offset: usize, value: f32) -> String {
    let (json, mut bin) = sample();
    bin[offset..offset + 4].copy_from_slice(&value.to_le_bytes());
    common::error_text(import(&json, &bin))
}

#[test]
fn the_unchanged_sample_is_imported() {
    let (json, bin) = sample();
    let asset = import(&json, &bin).unwrap();
    assert_eq!(asset.warnings, []);
    assert_eq!((asset.clips.len(), asset.skins.len(), asset.meshes[0].morph_targets), (1, 1, 1));
    assert_eq!(asset.meshes[0].primitives[0].joint_weights[..4], [0.75, 0.25, 0.0, 0.0]);
}

#[test]
fn non_finite_numbers_are_errors() {
    assert_eq!(
        with_float(POSITIONS + 16, f32::NAN),
        "bad.glb: meshes[0].primitives[0].POSITION (accessors[0]): element 1 holds NaN, only finite numbers are allowed"
    );
    assert_eq!(
        with_float(WEIGHTS + 4, f32::INFINITY),
        "bad.glb: meshes[0].primitives[0].WEIGHTS_0 (accessors[5]): element 0 holds inf, only finite numbers are allowed"
    );
    assert_eq!(
        with_float(ROTATIONS + 44, f32::NEG_INFINITY),
        "bad.glb: animations[0].channels[0] (accessors[3]): element 2 holds -inf, only finite numbers are allowed"
    );
    assert_eq!(
        with_float(TIMES + 4, f32::NAN),
        "bad.glb: animations[0].channels[0] (accessors[2]): element 1 holds NaN, only finite numbers are allowed"
    );
    let text = with_json(|j| j["nodes"][2]["translation"][1] = json!(1e39));
    assert_eq!(text, "bad.glb: nodes[2]: translation, rotation or scale is not finite");
}

#[test]
fn invalid_key_times_are_errors() {
    assert_eq!(
        with_float(TIMES + 8, 0.25),
        "bad.glb: animations[0].channels[0] (accessors[2]): key 2 is at 0.25 s, before key 1 at 0.5 s"
    );
    assert_eq!(
        with_float(TIMES, -1.0),
        "bad.glb: animations[0].channels[0] (accessors[2]): key 0 is at -1 s; key times start at 0"
    );
    assert_eq!(
        with_float(TIMES + 8, 1e30),
        "bad.glb: animations[0].channels[0] (accessors[2]): key 2 is at 1000000000000000000000000000000 s; the limit is 10000000 s"
    );
    // Repeated: the last of the equals is used, with a warning.
    let (json, mut bin) = sample();
    bin.copy_within(TIMES + 4..TIMES + 8, TIMES);
    let asset = import(&json, &bin).unwrap();
    let curve = &asset.clips[0].curves()[0];
    assert_eq!(curve.times.len(), 2);
    assert_eq!(curve.values[..4], [0.0, 0.0, 0.6, 0.8]);
    assert_eq!(asset.warnings[0].text, "1 of 3 key times repeat; the last key of each time is used");
    // A rotation of length zero.
    let (json, mut bin) = sample();
    bin[ROTATIONS..ROTATIONS + 16].fill(0);
    let text = common::error_text(import(&json, &bin));
    assert!(
        text.starts_with("bad.glb: animations[0].channels[0]: the rotation of key 0 has length zero"),
        "{text}"
    );
}

#[test]
fn wrong_counts_and_indices_are_errors() {
    assert_eq!(
        with_json(|j| j["accessors"][0]["count"] = json!(u64::MAX)),
        "bad.glb: meshes[0].primitives[0].POSITION (accessors[0]): the file's data take more than 2048 MiB when decoded, which is the limit"
    );
    assert_eq!(
        with_json(|j| j["accessors"][0]["count"] = json!(1_000_000)),
        "bad.glb: meshes[0].primitives[0].POSITION (accessors[0]): 1000000 elements end at byte 12000000 of bufferViews[0], which has 36 bytes"
    );
    let text = with_json(|j| j["accessors"][0]["count"] = json!(-3));
    assert!(text.starts_with("bad.glb: accessors[0].count (byte "), "{text}");
    assert!(text.ends_with("not valid glTF JSON: invalid value: integer `-3`, expected u64"), "{text}");
    assert_eq!(
        with_json(|j| {
            j["accessors"][0].as_object_mut().unwrap().remove("bufferView");
            j["accessors"][0]["count"] = json!(100_000_000);
        }),
        "bad.glb: meshes[0].primitives[0].POSITION (accessors[0]): has no bufferView and 100000000 elements; the limit for those is 16777216"
    );
    assert_eq!(
        with_json(|j| j["bufferViews"][7]["byteLength"] = json!(37)),
        "bad.glb: meshes[0].primitives[0].targets[0].POSITION (bufferViews[7]): ends at byte 329 of buffers[0], which has 328 bytes"
    );
    assert_eq!(
        with_json(|j| j["buffers"][0]["byteLength"] = json!(1_u64 << 40)),
        "bad.glb: skins[0].inverseBindMatrices (buffers[0]): should have 1099511627776 bytes, but the GLB's binary chunk has 328"
    );
    assert_eq!(
        with_json(|j| j["bufferViews"][0]["byteStride"] = json!(8)),
        "bad.glb: meshes[0].primitives[0].POSITION (accessors[0]): elements of 12 bytes do not fit the stride of 8 of bufferViews[0]"
    );
    let (json, mut bin) = sample();
    bin[common::sample::INDICES + 4] = 9;
    assert_eq!(
        common::error_text(import(&json, &bin)),
        "bad.glb: meshes[0].primitives[0].indices (accessors[1]): element 2 is vertex 9, but the number of vertices is 3"
    );
    let (json, mut bin) = sample();
    bin[common::sample::JOINTS + 1] = 2;
    assert_eq!(
        common::error_text(import(&json, &bin)),
        "bad.glb: nodes[0]: meshes[0] uses joint 2, but skins[0] has 2 joints"
    );
    for (pointer, place) in [
        (
            "/meshes/0/primitives/0/attributes/POSITION",
            "meshes[0].primitives[0].POSITION (accessors[99]): refers to accessors[99], but the last is accessors[7]",
        ),
        ("/nodes/0/mesh", "nodes[0].mesh: refers to meshes[99], but the last is meshes[0]"),
        ("/nodes/0/skin", "nodes[0].skin: refers to skins[99], but the last is skins[0]"),
        ("/skins/0/joints/1", "skins[0].joints: refers to nodes[99], but the last is nodes[2]"),
        (
            "/meshes/0/primitives/0/material",
            "meshes[0].primitives[0].material: refers to materials[99], but the last is materials[0]",
        ),
        (
            "/animations/0/channels/0/sampler",
            "animations[0].channels[0]: refers to samplers[99], but the last is samplers[0]",
        ),
        (
            "/animations/0/channels/0/target/node",
            "animations[0].channels[0]: refers to nodes[99], but the last is nodes[2]",
        ),
        (
            "/animations/0/samplers/0/output",
            "animations[0].channels[0] (accessors[99]): refers to accessors[99], but the last is accessors[7]",
        ),
        (
            "/bufferViews/0/buffer",
            "meshes[0].primitives[0].POSITION (buffers[99]): refers to buffers[99], but the last is buffers[0]",
        ),
        (
            "/accessors/0/bufferView",
            "meshes[0].primitives[0].POSITION (accessors[0]): refers to bufferViews[99], but the last is bufferViews[7]",
        ),
        ("/scenes/0/nodes/0", "scenes[0].nodes: refers to nodes[99], but the last is nodes[2]"),
        ("/scene", "scene: refers to scenes[99], but the last is scenes[0]"),
    ] {
        assert_eq!(with_json(|j| *j.pointer_mut(pointer).unwrap() = json!(99)), format!("bad.glb: {place}"));
    }
    assert_eq!(
        with_json(|j| j["accessors"][3]["count"] = json!(2)),
        "bad.glb: animations[0].channels[0]: has 3 keys and needs 12 numbers, but accessors[3] holds 8"
    );
    assert_eq!(
        with_json(|j| j["accessors"][0]["type"] = json!("VEC2")),
        "bad.glb: meshes[0].primitives[0].POSITION (accessors[0]): is of type VEC2, but VEC3 is needed here"
    );
}

#[test]
fn invalid_node_trees_are_errors() {
    assert_eq!(
        with_json(|j| j["nodes"][2]["children"] = json!([1])),
        "bad.glb: nodes[1]: is its own ancestor: the node tree has a cycle"
    );
    assert_eq!(
        with_json(|j| j["nodes"][2]["children"] = json!([2])),
        "bad.glb: nodes[2]: has two parents, nodes[1] and nodes[2]; a node may have one"
    );
    assert_eq!(
        with_json(|j| j["nodes"][0]["children"] = json!([2])),
        "bad.glb: nodes[2]: has two parents, nodes[0] and nodes[1]; a node may have one"
    );
    // A chain deeper than any stack.
    let n = 200_000;
    let nodes: Vec<Value> =
        (0..n).map(|i| if i + 1 < n { json!({"children": [i + 1]}) } else { json!({}) }).collect();
    let json = json!({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": nodes});
    assert_eq!(import(&json, &[]).unwrap().skeleton.len(), n);
    // JSON nested deeper than any stack.
    let deep = format!("{{\"asset\":{{\"version\":\"2.0\"}},\"extras\":{}", "[".repeat(1_000_000));
    let text = common::error_text(common::import_bytes("bad.gltf", deep.into_bytes()));
    assert!(text.contains("recursion limit exceeded") || text.contains("EOF"), "{text}");
}

#[test]
fn too_many_nodes_are_an_error() {
    let json = format!("{{\"asset\":{{\"version\":\"2.0\"}},\"nodes\":[{}{{}}]}}", "{},".repeat(3 << 20));
    assert_eq!(
        common::error_text(common::import_bytes("bad.gltf", json.into_bytes())),
        "bad.gltf: byte 0: the JSON has about 3145731 objects; the limit is 2097152"
    );
}

#[test]
fn zero_weights_become_the_first_joint_with_a_warning() {
    let (json, mut bin) = sample();
    bin[WEIGHTS..WEIGHTS + 16].fill(0);
    let asset = import(&json, &bin).unwrap();
    assert_eq!(asset.meshes[0].primitives[0].joint_weights[..4], [1.0, 0.0, 0.0, 0.0]);
    assert_eq!(asset.warnings.len(), 1);
    assert_eq!(
        asset.warnings[0].text,
        "1 of 3 vertices have weights that sum to 0; their first joint gets weight 1"
    );
}

struct Fails(&'static str);

impl Files for Fails {
    fn read(&self, _: &str) -> Result<Arc<Vec<u8>>, String> {
        Err(self.0.to_string())
    }
}

#[test]
fn unreadable_external_files_are_errors() {
    let (mut json, _) = sample();
    let mut text_of = |uri: &str, files: &dyn Files| {
        json["buffers"][0]["uri"] = json!(uri);
        let source = common::source("bad.gltf", serde_json::to_vec(&json).unwrap());
        common::error_text(GltfImporter::new().import(
            &source,
            files,
            ImportScope::ALL,
            &ImportOptions::default(),
        ))
    };
    let wrong = |text: String, tail: &str| {
        assert!(text.contains("buffers[0]") && text.ends_with(tail), "{text}");
    };
    wrong(text_of("my%20data.bin", &common::Companions::none()), "\"my data.bin\": file not found");
    wrong(text_of("folder", &Fails("is a directory")), "cannot read \"folder\": is a directory");
    wrong(
        text_of("../../etc/passwd", &Fails("lies outside")),
        "cannot read \"../../etc/passwd\": lies outside",
    );
    wrong(
        text_of("data:;base64,AA!A", &common::Companions::none()),
        "letter 2 of the base64 data, '!', is not base64",
    );
    wrong(
        text_of("data:;base64,AAAA", &common::Companions::none()),
        "should have 328 bytes, but its data URI has 3",
    );
}

/// A PNG of this size with nothing in it.
fn png_header(width: u32, height: u32) -> Vec<u8> {
    let crc = |bytes: &[u8]| {
        !bytes.iter().fold(!0u32, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xEDB8_8320 } else { c >> 1 })
        })
    };
    let mut out = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |kind: &[u8], data: &[u8]| {
        out.extend((data.len() as u32).to_be_bytes());
        let body = [kind, data].concat();
        out.extend(&body);
        out.extend(crc(&body).to_be_bytes());
    };
    let mut header = width.to_be_bytes().to_vec();
    header.extend(height.to_be_bytes());
    header.extend([8, 6, 0, 0, 0]);
    chunk(b"IHDR", &header);
    chunk(b"IDAT", &[0x78, 0x9c, 3, 0, 0, 0, 0, 1]);
    chunk(b"IEND", &[]);
    out
}

#[test]
fn damaged_images_are_warnings() {
    let with_picture = |bytes: &[u8]| {
        let (mut json, mut bin) = sample();
        json["bufferViews"]
            .as_array_mut()
            .unwrap()
            .push(json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len()}));
        bin.extend(bytes);
        json["buffers"][0]["byteLength"] = json!(bin.len());
        json["images"] = json!([{"bufferView": 8, "name": "coat"}]);
        json["textures"] = json!([{"source": 0}]);
        json["materials"][0]["pbrMetallicRoughness"] = json!({"baseColorTexture": {"index": 0}});
        // The model is there, without the image.
        let asset = import(&json, &bin).unwrap();
        assert_eq!((asset.instances.len(), asset.warnings.len()), (1, 1));
        assert!(asset.images.iter().all(|i| i.rgba == [255; 4]));
        format!("{}: {}", asset.warnings[0].place, asset.warnings[0].text)
    };
    assert_eq!(
        with_picture(&png_header(10_000, 10_000)),
        "images[0]: \"coat\" has 10000 x 10000 pixels; the limits are 1 pixel and 64 megapixels; the texture is left out"
    );
    assert_eq!(
        with_picture(&png_header(20_000, 2)),
        "images[0]: \"coat\" has 20000 x 2 pixels; the limit is 16384 a side; the texture is left out"
    );
    let text = with_picture(&png_header(4, 4));
    assert!(text.starts_with("images[0]: \"coat\" cannot be decoded: "), "{text}");
    assert!(text.ends_with("; white is used"), "{text}");
    assert_eq!(
        with_picture(b"GIF89a and so on"),
        "images[0]: \"coat\" is not a PNG, JPEG, WebP or KTX2 image; the texture is left out"
    );
    let text = with_picture(b"\x89PNG\r\n\x1a\n");
    assert!(text.starts_with("images[0]: \"coat\" has a damaged header: "), "{text}");
}

#[test]
fn unsupported_versions_and_required_extensions_are_errors() {
    assert_eq!(
        with_json(|j| j["asset"]["version"] = json!("1.0")),
        "bad.glb: asset.version: glTF 1.0 is not supported, only 2.0"
    );
    let (mut json, bin) = sample();
    json["extensionsRequired"] = json!(["MSFT_texture_dds"]);
    json["extensionsUsed"] = json!(["MSFT_texture_dds", "VENDOR_thing"]);
    let error = import(&json, &bin).unwrap_err();
    assert_eq!(
        error.to_string(),
        "bad.glb: extensionsRequired: the file needs MSFT_texture_dds, which is not supported"
    );
    assert!(error.hint.unwrap().contains("KTX2"));
    json["extensionsRequired"] = json!(["VENDOR_thing"]);
    let warnings = import(&json, &bin).unwrap().warnings;
    assert_eq!(warnings.len(), 2);
    let expected =
        "the file requires VENDOR_thing, which is not supported; without it the model may look wrong";
    assert_eq!((warnings[1].text.as_str(), warnings[1].place.as_str()), (expected, "extensionsRequired"));
}

#[test]
fn files_are_claimed_by_content() {
    let claim = |name: &str, bytes: &[u8]| GltfImporter::new().claim(&common::source(name, bytes.to_vec()));
    let (json, bin) = sample();
    assert_eq!(claim("x", &common::glb_of(&json, &bin)), Claim::Content(95));
    assert_eq!(claim("x.json", &serde_json::to_vec(&json).unwrap()), Claim::Content(95));
    assert_eq!(claim("package.json", br#"{"name":"x","version":"1"}"#), Claim::NotMine);
    assert_eq!(claim("mine.gltf", br#"{"asset":7}"#), Claim::NotMine);
    assert_eq!(claim("cut.gltf", br#"{"asset":{"version":"2.0"},"no"#), Claim::Extension);
    assert_eq!(claim("x.bvh", b"HIERARCHY"), Claim::NotMine);
}

/// Imports a damaged file; a panic fails the test. Returns whether the import gave an error.
fn damaged(name: &str, bytes: Vec<u8>) -> bool {
    match common::import_bytes(name, bytes) {
        Ok(asset) => {
            for p in asset.meshes.iter().flat_map(|m| &m.primitives) {
                assert!(p.positions.iter().all(|v| v.is_finite()));
                assert!(p.indices.iter().all(|i| (*i as usize) < p.positions.len()));
            }
            false
        }
        Err(e) => {
            assert!(!e.what.is_empty() && !e.place.is_empty(), "{e:?}");
            true
        }
    }
}

#[test]
fn truncated_files_and_flipped_bits_do_not_panic() {
    if own_process::ran_in_own_process() {
        return;
    }
    let (json, bin) = sample();
    let mut cases = vec![("sample.glb".to_string(), common::glb_of(&json, &bin), 4000)];
    for (name, bytes) in [
        ("packed.glb", &include_bytes!("../samples/packed.glb")[..]),
        ("layers.gltf", &include_bytes!("../samples/layers.gltf")[..]),
    ] {
        cases.push((name.to_string(), bytes.to_vec(), 1000));
    }
    if let Some(folder) = common::assets(3) {
        for (name, flips) in [("Fox.glb", 1000), ("SimpleSkin.gltf", 1000), ("Knight.glb", 120)] {
            cases.push((name.to_string(), std::fs::read(folder.join("gltf").join(name)).unwrap(), flips));
        }
    }
    for (name, bytes, flips) in cases {
        for cut in 0..50 {
            let length = bytes.len() * cut / 50;
            assert!(damaged(&name, bytes[..length].to_vec()), "{name} cut at {length} was read");
        }
        let mut state = 1;
        let mut refused = 0;
        for flip in 0..flips {
            let mut copy = bytes.clone();
            // Half of the flips in the head, where the JSON of a GLB is.
            let range = if flip % 2 == 0 { copy.len() } else { copy.len().min(16_000) } as u64;
            let bit = random(&mut state) % (range * 8);
            copy[(bit / 8) as usize] ^= 1 << (bit % 8);
            refused += usize::from(damaged(&name, copy));
        }
        println!("{name}: {refused} of {flips} flips refused");
        assert!(refused > 0 && refused < flips, "{name}: {refused} of {flips}");
    }
    // Peak memory of the whole run is bounded (Linux reports it).
    if let Ok(status) = std::fs::read_to_string("/proc/self/status")
        && let Some(line) = status.lines().find(|l| l.starts_with("VmHWM:"))
    {
        let kib: u64 = line.split_whitespace().nth(1).unwrap().parse().unwrap();
        println!("{line}");
        assert!(kib < 1 << 20, "{line}");
    }
}
