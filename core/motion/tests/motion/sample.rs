//! Sampling is compared with the f64 reference, for every interpolation and layout, and for extreme clips.

use crate::support::*;
use choreo_motion::{Clip, Curve, Interpolation, Level, Path, Pose, Sample, Time, Transform};
use glam::{Quat, Vec3};
use proptest::prelude::*;
use std::sync::Arc;

const PATHS: [Path; 3] = [Path::Translation, Path::Rotation, Path::Scale];
const INTERPOLATIONS: [Interpolation; 3] =
    [Interpolation::Step, Interpolation::Linear, Interpolation::CubicSpline];

fn sampled(clip: &Clip, time: Time) -> Pose {
    let mut pose = Pose::identity(clip.joint_count());
    let mut job = Sample { clip, time, pose: &mut pose };
    job.check().unwrap();
    job.run();
    pose
}

/// Worst error of a pose against the reference: (metres or scale, degrees).
fn worst_error(clip: &Clip, pose: &Pose, time: Time) -> (f64, f64) {
    let mut worst = (0.0f64, 0.0f64);
    for curve in clip.curves() {
        let got = pose.get(curve.joint as usize);
        let wanted = evaluate(curve, time);
        match curve.path {
            Path::Rotation => {
                let norm: f64 = quat64(got.rotation).iter().map(|c| c * c).sum();
                assert!((norm - 1.0).abs() < 2e-6, "rotation of length² {norm} at {time:?}");
                let error = degrees_between(quat64(got.rotation), wanted.try_into().unwrap());
                worst.1 = worst.1.max(error);
            }
            Path::Translation | Path::Scale => {
                let got = if curve.path == Path::Scale { got.scale } else { got.translation };
                for (g, w) in got.to_array().iter().zip(&wanted) {
                    worst.0 = worst.0.max((f64::from(*g) - w).abs());
                }
            }
            Path::Weights(_) => {}
        }
    }
    worst
}

/// A clip of all kinds of curves: some share their key times, some have separate ones, some are constant, and some joints have no
/// curve.
fn mixed_clip(seed: u64, joints: usize) -> Clip {
    let mut random = Random(seed);
    let random_times = |random: &mut Random| -> Arc<[Time]> {
        let mut at = random.below(1000) as i64;
        (0..1 + random.below(40))
            .map(|_| {
                at += 1 + random.below(50_000_000) as i64;
                Time(at)
            })
            .collect()
    };
    let shared: Vec<Arc<[Time]>> =
        vec![random_times(&mut random), (0..31).map(|i| Time(i * 23_520_000)).collect()];
    let mut curves = Vec::new();
    for joint in 0..joints as u32 {
        for path in PATHS {
            let kind = INTERPOLATIONS[random.below(3)];
            let times = match random.below(6) {
                0 => continue,
                1 => random_times(&mut random),
                n => Arc::clone(&shared[n % 2]),
            };
            let mut curve = random_curve(&mut random, joint, path, kind, times);
            if kind == Interpolation::Linear && random.below(5) == 0 {
                let first: Vec<f32> = curve.values[..path.width()].to_vec();
                curve.values = first.repeat(curve.times.len()).into();
            }
            curves.push(curve);
        }
    }
    Clip::new("mixed".into(), joints, curves).unwrap()
}

fn times_at_and_between_keys(clip: &Clip, random: &mut Random) -> Vec<Time> {
    let mut times = vec![Time(-5), Time::ZERO, clip.duration, clip.duration + Time(1), Time::MAX];
    for curve in clip.curves().iter().take(20) {
        let key = curve.times[random.below(curve.times.len())];
        times.extend([key, key - Time(1), key + Time(1)]);
    }
    times.extend((0..30).map(|_| Time(random.below(clip.duration.0.max(1) as usize) as i64)));
    times
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn all_kinds_of_curves_equal_the_reference(seed: u64, joints in 1usize..70) {
        let clip = mixed_clip(seed, joints);
        let mut random = Random(seed ^ 1);
        for time in times_at_and_between_keys(&clip, &mut random) {
            let (metres, degrees) = worst_error(&clip, &sampled(&clip, time), time);
            // Random keys have cubic curves that pass near zero: their direction is worse conditioned.
            prop_assert!(metres < 2e-6, "{metres} at {time:?}");
            prop_assert!(degrees < 2e-3, "{degrees} degrees at {time:?}");
        }
    }

    #[test]
    fn portable_and_avx2_sampling_give_the_same_bits(seed: u64, joints in 1usize..70) {
        let clip = mixed_clip(seed, joints);
        let mut random = Random(seed ^ 2);
        for time in times_at_and_between_keys(&clip, &mut random) {
            let mut poses = [Level::Portable, Level::Avx2].map(|level| {
                let mut pose = Pose::identity(joints);
                Sample { clip: &clip, time, pose: &mut pose }.run_on(level);
                pose
            });
            let bits = |pose: &mut Pose| -> Vec<u32> {
                pose.iter().flat_map(|t| {
                    [t.translation.to_array(), t.scale.to_array()].concat().into_iter().chain(t.rotation.to_array())
                }).map(f32::to_bits).collect()
            };
            let [a, b] = &mut poses;
            prop_assert_eq!(bits(a), bits(b));
        }
    }
}

