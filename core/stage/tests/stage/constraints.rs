//! Constraints: reach, aim, look-at, joint limits and foot lock.

use crate::support::random::Random;
use crate::support::*;
use choreo_asset::*;
use choreo_motion::{Path, Time};
use choreo_stage::*;
use glam::{DVec3, Quat, Vec3};
use std::sync::Arc;

const SPINE: u32 = 1;
const NECK: u32 = 2;
const FACE: u32 = 3;
const UPPER: u32 = 4;
const LOWER: u32 = 5;
const PALM: u32 = 6;
const THIGH: u32 = 7;
const SHIN: u32 = 8;
const FOOT: u32 = 9;

/// A character with a spine, a head, one arm of two bones and one leg; hips at 0.9 m.
fn character() -> Arc<Asset> {
    let skeleton = skeleton(&[
        ("Hips", None, at(0.0, 0.9, 0.0)),
        ("Spine", Some(0), at(0.0, 0.2, 0.0)),
        ("Neck", Some(SPINE), at(0.0, 0.35, 0.0)),
        ("Head", Some(NECK), at(0.0, 0.1, 0.0)),
        ("Arm", Some(SPINE), at(0.2, 0.3, 0.0)),
        ("ForeArm", Some(UPPER), at(0.3, 0.0, -0.02)),
        ("Hand", Some(LOWER), at(0.28, 0.0, 0.02)),
        ("UpLeg", Some(0), at(0.1, -0.05, 0.0)),
        ("Leg", Some(THIGH), at(0.0, -0.4, 0.03)),
        ("Foot", Some(SHIN), at(0.0, -0.4, -0.03)),
    ]);
    Arc::new(Asset { name: "body".into(), skeleton, ..Asset::default() })
}

fn reach_constraint(target: Target) -> ReachConstraint {
    ReachConstraint {
        joints: vec![UPPER, LOWER, PALM],
        target,
        offset: None,
        pole: None,
        hint: DVec3::NEG_Z,
        soft: 0.0,
        keep_rotation: false,
    }
}

fn stage_with(constraints: Vec<Constraint>) -> Stage {
    let mut stage = Stage::default();
    let anna = stage.cast("anna", character());
    stage.actors[anna].transform = Placement::at(3.0, 0.5, -2.0).turned(0.7);
    stage.actors[anna].constraints = constraints;
    stage
}

#[test]
fn two_bone_reach_puts_the_hand_on_its_target() {
    let mut n = Random(4);
    for _ in 0..100 {
        let shoulder = joint_world(&stage_with(vec![]).at(Time::ZERO).unwrap(), 0, UPPER);
        let target = shoulder + n.vec3().normalize() * (0.1 + 0.4 * n.signed64().abs());
        let stage =
            stage_with(vec![Constraint::new(ConstraintKind::Reach(reach_constraint(Target::Point(target))))]);
        assert!(stage.check().is_empty());
        let snapshot = stage.at(secs(1.0)).unwrap();
        assert_close(joint_world(&snapshot, 0, PALM), target, 1e-6);
        assert_close(joint_world(&snapshot, 0, UPPER), shoulder, 1e-9);
        let bone = |a: u32, b: u32| (joint_world(&snapshot, 0, a) - joint_world(&snapshot, 0, b)).length();
        assert!((bone(UPPER, LOWER) - 0.300666).abs() < 1e-5 && (bone(LOWER, PALM) - 0.280713).abs() < 1e-5);
    }
}

#[test]
fn constraint_weight_fades_in_and_out_and_scales_the_reach() {
    let target = v(3.3, 1.9, -1.8);
    let constraint = Constraint {
        start: secs(1.0),
        end: Some(secs(3.0)),
        fade: secs(0.5),
        ..Constraint::new(ConstraintKind::Reach(reach_constraint(Target::Point(target))))
    };
    let stage = stage_with(vec![constraint.clone()]);
    let hand = |t: f64| joint_world(&stage.at(secs(t)).unwrap(), 0, PALM);
    let rest = hand(0.0);
    assert_eq!((hand(1.0), hand(3.0), hand(9.0)), (rest, rest, rest));
    assert_close(hand(1.25), rest.lerp(target, 0.5), 1e-6);
    assert_close(hand(2.0), target, 1e-6);
    assert_close(hand(2.75), rest.lerp(target, 0.5), 1e-6);
    let half = stage_with(vec![Constraint { weight: 0.5, ..constraint }]);
    assert_close(joint_world(&half.at(secs(2.0)).unwrap(), 0, PALM), rest.lerp(target, 0.5), 1e-6);
}

