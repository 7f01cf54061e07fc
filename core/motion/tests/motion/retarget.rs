//! Clips on other characters: laws on skeletons of random proportions, names, rest poses and axes, with an f64 oracle of their own.

use crate::support::*;
use choreo_motion::retarget::{RetargetOptions, Translations, same_joints};
use choreo_motion::*;
use glam::{DAffine3, DQuat, DVec3, Vec3};
use proptest::prelude::*;
use std::collections::BTreeMap;

/// Names, proportions and rest pose of a generated character.
struct CharacterBuild {
    /// Names: 0 Mixamo, 1 KayKit, 2 Biped.
    family: usize,
    /// Joints between hips and arms.
    spine: usize,
    /// Metres.
    thigh: f64,
    shin: f64,
    arm: f64,
    /// Degrees below the horizontal that the arms hang at rest.
    arms_down: f64,
    /// Number of quarter turns about the vertical.
    quarters: f64,
    /// Origin at the hips rather than on the floor.
    from_hips: bool,
}

const DEFAULT_BUILD: CharacterBuild = CharacterBuild {
    family: 0,
    spine: 2,
    thigh: 0.45,
    shin: 0.45,
    arm: 0.3,
    arms_down: 0.0,
    quarters: 0.0,
    from_hips: false,
};

fn joint_name(family: usize, side: &str, part: &str) -> String {
    let biped = [
        ("hips", "Pelvis"),
        ("spine", "Spine"),
        ("spine1", "Spine1"),
        ("spine2", "Spine2"),
        ("neck", "Neck"),
        ("head", "Head"),
        ("arm", "UpperArm"),
        ("forearm", "Forearm"),
        ("hand", "Hand"),
        ("upleg", "Thigh"),
        ("leg", "Calf"),
        ("foot", "Foot"),
        ("toebase", "Toe0"),
    ];
    let kaykit = [
        ("spine1", "chest"),
        ("spine2", "upperchest"),
        ("arm", "upperarm"),
        ("forearm", "lowerarm"),
        ("upleg", "upperleg"),
        ("leg", "lowerleg"),
        ("toebase", "toes"),
    ];
    let of = |table: &[(&str, &str)]| {
        table.iter().find(|(p, _)| *p == part).map_or(part.to_string(), |(_, name)| name.to_string())
    };
    match (family, side) {
        (0, "") => format!("mixamorig:{}{}", part[..1].to_uppercase(), &part[1..]),
        (0, side) => format!("mixamorig:{side}{}{}", part[..1].to_uppercase(), &part[1..]),
        (1, "") => of(&kaykit),
        (1, side) => format!("{}.{}", of(&kaykit), side[..1].to_lowercase()),
        (_, "") => format!("Bip01 {}", of(&biped)),
        (_, side) => format!("Bip01 {} {}", &side[..1], of(&biped)),
    }
}

