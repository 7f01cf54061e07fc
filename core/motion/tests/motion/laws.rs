//! Laws that hold for any clip, pose and time, tried on random ones.

use crate::support::*;
use choreo_motion::*;
use glam::{Affine3A, Quat, Vec3};
use proptest::prelude::*;

/// A skeleton and two clips on it, from a seed.
fn random_motion(seed: u64) -> (Skeleton, Clip, Clip) {
    let mut random = Random(seed);
    let joints = 1 + random.below(20);
    let skeleton = skeleton(joints, Some(&mut random));
    let clip = |random: &mut Random| {
        let mut curves = Vec::new();
        for joint in 0..joints as u32 {
            for path in [Path::Translation, Path::Rotation, Path::Scale] {
                if random.below(3) == 0 {
                    continue;
                }
                let kinds = [Interpolation::Step, Interpolation::Linear, Interpolation::CubicSpline];
                let interpolation = kinds[random.below(3)];
                let keys = 1 + random.below(5);
                let secs: Vec<f64> =
                    (0..keys).map(|k| k as f64 * 0.5 + random.below(400) as f64 / 1000.0).collect();
                let mut curve = random_curve(random, joint, path, interpolation, times(&secs));
                if path == Path::Scale {
                    // Scales stay away from zero, because the inverse of a scale near zero is arbitrarily large.
                    curve.values = curve.values.iter().map(|v| 1.0 + 0.25 * v).collect();
                }
                curves.push(curve);
            }
        }
        Clip::new("random".into(), joints, curves).unwrap()
    };
    let (a, b) = (clip(&mut random), clip(&mut random));
    (skeleton, a, b)
}

fn sampled(skeleton: &Skeleton, clip: &Clip, time: Time) -> Pose {
    let mut pose = Pose::rest(skeleton);
    Sample { clip, time, pose: &mut pose }.run();
    pose
}

fn model_matrices(skeleton: &Skeleton, pose: &Pose) -> Vec<Affine3A> {
    let mut out = vec![Affine3A::IDENTITY; skeleton.len()];
    LocalToModel { skeleton, pose, model_from_joint: &mut out }.run();
    out
}

/// The largest difference of two elements, relative to the largest element.
fn difference(a: &[Affine3A], b: &[Affine3A]) -> f32 {
    let pairs = || a.iter().flat_map(|m| m.to_cols_array()).zip(b.iter().flat_map(|m| m.to_cols_array()));
    let size = pairs().map(|(x, _)| x.abs()).fold(1.0, f32::max);
    pairs().map(|(x, y)| (x - y).abs()).fold(0.0, f32::max) / size
}

/// Whether two transforms are equal up to a tolerance; q and −q are the same rotation.
fn nearly_equal(a: &Transform, b: &Transform, tolerance: f32) -> bool {
    let turned = a.rotation.dot(b.rotation).abs() > 1.0 - tolerance;
    let close = |x: Vec3, y: Vec3| (x - y).abs().max_element() <= tolerance * (1.0 + x.abs().max_element());
    turned && close(a.translation, b.translation) && close(a.scale, b.scale)
}

/// Rounding of a few operations a joint, down a chain of twenty.
const MAX_ROUNDING_ERROR: f32 = 2e-5;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn crossfade_of_a_clip_with_itself_is_the_clip(seed: u64, at in 0.0..3.0f64, weight in 0.0..=1.0f32) {
        let (skeleton, clip, _) = random_motion(seed);
        let time = Time::from_secs(at);
        let pose = sampled(&skeleton, &clip, time);
        let alone = model_matrices(&skeleton, &pose);
        let mut scratch = [Pose::rest(&skeleton), Pose::rest(&skeleton)];
        let mut faded = vec![Affine3A::IDENTITY; skeleton.len()];
        let mut fade = Crossfade {
            skeleton: &skeleton, rest: &Pose::rest(&skeleton), from: &clip, from_time: time, to: &clip, to_time: time,
            weight, scratch: &mut scratch, model_from_joint: &mut faded,
        };
        prop_assert!(fade.check().is_ok());
        fade.run();
        prop_assert!(difference(&alone, &faded) < MAX_ROUNDING_ERROR, "{}", difference(&alone, &faded));
        let mut blended = Pose::identity(0);
        Blend { from: &pose, to: &pose, weight, mask: None, out: &mut blended }.run();
        for (a, b) in pose.iter().zip(blended.iter()) {
            prop_assert!(nearly_equal(&a, &b, 1e-6), "{a:?} {b:?}");
        }
    }