/// Degrees between where the face points and an actor's center.
fn off_target(snapshot: &Snapshot, prop: usize, center: DVec3) -> f64 {
    let at = joint_world(snapshot, 0, FACE);
    let forward = snapshot.actors[0].world_from_model.matrix3
        * joint_axes(&snapshot.actors[0].model_from_joint[FACE as usize])
        * DVec3::Z;
    let way = snapshot.actors[prop].world_from_model.transform_point3(center) - at;
    forward.angle_between(way).to_degrees()
}

/// Anna reaches for a point in front of her with a stick in her hand, and looks at the stick.
#[test]
fn look_at_of_a_prop_in_the_own_hand_follows_the_reach_constraint() {
    let center = stick().rest_bounds().center().as_dvec3();
    let target = v(3.35, 1.75, -1.75);
    for (late, name) in [(false, "look"), (true, "aim of the spine, which carries the arm")] {
        let mut stage = stage_with(vec![Constraint {
            start: secs(1.0),
            fade: secs(0.4),
            ..Constraint::new(ConstraintKind::Reach(reach_constraint(Target::Point(target))))
        }]);
        let prop = stage.cast("stick", stick());
        stage.actors[prop].parents = vec![Parenting::always(Attachment { actor: 0, joint: Some(PALM) })];
        stage.actors[prop].transform.scale = DVec3::splat(0.1);
        let limit = 80f64.to_radians();
        let look = match late {
            false => LookAt { fade: Time::ZERO, ..LookAt::new(FACE, Target::Actor(prop)) },
            true => {
                let aim = AimConstraint {
                    joints: vec![SPINE, FACE],
                    shares: vec![0.25, 0.75],
                    target: Target::Actor(prop),
                    limit,
                };
                stage.actors[0].constraints.insert(0, Constraint::new(ConstraintKind::Aim(aim)));
                LookAt { weight: 0.0, ..LookAt::new(FACE, Target::Actor(prop)) }
            }
        };
        stage.actors[0].look_at.push(look);
        assert!(stage.check().is_empty(), "{:?}", stage.check());
        for t in [1.2, 1.25, 1.3, 1.5, 2.0] {
            let snapshot = stage.at(secs(t)).unwrap();
            // The stick turns a little with the forearm of a spine that has turned.
            let most = if late { 0.5 } else { 0.001 };
            let off = off_target(&snapshot, prop, center);
            assert!(off < most, "{name}: {off}° off at {t} s");
            if t >= 1.4 {
                assert_close(joint_world(&snapshot, 0, PALM), target, 1e-6);
            }
        }
    }
}