fn sampled_on_level(clip: &Clip, time: Time, level: Level) -> Pose {
    let mut pose = Pose::identity(clip.joint_count());
    Sample { clip, time, pose: &mut pose }.run_on(level);
    pose
}

/// The keys of curves with separate key times are gathered, since such curves of one clip are too many for common key times.
#[test]
fn curves_with_separate_key_times_equal_the_reference_and_their_single_sampling() {
    const JOINTS: u32 = 45;
    for kind in [Interpolation::Linear, Interpolation::CubicSpline] {
        let mut random = Random(5);
        let mut curves = Vec::new();
        for (joint, path) in (0..JOINTS).flat_map(|joint| PATHS.map(|path| (joint, path))) {
            // Some lanes are driven by no curve.
            if random.below(6) == 0 {
                continue;
            }
            let mut at = random.below(1000) as i64;
            let times = (0..90 + random.below(90)).map(|_| {
                let farthest = [1, 3, 60_000_000][random.below(3)];
                at += 1 + random.below(farthest) as i64;
                Time(at)
            });
            let times: Arc<[Time]> = times.collect();
            curves.push(random_curve(&mut random, joint, path, kind, times));
        }
        let clip = Clip::new("own".into(), JOINTS as usize, curves).unwrap();
        let alone: Vec<Clip> = clip.curves().iter().map(|c| clip.rekeyed(vec![c.clone()])).collect();
        for time in times_at_and_between_keys(&clip, &mut random) {
            let pose = sampled(&clip, time);
            let (metres, degrees) = worst_error(&clip, &pose, time);
            assert!(metres < 2e-6 && degrees < 2e-3, "{kind:?}: {metres}, {degrees} degrees at {time:?}");
            assert_eq!(pose, sampled_on_level(&clip, time, Level::Portable), "{kind:?} at {time:?}");
            for (curve, alone) in clip.curves().iter().zip(&alone) {
                let [got, wanted] = [&pose, &sampled(alone, time)].map(|p| p.get(curve.joint as usize));
                match curve.path {
                    Path::Translation => assert_eq!(got.translation, wanted.translation),
                    Path::Scale => assert_eq!(got.scale, wanted.scale),
                    // The series of a linear rotation has as many terms as the widest of eight needs.
                    _ => assert!(got.rotation.abs_diff_eq(wanted.rotation, 2e-7), "{got:?} {wanted:?}"),
                }
            }
            for joint in (0..JOINTS).filter(|j| !clip.animates(*j)) {
                assert_eq!(pose.get(joint as usize), Transform::IDENTITY);
            }
        }
    }
}

#[test]
fn the_comparison_with_the_reference_detects_a_planted_error() {
    let clip = mixed_clip(7, 30);
    let time = Time(123_456_789);
    let mut pose = sampled(&clip, time);
    let curve = clip.curves().iter().find(|c| c.path == Path::Rotation).unwrap();
    let joint = curve.joint as usize;
    let mut broken = pose.get(joint);
    broken.rotation *= Quat::from_xyzw(3e-6, 0.0, 0.0, 1.0);
    pose.set(joint, broken);
    let before = worst_error(&clip, &sampled(&clip, time), time).1;
    let after = worst_error(&clip, &pose, time).1;
    assert!(before < 1e-4 && after > 2e-4, "{before} {after}");
}

