//! Cues that scripts cannot make: masks between 0 and 1, a speed of zero, the fused crossfade, the order of morph weights.
//! Other cases are tested against closed forms in `tests/suite/timeline` and `tests/suite/layers`.

use crate::support::*;
use choreo_asset::*;
use choreo_motion::Time;
use choreo_stage::*;
use std::sync::Arc;

fn cue(asset: &Asset, clip: usize, start: f64, fade_in: f64) -> Cue {
    Cue { start: secs(start), fade_in: secs(fade_in), ..Cue::new(asset.clips[clip].clone()) }
}

fn stage_with_cues(cues: Vec<Cue>) -> Stage {
    let mut stage = Stage::default();
    let anna = stage.cast("anna", figure());
    cues.into_iter().for_each(|cue| stage.play(anna, cue));
    assert_eq!(stage.check().len(), 0, "{:?}", stage.check());
    stage
}

fn hips_position(stage: &Stage, t: f64) -> glam::DVec3 {
    joint_world(&stage.at(secs(t)).unwrap(), 0, HIPS)
}

fn stage_with_layer(base: usize, mask: Option<Vec<f32>>, cues: Vec<Cue>) -> Stage {
    let f = figure();
    let mut stage = stage_with_cues(vec![cue(&f, base, 0.0, 0.0)]);
    stage.actors[0].layers.push(Layer { mask: mask.map(Arc::new), cues, ..Layer::default() });
    assert_eq!(stage.check().len(), 0, "{:?}", stage.check());
    stage
}

#[test]
fn clip_with_speed_zero_holds_its_first_pose() {
    let stage = stage_with_cues(vec![Cue { speed: 0.0, ..cue(&figure(), ALONG_X, 1.0, 0.0) }]);
    assert_close(hips_position(&stage, 9.0), v(0.0, 0.0, 0.0), 1e-6);
}

#[test]
fn layer_mask_weights_joints_and_keeps_those_without_curves() {
    let f = figure();
    let mask = vec![0.0, 1.0, 1.0, 0.5, 1.0];
    let stage = stage_with_layer(ALONG_X, Some(mask), vec![cue(&f, RAISE, 0.0, 0.0)]);
    let snapshot = stage.at(secs(1.0)).unwrap();
    assert_close(joint_world(&snapshot, 0, HIPS), v(1.0, 0.0, 0.0), 1e-5);
    // The arm is at 45° in the clip; halfway from rest is 22.5°.
    let angle = 22.5f64.to_radians();
    let hand = v(1.0 + 0.3 + 0.6 * angle.cos(), 1.4 + 0.6 * angle.sin(), 0.0);
    assert_close(joint_world(&snapshot, 0, HAND), hand, 1e-5);
    // The hips still follow the base without a mask, because the clip does not animate them.
    let stage = stage_with_layer(ALONG_X, None, vec![cue(&f, RAISE, 0.0, 0.0)]);
    assert_close(hips_position(&stage, 1.0), v(1.0, 0.0, 0.0), 1e-5);
}

#[test]
fn fused_crossfade_equals_the_general_blend() {
    // A third layer, empty, takes the general path.
    let f = figure();
    let cues = vec![cue(&f, RAISE, 0.0, 0.0), cue(&f, NOD, 1.0, 1.0)];
    let fused = stage_with_cues(cues.clone());
    let mut general = stage_with_cues(cues);
    general.actors[0].layers.push(Layer::default());
    for t in [1.1, 1.5, 1.9] {
        let (a, b) = (fused.at(secs(t)).unwrap(), general.at(secs(t)).unwrap());
        for joint in 0..5 {
            assert_close(joint_world(&a, 0, joint), joint_world(&b, 0, joint), 1e-6);
        }
    }
}

#[test]
fn morph_weights_are_overridden_by_clip_script_keys_and_callbacks_in_order() {
    let asset = stick();
    let mut stage = Stage::default();
    stage.cast("stick", asset.clone());
    let weights = |stage: &Stage, t: f64| stage.at(secs(t)).unwrap().actors[0].morph_weights[0].clone();
    let near =
        |a: Vec<f32>, b: [f32; 2]| assert!((a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1e-6, "{a:?} {b:?}");
    near(weights(&stage, 1.0), [0.1, 0.2]);
    stage.play(0, Cue::new(asset.clips[0].clone()));
    near(weights(&stage, 1.0), [0.5, 0.5]);
    // Crossfaded like joints: 0.5 + (0.0 - 0.5) * 0.5 half a second in.
    stage.play(
        0,
        Cue { start: secs(1.0), fade_in: secs(1.0), speed: 0.0, ..Cue::new(asset.clips[0].clone()) },
    );
    near(weights(&stage, 1.5), [0.375, 0.5]);
    stage.actors[0].morphs.push((0, 1, 0.9));
    near(weights(&stage, 1.5), [0.375, 0.9]);
    stage.actors[0].channels.push(Channel {
        property: Property::Morph { instance: 0, target: 1 },
        interpolation: choreo_motion::Interpolation::Linear,
        times: vec![Time::ZERO, secs(2.0)],
        values: vec![0.0, 0.4],
    });
    near(weights(&stage, 1.5), [0.375, 0.3]);
    #[derive(Debug)]
    struct Callback;
    impl FrameCallback for Callback {
        fn run(&self, _: Time, edits: &mut FrameEdits) -> Result<(), StageError> {
            edits.actors.push((0, ActorEdit::Morph { instance: 0, target: 0, weight: 0.7 }));
            Ok(())
        }
    }
    stage.frame_callbacks.push(Arc::new(Callback));
    near(weights(&stage, 1.5), [0.7, 0.3]);
    assert_eq!(stage.check().len(), 0);
}
