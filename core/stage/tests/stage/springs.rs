//! Springs of a stage, whose frames can be evaluated in any order, at any rate and on any thread.

use crate::support::*;
use choreo_asset::*;
use choreo_motion::spring::{RigBone, SpringBone};
use choreo_motion::{Path, Time};
use choreo_stage::*;
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// A dog that runs to and fro, with a tail of four joints.
fn dog_asset() -> Arc<Asset> {
    let skeleton = skeleton(&[
        ("Hips", None, at(0.0, 1.0, 0.0)),
        ("Tail1", Some(0), at(0.0, 0.0, -0.2)),
        ("Tail2", Some(1), at(0.0, 0.0, -0.1)),
        ("Tail3", Some(2), at(0.0, 0.0, -0.1)),
        ("Tip", Some(3), at(0.0, 0.0, -0.1)),
    ]);
    let run = |z: f32| [0.0, 1.0, z];
    let keys: [(f64, &[f32]); 3] = [(0.0, &run(0.0)), (0.5, &run(1.0)), (1.0, &run(0.0))];
    let clips = vec![clip("run", 5, vec![curve(0, Path::Translation, &keys)])];
    Arc::new(Asset { name: "dog".into(), skeleton, clips, ..Asset::default() })
}

fn tail_springs() -> ActorSprings {
    let rig = spring_rig(1..4, Vec3::NEG_Z * 0.1);
    ActorSprings { rig, ..ActorSprings::default() }
}

fn dog_stage() -> Stage {
    let mut stage = Stage::default();
    let dog = dog_asset();
    let rex = stage.cast("rex", dog.clone());
    stage.play(rex, Cue::new(dog.clips[0].clone()));
    stage.actors[rex].springs = Some(Arc::new(tail_springs()));
    stage.actors[rex].transform = Placement::at(1.0, 0.0, 2.0).turned(0.4);
    stage
}

#[test]
fn springs_of_a_frame_evaluated_alone_equal_those_after_playback() {
    let stage = Arc::new(dog_stage());
    let time = |frame: i64| choreo_motion::FrameRate { num: 30, den: 1 }.time_of(frame);
    let mut player = Evaluator::new(stage.clone());
    let mut played = Snapshot::default();
    for frame in 0..=4000 {
        player.at_into(time(frame), &mut played).unwrap();
    }
    let alone = stage.at(time(4000)).unwrap();
    assert_eq!(played.content_hash(), alone.content_hash());
    // The springs have an effect: without them the joint is elsewhere.
    let mut still = (*stage).clone();
    still.actors[0].springs = None;
    let off = joint_world(&alone, 0, 4) - joint_world(&still.at(time(4000)).unwrap(), 0, 4);
    assert!(off.length() > 0.02, "{off}");
}

#[test]
fn springs_are_bit_identical_at_any_frame_rate_order_and_thread() {
    let stage = Arc::new(dog_stage());
    let times: Vec<Time> = [0.0, 0.1, 1.0 / 3.0, 0.5, 1.25, 2.0, 7.3, 7.31].map(secs).to_vec();
    let alone: Vec<_> = times.iter().map(|t| stage.at(*t).unwrap().content_hash()).collect();
    for fps in [12, 24, 30, 60, 144] {
        let mut player = Evaluator::new(stage.clone());
        let rate = choreo_motion::FrameRate { num: fps, den: 1 };
        let mut next = 0;
        for (time, expected) in times.iter().zip(&alone) {
            while rate.time_of(next) < *time {
                player.at(rate.time_of(next)).unwrap();
                next += 1;
            }
            assert_eq!(player.at(*time).unwrap().content_hash(), *expected, "{fps} fps, {time:?}");
        }
    }
    let shared = Evaluator::new(stage.clone());
    std::thread::scope(|scope| {
        for thread in 0..4 {
            let (mut eyes, times, alone) = (shared.clone(), &times, &alone);
            scope.spawn(move || {
                for i in 0..3 * times.len() {
                    let i = (i * 5 + thread * 3) % times.len();
                    assert_eq!(eyes.at(times[i]).unwrap().content_hash(), alone[i], "thread {thread}");
                }
            });
        }
    });
    // Before time 0 the springs are at rest.
    let early = |t: f64| joint_world(&stage.at(secs(t)).unwrap(), 0, 4);
    assert_close(early(-5.0), early(-0.01), 1e-9);
}

