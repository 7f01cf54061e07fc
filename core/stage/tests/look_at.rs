//! Heads that turn.

mod support;
use choreo_stage::*;
use glam::DVec3;
use std::sync::Arc;
use support::*;

/// Degrees between where the head faces and where a point is.
fn off_by(snapshot: &Snapshot, actor: usize, joint: u32, target: DVec3) -> f64 {
    let state = &snapshot.actors[actor];
    let axes = joint_axes(&state.model_from_joint[joint as usize]);
    let faces = (state.world_from_model.matrix3 * axes * DVec3::Z).normalize();
    let way = (target - joint_world(snapshot, actor, joint)).normalize();
    faces.cross(way).length().atan2(faces.dot(way)).to_degrees()
}

fn one(target: Target) -> Stage {
    let mut stage = Stage::default();
    let anna = stage.cast("anna", figure());
    stage.actors[anna].transform = Placement::at(3.0, 1.0, -2.0).turned(0.5);
    stage.actors[anna].look_at.push(LookAt::new(HEAD, target));
    stage
}

#[test]
fn a_head_points_at_its_target_whatever_its_clip_does() {
    let f = figure();
    let mut numbers = Numbers(1);
    let mut reached = 0;
    for _ in 0..200 {
        let target = v(3.0, 2.0, -2.0) + numbers.vec3() * 5.0;
        let mut stage = one(Target::Point(target));
        stage.play(0, Cue::new(f.clips[NOD].clone()));
        let snapshot = stage.at(secs(0.7)).unwrap();
        stage.actors[0].look_at.clear();
        let before = off_by(&stage.at(secs(0.7)).unwrap(), 0, HEAD, target);
        let off = off_by(&snapshot, 0, HEAD, target);
        if before <= 80.0 {
            reached += 1;
            assert!(off < 1e-4, "{off}° off, {before}° before");
        } else {
            let expected = before - 80.0 * (180.0 - before) / 100.0;
            assert!((off - expected).abs() < 1e-3, "{off}° off, must be {expected}°, {before}° before");
        }
        // The joint stays where it was, and nothing but the head moves.
        close(joint_world(&snapshot, 0, HEAD), joint_world(&stage.at(secs(0.7)).unwrap(), 0, HEAD), 1e-9);
        close(joint_world(&snapshot, 0, HAND), joint_world(&stage.at(secs(0.7)).unwrap(), 0, HAND), 1e-9);
    }
    assert!(reached > 30);
}

#[test]
fn forward_is_the_models_z_however_the_joint_is_turned_at_rest() {
    // A head joint whose own axes are permuted, under a joint that stands on its head.
    let rest = |q: glam::Quat| choreo_motion::Transform { rotation: q, ..at(0.0, 1.0, 0.0) };
    let skeleton = skeleton(&[
        ("Spine", None, rest(glam::Quat::from_rotation_z(3.0))),
        ("Head", Some(0), rest(glam::Quat::from_xyzw(0.5, 0.5, 0.5, 0.5))),
    ]);
    let asset = Arc::new(Asset { skeleton, ..Asset::default() });
    let mut stage = Stage::default();
    stage.cast("a", asset.clone());
    let target = v(0.7, 0.3, 4.0);
    stage.actors[0].look_at.push(LookAt::new(1, Target::Point(target)));
    let snapshot = stage.at(secs(0.0)).unwrap();
    let turn = joint_axes(&snapshot.actors[0].model_from_joint[1])
        * joint_axes(&asset.rest_model_from_joint()[1]).inverse();
    let way = (target - joint_world(&snapshot, 0, 1)).normalize();
    close((turn * DVec3::Z).normalize(), way, 1e-6);
}

