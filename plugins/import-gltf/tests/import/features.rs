//! Features that the sample files do not have: small glTF made here, one feature each.

use crate::common;
use crate::common::sample::sample;
use choreo_asset::{Asset, LightKind, Projection, Topology};
use choreo_motion::Path;
use choreo_plugin::{ImportOptions, ImportScope, Importer};
use glam::{Mat4, Quat, Vec3, Vec4};
use import_gltf::GltfImporter;
use serde_json::{Value, json};

/// The sample with more data: `add_accessor` appends bytes and returns the new accessor's index.
struct Builder {
    json: Value,
    bin: Vec<u8>,
}

impl Builder {
    fn new() -> Builder {
        let (json, bin) = sample();
        Builder { json, bin }
    }

    fn add_accessor(
        &mut self,
        bytes: &[u8],
        component: u32,
        shape: &str,
        count: usize,
        normalized: bool,
    ) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let views = self.json["bufferViews"].as_array_mut().unwrap();
        let view = views.len();
        views.push(json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()}));
        self.bin.extend(bytes);
        self.json["buffers"][0]["byteLength"] = json!(self.bin.len());
        let accessors = self.json["accessors"].as_array_mut().unwrap();
        accessors.push(json!({"bufferView": view, "componentType": component, "type": shape, "count": count,
            "normalized": normalized}));
        accessors.len() - 1
    }

    fn add_floats(&mut self, values: &[f32], shape: &str, count: usize) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.add_accessor(&bytes, 5126, shape, count, false)
    }

    fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    fn import(&self) -> Asset {
        let glb = common::glb_of(&self.json, &self.bin);
        common::import_bytes("feature.glb", glb).unwrap_or_else(|e| panic!("{e}"))
    }
}

fn warnings(asset: &Asset) -> Vec<String> {
    asset.warnings.iter().map(|w| format!("{}: {}", w.place, w.text)).collect()
}

#[test]
fn unindexed_strips_and_lines_are_imported() {
    for (mode, topology, indices) in [
        (0, Topology::Points, vec![0, 1, 2]),
        (1, Topology::Lines, vec![0, 1]),
        (2, Topology::Lines, vec![0, 1, 1, 2, 2, 0]),
        (3, Topology::Lines, vec![0, 1, 1, 2]),
        (4, Topology::Triangles, vec![0, 1, 2]),
        (5, Topology::Triangles, vec![0, 1, 2]),
        (6, Topology::Triangles, vec![1, 2, 0]),
    ] {
        let mut b = Builder::new();
        b.primitive()["mode"] = json!(mode);
        b.primitive().as_object_mut().unwrap().remove("indices");
        let asset = b.import();
        let p = &asset.meshes[0].primitives[0];
        assert_eq!((p.topology, &p.indices), (topology, &indices), "mode {mode}");
        let flat = if topology == Topology::Triangles { vec![Vec3::Z; 3] } else { Vec::new() };
        assert_eq!(p.normals, flat, "mode {mode}");
    }
}