/// Rotations between 1e-6° and 180° apart, sampled alone, in a batch, and in rows.
#[test]
fn linear_rotations_are_accurate_to_a_ten_thousandth_of_a_degree() {
    let mut worst = (0.0, 0.0, 0.0);
    for joints in [1u32, 5, 8] {
        for spacing in (1..=179).map(f64::from).chain([1e-6, 1e-3, 0.1, 179.9, 180.0]) {
            let mut random = Random(spacing.to_bits());
            let curves = (0..joints)
                .map(|joint| {
                    let a = Quat::from_array(random.rotation());
                    let axis = Vec3::new(random.signed(), random.signed(), 1.1).normalize();
                    let half = spacing.to_radians() / 2.0;
                    let b =
                        a * Quat::from_array((axis * half.sin() as f32).extend(half.cos() as f32).to_array());
                    // Every other joint gets the quaternion of the other sign, which is farther in numbers.
                    let b = if joint % 2 == 0 { b } else { -b };
                    let values = [a.to_array(), b.to_array()].concat();
                    curve(joint, Path::Rotation, Interpolation::Linear, &[0.0, 1.0], &values)
                })
                .collect();
            let clip = Clip::new("arc".into(), joints as usize, curves).unwrap();
            for step in 0..=64 {
                let time = Time(i64::from(step) * Time::TICKS_PER_SECOND / 64 + 7);
                let error = worst_error(&clip, &sampled(&clip, time), time).1;
                // At 180° both directions are shortest.
                if error > worst.0 && spacing < 180.0 {
                    worst = (error, spacing, time.as_secs());
                }
            }
        }
    }
    println!("worst slerp error {:.2e} degrees, keys {}° apart, at {:.3}", worst.0, worst.1, worst.2);
    assert!(worst.0 < 1e-4, "{worst:?}");
}

#[test]
fn a_pose_at_the_time_of_a_key_equals_the_key() {
    let mut random = Random(3);
    let even: Arc<[Time]> = (0..50).map(|i| Time(i * 23_520_000)).collect();
    let curves: Vec<Curve> = (0..24)
        .map(|i| {
            random_curve(
                &mut random,
                i / 3,
                PATHS[i as usize % 3],
                INTERPOLATIONS[i as usize / 3 % 2],
                even.clone(),
            )
        })
        .collect();
    let clip = Clip::new("keys".into(), 8, curves).unwrap();
    for (key, time) in even.iter().enumerate() {
        let pose = sampled(&clip, *time);
        for curve in clip.curves() {
            let got = pose.get(curve.joint as usize);
            let wanted = &curve.values[key * curve.path.width()..(key + 1) * curve.path.width()];
            match curve.path {
                Path::Rotation => {
                    let wanted = Quat::from_slice(wanted);
                    assert!(got.rotation == wanted || got.rotation == -wanted);
                }
                Path::Scale => assert_eq!(got.scale.to_array(), wanted),
                _ => assert_eq!(got.translation.to_array(), wanted),
            }
        }
    }
}

#[test]
fn joints_without_curves_keep_their_transforms() {
    let values = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    for joint in [0, 3, 9] {
        let moved = curve(joint, Path::Translation, Interpolation::Linear, &[0.0, 1.0], &values);
        let clip = Clip::new("one".into(), 10, vec![moved]).unwrap();
        let before = Transform {
            translation: Vec3::splat(9.0),
            rotation: Quat::from_xyzw(0.0, 1.0, 0.0, 0.0),
            scale: Vec3::splat(2.0),
        };
        let mut pose = Pose::identity(10);
        (0..10).for_each(|i| pose.set(i, before));
        Sample { clip: &clip, time: Time::from_secs(0.5), pose: &mut pose }.run();
        for i in 0..10 {
            let mut wanted = before;
            if i == joint as usize {
                wanted.translation = Vec3::new(2.5, 3.5, 4.5);
            }
            assert_eq!(pose.get(i), wanted, "joint {i}");
            assert_eq!(clip.animates(i as u32), i == joint as usize);
        }
    }
}

#[test]
fn sampling_an_empty_skeleton_gives_an_empty_pose() {
    let clip = Clip::new("nothing".into(), 0, vec![]).unwrap();
    assert_eq!(clip.duration, Time::ZERO);
    assert!(sampled(&clip, Time::from_secs(1.0)).is_empty());
}

#[test]
fn a_single_key_holds_at_every_time() {
    let clip = Clip::new(
        "one".into(),
        1,
        vec![curve(0, Path::Translation, Interpolation::Linear, &[2.0], &[1.0, 2.0, 3.0])],
    )
    .unwrap();
    for secs in [-1.0, 0.0, 2.0, 1e6] {
        assert_eq!(sampled(&clip, Time::from_secs(secs)).get(0).translation, Vec3::new(1.0, 2.0, 3.0));
    }
}

