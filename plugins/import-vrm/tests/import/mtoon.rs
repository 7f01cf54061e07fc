//! MToon as the importer reads it: 1.0's own words, and 0.x converted.

use crate::common::{Version, edited};
use choreo_asset::{Material, Shading, Toon, UvMotion};
use choreo_importer_kit_testing::{error_text, import_bytes, warnings};
use choreo_stage::Stage;
use glam::{Vec2, Vec3, Vec4};
use import_vrm::VrmImporter;
use serde_json::{Value, json};

fn material(version: Version, edit: impl FnOnce(&mut Value)) -> (Material, Vec<String>) {
    let asset = import_bytes(&VrmImporter, "tiny.vrm", edited(version, edit)).unwrap();
    (asset.materials[0].clone(), warnings(&asset))
}

fn toon(material: &Material) -> &Toon {
    assert_eq!(material.shading, Shading::Toon);
    material.toon.as_deref().unwrap()
}

#[test]
fn mtoon_1_has_its_defaults_and_reads_every_parameter() {
    let (plain, found_warnings) = material(Version::V1, |j| {
        j["materials"][0]["extensions"] =
            json!({ "VRMC_materials_mtoon": { "specVersion": "1.0" }, "KHR_materials_unlit": {} });
    });
    assert_eq!(toon(&plain), &Toon::default());
    assert!(found_warnings.is_empty(), "{found_warnings:?}");
    let (m, found_warnings) = material(Version::V1, |j| {
        j["materials"][0]["extensions"] = json!({ "VRMC_materials_mtoon": {
            "specVersion": "1.0", "shadeColorFactor": [0.25, 0.5, 0.75], "shadingShiftFactor": -0.2, "shadingToonyFactor": 0.75,
            "giEqualizationFactor": 0.5, "parametricRimColorFactor": [0.1, 0.2, 0.3], "parametricRimFresnelPowerFactor": 2.0,
            "parametricRimLiftFactor": 0.125, "rimLightingMixFactor": 0.0, "outlineWidthMode": "worldCoordinates",
            "outlineWidthFactor": 0.005, "uvAnimationScrollXSpeedFactor": 0.1, "transparentWithZWrite": true
        } });
    });
    let t = toon(&m);
    assert_eq!((t.shade_color.to_array(), t.rim_color.to_array()), ([0.25, 0.5, 0.75], [0.1, 0.2, 0.3]));
    assert_eq!((t.shading_shift, t.shading_toony, t.gi_equalization), (-0.2, 0.75, 0.5));
    assert_eq!((t.rim_fresnel_power, t.rim_lift, t.rim_lighting_mix), (2.0, 0.125, 0.0));
    let outline = t.outline.as_ref().unwrap();
    assert_eq!((outline.width, outline.on_screen), (0.005, false));
    assert_eq!(t.uv_motion, Some(UvMotion { scroll: Vec2::new(0.1, 0.0), rotation: 0.0 }));
    assert_eq!(found_warnings.len(), 1, "{found_warnings:?}");
}

/// MToon 0.x's ramp goes from `shift` to mix(1, shift, toony) in NL (its shader's min and max intensity threshold). The converted one
/// must begin and end where that does.
#[test]
fn mtoon_0_has_the_same_shading_threshold() {
    for (shift, toony) in [(0.0f64, 0.9f64), (-0.45, 0.8), (0.3, 0.5), (-1.0, 1.0)] {
        let (m, _) = material(Version::V0, |j| {
            j["extensions"]["VRM"]["materialProperties"] = json!([{ "name": "skin", "shader": "VRM/MToon",
                "floatProperties": { "_ShadeShift": shift, "_ShadeToony": toony, "_IndirectLightIntensity": 0.25, "_RimFresnelPower": 2.0,
                    "_OutlineWidthMode": 1, "_OutlineWidth": 0.5 },
                "vectorProperties": { "_ShadeColor": [0.5, 0.5, 0.5, 1.0], "_RimColor": [0.0, 0.0, 0.0, 1.0] },
                "textureProperties": {} }]);
        });
        let t = toon(&m);
        // NL at which the shade ends and the light begins.
        let (dark, lit) = (shift, toony * shift + (1.0 - toony));
        let half = 1.0 - f64::from(t.shading_toony);
        let (from, to) = (-half - f64::from(t.shading_shift), half - f64::from(t.shading_shift));
        assert!(
            (from - dark).abs() < 1e-6 && (to - lit).abs() < 1e-6,
            "{shift} {toony}: {from} {to}, {dark} {lit}"
        );
        assert!((t.shade_color.x - 0.214_041_1).abs() < 1e-6, "sRGB to linear");
        assert_eq!((t.gi_equalization, t.rim_fresnel_power), (0.75, 2.0));
        assert!((t.outline.as_ref().unwrap().width - 0.005).abs() < 1e-9, "centimetres");
    }
}

