//! The extensions of VRM to glTF: the same character as 0.x and as 1.0 must come out the same.

use crate::common::{Version, animation, character, edited, floats, glb, glb_of};
use choreo_asset::{Asset, EyesMovedBy};
use choreo_importer_kit_testing::{
    Companions, asset_rules, error_text, import, import_bytes, source, warnings,
};
use choreo_motion::spring::parameters::ColliderShape;
use choreo_motion::{HumanBone, Time, bind_clip};
use choreo_plugin::{Claim, ImportScope, Importer};
use choreo_stage::{Cue, Repeat, Stage, posed_meshes};
use glam::{DVec3, Vec3};
use import_gltf::GltfImporter;
use import_vrm::VrmImporter;
use std::sync::Arc;

/// The mesh instance with the nose; the hat, on a joint of the body, comes before it.
const FACE: usize = 1;

fn read(version: Version) -> Arc<Asset> {
    let asset = import_bytes(&VrmImporter, "tiny.vrm", glb(version)).unwrap();
    asset_rules::check("tiny.vrm", &asset);
    Arc::new(asset)
}

/// World places of all vertices of the asset alone on stage while a clip plays, by mesh instance.
fn vertices(asset: &Arc<Asset>, clip: Option<&choreo_motion::Clip>, secs: f64) -> Vec<Vec<DVec3>> {
    let mut stage = Stage::default();
    let actor = stage.cast("a", asset.clone());
    if let Some(clip) = clip {
        stage.play(actor, Cue { repeat: Repeat::Once, ..Cue::new(Arc::new(clip.clone())) });
    }
    let snapshot = stage.at(Time::from_secs(secs)).unwrap();
    let posed = posed_meshes(asset, &snapshot.actors[actor]);
    posed.iter().flat_map(|i| i.primitives.iter().map(|p| p.positions.clone())).collect()
}

fn difference(a: &[Vec<DVec3>], b: &[Vec<DVec3>]) -> f64 {
    assert_eq!(a.iter().map(Vec::len).collect::<Vec<_>>(), b.iter().map(Vec::len).collect::<Vec<_>>());
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max)
}

#[test]
fn both_versions_face_plus_z_and_move_alike() {
    let (old, new) = (read(Version::V0), read(Version::V1));
    for secs in [0.0, 0.3, 1.0] {
        let [a, b] = [&old, &new].map(|asset| vertices(asset, Some(&asset.clips[0]), secs));
        assert!(difference(&a, &b) < 1e-6, "{secs}: {a:?} {b:?}");
    }
    let rest = vertices(&old, None, 0.0);
    assert!((rest[FACE][2] - DVec3::new(0.0, 1.5, 0.4)).length() < 1e-6, "the nose points to +Z: {rest:?}");
    // The clip's morph lengthens the nose by 20 cm, halved at its end; a nod by 60° takes a point 0.5 m before the joint down.
    let nodded = vertices(&new, Some(&new.clips[0]), 1.0)[FACE][2];
    let (sin, cos) = (0.75f64.sqrt(), 0.5);
    let expected = DVec3::new(0.0, 1.5 - 0.6 * sin, 0.6 * cos) + DVec3::new(0.0, 0.05 * cos, 0.05 * sin);
    assert!((nodded - expected).length() < 1e-6, "{nodded} {expected}");
    // Joints have the same axes too.
    for (joint, name) in new.skeleton.names().iter().enumerate() {
        let other = old.skeleton.names().iter().position(|n| n == name).unwrap();
        let (a, b) = (old.rest_model_from_joint()[other], new.rest_model_from_joint()[joint]);
        assert!(a.abs_diff_eq(b, 1e-6), "{name}: {a} {b}");
    }
    // The comparison can fail: read as plain glTF, the old one shows its back.
    let plain = import_bytes(&GltfImporter, "tiny.vrm", glb(Version::V0)).unwrap();
    let back = vertices(&Arc::new(plain), None, 0.0);
    assert!((back[FACE][2] - DVec3::new(0.0, 1.5, -0.4)).length() < 1e-6);
    assert!(difference(&back, &rest) > 0.7);
}

