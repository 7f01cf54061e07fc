//! Mirroring is checked by invariants on random skeletons with random joint axes, and by a closed form.

use crate::support::*;
use choreo_motion::*;
use glam::{DAffine3, DMat3, DQuat, DVec3, Quat, Vec3};
use proptest::prelude::*;

/// A random tree of central joints with pairs of branches and random joint axes; its rest positions are symmetric if
/// `symmetric`.
fn random_skeleton(random: &mut Random, symmetric: bool) -> Skeleton {
    let (mut names, mut parents, mut rest) = (Vec::new(), Vec::new(), Vec::new());
    let mut pairs: Vec<(u32, u32)> = Vec::new();
    let mut middle = Vec::new();
    // Positions and rotations in model space: the rest positions are symmetric although the axes are not.
    let mut model: Vec<(DVec3, DQuat)> = Vec::new();
    let mut add =
        |name: String, parent: Option<u32>, at: DVec3, turn: DQuat, model: &mut Vec<(DVec3, DQuat)>| {
            let (origin, base) = parent.map_or((DVec3::ZERO, DQuat::IDENTITY), |p| model[p as usize]);
            let inverse = base.conjugate();
            rest.push(Transform {
                translation: (inverse * (at - origin)).as_vec3(),
                rotation: (inverse * turn).normalize().as_quat(),
                scale: Vec3::ONE,
            });
            names.push(name);
            parents.push(parent);
            model.push((at, turn));
            names.len() as u32 - 1
        };
    let turn = |random: &mut Random| DQuat::from_array(random.rotation().map(f64::from)).normalize();
    let at = |random: &mut Random| DVec3::from_array([0; 3].map(|_| f64::from(random.signed())));
    let first = add("Hips".into(), None, DVec3::new(0.0, 1.0, 0.1), turn(random), &mut model);
    middle.push(first);
    for i in 0..2 + random.below(5) {
        if random.below(3) == 0 {
            let parent = middle[random.below(middle.len())];
            let place = at(random) * DVec3::new(0.0, 1.0, 1.0);
            middle.push(add(format!("Spine{i}"), Some(parent), place, turn(random), &mut model));
            continue;
        }
        let below = random.below(pairs.len() + 1);
        let (l, r) = match pairs.get(below) {
            Some(pair) => *pair,
            None => (middle[0], middle[0]),
        };
        let mut place = at(random);
        place.x = place.x.abs() + 0.1;
        let across = if symmetric { place * DVec3::new(-1.0, 1.0, 1.0) } else { at(random) };
        let left = add(format!("Left{i}"), Some(l), place, turn(random), &mut model);
        let right = add(format!("Right{i}"), Some(r), across, turn(random), &mut model);
        pairs.push((left, right));
    }
    if pairs.is_empty() {
        let left = add("LeftHand".into(), Some(first), DVec3::X, turn(random), &mut model);
        let right = add("RightHand".into(), Some(first), -DVec3::X, turn(random), &mut model);
        pairs.push((left, right));
    }
    Skeleton::new(names, parents, rest).unwrap()
}

/// Translations and rotations of any interpolation.
fn random_clip(random: &mut Random, joints: usize) -> Clip {
    let mut curves = Vec::new();
    for joint in 0..joints as u32 {
        for path in [Path::Translation, Path::Rotation] {
            let kinds = [Interpolation::Step, Interpolation::Linear, Interpolation::CubicSpline];
            if random.below(4) > 0 {
                let secs: Vec<f64> = (0..1 + random.below(4)).map(|k| k as f64 * 0.5).collect();
                let kind = kinds[random.below(3)];
                curves.push(random_curve(random, joint, path, kind, times(&secs)));
            }
        }
    }
    Clip::new("moves".into(), joints, curves).unwrap()
}

fn sampled(skeleton: &Skeleton, clip: &Clip, at: f64) -> Pose {
    let mut pose = Pose::rest(skeleton);
    Sample { clip, time: Time::from_secs(at), pose: &mut pose }.run();
    pose
}

fn mirrored(map: &MirrorMap, from: &Pose) -> Pose {
    let mut out = Pose::identity(0);
    Mirror { map, from, out: &mut out }.run();
    out
}

/// Largest distance of two poses: metres, and the chord between quaternions of either sign.
fn distance(a: &Pose, b: &Pose) -> f32 {
    let pairs = a.iter().zip(b.iter());
    let one = |(a, b): (Transform, Transform)| {
        let chord = (a.rotation - b.rotation).length().min((a.rotation + b.rotation).length());
        chord.max((a.translation - b.translation).length()).max((a.scale - b.scale).length())
    };
    pairs.map(one).fold(0.0, f32::max)
}

