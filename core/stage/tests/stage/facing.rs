//! Characters modeled with another front than +Z: the front is detected, and they walk and look forward.

use crate::support::*;
use choreo_asset::*;
use choreo_motion::{Facing, Front, Path, Skeleton, Time, Transform};
use choreo_stage::*;
use glam::{DVec3, Quat};
use std::sync::Arc;

/// A person with named sides, toes and eyes, turned about +Y from facing +Z.
fn character_facing(front: Front) -> Arc<Asset> {
    let root = Transform { rotation: Quat::from_rotation_y(front.yaw_rad() as f32), ..Transform::IDENTITY };
    let skeleton = skeleton(&[
        ("Root", None, root),
        ("Hips", Some(0), at(0.0, 1.0, 0.0)),
        ("Head", Some(1), at(0.0, 0.6, 0.0)),
        ("LeftEye", Some(2), at(0.03, 0.05, 0.08)),
        ("RightEye", Some(2), at(-0.03, 0.05, 0.08)),
        ("LeftUpLeg", Some(1), at(0.1, 0.0, 0.0)),
        ("LeftLeg", Some(5), at(0.0, -0.45, 0.03)),
        ("LeftFoot", Some(6), at(0.0, -0.45, -0.03)),
        ("LeftToeBase", Some(7), at(0.0, -0.08, 0.12)),
        ("RightUpLeg", Some(1), at(-0.1, 0.0, 0.0)),
        ("RightLeg", Some(9), at(0.0, -0.45, 0.03)),
        ("RightFoot", Some(10), at(0.0, -0.45, -0.03)),
        ("RightToeBase", Some(11), at(0.0, -0.08, 0.12)),
    ]);
    Arc::new(Asset { name: "person".into(), skeleton, ..Asset::default() })
}

/// Where the front of an actor points in the world.
fn world_front(stage: &Stage, time: f64) -> DVec3 {
    let front = stage.actors[0].asset.front().direction();
    stage.at(secs(time)).unwrap().actors[0].world_from_model.transform_vector3(front)
}

#[test]
fn model_front_is_detected_from_feet_eyes_knees_and_sides() {
    for (name, front) in Front::ALL {
        let asset = character_facing(front);
        let facing = asset.facing();
        assert_eq!((facing.front, facing.doubtful), (front, false), "{name}: {facing:?}");
        let parts: Vec<&str> = facing.evidence.iter().map(|e| e.part).collect();
        assert_eq!(parts, ["feet", "eyes", "knees", "left and right"]);
        for evidence in &facing.evidence {
            assert_close(evidence.direction, front.direction(), 1e-6);
        }
        // The front that the script gives takes precedence.
        let given = Asset { front: Some(Front::MinusX), ..(*asset).clone() };
        assert_eq!(given.front(), Front::MinusX);
        assert_ne!(given.content_hash(), asset.content_hash());
    }
    assert_eq!(Facing::of(&figure().skeleton, &[]), Facing::default());
}

#[test]
fn model_front_falls_back_to_clip_travel_and_to_plus_z_on_contradiction() {
    // Its hips go along +X: alone they slide, on four limbs they walk.
    let f = figure();
    let along = &f.clips[ALONG_X..=ALONG_X];
    assert_eq!(Facing::of(&f.skeleton, along), Facing::default());
    let swing =
        |joint| curve(joint, Path::Rotation, &[(0.0, &[0.0, 0.0, 0.0, 1.0]), (1.0, &[0.6, 0.0, 0.0, 0.8])]);
    let curves = along[0].curves().iter().cloned().chain((1..5).map(swing)).collect();
    let facing = Facing::of(&f.skeleton, &[clip("walk", 5, curves)]);
    assert_eq!((facing.front, facing.evidence[0].part), (Front::PlusX, "travel of clips"));
    let old = character_facing(Front::MinusZ).skeleton.clone();
    let mut rest = old.rest().to_vec();
    // Eyes and knees at the back: two against two.
    [3, 4].iter().for_each(|eye: &usize| rest[*eye].translation.z = -0.08);
    [6, 10].iter().for_each(|knee: &usize| rest[*knee].translation.z = -0.03);
    [7, 11].iter().for_each(|foot: &usize| rest[*foot].translation.z = 0.03);
    let torn = Skeleton::new(old.names().to_vec(), old.parents().to_vec(), rest).unwrap();
    let facing = Facing::of(&torn, &[]);
    assert_eq!((facing.front, facing.doubtful), (Front::PlusZ, true), "{facing:?}");
}

#[test]
fn models_with_any_front_walk_and_look_forward() {
    for (name, front) in Front::ALL {
        let mut stage = Stage::default();
        stage.cast("anna", character_facing(front));
        stage.cast("goal", Arc::new(Asset::default()));
        stage.actors[1].transform = Placement::at(3.0, 0.0, -2.0);
        stage.actors[0].face = Some(1);
        assert_close(world_front(&stage, 0.0), v(3.0, 0.0, -2.0).normalize(), 1e-12);
        stage.actors[0].face = None;
        let path = choreo_stage::Path::new(vec![DVec3::ZERO, v(5.0, 0.0, 5.0)], false).unwrap();
        let pace = Pace::Constant(1.0);
        stage.actors[0].path_following =
            Some(Arc::new(PathFollowing { path, start: Time::ZERO, pace, turns: true }));
        assert_close(world_front(&stage, 1.0), v(1.0, 0.0, 1.0).normalize(), 1e-9);
        stage.actors[0].path_following = None;
        // 0.5 rad to the side of ahead: the head turns there, and not to behind.
        let head = v(0.0, 1.6, 0.0);
        let way = glam::DQuat::from_rotation_y(front.yaw_rad() + 0.5) * DVec3::Z;
        stage.actors[0].look_at.push(LookAt::new(2, Target::Point(head + way * 2.0)));
        let snapshot = stage.at(Time::ZERO).unwrap();
        let eyes = (joint_world(&snapshot, 0, 3) + joint_world(&snapshot, 0, 4)) * 0.5 - head;
        assert_close(eyes.with_y(0.0).normalize(), way, 1e-5);
        assert!(eyes.dot(way) > 0.0, "{name}");
    }
}
