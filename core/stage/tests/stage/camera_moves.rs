//! Looks, shakes, dissolves and callbacks of cameras, against closed forms.

use crate::support::*;
use choreo_asset::Projection;
use choreo_motion::Time;
use choreo_stage::*;
use glam::{DQuat, DVec3};
use std::f64::consts::FRAC_1_SQRT_2;
use std::sync::Arc;

fn view_direction(snapshot: &Snapshot) -> DVec3 {
    -snapshot.camera.world_from_view.matrix3.z_axis
}

fn camera_look(target: Option<DVec3>, start: f64, blend: f64) -> CameraLook {
    CameraLook { target: target.map(Target::Point), start: secs(start), blend: secs(blend) }
}

/// A camera at (0, 2, 0) that looks along −Z.
fn stage_with_camera() -> Stage {
    let mut stage = Stage::default();
    let rig = Rig::Fixed { position: v(0.0, 2.0, 0.0), rotation: DQuat::IDENTITY, look_at: None };
    stage.shoot(Camera::new("c", rig));
    stage
}

#[test]
fn camera_looks_blend_from_target_to_target_and_back() {
    let mut stage = stage_with_camera();
    stage.cameras[0].looks = vec![
        camera_look(Some(v(5.0, 2.0, 0.0)), 1.0, 1.0),
        camera_look(Some(v(0.0, 2.0, 9.0)), 3.0, 0.0),
        camera_look(None, 4.0, 2.0),
    ];
    assert_eq!(stage.check().len(), 0, "{:?}", stage.check());
    let h = FRAC_1_SQRT_2;
    for (t, expected) in [
        (0.999, v(0.0, 0.0, -1.0)),
        // Half of the blend is half of the way.
        (1.5, v(h, 0.0, -h)),
        (2.0, v(1.0, 0.0, 0.0)),
        (2.999, v(1.0, 0.0, 0.0)),
        (3.0, v(0.0, 0.0, 1.0)),
        (6.0, v(0.0, 0.0, -1.0)),
    ] {
        assert_close(view_direction(&stage.at(secs(t)).unwrap()), expected, 1e-6);
    }
}

#[test]
fn camera_pan_keeps_the_horizon_level_and_is_continuous() {
    let mut stage = stage_with_camera();
    // Down to the right, then up to the left: a shortest rotation between them would roll.
    stage.cameras[0].looks =
        vec![camera_look(Some(v(4.0, 0.0, -2.0)), 0.0, 0.0), camera_look(Some(v(-4.0, 5.0, 1.0)), 1.0, 1.0)];
    let at = |t: f64| stage.at(secs(t)).unwrap().camera.world_from_view.matrix3;
    let mut before = at(1.0);
    let mut turned = 0.0f64;
    for i in 1..=100 {
        let now = at(1.0 + f64::from(i) * 0.01);
        assert!(now.x_axis.y.abs() < 1e-9 && now.y_axis.y > 0.0, "rolled at step {i}: {now}");
        let step = before.z_axis.angle_between(now.z_axis);
        turned += step;
        // An ease of 1 s is at most 1.5 times as fast as its mean; leveling turns a little more.
        let whole = (DQuat::from_mat3(&now) * DQuat::from_mat3(&before).inverse()).to_axis_angle().1;
        let whole = whole.min(std::f64::consts::TAU - whole);
        assert!(step < 0.05 && whole < 0.1, "a jump of {step}, {whole} rad at step {i}");
        before = now;
    }
    let whole = at(1.0).z_axis.angle_between(at(2.0).z_axis);
    // Nearly on the shortest way.
    assert!(turned >= whole - 1e-3 && turned < 1.05 * whole, "{turned} of {whole}");
}

