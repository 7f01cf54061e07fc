//! Damaged, hostile and odd files.

use crate::common::{Version, animation, edited, glb, glb_of};
use choreo_importer_kit_testing::{
    asset_rules, assets, damage, error_text, import_bytes, own_process, warnings,
};
use import_vrm::VrmImporter;
use serde_json::{Value, json};

fn error_after_edit(version: Version, edit: impl FnOnce(&mut Value)) -> String {
    error_text(import_bytes(&VrmImporter, "bad.vrm", edited(version, edit)))
}

fn warnings_after_edit(version: Version, edit: impl FnOnce(&mut Value)) -> Vec<String> {
    let asset = import_bytes(&VrmImporter, "odd.vrm", edited(version, edit)).unwrap();
    asset_rules::check("odd.vrm", &asset);
    asset.springs.check(asset.skeleton.len()).unwrap();
    warnings(&asset)
}

#[test]
fn errors_name_the_element() {
    let bad = |edit: &dyn Fn(&mut Value)| error_after_edit(Version::V1, edit);
    assert_eq!(
        bad(&|j| j["extensions"]["VRMC_vrm"]["humanoid"]["humanBones"]["hips"]["node"] = json!(99)),
        "bad.vrm: extensions.VRMC_vrm.humanoid.humanBones.hips.node: refers to nodes[99], but the last is nodes[12]"
    );
    assert_eq!(
        bad(&|j| j["extensions"]["VRMC_vrm"]["humanoid"]["humanBones"]["hips"]["node"] = json!("x")),
        "bad.vrm: extensions.VRMC_vrm.humanoid.humanBones.hips.node: must be an index, a whole number from 0"
    );
    assert_eq!(
        bad(
            &|j| j["extensions"]["VRMC_vrm"]["expressions"]["preset"]["happy"]["morphTargetBinds"][0]["index"] =
                json!(7)
        ),
        "bad.vrm: extensions.VRMC_vrm.expressions.preset.happy.morphTargetBinds[0].index: is 7, but the mesh has 2 morph targets"
    );
    assert_eq!(
        bad(&|j| j["extensions"]["VRMC_springBone"]["springs"][0]["colliderGroups"] = json!([3])),
        "bad.vrm: extensions.VRMC_springBone.springs[0].colliderGroups[0]: refers to colliderGroups[3], but the last is colliderGroups[0]"
    );
    assert_eq!(
        bad(&|j| j["extensions"]["VRMC_springBone"]["colliders"][0]["shape"] = json!({})),
        "bad.vrm: extensions.VRMC_springBone.colliders[0].shape: is neither a sphere nor a capsule"
    );
    assert_eq!(
        error_after_edit(
            Version::V0,
            |j| j["extensions"]["VRM"]["secondaryAnimation"]["boneGroups"][0]["bones"] = json!([1.5])
        ),
        "bad.vrm: extensions.VRM.secondaryAnimation.boneGroups[0].bones[0]: must be an index, a whole number from 0"
    );
    assert_eq!(
        error_after_edit(Version::V0, |j| j["extensions"]["VRM"]["blendShapeMaster"]["blendShapeGroups"] =
            json!({})),
        "bad.vrm: extensions.VRM.blendShapeMaster.blendShapeGroups: must be an array"
    );
}