fn model_matrices(skeleton: &Skeleton, pose: &Pose) -> Vec<DAffine3> {
    let local =
        |t: Transform| (t.translation.as_dvec3(), t.rotation.as_dquat().normalize(), t.scale.as_dvec3());
    model64(skeleton, &pose.iter().map(local).collect::<Vec<_>>())
}

/// Rounding to f32 of numbers up to two, twice.
const MAX_ROUNDING_ERROR: f32 = 2e-6;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn mirroring_a_pose_twice_restores_it(seed: u64, at in 0.0..2.0f64) {
        let random = &mut Random(seed);
        let symmetric = random.below(2) == 0;
        let skeleton = random_skeleton(random, symmetric);
        let clip = random_clip(random, skeleton.len());
        let map = MirrorMap::new(&skeleton).unwrap();
        prop_assert!(map.unpaired().is_empty());
        let pose = sampled(&skeleton, &clip, at);
        let once = mirrored(&map, &pose);
        prop_assert!(distance(&pose, &mirrored(&map, &once)) < MAX_ROUNDING_ERROR);
        let back = clip.mirrored(&map).mirrored(&map);
        prop_assert_eq!(back.curves().len(), clip.curves().len());
        prop_assert!(distance(&pose, &sampled(&skeleton, &back, at)) < 10.0 * MAX_ROUNDING_ERROR);
        // The rest pose is its own mirror image, by definition.
        let rest = Pose::rest(&skeleton);
        prop_assert!(distance(&rest, &mirrored(&map, &rest)) < MAX_ROUNDING_ERROR);
    }

    /// Between the keys too: slerp, cubics and steps.
    #[test]
    fn a_mirrored_clip_is_the_mirrored_pose_at_every_time(seed: u64, at in -0.1..2.0f64) {
        let random = &mut Random(seed);
        let skeleton = random_skeleton(random, false);
        let clip = random_clip(random, skeleton.len());
        let map = MirrorMap::new(&skeleton).unwrap();
        let pose = mirrored(&map, &sampled(&skeleton, &clip, at));
        let other = sampled(&skeleton, &clip.mirrored(&map), at);
        // A cubic that all but vanishes before it is normalized loses digits.
        prop_assert!(distance(&pose, &other) < 1e-3, "{}", distance(&pose, &other));
    }

/// In a symmetric skeleton each joint gets the reflected position of its partner, and the reflected rotation from rest. Compared
    /// in f64.
    #[test]
    fn each_joint_takes_the_reflected_transform_of_its_partner(seed: u64, at in 0.0..2.0f64) {
        let random = &mut Random(seed);
        let skeleton = random_skeleton(random, true);
        let clip = random_clip(random, skeleton.len());
        let map = MirrorMap::new(&skeleton).unwrap();
        prop_assert!(map.asymmetry().0 < 1e-5 && map.axis() == 0);
        let pose = sampled(&skeleton, &clip, at);
        let (before, after) = (model_matrices(&skeleton, &pose), model_matrices(&skeleton, &mirrored(&map, &pose)));
        let rest = model_matrices(&skeleton, &Pose::rest(&skeleton));
        let m = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
        for joint in 0..skeleton.len() {
            let partner = map.partner(joint as u32).unwrap() as usize;
            prop_assert!((after[joint].translation - m * before[partner].translation).length() < 1e-5);
            let turned = |of: &[DAffine3], j: usize| of[j].matrix3 * rest[j].matrix3.transpose();
            let error = turned(&after, joint) - m * turned(&before, partner) * m;
            prop_assert!(error.to_cols_array().iter().all(|v| v.abs() < 1e-5), "{error}");
// Negative control: without the reflection, the rotation differs.
            let other = turned(&after, joint) - turned(&before, partner);
            let turns = (turned(&before, partner) - DMat3::IDENTITY).to_cols_array();
            if map.partner(joint as u32) != Some(joint as u32) && turns.iter().any(|v| v.abs() > 1.2) {
                prop_assert!(other.to_cols_array().iter().any(|v| v.abs() > 1e-4));
            }
        }
    }
}

fn skeleton_of_rows(rows: &[(&str, Option<u32>, [f32; 3])]) -> Skeleton {
    let names = rows.iter().map(|r| r.0.to_string()).collect();
    let at = |r: &(&str, Option<u32>, [f32; 3])| Transform { translation: r.2.into(), ..Transform::IDENTITY };
    Skeleton::new(names, rows.iter().map(|r| r.1).collect(), rows.iter().map(at).collect()).unwrap()
}

