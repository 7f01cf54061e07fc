//! Clip editing: each edit is compared with its definition at random times, on random clips with all kinds of keys.

use crate::support::*;
use choreo_motion::edit::reduce::KeptTimes;
use choreo_motion::*;
use glam::{DQuat, DVec3, Vec3};
use proptest::prelude::*;

/// A random clip of at most 2 s with all kinds of keys at separate times, morph weights included.
fn random_clip(random: &mut Random, skeleton: &Skeleton) -> Clip {
    let mut curves = Vec::new();
    for joint in 0..skeleton.len() as u32 {
        for path in [Path::Translation, Path::Rotation, Path::Scale, Path::Weights(2)] {
            let kinds = [Interpolation::Step, Interpolation::Linear, Interpolation::CubicSpline];
            if random.below(3) > 0 {
                let start = random.below(2) as f64 * 0.3;
                let secs: Vec<f64> = (0..1 + random.below(5))
                    .map(|k| start + k as f64 * 0.3 + random.below(100) as f64 * 0.001)
                    .collect();
                let kind = kinds[random.below(3)];
                curves.push(random_curve(random, joint, path, kind, times(&secs)));
            }
        }
    }
    let wave = random_curve(random, 0, Path::Rotation, Interpolation::Linear, times(&[0.0, 0.5, 1.7]));
    curves.retain(|c| (c.joint, c.path) != (0, Path::Rotation));
    curves.push(wave);
    Clip::new("motion".into(), skeleton.len(), curves).unwrap()
}

fn sampled(skeleton: &Skeleton, clip: &Clip, at: Time) -> (Pose, Vec<f32>) {
    let mut pose = Pose::rest(skeleton);
    Sample { clip, time: at, pose: &mut pose }.run();
    let mut weights = vec![0.0; 2 * skeleton.len()];
    for (joint, weights) in weights.chunks_mut(2).enumerate() {
        clip.sample_weights(joint as u32, at, weights);
    }
    (pose, weights)
}

fn largest_difference(a: &(Pose, Vec<f32>), b: &(Pose, Vec<f32>)) -> f32 {
    let one = |(a, b): (Transform, Transform)| {
        let turned = (a.rotation - b.rotation).length().min((a.rotation + b.rotation).length());
        turned.max((a.translation - b.translation).length()).max((a.scale - b.scale).length())
    };
    let weights = a.1.iter().zip(&b.1).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    a.0.iter().zip(b.0.iter()).map(one).fold(weights, f32::max)
}

/// Tolerance of comparisons: a cubic rotation of nearly zero length loses digits when it is normalized.
const TOLERANCE: f32 = 2e-4;