/// A stick blends from Anna's reaching hand to Boris's. Both look at it all the time.
#[test]
fn look_at_stays_continuous_while_its_prop_changes_parents() {
    let center = stick().rest_bounds().center().as_dvec3();
    let mut stage = stage_with(vec![]);
    stage.actors[0].transform = Placement::at(0.0, 0.0, 0.0);
    let boris = stage.cast("boris", character());
    stage.actors[boris].transform = Placement::at(0.6, 0.0, 0.9).turned(std::f64::consts::PI);
    let prop = stage.cast("stick", stick());
    stage.actors[prop].transform.scale = DVec3::splat(0.1);
    for (actor, at) in [(0, v(0.32, 1.3, 0.4)), (boris, v(0.28, 1.3, 0.5))] {
        stage.actors[actor]
            .constraints
            .push(Constraint::new(ConstraintKind::Reach(reach_constraint(Target::Point(at)))));
        let look = LookAt { fade: Time::ZERO, ..LookAt::new(FACE, Target::Actor(prop)) };
        stage.actors[actor].look_at.push(look);
    }
    let hand = |actor| Some(Attachment { actor, joint: Some(PALM) });
    stage.actors[prop].parents = vec![
        Parenting::always(hand(0).unwrap()),
        Parenting { blend: secs(0.5), keep: false, ..Parenting::from(hand(boris), secs(1.0)) },
    ];
    assert!(stage.check().is_empty(), "{:?}", stage.check());
    let face = |snapshot: &Snapshot, actor: usize| {
        let axes = joint_axes(&snapshot.actors[actor].model_from_joint[FACE as usize]);
        snapshot.actors[actor].world_from_model.matrix3 * axes * DVec3::Z
    };
    let mut before: Option<[DVec3; 2]> = None;
    for i in 0..=90 {
        let snapshot = stage.at(secs(0.7 + f64::from(i) / 100.0)).unwrap();
        assert!(off_target(&snapshot, prop, center) < 0.05, "{i}: {}", off_target(&snapshot, prop, center));
        let now = [face(&snapshot, 0), face(&snapshot, boris)];
        if let Some(before) = before {
            let turned = [0, 1].map(|a| now[a].angle_between(before[a]).to_degrees());
            assert!(turned[0] < 2.5 && turned[1] < 2.5, "{i}: {turned:?}");
        }
        before = Some(now);
    }
}

/// Boris reaches for a point and holds a stick; Anna reaches for the other end of the stick; a lamp is attached to her hand.
#[test]
fn reach_for_a_prop_uses_the_solved_hand_that_holds_it() {
    let mut stage = stage_with(vec![]);
    let boris = stage.cast("boris", character());
    let prop = stage.cast("stick", stick());
    let lamp = stage.cast("lamp", stick());
    stage.actors[boris].transform = Placement::at(3.2, 0.5, -1.4);
    stage.actors[boris]
        .constraints
        .push(Constraint::new(ConstraintKind::Reach(reach_constraint(Target::Point(v(3.3, 1.8, -1.7))))));
    stage.actors[prop].parents = vec![Parenting::always(Attachment { actor: boris, joint: Some(PALM) })];
    stage.actors[prop].transform.scale = DVec3::splat(0.1);
    stage.actors[lamp].parents = vec![Parenting::always(Attachment { actor: 0, joint: Some(PALM) })];
    let offset = Some(v(0.0, 1.0, 0.0));
    stage.actors[0].constraints.push(Constraint::new(ConstraintKind::Reach(ReachConstraint {
        offset,
        ..reach_constraint(Target::Actor(prop))
    })));
    assert!(stage.check().is_empty(), "{:?}", stage.check());
    let snapshot = stage.at(Time::ZERO).unwrap();
    let end = snapshot.actors[prop].world_from_model.transform_point3(v(0.0, 1.0, 0.0));
    assert_close(joint_world(&snapshot, boris, PALM), v(3.3, 1.8, -1.7), 1e-6);
    assert_close(joint_world(&snapshot, 0, PALM), end, 1e-6);
    assert_close(snapshot.actors[lamp].world_from_model.translation, end, 1e-6);
}

#[test]
fn mutual_reach_targets_are_solved_from_the_unconstrained_poses() {
    let mut stage = stage_with(vec![]);
    let boris = stage.cast("boris", character());
    stage.actors[boris].transform = Placement::at(3.4, 0.5, -1.6).turned(3.0);
    for (who, whom) in [(0, boris), (boris, 0)] {
        let target = Target::Joint { actor: whom, joint: PALM };
        stage.actors[who].constraints.push(Constraint::new(ConstraintKind::Reach(reach_constraint(target))));
    }
    let both = stage.at(Time::ZERO).unwrap();
    let alone = |who: usize| {
        let mut stage = stage.clone();
        stage.actors[1 - who].constraints.clear();
        stage.at(Time::ZERO).unwrap()
    };
    // Each reaches for where the other's hand was before.
    for who in [0, boris] {
        assert_close(joint_world(&both, who, PALM), joint_world(&alone(who), who, PALM), 1e-9);
    }
    // A target on a joint of the same actor is where the earlier constraints have moved it.
    let target = Target::Joint { actor: 0, joint: FACE };
    let mut own = stage_with(vec![Constraint::new(ConstraintKind::Reach(reach_constraint(target)))]);
    let aim = AimConstraint {
        joints: vec![SPINE, NECK],
        shares: vec![1.0, 1.0],
        target: Target::Point(v(9.0, 1.0, 0.0)),
        limit: 1.5,
    };
    own.actors[0].constraints.insert(0, Constraint::new(ConstraintKind::Aim(aim)));
    let snapshot = own.at(Time::ZERO).unwrap();
    assert_close(joint_world(&snapshot, 0, PALM), joint_world(&snapshot, 0, FACE), 1e-6);
}

