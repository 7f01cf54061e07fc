//! Camera rigs, cuts and framing, in cases that scripts cannot express; other cases are in `tests/suite/cameras`.

use crate::support::*;
use choreo_asset::*;
use choreo_motion::{Interpolation, Time};
use choreo_stage::*;
use glam::{DQuat, DVec3, Vec3};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

fn camera_position(snapshot: &Snapshot) -> DVec3 {
    snapshot.camera.world_from_view.translation
}
fn view_direction(snapshot: &Snapshot) -> DVec3 {
    -snapshot.camera.world_from_view.matrix3.z_axis
}
fn camera_up(snapshot: &Snapshot) -> DVec3 {
    snapshot.camera.world_from_view.matrix3.y_axis
}

fn stage_with_camera(rig: Rig) -> Stage {
    let mut stage = Stage::default();
    stage.cast("anna", figure());
    stage.shoot(Camera::new("c", rig));
    assert_eq!(stage.check().len(), 0, "{:?}", stage.check());
    stage
}

#[track_caller]
fn rotation_is_sound(snapshot: &Snapshot) {
    let m = snapshot.camera.world_from_view.matrix3;
    assert!(
        (m.determinant() - 1.0).abs() < 1e-9 && (m * m.transpose()).abs_diff_eq(glam::DMat3::IDENTITY, 1e-9)
    );
}

#[test]
fn look_at_straight_down_up_and_at_its_own_position_is_finite() {
    for (below, picture_up) in [(v(0.0, -3.0, 0.0), v(0.0, 0.0, -1.0)), (v(0.0, 3.0, 0.0), v(0.0, 0.0, 1.0))]
    {
        let position = v(5.0, 0.0, 5.0);
        let look_at = Some(Target::Point(position + below));
        let stage = stage_with_camera(Rig::Fixed { position, rotation: DQuat::IDENTITY, look_at });
        let snapshot = stage.at(Time::ZERO).unwrap();
        assert_close(view_direction(&snapshot), below / 3.0, 1e-12);
        assert_close(camera_up(&snapshot), picture_up, 1e-12);
        rotation_is_sound(&snapshot);
    }
    let rotation = DQuat::from_rotation_y(1.0);
    let look_at = Some(Target::Point(v(1.0, 2.0, 3.0)));
    let stage = stage_with_camera(Rig::Fixed { position: v(1.0, 2.0, 3.0), rotation, look_at });
    assert_close(view_direction(&stage.at(Time::ZERO).unwrap()), rotation * DVec3::NEG_Z, 1e-9);
    let stage = stage_with_camera(Rig::Follow { target: Target::Actor(0), offset: DVec3::ZERO });
    rotation_is_sound(&stage.at(Time::ZERO).unwrap());
}

#[test]
fn camera_of_a_file_follows_its_node() {
    let f = figure();
    let mut stage = stage_with_camera(Rig::File { actor: 0, camera: 0 });
    stage.actors[0].transform =
        Placement { scale: DVec3::splat(2.0), ..Placement::at(0.0, 0.0, 7.0).turned(FRAC_PI_2) };
    stage.play(0, Cue { repeat: Repeat::Once, ..Cue::new(f.clips[NOD].clone()) });
    let snapshot = stage.at(secs(1.0)).unwrap();
    assert_close(camera_position(&snapshot), v(0.0, 3.2, 7.0), 1e-6);
    let yaw = FRAC_PI_2 + 40f64.to_radians();
    assert_close(view_direction(&snapshot), -v(yaw.sin(), 0.0, yaw.cos()), 1e-6);
    rotation_is_sound(&snapshot);
    // Distances of the file are in its own units.
    let Projection::Perspective { yfov, near, far } = snapshot.camera.projection else { panic!() };
    assert!(yfov == 0.9 && (near - 0.2).abs() < 1e-6 && (far.unwrap() - 100.0).abs() < 1e-4);
}

#[test]
fn near_plane_set_by_the_script_is_kept_by_every_rig() {
    let target = Target::Point(v(0.0, 0.0, 0.0));
    let rigs = [
        Rig::Fixed { position: v(0.0, 0.0, 3.0), rotation: DQuat::IDENTITY, look_at: Some(target) },
        Rig::Follow { target, offset: v(0.0, 0.0, 3.0) },
        Rig::Orbit { target, distance: 3.0, elevation: 0.0, azimuth: 0.0, speed: 0.0 },
    ];
    for rig in rigs {
        let mut stage = stage_with_camera(rig);
        let near = |stage: &Stage| match stage.at(Time::ZERO).unwrap().camera.projection {
            Projection::Perspective { near, .. } => near,
            Projection::Orthographic { .. } => panic!(),
        };
        // Not set: a hundredth of the distance, where that is nearer.
        assert!((near(&stage) - 0.03).abs() < 1e-6, "{}", near(&stage));
        let field = Camera::field("near").unwrap();
        (field.set)(&mut stage.cameras[0], FieldValue::Number(2.0));
        assert_eq!(near(&stage), 2.0);
    }
}

