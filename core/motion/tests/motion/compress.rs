//! Compressed clips are compared with f64 evaluations of their source clips.

use crate::support;
use crate::support::Random;
use choreo_motion::{
    Clip, CompressError, Crossfade, Curve, FrameRate, Interpolation, Level, Path, Pose, Sample, Skeleton,
    Time, Transform,
};
use glam::{Affine3A, DQuat, DVec3, EulerRot, Quat, Vec3};
use std::sync::Arc;

/// A skeleton whose chains of 20 joints branch off one joint.
fn test_skeleton(joints: usize) -> Skeleton {
    let parents: Vec<Option<u32>> = (0..joints as u32)
        .map(|j| {
            if j == 0 {
                None
            } else if j % 20 == 0 {
                Some(3)
            } else {
                Some(j - 1)
            }
        })
        .collect();
    let parents: Vec<Option<u32>> =
        parents.into_iter().enumerate().map(|(j, p)| p.map(|p| p.min(j as u32 - 1))).collect();
    let mut random = Random(4);
    let rest = (0..joints)
        .map(|j| Transform {
            translation: if j == 0 { Vec3::Y } else { Vec3::new(0.01, 0.06, 0.0) },
            rotation: Quat::from_array(random.rotation()),
            scale: Vec3::ONE,
        })
        .collect();
    Skeleton::new((0..joints).map(|j| format!("j{j}")).collect(), parents, rest).unwrap()
}

/// A clip in which all joints rotate smoothly with some jitter, radians, and the root travels and spins; keys at a rate.
fn smooth_clip(skeleton: &Skeleton, rate: u32, secs: f64, jitter: f32, interpolation: Interpolation) -> Clip {
    let rate = FrameRate { num: rate, den: 1 };
    let frames = (secs * f64::from(rate.num)) as i64;
    let times: Arc<[Time]> = (0..=frames).map(|f| rate.time_of(f)).collect();
    let mut random = Random(17);
    let mut curves = Vec::new();
    for (joint, rest) in skeleton.rest().iter().enumerate() {
        let [a, b] = [0; 2].map(|_| random.rotation());
        let mut values = Vec::new();
        for (i, time) in times.iter().enumerate() {
            let t = time.as_secs() as f32;
            let mut wave = |k: f32| 0.5 * libm::sinf(t * (2.0 + k) + 9.0 * k) + jitter * random.signed();
            let mut turn = Quat::from_euler(EulerRot::XYZ, wave(a[0]), wave(a[1]), wave(b[0]));
            if joint == 0 {
                turn = Quat::from_rotation_y(t * 2.5) * turn;
            }
            let q = rest.rotation * turn;
            // Some keys have the quaternion of the other sign.
            let q = if i % 7 == 3 && interpolation == Interpolation::Linear { -q } else { q };
            match interpolation {
                Interpolation::CubicSpline => {
                    values.extend([0.0; 4]);
                    values.extend(q.to_array());
                    values.extend([0.0; 4]);
                }
                _ => values.extend(q.to_array()),
            }
        }
        let joint = joint as u32;
        curves.push(Curve {
            joint,
            path: Path::Rotation,
            interpolation,
            times: times.clone(),
            values: values.into(),
        });
        let still = |v: Vec3| -> Arc<[f32]> { times.iter().flat_map(|_| v.to_array()).collect() };
        let linear = Interpolation::Linear;
        let mut places = still(rest.translation);
        if joint == 0 {
            places = times.iter().flat_map(|t| [t.as_secs() as f32 * 1.4, 1.0, 0.0]).collect();
        }
        curves.push(Curve {
            joint,
            path: Path::Translation,
            interpolation: linear,
            times: times.clone(),
            values: places,
        });
        curves.push(Curve {
            joint,
            path: Path::Scale,
            interpolation: linear,
            times: times.clone(),
            values: still(Vec3::ONE),
        });
    }
    Clip::new("motion".into(), skeleton.len(), curves).unwrap()
}