fn time_at_fraction(fraction: f64, duration: Time) -> Time {
    duration.scaled(fraction)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn a_cut_clip_equals_that_part_and_joined_parts_equal_the_clip(seed: u64, a in 0.0..0.9f64, b in 0.01..1.0f64, at in 0.0..=1.0f64) {
        let random = &mut Random(seed);
        let skeleton = skeleton(4, Some(random));
        let clip = random_clip(random, &skeleton);
        let (from, until) = (time_at_fraction(a, clip.duration), time_at_fraction(a + (1.0 - a) * b, clip.duration));
        let cut = clip.cut(from, until).unwrap();
        prop_assert_eq!(cut.duration, until - from);
        let t = time_at_fraction(at, cut.duration);
        let distance = largest_difference(&sampled(&skeleton, &cut, t), &sampled(&skeleton, &clip, from + t));
        prop_assert!(distance < TOLERANCE, "{distance}");
        prop_assert!(cut.curves().iter().all(|c| c.times[0] >= Time::ZERO && c.times[c.times.len() - 1] <= cut.duration));
// Both parts, joined, are the clip again.
        let whole = clip.cut(Time::ZERO, until).unwrap().joined(&clip.cut(until, clip.duration).unwrap_or(clip.clone()), &skeleton);
        if until < clip.duration {
            let whole = whole.unwrap();
            prop_assert_eq!(whole.duration, clip.duration);
            let t = time_at_fraction(at, clip.duration);
            let distance = largest_difference(&sampled(&skeleton, &whole, t), &sampled(&skeleton, &clip, t));
            prop_assert!(distance < TOLERANCE, "{distance}");
        }
    }

    #[test]
    fn a_joined_clip_equals_each_clip_in_its_time(seed: u64, at in 0.0..1.0f64) {
        let random = &mut Random(seed);
        let skeleton = skeleton(3, Some(random));
        let (a, b) = (random_clip(random, &skeleton), random_clip(random, &skeleton));
        let both = a.joined(&b, &skeleton).unwrap();
        prop_assert_eq!(both.duration, a.duration + b.duration);
        let t = time_at_fraction(at, both.duration);
        let one = match t < a.duration {
            true => sampled(&skeleton, &a, t),
            false => sampled(&skeleton, &b, t - a.duration),
        };
        // If interpolations differ, cubics become LINEAR keys 1/240 s apart, which is coarse for random keys 0.3 s apart.
        let mixed = both.curves().iter().any(|c| {
            let kind = |clip: &Clip| {
                let found = clip.curves().iter().find(|d| (d.joint, d.path) == (c.joint, c.path));
                found.map(|d| d.interpolation)
            };
            let cubic = |kind| kind == Interpolation::CubicSpline;
            kind(&a).zip(kind(&b)).is_some_and(|(a, b)| a != b && (cubic(a) || cubic(b)))
        });
        let distance = largest_difference(&sampled(&skeleton, &both, t), &one);
        prop_assert!(distance < if mixed { 0.6 } else { TOLERANCE }, "{distance} {mixed}");
    }

    #[test]
    fn a_reversed_clip_plays_backwards_and_reversing_twice_restores_it(seed: u64, at in 0.0..=1.0f64) {
        let random = &mut Random(seed);
        let skeleton = skeleton(4, Some(random));
        let clip = random_clip(random, &skeleton);
        let back = clip.reversed();
        prop_assert_eq!(back.duration, clip.duration);
        let t = time_at_fraction(at, clip.duration);
        let distance = largest_difference(&sampled(&skeleton, &back, t), &sampled(&skeleton, &clip, clip.duration - t));
        prop_assert!(distance < TOLERANCE, "{distance}");
        let again = back.reversed();
        for (a, b) in again.curves().iter().zip(clip.curves()) {
            if a.interpolation == Interpolation::Step {
// The time of the first key of a STEP curve has no effect.
                prop_assert_eq!((&a.times[1..], &a.values), (&b.times[1..], &b.values));
            } else {
                prop_assert_eq!(a, b);
            }
        }
    }

    #[test]
    fn a_clip_at_another_speed_equals_the_clip_at_the_scaled_time(seed: u64, factor in 0.1..10.0f64, at in 0.0..=1.0f64) {
        let random = &mut Random(seed);
        let skeleton = skeleton(4, Some(random));
        let clip = random_clip(random, &skeleton);
        let fast = clip.at_speed(factor).unwrap();
        let t = time_at_fraction(at, fast.duration);
        // Times are rounded to ticks, which may move a time to the other side of a step.
        let near_step = |c: &Curve| c.interpolation == Interpolation::Step && c.times.iter().any(|k| (k.scaled(1.0 / factor) - t).0.abs() < 3);
        prop_assume!(!clip.curves().iter().any(near_step));
        let distance = largest_difference(&sampled(&skeleton, &fast, t), &sampled(&skeleton, &clip, t.scaled(factor)));
        prop_assert!(distance < TOLERANCE, "{distance}");
// A speed of 1/2 and then of 2 restores the clip bit for bit.
        let again = clip.at_speed(0.5).unwrap().at_speed(2.0).unwrap();
        prop_assert!(again.curves() == clip.curves() && again.duration == clip.duration);
    }

    #[test]
    fn an_offset_rotates_the_joint_in_every_pose(seed: u64, at in 0.0..=1.0f64) {
        let random = &mut Random(seed);
        let skeleton = skeleton(4, Some(random));
        let clip = random_clip(random, &skeleton);
        let turned = DQuat::from_array(random.rotation().map(f64::from)).normalize();
        let joint = random.below(4);
        let offset = clip.offset(joint as u32, Offset { moved: DVec3::ZERO, turned }, &skeleton).unwrap();
        let t = time_at_fraction(at, clip.duration);
        let (mut pose, weights) = sampled(&skeleton, &clip, t);
        let own = pose.get(joint);
        pose.set(joint, Transform { rotation: own.rotation * turned.as_quat(), ..own });
        let distance = largest_difference(&sampled(&skeleton, &offset, t), &(pose, weights));
        prop_assert!(distance < TOLERANCE, "{distance}");
    }

    #[test]
    fn reduction_stays_within_the_tolerance(seed: u64, at in 0.0..=1.0f64, tolerance in 0.0005..0.05f64) {
        let random = &mut Random(seed);
        let skeleton = skeleton(5, None);
        // Smooth motion of a hundred keys, some still.
        let secs: Vec<f64> = (0..100).map(|k| f64::from(k) / 30.0).collect();
        let mut curves = Vec::new();
        for joint in 0..5 {
            let (speed, size) = (f64::from(random.signed()) * 5.0, f64::from(random.signed()) * 0.4);
            let turn = |s: &f64| {
                let half = size * (speed * s).sin() * if joint == 3 { 0.0 } else { 1.0 };
                [half.sin() as f32, 0.0, 0.0, half.cos() as f32]
            };
            let values: Vec<f32> = secs.iter().flat_map(turn).collect();
            curves.push(curve(joint, Path::Rotation, Interpolation::Linear, &secs, &values));
        }
        let clip = Clip::new("smooth".into(), 5, curves).unwrap();
        for keep in [KeptTimes::Fewest, KeptTimes::Shared] {
            let (less, report) = clip.reduced(&skeleton, tolerance, keep).unwrap();
            prop_assert!(report.worst_m <= tolerance && report.bytes[1] <= report.bytes[0]);
            prop_assert_eq!((report.keys, less.duration), ([500, less.keys()], clip.duration));
// An independent measurement at a time between keys.
            let t = time_at_fraction(at, clip.duration);
            let model = |clip: &Clip| {
                let pose = sampled(&skeleton, clip, t).0;
                let local = |t: Transform| (t.translation.as_dvec3(), t.rotation.as_dquat().normalize(), t.scale.as_dvec3());
                model64(&skeleton, &pose.iter().map(local).collect::<Vec<_>>())
            };
            let (a, b) = (model(&clip), model(&less));
            let far = a.iter().zip(&b).map(|(a, b)| (a.translation - b.translation).length()).fold(0.0, f64::max);
            prop_assert!(far <= tolerance * 1.05, "{far} {tolerance}");
        }
        let own = clip.reduced(&skeleton, tolerance, KeptTimes::Fewest).unwrap().1;
        let shared = clip.reduced(&skeleton, tolerance, KeptTimes::Shared).unwrap().1;
        prop_assert!(own.keys[1] < 500 && own.bytes[1] <= shared.bytes[1]);
    }
}