#[test]
fn wrong_mtoon_values_are_errors_with_their_place() {
    let error = |mtoon: Value| {
        let bytes = edited(Version::V1, |j| {
            j["materials"][0]["extensions"] = json!({ "VRMC_materials_mtoon": mtoon })
        });
        error_text(import_bytes(&VrmImporter, "bad.vrm", bytes))
    };
    let place = "bad.vrm: materials[0].extensions.VRMC_materials_mtoon";
    assert_eq!(
        error(json!({ "shadeColorFactor": [1, 2] })),
        format!("{place}.shadeColorFactor: must be three numbers")
    );
    assert_eq!(
        error(json!({ "shadingToonyFactor": "x" })),
        format!("{place}.shadingToonyFactor: must be a finite number")
    );
    assert_eq!(
        error(json!({ "shadeMultiplyTexture": { "index": 5 } })),
        "bad.vrm: materials[0].shadeMultiplyTexture: refers to textures[5], but the file has no textures"
    );
    assert!(
        error(json!({ "matcapTexture": 3 }))
            .starts_with("bad.vrm: materials[0].matcapTexture: is no textureInfo")
    );
}

/// Half of `happy` at one second: the same in both versions, whose colors and whose v count otherwise.
#[test]
fn expressions_change_material_colors() {
    for version in [Version::V0, Version::V1] {
        let bytes = edited(version, |j| {
            if version == Version::V1 {
                let happy = &mut j["extensions"]["VRMC_vrm"]["expressions"]["preset"]["happy"];
                happy["materialColorBinds"] = json!([
                    { "material": 0, "type": "color", "targetValue": [0.5, 1.0, 0.0, 1.0] },
                    { "material": 0, "type": "emissionColor", "targetValue": [0.0, 0.0, 1.0, 1.0] },
                ]);
                return;
            }
            j["materials"][0]["name"] = json!("skin");
            let groups =
                j["extensions"]["VRM"]["blendShapeMaster"]["blendShapeGroups"].as_array_mut().unwrap();
            let joy = groups.iter_mut().find(|g| g["presetName"] == "joy").unwrap();
            joy["materialValues"] = json!([
                { "materialName": "skin", "propertyName": "_Color", "targetValue": [0.735_357, 1.0, 0.0, 1.0] },
                { "materialName": "skin", "propertyName": "_EmissionColor", "targetValue": [0.0, 0.0, 1.0, 1.0] },
            ]);
        });
        let asset = std::sync::Arc::new(import_bytes(&VrmImporter, "face.vrm", bytes).unwrap());
        let rest = &asset.materials[0];
        let mut stage = Stage::default();
        let actor = stage.cast("a", asset.clone());
        let happy = asset.expressions.iter().position(|e| e.name == "happy").unwrap() as u32;
        stage.actors[actor].expressions = vec![(happy, 0.5)];
        let now = &stage.at(choreo_motion::Time::ZERO).unwrap().actors[actor].materials[0].now;
        let base = rest.base_color.lerp(Vec4::new(0.5, 1.0, 0.0, 1.0), 0.5);
        assert!(now.base_color.abs_diff_eq(base, 1e-4), "{} is not {base}", now.base_color);
        assert!(now.emissive.abs_diff_eq(rest.emissive.lerp(Vec3::Z, 0.5), 1e-5), "{}", now.emissive);
        // Nothing changes without the expression.
        stage.actors[actor].expressions.clear();
        assert!(stage.at(choreo_motion::Time::ZERO).unwrap().actors[actor].materials.is_empty());
    }
}