#[test]
fn partners_are_found_by_name_then_by_position_in_the_hierarchy() {
    let skeleton = skeleton_of_rows(&[
        ("Armature", None, [0.0; 3]),
        ("hips", Some(0), [0.0, 1.0, 0.0]),
        ("arm_joint_L__4_", Some(1), [0.3, 0.5, 0.0]),
        ("arm_joint_R", Some(1), [-0.3, 0.5, 0.0]),
        ("arm_joint_L__3_", Some(2), [0.2, 0.0, 0.0]),
        ("arm_joint_R__2_", Some(3), [-0.2, 0.0, 0.0]),
        ("leg.l", Some(1), [0.1, -0.1, 0.0]),
        ("leg.r", Some(1), [-0.1, -0.1, 0.0]),
        ("pouch", Some(6), [0.1, 0.0, 0.0]),
        ("strap.l", Some(0), [0.1, 0.0, 0.0]),
        ("buckle", Some(9), [0.1, 0.0, 0.0]),
    ]);
    let map = MirrorMap::new(&skeleton).unwrap();
    assert_eq!(map.pairs(&skeleton), [(2, 3), (4, 5), (6, 7)]);
    assert_eq!((map.partner(0), map.partner(1), map.partner(8)), (Some(0), Some(1), None));
    assert_eq!(map.unpaired(), [8, 9, 10]);
    assert_eq!(map.asymmetry().0, 0.0);
    assert_eq!(
        MirrorMap::new(&skeleton_of_rows(&[("hips", None, [0.0; 3])])).unwrap_err(),
        MirrorError::NoPairs
    );
}

/// A right arm raised by 90° about z, seen from the front, is a left arm raised by -90°; exactly, since axes agree.
#[test]
fn mirroring_moves_a_raised_arm_to_the_other_side() {
    let skeleton = skeleton_of_rows(&[
        ("Hips", None, [0.0, 1.0, 0.0]),
        ("LeftArm", Some(0), [0.2, 0.5, 0.0]),
        ("RightArm", Some(0), [-0.2, 0.5, 0.0]),
    ]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let raise = curve(
        2,
        Path::Rotation,
        Interpolation::Linear,
        &[0.0, 1.0],
        &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half],
    );
    let sway =
        curve(0, Path::Translation, Interpolation::Linear, &[0.0, 1.0], &[0.0, 1.0, 0.0, 0.25, 1.0, 0.5]);
    let clip = Clip::new("wave".into(), 3, vec![raise, sway]).unwrap();
    let other = clip.mirrored(&MirrorMap::new(&skeleton).unwrap());
    assert_eq!((other.curves()[0].joint, other.duration), (1, clip.duration));
    assert_eq!(other.curves()[0].values[4..], [-0.0, -0.0, -half, half]);
    assert_eq!(other.curves()[1].values[..], [0.0, 1.0, 0.0, -0.25, 1.0, 0.5]);
    let pose = sampled(&skeleton, &other, 1.0);
    assert!((pose.get(1).rotation * Vec3::X).abs_diff_eq(-Vec3::Y, 1e-6));
    assert_eq!(pose.get(2).rotation, Quat::IDENTITY);
}

/// One side has half the scale of the other, a node converts centimetres, and scales are animated.
#[test]
fn scales_and_units_are_mirrored_relative_to_the_rest_pose() {
    let mut rest = [Transform::IDENTITY; 4];
    rest[1] = Transform { translation: Vec3::X, scale: Vec3::splat(0.01), ..Transform::IDENTITY };
    rest[2] = Transform { translation: -Vec3::X, scale: Vec3::splat(0.02), ..Transform::IDENTITY };
    let names = ["hips", "l_arm", "r_arm", "l_hand"].map(String::from).to_vec();
    let mut names5 = names.clone();
    names5.push("r_hand".into());
    let mut rest5 = rest.to_vec();
    rest5.push(Transform::IDENTITY);
    let skeleton = Skeleton::new(names5, vec![None, Some(0), Some(0), Some(1), Some(2)], rest5).unwrap();
    let map = MirrorMap::new(&skeleton).unwrap();
    let mut pose = Pose::rest(&skeleton);
    // The left hand moves outwards by 30 units (0.3 m), and the scale of its arm doubles.
    pose.set(3, Transform { translation: Vec3::X * 30.0, ..Transform::IDENTITY });
    pose.set(1, Transform { scale: Vec3::splat(0.02), ..pose.get(1) });
    let out = mirrored(&map, &pose);
    assert!(out.get(4).translation.abs_diff_eq(Vec3::X * -15.0, 1e-5));
    assert!(out.get(2).scale.abs_diff_eq(Vec3::splat(0.04), 1e-7));
    assert!(distance(&mirrored(&map, &out), &pose) < 1e-5);
}