#[test]
fn springs_start_at_rest_unless_a_pre_roll_simulates_earlier_time() {
    let mut stage = dog_stage();
    stage.actors[0].layers.clear();
    let tip = |stage: &Stage, t: f64| joint_world(&stage.at(secs(t)).unwrap(), 0, 4);
    for t in [0.1, 1.0, 3.0] {
        assert_close(tip(&stage, t), tip(&stage, 0.0), 1e-6);
    }
    // A clip that runs before time 0 swings the tail at time 0, but only with a pre-roll.
    let dog = dog_asset();
    stage.play(0, Cue { start: secs(-3.0), ..Cue::new(dog.clips[0].clone()) });
    let settled = tip(&stage, 0.0);
    stage.actors[0].springs = Some(Arc::new(ActorSprings { pre_roll: secs(2.0), ..tail_springs() }));
    assert!((tip(&stage, 0.0) - settled).length() > 0.01);
}

#[test]
fn springs_of_a_child_actor_follow_the_springs_of_its_parent() {
    let mut stage = dog_stage();
    let bell = stage.cast("bell", dog_asset());
    stage.actors[bell].parents = vec![Parenting::always(Attachment { actor: 0, joint: Some(4) })];
    stage.actors[bell].springs = Some(Arc::new(tail_springs()));
    let snapshot = stage.at(secs(2.2)).unwrap();
    // The bell is at the tip that the springs have moved.
    assert_close(snapshot.actors[bell].world_from_model.translation, joint_world(&snapshot, 0, 4), 1e-9);
    let mut eyes = Evaluator::new(Arc::new(stage.clone()));
    for i in 0..=66 {
        eyes.at(secs(f64::from(i) / 30.0)).unwrap();
    }
    assert_eq!(eyes.at(secs(2.2)).unwrap().content_hash(), snapshot.content_hash());
}

#[test]
fn wind_moves_springs_and_callbacks_override_it() {
    #[derive(Debug)]
    struct Gust;
    impl FrameCallback for Gust {
        fn run(&self, time: Time, edits: &mut FrameEdits) -> Result<(), StageError> {
            let wind = if time < secs(1.0) { DVec3::ZERO } else { DVec3::X * 10.0 };
            edits.actors.push((0, ActorEdit::Wind(wind)));
            Ok(())
        }
    }
    let mut stage = dog_stage();
    stage.actors[0].layers.clear();
    stage.actors[0].transform = Placement::default();
    let x = |stage: &Stage, t: f64| joint_world(&stage.at(secs(t)).unwrap(), 0, 4).x;
    assert!(x(&stage, 1.0).abs() < 1e-6);
    stage.frame_callbacks.push(Arc::new(Gust));
    assert!(x(&stage, 0.9).abs() < 1e-6 && x(&stage, 3.0) > 0.05);
    stage.frame_callbacks.clear();
    stage.actors[0].springs = Some(Arc::new(ActorSprings { wind: DVec3::X * 10.0, ..tail_springs() }));
    assert!((x(&stage, 0.0) - x(&stage, 3.0)).abs() < 1e-6 && x(&stage, 0.0) > 0.05);
}

#[test]
fn springs_stay_exact_at_100_hours_and_continuous_between_stretches() {
    let stage = Arc::new(dog_stage());
    let tip = |eyes: &mut Evaluator, t: f64| joint_world(&eyes.at(secs(t)).unwrap(), 0, 4);
    let mut eyes = Evaluator::new(stage.clone());
    let late = tip(&mut eyes, 360_000.25);
    assert!(late.is_finite());
    // The clip lasts a second: the same motion as after ten minutes, which is another stretch.
    assert_close(late, tip(&mut eyes, 700.25), 1e-6);
    // The motion is continuous where two stretches meet.
    let (before, at) = (tip(&mut eyes, 600.0 - 1e-9), tip(&mut eyes, 600.0));
    assert_close(before, at, 1e-6);
}

#[test]
fn undamped_spring_keeps_its_amplitude_between_stretches() {
    let mut stage = dog_stage();
    let mut undamped = tail_springs();
    undamped.rig.retain(|joint| joint == 1);
    // A step is exact without a load; a load's pull is approximated by a spring at each step.
    let swings = |b: &mut RigBone| (b.spring, b.gravity) = (SpringBone::new(2.5, 0.0), DVec3::ZERO);
    undamped.rig.bones_mut().for_each(swings);
    stage.actors[0].springs = Some(Arc::new(undamped));
    // Shoved once to the side; nothing else drives the tail.
    let keys: [(f64, &[f32]); 2] = [(0.0, &[0.0, 1.0, 0.0]), (0.2, &[0.3, 1.0, 0.0])];
    let shove = clip("shove", 5, vec![curve(0, Path::Translation, &keys)]);
    stage.actors[0].layers[0].cues[0] = Cue { repeat: Repeat::Once, ..Cue::new(shove) };
    let mut eyes = Evaluator::new(Arc::new(stage));
    // How far the tip moves within a second.
    let mut swing = |from: f64| {
        let places: Vec<DVec3> =
            (0..60).map(|i| joint_world(&eyes.at(secs(from + f64::from(i) / 60.0)).unwrap(), 0, 4)).collect();
        places.iter().map(|p| p.distance(places[0])).fold(0.0, f64::max)
    };
    let (before, after) = (swing(598.0), swing(601.0));
    assert!(before > 0.01 && (after - before).abs() < 0.2 * before, "{before} m, then {after} m");
}

