//! Parents over time: an attached actor keeps its size and, when its parent changes, its place; then it moves with the new parent.

use crate::support::*;
use choreo_asset::*;
use choreo_motion::{Time, Transform};
use choreo_stage::*;
use glam::{DAffine3, DMat3, DQuat, DVec3, Quat, Vec3};
use std::f64::consts::{FRAC_PI_4, PI};
use std::sync::Arc;

/// One tick after a time, when a new parent has taken over.
fn one_tick_after(time: f64) -> Time {
    secs(time) + Time(1)
}

fn world_from_actor(stage: &Stage, actor: usize, time: Time) -> DAffine3 {
    stage.at(time).unwrap().actors[actor].world_from_model
}

/// World from the hand of a [`figure`] that raises its arm, in closed form.
fn world_from_hand(placement: &Placement, t: f64) -> DAffine3 {
    let Placement { translation, rotation, scale } = *placement;
    let arm = DAffine3::from_rotation_translation(DQuat::from_rotation_z(FRAC_PI_4 * t), v(0.3, 1.4, 0.0));
    DAffine3::from_scale_rotation_translation(scale, rotation, translation)
        * arm
        * DAffine3::from_translation(v(0.6, 0.0, 0.0))
}

/// Two characters that raise their arms, with a stick in the hand of the first.
fn handover() -> Stage {
    let mut stage = Stage::default();
    let f = figure();
    for name in ["anna", "boris"] {
        let actor = stage.cast(name, f.clone());
        stage.play(actor, Cue::new(f.clips[RAISE].clone()));
    }
    stage.actors[1].transform = Placement::at(2.0, 0.3, -0.5).turned(PI - 0.4);
    stage.cast("stick", stick());
    stage.actors[2].transform = Placement::at(0.1, 0.05, -0.2).turned(0.7);
    stage.actors[2].transform.scale = DVec3::splat(0.5);
    stage.actors[2].parents = vec![parenting_on_hand(0)];
    stage
}

fn parenting_on_hand(actor: usize) -> Parenting {
    Parenting::always(Attachment { actor, joint: Some(HAND) })
}

fn parenting_to_hand_at(actor: usize, start: f64) -> Parenting {
    Parenting::from(Some(Attachment { actor, joint: Some(HAND) }), secs(start))
}

fn parent_from_actor(placement: &Placement) -> DAffine3 {
    let Placement { translation, rotation, scale } = *placement;
    DAffine3::from_scale_rotation_translation(scale, rotation, translation)
}