#[test]
fn eight_and_twelve_influences_are_read_and_normalized() {
    let mut b = Builder::new();
    let joints = b.add_accessor(&[1, 0, 0, 0].repeat(3), 5121, "VEC4", 3, false);
    let wide: Vec<u8> = [1u16, 0, 0, 0].repeat(3).iter().flat_map(|v| v.to_le_bytes()).collect();
    let joints_wide = b.add_accessor(&wide, 5123, "VEC4", 3, false);
    let bytes = b.add_accessor(&[255, 0, 0, 0].repeat(3), 5121, "VEC4", 3, true);
    let shorts: Vec<u8> = [65535u16, 0, 0, 0].repeat(3).iter().flat_map(|v| v.to_le_bytes()).collect();
    let shorts = b.add_accessor(&shorts, 5123, "VEC4", 3, true);
    b.primitive()["attributes"]["JOINTS_1"] = json!(joints);
    b.primitive()["attributes"]["WEIGHTS_1"] = json!(bytes);
    let asset = b.import();
    let p = &asset.meshes[0].primitives[0];
    assert_eq!((p.influences, p.joint_indices.len()), (8, 24));
    // 0.75, 0.25 and 1.0 of a sum of 2.
    assert_eq!(p.joint_weights[..8], [0.375, 0.125, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0]);
    assert_eq!(p.joint_indices[..5], [0, 1, 0, 0, 1]);
    b.primitive()["attributes"]["JOINTS_2"] = json!(joints_wide);
    b.primitive()["attributes"]["WEIGHTS_2"] = json!(shorts);
    let asset = b.import();
    let p = &asset.meshes[0].primitives[0];
    assert_eq!(p.influences, 8);
    assert!((p.joint_weights[..8].iter().sum::<f32>() - 1.0).abs() < 1e-6);
    assert_eq!(p.joint_weights[0], 1.0 / 3.0);
    assert!(warnings(&asset).is_empty(), "four joints have weight, so nothing was dropped");
}

#[test]
fn missing_bind_matrices_and_joint_outside_the_scene() {
    let mut b = Builder::new();
    b.json["skins"][0].as_object_mut().unwrap().remove("inverseBindMatrices");
    b.json["scenes"][0]["nodes"] = json!([0]);
    let asset = b.import();
    assert_eq!(asset.skins[0].inverse_bind, [Mat4::IDENTITY; 2]);
    assert_eq!(asset.skeleton.names(), ["body", "hip", "hand"]);
    assert_eq!(asset.skins[0].joints, [1, 2]);
    assert_eq!(
        warnings(&asset),
        ["nodes[1]: is a skin joint outside the scene; its tree is read as joints but not shown"]
    );
}

#[test]
fn nodes_outside_the_scene_are_left_out() {
    let mut b = Builder::new();
    b.json["nodes"].as_array_mut().unwrap().push(json!({"mesh": 0}));
    b.json["animations"][0]["channels"]
        .as_array_mut()
        .unwrap()
        .push(json!({"sampler": 0, "target": {"node": 3, "path": "rotation"}}));
    let asset = b.import();
    assert_eq!((asset.skeleton.len(), asset.instances.len()), (3, 1));
    assert_eq!(asset.clips[0].curves().len(), 1);
    assert_eq!(
        warnings(&asset),
        [
            "nodes[3]: 1 of 4 nodes are not part of the scene and were left out, this one first",
            "animations[0].channels[1]: animates nodes[3], which is not in the scene; it is left out"
        ]
    );
}

#[test]
fn the_scene_option_selects_the_scene() {
    let mut b = Builder::new();
    b.json["nodes"].as_array_mut().unwrap().push(json!({}));
    b.json["scenes"].as_array_mut().unwrap().push(json!({"nodes": [3]}));
    let source = common::source("feature.glb", common::glb_of(&b.json, &b.bin));
    let mut options = ImportOptions::default();
    options.0.insert("scene".into(), choreo_plugin::importer::OptionValue::Number(1.0));
    let needs = ImportScope { clips: false, ..ImportScope::ALL };
    let asset = GltfImporter::new().import(&source, &common::Companions::none(), needs, &options).unwrap();
    assert_eq!(asset.skeleton.names(), ["node 3"]);
}