#[test]
fn both_versions_have_the_same_human_bone_names() {
    for asset in [read(Version::V0), read(Version::V1)] {
        let humanoid = asset.skeleton.humanoid().unwrap();
        let name = |bone| humanoid.joint(bone).map(|j| asset.skeleton.names()[j as usize].as_str());
        assert_eq!(name(HumanBone::LeftThumbMetacarpal), Some("thumb a"));
        assert_eq!(name(HumanBone::LeftThumbProximal), Some("thumb b"));
        assert_eq!(name(HumanBone::LeftThumbDistal), Some("thumb c"));
        assert_eq!((name(HumanBone::Head), name(HumanBone::Jaw)), (Some("head"), None));
        assert_eq!(humanoid.bones().count(), 8);
        let find = |name: &str| asset.skeleton.find(name).map(|j| asset.skeleton.names()[j].as_str());
        assert_eq!(find("mixamorig:LeftArm"), Some("left upper arm"));
        assert_eq!(find("leftThumbMetacarpal"), Some("thumb a"));
        assert!(warnings(&asset).is_empty(), "{:?}", warnings(&asset));
    }
}

#[test]
fn both_versions_have_the_expression_names_of_vrm_1() {
    for (version, over) in [(Version::V0, 0.0), (Version::V1, 1.0)] {
        let asset = read(version);
        // The last four are the gaze expressions.
        let (gaze, faces): (Vec<_>, Vec<_>) =
            asset.expressions.iter().partition(|e| choreo_asset::GAZE.contains(&e.name.as_str()));
        assert!(gaze.len() == 4 && gaze.iter().all(|e| e.morphs.is_empty()));
        let mut faces = faces;
        faces.sort_by(|a, b| a.name.cmp(&b.name));
        let names: Vec<&str> = faces.iter().map(|e| e.name.as_str()).collect();
        assert_eq!(names, ["blink", "happy", "liar"]);
        assert_eq!(faces.iter().map(|e| e.binary).collect::<Vec<_>>(), [true, false, false]);
        let binds = faces.iter().map(|e| (e.morphs[0].target, e.morphs[0].weight)).collect::<Vec<_>>();
        assert_eq!(binds, [(0, 1.0), (1, 0.5), (0, 1.0)]);
        // On the stage, happy lifts the nose by half a bind, and suppresses blink if the file says so.
        let mut stage = Stage::default();
        let actor = stage.cast("a", asset.clone());
        let index = |name: &str| asset.expressions.iter().position(|e| e.name == name).unwrap() as u32;
        stage.actors[actor].expressions = vec![(index("happy"), 0.5), (index("blink"), 1.0)];
        let weights = stage.at(Time::ZERO).unwrap().actors[actor].morph_weights[FACE].clone();
        assert_eq!(weights, [1.0 - over, 0.25], "{version:?}");
    }
}

#[test]
fn both_versions_have_equal_springs() {
    let (old, new) = (read(Version::V0), read(Version::V1));
    for asset in [&old, &new] {
        let springs = &asset.springs;
        springs.check(asset.skeleton.len()).unwrap();
        let chain = &springs.chains[0];
        assert_eq!(
            (springs.chains.len(), chain.name.as_str(), chain.colliders.as_slice()),
            (1, "hair", &[0][..])
        );
        let name = |joint: u32| asset.skeleton.names()[joint as usize].as_str();
        assert_eq!(chain.center.map(name), Some("hips"));
        let first = &chain.joints[0];
        assert_eq!((name(first.joint), name(chain.joints[1].joint)), ("hair 1", "hair 2"));
        assert!((first.tail - Vec3::new(0.0, -0.1, -0.05)).length() < 1e-6, "{}", first.tail);
        assert!((chain.joints[1].tail - Vec3::new(0.0, -0.1, 0.0)).length() < 1e-6);
        assert_eq!((first.stiffness, first.drag_force, first.hit_radius), (0.5, 0.25, 0.02));
        // A direction of length 2 doubles the power.
        assert!((first.gravity_power - 0.2).abs() < 1e-6);
        assert_eq!(first.gravity_direction, Vec3::NEG_Y);
        let ColliderShape::Sphere { offset, radius, inside } = springs.colliders[0].shape else { panic!() };
        assert!((offset - Vec3::new(0.01, 0.05, -0.02)).length() < 1e-6, "{offset}");
        assert_eq!((name(springs.colliders[0].joint), radius, inside), ("head", 0.1, false));
    }
    // 1.0: the last joint is an end only, and each joint has its own numbers. 0.x: the last gets 7 cm more.
    assert_eq!((new.springs.chains[0].joints.len(), old.springs.chains[0].joints.len()), (2, 3));
    assert_eq!(new.springs.chains[0].joints[1].stiffness, 0.75);
    let last = old.springs.chains[0].joints[2].tail;
    assert!((last - Vec3::new(0.0, -0.07, 0.0)).length() < 1e-6, "{last}");
}

