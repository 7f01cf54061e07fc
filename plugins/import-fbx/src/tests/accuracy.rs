//! Errors of clips between their keys, compared with ufbx, and the number of keys that a smaller tolerance needs.

use crate::file::TOLERANCE_DEG;
use crate::local::LocalTransform;
use crate::{FbxImporter, convert, load};
use choreo_asset::Asset;
use choreo_importer_kit_testing::{Companions, assets, options, source};
use choreo_motion::{Pose, Sample, Time};
use choreo_plugin::{ImportScope, Importer, OptionValue};
use glam::{DQuat, DVec3};
use std::path::Path;

const ONLY_CLIPS: ImportScope =
    ImportScope { geometry: false, clips: true, textures: false, pixels: false, image_files: false };

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LargestErrors {
    /// Metres, of any node in its parent's space.
    pub translation: f64,
    pub degrees: f64,
    /// Error of any axis.
    pub scale: f64,
    pub keys: usize,
    /// Joints that hold the scale of others.
    pub helpers: usize,
}

const MAX_METRES: f64 = 1e-4;

/// A tolerance in degrees, or keys a second.
#[derive(Clone, Copy)]
pub(super) enum Sampling {
    Within(f64),
    Rate(f64),
}

fn import_clips(bytes: &[u8], sampling: Sampling) -> Asset {
    let (name, value) = match sampling {
        Sampling::Within(degrees) => ("tolerance", degrees),
        Sampling::Rate(rate) => ("rate", rate),
    };
    let options = options(&FbxImporter, &[(name, OptionValue::Number(value))]);
    let source = source("a.fbx", bytes);
    FbxImporter.import(&source, &Companions::none(), ONLY_CLIPS, &options).unwrap()
}

/// Compares clips with ufbx at `samples` evenly spaced times, which fall between keys. `delay_secs` is a planted fault.
pub(super) fn largest_errors(
    bytes: &[u8],
    sampling: Sampling,
    samples: usize,
    delay_secs: f64,
) -> LargestErrors {
    let asset = import_clips(bytes, sampling);
    let scene = load::load(bytes, ONLY_CLIPS, &Companions::none()).unwrap();
    let mut errors = LargestErrors::default();
    let names = asset.skeleton.names();
    for clip in &asset.clips {
        errors.keys += clip.curves().iter().map(|c| c.times.len()).sum::<usize>();
        let stack = scene.anim_stacks.as_ref().iter().find(|s| s.element.name.as_ref() == clip.name).unwrap();
        let mut pose = Pose::rest(&asset.skeleton);
        for k in 0..samples {
            let secs = clip.duration.as_secs() * (k as f64 + 0.37) / samples as f64;
            Sample { clip, time: Time::from_secs(secs), pose: &mut pose }.run();
            for node in &scene.nodes {
                let own = node.element.name.as_ref();
                let name = match node.parent.as_ref().filter(|_| node.is_scale_helper) {
                    Some(parent) => format!("{} {own}", parent.element.name.as_ref()),
                    None => own.to_string(),
                };
                let named = names.iter().filter(|n| **n == name).count();
                let joint = names.iter().position(|n| *n == name);
                let (Some(joint), 1) = (joint, named) else { continue };
                errors.helpers += usize::from(node.is_scale_helper && k == 0);
                let theirs = node.evaluate_transform(&stack.anim, stack.time_begin + secs + delay_secs);
                let ours = pose.get(joint);
                let t = theirs.translation;
                let off = DVec3::new(t.x, t.y, t.z).distance(ours.translation.as_dvec3());
                let s = theirs.scale;
                let scale = (DVec3::new(s.x, s.y, s.z) - ours.scale.as_dvec3()).abs().max_element();
                errors.scale = errors.scale.max(scale);
                let r = theirs.rotation;
                let theirs = DQuat::from_xyzw(r.x, r.y, r.z, r.w).normalize();
                let ours = ours.rotation.as_dquat().normalize();
                let chord = (ours - if ours.dot(theirs) < 0.0 { -theirs } else { theirs }).length();
                errors.translation = errors.translation.max(off);
                errors.degrees = errors.degrees.max(4.0 * libm::asin((chord / 2.0).min(1.0)).to_degrees());
            }
        }
    }
    errors
}