#[test]
fn sampling_finds_the_interval_among_a_million_keys() {
    let mut random = Random(11);
    for even in [true, false] {
        let mut at = 0;
        let times: Arc<[Time]> = (0..1_000_000)
            .map(|_| {
                // Uneven: spacings from one tick to fifty seconds, the worst for a table.
                at += if even { 1000 } else { 1 << random.below(36) };
                Time(at)
            })
            .collect();
        let clip = random_curve(&mut random, 0, Path::Translation, Interpolation::Linear, times);
        let clip = Clip::new("long".into(), 1, vec![clip]).unwrap();
        let times = &clip.curves()[0].times;
        for _ in 0..300 {
            let key = random.below(999_999);
            let time = Time(times[key].0 + (times[key + 1].0 - times[key].0) / 2);
            let pose = sampled(&clip, time);
            let value = |key: usize| Vec3::from_slice(&clip.curves()[0].values[key * 3..]);
            let s = time.fraction(times[key], times[key + 1]);
            let wanted = value(key) + (value(key + 1) - value(key)) * s;
            assert!(pose.get(0).translation.distance(wanted) < 1e-6);
        }
    }
}

#[test]
fn sampling_ten_thousand_joints_is_accurate() {
    let mut random = Random(5);
    let times: Arc<[Time]> = (0..3).map(|i| Time(i * 1_000_000)).collect();
    let curves = (0..10_000)
        .map(|j| random_curve(&mut random, j, Path::Rotation, Interpolation::Linear, times.clone()))
        .collect();
    let clip = Clip::new("crowd".into(), 10_000, curves).unwrap();
    let time = Time(1_500_000);
    let (_, degrees) = worst_error(&clip, &sampled(&clip, time), time);
    assert!(degrees < 1e-4, "{degrees}");
}

#[test]
fn cubic_rotations_through_zero_length_stay_normalized() {
    let zero = [0.0; 4];
    let (a, b) = ([0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, -1.0]);
    let values = [zero, a, zero, zero, b, zero].concat();
    for joints in [1u32, 8] {
        let curves = (0..joints)
            .map(|j| curve(j, Path::Rotation, Interpolation::CubicSpline, &[0.0, 1.0], &values))
            .collect();
        let clip = Clip::new("opposite".into(), joints as usize, curves).unwrap();
        for step in 0..=16 {
            let pose = sampled(&clip, Time(step * Time::TICKS_PER_SECOND / 16));
            let q = pose.get(0).rotation;
            assert!((q.length() - 1.0).abs() < 1e-6, "{q} at {step}/16");
        }
    }
}

#[test]
fn antipodal_linear_keys_are_the_same_rotation() {
    let q = [0.5, 0.5, -0.5, 0.5];
    let values = [q, q.map(|c: f32| -c)].concat();
    for joints in [1u32, 8] {
        let curves = (0..joints)
            .map(|j| curve(j, Path::Rotation, Interpolation::Linear, &[0.0, 1.0], &values))
            .collect();
        let clip = Clip::new("antipodal".into(), joints as usize, curves).unwrap();
        let got = sampled(&clip, Time::from_secs(0.3)).get(0).rotation;
        assert!(degrees_between(quat64(got), q.map(f64::from)) < 1e-5, "{got}");
    }
}

#[test]
fn morph_weights_are_sampled_and_other_joints_unchanged() {
    let w = curve(1, Path::Weights(3), Interpolation::Linear, &[0.0, 2.0], &[0.0, 1.0, 0.5, 1.0, 0.0, 0.5]);
    let clip = Clip::new("face".into(), 2, vec![w]).unwrap();
    let mut out = [7.0; 4];
    assert!(!clip.sample_weights(0, Time::ZERO, &mut out));
    assert_eq!(out, [7.0; 4]);
    assert!(clip.sample_weights(1, Time::from_secs(0.5), &mut out));
    assert_eq!(out, [0.25, 0.75, 0.5, 7.0]);
    assert!(clip.sample_weights(1, Time::from_secs(9.0), &mut out[..1]));
    assert_eq!(out[0], 1.0);
    assert!(!clip.animates(1));
}

#[test]
fn a_pose_with_the_wrong_joint_count_is_an_error() {
    let clip = Clip::new("walk".into(), 3, vec![]).unwrap();
    let mut pose = Pose::identity(2);
    let job = Sample { clip: &clip, time: Time::ZERO, pose: &mut pose };
    assert_eq!(job.check().unwrap_err().to_string(), "`Sample.pose` has length 2, must have length 3");
}