#[test]
fn animations_retarget_to_both_versions_whatever_their_rest_axes() {
    let (json, bin) = animation();
    let vrma = import_bytes(&VrmImporter, "yes.vrma", glb_of(&json, &bin)).unwrap();
    asset_rules::check("yes.vrma", &vrma);
    assert!(!vrma.meshes.is_empty(), "its bones are shown");
    assert_eq!(vrma.clips[0].expressions().len(), 1);
    for version in [Version::V0, Version::V1] {
        let asset = read(version);
        let (clip, missing) = bind_clip(&vrma.clips[0], &vrma.skeleton, &asset.skeleton);
        assert!(missing.is_empty(), "{missing:?}");
        // The hips rise from 2 m to 3 m there, from 1 m to 1.5 m here; the nose nods by 60°. happy at half its weight, times half a
        // bind, lifts the tip by 2.5 cm; at the end by 5 cm.
        let tip = vertices(&asset, Some(&clip), 1.0)[FACE][2];
        let (sin, cos) = (0.75f64.sqrt(), 0.5);
        let expected = DVec3::new(0.0, 2.0 - 0.4 * sin + 0.05 * cos, 0.4 * cos + 0.05 * sin);
        assert!((tip - expected).length() < 1e-6, "{version:?}: {tip} {expected}");
        // If the bones had no T-poses, the same keys would turn the head about another axis.
        let mut raw = clip.curves().to_vec();
        for curve in raw.iter_mut().filter(|c| c.path == choreo_motion::Path::Rotation) {
            let source =
                vrma.clips[0].curves().iter().find(|c| c.path == choreo_motion::Path::Rotation).unwrap();
            curve.values = source.values.clone();
        }
        let raw = choreo_motion::Clip::new("raw".into(), asset.skeleton.len(), raw).unwrap();
        assert!((vertices(&asset, Some(&raw), 1.0)[FACE][2] - expected).length() > 0.1);
    }
}

#[test]
fn eye_settings_and_file_metadata_are_kept() {
    let (old, new) = (read(Version::V0), read(Version::V1));
    for asset in [&old, &new] {
        let eyes = asset.eyes.unwrap();
        assert_eq!(eyes.moved_by, EyesMovedBy::Bones);
        assert!((eyes.inner.output_scale - 8.0f32.to_radians()).abs() < 1e-6);
        assert!((eyes.inner.input_max - 90.0f32.to_radians()).abs() < 1e-6);
        assert!((eyes.offset_from_head - Vec3::new(0.0, 0.06, 0.1)).length() < 1e-6);
    }
    let said = |asset: &Asset, label: &str| {
        asset.origin.about.iter().find(|(l, _)| l == label).map(|(_, t)| t.clone()).unwrap_or_default()
    };
    assert_eq!((said(&new, "title"), said(&new, "authors")), ("Tiny".into(), "Ada, Bo".into()));
    assert_eq!(said(&new, "licence"), "https://vrm.dev/licenses/1.0/");
    assert_eq!(said(&new, "permissions"), "commercialUsage corporation, redistribution allowed");
    assert_eq!((said(&old, "authors"), said(&old, "licence")), ("Ada".into(), "CC0".into()));
    assert_eq!((old.origin.format.as_str(), new.origin.format.as_str()), ("VRM 0.x", "VRM 1.0"));
}