/// Farthest that any joint of `b` is from an f64 evaluation of `a`, millimetres.
fn error_mm(skeleton: &Skeleton, a: &Clip, b: &Clip) -> f64 {
    let mut pose = Pose::rest(skeleton);
    let mut worst = 0.0f64;
    for i in 0..300 {
        let time = Time((a.duration.0 as f64 * ((f64::from(i) * 0.618_033_988_75) % 1.0)) as i64);
        pose.copy_from(&Pose::rest(skeleton));
        Sample { clip: b, time, pose: &mut pose }.run();
        let wide =
            |t: Transform| (t.translation.as_dvec3(), t.rotation.as_dquat().normalize(), t.scale.as_dvec3());
        let got: Vec<_> = pose.iter().map(wide).collect();
        let mut want: Vec<_> = skeleton.rest().iter().copied().map(wide).collect();
        for curve in a.curves() {
            let value = support::evaluate(curve, time);
            let local = &mut want[curve.joint as usize];
            match curve.path {
                Path::Translation => local.0 = DVec3::from_slice(&value),
                Path::Rotation => local.1 = DQuat::from_slice(&value),
                Path::Scale => local.2 = DVec3::from_slice(&value),
                Path::Weights(_) => {}
            }
        }
        for (a, b) in support::model64(skeleton, &got).iter().zip(support::model64(skeleton, &want)) {
            worst = worst.max((a.translation - b.translation).length() * 1e3);
        }
    }
    worst
}

#[test]
fn compression_to_a_tenth_of_a_millimetre_takes_a_tenth_of_the_dense_bytes() {
    let skeleton = test_skeleton(61);
    let clip = smooth_clip(&skeleton, 30, 6.0, 0.0, Interpolation::Linear);
    let (small, report) = clip.compressed(&skeleton, 1e-4).unwrap();
    assert!(small.is_compressed() && report.worst_m > 0.0 && report.worst_m <= 1e-4, "{report:?}");
    let error = error_mm(&skeleton, &clip, &small);
    assert!(error > 1e-4 && error <= 0.1, "{error} mm");
    assert!(report.bytes[1] * 10 <= report.dense_bytes, "{report:?}");
    assert_eq!(small.stored_bytes(), report.bytes[1]);
    assert_eq!(small.duration, clip.duration);
    // A coarser tolerance takes fewer bytes and has a larger error.
    let (coarse, rough) = clip.compressed(&skeleton, 5e-3).unwrap();
    assert!(rough.bytes[1] < report.bytes[1] && rough.worst_m <= 5e-3);
    assert!(error_mm(&skeleton, &clip, &coarse) > 0.1, "the comparison must see more than a tenth");
}

#[test]
fn compression_of_jitter_other_rates_and_splines_stays_within_the_tolerance() {
    let skeleton = test_skeleton(30);
    for (rate, jitter, interpolation) in [
        (30, 0.02, Interpolation::Linear),
        (24, 0.0, Interpolation::Linear),
        (60, 0.001, Interpolation::Linear),
        (30, 0.0, Interpolation::CubicSpline),
    ] {
        let clip = smooth_clip(&skeleton, rate, 3.0, jitter, interpolation);
        let (small, report) = clip.compressed(&skeleton, 1e-4).unwrap();
        let error = error_mm(&skeleton, &clip, &small);
        assert!(error <= 0.1, "{rate} Hz, {interpolation:?}: {error} mm, {report:?}");
        assert!(report.bytes[1] <= report.bytes[0]);
        assert!(
            interpolation != Interpolation::Linear || report.bytes[1] * 2 < report.bytes[0],
            "{rate} {report:?}"
        );
    }
}