#[test]
fn camera_cuts_keys_and_callbacks_apply_at_their_times() {
    let mut stage =
        stage_with_camera(Rig::Fixed { position: DVec3::ZERO, rotation: DQuat::IDENTITY, look_at: None });
    let target = Target::Point(DVec3::ZERO);
    stage.shoot(Camera::new(
        "orbit",
        Rig::Orbit { target, distance: 1.0, elevation: 0.0, azimuth: 0.0, speed: 0.0 },
    ));
    stage.cuts = vec![Cut::new(secs(1.0), 1), Cut::new(secs(2.0), 0)];
    let on = |stage: &Stage, t: f64| stage.at(secs(t)).unwrap().camera.camera;
    for (t, camera) in [(-1.0, 0), (0.999, 0), (1.0, 1), (1.999, 1), (2.0, 0), (99.0, 0)] {
        assert_eq!(on(&stage, t), Some(camera), "at {t}");
    }
    let linear = |property, values: &[f64]| Channel {
        property,
        interpolation: Interpolation::Linear,
        times: vec![secs(0.0), secs(1.0)],
        values: values.to_vec(),
    };
    stage.cameras[0].channels = vec![
        linear(Property::Translation, &[0.0, 0.0, 0.0, 2.0, 0.0, 0.0]),
        linear(Property::FieldOfView, &[0.5, 1.5]),
    ];
    assert_eq!(stage.check().len(), 0);
    let snapshot = stage.at(secs(0.5)).unwrap();
    assert_close(camera_position(&snapshot), v(1.0, 0.0, 0.0), 1e-12);
    assert!(matches!(
        snapshot.camera.projection,
        Projection::Perspective { yfov: 1.0, near: 0.05, far: None }
    ));
    #[derive(Debug)]
    struct Callback;
    impl FrameCallback for Callback {
        fn run(&self, _: Time, edits: &mut FrameEdits) -> Result<(), StageError> {
            edits.cameras.push((0, CameraEdit::MoveTo(v(0.0, 0.0, 9.0))));
            edits.cameras.push((7, CameraEdit::MoveTo(v(0.0, 0.0, 9.0))));
            Ok(())
        }
    }
    stage.frame_callbacks.push(std::sync::Arc::new(Callback));
    assert_close(camera_position(&stage.at(secs(0.5)).unwrap()), v(0.0, 0.0, 9.0), 1e-12);
}

/// Largest |x| and |y| of all visible vertices in clip space, which are below 1 inside the image, and the least distance to the camera.
fn projected(stage: &Stage, t: f64) -> (DVec3, f64) {
    let snapshot = stage.at(secs(t)).unwrap();
    let view = snapshot.camera.world_from_view.inverse();
    let aspect = f64::from(stage.settings.size[0]) / f64::from(stage.settings.size[1]);
    let (mut reach, mut nearest) = (DVec3::ZERO, f64::INFINITY);
    for (actor, state) in stage.actors.iter().zip(&snapshot.actors) {
        for instance in posed_meshes(&actor.asset, state) {
            for p in instance.primitives.iter().flat_map(|p| &p.positions) {
                let p = view.transform_point3(*p);
                let at = match snapshot.camera.projection {
                    Projection::Perspective { yfov, near, .. } => {
                        assert!(-p.z > f64::from(near), "clipped: {} m before the eye, near {near}", -p.z);
                        let t = (f64::from(yfov) / 2.0).tan();
                        v(p.x / -p.z / t / aspect, p.y / -p.z / t, 0.0)
                    }
                    Projection::Orthographic { height, near, far } => {
                        assert!((f64::from(near)..f64::from(far)).contains(&-p.z));
                        v(p.x, p.y * aspect, 0.0) / (f64::from(height) / 2.0 * aspect)
                    }
                };
                reach = reach.max(at.abs());
                nearest = nearest.min(-p.z);
            }
        }
    }
    (reach, nearest)
}

#[test]
fn framing_camera_is_static_and_keeps_a_walking_actor_in_the_frame() {
    let f = figure();
    let mut stage = Stage::default();
    stage.cast("anna", f.clone());
    stage.settings.length = secs(4.0);
    stage.play(0, Cue { repeat: Repeat::Once, ..Cue::new(f.clips[ALONG_X].clone()) });
    let first = stage.at(secs(0.0)).unwrap().camera;
    let mut widest: f64 = 0.0;
    for i in 0..=40 {
        let t = i as f64 / 10.0;
        assert_eq!(stage.at(secs(t)).unwrap().camera, first);
        let (reach, _) = projected(&stage, t);
        assert!(reach.max_element() < 0.98, "at {t} s {reach}");
        widest = widest.max(reach.max_element());
    }
    assert!(widest > 0.8, "{widest}");
    // Negative control: with length zero the camera frames only the first frame, and the actor walks out of the image.
    stage.settings.length = Time::ZERO;
    assert!(projected(&stage, 3.9).0.max_element() > 1.0);
}

