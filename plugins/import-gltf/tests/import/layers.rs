//! KHR_materials_clearcoat, _sheen, _ior, _transmission, _volume, _variants and _pbrSpecularGlossiness as the asset has them.

use crate::common;
use crate::common::sample::sample;
use choreo_asset::{Asset, Material};
use choreo_plugin::{ImportOptions, ImportScope, Importer, OptionValue};
use glam::Vec3;
use import_gltf::GltfImporter;
use serde_json::{Value, json};

fn import(edit: impl FnOnce(&mut Value)) -> Result<Asset, choreo_plugin::ImportError> {
    let (mut json, bin) = sample();
    edit(&mut json);
    common::import_bytes("layers.glb", common::glb_of(&json, &bin))
}

fn material(extensions: Value) -> Material {
    let asset = import(|json| json["materials"][0]["extensions"] = extensions);
    asset.unwrap_or_else(|e| panic!("{e}")).materials[0].clone()
}

#[test]
fn material_layer_factors_are_imported() {
    let m = material(json!({
        "KHR_materials_clearcoat": {"clearcoatFactor": 0.75, "clearcoatRoughnessFactor": 0.25},
        "KHR_materials_sheen": {"sheenColorFactor": [0.5, 0.25, 2.0], "sheenRoughnessFactor": 0.5},
        "KHR_materials_transmission": {"transmissionFactor": 1.5},
        "KHR_materials_volume": {"thicknessFactor": 0.125, "attenuationDistance": 2.0, "attenuationColor": [0.5, 1, 0.25]}
    }));
    let l = m.layers.unwrap();
    assert_eq!((l.clearcoat, l.clearcoat_roughness, l.clearcoat_normal_scale), (0.75, 0.25, 1.0));
    assert_eq!((l.sheen_color, l.sheen_roughness), (Vec3::new(0.5, 0.25, 1.0), 0.5));
    assert_eq!((l.transmission, l.thickness, l.attenuation_distance), (1.0, 0.125, 2.0));
    // Half of the red after two metres: −ln(½) / 2 a metre.
    let lost = [0.5f64, 1.0, 0.25].map(|c| (-c.ln() / 2.0) as f32);
    assert!(l.extinction().abs_diff_eq(Vec3::from(lost), 1e-6), "{}", l.extinction());
    assert!(material(json!({})).layers.is_none(), "a plain material has none");
    let volume = material(json!({"KHR_materials_volume": {"thicknessFactor": 1.0}})).layers.unwrap();
    assert!(l.refracts() && (l.ior, l.dispersion) == (1.5, 0.0) && !volume.refracts());
    let diamond = material(json!({
        "KHR_materials_transmission": {"transmissionFactor": 1.0},
        "KHR_materials_volume": {"thicknessFactor": 0.01},
        "KHR_materials_ior": {"ior": 2.42},
        "KHR_materials_dispersion": {"dispersion": 0.36}
    }));
    let l = diamond.layers.unwrap();
    assert!(l.refracts() && (l.ior, l.dispersion) == (2.42, 0.36));
    // 0.025 · 1.42 · 0.36 to each side.
    assert!(l.iors().abs_diff_eq(Vec3::new(2.40722, 2.42, 2.43278), 1e-5), "{}", l.iors());
    let flat = material(json!({
        "KHR_materials_transmission": {"transmissionFactor": 1.0},
        "KHR_materials_volume": {"thicknessFactor": 0.01},
        "KHR_materials_ior": {"ior": 1.0}
    }));
    assert!(!flat.layers.unwrap().refracts(), "an index of 1 bends nothing");
    assert_eq!((volume.attenuation_distance, volume.absorbs()), (f32::INFINITY, false));
}

#[test]
fn iridescence_anisotropy_and_thin_transmission_are_read() {
    let m = material(json!({
        "KHR_materials_iridescence": {"iridescenceFactor": 0.5, "iridescenceIor": 1.75, "iridescenceThicknessMaximum": 550},
        "KHR_materials_anisotropy": {"anisotropyStrength": 0.75, "anisotropyRotation": 0.5},
        "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.25, "diffuseTransmissionColorFactor": [0.5, 1, 0.25]},
        "KHR_materials_volume": {"thicknessFactor": 1.0, "attenuationDistance": 2.0, "attenuationColor": [0.5, 1, 0.25]}
    }));
    let l = m.layers.unwrap();
    assert_eq!((l.iridescence, l.iridescence_ior, l.iridescence_thickness), (0.5, 1.75, [100.0, 550.0]));
    assert_eq!((l.anisotropy, l.anisotropy_rotation), (0.75, 0.5));
    assert_eq!(l.diffuse_transmission_color, Vec3::new(0.5, 1.0, 0.25));
    assert!(l.diffuse_transmission == 0.25 && l.absorbs(), "a volume counts for light from behind too");
    let plain =
        material(json!({"KHR_materials_iridescence": {}, "KHR_materials_anisotropy": {}})).layers.unwrap();
    assert_eq!(*plain, choreo_asset::MaterialLayers::default());
}

