//! Files as other programs write them: valid ones that a strict reader refuses, and those that must be refused with a word.

use crate::common;
use crate::common::sample::{LENGTH, TIMES, sample};
use choreo_asset::{Asset, Primitive};
use choreo_plugin::{ImportOptions, ImportScope, Importer, OptionValue};
use glam::Vec3;
use import_gltf::GltfImporter;
use serde_json::{Value, json};

fn import(json: &Value, bin: &[u8]) -> Result<Asset, choreo_plugin::ImportError> {
    common::import_bytes("other.glb", common::glb_of(json, bin))
}

fn warnings(asset: &Asset) -> Vec<String> {
    asset.warnings.iter().map(|w| format!("{}: {}", w.place, w.text)).collect()
}

fn primitives(asset: &Asset) -> Vec<&Primitive> {
    asset.meshes.iter().flat_map(|m| &m.primitives).collect()
}

/// Every whole number of a JSON text, written with a fraction.
fn with_fractions(value: &Value) -> Value {
    match value {
        Value::Number(n) if n.is_u64() => json!(n.as_f64()),
        Value::Array(list) => list.iter().map(with_fractions).collect(),
        Value::Object(map) => map.iter().map(|(k, v)| (k.clone(), with_fractions(v))).collect(),
        other => other.clone(),
    }
}

/// glTF 2.0 §5.25.1: `nodes` of a scene may be left out.
#[test]
fn a_scene_without_nodes_is_read() {
    let (mut json, bin) = sample();
    json["scenes"] = json!([{"name": "Scene"}]);
    let asset = import(&json, &bin).unwrap();
    assert_eq!((asset.instances.len(), asset.skeleton.len()), (0, 0));
    // Beside a scene that has some, which is shown.
    json["scenes"] = json!([{"name": "Empty"}, {"nodes": [0, 1]}]);
    json["scene"] = json!(1);
    let asset = import(&json, &bin).unwrap();
    assert_eq!((asset.instances.len(), asset.skeleton.len(), asset.clips.len()), (1, 3, 1));
    assert_eq!(warnings(&asset), Vec::<String>::new());
}

#[test]
fn whole_numbers_written_with_a_fraction_are_read() {
    let (json, bin) = sample();
    let plain = import(&json, &bin).unwrap();
    let same = import(&with_fractions(&json), &bin).unwrap();
    assert_eq!(primitives(&same), primitives(&plain));
    assert_eq!(same.skins, plain.skins);
    assert_eq!(same.clips[0].curves(), plain.clips[0].curves());
    assert_eq!(same.skeleton.names(), plain.skeleton.names());
    // The same holds in extensions, which are not part of the schema: packed views, instances, materials.
    let layers: Value = serde_json::from_slice(include_bytes!("../samples/layers.gltf")).unwrap();
    let import =
        |json: &Value| common::import_bytes("layers.gltf", serde_json::to_vec(json).unwrap()).unwrap();
    let (plain, same) = (import(&layers), import(&with_fractions(&layers)));
    assert_eq!((primitives(&same), &same.materials), (primitives(&plain), &plain.materials));
    let only_in_extensions = with_fractions(&layers["materials"]);
    let mut json = layers.clone();
    json["materials"] = only_in_extensions;
    assert_eq!(import(&json).materials, plain.materials);
    let packed = include_bytes!("../samples/packed.glb");
    let fractions = common::edited(packed, |json, _| *json = with_fractions(json));
    let (plain, same) = (
        common::import_bytes("packed.glb", packed.to_vec()).unwrap(),
        common::import_bytes("packed.glb", fractions).unwrap(),
    );
    assert_eq!(primitives(&same), primitives(&plain));
    // A fraction that is one stays an error.
    let (mut json, bin) = sample();
    json["accessors"][0]["count"] = json!(2.5);
    assert_eq!(
        common::error_text(self::import(&json, &bin)).split(" (byte").next(),
        Some("other.glb: accessors[0].count")
    );
}

