//! Clips: errors, corrections and shared data; binding to other skeletons.

use crate::support::*;
use choreo_motion::{Clip, Curve, FrameRate, Interpolation, Path, Skeleton, Time, Transform, bind_clip};
use std::sync::Arc;

const LINEAR: Interpolation = Interpolation::Linear;

fn error_of(c: Curve) -> String {
    Clip::new("bad".into(), 2, vec![c]).unwrap_err().to_string()
}

#[test]
fn errors_name_the_curve_and_the_problem() {
    let t = |secs: &[f64], values: &[f32]| curve(1, Path::Translation, LINEAR, secs, values);
    let r = |values: &[f32]| curve(0, Path::Rotation, LINEAR, &[0.0], values);
    let six = [0.0; 6];
    let cases = [
        (t(&[], &[]), "curve 0 (Translation of joint 1): it has no keys"),
        (
            t(&[0.0, 1.0], &[0.0; 5]),
            "curve 0 (Translation of joint 1): the number of values is 5, must be 6 (3 per key)",
        ),
        (
            t(&[0.5, 0.5], &six),
            "curve 0 (Translation of joint 1): the time of key 1 (0.5 s) repeats that of key 0 (0.5 s); \
             key times must increase",
        ),
        (
            t(&[0.5, 0.25], &six),
            "curve 0 (Translation of joint 1): the time of key 1 (0.25 s) runs backwards from that of \
             key 0 (0.5 s); key times must increase",
        ),
        (
            t(&[0.0, 1.0], &[0.0, 0.0, 0.0, 0.0, f32::NAN, 0.0]),
            "curve 0 (Translation of joint 1): key 1 holds NaN, must be finite",
        ),
        (
            t(&[0.0], &[f32::INFINITY, 0.0, 0.0]),
            "curve 0 (Translation of joint 1): key 0 holds inf, must be finite",
        ),
        (
            t(&[0.0], &[0.0, -1e20, 0.0]),
            "curve 0 (Translation of joint 1): key 0 holds -100000000000000000000, at most ±1000000000000000 \
             is allowed",
        ),
        (r(&[0.0; 4]), "curve 0 (Rotation of joint 0): the rotation of key 0 has length zero, must be 1"),
        (
            curve(2, Path::Scale, LINEAR, &[0.0], &[1.0; 3]),
            "curve 0 (Scale of joint 2): there is no such joint; number of the skeleton's joints: 2",
        ),
        (
            curve(0, Path::Weights(1 << 20), LINEAR, &[0.0], &[]),
            "curve 0 (Weights(1048576) of joint 0): 1048576 morph weights, at most 65536 are allowed",
        ),
    ];
    for (curve, text) in cases {
        assert_eq!(error_of(curve), text);
    }
    let c = curve(0, Path::Scale, LINEAR, &[0.0], &[1.0; 3]);
    assert_eq!(
        Clip::new("twice".into(), 1, vec![c.clone(), c]).unwrap_err().to_string(),
        "curve 1 (Scale of joint 0): curve 0 already drives the same property"
    );
}

