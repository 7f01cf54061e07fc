//! Additive layers and weighted blends are compared with closed forms and f64, in any order.

use crate::support::*;
use choreo_motion::math::rotation::{from_rotation_vector, rotation_vector};
use choreo_motion::{AdditiveLayers, Pose, Transform, WeightedBlend};
use glam::{DQuat, DVec3, Quat, Vec3};

fn random_pose(random: &mut Random, joints: usize) -> Pose {
    let mut pose = Pose::identity(joints);
    for joint in 0..joints {
        let mut vector = || Vec3::new(random.signed(), random.signed(), random.signed());
        let (translation, scale) = (vector(), vector() * 0.2 + 1.0);
        let rotation = Quat::from_array(random.rotation());
        pose.set(joint, Transform { translation, rotation, scale });
    }
    pose
}

fn angle(a: Quat, b: Quat) -> f64 {
    rotation_vector(a.as_dquat().conjugate() * b.as_dquat()).length()
}

fn largest_difference(a: &Pose, b: &Pose) -> f64 {
    let one = |(a, b): (Transform, Transform)| {
        let moved = (a.translation - b.translation).length() + (a.scale - b.scale).length();
        f64::from(moved).max(angle(a.rotation, b.rotation))
    };
    a.iter().zip(b.iter()).map(one).fold(0.0, f64::max)
}

#[test]
fn rotation_vectors_and_rotations_convert_back_at_any_angle() {
    let axis = DVec3::new(0.6, -0.48, 0.64);
    for degrees in [0.0, 1e-9, 1e-3, 1.0, 90.0, 179.999, 180.0] {
        let v = axis * f64::to_radians(degrees);
        let q = from_rotation_vector(v);
        assert!((q.length() - 1.0).abs() < 1e-15);
        assert!(rotation_vector(q).abs_diff_eq(v, 1e-12), "{degrees}");
        assert!(rotation_vector(-q).abs_diff_eq(v, 1e-9), "−q at {degrees}");
    }
    // Beyond half a turn, the vector is that of the shorter rotation.
    let v = axis * 4.0;
    let short = axis * (4.0 - std::f64::consts::TAU);
    assert!(rotation_vector(from_rotation_vector(v)).abs_diff_eq(short, 1e-12));
}

#[test]
fn additive_weights_scale_the_angle_and_may_be_negative() {
    let turned = |degrees: f32| {
        let mut pose = Pose::identity(1);
        pose.set(
            0,
            Transform { rotation: Quat::from_rotation_x(degrees.to_radians()), ..Transform::IDENTITY },
        );
        pose
    };
    for (weight, expected) in [(1.0, 130.0), (0.5, 80.0), (0.0, 30.0), (-0.3, 0.0), (0.25, 55.0)] {
        let mut deltas = AdditiveLayers::default();
        deltas.start(1);
        deltas.add(&turned(20.0), &turned(120.0), weight, None);
        let mut pose = turned(30.0);
        deltas.apply(&mut pose);
        let error = angle(pose.get(0).rotation, Quat::from_rotation_x(f32::to_radians(expected)));
        assert!(error < 1e-6, "{weight}: {error}");
    }
}

#[test]
fn additive_layers_are_independent_of_their_order_and_cancel() {
    let mut random = Random(7);
    let base = random_pose(&mut random, 19);
    let poses: Vec<(Pose, Pose, f32)> = (0..4)
        .map(|i| (random_pose(&mut random, 19), random_pose(&mut random, 19), 0.2 + 0.2 * i as f32))
        .collect();
    let mask: Vec<f32> = (0..19).map(|i| i as f32 / 18.0).collect();
    let sum = |order: &[usize], signs: &[f32]| {
        let mut deltas = AdditiveLayers::default();
        deltas.start(19);
        for sign in signs {
            for i in order {
                let (reference, pose, weight) = &poses[*i];
                deltas.add(reference, pose, weight * sign, Some(&mask));
            }
        }
        let mut out = base.clone();
        deltas.apply(&mut out);
        out
    };
    let first = sum(&[0, 1, 2, 3], &[1.0]);
    for order in [[3, 2, 1, 0], [1, 3, 0, 2], [2, 0, 3, 1]] {
        assert!(largest_difference(&first, &sum(&order, &[1.0])) < 1e-6);
    }
    assert!(largest_difference(&base, &sum(&[0, 1, 2, 3], &[1.0, -1.0])) < 1e-5);
    // Negative control: products of quaternions depend on the order.
    let product = |order: [usize; 2]| {
        let delta = |i: usize| {
            let (from, to) = (poses[i].0.get(5).rotation, poses[i].1.get(5).rotation);
            from_rotation_vector(rotation_vector(from.as_dquat().conjugate() * to.as_dquat()) * 0.5)
        };
        order.into_iter().fold(DQuat::IDENTITY, |q, i| q * delta(i)).as_quat()
    };
    assert!(angle(product([0, 1]), product([1, 0])) > 0.05);
}

#[test]
fn a_weighted_blend_is_the_mean_in_any_order_and_the_base_has_the_remaining_weight() {
    let mut random = Random(11);
    let base = random_pose(&mut random, 21);
    let poses: Vec<Pose> = (0..3).map(|_| random_pose(&mut random, 21)).collect();
    let mix = |order: &[usize], weights: [f32; 3]| {
        let mut mix = WeightedBlend::default();
        mix.start(21);
        order.iter().for_each(|i| mix.add(&base, &poses[*i], weights[*i], None));
        let mut out = base.clone();
        mix.finish(&mut out);
        out
    };
    for weights in [[0.2, 0.3, 0.1], [0.9, 0.8, 0.7], [0.5, 0.5, 0.0]] {
        let first = mix(&[0, 1, 2], weights);
        for order in [[2, 1, 0], [1, 2, 0], [0, 2, 1]] {
            assert!(largest_difference(&first, &mix(&order, weights)) < 1e-5, "{weights:?}");
        }
        let w: Vec<f64> = weights.iter().map(|w| f64::from(*w)).collect();
        let total: f64 = w.iter().sum();
        for joint in 0..21 {
            let left = (1.0 - total).max(0.0);
            let b = base.get(joint);
            let mut place = b.translation.as_dvec3() * left;
            let mut q = glam::DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
            for (pose, w) in poses.iter().zip(&w) {
                let pose = pose.get(joint);
                place += pose.translation.as_dvec3() * *w;
                let turned = pose.rotation.as_dquat();
                q += turned * if turned.dot(b.rotation.as_dquat()) < 0.0 { -*w } else { *w };
            }
            let got = first.get(joint);
            assert!(got.translation.as_dvec3().abs_diff_eq(place / total.max(1.0), 1e-6));
            // The tolerance is the error of corrected nlerp against slerp.
            let turned = b.rotation.as_dquat().slerp(q.normalize(), total.min(1.0));
            assert!(angle(got.rotation, turned.as_quat()) < 8e-4);
        }
    }
    // Without poses the base is unchanged bit for bit; one pose at weight 1 gives that pose.
    assert_eq!(mix(&[], [0.0; 3]), base);
    assert_eq!(mix(&[0, 1, 2], [0.0; 3]), base);
    assert!(largest_difference(&mix(&[1], [0.0, 1.0, 0.0]), &poses[1]) < 1e-6);
    let normalized_too_early =
        largest_difference(&mix(&[0, 1, 2], [0.2, 0.3, 0.1]), &mix(&[0, 1, 2], [0.4, 0.6, 0.2]));
    assert!(normalized_too_early > 0.05, "a base that does not fill up would have passed");
}