fn own_sample() -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/flag.fbx")).unwrap()
}

/// Checks the project's own sample: a rotation by Euler angles, cubic and linear, through 70° in a second.
#[test]
fn a_smaller_tolerance_gives_a_smaller_error() {
    let close = largest_errors(&own_sample(), Sampling::Within(TOLERANCE_DEG), 503, 0.0);
    let [one, two, four] =
        [24.0, 48.0, 96.0].map(|rate| largest_errors(&own_sample(), Sampling::Rate(rate), 503, 0.0));
    println!("flag.fbx: {close:?} {one:?} {two:?} {four:?}");
    assert!(close.degrees < TOLERANCE_DEG && close.translation < MAX_METRES, "{close:?}");
    assert!(one.degrees > 3.0 * two.degrees && two.degrees > 3.0 * four.degrees, "{one:?} {two:?} {four:?}");
    // A thousandth of a second late is seen.
    assert!(
        largest_errors(&own_sample(), Sampling::Within(TOLERANCE_DEG), 503, 0.002).degrees
            > 2.0 * TOLERANCE_DEG
    );
}

/// The table of the README.
#[test]
fn sample_files_are_within_the_tolerance() {
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
        let scene = load::load(&bytes, ONLY_CLIPS, &Companions::none()).unwrap();
        let own = scene.settings.frames_per_second;
        let within = [0.5, TOLERANCE_DEG, 0.005].map(Sampling::Within);
        let samplings = within.into_iter().chain([own, 4.0 * own].map(Sampling::Rate));
        let rows: Vec<LargestErrors> =
            samplings.map(|sampling| largest_errors(&bytes, sampling, 97, 0.0)).collect();
        let text: Vec<String> = rows
            .iter()
            .map(|w| format!("{:.4} mm {:.4}° {} keys", w.translation * 1e3, w.degrees, w.keys))
            .collect();
        println!("| {name} | {own} | {} |", text.join(" | "));
        // f32 keys: a few millionths of a degree, and of the greatest translation. What is sampled is off by a little more than at
        // its probes.
        for (row, degrees) in rows.iter().zip([0.5, TOLERANCE_DEG, 0.005]) {
            let metres = MAX_METRES * degrees / TOLERANCE_DEG;
            let close = row.degrees < 1.15 * degrees + 1e-4 && row.translation < 1.15 * metres + 2e-6;
            assert!(close, "{name}: {row:?} {degrees}");
        }
        // The file's own rate is no better, but where there is nothing to be better at.
        assert!(rows[1].degrees <= rows[3].degrees.max(0.01 * TOLERANCE_DEG), "{name}: {rows:?}");
    }
}

/// Compares nodes at rest with ufbx's: they differ in the last bits of two libraries' sines.
#[test]
fn rest_transforms_equal_those_of_ufbx() {
    let files = assets(23).map(|folder| crate::tests::accuracy::all_files(&folder)).unwrap_or_default();
    let read = |path: &std::path::PathBuf| std::fs::read(path).unwrap();
    let (mut worst, mut count) = (0.0f64, 0);
    for bytes in files.iter().map(read).chain([own_sample()]) {
        let scene = load::load(&bytes, ONLY_CLIPS, &Companions::none()).unwrap();
        for node in &scene.nodes {
            let Some(local) = LocalTransform::new(node) else { continue };
            let theirs = convert::transform(&node.local_transform, String::new).unwrap();
            let ours = local.at_rest();
            let turn = 1.0 - ours.rotation.as_dquat().dot(theirs.rotation.as_dquat()).abs();
            let far = (ours.translation - theirs.translation).length() / (1.0 + theirs.translation.length());
            worst = worst.max(turn).max(f64::from(far)).max(f64::from((ours.scale - theirs.scale).length()));
            count += 1;
        }
    }
    println!("{count} nodes at rest, off by {worst:.1e} at most");
    assert!(count > 15 && worst < 1e-6, "{count} {worst}");
}

fn all_files(folder: &Path) -> Vec<std::path::PathBuf> {
    let mut folders = vec![folder.join("fbx"), folder.join("same-model-3-formats")];
    let mut out = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => folders.push(path),
                false if path.extension().is_some_and(|e| e == "fbx") => out.push(path),
                false => {}
            }
        }
    }
    out.sort();
    out
}