/// The two clips give different poses, so that the comparison can fail.
    #[test]
    fn blend_with_weight_0_or_1_returns_an_input_bit_for_bit(seed: u64, at in 0.0..3.0f64) {
        let (skeleton, a, b) = random_motion(seed);
        let [a, b] = [&a, &b].map(|clip| sampled(&skeleton, clip, Time::from_secs(at)));
        for (weight, end) in [(0.0, &a), (1.0, &b)] {
            let mut out = Pose::identity(0);
            Blend { from: &a, to: &b, weight, mask: None, out: &mut out }.run();
            prop_assert_eq!(&out, end);
        }
// With inputs exchanged, a weight w becomes 1 − w.
        let (mut there, mut back) = (Pose::identity(0), Pose::identity(0));
        Blend { from: &a, to: &b, weight: 0.25, mask: None, out: &mut there }.run();
        Blend { from: &b, to: &a, weight: 0.75, mask: None, out: &mut back }.run();
        for (a, b) in there.iter().zip(back.iter()) {
            prop_assert!(nearly_equal(&a, &b, 1e-5), "{a:?} {b:?}");
        }
    }

    /// Each matrix is the parent's times the joint's own, so the parent's inverse gives the joint's own back.
    #[test]
    fn inverse_parent_matrices_recover_the_local_transforms(seed: u64, at in 0.0..3.0f64) {
        let (skeleton, clip, _) = random_motion(seed);
        let pose = sampled(&skeleton, &clip, Time::from_secs(at));
        let model = model_matrices(&skeleton, &pose);
        for (joint, parent) in skeleton.parents().iter().enumerate() {
            let local = pose.get(joint).to_affine();
            let from_parent = parent.map_or(Affine3A::IDENTITY, |p| model[p as usize]);
            prop_assume!(from_parent.matrix3.determinant().abs() > 1e-3);
            let back = from_parent.inverse() * model[joint];
// The inverse magnifies rounding by the ratio of the scales of the chain.
            prop_assert!(difference(&[local], &[back]) < 5e-3, "{local:?} {back:?}");
        }
    }

/// A quaternion of any length gives the same rotation as the normalized one.
    #[test]
    fn local_to_model_ignores_the_length_of_quaternions(seed: u64, k in 0.1..10.0f32) {
        let (skeleton, clip, _) = random_motion(seed);
        let pose = sampled(&skeleton, &clip, Time::from_secs(0.7));
        let mut long = pose.clone();
        for joint in 0..long.len() {
            let mut t = long.get(joint);
            t.rotation = Quat::from_array(t.rotation.to_array().map(|v| v * k));
            long.set(joint, t);
        }
        prop_assert!(difference(&model_matrices(&skeleton, &pose), &model_matrices(&skeleton, &long)) < MAX_ROUNDING_ERROR);
    }

    /// A negative speed gives the mirror image, within the trim, of the clip time at the positive speed.
    #[test]
    fn negative_speed_mirrors_the_clip_time(start in 0i64..1_000_000, length in 1i64..1_000_000, at in 0i64..10_000_000, speed in 0.01..4.0f64) {
        let trim = (Time(start), Time(start + length));
        for repeat in [Repeat::Once, Repeat::PingPong, Repeat::Loop] {
            let forwards = Playback { speed, trim, repeat }.clip_time(Time(at));
            let backwards = Playback { speed: -speed, trim, repeat }.clip_time(Time(at));
            prop_assert_eq!(trim.0.0 + trim.1.0 - backwards.0, forwards.0);
        }
    }

    /// A clip cut in two and played one part after the other is the clip.
    #[test]
    fn a_split_playback_gives_the_clip_times_of_the_whole(length in 2i64..1_000_000, cut in 0.0..1.0f64, at in 0i64..1_200_000) {
        let cut = 1 + (cut * (length - 2) as f64) as i64;
        let part = |from: i64, to: i64, at: i64| {
            Playback { speed: 1.0, trim: (Time(from), Time(to)), repeat: Repeat::Once }.clip_time(Time(at))
        };
        let parts = if at < cut { part(0, cut, at) } else { part(cut, length, at - cut) };
        prop_assert_eq!(parts, part(0, length, at));
// A loop repeats after each period.
        let looped = Playback { speed: 1.0, trim: (Time(0), Time(length)), repeat: Repeat::Loop };
        prop_assert_eq!(looped.clip_time(Time(at)), looped.clip_time(Time(at + 7 * length)));
    }

    #[test]
    fn binding_to_the_own_skeleton_keeps_the_clip(seed: u64, at in 0.0..3.0f64) {
        let (skeleton, clip, _) = random_motion(seed);
        let (bound, missing) = bind_clip(&clip, &skeleton, &skeleton);
        prop_assert!(missing.is_empty());
        let time = Time::from_secs(at);
        prop_assert_eq!(sampled(&skeleton, &clip, time), sampled(&skeleton, &bound, time));
    }

    /// Skinning with one joint of weight 1 is that joint's matrix; weights shared among equal joints change nothing.
    #[test]
    fn weights_shared_by_equal_joints_skin_like_one_joint(seed: u64, share in 0.0..=1.0f32) {
        let (skeleton, clip, _) = random_motion(seed);
        let matrix = model_matrices(&skeleton, &sampled(&skeleton, &clip, Time::from_secs(0.3)))[0];
        let matrices = [matrix, matrix];
        let positions = [Vec3::new(1.0, -2.0, 0.5)];
        let mut out = [Vec3::ZERO];
        LinearSkinning {
            matrices: &matrices, influences: 4, joint_indices: &[0, 1, 0, 0], joint_weights: &[share, 1.0 - share, 0.0, 0.0],
            positions: &positions, normals: &[], out_positions: &mut out, out_normals: &mut [],
        }.run();
        let expected = matrix.transform_point3(positions[0]);
        prop_assert!((out[0] - expected).length() < 1e-5 * (1.0 + expected.length()), "{} {expected}", out[0]);
    }
}