#[test]
fn camera_look_follows_a_moving_joint_of_a_hidden_actor() {
    let mut stage = stage_with_camera();
    let f = figure();
    stage.cast("anna", f.clone());
    stage.actors[0].visible = false;
    stage.play(0, Cue { repeat: Repeat::Once, ..Cue::new(f.clips[ALONG_X].clone()) });
    let target = Some(Target::Joint { actor: 0, joint: HIPS });
    stage.cameras[0].looks = vec![CameraLook { target, start: Time::ZERO, blend: Time::ZERO }];
    let snapshot = stage.at(secs(3.0)).unwrap();
    assert_close(view_direction(&snapshot), v(3.0, -2.0, 0.0).normalize(), 1e-6);
    // A near plane that is not set does not clip a close target away.
    let Projection::Perspective { near, .. } = snapshot.camera.projection else { panic!() };
    assert!((f64::from(near) - 0.01 * 13f64.sqrt()).abs() < 1e-6, "{near}");
}

fn shake() -> CameraShake {
    CameraShake {
        start: secs(1.0),
        end: Some(secs(21.0)),
        fade: secs(0.5),
        angle: 0.02,
        shift: 0.1,
        frequency: 3.0,
        seed: 7,
    }
}

/// Pan and tilt of a camera that looks along −Z.
fn pan_and_tilt(snapshot: &Snapshot) -> [f64; 2] {
    let way = view_direction(snapshot);
    [(-way.x).atan2(-way.z), way.y.asin()]
}

#[test]
fn camera_shake_stays_in_its_amplitude_and_is_smooth() {
    let mut stage = stage_with_camera();
    stage.cameras[0].shakes = vec![shake()];
    assert_eq!(stage.check().len(), 0);
    let still = stage_with_camera().at(secs(0.5)).unwrap().camera;
    for t in [0.5, 1.0, 21.0, 30.0] {
        assert_eq!(stage.at(secs(t)).unwrap().camera, still, "at {t}");
    }
    let step = 0.001;
    let (mut before, mut squares, mut sums) = ([0.0; 2], [0.0; 2], [0.0; 2]);
    let count = 16_000;
    for i in 0..count {
        let snapshot = stage.at(secs(2.0 + f64::from(i) * step)).unwrap();
        let shift = snapshot.camera.world_from_view.translation - v(0.0, 2.0, 0.0);
        assert!(shift.abs().max_element() <= 0.1 * 1.05, "{shift}");
        let now = pan_and_tilt(&snapshot);
        for axis in 0..2 {
            assert!(now[axis].abs() <= 0.02 * 1.01, "{now:?}");
            // The quintic of value noise rises by at most 1.875 times the 2 between its values, 2 · 3 Hz times a second.
            let most = 0.02 * 2.0 * 1.875 * 6.0 * step * 1.01;
            assert!(i == 0 || (now[axis] - before[axis]).abs() <= most, "step {i}: {now:?} after {before:?}");
            squares[axis] += now[axis] * now[axis];
            sums[axis] += now[axis];
        }
        before = now;
    }
    for axis in 0..2 {
        let (mean, power) = (sums[axis] / f64::from(count), squares[axis] / f64::from(count));
        // Uniform values have a third of the square of their bound; interpolation takes some of it away.
        let share = power.sqrt() / 0.02;
        assert!(share > 0.35 && share < 0.65 && mean.abs() < 0.005, "axis {axis}: {share} about {mean}");
    }
}

#[test]
fn camera_shake_depends_on_its_seed_and_not_on_the_frame_order() {
    let mut stage = stage_with_camera();
    stage.cameras[0].shakes = vec![shake()];
    let late = stage.at(secs(17.3)).unwrap().content_hash();
    let mut evaluator = Evaluator::new(Arc::new(stage.clone()));
    evaluator.at(secs(3.0)).unwrap();
    assert_eq!(evaluator.at(secs(17.3)).unwrap().content_hash(), late);
    let mut other = stage.clone();
    other.cameras[0].shakes[0].seed = 8;
    assert_ne!(other.content_hash(), stage.content_hash());
    let values = |stage: &Stage| -> Vec<f64> {
        (0..400).map(|i| pan_and_tilt(&stage.at(secs(2.0 + 0.04 * f64::from(i))).unwrap())[0]).collect()
    };
    let (a, b) = (values(&stage), values(&other));
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let correlation = dot(&a, &b) / (dot(&a, &a) * dot(&b, &b)).sqrt();
    assert!(correlation.abs() < 0.3, "{correlation}");
}

