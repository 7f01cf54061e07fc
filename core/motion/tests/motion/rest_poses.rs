//! Binding of clips between skeletons whose rest poses differ in axes and size: every bone must rotate in the world as before.

use crate::support::Random;
use choreo_motion::{
    Clip, Curve, ExpressionCurve, HumanBone, Humanoid, Interpolation, LocalToModel, Path, Pose, Sample,
    Skeleton, Time, Transform, bind_clip,
};
use glam::{Affine3A, DMat3, DQuat, DVec3, Quat, Vec3};

const CHAIN: [(&str, HumanBone); 4] = [
    ("hips", HumanBone::Hips),
    ("spine", HumanBone::Spine),
    ("chest", HumanBone::Chest),
    ("head", HumanBone::Head),
];

fn random_rotation(random: &mut Random) -> Quat {
    let mut next = || random.signed();
    Quat::from_xyzw(next(), next(), next(), next() + 1.5).normalize()
}

/// A root and a chain on it; at rest the hips stand `height` above the origin whatever the root's axes.
fn humanoid_skeleton(names: [&str; 4], seed: u64, height: f32, declared: bool) -> Skeleton {
    let random = &mut Random(seed);
    let root = Transform { rotation: random_rotation(random), ..Transform::IDENTITY };
    let hips_at = root.rotation.conjugate() * Vec3::new(0.1, height, 0.0);
    let mut rest = vec![
        root,
        Transform { translation: hips_at, rotation: random_rotation(random), ..Transform::IDENTITY },
    ];
    for _ in 1..4 {
        let translation = Vec3::new(random.signed(), random.signed(), random.signed());
        rest.push(Transform { translation, rotation: random_rotation(random), ..Transform::IDENTITY });
    }
    let all = std::iter::once("root").chain(names).map(str::to_string).collect();
    let skeleton = Skeleton::new(all, vec![None, Some(0), Some(1), Some(2), Some(3)], rest).unwrap();
    if !declared {
        return skeleton;
    }
    let bones = CHAIN.iter().zip(1..).map(|((_, bone), joint)| (*bone, joint));
    skeleton.with_humanoid(Humanoid::new(bones).unwrap()).unwrap()
}

fn clip(from: &Skeleton, seed: u64) -> Clip {
    let random = &mut Random(seed);
    let times: Vec<Time> = [0.0, 0.4, 1.0].map(Time::from_secs).to_vec();
    let mut curves = Vec::new();
    for joint in 1..5 {
        let keys = (0..3).flat_map(|_| random_rotation(random).to_array()).collect();
        let (times, interpolation) = (times.clone().into(), Interpolation::Linear);
        curves.push(Curve { joint, path: Path::Rotation, interpolation, times, values: keys });
        // Positions of the hips, and lengths of other bones, which must not be transferred.
        let keys = (0..9).map(|_| random.signed()).collect();
        let times = curves[0].times.clone();
        curves.push(Curve { joint, path: Path::Translation, interpolation, times, values: keys });
    }
    Clip::new("dance".into(), from.len(), curves).unwrap()
}

fn posed(skeleton: &Skeleton, clip: Option<&Clip>, secs: f64) -> Vec<Affine3A> {
    let mut pose = Pose::rest(skeleton);
    if let Some(clip) = clip {
        Sample { clip, time: Time::from_secs(secs), pose: &mut pose }.run();
    }
    let mut model_from_joint = vec![Affine3A::IDENTITY; skeleton.len()];
    LocalToModel { skeleton, pose: &pose, model_from_joint: &mut model_from_joint }.run();
    model_from_joint
}

fn rotation(m: &Affine3A) -> DQuat {
    let columns = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis].map(|c| Vec3::from(c).as_dvec3());
    DQuat::from_mat3(&DMat3::from_cols(columns[0], columns[1], columns[2])).normalize()
}