/// KHR_mesh_quantization: plain and normalized integers, with stride.
#[test]
fn quantized_vertices_are_decoded() {
    let mut b = Builder::new();
    let shorts: Vec<u8> =
        [0i16, 0, 0, 0, 300, 0, 0, 0, 0, -200, 7, 0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let positions = b.add_accessor(&shorts, 5122, "VEC3", 3, false);
    let normals = b.add_accessor(&[0, 0, 127, 0].repeat(3), 5120, "VEC3", 3, true);
    let uvs = b.add_accessor(&[255, 0, 51, 255, 0, 0], 5121, "VEC2", 3, true);
    for view in [positions, normals] {
        let view = b.json["accessors"][view]["bufferView"].as_u64().unwrap() as usize;
        b.json["bufferViews"][view]["byteStride"] = json!(if view == positions { 8 } else { 4 });
    }
    b.json["bufferViews"][positions]["byteStride"] = json!(8);
    let attributes = &mut b.primitive()["attributes"];
    attributes["POSITION"] = json!(positions);
    attributes["NORMAL"] = json!(normals);
    attributes["TEXCOORD_0"] = json!(uvs);
    let asset = b.import();
    let p = &asset.meshes[0].primitives[0];
    assert_eq!(p.positions, [Vec3::ZERO, Vec3::new(300.0, 0.0, 0.0), Vec3::new(0.0, -200.0, 7.0)]);
    assert_eq!(p.normals, [Vec3::Z; 3]);
    assert_eq!(p.uvs[0][1].to_array(), [0.2, 1.0]);
}

#[test]
fn vertex_colors_of_every_type_are_decoded() {
    let expected = [Vec4::new(1.0, 0.0, 0.2, 1.0), Vec4::ONE, Vec4::new(0.0, 0.0, 0.0, 1.0)];
    let rgb = [1.0f32, 0.0, 0.2, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0];
    let rgba: Vec<f32> = rgb.chunks(3).flat_map(|c| [c[0], c[1], c[2], 1.0]).collect();
    let u8s = |v: &[f32]| v.iter().map(|c| (c * 255.0).round() as u8).collect::<Vec<_>>();
    let u16s =
        |v: &[f32]| v.iter().flat_map(|c| ((c * 65535.0).round() as u16).to_le_bytes()).collect::<Vec<_>>();
    for (values, shape) in [(&rgb[..], "VEC3"), (&rgba[..], "VEC4")] {
        for kind in [5126, 5121, 5123] {
            let mut b = Builder::new();
            let accessor = match kind {
                5126 => b.add_floats(values, shape, 3),
                5121 => b.add_accessor(&u8s(values), 5121, shape, 3, true),
                _ => b.add_accessor(&u16s(values), 5123, shape, 3, true),
            };
            b.primitive()["attributes"]["COLOR_0"] = json!(accessor);
            let colors = b.import().meshes[0].primitives[0].colors.clone();
            assert!(colors.iter().zip(expected).all(|(a, b)| a.abs_diff_eq(b, 1e-6)), "{shape} {kind}");
        }
    }
}

#[test]
fn morph_names_weights_and_animated_weights() {
    let mut b = Builder::new();
    let weights = b.add_accessor(&[0, 0, 255], 5121, "SCALAR", 3, true);
    b.json["meshes"][0]["weights"] = json!([0.25]);
    b.json["meshes"][0]["extras"] = json!({"targetNames": ["smile"]});
    let animation = &mut b.json["animations"][0];
    animation["samplers"]
        .as_array_mut()
        .unwrap()
        .push(json!({"input": 2, "output": weights, "interpolation": "STEP"}));
    animation["channels"]
        .as_array_mut()
        .unwrap()
        .push(json!({"sampler": 1, "target": {"node": 0, "path": "weights"}}));
    let asset = b.import();
    assert_eq!(asset.meshes[0].morph_names, ["smile"]);
    assert_eq!(asset.instances[0].weights, [0.25]);
    assert_eq!(asset.meshes[0].primitives[0].morphs[0].positions, [Vec3::Z; 3]);
    let curve = &asset.clips[0].curves()[1];
    assert_eq!((curve.path, curve.values[2]), (Path::Weights(1), 1.0));
    b.json["nodes"][0]["weights"] = json!([0.5]);
    assert_eq!(b.import().instances[0].weights, [0.5]);
    // Writers of VRM 0.x name them in the primitives.
    b.json["meshes"][0].as_object_mut().unwrap().remove("extras");
    b.json["meshes"][0]["primitives"][0]["extras"] = json!({"targetNames": ["frown"]});
    assert_eq!(b.import().meshes[0].morph_names, ["frown"]);
}

/// Rotations as normalized shorts and bytes; the flag itself is often forgotten.
#[test]
fn integer_rotations_are_decoded() {
    for flagged in [true, false] {
        let mut b = Builder::new();
        let shorts: Vec<u8> = [0i16, 0, 0, 32767]
            .repeat(2)
            .into_iter()
            .chain([0, 32767, 0, 0])
            .flat_map(|v| v.to_le_bytes())
            .collect();
        let output = b.add_accessor(&shorts, 5122, "VEC4", 3, flagged);
        b.json["animations"][0]["samplers"][0]["output"] = json!(output);
        let values = b.import().clips[0].curves()[0].values.clone();
        assert_eq!(values[..], [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0]);
    }
}

#[test]
fn matrices_and_shear() {
    let mut b = Builder::new();
    let m = Mat4::from_scale_rotation_translation(
        Vec3::new(2.0, 2.0, -2.0),
        Quat::from_xyzw(0.0, 0.6, 0.0, 0.8),
        Vec3::new(1.0, 2.0, 3.0),
    );
    b.json["nodes"][1]["matrix"] = json!(m.to_cols_array());
    b.json["nodes"][0]["matrix"] = json!([1, 0, 0, 0, 0.5, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    let asset = b.import();
    assert!(Mat4::from(asset.skeleton.rest()[1].to_affine()).abs_diff_eq(m, 1e-5));
    let warnings = warnings(&asset);
    assert!(
        warnings.len() == 1 && warnings[0].starts_with("nodes[0]: the matrix is sheared"),
        "{warnings:?}"
    );
}

#[test]
fn cameras_and_lights_are_imported() {
    let mut b = Builder::new();
    b.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}]);
    b.json["nodes"][1]["camera"] = json!(0);
    b.json["nodes"][2]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
    b.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    b.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "spot", "intensity": 5, "range": 9, "spot": {"innerConeAngle": 2.0, "outerConeAngle": 3.0}}
    ]}});
    let asset = b.import();
    assert_eq!(asset.cameras[0].projection, Projection::Perspective { yfov: 0.8, near: 0.1, far: None });
    assert_eq!((asset.cameras[0].joint, asset.lights[0].joint), (1, 2));
    let LightKind::Spot { inner, outer } = asset.lights[0].light.kind else { panic!("not a spot") };
    assert!(0.0 < inner && inner < outer && outer == std::f32::consts::FRAC_PI_2);
    assert_eq!(asset.lights[0].light.range, Some(9.0));
    assert_eq!(warnings(&asset).len(), 1);
}

