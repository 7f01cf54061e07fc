//! How far clips are from what ufbx evaluates between their keys, and what closer keys cost.

use crate::refine::{MAX_DEGREES, MAX_METRES};
use crate::{FbxImporter, load};
use choreo_import_testing::{Companions, assets, options, source};
use choreo_motion::{Pose, Sample, Time};
use choreo_plugin::{Importer, Needs, OptionValue};
use choreo_stage::Asset;
use glam::{DQuat, DVec3};
use std::path::Path;

const ONLY_CLIPS: Needs = Needs { geometry: false, clips: true, textures: false };

#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    /// Metres, of any node in its parent's space.
    translation: f64,
    degrees: f64,
    keys: usize,
}

fn clips(bytes: &[u8], rate: f64) -> Asset {
    let options = options(&FbxImporter, &[("rate", OptionValue::Number(rate))]);
    let source = source("a.fbx", bytes);
    FbxImporter.import(&source, &Companions::none(), ONLY_CLIPS, &options).unwrap()
}

/// Against ufbx, at `samples` even times of every clip, which fall between keys. `late` is a planted fault.
fn worst(bytes: &[u8], rate: f64, samples: usize, late: f64) -> Worst {
    let asset = clips(bytes, rate);
    let scene = load::load(bytes, ONLY_CLIPS).unwrap();
    let mut worst = Worst::default();
    let names = asset.skeleton.names();
    for clip in &asset.clips {
        worst.keys += clip.curves().iter().map(|c| c.times.len()).sum::<usize>();
        let stack = scene.anim_stacks.as_ref().iter().find(|s| s.element.name.as_ref() == clip.name).unwrap();
        let mut pose = Pose::rest(&asset.skeleton);
        for k in 0..samples {
            let secs = clip.duration.as_secs() * (k as f64 + 0.37) / samples as f64;
            Sample { clip, time: Time::from_secs(secs), pose: &mut pose }.run();
            for node in &scene.nodes {
                let named = names.iter().filter(|n| *n == node.element.name.as_ref()).count();
                let joint = names.iter().position(|n| n == node.element.name.as_ref());
                let (Some(joint), 1, false) = (joint, named, node.is_scale_helper) else { continue };
                let theirs = node.evaluate_transform(&stack.anim, stack.time_begin + secs + late);
                let ours = pose.get(joint);
                let t = theirs.translation;
                let off = DVec3::new(t.x, t.y, t.z).distance(ours.translation.as_dvec3());
                let r = theirs.rotation;
                let theirs = DQuat::from_xyzw(r.x, r.y, r.z, r.w).normalize();
                let ours = ours.rotation.as_dquat().normalize();
                let chord = (ours - if ours.dot(theirs) < 0.0 { -theirs } else { theirs }).length();
                worst.translation = worst.translation.max(off);
                worst.degrees = worst.degrees.max(4.0 * libm::asin((chord / 2.0).min(1.0)).to_degrees());
            }
        }
    }
    worst
}

fn own() -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/flag.fbx")).unwrap()
}

/// Of the project's own sample: a rotation by Euler angles, cubic and linear, through 70° in a second.
#[test]
fn closer_keys_are_closer() {
    let [close, one, two, four] = [0.0, 24.0, 48.0, 96.0].map(|rate| worst(&own(), rate, 503, 0.0));
    println!("flag.fbx: {close:?} {one:?} {two:?} {four:?}");
    assert!(close.degrees < 1.1 * MAX_DEGREES && close.translation < MAX_METRES, "{close:?}");
    assert!(one.degrees > 3.0 * two.degrees && two.degrees > 3.0 * four.degrees, "{one:?} {two:?} {four:?}");
    // A thousandth of a second late is seen.
    assert!(worst(&own(), 0.0, 503, 0.002).degrees > 2.0 * MAX_DEGREES);
}

/// The table of the README.
#[test]
fn sample_files() {
    let Some(folder) = assets(9) else { return };
    let files = [
        "fbx/animation_with_skeleton.fbx",
        "fbx/huesitos.fbx",
        "fbx/pab/locomotions.fbx",
        "fbx/pab/run.fbx",
        "fbx/pab/walk.fbx",
        "fbx/ufbx/blender_279_sausage_7400_binary.fbx",
        "fbx/ufbx/maya_game_sausage_7500_binary_wiggle.fbx",
        "fbx/ufbx/maya_game_sausage_6100_ascii_combined.fbx",
        "fbx/ufbx/maya_interpolation_modes_7500_ascii.fbx",
    ];
    for name in files {
        let bytes = std::fs::read(folder.join(name)).unwrap();
        let scene = load::load(&bytes, ONLY_CLIPS).unwrap();
        let own = scene.settings.frames_per_second;
        let rows = [0.0, own, 4.0 * own].map(|rate| worst(&bytes, rate, 97, 0.0));
        let text = rows.map(|w| format!("{:.4} mm {:.4}° {} keys", w.translation * 1e3, w.degrees, w.keys));
        println!("| {name} | {own} | {} |", text.join(" | "));
        let (close, plain) = (rows[0], rows[1]);
        assert!(
            close.translation < 3.0 * MAX_METRES && close.degrees < 3.0 * MAX_DEGREES,
            "{name}: {close:?}"
        );
        assert!(close.degrees <= plain.degrees + 1e-6, "{name}: {close:?} {plain:?}");
    }
}
