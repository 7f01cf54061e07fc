//! KHR_animation_pointer: animated properties on a stage, compared with the keys, and warnings about unsupported pointers.

use crate::common;
use choreo_asset::{Asset, Projection};
use choreo_motion::{Path, Time};
use choreo_stage::{Camera, Cue, Rig, Snapshot, Stage};
use glam::Vec4;
use serde_json::{Value, json};
use std::sync::Arc;

/// A triangle with a camera, a lamp and a clip of one second that animates these pointers from the first value to the second.
fn file(tracks: &[(&str, &[f32], &[f32])]) -> Vec<u8> {
    let mut bin: Vec<u8> = Vec::new();
    let mut json = json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_animation_pointer", "KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 3.0, "color": [1, 1, 1]}]}},
        "nodes": [
            {"mesh": 0},
            {"camera": 0, "translation": [0, 0, 3]},
            {"extensions": {"KHR_lights_punctual": {"light": 0}}, "translation": [0, 2, 0]}
        ],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.0, 0.5, 1.0]}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "accessors": [], "bufferViews": [],
        "animations": [{"name": "show", "samplers": [], "channels": []}],
        "buffers": [{"byteLength": 0}]
    });
    let mut add = |json: &mut Value, values: &[f32], shape: &str| {
        let (offset, count) = (bin.len(), json["accessors"].as_array().unwrap().len());
        let width = ["", "SCALAR", "VEC2", "VEC3", "VEC4"].iter().position(|s| *s == shape).unwrap();
        bin.extend(values.iter().flat_map(|v| v.to_le_bytes()));
        let view = json!({"buffer": 0, "byteOffset": offset, "byteLength": values.len() * 4});
        json["bufferViews"].as_array_mut().unwrap().push(view);
        let accessor =
            json!({"bufferView": count, "componentType": 5126, "count": values.len() / width, "type": shape});
        json["accessors"].as_array_mut().unwrap().push(accessor);
        json["buffers"][0]["byteLength"] = json!(bin.len());
        count
    };
    add(&mut json, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], "VEC3");
    let times = add(&mut json, &[0.0, 1.0], "SCALAR");
    for (number, (pointer, from, to)) in tracks.iter().enumerate() {
        let shape = ["", "SCALAR", "VEC2", "VEC3", "VEC4"][from.len()];
        let values = add(&mut json, &[*from, *to].concat(), shape);
        let animation = &mut json["animations"][0];
        animation["samplers"].as_array_mut().unwrap().push(json!({"input": times, "output": values}));
        let target =
            json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}});
        animation["channels"].as_array_mut().unwrap().push(json!({"sampler": number, "target": target}));
    }
    common::glb_of(&json, &bin)
}

fn import(tracks: &[(&str, &[f32], &[f32])]) -> Arc<Asset> {
    Arc::new(common::import_bytes("pointers.glb", file(tracks)).unwrap_or_else(|e| panic!("{e}")))
}

fn at(asset: &Arc<Asset>, secs: f64) -> Snapshot {
    let mut stage = Stage::default();
    let actor = stage.cast("a", asset.clone());
    stage.actors[actor].file_lights = true;
    stage.play(actor, Cue::new(asset.clips[0].clone()));
    let (projection, rig) = (Projection::default(), Rig::File { actor, camera: 0 });
    stage.cameras.push(Camera { projection, ..Camera::new("own", rig) });
    stage.at(Time::from_secs(secs)).unwrap()
}

#[test]
fn cameras_lights_and_colors_follow_their_keys() {
    let asset = import(&[
        ("/cameras/0/perspective/yfov", &[0.8], &[0.4]),
        ("/extensions/KHR_lights_punctual/lights/0/intensity", &[3.0], &[9.0]),
        ("/extensions/KHR_lights_punctual/lights/0/color", &[1.0, 1.0, 1.0], &[1.0, 0.0, 0.5]),
        ("/materials/0/pbrMetallicRoughness/baseColorFactor", &[0.5, 0.0, 0.5, 1.0], &[0.1, 0.8, 0.5, 1.0]),
        ("/nodes/0/translation", &[0.0, 0.0, 0.0], &[4.0, 0.0, 0.0]),
    ]);
    assert_eq!(asset.warnings, []);
    let clip = &asset.clips[0];
    assert_eq!(clip.duration, Time::from_secs(1.0));
    assert_eq!((clip.curves().len(), clip.properties().len()), (1, 4));
    assert_eq!(clip.curves()[0].path, Path::Translation);
    for (secs, share) in [(0.0, 0.0f32), (0.25, 0.25), (0.5, 0.5), (1.0, 1.0)] {
        // A clip loops; its last key is held just before the end only.
        let snapshot = at(&asset, if secs == 1.0 { 0.999_999_9 } else { secs });
        let Projection::Perspective { yfov, .. } = snapshot.camera.projection else { panic!("perspective") };
        assert!((yfov - (0.8 - 0.4 * share)).abs() < 1e-5, "{secs}: {yfov}");
        let light = &snapshot.lights[0].light;
        assert!((light.intensity - (3.0 + 6.0 * share)).abs() < 1e-4, "{secs}: {}", light.intensity);
        assert!(
            (light.color.y - (1.0 - share)).abs() < 1e-5
                && (light.color.z - (1.0 - 0.5 * share)).abs() < 1e-5
        );
        let color = snapshot.actors[0].base_colors[0];
        let expected = Vec4::new(0.5, 0.0, 0.5, 1.0).lerp(Vec4::new(0.1, 0.8, 0.5, 1.0), share);
        assert!(color.abs_diff_eq(expected, 1e-5), "{secs}: {color}");
        assert!((snapshot.actors[0].model_from_joint[0].translation.x - 4.0 * share).abs() < 1e-5);
    }
    // The planted fault: at another time the numbers are others.
    assert_ne!(at(&asset, 0.25).actors[0].base_colors, at(&asset, 0.3).actors[0].base_colors);
}