/// Painted eyes from the file to the image, of 1.0 and of 0.x.
#[test]
fn expression_driven_eyes_follow_the_gaze_target() {
    use choreo_stage::{LookAt, Target};
    use serde_json::json;
    for version in [Version::V0, Version::V1] {
        let (mut json, bin) = character(version);
        if version == Version::V1 {
            let vrm = &mut json["extensions"]["VRMC_vrm"];
            vrm["lookAt"] = json!({ "type": "expression", "offsetFromHeadBone": [0.0, 0.0, 0.0],
                "rangeMapHorizontalOuter": { "inputMaxValue": 60.0, "outputScale": 1.0 } });
            let presets = &mut vrm["expressions"]["preset"];
            presets["lookLeft"] = json!({
                "morphTargetBinds": [{ "node": 10, "index": 0, "weight": 1.0 }],
                "materialColorBinds": [{ "material": 0, "type": "color", "targetValue": [0.0, 0.0, 0.0, 1.0] }]
            });
            presets["happy"]["overrideLookAt"] = json!("block");
        } else {
            let vrm = &mut json["extensions"]["VRM"];
            let person = &mut vrm["firstPerson"];
            person["lookAtTypeName"] = json!("BlendShape");
            person["firstPersonBoneOffset"] = json!({ "x": 0.0, "y": 0.0, "z": 0.0 });
            person["lookAtHorizontalOuter"] = json!({ "xRange": 60.0, "yRange": 1.0 });
            let left = json!({ "name": "LookLeft", "presetName": "lookleft",
                "binds": [{ "mesh": 0, "index": 0, "weight": 100.0 }],
                "materialValues": [{ "materialName": "skin", "propertyName": "_Color", "targetValue": [0.0, 0.0, 0.0, 1.0] }] });
            vrm["blendShapeMaster"]["blendShapeGroups"].as_array_mut().unwrap().push(left);
        }
        let asset = Arc::new(import_bytes(&VrmImporter, "eyes.vrm", glb_of(&json, &bin)).unwrap());
        assert_eq!(asset.eyes.unwrap().moved_by, EyesMovedBy::Expressions);
        let head = asset.skeleton.names().iter().position(|n| n == "head").unwrap() as u32;
        let happy = asset.expressions.iter().position(|e| e.name == "happy").unwrap() as u32;
        let looking = |smile: f32| {
            let mut stage = Stage::default();
            stage.cast("a", asset.clone());
            // The target is 60 degrees to the left. With a weight of one half, the eyes get 30 degrees, and rotate by half of that.
            let (sin, cos) = (0.75f64.sqrt(), 0.5);
            let target = Target::Point(DVec3::new(sin, 0.0, cos) * 100.0 + DVec3::new(0.0, 1.5, 0.0));
            stage.actors[0].look_at.push(LookAt { weight: 0.5, ..LookAt::new(head, target) });
            stage.actors[0].expressions.push((happy, smile));
            let snapshot = stage.at(Time::ZERO).unwrap();
            let state = &snapshot.actors[0];
            let red = state.materials.iter().find(|m| m.material == 0).map_or(0.8, |m| m.now.base_color.x);
            (state.morph_weights[FACE][0], red)
        };
        let (long, red) = looking(0.0);
        assert!((long - 0.25).abs() < 1e-3 && (red - 0.8 * 0.75).abs() < 1e-3, "{version:?}: {long} {red}");
        // A smile that blocks the gaze, which only 1.0 can say.
        let (long, red) = looking(0.5);
        let still = if version == Version::V1 { 0.0 } else { 0.25 };
        assert!(
            (long - still).abs() < 1e-3 && (red - 0.8 * (1.0 - still)).abs() < 1e-3,
            "{version:?}: {long} {red}"
        );
    }
}