/// A skeleton of these proportions whose joints have random axes.
fn character_skeleton(random: &mut Random, build: &CharacterBuild) -> Skeleton {
    let mut rows: Vec<(String, Option<u32>, DVec3)> = Vec::new();
    let mut add = |side: &str, part: &str, parent: Option<u32>, at: DVec3| {
        rows.push((joint_name(build.family, side, part), parent, at));
        rows.len() as u32 - 1
    };
    let ankle = 0.1;
    let hips = DVec3::new(0.0, ankle + build.thigh + build.shin, 0.0);
    let h = add("", "hips", None, hips);
    let mut top = h;
    for i in 0..build.spine {
        let part = ["spine", "spine1", "spine2"][i];
        top = add("", part, Some(top), hips + DVec3::Y * (0.1 + 0.4 * (i + 1) as f64 / build.spine as f64));
    }
    let chest = hips + DVec3::Y * 0.5;
    let neck = add("", "neck", Some(top), chest + DVec3::Y * 0.15);
    add("", "head", Some(neck), chest + DVec3::Y * 0.25);
    let down = build.arms_down.to_radians();
    for (side, x) in [("Left", 1.0), ("Right", -1.0)] {
        let along = DVec3::new(x * down.cos(), -down.sin(), 0.0);
        let shoulder = chest + DVec3::new(0.2 * x, 0.1, 0.0);
        let arm = add(side, "arm", Some(top), shoulder);
        let forearm = add(side, "forearm", Some(arm), shoulder + along * build.arm);
        add(side, "hand", Some(forearm), shoulder + along * build.arm * 1.9);
        let hip = hips + DVec3::X * 0.1 * x;
        let upleg = add(side, "upleg", Some(h), hip);
        let leg = add(side, "leg", Some(upleg), hip - DVec3::Y * build.thigh);
        let foot = add(side, "foot", Some(leg), hip - DVec3::Y * (build.thigh + build.shin));
        add(side, "toebase", Some(foot), hip + DVec3::new(0.0, -build.thigh - build.shin - 0.07, 0.15));
    }
    let turn = DQuat::from_rotation_y(build.quarters * std::f64::consts::FRAC_PI_2);
    let down = if build.from_hips { hips } else { DVec3::ZERO };
    let mut model: Vec<(DVec3, DQuat)> = Vec::new();
    let mut rest = Vec::new();
    for (_, parent, at) in &rows {
        let at = turn * (*at - down);
        let own = DQuat::from_array(random.rotation().map(f64::from)).normalize();
        let (origin, base) = parent.map_or((DVec3::ZERO, DQuat::IDENTITY), |p| model[p as usize]);
        rest.push(Transform {
            translation: (base.conjugate() * (at - origin)).as_vec3(),
            rotation: (base.conjugate() * own).normalize().as_quat(),
            scale: Vec3::ONE,
        });
        model.push((at, own));
    }
    let (names, parents) = rows.into_iter().map(|r| (r.0, r.1)).unzip();
    Skeleton::new(names, parents, rest).unwrap()
}

fn random_build(random: &mut Random, family: usize) -> CharacterBuild {
    let mut between = |low: f64, high: f64| low + (high - low) * (f64::from(random.signed()) + 1.0) / 2.0;
    CharacterBuild {
        family,
        spine: 2,
        thigh: between(0.2, 0.6),
        shin: between(0.2, 0.6),
        arm: between(0.1, 0.5),
        arms_down: between(0.0, 70.0),
        quarters: between(0.0, 4.0).floor(),
        from_hips: between(0.0, 1.0) > 0.7,
    }
}

/// A clip of one second in which all joints rotate by up to about 60° from rest, and the hips move.
fn random_clip(random: &mut Random, skeleton: &Skeleton) -> Clip {
    random_clip_of_length(random, skeleton, 1.0)
}

/// Like [`random_clip`], over `length` seconds.
fn random_clip_of_length(random: &mut Random, skeleton: &Skeleton, length: f64) -> Clip {
    let secs = [0.0, 0.4, 0.7, 1.0].map(|share| share * length);
    let mut curves = Vec::new();
    for (joint, rest) in skeleton.rest().iter().enumerate() {
        let mut values = Vec::new();
        for _ in secs {
            let [x, y, z] = [0; 3].map(|_| 0.3 * random.signed());
            let turn = glam::Quat::from_xyzw(x, y, z, 1.0).normalize();
            values.extend((rest.rotation * turn).normalize().to_array());
        }
        curves.push(curve(joint as u32, Path::Rotation, Interpolation::Linear, &secs, &values));
    }
    let hips = skeleton.rest()[0].translation;
    let places =
        secs.iter().flat_map(|_| (hips + Vec3::from_array([0; 3].map(|_| 0.2 * random.signed()))).to_array());
    let places: Vec<f32> = places.collect();
    curves.push(curve(0, Path::Translation, Interpolation::Linear, &secs, &places));
    Clip::new("dance".into(), skeleton.len(), curves).unwrap()
}

