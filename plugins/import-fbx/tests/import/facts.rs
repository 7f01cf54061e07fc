//! Every sample file is sound, and the clips of one file play on the character of another.

use crate::common;
use choreo_importer_kit_testing::asset_rules;
use choreo_motion::bind_clip;

#[test]
fn every_imported_file_is_consistent() {
    let Some(folder) = common::assets(23) else { return };
    let files = common::all_files(&folder);
    assert!(files.len() >= 23, "{}", files.len());
    for path in files {
        let asset = common::import_path(&path);
        asset_rules::check(&path.display().to_string(), &asset);
        assert!(!asset.skeleton.is_empty());
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