/// Largest angle, in radians, between how far a bone has turned from rest in one world and in the other, and largest distance
/// of the hips from where their height puts them.
fn errors(from: &Skeleton, to: &Skeleton, clip: &Clip, bound: &Clip) -> (f64, f64) {
    let (rest, rest2) = (posed(from, None, 0.0), posed(to, None, 0.0));
    let ratio = f64::from(rest2[1].translation.y) / f64::from(rest[1].translation.y);
    let (mut angle, mut place) = (0.0f64, 0.0f64);
    for step in 0..=20 {
        let secs = f64::from(step) / 20.0;
        let (now, now2) = (posed(from, Some(clip), secs), posed(to, Some(bound), secs));
        for joint in 1..5 {
            let turned = rotation(&now[joint]) * rotation(&rest[joint]).conjugate();
            let turned2 = rotation(&now2[joint]) * rotation(&rest2[joint]).conjugate();
            let between = turned.conjugate() * turned2;
            angle = angle.max(2.0 * between.xyz_length().atan2(between.w.abs()));
        }
        let at = |m: &Affine3A| Vec3::from(m.translation).as_dvec3();
        place = place.max((at(&now2[1]) - at(&now[1]) * ratio).length());
    }
    (angle, place)
}

trait XyzLength {
    fn xyz_length(&self) -> f64;
}
impl XyzLength for DQuat {
    fn xyz_length(&self) -> f64 {
        DVec3::new(self.x, self.y, self.z).length()
    }
}

#[test]
fn bind_clip_keeps_world_space_rotation_changes() {
    let names = ["hips", "spine", "chest", "head"];
    for seed in 0..8 {
        // Unknown names with declared bones, and names that identify the bones.
        for (given, from_declared) in [(["a", "b", "c", "d"], true), (names, false)] {
            let from = humanoid_skeleton(given, seed, 1.5, from_declared);
            let to = humanoid_skeleton(["p", "q", "r", "s"], seed + 100, 0.9, true);
            let clip = clip(&from, seed + 200);
            let (bound, unmatched) = bind_clip(&clip, &from, &to);
            assert!(unmatched.is_empty(), "{unmatched:?}");
            let (angle, place) = errors(&from, &to, &clip, &bound);
            assert!(angle < 2e-6 && place < 2e-6, "seed {seed}: {angle} rad, {place} m");
            // Bones keep their own lengths.
            assert!(bound.curves().iter().all(|c| c.path == Path::Rotation || c.joint == 1));
            // Negative control: without the T-poses, the same keys give other rotations.
            let raw: Vec<Curve> = clip.curves().to_vec();
            let raw = Clip::new("raw".into(), to.len(), raw).unwrap();
            let (angle, place) = errors(&from, &to, &clip, &raw);
            assert!(angle > 0.1 && place > 0.1, "seed {seed}: {angle} rad, {place} m");
        }
    }
}

#[test]
fn a_declared_t_pose_replaces_the_rest_pose() {
    let to = humanoid_skeleton(["p", "q", "r", "s"], 3, 1.0, true);
    let resting_in_t = humanoid_skeleton(["a", "b", "c", "d"], 4, 1.0, true);
    // The same skeleton at rest in another pose, with a declared T-pose.
    let mut rest = resting_in_t.rest().to_vec();
    let random = &mut Random(9);
    rest.iter_mut().for_each(|r| r.rotation = random_rotation(random));
    let (names, parents) = (resting_in_t.names().to_vec(), resting_in_t.parents().to_vec());
    let humanoid = resting_in_t.humanoid().unwrap().clone().with_t_pose(resting_in_t.rest().to_vec());
    let other = Skeleton::new(names, parents, rest).unwrap();
    let without = other.clone().with_humanoid(resting_in_t.humanoid().unwrap().clone()).unwrap();
    let other = other.with_humanoid(humanoid).unwrap();
    let clip = clip(&other, 5);
    let keys = |from: &Skeleton| bind_clip(&clip, from, &to).0.curves().to_vec();
    assert!(keys(&other) == keys(&resting_in_t));
    assert!(keys(&without) != keys(&resting_in_t));
    let short = resting_in_t.humanoid().unwrap().clone().with_t_pose(vec![Transform::IDENTITY]);
    let error = resting_in_t.clone().with_humanoid(short).unwrap_err().to_string();
    assert_eq!(
        error,
        "the number of transforms of the T-pose is 1, must be 5, one per joint of the skeleton"
    );
}