fn model_at(skeleton: &Skeleton, clip: &Clip, at: f64) -> Vec<DAffine3> {
    let mut pose = Pose::rest(skeleton);
    Sample { clip, time: Time::from_secs(at), pose: &mut pose }.run();
    let local =
        |t: Transform| (t.translation.as_dvec3(), t.rotation.as_dquat().normalize(), t.scale.as_dvec3());
    model64(skeleton, &pose.iter().map(local).collect::<Vec<_>>())
}

/// Largest difference of any number of two poses' matrices.
fn difference(a: &[DAffine3], b: &[DAffine3]) -> f64 {
    let pairs = a.iter().zip(b).flat_map(|(a, b)| a.to_cols_array().into_iter().zip(b.to_cols_array()));
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

const LIMBS: [(&str, &str); 4] = [("upleg", "leg"), ("leg", "foot"), ("arm", "forearm"), ("forearm", "hand")];

/// Largest angle, degrees, between the directions of the same limbs, the source turned by the yaw.
fn largest_limb_angle([a, b]: [(&Skeleton, &[DAffine3]); 2], yaw_degrees: f64) -> f64 {
    let humans = [HumanoidJoints::of(a.0), HumanoidJoints::of(b.0)];
    let turn = DQuat::from_rotation_y(yaw_degrees.to_radians());
    let mut worst: f64 = 0.0;
    for side in ["left", "right"] {
        for (from, to) in LIMBS {
            let along = |human: &HumanoidJoints, model: &[DAffine3]| {
                let place =
                    |n: &str| model[human.joint(&format!("{side} {n}")).unwrap() as usize].translation;
                (place(to) - place(from)).normalize()
            };
            let (s, t) = (turn * along(&humans[0], a.1), along(&humans[1], b.1));
            worst = worst.max(s.angle_between(t).to_degrees());
        }
    }
    worst
}

/// Height of the lowest foot or toe over its height at rest.
fn clearance(skeleton: &Skeleton, model: &[DAffine3]) -> f64 {
    let human = HumanoidJoints::of(skeleton);
    let rest = model_at(skeleton, &Clip::new("rest".into(), skeleton.len(), Vec::new()).unwrap(), 0.0);
    let floor = rest.iter().map(|m| m.translation.y).fold(f64::MAX, f64::min);
    let floor = if floor < -0.15 { floor } else { 0.0 };
    let feet = ["left foot", "right foot", "left toebase", "right toebase"]
        .map(|n| human.joint(n).unwrap() as usize);
    feet.iter().map(|j| model[*j].translation.y - (rest[*j].translation.y - floor)).fold(f64::MAX, f64::min)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn retargeting_to_the_same_skeleton_keeps_the_clip(seed: u64, at in 0.0..1.0f64) {
        let random = &mut Random(seed);
        let build = random_build(random, random.0 as usize % 3);
        let skeleton = character_skeleton(random, &build);
        let clip = random_clip(random, &skeleton);
        prop_assert!(same_joints(&clip, &skeleton, &skeleton));
        // The function that scripts use copies the curves bit for bit.
        let (bound, coverage, report) = bind_or_retarget(&clip, &skeleton, &skeleton);
        prop_assert!(bound.curves() == clip.curves() && coverage.left_out.is_empty() && report.is_none());
        // The retargeting formulas give the same poses up to rounding.
        let (other, report) = Retarget::new(&skeleton, &skeleton, RetargetOptions::default()).clip(&clip);
        let apart = difference(&model_at(&skeleton, &clip, at), &model_at(&skeleton, &other, at));
        prop_assert!(apart < 1e-5, "{apart} {report:?}");
    }

    #[test]
    fn retargeted_limbs_point_in_the_directions_of_the_source(seed: u64, at in 0.0..1.0f64) {
        let random = &mut Random(seed);
        let (a, b) = (random_build(random, random.0 as usize % 3), random_build(random, random.0 as usize / 3 % 3));
        let (from, to) = (character_skeleton(random, &a), character_skeleton(random, &b));
        let clip = random_clip(random, &from);
        let retarget = Retarget::new(&from, &to, RetargetOptions::default());
        prop_assert_eq!(retarget.map().pairs().count(), from.len());
        let (other, report) = retarget.clip(&clip);
        prop_assert!(retarget.coverage(&clip).left_out.is_empty() && report.held.is_empty() && !report.coarse);
        let (s, t) = (model_at(&from, &clip, at), model_at(&to, &other, at));
        let apart = largest_limb_angle([(&from, &s), (&to, &t)], retarget.yaw_degrees());
        prop_assert!(apart < 0.01, "{apart}° {report:?}");
        // The key times are unchanged, except those of the hips.
        for curve in other.curves().iter().filter(|c| c.path == Path::Rotation) {
            prop_assert_eq!(curve.times.len(), 4);
        }
        // Negative control: without alignment, arms keep the difference of the rest poses.
        if (a.arms_down - b.arms_down).abs() > 5.0 {
            let off = RetargetOptions { align: false, ..RetargetOptions::default() };
            let (other, _) = Retarget::new(&from, &to, off).clip(&clip);
            prop_assert!(largest_limb_angle([(&from, &s), (&to, &model_at(&to, &other, at))], retarget.yaw_degrees()) > 2.0);
        }
    }

    #[test]
    fn retargeting_there_and_back_restores_the_clip(seed: u64, at in 0.0..1.0f64) {
        let random = &mut Random(seed);
        let (a, b) = (random_build(random, 0), random_build(random, 1 + random.0 as usize % 2));
        let (from, to) = (character_skeleton(random, &a), character_skeleton(random, &b));
        let clip = random_clip(random, &from);
        let there = Retarget::new(&from, &to, RetargetOptions::default()).clip(&clip).0;
        let back = Retarget::new(&to, &from, RetargetOptions::default()).clip(&there).0;
        // The height of the hips is left out; the next test compares it.
        let [mut a, mut b] = [model_at(&from, &clip, at), model_at(&from, &back, at)];
        for model in [&mut a, &mut b] {
            let up = model[0].translation.y;
            model.iter_mut().for_each(|joint| joint.translation.y -= up);
        }
        let apart = difference(&a, &b);
        prop_assert!(apart < 1e-4, "{apart}");
    }
}

/// In slow motion the feet stand, and the lowest one is as high as the source's, times the scale. In fast motion the hips move
/// smoothly instead.
#[test]
fn the_lowest_foot_keeps_its_scaled_height_in_slow_motion() {
    const LENGTH: f64 = 100.0;
    let mut fastest: f64 = 0.0;
    for seed in 1..9 {
        let random = &mut Random(seed);
        let (a, b) = (random_build(random, 0), random_build(random, 1));
        let (from, to) = (character_skeleton(random, &a), character_skeleton(random, &b));
        let off = |clip: &Clip, at: f64| {
            let retarget = Retarget::new(&from, &to, RetargetOptions::default());
            let other = retarget.clip(clip).0;
            let worst = (1..40).map(|i| {
                let at = at * f64::from(i) / 40.0;
                let wanted = clearance(&from, &model_at(&from, clip, at)) * retarget.scale();
                (clearance(&to, &model_at(&to, &other, at)) - wanted).abs()
            });
            worst.fold(0.0, f64::max)
        };
        let slow = random_clip_of_length(random, &from, LENGTH);
        // Sampling smooths the kink where one foot takes over from the other: by 2.3 mm in the worst of these.
        assert!(off(&slow, LENGTH) < 3e-3, "{seed}: {}", off(&slow, LENGTH));
        fastest = fastest.max(off(&random_clip_of_length(random, &from, 1.0), 1.0));
    }
    // The comparison can fail.
    assert!(fastest > 0.03, "{fastest}");
}

/// Spines of three joints to spines of one, and the reverse: joints below the spine rotate as in the source.
#[test]
fn retargeting_maps_spines_with_different_joint_counts() {
    let random = &mut Random(7);
    for (ours, theirs) in [(3, 1), (1, 3), (3, 2), (2, 3)] {
        let from = character_skeleton(random, &CharacterBuild { spine: ours, ..DEFAULT_BUILD });
        let to = character_skeleton(random, &CharacterBuild { spine: theirs, family: 1, ..DEFAULT_BUILD });
        let clip = random_clip(random, &from);
        let retarget = Retarget::new(&from, &to, RetargetOptions::default());
        let (other, report) = retarget.clip(&clip);
        let mut worst: f64 = 0.0;
        for at in 0..20 {
            let at = f64::from(at) * 0.05;
            let (s, t) = (model_at(&from, &clip, at), model_at(&to, &other, at));
            worst = worst.max(largest_limb_angle([(&from, &s), (&to, &t)], 0.0));
        }
        // Rotations of several joints in one are sampled: 1e-3 rad is 0.06°.
        assert!(worst < 0.13, "{ours} on {theirs}: {worst}°");
        assert_eq!(report.sampled.iter().any(|n| n != "hips"), ours > theirs, "{report:?}");
    }
}

/// Joint names that no family uses: structure, sides and heights identify the joints.
#[test]
fn humanoid_joints_are_found_by_structure_sides_and_heights() {
    let rows: [(&str, Option<u32>, [f32; 3]); 17] = [
        ("scene", None, [0.0, 0.0, 0.0]),
        ("torso_joint_1", Some(0), [0.0, 0.7, 0.0]),
        ("torso_joint_2", Some(1), [0.0, 0.15, 0.0]),
        ("torso_joint_3", Some(2), [0.0, 0.25, 0.0]),
        ("neck_joint_1", Some(3), [0.0, 0.1, 0.0]),
        ("neck_joint_2", Some(4), [0.0, 0.1, 0.0]),
        ("arm_joint_L__4_", Some(3), [0.1, 0.0, 0.0]),
        ("arm_joint_L__3_", Some(6), [0.2, -0.1, 0.0]),
        ("arm_joint_L__2_", Some(7), [0.1, -0.1, 0.0]),
        ("arm_joint_R", Some(3), [-0.1, 0.0, 0.0]),
        ("arm_joint_R__2_", Some(9), [-0.2, -0.1, 0.0]),
        ("arm_joint_R__3_", Some(10), [-0.1, -0.1, 0.0]),
        ("leg_joint_L_1", Some(1), [0.07, -0.05, 0.0]),
        ("leg_joint_L_2", Some(12), [0.0, -0.3, 0.0]),
        ("leg_joint_L_3", Some(13), [0.0, -0.3, 0.0]),
        ("leg_joint_R_1", Some(1), [-0.07, -0.05, 0.0]),
        ("leg_joint_R_2", Some(15), [0.0, -0.3, 0.0]),
    ];
    let mut rows = rows.to_vec();
    rows.push(("leg_joint_R_3", Some(16), [0.0, -0.3, 0.0]));
    let names = rows.iter().map(|r| r.0.to_string()).collect();
    let at = |r: &(&str, Option<u32>, [f32; 3])| Transform { translation: r.2.into(), ..Transform::IDENTITY };
    let skeleton =
        Skeleton::new(names, rows.iter().map(|r| r.1).collect(), rows.iter().map(at).collect()).unwrap();
    let human = HumanoidJoints::of(&skeleton);
    let is = |name: &str| human.joint(name).map(|j| rows[j as usize].0);
    assert_eq!(is("hips"), Some("torso_joint_1"));
    assert_eq!(
        [is("left arm"), is("left forearm"), is("right hand")],
        [Some("arm_joint_L__4_"), Some("arm_joint_L__3_"), Some("arm_joint_R__3_")]
    );
    assert_eq!(
        [is("left upleg"), is("right leg"), is("left foot")],
        [Some("leg_joint_L_1"), Some("leg_joint_R_2"), Some("leg_joint_L_3")]
    );
    assert_eq!((is("head"), human.spine(), human.neck()), (Some("neck_joint_2"), &[2, 3][..], &[4][..]));
    assert!(human.is_humanoid());
    assert!(!HumanoidJoints::of(&Skeleton::default()).is_humanoid());
}

#[test]
fn given_joint_pairs_and_excluded_joints_take_precedence() {
    let random = &mut Random(3);
    let (from, to) = (
        character_skeleton(random, &DEFAULT_BUILD),
        character_skeleton(random, &CharacterBuild { family: 2, ..DEFAULT_BUILD }),
    );
    let [a, b] = [&from, &to].map(HumanoidJoints::of);
    let (arm, head) = (b.joint("left arm").unwrap(), b.joint("head").unwrap());
    let other = a.joint("right arm").unwrap();
    let joints = BTreeMap::from([(arm, Some(other)), (head, None), (9999, Some(0)), (0, Some(9999))]);
    let retarget = Retarget::new(&from, &to, RetargetOptions { joints, ..RetargetOptions::default() });
    assert_eq!((retarget.map().source(arm), retarget.map().source(head)), (Some(other), None));
    let dance = random_clip(random, &from);
    let (clip, _) = retarget.clip(&dance);
    let coverage = retarget.coverage(&dance);
    assert!(!clip.animates(head) && coverage.left_out.contains(&"mixamorig:Head".to_string()));
}

#[test]
fn retargeting_reports_translations_that_it_leaves_out() {
    let random = &mut Random(5);
    let (from, to) = (
        character_skeleton(random, &DEFAULT_BUILD),
        character_skeleton(random, &CharacterBuild { family: 1, thigh: 0.9, shin: 0.9, ..DEFAULT_BUILD }),
    );
    let hand = HumanoidJoints::of(&from).joint("left hand").unwrap();
    let rest = from.rest()[hand as usize].translation;
    let keys: Vec<f32> = [rest, rest + Vec3::X * 0.2].iter().flat_map(|v| v.to_array()).collect();
    let stretch = curve(hand, Path::Translation, Interpolation::Linear, &[0.0, 1.0], &keys);
    let clip = Clip::new("stretch".into(), from.len(), vec![stretch]).unwrap();
    let (still, report) = Retarget::new(&from, &to, RetargetOptions::default()).clip(&clip);
    assert!(still.curves().iter().all(|c| c.path != Path::Translation));
    assert_eq!((report.held.len(), report.held[0].0.as_str()), (1, "mixamorig:LeftHand"));
    let all = RetargetOptions { translations: Translations::All, ..RetargetOptions::default() };
    let (moved, report) = Retarget::new(&from, &to, all).clip(&clip);
    assert!(report.held.is_empty());
    let (a, b) = (model_at(&to, &moved, 0.0), model_at(&to, &moved, 1.0));
    let joint = HumanoidJoints::of(&to).joint("left hand").unwrap() as usize;
    // Legs twice as long, so the hand goes twice as far.
    assert!(((b[joint].translation - a[joint].translation).length() - 0.4).abs() < 1e-5);
}

fn with_renamed_joints(skeleton: &Skeleton, name: impl Fn(&str) -> String) -> Skeleton {
    let names = skeleton.names().iter().map(|n| name(n)).collect();
    Skeleton::new(names, skeleton.parents().to_vec(), skeleton.rest().to_vec()).unwrap()
}

/// Three joints below each hand, by the name that `finger` makes of the side and the number.
fn with_fingers(skeleton: &Skeleton, finger: impl Fn(&str, usize) -> String) -> Skeleton {
    let (mut names, mut parents) = (skeleton.names().to_vec(), skeleton.parents().to_vec());
    let mut rest = skeleton.rest().to_vec();
    for side in ["Left", "Right"] {
        let mut parent =
            HumanoidJoints::of(skeleton).joint(&format!("{} hand", side.to_lowercase())).unwrap();
        for number in 1..=3 {
            names.push(finger(side, number));
            parents.push(Some(parent));
            rest.push(Transform { translation: Vec3::X * 0.03, ..Transform::IDENTITY });
            parent = names.len() as u32 - 1;
        }
    }
    Skeleton::new(names, parents, rest).unwrap()
}

/// Joints that no joint follows are reported by body part, whether the clip is copied or retargeted.
#[test]
fn body_parts_that_stay_at_rest_are_reported() {
    let random = &mut Random(17);
    let from = character_skeleton(random, &DEFAULT_BUILD);
    let clip = random_clip(random, &from);
    let named = |to: &Skeleton| {
        let (bound, coverage, report) = bind_or_retarget(&clip, &from, to);
        (coverage.followed(), coverage.parts, bound.curves().is_empty(), report.is_some())
    };
    assert_eq!(
        named(&character_skeleton(random, &CharacterBuild { family: 2, ..DEFAULT_BUILD })),
        (19, vec![], false, true)
    );
    // The same skeleton, with unknown names for a few joints.
    let renamed_joints =
        ["Head", "Neck", "LeftArm", "LeftForearm", "LeftHand", "RightUpleg", "RightLeg", "RightFoot"];
    let hidden = with_renamed_joints(&from, |n| {
        match renamed_joints.iter().position(|l| n == format!("mixamorig:{l}")) {
            Some(i) => format!("bit {i}"),
            None => n.to_string(),
        }
    });
    assert_eq!(named(&hidden), (11, vec!["head", "left arm", "right leg"], false, false));
    // No name is known; structure identifies hips and legs.
    let legs = with_renamed_joints(&from, |n| {
        let plain = n.trim_start_matches("mixamorig:").to_lowercase();
        let is_leg = ["leg", "foot", "toe"].iter().any(|part| plain.contains(part));
        match (plain.strip_prefix("left"), plain.strip_prefix("right")) {
            (Some(part), _) if is_leg => format!("limb{}.L", part.len()),
            (_, Some(part)) if is_leg => format!("limb{}.R", part.len()),
            _ => format!("bit {}", plain.len()),
        }
    });
    assert_eq!(named(&legs), (9, vec!["spine", "head", "left arm", "right arm"], false, true));
    let nothing = with_renamed_joints(&from, |n| format!("bit {}", n.len()));
    let (count, parts, empty, _) = named(&nothing);
    assert_eq!((count, empty), (0, true), "{parts:?}");
    // Joints that the caller excludes do not count as lost.
    let arm = HumanoidJoints::of(&from).joint("left arm").unwrap();
    let below = [arm, arm + 1, arm + 2].map(|j| (j, None));
    let options = RetargetOptions { joints: BTreeMap::from(below), ..RetargetOptions::default() };
    let coverage = Retarget::new(&from, &from, options).coverage(&clip);
    assert_eq!((coverage.followed(), coverage.parts), (16, vec![]));
}

/// Fingers are reported if the other character has fingers of unknown names, and not if its hands have none.
#[test]
fn unmatched_fingers_are_reported_only_for_hands_with_fingers() {
    let random = &mut Random(19);
    let mitten = character_skeleton(random, &DEFAULT_BUILD);
    let from = with_fingers(&mitten, |side, number| format!("mixamorig:{side}HandIndex{number}"));
    let clip = random_clip(random, &from);
    let parts = |to: &Skeleton| bind_or_retarget(&clip, &from, to).1.parts;
    let other = with_fingers(&mitten, |side, number| format!("{side} digit {number}"));
    assert_eq!(parts(&other), ["left fingers", "right fingers"]);
    assert!(parts(&mitten).is_empty());
    let unreal =
        with_fingers(&mitten, |side, number| format!("index_0{number}_{}", side[..1].to_lowercase()));
    assert!(parts(&unreal).is_empty());
}

/// Hips with an unknown name are found as the joint that carries both thighs.
#[test]
fn the_joint_that_carries_both_thighs_is_the_hips() {
    let random = &mut Random(23);
    let from = character_skeleton(random, &DEFAULT_BUILD);
    let families: [&[(&str, &str)]; 3] = [
        &[
            ("Hips", "DEF-spine"),
            ("Spine", "DEF-spine.001"),
            ("Spine1", "DEF-spine.002"),
            ("Neck", "DEF-spine.004"),
            ("Head", "DEF-spine.006"),
            ("Arm", "DEF-upper_arm.*"),
            ("Forearm", "DEF-forearm.*"),
            ("Hand", "DEF-hand.*"),
            ("Upleg", "DEF-thigh.*"),
            ("Leg", "DEF-shin.*"),
            ("Foot", "DEF-foot.*"),
            ("Toebase", "DEF-toe.*"),
        ],
        &[
            ("Hips", "root"),
            ("Spine", "lowerback"),
            ("Spine1", "upperback"),
            ("Neck", "lowerneck"),
            ("Head", "head"),
            ("Arm", "*humerus"),
            ("Forearm", "*radius"),
            ("Hand", "*hand"),
            ("Upleg", "*femur"),
            ("Leg", "*tibia"),
            ("Foot", "*foot"),
            ("Toebase", "*toes"),
        ],
        &[
            ("Arm", "armUpper*"),
            ("Forearm", "armLower*"),
            ("Hand", "hand*"),
            ("Upleg", "legUpper*"),
            ("Leg", "legLower*"),
            ("Foot", "foot*"),
            ("Toebase", "toes*"),
        ],
    ];
    for family in families {
        let to = with_renamed_joints(&from, |name| {
            let plain = name.strip_prefix("mixamorig:").unwrap_or(name);
            let (side, part) = match (plain.strip_prefix("Left"), plain.strip_prefix("Right")) {
                (Some(part), _) => ("l", part),
                (_, Some(part)) => ("r", part),
                _ => ("", plain),
            };
            let capital = part[..1].to_uppercase() + &part[1..];
            let theirs = family.iter().find(|(ours, _)| *ours == capital);
            let upper = if family[0].1 == "root" { side.to_string() } else { side.to_uppercase() };
            theirs.map_or(part.to_string(), |(_, theirs)| theirs.replace('*', &upper))
        });
        let (human, own) = (HumanoidJoints::of(&to), HumanoidJoints::of(&from));
        assert!(human.is_humanoid(), "{:?}: {human:?}", to.names());
        for part in ["hips", "head", "left arm", "right forearm", "left upleg", "right leg", "left foot"] {
            assert_eq!(human.joint(part), own.joint(part), "{part}: {:?}", to.names());
        }
        let (_, coverage, _) = bind_or_retarget(&random_clip(random, &from), &from, &to);
        assert!(coverage.left_out.is_empty(), "{coverage:?}");
    }
}

/// Clips are not copied if no names match; they are copied if the same joints rest in another pose.
#[test]
fn clips_are_copied_only_between_skeletons_with_equal_joint_positions() {
    let random = &mut Random(11);
    let from = character_skeleton(random, &DEFAULT_BUILD);
    let clip = random_clip(random, &from);
    let other = character_skeleton(random, &CharacterBuild { family: 1, ..DEFAULT_BUILD });
    assert!(!same_joints(&clip, &from, &other));
    assert!(bind_or_retarget(&clip, &from, &other).2.is_some());
    // The same skeleton in another rest pose: rotations differ, positions in the parents' spaces do not.
    let turn = glam::Quat::from_rotation_x(0.5);
    let rest =
        from.rest().iter().map(|t| Transform { rotation: (t.rotation * turn).normalize(), ..*t }).collect();
    let posed = Skeleton::new(from.names().to_vec(), from.parents().to_vec(), rest).unwrap();
    let (bound, _, report) = bind_or_retarget(&clip, &posed, &from);
    assert!(report.is_none() && bound.curves() == clip.curves());
    // Skeletons that are no humanoids are matched by names.
    let box_of = |names: [&str; 2]| {
        Skeleton::new(names.map(String::from).to_vec(), vec![None, Some(0)], vec![Transform::IDENTITY; 2])
            .unwrap()
    };
    let (a, b) = (box_of(["box", "lid"]), box_of(["crate", "lid"]));
    let open = curve(1, Path::Scale, Interpolation::Linear, &[0.0], &[2.0; 3]);
    let (bound, _, report) = bind_or_retarget(&Clip::new("open".into(), 2, vec![open]).unwrap(), &a, &b);
    assert!(report.is_none() && bound.curves().len() == 1);
}
