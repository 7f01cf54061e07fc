//! Joint positions over time against an f64 evaluation that shares no code with the importer: rotation matrices from the
//! Euler angles as the file lists them, and between keys the rotation about one axis that leads from one matrix to the next.

use crate::oracle::{Fault, Oracle};
use choreo_importer_kit_testing::{assets, import_bytes, pose, warnings};
use import_bvh::BvhImporter;
use std::path::PathBuf;

/// Relative to the skeleton's size: f32 has 6e-8 a number, and a dozen joints in a row add up.
const ALLOWED: f64 = 2e-6;

fn samples() -> Vec<(String, Vec<u8>)> {
    let own = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let mut paths = vec![own.join("orders.bvh"), own.join("arm.bvh")];
    if let Some(folder) = assets(4) {
        let names = [
            "valid-channel-order-yxz.bvh",
            "valid-nested-joints.bvh",
            "walk01.bvh",
            "mocopi-mobile-arm-raise-turn.bvh",
        ];
        paths.extend(names.map(|n| folder.join("bvh").join(n)));
    }
    let read =
        |p: &PathBuf| (p.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(p).unwrap());
    paths.iter().map(read).collect()
}

/// Worst distance of any joint at any key and any quarter of an interval, relative to the skeleton's size.
fn worst_joint_distance(name: &str, bytes: &[u8], fault: Option<Fault>) -> f64 {
    let asset = import_bytes(&BvhImporter, name, bytes).unwrap_or_else(|e| panic!("{e}"));
    let oracle = Oracle::read(std::str::from_utf8(bytes).unwrap());
    let scale = asset.origin.metres_per_unit.unwrap();
    assert_eq!(asset.skeleton.len(), oracle.joints.len(), "{name}");
    let size = oracle.size() * scale;
    let every = oracle.frames.len() / 40 + 1;
    let mut worst = 0.0f64;
    for frame in (0..oracle.frames.len()).step_by(every) {
        let quarters: &[f64] = if frame + 1 < oracle.frames.len() { &[0.0, 0.25, 0.5] } else { &[0.0] };
        for part in quarters {
            // Times by the clip's own keys: the rounding of the frame time is tested below.
            let keys = &asset.clips[0].curves()[0].times;
            let secs = match keys.get(frame + 1) {
                Some(next) => keys[frame].as_secs() + (next.as_secs() - keys[frame].as_secs()) * part,
                None => keys[frame].as_secs(),
            };
            let ours = pose::at(&asset, Some(0), secs);
            let truth = oracle.positions(frame, *part, fault);
            for (joint, (a, b)) in ours.iter().zip(&truth).enumerate() {
                let error = (a.translation.as_dvec3() - *b * scale).length() / size;
                assert!(error.is_finite(), "{name} joint {joint}");
                worst = worst.max(error);
            }
        }
    }
    worst
}

#[test]
fn joints_equal_the_reference_evaluation_of_the_file() {
    for (name, bytes) in samples() {
        let error = worst_joint_distance(&name, &bytes, None);
        println!("{name}: worst joint {error:.1e} of the size");
        assert!(error < ALLOWED, "{name}: {error}");
    }
}

/// The comparison can fail: the angles applied in the opposite order, and a position added to the offset.
#[test]
fn the_comparison_detects_a_planted_fault() {
    for (name, bytes) in samples() {
        if name == "arm.bvh" || name == "valid-nested-joints.bvh" {
            continue; // They turn about one axis at a time: the order makes no difference.
        }
        let error = worst_joint_distance(&name, &bytes, Some(Fault::OppositeOrder));
        assert!(error > ALLOWED * 100.0, "{name}: {error}");
    }
    let (name, bytes) = samples().remove(0);
    assert!(worst_joint_distance(&name, &bytes, Some(Fault::PositionAddsToOffset)) > 0.1);
}

#[test]
fn names_times_and_guesses() {
    let (name, bytes) = samples().remove(0);
    let asset = import_bytes(&BvhImporter, &name, bytes).unwrap();
    assert_eq!(asset.skeleton.names(), ["Hips", "Left Arm", "Hand", "Hand_end", "Foot", "Foot_end"]);
    let clip = &asset.clips[0];
    assert_eq!((clip.name.as_str(), clip.duration.as_secs()), ("orders", 2.0 / 30.0));
    assert_eq!(asset.origin.metres_per_unit, Some(0.01));
    assert_eq!(
        warnings(&asset),
        [
            "HIERARCHY: the format has no unit; taken as 1 cm by the skeleton's extent of 140.0000 (option scale: metres a unit)"
        ]
    );

    let Some(folder) = assets(4) else { return };
    for (file, joints, curves, secs) in [
        ("walk01.bvh", 24, 20, 100.0 / 24.0),
        ("mocopi-mobile-arm-raise-turn.bvh", 32, 54, 852.0 / 50.0),
        ("valid-nested-joints.bvh", 6, 5, 2.0 / 30.0),
        ("valid-channel-order-yxz.bvh", 3, 3, 1.0 / 60.0),
    ] {
        let bytes = std::fs::read(folder.join("bvh").join(file)).unwrap();
        let asset = import_bytes(&BvhImporter, file, bytes).unwrap();
        let clip = &asset.clips[0];
        let facts = (asset.skeleton.len(), clip.curves().len());
        assert_eq!(facts, (joints, curves), "{file}");
        assert!((clip.duration.as_secs() - secs).abs() < 1e-8, "{file}: {}", clip.duration.as_secs());
        let bounds = asset.rest_bounds();
        let height = (bounds.max - bounds.min).max_element();
        assert!((0.8..2.6).contains(&height), "{file} is {height} m high");
    }
}