#[test]
fn brushed_metal_has_tangents_without_a_normal_map() {
    let tangents = |extensions: Value, uvs: bool| {
        let asset = import(|json| {
            json["materials"][0]["extensions"] = extensions;
            if uvs {
                // Any two numbers a vertex do: those of its place.
                let position = json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap();
                let mut uv = json["accessors"][position as usize].clone();
                uv["type"] = json!("VEC2");
                uv.as_object_mut().unwrap().retain(|key, _| key != "min" && key != "max");
                let accessors = json["accessors"].as_array_mut().unwrap();
                accessors.push(uv);
                let last = accessors.len() - 1;
                json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(last);
            }
        });
        let asset = asset.unwrap_or_else(|e| panic!("{e}"));
        let warned = asset.warnings.iter().any(|w| w.text.contains("has anisotropy but no TEXCOORD_0"));
        (!asset.meshes[0].primitives[0].tangents.is_empty(), warned)
    };
    let brushed = || json!({"KHR_materials_anisotropy": {"anisotropyStrength": 0.5}});
    assert_eq!(tangents(brushed(), true), (true, false));
    assert_eq!(tangents(brushed(), false), (false, true), "no direction without uvs, which is said");
    assert_eq!(
        tangents(json!({"KHR_materials_anisotropy": {}}), true),
        (false, false),
        "nothing to be drawn out"
    );
}

#[test]
fn the_index_of_refraction_is_imported() {
    for (ior, f0) in [(1.5, 0.04), (1.0, 0.0), (1.33, 0.020_059), (2.42, 0.172_395), (0.0, 1.0)] {
        let m = material(json!({"KHR_materials_ior": {"ior": ior}}));
        let got = f64::from(m.specular_color.x) * 0.04;
        assert!((got - f0).abs() < 1e-5, "{ior}: {got}");
    }
}

#[test]
fn errors_name_the_extension_and_key() {
    let error = |extensions: Value| {
        common::error_text(import(|json| json["materials"][0]["extensions"] = extensions))
    };
    assert_eq!(
        error(json!({"KHR_materials_clearcoat": {"clearcoatFactor": "much"}})),
        "layers.glb: materials[0].extensions.KHR_materials_clearcoat.clearcoatFactor: is \"much\"; a number is needed"
    );
    assert_eq!(
        error(json!({"KHR_materials_sheen": {"sheenColorFactor": [1, 2]}})),
        "layers.glb: materials[0].extensions.KHR_materials_sheen.sheenColorFactor: is not a color; three numbers are needed"
    );
    assert_eq!(
        error(json!({"KHR_materials_transmission": {"transmissionTexture": {"index": 7}}})),
        "layers.glb: materials[0].transmissionTexture: refers to textures[7], but the file has no textures"
    );
    assert_eq!(
        error(json!({"KHR_materials_volume": {"thicknessTexture": {}}})),
        "layers.glb: materials[0].extensions.KHR_materials_volume.thicknessTexture: has no index of a texture"
    );
}

#[test]
fn unsupported_glass_parameters_are_warnings() {
    let asset = import(|json| {
        json["materials"][0]["extensions"] =
            json!({"KHR_materials_transmission": {"transmissionFactor": 1.0}})
    });
    let volume = import(
        |json| json["materials"][0]["extensions"] = json!({"KHR_materials_transmission": {"transmissionFactor": 1.0}, "KHR_materials_volume": {"thicknessFactor": 0.1}}),
    );
    assert!(volume.unwrap().warnings.is_empty(), "a volume bends and blurs");
    let warnings = asset.unwrap().warnings;
    assert_eq!(warnings.len(), 1);
    assert_eq!(
        warnings[0].text,
        "1 material has transmission with thin, rough walls: the background is tinted, but not blurred by the roughness"
    );
}

#[test]
fn the_variant_option_selects_materials() {
    let (mut json, bin) = sample();
    json["extensions"] =
        json!({"KHR_materials_variants": {"variants": [{"name": "plain"}, {"name": "festive"}]}});
    json["materials"] = json!([{"name": "skin"}, {"name": "gold"}]);
    json["meshes"][0]["primitives"][0]["extensions"] =
        json!({"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [1]}]}});
    let load = |name: &str| {
        let source = common::source("variants.glb", common::glb_of(&json, &bin));
        let importer = GltfImporter::new();
        let given =
            ImportOptions([("variant".to_string(), OptionValue::Text(name.into()))].into_iter().collect());
        let options = importer.manifest().complete(&given).unwrap();
        importer.import(&source, &common::Companions::none(), ImportScope::ALL, &options)
    };
    let shown = |name: &str| load(name).unwrap().meshes[0].primitives[0].material;
    assert_eq!([shown(""), shown("plain"), shown("festive")], [Some(0), Some(0), Some(1)]);
    let error = load("golden").unwrap_err();
    assert_eq!(
        error.to_string(),
        "variants.glb: extensions.KHR_materials_variants.variants: has no variant \"golden\""
    );
    assert_eq!(error.hint.as_deref(), Some("its variants are plain, festive"));
}