#[test]
fn aim_distributes_the_rotation_over_spine_neck_and_head() {
    let aim = |joints: Vec<u32>| AimConstraint {
        shares: vec![1.0; joints.len()],
        joints,
        target: Target::Point(v(5.0, 2.5, -1.0)),
        limit: 80f64.to_radians(),
    };
    let facing = |snapshot: &Snapshot, joint: u32| {
        let axes = joint_axes(&snapshot.actors[0].model_from_joint[joint as usize]);
        (snapshot.actors[0].world_from_model.matrix3 * axes * DVec3::Z).normalize()
    };
    let rest = stage_with(vec![]).at(Time::ZERO).unwrap();
    let snapshot = stage_with(vec![Constraint::new(ConstraintKind::Aim(aim(vec![SPINE, NECK, FACE])))])
        .at(Time::ZERO)
        .unwrap();
    let way = (v(5.0, 2.5, -1.0) - joint_world(&snapshot, 0, FACE)).normalize();
    assert!(facing(&snapshot, FACE).dot(way) > 1.0 - 1e-9);
    let turned = |joint: u32| facing(&snapshot, joint).angle_between(facing(&rest, joint));
    assert!(turned(SPINE) > 0.1 && turned(NECK) > turned(SPINE) && turned(FACE) > turned(NECK));
    // The arms move with the spine.
    assert!((joint_world(&snapshot, 0, PALM) - joint_world(&rest, 0, PALM)).length() > 0.05);
    let alone =
        stage_with(vec![Constraint::new(ConstraintKind::Aim(aim(vec![FACE])))]).at(Time::ZERO).unwrap();
    assert_eq!(joint_world(&alone, 0, PALM), joint_world(&rest, 0, PALM));
}

#[test]
fn joint_limits_clamp_clips_and_constraints() {
    let target = Target::Point(v(3.3, 1.9, -1.8));
    let mut stage = stage_with(vec![Constraint::new(ConstraintKind::Reach(reach_constraint(target)))]);
    let free = joint_world(&stage.at(Time::ZERO).unwrap(), 0, PALM);
    stage.actors[0].limits.push((LOWER, Limit::Hinge { axis: DVec3::Y, angle: (0.0, 0.1) }));
    let stiff = stage.at(Time::ZERO).unwrap();
    assert!((joint_world(&stiff, 0, PALM) - free).length() > 0.02);
    let local = |snapshot: &Snapshot, joint: u32, parent: u32| {
        let m = &snapshot.actors[0].model_from_joint;
        Quat::from_mat3a(&(m[parent as usize].matrix3.transpose() * m[joint as usize].matrix3))
    };
    let bent = local(&stiff, LOWER, UPPER);
    assert!(
        bent.x.abs() < 1e-5 && bent.z.abs() < 1e-5 && 2.0 * bent.y.asin() <= 0.1001 && bent.y > -1e-5,
        "{bent}"
    );
    // A clip that raises the arm farther than it may.
    let high = Quat::from_rotation_z(1.2).to_array();
    let raised = clip("raise", 10, vec![curve(UPPER, Path::Rotation, &[(0.0, &high)])]);
    let mut stage = stage_with(vec![]);
    stage.play(0, Cue::new(raised));
    stage.actors[0].limits.push((UPPER, Limit::SwingTwist { axis: DVec3::X, swing: 0.5, twist: (0.0, 0.0) }));
    let arm = local(&stage.at(Time::ZERO).unwrap(), UPPER, SPINE);
    assert!((2.0 * arm.z.asin() - 0.5).abs() < 1e-4, "{arm}");
}