#[test]
fn compressed_sampling_is_equal_on_all_levels_and_for_decoded_keys() {
    let skeleton = test_skeleton(61);
    let clip = smooth_clip(&skeleton, 30, 4.0, 0.003, Interpolation::Linear);
    let (small, _) = clip.compressed(&skeleton, 1e-4).unwrap();
    let plain = Clip::new("plain".into(), small.joint_count(), small.curves().to_vec()).unwrap();
    assert!(!plain.is_compressed() && plain.stored_bytes() > small.stored_bytes());
    let mut poses = [(); 3].map(|()| Pose::rest(&skeleton));
    for i in 0..200 {
        // Before the first key and after the last too.
        let time = Time(small.duration.0 * (i * 37 % 220 - 10) / 200 + i);
        let [best, portable, decoded] = &mut poses;
        Sample { clip: &small, time, pose: best }.run_on(Level::best());
        Sample { clip: &small, time, pose: portable }.run_on(Level::Portable);
        assert_eq!(best, portable, "{time:?}");
        Sample { clip: &plain, time, pose: decoded }.run();
        for (a, b) in best.iter().zip(decoded.iter()) {
            let q = if a.rotation.dot(b.rotation) < 0.0 { -b.rotation } else { b.rotation };
            assert!(
                a.rotation.abs_diff_eq(q, 5e-6) && a.translation.abs_diff_eq(b.translation, 1e-5),
                "{a:?} {b:?}"
            );
            assert!((a.rotation.length() - 1.0).abs() < 1e-5);
        }
    }
}

#[test]
fn a_crossfade_of_compressed_clips_matches_the_uncompressed_one() {
    let skeleton = test_skeleton(40);
    let clip = smooth_clip(&skeleton, 30, 4.0, 0.0, Interpolation::Linear);
    let (small, _) = clip.compressed(&skeleton, 1e-4).unwrap();
    let rest = Pose::rest(&skeleton);
    let model = |clip: &Clip| {
        let mut scratch = [rest.clone(), rest.clone()];
        let mut out = vec![Affine3A::IDENTITY; skeleton.len()];
        Crossfade {
            skeleton: &skeleton,
            rest: &rest,
            from: clip,
            from_time: Time::from_secs(0.7),
            to: clip,
            to_time: Time::from_secs(3.1),
            weight: 0.4,
            scratch: &mut scratch,
            model_from_joint: &mut out,
        }
        .run();
        out
    };
    for (a, b) in model(&clip).iter().zip(model(&small)) {
        assert!(a.translation.abs_diff_eq(b.translation, 2e-4), "{a} {b}");
    }
}

#[test]
fn clips_that_cannot_become_smaller_stay_and_invalid_input_is_an_error() {
    let skeleton = test_skeleton(5);
    let key = |joint| Curve {
        joint,
        path: Path::Rotation,
        interpolation: Interpolation::Linear,
        times: [Time::ZERO, Time::from_secs(1.0)].into(),
        values: [0.0, 0.0, 0.0, 1.0, 0.0, 0.6, 0.0, 0.8].into(),
    };
    let few = Clip::new("few".into(), 5, vec![key(1), key(2)]).unwrap();
    let (same, report) = few.compressed(&skeleton, 1e-4).unwrap();
    assert!(!same.is_compressed() && report.bytes[0] == report.bytes[1] && report.worst_m == 0.0);
    assert_eq!(same.curves(), few.curves());
    let empty = Clip::new("empty".into(), 5, Vec::new()).unwrap();
    assert!(!empty.compressed(&skeleton, 1e-4).unwrap().0.is_compressed());
    assert_eq!(
        few.compressed(&skeleton, f64::NAN).unwrap_err().to_string(),
        "the tolerance of NaN m must be from 0.000001 m to 0.1 m"
    );
    let wrong = few.compressed(&test_skeleton(6), 1e-4).unwrap_err();
    assert_eq!(wrong, CompressError::Joints { clip: "few".into(), joints: 5, expected: 6 });
    // All curves are constant: one key each.
    let still = smooth_clip(&skeleton, 30, 2.0, 0.0, Interpolation::Linear).cut(Time::ZERO, Time(1)).unwrap();
    assert!(still.compressed(&skeleton, 1e-4).is_ok());
}

#[test]
fn clips_with_extreme_key_times_are_not_compressed() {
    let curve = Curve {
        joint: 0,
        path: Path::Translation,
        interpolation: Interpolation::Linear,
        times: vec![Time(i64::MIN / 2), Time(0), Time(i64::MAX)].into(),
        values: vec![0.0; 9].into(),
    };
    let Ok(clip) = Clip::new("long".into(), 1, vec![curve]) else { panic!("such keys can be") };
    let (small, report) = clip.compressed(&test_skeleton(1), 1e-4).unwrap();
    assert_eq!((report.worst_m, report.bytes[0]), (0.0, report.bytes[1]));
    assert_eq!(small.duration, clip.duration);
}