#[track_caller]
fn assert_same_transform(actual: &DAffine3, expected: &DAffine3, tolerance: f64) {
    let error = (0..4).map(|i| (actual.to_cols_array_2d()[i], expected.to_cols_array_2d()[i]));
    let error = error.flat_map(|(a, b)| a.into_iter().zip(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(error <= tolerance, "expected {expected}, actual {actual}: {error} > {tolerance}");
}

/// A scaled root with a rotated and scaled child, which gives a shear, and a hand below them, as some exporters write.
fn scaled_skeleton(root: Transform, middle: Transform) -> Arc<Asset> {
    let skeleton = skeleton(&[
        ("Armature", None, root),
        ("Arm", Some(0), middle),
        ("Hand", Some(1), at(0.0, 50.0, 0.0)),
    ]);
    Arc::new(Asset { name: "scaled".into(), skeleton, ..Asset::default() })
}

#[test]
fn attached_actor_keeps_its_size_whatever_the_scale_of_its_parent() {
    let turned = Quat::from_rotation_x(1.1);
    let cases = [
        (Vec3::splat(0.01), Vec3::ONE),
        (Vec3::splat(100.0), Vec3::ONE),
        (Vec3::new(-1.0, 1.0, 1.0), Vec3::splat(2.0)),
        (Vec3::new(1.0, 3.0, 0.2), Vec3::ONE),
        (Vec3::new(1.0, 0.1, 1.0), Vec3::new(1.0, 1.0, 4.0)),
        (Vec3::ZERO, Vec3::ONE),
    ];
    for (root, middle) in cases {
        let root = Transform { scale: root, ..Transform::IDENTITY };
        let asset =
            scaled_skeleton(root, Transform { rotation: turned, scale: middle, translation: Vec3::Y });
        let mut stage = Stage::default();
        stage.cast("body", asset.clone());
        stage.cast("sword", stick());
        stage.actors[1].transform = Placement::at(0.0, 0.0, 0.2);
        stage.actors[1].parents = vec![Parenting::always(Attachment { actor: 0, joint: Some(2) })];
        let snapshot = stage.at(Time::ZERO).unwrap();
        let placed = snapshot.actors[1].world_from_model;
        let unit = placed.matrix3.transpose() * placed.matrix3;
        assert!(unit.abs_diff_eq(DMat3::IDENTITY, 1e-9), "{root:?} {middle}: {placed}");
        assert_eq!(placed.matrix3.determinant().signum(), if root.scale.x < 0.0 { -1.0 } else { 1.0 });
        // `.at` is in metres.
        assert!((placed.translation.distance(joint_world(&snapshot, 0, 2)) - 0.2).abs() < 1e-6);
        // Where the scale is inherited, as it was until now, it is all in the joint's matrix.
        stage.actors[1].parents[0].scale = ParentScale::Inherit;
        let inherited = world_from_actor(&stage, 1, Time::ZERO);
        let joint = snapshot.actors[0].model_from_joint[2];
        let joint = DAffine3::from_cols_array(&joint.to_cols_array().map(f64::from));
        assert_same_transform(&inherited, &(joint * DAffine3::from_translation(v(0.0, 0.0, 0.2))), 1e-12);
    }
}

#[test]
fn parent_change_between_moving_hands_is_continuous() {
    let mut stage = handover();
    stage.actors[2].parents.push(parenting_to_hand_at(1, 1.0));
    assert!(stage.check().is_empty(), "{:?}", stage.check());
    let [anna, boris, stick] = [0, 1, 2].map(|a| stage.actors[a].transform);
    let given = world_from_hand(&anna, 1.0) * parent_from_actor(&stick);
    for t in [0.0, 0.6, 1.0] {
        assert_same_transform(
            &world_from_actor(&stage, 2, secs(t)),
            &(world_from_hand(&anna, t) * parent_from_actor(&stick)),
            1e-6,
        );
    }
    let jump = world_from_actor(&stage, 2, one_tick_after(1.0))
        .translation
        .distance(world_from_actor(&stage, 2, secs(1.0)).translation);
    assert!(jump < 2e-9, "{jump} m in {} s", 1.0 / Time::TICKS_PER_SECOND as f64);
    for t in [1.1, 1.5, 1.9] {
        assert_same_transform(
            &world_from_actor(&stage, 2, secs(t)),
            &(world_from_hand(&boris, t) * world_from_hand(&boris, 1.0).inverse() * given),
            1e-6,
        );
    }
    // Without `keep` it moves to its own placement in the new hand.
    stage.actors[2].parents[1].keep = false;
    assert_same_transform(
        &world_from_actor(&stage, 2, secs(1.0)),
        &(world_from_hand(&boris, 1.0) * parent_from_actor(&stick)),
        1e-6,
    );
    let placement = Placement::at(0.0, 0.3, 0.0);
    stage.actors[2].parents[1].placement = Some(placement);
    let half = DAffine3::from_scale(DVec3::splat(0.5));
    assert_same_transform(
        &world_from_actor(&stage, 2, secs(1.5)),
        &(world_from_hand(&boris, 1.5) * parent_from_actor(&placement) * half),
        1e-6,
    );
}

#[test]
fn parent_blend_is_continuous_and_ends_on_the_new_parent() {
    let mut stage = handover();
    for keep in [true, false] {
        stage.actors[2].parents =
            vec![parenting_on_hand(0), Parenting { keep, ..parenting_to_hand_at(1, 0.6) }];
        let sharp = stage.clone();
        stage.actors[2].parents[1].blend = secs(0.8);
        let mut evaluator = Evaluator::new(Arc::new(stage.clone()));
        let mut places = (0..=1000).map(|i| {
            let snapshot = evaluator.at(secs(0.5 + f64::from(i) * 1e-3)).unwrap();
            snapshot.actors[2].world_from_model.transform_point3(v(0.0, 1.0, 0.0))
        });
        let first = places.next().unwrap();
        let (_, fastest) =
            places.fold((first, 0.0f64), |(before, most), p| (p, most.max(before.distance(p))));
        // Metres a millisecond; sharp, the change without keeping is metres at once.
        assert!(fastest < if keep { 2e-3 } else { 8e-3 }, "keep {keep}: {fastest} m in a millisecond");
        assert_same_transform(
            &world_from_actor(&stage, 2, secs(0.6)),
            &world_from_actor(&handover(), 2, secs(0.6)),
            1e-7,
        );
        assert_same_transform(
            &world_from_actor(&stage, 2, secs(1.4)),
            &world_from_actor(&sharp, 2, secs(1.4)),
            1e-12,
        );
        let between = world_from_actor(&stage, 2, secs(1.0)).matrix3;
        assert!((between.transpose() * between).abs_diff_eq(DMat3::IDENTITY * 0.25, 1e-6), "{between}");
    }
}

#[test]
fn released_actor_stays_in_the_world_until_its_next_parent() {
    let mut stage = handover();
    stage.actors[2].parents.extend([Parenting::from(None, secs(0.5)), parenting_to_hand_at(1, 1.25)]);
    let let_go = world_from_actor(&stage, 2, secs(0.5));
    assert_same_transform(&world_from_actor(&stage, 2, secs(1.25)), &let_go, 1e-12);
    let boris = stage.actors[1].transform;
    assert_same_transform(
        &world_from_actor(&stage, 2, secs(1.9)),
        &(world_from_hand(&boris, 1.9) * world_from_hand(&boris, 1.25).inverse() * let_go),
        1e-6,
    );
    // Keys go on in the space that was kept.
    stage.actors[2].channels = vec![Channel {
        property: Property::Translation,
        interpolation: choreo_motion::Interpolation::Linear,
        times: vec![secs(0.0), secs(2.0)],
        values: vec![0.0, 0.0, 0.0, 0.0, 0.4, 0.0],
    }];
    for t in [0.5, 1.25] {
        let jump = world_from_actor(&stage, 2, one_tick_after(t))
            .translation
            .distance(world_from_actor(&stage, 2, secs(t)).translation);
        assert!(jump < 2e-9, "{jump} at {t} s");
    }
    let moved = world_from_actor(&stage, 2, secs(1.0)).translation
        - world_from_actor(&stage, 2, secs(0.5)).translation;
    assert!((moved.length() - 0.1).abs() < 1e-9, "{moved}");
}

#[test]
fn parent_and_child_may_swap_roles_but_not_overlap() {
    let mut stage = Stage::default();
    let asset = Arc::new(Asset::default());
    let [tray, cup] = ["tray", "cup"].map(|name| stage.cast(name, asset.clone()));
    stage.actors[tray].transform = Placement::at(1.0, 0.0, 0.0);
    stage.actors[cup].transform = Placement::at(0.0, 0.2, 0.0);
    let on = |actor, start| Parenting::from(Some(Attachment { actor, joint: None }), start);
    stage.actors[cup].parents =
        vec![Parenting { keep: false, ..on(tray, Time::MIN) }, Parenting::from(None, secs(1.0))];
    stage.actors[tray].parents = vec![on(cup, secs(1.0))];
    assert!(stage.check().is_empty(), "{:?}", stage.check());
    let places = |stage: &Stage, t: f64| [tray, cup].map(|a| world_from_actor(stage, a, secs(t)).translation);
    assert_eq!(places(&stage, 0.5), [v(1.0, 0.0, 0.0), v(1.0, 0.2, 0.0)]);
    assert_eq!(places(&stage, 3.0), [v(1.0, 0.0, 0.0), v(1.0, 0.2, 0.0)]);
    // They cannot be attached to each other at the same time: here the cup is released later than the tray is attached to it.
    stage.actors[cup].parents[1].start = secs(2.0);
    let found = stage.check().iter().map(ToString::to_string).collect::<Vec<_>>();
    assert_eq!(found, ["actor \"tray\" is attached to itself, through \"cup\", at 1 s"]);
    let rig = Rig::Fixed { position: DVec3::Z, rotation: DQuat::IDENTITY, look_at: None };
    stage.shoot(Camera::new("c", rig));
    assert_eq!([0.9, 1.5, 2.5].map(|t| stage.at(secs(t)).is_ok()), [true, false, false]);
}

#[test]
fn chained_parent_changes_are_bit_identical_in_any_order_on_any_thread() {
    let mut stage = handover();
    stage.actors[2].parents.extend([
        parenting_to_hand_at(1, 0.3),
        parenting_to_hand_at(0, 0.9),
        Parenting::from(None, secs(1.4)),
    ]);
    stage.actors[2].parents[2].blend = secs(0.4);
    // Another actor is attached to the stick and changes its parent at the same time.
    stage.cast("ribbon", stick());
    let on_stick = Parenting::from(Some(Attachment { actor: 2, joint: None }), secs(0.9));
    stage.actors[3].parents = vec![Parenting { blend: secs(0.2), ..on_stick }];
    assert!(stage.check().is_empty(), "{:?}", stage.check());
    let times: Vec<Time> = (0..40).map(|i| secs(f64::from(i) * 0.05)).collect();
    let alone: Vec<ContentHash> = times.iter().map(|t| stage.at(*t).unwrap().content_hash()).collect();
    let evaluator = Evaluator::new(Arc::new(stage));
    std::thread::scope(|scope| {
        for thread in 0..4 {
            let (mut evaluator, times, alone) = (evaluator.clone(), &times, &alone);
            scope.spawn(move || {
                for i in (0..times.len()).map(|i| (i * (7 + 2 * thread) + 13) % times.len()) {
                    assert_eq!(evaluator.at(times[i]).unwrap().content_hash(), alone[i], "{:?}", times[i]);
                }
            });
        }
    });
}

#[test]
fn parent_change_from_a_reaching_hand_is_continuous() {
    let mut stage = handover();
    for (actor, target) in [(0, v(0.9, 1.9, 0.3)), (1, v(1.2, 1.6, 0.1))] {
        let reach = ReachConstraint {
            joints: vec![CHEST, ARM, HAND],
            target: Target::Point(target),
            offset: None,
            pole: None,
            hint: DVec3::NEG_Z,
            soft: 0.0,
            keep_rotation: false,
        };
        stage.actors[actor].constraints.push(Constraint {
            start: secs(0.2),
            fade: secs(0.6),
            ..Constraint::new(ConstraintKind::Reach(reach))
        });
    }
    stage.actors[2].parents.push(parenting_to_hand_at(1, 0.5));
    let mut moved = stage.clone();
    moved.actors.iter_mut().for_each(|actor| actor.constraints.clear());
    let far = world_from_actor(&moved, 2, secs(0.5))
        .translation
        .distance(world_from_actor(&stage, 2, secs(0.5)).translation);
    assert!(far > 0.01, "the constraint moves the hand by {far} m only");
    let jump = world_from_actor(&stage, 2, one_tick_after(0.5))
        .translation
        .distance(world_from_actor(&stage, 2, secs(0.5)).translation);
    assert!(jump < 2e-8, "{jump} m");
}

#[derive(Debug)]
struct Callback(fn(f64, &mut FrameEdits));
impl FrameCallback for Callback {
    fn run(&self, time: Time, edits: &mut FrameEdits) -> Result<(), StageError> {
        self.0(time.as_secs(), edits);
        Ok(())
    }
}

#[test]
fn callback_sets_the_parent_of_one_frame() {
    let mut stage = handover();
    stage.frame_callbacks.push(Arc::new(Callback(|t, edits| {
        let parent = parenting_on_hand(1);
        let parent = if t > 1.5 { Parenting { to: None, ..parent } } else { parent };
        if t > 1.0 {
            edits.actors.push((2, ActorEdit::Attach(parent)));
        }
    })));
    let [anna, boris, stick] = [0, 1, 2].map(|a| stage.actors[a].transform);
    assert_same_transform(
        &world_from_actor(&stage, 2, secs(0.9)),
        &(world_from_hand(&anna, 0.9) * parent_from_actor(&stick)),
        1e-6,
    );
    assert_same_transform(
        &world_from_actor(&stage, 2, secs(1.2)),
        &(world_from_hand(&boris, 1.2) * parent_from_actor(&stick)),
        1e-6,
    );
    assert_same_transform(&world_from_actor(&stage, 2, secs(1.8)), &parent_from_actor(&stick), 1e-12);
}

#[test]
fn visible_parents_are_posed_and_children_are_culled_after_the_blend() {
    let f = figure();
    let mut stage = Stage::default();
    for (name, x) in [("anna", 0.0), ("boris", 400.0)] {
        let actor = stage.cast(name, f.clone());
        stage.actors[actor].transform = Placement::at(x, 0.0, 0.0);
    }
    stage.cast("stick", stick());
    // A stick without morphs has known bounds.
    let mut plain = (*stick()).clone();
    plain.meshes =
        vec![Arc::new(Mesh { primitives: vec![box_primitive(Vec3::ZERO, Vec3::ONE)], ..Mesh::default() })];
    plain.instances[0].weights.clear();
    plain.clips.clear();
    stage.actors[2].asset = Arc::new(plain);
    let placed = Placement::at(0.0, 0.1, 0.0);
    stage.actors[2].parents = vec![
        parenting_on_hand(0),
        Parenting { keep: false, placement: Some(placed), blend: secs(0.5), ..parenting_to_hand_at(1, 1.0) },
    ];
    let rig = Rig::Fixed { position: v(0.0, 1.0, 5.0), rotation: DQuat::IDENTITY, look_at: None };
    stage.shoot(Camera::new("c", rig));
    assert!(stage.check().is_empty(), "{:?}", stage.check());
    let mut evaluator = Evaluator::new(Arc::new(stage.clone())).for_images(1.0);
    let mut culled =
        |t: f64| evaluator.at(secs(t)).unwrap().actors.iter().map(|a| a.culled).collect::<Vec<_>>();
    assert_eq!(culled(0.5), [false, true, false]);
    // During a blend it may be anywhere, so it is not culled.
    assert_eq!(culled(1.2), [false, true, false]);
    assert_eq!(culled(1.6), [false, true, true]);
    // Hidden carriers are posed for it.
    stage.actors[1].visible = false;
    stage.actors[2].visible = true;
    let snapshot = stage.at(secs(1.2)).unwrap();
    assert!(!snapshot.actors[2].visible, "it is hidden with its newest parent");
}
