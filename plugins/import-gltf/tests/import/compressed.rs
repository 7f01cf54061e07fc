//! Draco and KTX2: a surface and an image of known formulas, packed by the programs of Google and Binomial (npm), against what was packed.
//! The samples are such files, so that the tests need no registry; `CHOREO_ACCEPT=1` with npm regenerates them.

use crate::common;
use choreo_asset::{Asset, Primitive};
use choreo_importer_kit_testing::damage;
use choreo_importer_kit_testing::npm::Packages;
use glam::{Vec2, Vec3, Vec4};
use import_gltf::GltfImporter;
use serde_json::json;
use std::path::Path;

/// Vertices of a side of the surface.
const SIDE: usize = 13;
const IMAGE: [u32; 2] = [40, 28];
const PACKAGES: [&str; 6] = [
    "@gltf-transform/core@4.5.1",
    "@gltf-transform/extensions@4.5.1",
    "@gltf-transform/functions@4.5.1",
    "draco3dgltf@1.5.7",
    "ktx2-encoder@0.6.0",
    "three@0.187.0",
];
const DRACO: [&str; 2] = ["edgebreaker", "sequential"];
const KTX2: [&str; 3] = ["etc1s", "uastc", "zstd"];

fn sample(name: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/samples");
    std::fs::read(folder.join(format!("{name}.glb"))).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Two gradients and an edge, with alpha.
fn pixels() -> Vec<u8> {
    let [width, height] = IMAGE;
    let pixel = |x: u32, y: u32| {
        let blue = if x + y < 34 { 60 } else { 180 };
        [(6 * x) as u8, (9 * y) as u8, blue, (255 - 3 * x) as u8]
    };
    (0..height).flat_map(|y| (0..width).flat_map(move |x| pixel(x, y))).collect()
}

/// The surface, unpacked: positions, normals, uvs, colors of 8 bits, joints and weights.
fn uncompressed_glb() -> Vec<u8> {
    let mut bin = Vec::new();
    let (mut views, mut accessors) = (Vec::new(), Vec::new());
    let mut add = |bytes: Vec<u8>, component: u32, shape: &str, count: usize| {
        views.push(json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": bytes.len()}));
        accessors.push(
            json!({"bufferView": views.len() - 1, "componentType": component, "type": shape, "count": count}),
        );
        bin.extend(bytes);
        bin.resize(bin.len().next_multiple_of(4), 0);
    };
    let vertices: Vec<[f32; 2]> = (0..SIDE * SIDE)
        .map(|v| [(v % SIDE) as f32 / (SIDE - 1) as f32, (v / SIDE) as f32 / (SIDE - 1) as f32])
        .collect();
    let mut floats = |shape: &str, one: &dyn Fn(f32, f32) -> Vec<f32>| {
        let bytes = vertices.iter().flat_map(|[x, z]| one(*x, *z)).flat_map(f32::to_le_bytes).collect();
        add(bytes, 5126, shape, SIDE * SIDE);
    };
    floats("VEC3", &|x, z| vec![3.0 * x - 1.0, (x - 0.5) * (x - 0.5) + 0.3 * z * z, 2.0 * z]);
    floats("VEC3", &|x, z| Vec3::new(1.0 - 2.0 * x, 1.5, -0.6 * z).normalize().to_array().to_vec());
    floats("VEC2", &|x, z| vec![x, 1.0 - z]);
    floats("VEC4", &|x, z| vec![x, 1.0 - x, 0.5 * z, 0.0]);
    let colors = |[x, z]: &[f32; 2]| [(255.0 * x) as u8, (255.0 * z) as u8, 128, 255];
    add(vertices.iter().flat_map(colors).collect(), 5121, "VEC4", SIDE * SIDE);
    add(
        vertices.iter().flat_map(|[x, _]| [0, 1, u8::from(*x > 0.5), 0]).collect(),
        5121,
        "VEC4",
        SIDE * SIDE,
    );
    let cells = (0..SIDE - 1).flat_map(|z| (0..SIDE - 1).map(move |x| (z * SIDE + x) as u16));
    let side = SIDE as u16;
    let indices: Vec<u16> = cells.flat_map(|a| [a, a + side, a + 1, a + 1, a + side, a + side + 1]).collect();
    let count = indices.len();
    add(indices.into_iter().flat_map(u16::to_le_bytes).collect(), 5123, "SCALAR", count);
    (accessors[0]["min"], accessors[0]["max"]) = (json!([-1.0, 0.0, 0.0]), json!([2.0, 0.55, 2.0]));
    accessors[4]["normalized"] = json!(true);
    let mut png = std::io::Cursor::new(Vec::new());
    let [width, height] = IMAGE;
    image::write_buffer_with_format(
        &mut png,
        &pixels(),
        width,
        height,
        image::ColorType::Rgba8,
        image::ImageFormat::Png,
    )
    .unwrap();
    let png = png.into_inner();
    views.push(json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": png.len()}));
    bin.extend(&png);
    bin.resize(bin.len().next_multiple_of(4), 0);
    let attributes =
        json!({"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "WEIGHTS_0": 3, "COLOR_0": 4, "JOINTS_0": 5});
    let json = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1, 2]}],
        "nodes": [{"mesh": 0, "skin": 0}, {}, {}], "skins": [{"joints": [1, 2]}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 6, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}], "images": [{"bufferView": 7, "mimeType": "image/png"}],
        "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": bin.len()}],
    });
    common::glb_of(&json, &bin)
}