#[test]
fn guessed_and_ignored_content_is_a_warning() {
    assert_eq!(
        warnings_after_edit(Version::V1, |j| j["extensions"]["VRMC_springBone"]["springs"][0]["joints"][0]
            ["dragForce"] = json!(1.5)),
        ["extensions.VRMC_springBone.springs[0].joints[0].dragForce: is 1.5; 1 is used"]
    );
    assert_eq!(
        warnings_after_edit(Version::V1, |j| {
            let again = j["extensions"]["VRMC_springBone"]["springs"][0].clone();
            j["extensions"]["VRMC_springBone"]["springs"] = json!([again.clone(), again]);
        }),
        [
            "extensions.VRMC_springBone.springs[1]: 2 of its joints already belong to an earlier spring and are left out here"
        ]
    );
    assert_eq!(
        warnings_after_edit(Version::V1, |j| {
            let joints = &mut j["extensions"]["VRMC_springBone"]["springs"][0]["joints"];
            *joints = json!([{ "node": 9 }, { "node": 7 }]);
        }),
        [
            "extensions.VRMC_springBone.springs[0].joints[1]: nodes[7] is not below the joint before it; the spring ends here"
        ]
    );
    assert_eq!(
        warnings_after_edit(Version::V1, |j| {
            let bones = &mut j["extensions"]["VRMC_vrm"]["humanoid"]["humanBones"];
            bones["tail"] = json!({ "node": 9 });
            bones["chest"] = json!({ "node": 2 });
        }),
        [
            "extensions.VRMC_vrm.humanoid.humanBones.head: nodes[2] is the bone chest already; this bone is left out",
            "extensions.VRMC_vrm.humanoid.humanBones.tail: \"tail\" is not a human bone; it is left out",
            "extensions.VRMC_vrm.humanoid.humanBones: has no head, which every VRM must have",
        ]
    );
    assert_eq!(
        warnings_after_edit(Version::V1, |j| {
            let faces = &mut j["extensions"]["VRMC_vrm"]["expressions"];
            faces["custom"]["happy"] = json!({});
            faces["preset"]["happy"]["materialColorBinds"] =
                json!([{ "material": 0, "type": "outlineColor", "targetValue": [1, 0, 0, 1] }]);
            faces["preset"]["happy"]["overrideBlink"] = json!("maybe");
        }),
        [
            "extensions.VRMC_vrm.expressions.preset.happy.overrideBlink: is not none, block or blend; none is used",
            "extensions.VRMC_vrm.expressions.custom.happy: is a second expression \"happy\"; it is left out",
            "extensions.VRMC_vrm.expressions: 1 expression also changes material properties that are missing or not drawn: happy",
        ]
    );
    assert_eq!(
        warnings_after_edit(Version::V1, |j| j["extensions"]["VRMC_vrm"]["specVersion"] = json!("2.0")),
        ["extensions.VRMC_vrm: has version \"2.0\"; it is read as 1.0"]
    );
}

/// A bone group may name one root many times, or every joint of a chain: no joint swings twice, and the work stays bounded.
#[test]
fn repeated_spring_joints_are_simulated_once() {
    let many = warnings_after_edit(Version::V0, |j| {
        let group = &mut j["extensions"]["VRM"]["secondaryAnimation"]["boneGroups"][0];
        group["bones"] = (0..20_000).map(|i| json!(7 + i % 3)).collect();
    });
    assert!(!many.is_empty());
}

#[test]
fn own_samples_truncated_and_bit_flipped_do_not_panic() {
    if own_process::ran_in_own_process() {
        return;
    }
    let flips = damage::flips();
    for version in [Version::V0, Version::V1] {
        damage::run(&VrmImporter, "tiny.vrm", &glb(version), flips * 3);
    }
    let (json, bin) = animation();
    damage::run(&VrmImporter, "yes.vrma", &glb_of(&json, &bin), flips * 3);
}

/// `CHOREO_FLIPS=1000` for as many as the others have.
#[test]
fn downloaded_samples_truncated_and_bit_flipped_do_not_panic() {
    if own_process::ran_in_own_process() {
        return;
    }
    let Some(folder) = assets(10) else { return };
    for entry in std::fs::read_dir(folder.join("vrm")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let bytes = std::fs::read(&path).unwrap();
        let asset = import_bytes(&VrmImporter, &name, bytes.clone()).unwrap();
        asset_rules::check(&name, &asset);
        assert!(asset.skeleton.humanoid().is_some_and(|h| h.bones().count() >= 15), "{name}");
        damage::run(&VrmImporter, &name, &bytes, damage::flips());
    }
}