/// A step every second that slides by 10 cm while the foot is down, and 0.6 m between.
fn sliding_steps_stage() -> Stage {
    let mut stage = stage_with(vec![]);
    let mut keys: Vec<(f64, [f32; 3])> = Vec::new();
    for i in 0..4 {
        let z = 0.7 * i as f32;
        keys.push((f64::from(i), [0.0, 0.9, z]));
        keys.push((f64::from(i) + 0.6, [0.0, 0.9, z + 0.1]));
        keys.push((f64::from(i) + 0.8, [0.0, 1.1, z + 0.4]));
    }
    let keys: Vec<(f64, &[f32])> = keys.iter().map(|(t, k)| (*t, &k[..])).collect();
    let hop = clip("hop", 10, vec![curve(0, Path::Translation, &keys)]);
    stage.play(0, Cue { repeat: Repeat::Once, ..Cue::new(hop) });
    stage
}

fn foot_lock(ground: Option<usize>) -> Constraint {
    let legs = vec![Leg { hip: THIGH, knee: SHIN, foot: FOOT, toe: None }];
    Constraint::new(ConstraintKind::FootLock(FootLock {
        legs,
        hips: Some(0),
        ground: ground.into_iter().collect(),
        locked_spans: Vec::new(),
        standing_fades: Vec::new(),
    }))
}

/// Largest distance of the foot from its place at the first time, until the second one, metres.
fn foot_slide(stage: &Stage, from: f64, to: f64) -> f64 {
    let mut eyes = Evaluator::new(Arc::new(stage.clone()));
    let mut foot = |t: f64| joint_world(&eyes.at(secs(t)).unwrap(), 0, FOOT);
    let first = foot(from);
    (0..=20).map(|i| (foot(from + (to - from) * f64::from(i) / 20.0) - first).length()).fold(0.0, f64::max)
}

#[test]
fn foot_lock_keeps_planted_feet_from_sliding() {
    let mut stage = sliding_steps_stage();
    assert!(foot_slide(&stage, 1.1, 1.5) > 0.06);
    stage.actors[0].constraints.push(foot_lock(None));
    assert!(stage.check().is_empty(), "{:?}", stage.check());
    assert!(foot_slide(&stage, 1.1, 1.5) < 1e-6, "{}", foot_slide(&stage, 1.1, 1.5));
    // The foot does not jump: at 240 Hz it is at most a little faster than in the clip.
    let mut eyes = Evaluator::new(Arc::new(stage.clone()));
    let fastest = |planted: bool| {
        let mut stage = stage.clone();
        if !planted {
            stage.actors[0].constraints.clear();
        }
        let mut eyes_of = Evaluator::new(Arc::new(stage));
        let mut before = joint_world(&eyes_of.at(secs(0.5)).unwrap(), 0, FOOT);
        let mut most = 0.0f64;
        for i in 121..720 {
            let now = joint_world(&eyes_of.at(secs(f64::from(i) / 240.0)).unwrap(), 0, FOOT);
            most = most.max((now - before).length());
            before = now;
        }
        most
    };
    assert!(fastest(true) < 1.6 * fastest(false) + 0.002);
    // A frame evaluated alone equals the same frame after others.
    let there = eyes.at(secs(2.345)).unwrap();
    assert_eq!(there.content_hash(), stage.at(secs(2.345)).unwrap().content_hash());
}