/// The reported error is measured at keys only. It is compared with the error of joints, and of points 10 cm from them, at 3,000
/// times.
#[test]
fn the_reported_error_of_a_reduction_is_the_largest_at_any_time() {
    let skeleton = skeleton(5, None);
    let secs: Vec<f64> = (0..60).map(|k| f64::from(k) / 30.0).collect();
    let turn = |joint: u32, s: &f64| {
        let half = 0.3 * (f64::from(joint + 2) * s).sin();
        [0.0, half.sin() as f32, 0.0, half.cos() as f32]
    };
    let curves = (0..5).map(|joint| {
        let values: Vec<f32> = secs.iter().flat_map(|s| turn(joint, s)).collect();
        curve(joint, Path::Rotation, Interpolation::Linear, &secs, &values)
    });
    let clip = Clip::new("smooth".into(), 5, curves.collect()).unwrap();
    let (less, report) = clip.reduced(&skeleton, 0.01, KeptTimes::Own).unwrap();
    let mut far = 0.0f64;
    for part in 0..3000 {
        let t = Time(clip.duration.0 * part / 3000);
        let model = |clip: &Clip| {
            let local = |t: Transform| {
                (t.translation.as_dvec3(), t.rotation.as_dquat().normalize(), t.scale.as_dvec3())
            };
            model64(&skeleton, &sampled(&skeleton, clip, t).0.iter().map(local).collect::<Vec<_>>())
        };
        for (a, b) in model(&clip).iter().zip(&model(&less)) {
            for point in [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z] {
                far = far.max((a.transform_point3(0.1 * point) - b.transform_point3(0.1 * point)).length());
            }
        }
    }
    assert!((far / report.worst_m - 1.0).abs() < 0.02, "{far} {report:?}");
}