/// `yes` with a gaze that goes from straight ahead to 45° to the left and 30° up.
fn looking_aside() -> (serde_json::Value, Vec<u8>) {
    use serde_json::json;
    let (mut json, mut bin) = animation();
    let at = bin.len();
    let aside =
        glam::Quat::from_rotation_y(45f32.to_radians()) * glam::Quat::from_rotation_x(-30f32.to_radians());
    // A roll about the gaze direction changes nothing.
    let aside = aside * glam::Quat::from_rotation_z(1.0);
    floats(&mut bin, &[0.0, 0.0, 0.0, 1.0]);
    floats(&mut bin, &aside.to_array());
    json["buffers"][0]["byteLength"] = json!(bin.len());
    let list = |json: &mut serde_json::Value, value| json.as_array_mut().unwrap().push(value);
    list(&mut json["bufferViews"], json!({ "buffer": 0, "byteOffset": at, "byteLength": 32 }));
    let accessor = json["accessors"].as_array().unwrap().len();
    let view = json["bufferViews"].as_array().unwrap().len() - 1;
    list(
        &mut json["accessors"],
        json!({ "bufferView": view, "componentType": 5126, "count": 2, "type": "VEC4" }),
    );
    let animation = &mut json["animations"][0];
    list(&mut animation["samplers"], json!({ "input": 0, "output": accessor }));
    list(&mut animation["channels"], json!({ "sampler": 3, "target": { "node": 4, "path": "rotation" } }));
    (json, bin)
}

/// VRMC_vrm_animation's `lookAt`: the angles go through the character's range maps, for eyes moved by bones and by expressions.
#[test]
fn eyes_look_where_an_animation_says() {
    use serde_json::json;
    let (json, bin) = looking_aside();
    let vrma = import_bytes(&VrmImporter, "aside.vrma", glb_of(&json, &bin)).unwrap();
    assert_eq!(warnings(&vrma), Vec::<String>::new());
    let clip = &vrma.clips[0];
    assert_eq!(clip.expressions().len(), 5, "happy and four ways");
    assert!(clip.curves().iter().all(|c| vrma.skeleton.names()[c.joint as usize] != "gaze"));
    let at = |name: &str, seconds: f64| {
        f64::from(clip.sample_expression(name, Time::from_secs(seconds)).unwrap()) * 90.0
    };
    assert!((at("gazeLeft", 1.0) - 45.0).abs() < 1e-3 && (at("gazeUp", 1.0) - 30.0).abs() < 1e-3);
    assert_eq!((at("gazeRight", 1.0), at("gazeDown", 1.0)), (0.0, 0.0));
    // Between the keys as slerp turns, to a hundredth of a degree.
    let far = glam::DQuat::from_rotation_y(45f64.to_radians())
        * glam::DQuat::from_rotation_x(-30f64.to_radians())
        * glam::DQuat::from_rotation_z(1.0);
    for t in [0.1, 0.37, 0.5, 0.93] {
        let way = glam::DQuat::IDENTITY.slerp(far, t) * DVec3::Z;
        let (yaw, pitch) = choreo_asset::eyes::angles_of(way);
        let found = (at("gazeLeft", t) - at("gazeRight", t), at("gazeUp", t) - at("gazeDown", t));
        let off = (found.0 - yaw.to_degrees()).hypot(found.1 - pitch.to_degrees());
        assert!(off < 0.01, "{t}: {off}");
    }
    let playing = |asset: Arc<Asset>, seconds: f64| {
        let (clip, _) = bind_clip(clip, &vrma.skeleton, &asset.skeleton);
        let mut stage = Stage::default();
        let actor = stage.cast("a", asset);
        stage.play(actor, Cue { repeat: Repeat::Once, ..Cue::new(Arc::new(clip)) });
        let snapshot = stage.at(Time::from_secs(seconds)).unwrap();
        snapshot.actors[0].clone()
    };
    for version in [Version::V0, Version::V1] {
        let asset = read(version);
        let find = |name: &str| asset.skeleton.names().iter().position(|n| n == name).unwrap();
        let humanoid = asset.skeleton.humanoid().unwrap();
        let eye = humanoid.joint(HumanBone::LeftEye).unwrap() as usize;
        let state = playing(asset.clone(), 1.0);
        let turned = |joint: usize| {
            let rotation = |m: &glam::Affine3A| m.to_scale_rotation_translation().1.as_dquat();
            rotation(&state.model_from_joint[joint])
                * rotation(&asset.rest_model_from_joint()[joint]).inverse()
        };
        // Both maps give a ninth of the angle: 45° to the left are 5°, 30° up are 3 1/3°.
        let (yaw, pitch) = (5f64.to_radians(), (10.0f64 / 3.0).to_radians());
        let own = glam::DQuat::from_rotation_y(yaw) * glam::DQuat::from_rotation_x(-pitch);
        let off = turned(eye).angle_between(turned(find("head")) * own).to_degrees();
        assert!(off < 0.01, "{version:?}: {off}");
        // Eyes that rested with the head would be off by all of it.
        assert!(turned(eye).angle_between(turned(find("head"))).to_degrees() > 5.0);
    }
    let painted = |over: &str| {
        let (mut json, bin) = character(Version::V1);
        let vrm = &mut json["extensions"]["VRMC_vrm"];
        vrm["lookAt"] = json!({ "type": "expression",
            "rangeMapHorizontalOuter": { "inputMaxValue": 60.0, "outputScale": 1.0 } });
        let presets = &mut vrm["expressions"]["preset"];
        presets["lookLeft"] = json!({ "morphTargetBinds": [{ "node": 10, "index": 0, "weight": 1.0 }] });
        presets["happy"]["overrideLookAt"] = json!(over);
        let asset = import_bytes(&VrmImporter, "eyes.vrm", glb_of(&json, &bin)).unwrap();
        playing(Arc::new(asset), 1.0).morph_weights[FACE][0]
    };
    assert!((painted("none") - 0.75).abs() < 1e-3, "{}", painted("none"));
    // The clip smiles, and such a smile holds the gaze down.
    assert_eq!(painted("block"), 0.0);
}