fn with_image(image: Value) -> (Value, Vec<u8>) {
    let (mut json, bin) = sample();
    json["images"] = json!([image]);
    json["textures"] = json!([{"source": 0}]);
    json["materials"][0]["pbrMetallicRoughness"] =
        json!({"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 0.5, 0, 1]});
    json["materials"][0]["normalTexture"] = json!({"index": 0});
    (json, bin)
}

/// The model is imported with the material's own color, like OBJ, COLLADA and FBX.
#[test]
fn a_missing_image_is_a_warning() {
    for (uri, told) in [
        (
            "art/my%20coat.png",
            "images[0]: \"my coat.png\" is not beside the file or in its textures/, images/, maps/; give its folder with --search; the texture is left out",
        ),
        (
            "../coat.png",
            "images[0]: \"coat.png\" is not beside the file or in its textures/, images/, maps/, and folders above it are not read; give its folder with --search; the texture is left out",
        ),
        (
            "data:image/png;base64,AA!A",
            "images[0]: letter 2 of the base64 data, '!', is not base64; the texture is left out",
        ),
    ] {
        let (json, bin) = with_image(json!({"uri": uri}));
        let asset = import(&json, &bin).unwrap();
        assert_eq!(warnings(&asset), [told]);
        let material = &asset.materials[0];
        assert_eq!(material.base_color.to_array(), [1.0, 0.5, 0.0, 1.0]);
        assert!(material.base_color_texture.is_none() && material.normal_texture.is_none());
        assert_eq!((asset.images.len(), asset.instances.len(), asset.clips.len()), (0, 1, 1));
    }
    let (json, bin) = with_image(json!({"name": "coat"}));
    let told = "images[0]: has neither a bufferView nor a uri; the texture is left out";
    assert_eq!(warnings(&import(&json, &bin).unwrap()), [told]);
    // An error of the file itself stays an error.
    let (json, bin) = with_image(json!({"bufferView": 99}));
    let text = common::error_text(import(&json, &bin));
    assert!(text.contains("images[0]: refers to bufferViews[99], but the last is bufferViews[7]"), "{text}");
}

/// The names that a file gives and the folders that exporters use, as for the other formats.
#[test]
fn images_are_searched_in_the_same_folders_as_other_formats() {
    let mut png = Vec::new();
    let pixel = image::RgbaImage::from_pixel(1, 1, image::Rgba([9, 8, 7, 255]));
    pixel.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).unwrap();
    let folder = std::env::temp_dir().join(format!("choreo-gltf-images-{}", std::process::id()));
    std::fs::create_dir_all(folder.join("textures")).unwrap();
    std::fs::write(folder.join("textures/coat.png"), png).unwrap();
    let (json, bin) = with_image(json!({"uri": "C:/art/coat.png"}));
    let source = common::source("other.glb", common::glb_of(&json, &bin));
    let files = common::Companions::in_folder(folder.clone());
    let asset = GltfImporter::new().import(&source, &files, ImportScope::ALL, &ImportOptions::default());
    std::fs::remove_dir_all(folder).unwrap();
    assert_eq!(asset.unwrap().images[0].rgba, [9, 8, 7, 255]);
}

#[test]
fn all_extensions_that_are_missing_are_named() {
    let (mut json, bin) = sample();
    let names = ["VENDOR_thing", "MSFT_texture_dds", "KHR_materials_unlit", "VENDOR_other"];
    json["extensionsUsed"] = json!(names);
    json["extensionsRequired"] = json!(names);
    let error = import(&json, &bin).unwrap_err();
    assert_eq!(
        error.to_string(),
        "other.glb: extensionsRequired: the file needs VENDOR_thing, MSFT_texture_dds and VENDOR_other, which are not supported"
    );
    assert_eq!(error.hint.unwrap(), "convert the textures to PNG, JPEG, WebP or KTX2");
    // Textures that are not requested are no reason to refuse the file.
    let source = common::source("other.glb", common::glb_of(&json, &bin));
    let needs =
        ImportScope { geometry: true, clips: false, textures: false, pixels: false, image_files: false };
    let asset =
        GltfImporter::new().import(&source, &common::Companions::none(), needs, &ImportOptions::default());
    assert!(asset.is_ok());
}

/// `extensionsUsed` alone promises vertices for readers without Draco, which are exact; some writers leave their accessors empty.
#[test]
fn compressed_vertices_are_read_without_a_fallback() {
    let (mut json, bin) = sample();
    json["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
    json["meshes"][0]["primitives"][0]["extensions"] =
        json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}});
    let asset = import(&json, &bin).unwrap();
    assert_eq!(asset.warnings, []);
    assert_eq!(asset.meshes[0].primitives[0].positions[1], Vec3::X);
    for empty in [0, 1] {
        let mut json = json.clone();
        json["accessors"][empty].as_object_mut().unwrap().remove("bufferView");
        let error = import(&json, &bin).unwrap_err().to_string();
        let told = "other.glb: meshes[0].primitives[0].KHR_draco_mesh_compression: cannot be decoded: ";
        assert!(error.starts_with(told), "{error}");
    }
}