#[test]
fn framing_ignores_a_large_ground_beside_other_actors() {
    let mut stage = Stage::default();
    stage.cast("anna", figure());
    let without = stage.at(Time::ZERO).unwrap().camera;
    let mut asset = (*stick()).clone();
    let plane = box_primitive(Vec3::new(-50.0, 0.0, -50.0), Vec3::new(50.0, 0.0, 50.0));
    asset.meshes[0] = Arc::new(Mesh { primitives: vec![plane], ..Mesh::default() });
    stage.cast("floor", Arc::new(asset));
    assert_eq!(stage.at(Time::ZERO).unwrap().camera, without);
    // If the ground is the only visible actor, it is framed.
    stage.actors[0].visible = false;
    assert!(camera_position(&stage.at(Time::ZERO).unwrap()).length() > 50.0);
}

#[test]
fn framing_an_empty_stage_gives_a_finite_camera() {
    let mut stage = Stage::default();
    let snapshot = stage.at(Time::ZERO).unwrap();
    assert!(snapshot.camera.world_from_view.is_finite() && snapshot.camera.camera.is_none());
    // The camera frames the space of a person at the origin.
    assert!(
        camera_position(&snapshot).length() < 20.0
            && view_direction(&snapshot).dot(camera_position(&snapshot)) < 0.0
    );
    stage.cast("empty", std::sync::Arc::new(Asset::default()));
    stage.cast("hidden", figure());
    stage.actors[1].visible = false;
    assert_close(camera_position(&stage.at(Time::ZERO).unwrap()), camera_position(&snapshot), 0.0);
}

#[test]
fn near_plane_does_not_clip_a_small_close_target() {
    let mut stage = stage_with_camera(Rig::Follow { target: Target::Actor(0), offset: v(0.0, 0.0, 0.005) });
    stage.actors[0].transform.scale = DVec3::splat(0.001);
    let (reach, nearest) = projected(&stage, 0.0);
    assert!(reach.max_element() < 1.0 && nearest < 0.006);
}

#[test]
fn effect_distance_is_the_depth_of_its_target_for_each_camera() {
    let mut stage = Stage::default();
    let anna = stage.cast("anna", figure());
    stage.actors[anna].transform.translation = v(1.0, 0.0, -4.0);
    stage.actors[anna].visible = false;
    let looking =
        |position, way| Rig::Fixed { position, rotation: DQuat::from_rotation_y(way), look_at: None };
    stage.shoot(Camera::new("along z", looking(v(9.0, 5.0, 6.0), 0.0)));
    stage.shoot(Camera::new("along x", looking(v(-2.0, 0.0, 0.0), -FRAC_PI_2)));
    stage.cuts = vec![Cut { dissolve: secs(1.0), ..Cut::new(secs(1.0), 1) }];
    let distance = |parameter: &str, target, least| EffectDistance {
        parameter: parameter.into(),
        target,
        least,
        most: 100.0,
    };
    let joint = Target::Joint { actor: anna, joint: 2 };
    stage.effects.push(EffectUse {
        parameters: vec![("a".into(), 7.0), ("b".into(), 7.0)],
        distances: vec![distance("a", joint, 0.05), distance("c", joint, 50.0)],
        ..EffectUse::default()
    });
    let value =
        |effects: &[EffectState], name: &str| effects[0].parameters.iter().find(|p| p.0 == name).unwrap().1;
    // The truth: the joint in the world, and the coordinate along the viewing direction.
    let at = |t: f64| {
        let posed = Evaluator::new(Arc::new(stage.clone())).posing_hidden().at(secs(t)).unwrap();
        joint_world(&posed, anna, 2)
    };
    let first = stage.at(secs(0.5)).unwrap();
    assert!((value(&first.effects, "a") - (6.0 - at(0.5).z)).abs() < 1e-9);
    assert_eq!((value(&first.effects, "b"), value(&first.effects, "c")), (7.0, 50.0));
    let mixed = stage.at(secs(1.5)).unwrap();
    assert!((value(&mixed.effects, "a") - (at(1.5).x + 2.0)).abs() < 1e-9);
    let before = mixed.dissolve.unwrap().effects;
    assert!((value(&before, "a") - (6.0 - at(1.5).z)).abs() < 1e-9);
}