#[test]
fn foot_lock_raises_feet_to_the_ground_mesh() {
    let mut stage = sliding_steps_stage();
    stage.actors[0].transform = Placement::default();
    let mut steps = Asset { skeleton: skeleton(&[("Steps", None, at(0.0, 0.0, 0.0))]), ..Asset::default() };
    // A step 20 cm high from z = 0.5 on.
    let primitive = box_primitive(Vec3::new(-1.0, -1.0, 0.5), Vec3::new(1.0, 0.2, 5.0));
    steps.meshes.push(Arc::new(Mesh { primitives: vec![primitive], ..Mesh::default() }));
    steps.instances.push(MeshInstance { joint: 0, mesh: 0, ..MeshInstance::default() });
    let ground = stage.cast("steps", Arc::new(steps));
    let foot = |stage: &Stage, t: f64| joint_world(&stage.at(secs(t)).unwrap(), 0, FOOT).y;
    let flat = [0.3, 1.3, 2.3].map(|t| foot(&stage, t));
    stage.actors[0].constraints.push(foot_lock(Some(ground)));
    let stepped = [0.3, 1.3, 2.3].map(|t| foot(&stage, t));
    // 0.05 m above the floor in the clip.
    assert!((stepped[0] - flat[0]).abs() < 1e-4, "{stepped:?} {flat:?}");
    assert!((stepped[1] - flat[1] - 0.2).abs() < 1e-4 && (stepped[2] - flat[2] - 0.2).abs() < 1e-4);
}

#[test]
fn invalid_constraint_targets_are_reported_and_poses_stay_finite() {
    for target in
        [Target::Actor(9), Target::Joint { actor: 9, joint: 0 }, Target::Joint { actor: 0, joint: 99 }]
    {
        let aim = AimConstraint { joints: vec![SPINE, NECK], shares: vec![1.0, 1.0], target, limit: 1.0 };
        let poled =
            ReachConstraint { pole: Some(target), ..reach_constraint(Target::Point(v(3.0, 1.0, -2.0))) };
        let mut stage = stage_with(vec![
            Constraint::new(ConstraintKind::Reach(reach_constraint(target))),
            Constraint::new(ConstraintKind::Reach(poled)),
            Constraint::new(ConstraintKind::Aim(aim)),
            foot_lock(Some(9)),
        ]);
        stage.actors[0].look_at.push(LookAt::new(FACE, target));
        assert!(!stage.check().is_empty());
        let snapshot = stage.at(secs(0.5)).unwrap();
        assert!(snapshot.actors[0].model_from_joint.iter().all(|m| m.is_finite()));
    }
}

#[test]
fn check_reports_each_invalid_constraint_field() {
    let contacts = |change: fn(&mut Actor)| {
        let target = Target::Point(DVec3::ZERO);
        let mut stage = stage_with(vec![Constraint::new(ConstraintKind::Reach(reach_constraint(target)))]);
        change(&mut stage.actors[0]);
        let found: Vec<String> = stage.check().iter().map(ToString::to_string).collect();
        let _ = stage.at(secs(0.5));
        found
    };
    let with = |s: &str| vec![s.to_string()];
    fn kind(actor: &mut Actor) -> &mut ReachConstraint {
        match &mut actor.constraints[0].kind {
            ConstraintKind::Reach(reach) => reach,
            _ => unreachable!(),
        }
    }
    assert_eq!(
        contacts(|a| a.constraints[0].weight = f32::NAN),
        with("actor \"anna\", reach: weight is NaN, must be from 0 to 1")
    );
    assert_eq!(
        contacts(|a| kind(a).joints = vec![PALM, LOWER]),
        with("actor \"anna\", reach: each joint must be below the one before it")
    );
    assert_eq!(
        contacts(|a| kind(a).soft = 2.0),
        with("actor \"anna\", reach: soft is 2, must be from 0 to 1")
    );
    assert_eq!(
        contacts(|a| kind(a).joints = vec![UPPER]),
        with("actor \"anna\", reach: the number of joints is 1, must be at least 2")
    );
    assert_eq!(
        contacts(|a| kind(a).joints = vec![UPPER, 99]),
        with("actor \"anna\", reach: joint 99 does not exist (count: 10)")
    );
    assert_eq!(
        contacts(|a| kind(a).target = Target::Actor(7)),
        with("actor \"anna\", reach: target actor 7 does not exist (count: 1)")
    );
    assert_eq!(
        contacts(|a| a.limits.push((0, Limit::Hinge { axis: DVec3::ZERO, angle: (0.0, 1.0) }))),
        with("actor \"anna\", limit: `Limit.axis` is of length 0, must be of length 1")
    );
}