#[test]
fn float_indices_are_errors() {
    let told = "other.glb: meshes[0].primitives[0].indices (accessors[1]): has component type F32; U8, U16 and U32 are allowed here";
    let (mut json, mut bin) = sample();
    bin.extend([0.0f32, 1.0, 2.0].iter().flat_map(|v| v.to_le_bytes()));
    json["buffers"][0]["byteLength"] = json!(bin.len());
    json["bufferViews"][1] = json!({"buffer": 0, "byteOffset": LENGTH, "byteLength": 12});
    json["accessors"][1]["componentType"] = json!(5126);
    assert_eq!(common::error_text(import(&json, &bin)), told);
    // The same holds without data: the specification makes them zeros.
    json["accessors"][1].as_object_mut().unwrap().remove("bufferView");
    assert_eq!(common::error_text(import(&json, &bin)), told);
    json["accessors"][1]["componentType"] = json!(5122);
    assert!(common::error_text(import(&json, &bin)).contains("has component type I16; U8, U16 and U32"));
}

#[test]
fn a_clip_without_a_mesh_gets_visible_bones() {
    let (mut json, bin) = sample();
    json.as_object_mut().unwrap().remove("meshes");
    json.as_object_mut().unwrap().remove("skins");
    json["nodes"][0] = json!({"name": "body"});
    let asset = import(&json, &bin).unwrap();
    assert_eq!((asset.meshes.len(), asset.instances.len()), (1, 1));
    assert_eq!(
        (asset.meshes[0].name.as_str(), asset.materials.last().unwrap().name.as_str()),
        ("bones", "bones")
    );
    // One bone, from hip to hand, a metre up.
    assert_eq!(asset.meshes[0].primitives[0].positions.len(), 24);
    let bounds = asset.rest_bounds();
    assert!((bounds.max.y - 1.0).abs() < 1e-5 && bounds.min.y.abs() < 1e-5, "{bounds:?}");
    // Not where they are not wanted, nor for clips alone.
    let source = common::source("other.glb", common::glb_of(&json, &bin));
    let with = |needs: ImportScope, options: &ImportOptions| {
        GltfImporter::new()
            .import(&source, &common::Companions::none(), needs, options)
            .unwrap()
            .instances
            .len()
    };
    let mut off = ImportOptions::default();
    off.0.insert("bones".into(), OptionValue::Bool(false));
    assert_eq!(with(ImportScope::ALL, &off), 0);
    assert_eq!(with(ImportScope { geometry: false, ..ImportScope::ALL }, &ImportOptions::default()), 0);
    // The same mesh where the clips are not requested.
    assert_eq!(with(ImportScope { clips: false, ..ImportScope::ALL }, &ImportOptions::default()), 1);
    // A camera that a clip moves is no skeleton.
    json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}]);
    json["nodes"][2]["camera"] = json!(0);
    assert_eq!(import(&json, &bin).unwrap().instances.len(), 0);
}

/// glTF 2.0 §3.11: a clip begins at 0 s, however late its first key is, and holds that key until then.
#[test]
fn clips_begin_at_time_zero() {
    let (json, mut bin) = sample();
    for (key, secs) in [2.0f32, 2.5, 3.0].into_iter().enumerate() {
        bin[TIMES + 4 * key..][..4].copy_from_slice(&secs.to_le_bytes());
    }
    let asset = import(&json, &bin).unwrap();
    let clip = &asset.clips[0];
    assert_eq!((clip.duration.as_secs(), clip.curves()[0].times[0].as_secs()), (3.0, 2.0));
}