#[test]
fn fades_and_weights_scale_the_angle() {
    let mut stage = one(Target::Point(DVec3::ZERO));
    stage.actors[0].transform = Placement::at(0.0, 0.0, 0.0);
    let head = v(0.0, 1.6, 0.0);
    let sixty = 60f64.to_radians();
    let target = head + v(sixty.sin(), 0.0, sixty.cos()) * 3.0;
    let look = LookAt {
        start: secs(1.0),
        end: Some(secs(4.0)),
        fade: secs(1.0),
        weight: 0.5,
        ..LookAt::new(HEAD, Target::Point(target))
    };
    stage.actors[0].look_at = vec![look];
    for (t, share) in [(0.99, 0.0), (1.0, 0.0), (1.5, 0.25), (2.5, 0.5), (3.5, 0.25), (4.0, 0.0)] {
        let off = off_by(&stage.at(secs(t)).unwrap(), 0, HEAD, target);
        assert!((off - 60.0 * (1.0 - share)).abs() < 1e-3, "at {t} s {off}° off");
    }
}

#[test]
fn two_look_each_other_in_the_eye_and_one_at_the_thing_in_her_hand() {
    let mut stage = Stage::default();
    let [anna, boris] = ["anna", "boris"].map(|name| stage.cast(name, figure()));
    stage.actors[anna].transform = Placement::at(-1.0, 0.0, 0.0).turned(1.2);
    stage.actors[boris].transform = Placement::at(1.0, 0.3, 0.0).turned(-1.9);
    for (who, other) in [(anna, boris), (boris, anna)] {
        let target = Target::Joint { actor: other, joint: HEAD };
        stage.actors[who].look_at.push(LookAt::new(HEAD, target));
    }
    let snapshot = stage.at(secs(0.0)).unwrap();
    for (who, other) in [(anna, boris), (boris, anna)] {
        let off = off_by(&snapshot, who, HEAD, joint_world(&snapshot, other, HEAD));
        assert!(off < 1e-4, "{off}");
    }
    let sword = stage.cast("sword", stick());
    stage.actors[sword].parent = Some(Attachment { actor: anna, joint: Some(HAND) });
    stage.actors[sword].transform = Placement::at(0.0, 0.0, 0.4);
    stage.actors[anna].look_at[0].target = Target::Actor(sword);
    let snapshot = stage.at(secs(0.0)).unwrap();
    let middle = snapshot.actors[sword].world_from_model.transform_point3(v(0.0, 0.5, 0.0));
    let off = off_by(&snapshot, anna, HEAD, middle);
    assert!(off < 1e-3, "{off}");
}

#[test]
fn what_hangs_on_a_turned_head_turns_with_it() {
    let mut stage = one(Target::Point(v(3.0, 2.6, 1.0)));
    let hat = stage.cast("hat", stick());
    stage.actors[hat].parent = Some(Attachment { actor: 0, joint: Some(HEAD) });
    stage.actors[hat].transform = Placement::at(0.0, 0.0, 1.0);
    let snapshot = stage.at(secs(0.0)).unwrap();
    let (head, brim) = (joint_world(&snapshot, 0, HEAD), snapshot.actors[hat].world_from_model.translation);
    let way = (v(3.0, 2.6, 1.0) - head).normalize();
    close(brim - head, way, 1e-5);
}

#[test]
fn targets_behind_and_inside_stay_finite_and_continuous() {
    let mut last: Option<f64> = None;
    // All the way round, through straight behind.
    for i in 0..=720 {
        let angle = (i as f64 / 2.0).to_radians();
        let mut stage = one(Target::Point(v(0.0, 1.6, 0.0) + v(angle.sin(), 0.0, angle.cos())));
        stage.actors[0].transform = Placement::default();
        let snapshot = stage.at(secs(0.0)).unwrap();
        let z = joint_axes(&snapshot.actors[0].model_from_joint[HEAD as usize]) * DVec3::Z;
        let yaw = z.x.atan2(z.z).to_degrees();
        assert!(yaw.is_finite() && yaw.abs() <= 80.001, "{yaw}");
        assert!(last.is_none_or(|l| (l - yaw).abs() < 0.6), "jumps from {last:?} to {yaw} at {i}");
        last = Some(yaw);
    }
    let mut inside = one(Target::Point(DVec3::ZERO));
    inside.actors[0].transform = Placement::default();
    inside.actors[0].look_at[0].target = Target::Joint { actor: 0, joint: HEAD };
    let snapshot = inside.at(secs(0.0)).unwrap();
    assert_eq!(snapshot.actors[0].model_from_joint, figure().rest_model_from_joint());
}
