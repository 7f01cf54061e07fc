//! Extreme cases: far from the origin, zero scale, empty, very late, and invalid on purpose.

use crate::support::*;
use choreo_asset::*;
use choreo_motion::{Interpolation, Time};
use choreo_stage::*;
use glam::{DQuat, DVec3, Vec3};
use std::sync::Arc;

fn messages(stage: &Stage) -> Vec<String> {
    stage.check().iter().map(ToString::to_string).collect()
}

#[test]
fn poses_and_cameras_10000_km_away_equal_those_at_the_origin() {
    let f = figure();
    let near = |origin: DVec3| {
        let mut stage = Stage::default();
        stage.cast("anna", f.clone());
        stage.cast("sword", stick());
        stage.play(0, Cue::new(f.clips[RAISE].clone()));
        stage.actors[0].transform.translation = origin;
        stage.actors[0].look_at.push(LookAt::new(HEAD, Target::Point(origin + v(1.0, 1.0, 1.0))));
        stage.actors[1].parents = vec![Parenting::always(Attachment { actor: 0, joint: Some(HAND) })];
        let target = Target::Joint { actor: 0, joint: HAND };
        stage.shoot(Camera::new("c", Rig::Follow { target, offset: v(0.0, 0.3, 2.0) }));
        stage.at(secs(0.7)).unwrap()
    };
    let (here, there) = (near(DVec3::ZERO), near(v(1e7, 0.0, -1e7)));
    for (a, b) in here.actors.iter().zip(&there.actors) {
        let moved = b.world_from_model.translation - v(1e7, 0.0, -1e7);
        assert_close(moved, a.world_from_model.translation, 1e-8);
        for (a, b) in a.model_from_joint.iter().zip(&b.model_from_joint) {
            assert!(a.abs_diff_eq(*b, 1e-6), "{a} {b}");
        }
    }
    let eye = |s: &Snapshot| s.camera.world_from_view.translation;
    assert_close(eye(&there) - v(1e7, 0.0, -1e7), eye(&here), 1e-8);
}

#[test]
fn looped_clip_is_exact_after_100_hours_and_finite_at_extreme_times() {
    let f = figure();
    let mut stage = Stage::default();
    stage.cast("anna", f.clone());
    stage.play(0, Cue { start: secs(0.25), ..Cue::new(f.clips[ALONG_X].clone()) });
    // 360 000 s = 90 000 rounds of 4 s, and 1.25 s − 0.25 s.
    let hips = joint_world(&stage.at(secs(360_001.25)).unwrap(), 0, HIPS);
    assert_close(hips, v(1.0, 0.0, 0.0), 1e-6);
    for time in [Time(i64::MIN), Time(i64::MAX), Time(-1)] {
        assert!(joint_world(&stage.at(time).unwrap(), 0, HIPS).is_finite());
    }
}

#[test]
fn scale_of_zero_gives_finite_transforms() {
    let mut stage = Stage::default();
    stage.cast("anna", figure());
    stage.cast("sword", stick());
    stage.actors[0].transform.scale = DVec3::ZERO;
    stage.actors[0].transform.translation = v(1.0, 2.0, 3.0);
    stage.actors[0].look_at.push(LookAt::new(HEAD, Target::Point(v(4.0, 4.0, 4.0))));
    stage.actors[1].parents = vec![Parenting::always(Attachment { actor: 0, joint: Some(HAND) })];
    stage.actors[1].face = Some(0);
    let mut lamp = StageLight::sun("lamp", Vec3::X, 1.0);
    lamp.parent = Some(Attachment { actor: 0, joint: None });
    stage.lights.push(lamp);
    let eyes = stage.shoot(Camera::new("eyes", Rig::File { actor: 0, camera: 0 }));
    let frame = stage.shoot(Camera::new("frame", Rig::Frame { azimuth: 0.0, elevation: 0.0 }));
    for camera in [eyes, frame] {
        stage.cuts = vec![Cut::new(Time::ZERO, camera)];
        let snapshot = stage.at(secs(1.0)).unwrap();
        assert!(snapshot.camera.world_from_view.is_finite(), "{:?}", snapshot.camera);
        assert!((snapshot.camera.world_from_view.matrix3.determinant() - 1.0).abs() < 1e-9);
        assert!(snapshot.actors.iter().all(|a| a.world_from_model.is_finite()));
        assert!(snapshot.actors.iter().flat_map(|a| &a.model_from_joint).all(|m| m.is_finite()));
        assert_eq!(snapshot.lights[0].direction, Vec3::X, "scale is not handed down");
    }
}