#[derive(Debug)]
struct Edits(Vec<(usize, CameraEdit)>);

impl FrameCallback for Edits {
    fn run(&self, _: Time, edits: &mut FrameEdits) -> Result<(), StageError> {
        edits.cameras.extend(self.0.iter().cloned());
        Ok(())
    }
}

#[test]
fn camera_callbacks_aim_turn_and_zoom_for_one_frame() {
    let edited = |edits: Vec<(usize, CameraEdit)>| {
        let mut stage = stage_with_camera();
        stage.frame_callbacks.push(Arc::new(Edits(edits)));
        stage.at(secs(1.0)).unwrap()
    };
    let (camera, target) = (0, Target::Point(v(7.0, 2.0, 0.0)));
    let aimed = (camera, CameraEdit::LookAt(target));
    assert_close(view_direction(&edited(vec![aimed.clone()])), v(1.0, 0.0, 0.0), 1e-12);
    // From where a callback puts it.
    let moved = (camera, CameraEdit::MoveTo(v(7.0, 2.0, 4.0)));
    assert_close(view_direction(&edited(vec![aimed.clone(), moved])), v(0.0, 0.0, -1.0), 1e-12);
    let turned = (camera, CameraEdit::Turn(DQuat::from_rotation_y(0.5)));
    assert_close(view_direction(&edited(vec![aimed, turned])), v(0.5f64.cos(), 0.0, -0.5f64.sin()), 1e-12);
    let zoomed = edited(vec![(camera, CameraEdit::FieldOfView(0.25))]);
    assert!(matches!(
        zoomed.camera.projection,
        Projection::Perspective { yfov: 0.25, near: 0.05, far: None }
    ));
    let flat = edited(vec![(camera, CameraEdit::Height(3.0))]);
    assert!(matches!(flat.camera.projection, Projection::Orthographic { height: 3.0, .. }));
    let other = edited(vec![(1, CameraEdit::FieldOfView(0.25))]);
    assert_eq!(other.camera, stage_with_camera().at(secs(1.0)).unwrap().camera);
}

#[test]
fn dissolve_holds_the_previous_camera_until_it_ends() {
    let mut stage = stage_with_camera();
    let rig = Rig::Fixed { position: v(5.0, 0.0, 0.0), rotation: DQuat::IDENTITY, look_at: None };
    stage.shoot(Camera::new("second", rig.clone()));
    stage.shoot(Camera::new("third", rig));
    let dissolving =
        |at: f64, camera: usize, secs_: f64| Cut { dissolve: secs(secs_), ..Cut::new(secs(at), camera) };
    stage.cuts = vec![dissolving(1.0, 1, 2.0), dissolving(2.5, 2, 0.5), dissolving(4.0, 2, 1.0)];
    let share = |t: f64| {
        let snapshot = stage.at(secs(t)).unwrap();
        let before = snapshot.dissolve.map(|d| (d.camera.camera.unwrap(), d.share));
        (snapshot.camera.camera.unwrap(), before)
    };
    assert_eq!(share(0.9), (0, None));
    assert_eq!(share(1.0), (1, Some((0, 1.0))));
    assert_eq!(share(1.5), (1, Some((0, 0.75))));
    // The next cut ends it; its own dissolve is from the second camera.
    assert_eq!(share(2.5), (2, Some((1, 1.0))));
    assert_eq!(share(2.75), (2, Some((1, 0.5))));
    assert_eq!(share(3.0), (2, None));
    // To the camera that is on already there is nothing to mix.
    assert_eq!(share(4.5), (2, None));
    let snapshot = stage.at(secs(1.5)).unwrap();
    assert_close(snapshot.dissolve.unwrap().camera.world_from_view.translation, v(0.0, 2.0, 0.0), 1e-12);
}