#[test]
fn specular_glossiness_keeps_its_reflectance() {
    let mut b = Builder::new();
    b.json["materials"][0]["extensions"] = json!({"KHR_materials_pbrSpecularGlossiness": {
        "diffuseFactor": [0.5, 0.25, 1.0, 1.0], "specularFactor": [0.2, 0.1, 0.04], "glossinessFactor": 0.75}});
    let asset = b.import();
    let m = &asset.materials[0];
    assert_eq!((m.metallic, m.roughness, m.base_color.x), (0.0, 0.25, 0.5));
    assert!((m.specular_color * 0.04).abs_diff_eq(Vec3::new(0.2, 0.1, 0.04), 1e-6));
    assert!(warnings(&asset).is_empty());
}

#[test]
fn parts_outside_the_import_scope_are_not_decoded() {
    let mut b = Builder::new();
    b.json["images"] = json!([{"uri": "not there.png"}]);
    b.json["textures"] = json!([{"source": 0}]);
    b.json["materials"][0]["normalTexture"] = json!({"index": 0});
    let source = common::source("feature.glb", common::glb_of(&b.json, &b.bin));
    let import = |geometry, clips, textures| {
        let needs = ImportScope { geometry, clips, textures, pixels: textures, image_files: false };
        GltfImporter::new().import(&source, &common::Companions::none(), needs, &ImportOptions::default())
    };
    assert!(
        warnings(&import(true, true, true).unwrap())[0].contains("\"not there.png\" is not beside the file")
    );
    let asset = import(true, true, false).unwrap();
    assert!(asset.materials[0].normal_texture.is_none());
    assert!(asset.meshes[0].primitives[0].tangents.is_empty());
    let asset = import(false, true, false).unwrap();
    assert_eq!((asset.meshes.len(), asset.instances.len(), asset.clips.len()), (0, 0, 1));
    let asset = import(true, false, false).unwrap();
    assert_eq!((asset.meshes.len(), asset.clips.len()), (1, 0));
}