#[test]
fn content_decides_which_importer_claims_a_file() {
    let claim = |name: &str, bytes: Vec<u8>| VrmImporter.claim(&source(name, bytes));
    let gltf = |bytes: Vec<u8>| GltfImporter::new().claim(&source("x.vrm", bytes));
    for version in [Version::V0, Version::V1] {
        assert_eq!(claim("x.bin", glb(version)), Claim::Content(98));
        assert!(gltf(glb(version)) < Claim::Content(98));
        // A truncated file is claimed only if its name has the extension of VRM.
        let cut = glb(version)[..2500].to_vec();
        assert_eq!(claim("x.glb", cut.clone()), Claim::NotMine);
        assert_eq!(claim("x.vrm", cut), Claim::Content(96));
    }
    let (json, bin) = animation();
    assert_eq!(claim("x.bin", glb_of(&json, &bin)), Claim::Content(98));
    // The claim on text: with the words but not as an extension, and without either.
    let (json, _) = character(Version::V1);
    assert_eq!(claim("x.gltf", serde_json::to_vec(&json).unwrap()), Claim::Content(98));
    let plain = edited(Version::V1, |json| {
        json["extensions"] = serde_json::json!({});
    });
    assert_eq!(claim("x.vrm", plain), Claim::NotMine);
    assert_eq!(claim("x.vrm", b"solid x".to_vec()), Claim::NotMine);
}

#[test]
fn parts_outside_the_import_scope_are_not_read() {
    let clips =
        import(&VrmImporter, &source("a.vrm", glb(Version::V0)), &Companions::none(), ImportScope::CLIPS)
            .unwrap();
    assert!(clips.meshes.is_empty() && clips.clips.len() == 1 && clips.skeleton.humanoid().is_some());
    assert_eq!(warnings(&clips), Vec::<String>::new());
    let plain = edited(Version::V1, |json| json["extensions"] = serde_json::json!({}));
    assert_eq!(
        error_text(import_bytes(&VrmImporter, "a.vrm", plain)),
        "a.vrm: extensions: has none of VRM, VRMC_vrm and VRMC_vrm_animation"
    );
}

/// `sample/` holds what these tests make, for scripts to load; `CHOREO_ACCEPT=1` writes it.
#[test]
fn the_sample_files_equal_the_generated_ones() {
    let (json, bin) = animation();
    let made = [
        ("tiny-0.vrm", glb(Version::V0)),
        ("tiny-1.vrm", glb(Version::V1)),
        ("yes.vrma", glb_of(&json, &bin)),
    ];
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("sample");
    for (name, bytes) in made {
        let path = folder.join(name);
        if std::env::var_os("CHOREO_ACCEPT").is_some() {
            std::fs::create_dir_all(&folder).unwrap();
            std::fs::write(&path, &bytes).unwrap();
        }
        let stored = std::fs::read(&path).unwrap_or_default();
        assert!(stored == bytes, "{} is another file; CHOREO_ACCEPT=1 writes it", path.display());
    }
}