fn read(name: &str, bytes: Vec<u8>) -> Asset {
    let asset = common::import_bytes(name, bytes).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(asset.warnings, [], "{name}");
    asset
}

/// The largest differences of two vertices.
#[derive(Debug, Default)]
struct VertexDifference {
    position: f32,
    /// Radians.
    normal: f32,
    uv: f32,
    weight: f32,
    color: f32,
}

/// Compares a compressed surface with the original. Vertices are matched by position, because Draco reorders them.
fn vertex_difference(plain: &Primitive, packed: &Primitive) -> Result<VertexDifference, String> {
    if packed.positions.len() != plain.positions.len() {
        return Err(format!("{} vertices", packed.positions.len()));
    }
    let nearest = |p: &Vec3| {
        let far = |v: &usize| plain.positions[*v].distance(*p);
        (0..plain.positions.len()).min_by(|a, b| far(a).total_cmp(&far(b))).unwrap()
    };
    let of: Vec<usize> = packed.positions.iter().map(nearest).collect();
    let weights = |p: &Primitive, v: usize| Vec4::from_slice(&p.joint_weights[4 * v..4 * v + 4]);
    let mut apart = VertexDifference::default();
    for (v, w) in of.iter().enumerate() {
        let most = |value: &mut f32, found: f32| *value = value.max(found);
        let delta = (packed.positions[v] - plain.positions[*w]).abs();
        most(&mut apart.position, delta.max_element());
        most(&mut apart.normal, packed.normals[v].normalize().angle_between(plain.normals[*w]));
        let uv: Vec2 = packed.uvs[0][v] - plain.uvs[0][*w];
        most(&mut apart.uv, uv.abs().max_element());
        most(&mut apart.weight, (weights(packed, v) - weights(plain, *w)).abs().max_element());
        most(&mut apart.color, (packed.colors[v] - plain.colors[*w]).abs().max_element());
        let joints = |p: &Primitive, v: usize| p.joint_indices[4 * v..4 * v + 4].to_vec();
        if joints(packed, v) != joints(plain, *w) {
            return Err(format!("joints of vertex {v}: {:?}", joints(packed, v)));
        }
    }
    let triangles = |indices: &[u32], of: &dyn Fn(u32) -> u32| {
        let mut all: Vec<[u32; 3]> = indices.as_chunks::<3>().0.iter().map(|t| t.map(of)).collect();
        for triangle in &mut all {
            let first = (0..3).min_by_key(|i| triangle[*i]).unwrap();
            triangle.rotate_left(first);
        }
        all.sort_unstable();
        all
    };
    let same = triangles(&packed.indices, &|i| of[i as usize] as u32) == triangles(&plain.indices, &|i| i);
    if same { Ok(apart) } else { Err("other triangles".into()) }
}

/// Within half a step of the quantization: 14 bits of the surface's longest side (3), 12 of uvs and weights, 8 of colors (whole numbers,
/// exact), 10 of the octahedron of directions, on which a step is at most 4/1022 rad long.
fn check_draco(name: &str, bytes: Vec<u8>) -> Result<(), String> {
    let (plain, packed) = (read("plain.glb", uncompressed_glb()), read(name, bytes));
    let apart = vertex_difference(&plain.meshes[0].primitives[0], &packed.meshes[0].primitives[0])?;
    println!("{name}: {apart:?}");
    let half = |range: f32, bits: i32| 0.5 * range / ((1 << bits) - 1) as f32 + 1e-6;
    let within = apart.position <= half(3.0, 14)
        && apart.normal <= 4.0 / 1022.0
        && apart.uv <= half(1.0, 12)
        && apart.weight <= 2.0 * half(1.0, 12)
        && apart.color <= 0.5 / 255.0;
    if within { Ok(()) } else { Err(format!("{apart:?}")) }
}

/// The mean difference of a channel, of 255, from what was packed.
fn check_ktx2(name: &str, bytes: Vec<u8>) -> Asset {
    let asset = read(name, bytes);
    let image = &asset.images[0];
    assert_eq!([image.width, image.height], IMAGE);
    let pixels = pixels();
    let sum: u32 = image.rgba.iter().zip(&pixels).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
    let mean = f64::from(sum) / pixels.len() as f64;
    println!("{name}: {mean:.2} of 255");
    assert!(mean < if name.starts_with("etc1s") { 6.0 } else { 1.5 }, "{name}: {mean}");
    asset
}