#[test]
fn seek_evaluates_one_pose_without_springs_and_reuses_checkpoints_with_springs() {
    let mut stage = dog_stage();
    stage.actors[0].springs = None;
    let mut eyes = Evaluator::new(Arc::new(stage.clone()));
    eyes.at(secs(100.0)).unwrap();
    assert_eq!(eyes.total_poses(), 1);
    stage.actors[0].springs = Some(Arc::new(tail_springs()));
    let mut eyes = Evaluator::new(Arc::new(stage));
    eyes.at(secs(100.0)).unwrap();
    assert_eq!(eyes.total_poses(), 6002);
    // A seek back goes on from what was kept, at most 15 steps before.
    eyes.at(secs(50.0)).unwrap();
    assert!(eyes.total_poses() <= 6002 + 17, "{}", eyes.total_poses());
}

/// A stage in which a camera looks at rex until 2 s and again from 4 s on, and between at its back, where `away` is.
fn stage_with_changing_view() -> (Stage, usize) {
    let mut stage = dog_stage();
    let dog = dog_asset();
    let away = stage.cast("away", dog.clone());
    stage.play(away, Cue::new(dog.clips[0].clone()));
    stage.actors[away].springs = Some(Arc::new(tail_springs()));
    stage.actors[away].transform = Placement::at(0.0, 0.0, 40.0);
    let behind = glam::DQuat::from_rotation_y(std::f64::consts::PI);
    for (rotation, at) in [(glam::DQuat::IDENTITY, 0.0), (behind, 2.0), (glam::DQuat::IDENTITY, 4.0)] {
        let rig = Rig::Fixed { position: DVec3::new(1.0, 1.0, 10.0), rotation, look_at: None };
        let camera = stage.shoot(Camera::new("camera", rig));
        stage.cuts.push(Cut::new(secs(at), camera));
    }
    (stage, away)
}

/// Only actors in the image are simulated; one that enters it later moves as if it had been simulated all the time.
#[test]
fn culled_springs_are_not_simulated_and_catch_up_when_visible() {
    let (stage, away) = stage_with_changing_view();
    let stage = Arc::new(stage);
    let mut all = Evaluator::new(stage.clone());
    let mut seen = Evaluator::new(stage.clone()).for_images(16.0 / 9.0);
    let mut poses = 0;
    for frame in 0..180 {
        let time = choreo_motion::FrameRate { num: 30, den: 1 }.time_of(frame);
        let (whole, image) = (all.at(time).unwrap(), seen.at(time).unwrap());
        let in_view = if (60..120).contains(&frame) { away } else { 0 };
        for actor in [0, away] {
            assert_eq!(image.actors[actor].culled, actor != in_view, "frame {frame}");
        }
        assert_eq!(seen.costs(&image).spring_bones, 3, "frame {frame}");
        assert_eq!(all.costs(&whole).spring_bones, 6, "frame {frame}");
        let joints = |snapshot: &Snapshot| snapshot.actors[in_view].model_from_joint.clone();
        assert_eq!(joints(&image), joints(&whole), "frame {frame}");
        if frame == 59 {
            poses = seen.total_poses();
        }
    }
    // A pose of one dog for each step of 1/60 s until the cut, and one for each frame: 119 + 60.
    assert_eq!(poses, 119 + 60);
    // The one that was away makes the steps before the cut when it is first seen, the other one those of two seconds when it comes back.
    assert!(all.total_poses() - seen.total_poses() > 180, "{} {}", all.total_poses(), seen.total_poses());
    // A frame alone, and one after a jump back.
    for at in [3.3, 5.0, 1.2] {
        let in_view = if at == 3.3 { away } else { 0 };
        let joints = |snapshot: Snapshot| snapshot.actors[in_view].model_from_joint.clone();
        let alone = Evaluator::new(stage.clone()).for_images(16.0 / 9.0).at(secs(at)).unwrap();
        let exact = joints(stage.at(secs(at)).unwrap());
        assert_eq!(joints(alone), exact, "{at} s alone");
        assert_eq!(joints(seen.at(secs(at)).unwrap()), exact, "{at} s after others");
    }
}