#[test]
fn rotation_keys_are_normalized() {
    let values = [0.0, 0.0, 6.0, 8.0, 0.0, 0.0, 0.0, 1.0];
    let clip =
        Clip::new("long".into(), 1, vec![curve(0, Path::Rotation, LINEAR, &[0.0, 1.0], &values)]).unwrap();
    assert_eq!(&*clip.curves()[0].values, [0.0, 0.0, 0.6, 0.8, 0.0, 0.0, 0.0, 1.0]);
    // Tangents are not rotations: they stay as they are.
    let values = [5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0];
    let cubic = curve(0, Path::Rotation, Interpolation::CubicSpline, &[0.0], &values);
    let clip = Clip::new("cubic".into(), 1, vec![cubic]).unwrap();
    assert_eq!(&clip.curves()[0].values[..8], [5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
}

#[test]
fn duration_is_the_last_key() {
    let a = curve(0, Path::Scale, LINEAR, &[0.0, 2.5], &[1.0; 6]);
    let b = curve(0, Path::Translation, LINEAR, &[1.0], &[1.0; 3]);
    assert_eq!(Clip::new("two".into(), 1, vec![a, b]).unwrap().duration, Time::from_secs(2.5));
}

fn skeleton_with_names(names: &[&str]) -> Skeleton {
    let parents = (0..names.len()).map(|i| (i > 0).then(|| i as u32 - 1)).collect();
    let rest = vec![Transform::IDENTITY; names.len()];
    Skeleton::new(names.iter().map(|n| n.to_string()).collect(), parents, rest).unwrap()
}

#[test]
fn binding_matches_exact_then_plain_names_and_shares_the_keys() {
    let from = skeleton_with_names(&["mixamorig:Hips", "mixamorig:Spine", "Tail", "Head"]);
    let to = skeleton_with_names(&["Root", "Head", "Hips", "head", "mixamorig1:Spine"]);
    let curves = (0..4).map(|j| curve(j, Path::Translation, LINEAR, &[0.0], &[j as f32; 3])).collect();
    let clip = Clip::new("walk".into(), 4, curves).unwrap();
    let (bound, unmatched) = bind_clip(&clip, &from, &to);
    assert_eq!(unmatched, ["Tail"]);
    assert_eq!(bound.joint_count(), 5);
    let joints: Vec<u32> = bound.curves().iter().map(|c| c.joint).collect();
    // "Head" is there exactly, though "head" has the same plain name.
    assert_eq!(joints, [2, 4, 1]);
    assert_eq!((bound.name.as_str(), bound.duration), ("walk", clip.duration));
    assert!(Arc::ptr_eq(&bound.curves()[0].values, &clip.curves()[0].values));
    assert!(bound.animates(4) && !bound.animates(0));
}

#[test]
fn binding_matches_humanoid_joints_of_other_naming_families() {
    let from = skeleton_with_names(&["Bip01 Pelvis", "Bip01 L UpperArm", "Bip01 R Calf", "Bip01 Ponytail1"]);
    let to = skeleton_with_names(&["mixamorig:Hips", "mixamorig:RightLeg", "mixamorig:LeftArm"]);
    let curves = (0..4).map(|j| curve(j, Path::Translation, LINEAR, &[0.0], &[j as f32; 3])).collect();
    let clip = Clip::new("walk".into(), 4, curves).unwrap();
    let (bound, unmatched) = bind_clip(&clip, &from, &to);
    assert_eq!(unmatched, ["Bip01 Ponytail1"]);
    let joints: Vec<(u32, f32)> = bound.curves().iter().map(|c| (c.joint, c.values[0])).collect();
    assert_eq!(joints, [(0, 0.0), (2, 1.0), (1, 2.0)]);
    assert_eq!((to.find("leftUpperArm"), to.find("Bip01 L Thigh")), (Some(2), None));
}

#[test]
fn ambiguous_plain_names_are_not_guessed() {
    let from = skeleton_with_names(&["a:Arm"]);
    let to = skeleton_with_names(&["b:Arm", "c:Arm"]);
    let clip = Clip::new("x".into(), 1, vec![curve(0, Path::Scale, LINEAR, &[0.0], &[1.0; 3])]).unwrap();
    let (bound, unmatched) = bind_clip(&clip, &from, &to);
    assert_eq!((bound.curves().len(), unmatched), (0, vec!["a:Arm".to_string()]));
}

#[test]
fn binding_to_the_same_names_changes_nothing() {
    let skeleton = skeleton_with_names(&["x", "x", "y"]);
    let curves = (0..3).map(|j| curve(j, Path::Scale, LINEAR, &[0.0], &[1.0; 3])).collect();
    let clip = Clip::new("same".into(), 3, curves).unwrap();
    let (bound, unmatched) = bind_clip(&clip, &skeleton, &skeleton);
    assert_eq!((bound.curves(), unmatched.len()), (clip.curves(), 0));
}

#[test]
fn baking_reports_its_largest_error() {
    let thirty = FrameRate { num: 30, den: 1 };
    // A key between two frames is cut off: the triangle's tip at 0.51 s, between frames 15 (0.5 s) and 16 (0.5333 s).
    let tip = curve(
        0,
        Path::Translation,
        LINEAR,
        &[0.0, 0.51, 1.0],
        &[0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
    );
    let clip = Clip::new("tip".into(), 1, vec![tip]).unwrap();
    let (baked, error) = clip.baked(thirty).unwrap();
    assert_eq!(baked.curves()[0].times.len(), 31);
    assert_eq!((baked.duration, baked.curves()[0].times[30]), (clip.duration, clip.duration));
    let (a, b) = (0.5 / 0.51, (1.0 - 16.0 / 30.0) / 0.49);
    let wanted = 1.0 - (a + (b - a) * 0.01 * 30.0);
    assert!((error.translation_m - wanted).abs() < 1e-6, "{error:?} {wanted}");
    assert_eq!((error.rotation_rad, error.scale), (0.0, 0.0));
    // A turn at constant speed loses nothing; steps and weights stay as they are.
    let turn = curve(0, Path::Rotation, LINEAR, &[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    let steps = curve(0, Path::Scale, Interpolation::Step, &[0.0, 0.4], &[1.0, 1.0, 1.0, 2.0, 2.0, 2.0]);
    let clip = Clip::new("turn".into(), 1, vec![turn, steps.clone()]).unwrap();
    let (baked, error) = clip.baked(thirty).unwrap();
    assert!(error.rotation_rad < 1e-6 && error.scale == 0.0, "{error:?}");
    assert_eq!(baked.curves()[1], steps);
}

#[test]
fn baking_beyond_the_size_limit_is_an_error() {
    let long = curve(0, Path::Scale, LINEAR, &[0.0, 1e6], &[1.0; 6]);
    let clip = Clip::new("long".into(), 1, vec![long]).unwrap();
    let refused = clip.baked(FrameRate { num: 60, den: 1 }).unwrap_err().to_string();
    assert_eq!(
        refused,
        "baking the clip \"long\" at 60 frames/s makes 180000003 numbers, at most 67108864 are allowed; \
         choose a lower rate"
    );
}