#[test]
fn without_the_clip_nothing_changes() {
    let asset = import(&[("/materials/0/pbrMetallicRoughness/baseColorFactor", &[0.0; 4], &[1.0; 4])]);
    let mut stage = Stage::default();
    stage.cast("a", asset.clone());
    assert!(stage.at(Time::from_secs(0.5)).unwrap().actors[0].base_colors.is_empty());
    // Halfway through a fade-in, the weight of the clip is 0.5.
    let mut stage = Stage::default();
    let actor = stage.cast("a", asset.clone());
    let plain = Arc::new(choreo_motion::Clip::new("plain".into(), asset.skeleton.len(), vec![]).unwrap());
    stage.play(actor, Cue::new(plain));
    let start = Time::from_secs(1.0);
    stage.play(actor, Cue { start, fade_in: Time::from_secs(1.0), ..Cue::new(asset.clips[0].clone()) });
    let color = stage.at(Time::from_secs(1.5)).unwrap().actors[0].base_colors[0];
    // Rest (0.5, 0, 0.5, 1), the clip at half a second 0.5 everywhere, each by half with a linear or a smooth fade.
    assert!(color.abs_diff_eq(Vec4::new(0.5, 0.25, 0.5, 0.75), 1e-5), "{color}");
}

#[test]
fn unsupported_pointers_are_named_in_warnings() {
    let asset = import(&[
        ("/materials/0/extensions/KHR_materials_ior/ior", &[0.0; 3], &[1.0; 3]),
        ("/nodes/77/translation/x", &[0.0], &[1.0]),
        ("/cameras/3/perspective/yfov", &[0.8], &[0.4]),
        ("nonsense", &[0.8], &[0.4]),
    ]);
    let texts: Vec<String> = asset.warnings.iter().map(|w| format!("{}: {}", w.place, w.text)).collect();
    let line = |n: usize, pointer: &str| {
        format!(
            "animations[0].channels[{n}]: animates {pointer}, which cannot be animated here; it is left out"
        )
    };
    assert_eq!(
        texts,
        [
            line(0, "/materials/0/extensions/KHR_materials_ior/ior"),
            line(1, "/nodes/77/translation/x"),
            line(2, "/cameras/3/perspective/yfov"),
            line(3, "nonsense")
        ]
    );
    let wrong = common::import_bytes("bad.glb", file(&[("/nodes/77/translation", &[0.0; 3], &[1.0; 3])]));
    assert_eq!(
        common::error_text(wrong),
        "bad.glb: animations[0].channels[0]: refers to nodes[77], but the last is nodes[2]"
    );
    let wrong = file(&[("/materials/0/pbrMetallicRoughness/baseColorFactor", &[0.0; 3], &[1.0; 3])]);
    assert_eq!(
        common::error_text(common::import_bytes("bad.glb", wrong)),
        "bad.glb: animations[0].channels[0]: has 2 keys and needs 8 numbers, but accessors[2] holds 6"
    );
}

#[test]
fn factors_of_materials_follow_their_keys() {
    let asset = import(&[
        ("/materials/0/emissiveFactor", &[0.0, 0.0, 0.0], &[1.0, 0.5, 0.25]),
        ("/materials/0/pbrMetallicRoughness/metallicFactor", &[1.0], &[0.0]),
        ("/materials/0/pbrMetallicRoughness/roughnessFactor", &[0.2], &[0.6]),
        ("/extensions/KHR_lights_punctual/lights/0/range", &[2.0], &[4.0]),
    ]);
    assert_eq!(asset.warnings, []);
    assert_eq!(asset.changing_materials(), [true]);
    for (secs, share) in [(0.0, 0.0f32), (0.25, 0.25), (0.5, 0.5)] {
        let snapshot = at(&asset, secs);
        let changed = &snapshot.actors[0].materials[0];
        let (now, rest) = (&changed.now, &asset.materials[0]);
        assert_eq!(changed.material, 0);
        assert!(now.emissive.abs_diff_eq(glam::Vec3::new(1.0, 0.5, 0.25) * share, 1e-5), "{secs}");
        assert!(
            (now.metallic - (1.0 - share)).abs() < 1e-5 && (now.roughness - (0.2 + 0.4 * share)).abs() < 1e-5
        );
        assert_eq!(now.base_color, rest.base_color);
        let range = snapshot.lights[0].light.range.unwrap();
        assert!((range - (2.0 + 2.0 * share)).abs() < 1e-4, "{secs}: {range}");
    }
    // An actor whose clips play nothing has the file's materials.
    let mut stage = Stage::default();
    stage.cast("a", asset.clone());
    assert!(stage.at(Time::from_secs(0.5)).unwrap().actors[0].materials.is_empty());
}