/// A visible actor on a spring joint of a culled actor needs the springs of that actor, at all earlier times, too.
#[test]
fn springs_of_a_culled_parent_are_simulated_for_visible_children() {
    let (mut stage, away) = stage_with_changing_view();
    let bell = stage.cast("bell", dog_asset());
    stage.actors[bell].springs = Some(Arc::new(tail_springs()));
    let on_tail = Attachment { actor: away, joint: Some(4) };
    // Far from the tail, where the camera looks; on it since 1 s, and from 3 s on somewhere else.
    let mut parent = Parenting::from(Some(on_tail), secs(1.0));
    parent.keep = false;
    stage.actors[bell].parents = vec![parent, Parenting::from(None, secs(3.0))];
    stage.actors[bell].transform = Placement::at(0.0, 0.0, -38.0);
    let stage = Arc::new(stage);
    let whole = stage.at(secs(1.5)).unwrap();
    let mut seen = Evaluator::new(stage.clone()).for_images(16.0 / 9.0);
    let image = seen.at(secs(1.5)).unwrap();
    assert!(!image.actors[bell].culled);
    assert_eq!(image.actors[bell].world_from_model, whole.actors[bell].world_from_model);
    assert_eq!(image.actors[bell].model_from_joint, whole.actors[bell].model_from_joint);
    // rex, the one on whose tail the bell hangs, and the bell.
    assert_eq!(seen.costs(&image).spring_bones, 9);
    // Long after the bell has left the tail, whose owner is out of view again, it still swings as that one has swung it.
    let mut stage = (*stage).clone();
    stage.actors[bell].parents[1] = Parenting { keep: false, ..Parenting::from(None, secs(4.0)) };
    let stage = Arc::new(stage);
    let whole = stage.at(secs(4.1)).unwrap();
    let mut seen = Evaluator::new(stage.clone()).for_images(16.0 / 9.0);
    let image = seen.at(secs(4.1)).unwrap();
    assert!(image.actors[away].culled && !image.actors[bell].culled);
    assert_eq!(image.actors[bell].model_from_joint, whole.actors[bell].model_from_joint);
    assert_eq!(seen.costs(&image).spring_bones, 9);
}

/// A callback may attach an actor with springs to a spring joint of another actor; then both are simulated together.
#[test]
fn springs_attached_by_callbacks_are_simulated_together() {
    #[derive(Debug)]
    struct Hang(usize);
    impl FrameCallback for Hang {
        fn run(&self, time: Time, edits: &mut FrameEdits) -> Result<(), StageError> {
            if (secs(0.5)..secs(1.5)).contains(&time) {
                let parent = Parenting::always(Attachment { actor: self.0, joint: Some(4) });
                edits.actors.push((0, ActorEdit::Attach(parent)));
            }
            Ok(())
        }
    }
    let (mut stage, away) = stage_with_changing_view();
    stage.frame_callbacks.push(Arc::new(Hang(away)));
    let stage = Arc::new(stage);
    let mut player = Evaluator::new(stage.clone());
    let mut seen = Evaluator::new(stage.clone()).for_images(16.0 / 9.0);
    for frame in 0..60 {
        let time = secs(f64::from(frame) / 30.0);
        let (played, image) = (player.at(time).unwrap(), seen.at(time).unwrap());
        assert_eq!(played.content_hash(), stage.at(time).unwrap().content_hash(), "frame {frame}");
        let joints = |snapshot: &Snapshot| snapshot.actors[0].model_from_joint.clone();
        assert_eq!(joints(&image), joints(&played), "frame {frame}");
    }
}

#[test]
fn check_reports_invalid_wind_and_damping_of_springs() {
    let mut stage = dog_stage();
    let mut bad = tail_springs();
    bad.wind = DVec3::NAN;
    bad.rig.bones_mut().for_each(|b| b.spring.damping = -1.0);
    stage.actors[0].springs = Some(Arc::new(bad));
    let contacts: Vec<String> = stage.check().iter().map(ToString::to_string).collect();
    assert_eq!(
        contacts,
        [
            "actor \"rex\", springs: bone of joint 1: damping is -1, must be 0..=1e18",
            "actor \"rex\", springs: the wind is [NaN, NaN, NaN], must be finite"
        ]
    );
}

#[test]
fn release_from_a_spring_joint_is_continuous() {
    let mut stage = dog_stage();
    let bell = stage.cast("bell", stick());
    let on_tail = Attachment { actor: 0, joint: Some(4) };
    stage.actors[bell].parents = vec![Parenting::always(on_tail), Parenting::from(None, secs(0.7))];
    let place = |stage: &Stage, time: Time| stage.at(time).unwrap().actors[bell].world_from_model.translation;
    let mut stiff = stage.clone();
    stiff.actors[0].springs = None;
    let swung = place(&stage, secs(0.7)).distance(place(&stiff, secs(0.7)));
    let jump = place(&stage, secs(0.7)).distance(place(&stage, secs(0.7) + Time(1)));
    assert!(swung > 0.01 && jump < 1e-7, "swung by {swung} m, jumps by {jump} m");
}