#[test]
fn empty_stage_asset_layer_and_clip_are_valid() {
    let mut stage = Stage::default();
    assert!(stage.check().is_empty());
    stage.at(Time::ZERO).unwrap();
    stage.cast("nothing", Arc::new(Asset::default()));
    stage.actors[0].layers.push(Layer::default());
    stage.play(0, Cue::new(clip("nothing", 0, vec![])));
    let snapshot = stage.at(secs(1.0)).unwrap();
    assert!(snapshot.actors[0].model_from_joint.is_empty());
    assert!(stage.check().is_empty(), "{:?}", messages(&stage));
}

/// Makes one thing wrong in a stage that is right.
type Fault = fn(&mut Stage);

#[test]
fn check_reports_each_planted_fault_and_evaluation_does_not_panic() {
    let sound = || {
        let f = figure();
        let mut stage = Stage::default();
        stage.cast("anna", f.clone());
        stage.play(0, Cue::new(f.clips[RAISE].clone()));
        stage.shoot(Camera::new("c", Rig::Frame { azimuth: 0.0, elevation: 0.0 }));
        stage.lights.push(StageLight::sun("sun", Vec3::NEG_Y, 1.0));
        stage.actors[0].channels.push(Channel {
            property: Property::Translation,
            interpolation: Interpolation::Linear,
            times: vec![secs(0.0), secs(1.0)],
            values: vec![0.0; 6],
        });
        stage
    };
    assert!(messages(&sound()).is_empty());
    let faults: [(Fault, &str); 30] = [
        (|s| s.settings.size[0] = 0, "settings: size is 0 x 720 pixels, each must be 1 to 16384"),
        (|s| s.settings.fps.den = 0, "settings: fps is 30/0, must be positive"),
        (|s| s.settings.samples = Some(2), "settings: samples is 2, must be 1 or 4"),
        (
            |s| s.settings.ambient_up.x = f32::NAN,
            "settings: ambient light from above is [NaN, 0.45, 0.45], must be finite",
        ),
        (
            |s| s.actors[0].transform.translation.x = f64::NAN,
            "actor \"anna\": position is [NaN, 0, 0], must be finite",
        ),
        (
            |s| s.actors[0].transform.scale.y = f64::INFINITY,
            "actor \"anna\": scale is [1, inf, 1], must be finite",
        ),
        (
            |s| s.actors[0].transform.rotation = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0),
            "actor \"anna\": rotation has length 0, must be 1",
        ),
        (
            |s| s.actors[0].parents = vec![Parenting::always(Attachment { actor: 9, joint: None })],
            "actor \"anna\": parent actor 9 does not exist (count: 1)",
        ),
        (|s| s.actors[0].face = Some(0), "actor \"anna\": faces itself"),
        (|s| s.actors[0].face = Some(4), "actor \"anna\": faced actor 4 does not exist (count: 1)"),
        (
            |s| s.actors[0].layers[0].mask = Some(Arc::new(vec![1.0])),
            "actor \"anna\", layer 0: the number of mask weights is 1, must be that of joints, 5",
        ),
        (
            |s| s.actors[0].layers[0].cues[0].speed = f64::NAN,
            "actor \"anna\", layer 0, cue 0 (\"raise\"): `Playback.speed` is NaN, must be finite",
        ),
        (
            |s| s.actors[0].layers[0].cues[0].weight = 1.5,
            "actor \"anna\", layer 0, cue 0 (\"raise\"): weight is 1.5, must be from 0 to 1",
        ),
        (
            |s| s.actors[0].layers[0].cues[0].fade_in = secs(-1.0),
            "actor \"anna\", layer 0, cue 0 (\"raise\"): fade is -1 s, must not be negative",
        ),
        (
            |s| s.actors[0].layers[0].cues[0].end = Some(secs(-1.0)),
            "actor \"anna\", layer 0, cue 0 (\"raise\"): ends at -1 s, before it starts at 0 s",
        ),
        (
            |s| s.actors[0].layers[0].cues[0].clip = clip("other", 2, vec![]),
            "actor \"anna\", layer 0, cue 0 (\"other\"): the clip is for a skeleton of 2 joints, the actor's has 5; bind it first",
        ),
        (
            |s| {
                let late = s.actors[0].layers[0].cues[0].clone();
                s.actors[0].layers[0].cues.insert(0, Cue { start: secs(5.0), ..late })
            },
            "actor \"anna\", layer 0, cue 1 (\"raise\"): starts before the cue before it; sort by start",
        ),
        (
            |s| s.actors[0].look_at.push(LookAt::new(77, Target::Point(DVec3::ZERO))),
            "actor \"anna\", look_at: joint 77 does not exist (count: 5)",
        ),
        (
            |s| s.actors[0].look_at.push(LookAt::new(2, Target::Point(DVec3::NAN))),
            "actor \"anna\", look_at: the target is [NaN, NaN, NaN], must be finite",
        ),
        (
            |s| s.actors[0].morphs.push((0, 3, 1.0)),
            "actor \"anna\": morph target 3 does not exist (count: 0)",
        ),
        (
            |s| s.actors[0].channels[0].values[1] = f64::NAN,
            "actor \"anna\", keys of Translation: a key has a value that is not finite",
        ),
        (
            |s| {
                s.actors[0].channels[0].values.pop();
            },
            "actor \"anna\", keys of Translation: the number of values is 5, must be 6 for the number of keys, 2",
        ),
        (
            |s| s.actors[0].channels[0].times[1] = secs(0.0),
            "actor \"anna\", keys of Translation: key times must increase",
        ),
        (
            |s| {
                let c = s.actors[0].channels[0].clone();
                s.cameras[0].channels.push(c)
            },
            "camera \"c\", keys of Translation: this property cannot be keyed here",
        ),
        (
            |s| s.cameras[0].projection = Projection::Perspective { yfov: 0.0, near: 0.1, far: None },
            "camera \"c\": field of view is 0 rad, must be above 0 and below π",
        ),
        (
            |s| s.cameras[0].rig = Rig::File { actor: 0, camera: 8 },
            "camera \"c\": camera of the file 8 does not exist (count: 1)",
        ),
        (|s| s.cuts.push(Cut::new(secs(1.0), 3)), "cut 0 at 1 s: camera 3 does not exist (count: 1)"),
        (|s| s.lights[0].direction = Vec3::ZERO, "light \"sun\": direction has length 0, must be 1"),
        (
            |s| s.lights[0].light.intensity = f32::NAN,
            "light \"sun\": intensity is NaN, must be from 0 to 1000000000",
        ),
        (
            |s| s.lights[0].light.kind = LightKind::Spot { inner: 0.5, outer: 0.2 },
            "light \"sun\": cone is 0.5 to 0.2 rad, must be 0 ≤ inner < outer ≤ π/2",
        ),
    ];
    for (fault, message) in faults {
        let mut stage = sound();
        fault(&mut stage);
        assert_eq!(messages(&stage), [message]);
        // The result does not matter, but evaluation must not panic.
        let _ = stage.at(secs(0.5));
    }
}

/// Found by the fuzz target `timeline`: the framing camera stood at NaN.
#[test]
fn framing_camera_stays_finite_at_extreme_distances() {
    for far in [1e20, 1e150, 1e300, f64::MAX] {
        let mut stage = Stage::default();
        for (name, x) in [("near", 0.0), ("far", far), ("farther", -far)] {
            let actor = stage.cast(name, figure());
            stage.actors[actor].transform.translation = v(x, x, 0.0);
        }
        let camera = stage.at(secs(0.0)).unwrap().camera;
        assert!(camera.world_from_view.is_finite(), "{far:e}: {camera:?}");
        let Projection::Perspective { near, .. } = camera.projection else { panic!("{camera:?}") };
        assert!(near.is_finite() && near > 0.0, "{far:e}: {near}");
    }
}