#[test]
fn draco_is_within_its_quantization() {
    for name in DRACO {
        check_draco(name, sample(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
}

#[test]
fn ktx2_is_close_to_the_original_image() {
    for name in KTX2 {
        check_ktx2(name, sample(name));
    }
}

/// Packed now, by npm's packages; KTX2 has exactly the pixels of Binomial's own transcoder.
#[test]
fn compressed_files_of_other_programs_are_read() {
    let Some(packages) = Packages::install(env!("CARGO_TARGET_TMPDIR"), "gltf-packers", &PACKAGES) else {
        return;
    };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("packed");
    std::fs::create_dir_all(&folder).unwrap();
    let (input, colors) = (folder.join("plain.glb"), folder.join("pixels"));
    std::fs::write(&input, uncompressed_glb()).unwrap();
    std::fs::write(&colors, pixels()).unwrap();
    packages.run("pack.mjs", include_str!("../common/pack.mjs"), &[&input, &colors, &folder]);
    let packed = |name: &str| std::fs::read(folder.join(name)).unwrap();
    for name in DRACO {
        check_draco(name, packed(&format!("{name}.glb"))).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
    for name in KTX2 {
        let asset = check_ktx2(name, packed(&format!("{name}.glb")));
        assert!(
            asset.images[0].rgba == packed(&format!("{name}.rgba")),
            "{name}: other pixels than Binomial's"
        );
    }
    if std::env::var_os("CHOREO_ACCEPT").is_some() {
        let samples = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/samples");
        for name in DRACO.into_iter().chain(KTX2) {
            std::fs::write(samples.join(format!("{name}.glb")), packed(&format!("{name}.glb"))).unwrap();
        }
    }
}

#[test]
fn errors_in_compressed_data_name_the_element() {
    let place = "bad.glb: meshes[0].primitives[0].KHR_draco_mesh_compression";
    let said = |edit: &dyn Fn(&mut serde_json::Value, &mut Vec<u8>)| {
        common::error_text(common::import_bytes("bad.glb", common::edited(&sample("edgebreaker"), edit)))
    };
    let extension = |json: &mut serde_json::Value, key: &str, value: serde_json::Value| {
        json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"][key] = value;
    };
    assert_eq!(
        said(&|json, _| extension(json, "bufferView", json!("0"))),
        format!("{place}: has no bufferView")
    );
    let text = said(&|json, _| extension(json, "attributes", json!({"POSITION": 99})));
    assert_eq!(text, format!("{place}.POSITION: is attribute 99, which the data do not have"));
    let text = said(&|json, _| {
        let position = &json["meshes"][0]["primitives"][0]["attributes"]["POSITION"];
        let position = position.as_u64().unwrap() as usize;
        json["accessors"][position]["type"] = json!("VEC2");
    });
    assert!(text.starts_with(place) && text.contains("has 3 components, but accessors["), "{text}");
    let text = said(&|json, _| {
        let packed = &json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"];
        let view = packed["bufferView"].as_u64().unwrap() as usize;
        json["bufferViews"][view]["byteLength"] = json!(40);
    });
    assert!(text.starts_with(&format!("{place}: cannot be decoded: ")), "{text}");
}

/// Each is a warning, and the texture is left out or white.
#[test]
fn damaged_ktx2_images_are_warnings() {
    let warned = |name: &str, at: usize, bytes: &[u8]| {
        let file = common::edited(&sample(name), |json, bin| {
            let view = json["images"][0]["bufferView"].as_u64().unwrap() as usize;
            let start = json["bufferViews"][view]["byteOffset"].as_u64().unwrap_or(0) as usize;
            bin[start + at..start + at + bytes.len()].copy_from_slice(bytes);
        });
        let asset = common::import_bytes("bad.glb", file).unwrap_or_else(|e| panic!("{e}"));
        asset.warnings.iter().map(|w| w.text.clone()).collect::<Vec<_>>().join("; ")
    };
    for (name, at, bytes, told) in [
        ("uastc", 12, &37u32.to_le_bytes()[..], "has Vulkan format 37; KTX2 must be ETC1S or UASTC"),
        (
            "uastc",
            36,
            &6u32.to_le_bytes(),
            "has a depth of 0, 0 layers, 6 faces and 6 levels; it should be one 2D image",
        ),
        ("uastc", 20, &60_000u32.to_le_bytes(), "has 60000 x 28 pixels; the limit is 16384 a side"),
        ("uastc", 80, &u64::MAX.to_le_bytes(), "is cut off"),
        ("etc1s", 72, &u64::MAX.to_le_bytes(), "is cut off"),
        // As much memory as a file asks for.
        (
            "zstd",
            96,
            &(1u64 << 45).to_le_bytes(),
            "says it unpacks to 35184372088832 bytes, but its size needs 1120",
        ),
        ("etc1s", 64, &16u64.to_le_bytes(), "its data are damaged; white is used"),
    ] {
        let text = warned(name, at, bytes);
        assert!(text.contains(told), "{name} {at}: {text}");
    }
}

#[test]
fn damaged_compressed_files_do_not_panic() {
    let flips = damage::flips();
    damage::run_cases(&GltfImporter::new(), || {
        DRACO.into_iter().chain(KTX2).map(|name| (name, sample(name), flips)).collect()
    });
}