#[test]
fn the_comparison_of_cut_clips_detects_a_shift_in_time() {
    let random = &mut Random(1);
    let skeleton = skeleton(4, Some(random));
    let clip = random_clip(random, &skeleton);
    let cut = clip.cut(Time::from_secs(0.5), clip.duration).unwrap();
    let at = Time::from_secs(0.2);
    // A tenth of a second off.
    let other = sampled(&skeleton, &clip, at + Time::from_secs(0.6));
    assert!(largest_difference(&sampled(&skeleton, &cut, at), &other) > 100.0 * TOLERANCE);
}

#[test]
fn smoothing_removes_jitter_and_keeps_steady_motion() {
    let secs: Vec<f64> = (0..61).map(|k| f64::from(k) / 30.0).collect();
    let way = |shake: f32| -> Vec<f32> {
        let at = |(k, s): (usize, &f64)| [*s as f32, if k % 2 == 0 { shake } else { -shake }, 1.0];
        secs.iter().enumerate().flat_map(at).collect()
    };
    let clip = |shake: f32| {
        let way = curve(0, Path::Translation, Interpolation::Linear, &secs, &way(shake));
        Clip::new("way".into(), 1, vec![way]).unwrap()
    };
    let smooth = clip(0.01).smoothed(Time::from_secs(0.2)).unwrap();
    let keys: Vec<Vec3> = smooth.curves()[0].values.chunks(3).map(Vec3::from_slice).collect();
    for (key, s) in keys.iter().zip(&secs) {
        assert!((f64::from(key.x) - s).abs() < 1e-6, "even motion stays: {key} at {s}");
    }
    // Away from the ends less than a fifth of the jitter is left; the ends are unchanged.
    assert!(keys[10..50].iter().all(|k| k.y.abs() < 0.002), "{keys:?}");
    assert_eq!((keys[0].y, keys[60].y), (0.01, 0.01));
    let steps = Curve { interpolation: Interpolation::Step, ..clip(0.01).curves()[0].clone() };
    let steps = Clip::new("steps".into(), 1, vec![steps]).unwrap();
    assert_eq!(steps.smoothed(Time::from_secs(0.2)).unwrap().curves(), steps.curves());
}

#[test]
fn an_offset_moves_a_joint_along_the_axes_of_the_model() {
    let mut rest = vec![Transform::IDENTITY; 2];
    // A parent that is rotated by 90° and converts centimetres.
    rest[0].rotation = glam::Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    rest[0].scale = Vec3::splat(0.01);
    let skeleton = Skeleton::new(vec!["a".into(), "b".into()], vec![None, Some(0)], rest).unwrap();
    let clip = Clip::new("still".into(), 2, Vec::new()).unwrap();
    let by = Offset { moved: DVec3::Y * 0.5, turned: DQuat::IDENTITY };
    let pose = sampled(&skeleton, &clip.offset(1, by, &skeleton).unwrap(), Time::ZERO).0;
    assert!(pose.get(1).translation.abs_diff_eq(Vec3::X * 50.0, 1e-4), "{}", pose.get(1).translation);
}

#[test]
fn invalid_edits_are_errors() {
    let random = &mut Random(2);
    let skeleton = skeleton(2, None);
    let clip = random_clip(random, &skeleton);
    let (a, b) = (Time::from_secs(0.5), Time::from_secs(0.2));
    assert!(
        clip.cut(a, b)
            .unwrap_err()
            .to_string()
            .starts_with("from 0.5 s to 0.2 s is not a part of the clip \"motion\"")
    );
    assert!(clip.cut(Time::ZERO, Time::from_secs(99.0)).is_err() && clip.cut(a, a).is_err());
    assert!(clip.at_speed(0.0).is_err() && clip.at_speed(f64::NAN).is_err() && clip.at_speed(-1.0).is_err());
    assert!(
        clip.smoothed(Time::ZERO).is_err()
            && clip.offset(9, Offset { moved: DVec3::ONE, turned: DQuat::IDENTITY }, &skeleton).is_err()
    );
    assert!(clip.reduced(&skeleton, -1.0, KeptTimes::Fewest).is_err());
    let other = Clip::new("other".into(), 3, Vec::new()).unwrap();
    assert!(clip.joined(&other, &skeleton).is_err());
}