#[test]
fn equal_t_poses_share_the_keys_and_bones_are_found_by_any_name() {
    let from = humanoid_skeleton(["a", "b", "c", "d"], 1, 1.0, true);
    let to = humanoid_skeleton(["p", "q", "r", "s"], 1, 1.0, true);
    let clip = clip(&from, 2);
    let (bound, _) = bind_clip(&clip, &from, &to);
    let rotations = |c: &Clip| -> Vec<_> {
        c.curves().iter().filter(|c| c.path == Path::Rotation).map(|c| c.values.clone()).collect()
    };
    let (before, after) = (rotations(&clip), rotations(&bound));
    assert!(before.iter().zip(&after).all(|(a, b)| std::sync::Arc::ptr_eq(a, b)));
    assert_eq!(to.find("mixamorig:Hips"), Some(1));
    assert_eq!(to.find("upperChest"), None);
    assert_eq!((to.find("Head"), to.find("s")), (Some(4), Some(4)));
}

#[test]
fn bind_clip_keeps_expressions_and_their_duration() {
    let from = humanoid_skeleton(["a", "b", "c", "d"], 1, 1.0, true);
    let curve = |name: &str, secs: &[f64], values: &[f32]| ExpressionCurve {
        name: name.into(),
        interpolation: Interpolation::Linear,
        times: secs.iter().map(|s| Time::from_secs(*s)).collect(),
        values: values.into(),
    };
    let plain = clip(&from, 2);
    let curves = vec![curve("happy", &[0.0, 2.0], &[0.0, 1.0]), curve("aa", &[0.5], &[0.25])];
    let face = plain.clone().with_expressions(curves).unwrap();
    assert_eq!((plain.duration, face.duration), (Time::from_secs(1.0), Time::from_secs(2.0)));
    let (bound, _) = bind_clip(&face, &from, &humanoid_skeleton(["p", "q", "r", "s"], 7, 1.0, true));
    let at = |name: &str, secs: f64| bound.sample_expression(name, Time::from_secs(secs));
    assert_eq!((at("happy", 0.5), at("happy", 9.0), at("aa", 0.0)), (Some(0.25), Some(1.0), Some(0.25)));
    assert_eq!((at("sad", 0.5), bound.duration), (None, face.duration));
    let error = |curves| plain.clone().with_expressions(curves).unwrap_err().to_string();
    let twice = vec![curve("aa", &[0.0], &[0.0]), curve("aa", &[1.0], &[0.0])];
    assert_eq!(error(twice), "expression \"aa\": it has two curves, must have one");
    let nan = vec![curve("aa", &[0.0], &[f32::NAN])];
    assert_eq!(error(nan), "expression \"aa\": key 0 holds NaN, must be finite");
}

#[test]
fn a_short_joint_name_is_unique_and_finds_its_joint() {
    let names = ["mixamorig:Hips", "mixamorig:Head", "a:Tail", "b:Tail", "Tail2|Tip"].map(String::from);
    let skeleton = Skeleton::new(names.to_vec(), vec![None; 5], vec![Transform::IDENTITY; 5]).unwrap();
    let short: Vec<&str> = (0..5).map(|joint| skeleton.short_name(joint)).collect();
    assert_eq!(short, ["Hips", "Head", "a:Tail", "b:Tail", "Tip"]);
    assert!(short.iter().enumerate().all(|(joint, name)| skeleton.find(name) == Some(joint)));
    assert_eq!(skeleton.short_name(5), "");
}