/// Two images of the same bytes become one, and one image is decoded once.
#[test]
fn equal_images_are_stored_once() {
    let mut png = Vec::new();
    let pixels = image::RgbaImage::from_pixel(2, 2, image::Rgba([9, 8, 7, 255]));
    pixels.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).unwrap();
    let mut other = Vec::new();
    let deep =
        image::ImageBuffer::<image::Rgb<u16>, _>::from_pixel(1, 1, image::Rgb([65535u16, 257 * 100, 0]));
    image::DynamicImage::ImageRgb16(deep)
        .write_to(&mut std::io::Cursor::new(&mut other), image::ImageFormat::Png)
        .unwrap();
    let mut b = Builder::new();
    let views = [&png, &png, &other].map(|bytes| {
        let accessor = b.add_accessor(bytes, 5121, "SCALAR", 1, false);
        b.json["accessors"][accessor]["bufferView"].clone()
    });
    b.json["images"] = views.iter().map(|v| json!({"bufferView": v})).collect();
    b.json["textures"] = json!([{"source": 0}, {"source": 1}, {"source": 2}]);
    b.json["materials"][0]["emissiveTexture"] = json!({"index": 0});
    b.json["materials"][0]["occlusionTexture"] = json!({"index": 1});
    b.json["materials"][0]["normalTexture"] = json!({"index": 2});
    let asset = b.import();
    assert_eq!(asset.images.len(), 2);
    let m = &asset.materials[0];
    assert_eq!(m.emissive_texture.as_ref().unwrap().image, m.occlusion_texture.as_ref().unwrap().image);
    let deep = &asset.images[m.normal_texture.as_ref().unwrap().image as usize];
    assert_eq!(deep.rgba, [255, 100, 0, 255]);
    assert_eq!(
        warnings(&asset),
        ["meshes[0].primitives[0]: has a normal map but no TEXCOORD_0, so it has no effect"]
    );
}

/// The same file twice gives the same asset, images and threads or not.
#[test]
fn repeated_imports_are_equal() {
    let Some(folder) = common::assets(1) else { return };
    let import = || common::import_path(&folder.join("gltf/NormalTangentTest.glb")).unwrap();
    let (a, b) = (import(), import());
    assert_eq!(a.meshes[0].primitives, b.meshes[0].primitives);
    assert!(a.images.iter().zip(&b.images).all(|(x, y)| x == y));
    assert_eq!(a.materials, b.materials);
}

#[test]
fn clips_outside_the_import_scope_keep_only_their_names() {
    let mut b = Builder::new();
    let mut second = b.json["animations"][0].clone();
    second["name"] = json!("nod");
    b.json["animations"].as_array_mut().unwrap().push(second);
    let source = common::source("feature.glb", common::glb_of(&b.json, &b.bin));
    let curves = |played: &'static str| {
        let files = choreo_importer_kit_testing::Companions::playing(played);
        let import = GltfImporter::new().import(&source, &files, ImportScope::ALL, &ImportOptions::default());
        let asset = import.unwrap();
        asset.clips.iter().map(|clip| (clip.name.clone(), clip.curves().len())).collect::<Vec<_>>()
    };
    assert_eq!(curves("turn"), [("turn".to_string(), 1), ("nod".to_string(), 0)]);
    assert_eq!(curves("nod"), [("turn".to_string(), 0), ("nod".to_string(), 1)]);
}
