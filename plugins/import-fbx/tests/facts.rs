//! Every sample file against assimp, the same props in glTF, and the clips of one file on the character of another.

mod common;

use choreo_import_testing::{assimp, sound};
use choreo_motion::bind_clip;
use choreo_stage::Asset;
use import_gltf::GltfImporter;

#[test]
fn every_file_is_sound() {
    let Some(folder) = common::assets(23) else { return };
    let files = common::all_files(&folder);
    assert!(files.len() >= 23, "{}", files.len());
    for path in files {
        let asset = common::import_path(&path);
        sound::check(&path.display().to_string(), &asset);
        assert!(!asset.skeleton.is_empty());
    }
}

/// Of version 6100, which assimp does not know.
const UNREADABLE: [&str; 2] = ["maya_cube_6100_binary.fbx", "maya_game_sausage_6100_ascii_combined.fbx"];

/// Differences that README.md explains: (file, what, ours, assimp's).
const EXPLAINED: [(&str, &str, usize, usize); 2] =
    [("animation_with_skeleton.fbx", "skin joints", 14, 13), ("spider.fbx", "triangles", 1368, 1340)];

#[test]
fn counts_as_assimp_has_them() {
    let Some(folder) = common::assets(23) else { return };
    let mut different = Vec::new();
    for path in common::all_files(&folder) {
        let Some(theirs) = assimp::info(&path) else {
            println!("SKIP 23: assimp is not installed");
            return;
        };
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let Ok(theirs) = theirs else {
            assert!(UNREADABLE.contains(&name.as_str()), "{name}: assimp cannot read it");
            continue;
        };
        let ours = common::import_path(&path);
        let bones = has_bones_only(&ours);
        let of_file = if bones { 0 } else { common::triangles(&ours) };
        let joints: usize = if bones { 0 } else { ours.skins.iter().map(|s| s.joints.len() - 1).sum() };
        for (what, a, b) in [
            ("triangles", of_file, theirs.faces),
            ("clips", ours.clips.len(), theirs.animations),
            ("skin joints", joints, theirs.bones),
            ("cameras", ours.cameras.len(), theirs.cameras),
            ("lights", ours.lights.len(), theirs.lights),
        ] {
            if a != b && !EXPLAINED.contains(&(name.as_str(), what, a, b)) {
                println!("| {name} | {what} | {a} | {b} |");
                different.push((name.clone(), what, a, b));
            }
        }
    }
    assert!(different.is_empty(), "{different:?}");
}

fn has_bones_only(asset: &Asset) -> bool {
    asset.meshes.len() == 1 && asset.meshes[0].name == "bones"
}

#[test]
fn one_prop_in_two_formats() {
    let Some(folder) = common::assets(2).map(|f| f.join("same-model-3-formats")) else { return };
    for (fbx, glb) in [
        ("barrel_large_decorated.fbx", "barrel_large_decorated.gltf.glb"),
        ("chest_gold.fbx", "chest_gold.glb"),
    ] {
        let ours = common::import_path(&folder.join(fbx));
        let other = choreo_import_testing::import_path(&GltfImporter, &folder.join(glb)).unwrap();
        assert_eq!(common::triangles(&ours), common::triangles(&other), "{fbx}");
        let (a, b) = (common::rest_box(&ours), common::rest_box(&other));
        let off = (a.0 - b.0).abs().max((a.1 - b.1).abs()).max_element();
        println!("{fbx}: {} triangles, box off by {off:.2e} m", common::triangles(&ours));
        assert!(off < 1e-5, "{fbx}: {a:?} {b:?}");
        assert_eq!(ours.images.len(), other.images.len());
    }
}

/// ProAnimationBank's walk was made on the skeleton of its character.
#[test]
fn clips_play_on_another_character() {
    let Some(folder) = common::assets(2).map(|f| f.join("fbx/pab")) else { return };
    let arnaud = common::import_path(&folder.join("arnaud.fbx"));
    for name in ["walk", "run"] {
        let moves = common::import_path(&folder.join(format!("{name}.fbx")));
        let (clip, missing) = bind_clip(&moves.clips[0], &moves.skeleton, &arnaud.skeleton);
        let driven: std::collections::BTreeSet<u32> = clip.curves().iter().map(|c| c.joint).collect();
        println!("{name}: {} joints driven, without a partner: {missing:?}", driven.len());
        assert!(driven.len() >= 48, "{}", driven.len());
        // The feet come and go, the head stays up.
        let joint = |n: &str| arnaud.skeleton.find(n).unwrap();
        let at = |secs: f64, j: usize| common::pose(&arnaud, Some((&clip, secs))).0[j].translation;
        let feet: Vec<f32> =
            (0..20).map(|k| at(f64::from(k) * clip.duration.as_secs() / 20.0, joint("LeftFoot")).y).collect();
        let (low, high) = feet.iter().fold((f32::MAX, f32::MIN), |(a, b), y| (a.min(*y), b.max(*y)));
        assert!(low > 0.0 && low < 0.25 && high - low > 0.1, "{name}: {low} {high}");
        assert!((1.4..1.9).contains(&at(0.3, joint("Head")).y));
    }
}
