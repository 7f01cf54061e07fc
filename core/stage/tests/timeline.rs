//! Cues against closed forms: the clips move the hips along x = t and y = 2t, so a blend's weights can be read off.

mod support;
use choreo_motion::Time;
use choreo_stage::*;
use std::sync::Arc;
use support::*;

fn cue(asset: &Asset, clip: usize, start: f64, fade_in: f64) -> Cue {
    Cue { start: secs(start), fade_in: secs(fade_in), ..Cue::new(asset.clips[clip].clone()) }
}

fn playing(cues: Vec<Cue>) -> Stage {
    let mut stage = Stage::default();
    let anna = stage.cast("anna", figure());
    cues.into_iter().for_each(|cue| stage.play(anna, cue));
    assert_eq!(stage.check().len(), 0, "{:?}", stage.check());
    stage
}

fn hips(stage: &Stage, t: f64) -> glam::DVec3 {
    joint_world(&stage.at(secs(t)).unwrap(), 0, HIPS)
}

#[test]
fn a_crossfade_goes_linearly_and_the_first_clip_plays_on_under_it() {
    let f = figure();
    let stage = playing(vec![cue(&f, ALONG_X, 0.0, 0.0), cue(&f, ALONG_Y, 2.0, 0.8)]);
    let mut worst_frozen: f64 = 0.0;
    for i in 0..=35 {
        let t = i as f64 / 10.0;
        let w = ((t - 2.0) / 0.8).clamp(0.0, 1.0);
        close(hips(&stage, t), v((1.0 - w) * t, w * 2.0 * (t - 2.0).max(0.0), 0.0), 1e-5);
        let frozen = v((1.0 - w) * t.min(2.0), w * 2.0 * (t - 2.0).max(0.0), 0.0);
        worst_frozen = worst_frozen.max((hips(&stage, t) - frozen).length());
    }
    assert!(worst_frozen > 0.1, "a clip frozen under the fade would have passed: {worst_frozen}");
}

#[test]
fn smooth_fades_follow_their_cubic() {
    let f = figure();
    let smooth = Cue { ease: Ease::Smooth, ..cue(&f, ALONG_Y, 2.0, 0.8) };
    let stage = playing(vec![cue(&f, ALONG_X, 0.0, 0.0), smooth]);
    for t in [2.0, 2.2, 2.4, 2.7, 2.8] {
        let s: f64 = (t - 2.0) / 0.8;
        let w = 3.0 * s * s - 2.0 * s * s * s;
        close(hips(&stage, t), v((1.0 - w) * t, w * 2.0 * (t - 2.0), 0.0), 1e-5);
    }
}

#[test]
fn a_fade_over_a_fade_is_a_fold() {
    let f = figure();
    let stage =
        playing(vec![cue(&f, ALONG_X, 0.0, 0.0), cue(&f, ALONG_Y, 1.0, 1.0), cue(&f, ALONG_X, 1.5, 1.0)]);
    let t = 1.75;
    let (w1, w2) = (0.75, 0.25);
    let (x, y) = ((1.0 - w1) * t, w1 * 2.0 * 0.75);
    close(hips(&stage, t), v(x * (1.0 - w2) + w2 * 0.25, y * (1.0 - w2), 0.0), 1e-5);
}

#[test]
fn a_cue_of_half_weight_stays_half_mixed_and_the_first_has_all() {
    let f = figure();
    let half = |c: Cue| Cue { weight: 0.5, ..c };
    let stage = playing(vec![half(cue(&f, ALONG_X, 0.0, 1.0)), half(cue(&f, ALONG_Y, 1.0, 1.0))]);
    close(hips(&stage, 0.5), v(0.5, 0.0, 0.0), 1e-6);
    close(hips(&stage, 3.0), v(1.5, 2.0, 0.0), 1e-5);
}

#[test]
fn speed_trim_reverse_and_repeats() {
    let f = figure();
    let x = |edit: &dyn Fn(&mut Cue), t: f64| {
        let mut one = cue(&f, ALONG_X, 1.0, 0.0);
        edit(&mut one);
        hips(&playing(vec![one]), t).x
    };
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-5, "{a} is not {b}");
    near(x(&|c| c.speed = 1.5, 2.0), 1.5);
    near(x(&|c| c.speed = -1.0, 2.5), 4.0 - 1.5);
    near(x(&|c| c.speed = 0.0, 9.0), 0.0);
    near(x(&|c| c.trim = (secs(1.0), secs(2.0)), 1.25), 1.25);
    near(x(&|c| c.trim = (secs(1.0), secs(2.0)), 5.75), 1.75);
    near(x(&|_| (), 1.0 + 4.0 + 0.5), 0.5);
    near(x(&|c| c.repeat = Repeat::Once, 100.0), 4.0);
    near(x(&|c| (c.repeat, c.speed) = (Repeat::Once, -2.0), 100.0), 0.0);
    near(x(&|c| c.repeat = Repeat::PingPong, 1.0 + 5.0), 3.0);
    near(x(&|c| c.repeat = Repeat::PingPong, 1.0 + 9.0), 1.0);
}

#[test]
fn the_first_frame_stands_before_the_first_cue() {
    let f = figure();
    let stage = playing(vec![Cue { trim: (secs(1.5), secs(3.0)), ..cue(&f, ALONG_X, 2.0, 0.5) }]);
    for t in [-3.0, 0.0, 1.999, 2.0] {
        close(hips(&stage, t), v(1.5, 0.0, 0.0), 1e-5);
    }
    // Nor is it faded in from the rest pose.
    close(hips(&stage, 2.25), v(1.75, 0.0, 0.0), 1e-5);
}

#[test]
fn after_an_end_the_pose_is_held_and_a_late_cue_fades_in_over_it() {
    let f = figure();
    let ended = Cue { end: Some(secs(1.5)), ..cue(&f, ALONG_X, 0.0, 0.0) };
    let stage = playing(vec![ended.clone(), cue(&f, ALONG_Y, 3.0, 1.0)]);
    close(hips(&stage, 1.25), v(1.25, 0.0, 0.0), 1e-5);
    close(hips(&stage, 2.5), v(1.5, 0.0, 0.0), 1e-5);
    close(hips(&stage, 3.5), v(0.75, 0.5, 0.0), 1e-5);
    // One that follows at once takes over a playing clip.
    let stage = playing(vec![ended, cue(&f, ALONG_Y, 1.5, 1.0)]);
    close(hips(&stage, 2.0), v(1.0, 0.5, 0.0), 1e-5);
}

#[test]
fn a_loop_that_ends_after_whole_rounds_holds_its_last_pose() {
    let f = figure();
    let stage = playing(vec![Cue { end: Some(secs(8.0)), ..cue(&f, ALONG_X, 0.0, 0.0) }]);
    close(hips(&stage, 7.9999), v(3.9999, 0.0, 0.0), 1e-4);
    for t in [8.0, 8.1, 30.0] {
        close(hips(&stage, t), v(4.0, 0.0, 0.0), 1e-5);
    }
    let reversed = Cue { end: Some(secs(4.0)), speed: -1.0, ..cue(&f, ALONG_X, 0.0, 0.0) };
    close(hips(&playing(vec![reversed]), 10.0), v(0.0, 0.0, 0.0), 1e-5);
}

fn layered(base: usize, mask: Option<Vec<f32>>, cues: Vec<Cue>) -> Stage {
    let f = figure();
    let mut stage = playing(vec![cue(&f, base, 0.0, 0.0)]);
    stage.actors[0].layers.push(Layer { mask: mask.map(Arc::new), cues, ..Layer::default() });
    assert_eq!(stage.check().len(), 0, "{:?}", stage.check());
    stage
}

#[test]
fn an_upper_layer_overrides_between_start_and_end_with_its_fades() {
    let f = figure();
    let over = Cue { end: Some(secs(4.0)), fade_out: secs(0.5), ..cue(&f, ALONG_Y, 2.0, 1.0) };
    let stage = layered(ALONG_X, None, vec![over]);
    for (t, w) in [(1.0, 0.0), (2.25, 0.25), (3.2, 1.0), (3.75, 0.5), (3.999999, 0.0)] {
        close(hips(&stage, t), v((1.0 - w) * t, w * 2.0 * (t - 2.0), 0.0), 1e-4);
    }
    // Absent again from the end on: the base loops.
    close(hips(&stage, 4.5), v(0.5, 0.0, 0.0), 1e-5);
}

#[test]
fn a_mask_weighs_joints_and_what_the_upper_clip_leaves_alone_stays() {
    let f = figure();
    let mask = vec![0.0, 1.0, 1.0, 0.5, 1.0];
    let stage = layered(ALONG_X, Some(mask), vec![cue(&f, RAISE, 0.0, 0.0)]);
    let snapshot = stage.at(secs(1.0)).unwrap();
    close(joint_world(&snapshot, 0, HIPS), v(1.0, 0.0, 0.0), 1e-5);
    // The arm is at 45° in the clip; halfway from rest is 22.5°.
    let angle = 22.5f64.to_radians();
    let hand = v(1.0 + 0.3 + 0.6 * angle.cos(), 1.4 + 0.6 * angle.sin(), 0.0);
    close(joint_world(&snapshot, 0, HAND), hand, 1e-5);
    // Without a mask the hips still follow the base: the clip does not animate them.
    let stage = layered(ALONG_X, None, vec![cue(&f, RAISE, 0.0, 0.0)]);
    close(hips(&stage, 1.0), v(1.0, 0.0, 0.0), 1e-5);
}

#[test]
fn on_an_upper_layer_cues_hand_over_without_a_dip() {
    let f = figure();
    for end in [None, Some(secs(2.0))] {
        let first = Cue { end, ..cue(&f, ALONG_Y, 0.0, 0.0) };
        let second = Cue { speed: 0.5, ..cue(&f, ALONG_Y, 2.0, 1.0) };
        let stage = layered(ALONG_X, None, vec![first.clone(), second.clone()]);
        // Both go along y alone: any x would be the base shining through.
        close(hips(&stage, 2.5), v(0.0, 0.5 * 5.0 + 0.5 * 0.5, 0.0), 1e-5);
        close(hips(&stage, 3.5), v(0.0, 1.5, 0.0), 1e-5);
        // Shares of a full and a half cue go from (1, 0) to (0, ½).
        let stage = layered(ALONG_X, None, vec![first, Cue { weight: 0.5, ..second }]);
        let (a, b) = (0.25, 0.75 * 0.5);
        let t = 2.75;
        let (rest, y) = ((1.0 - a - b) * t, a * 2.0 * t + b * (t - 2.0));
        close(hips(&stage, t), v(rest, y, 0.0), 1e-5);
    }
}

#[test]
fn without_cues_the_rest_pose_stands() {
    let mut stage = Stage::default();
    stage.cast("anna", figure());
    let snapshot = stage.at(secs(3.0)).unwrap();
    assert_eq!(snapshot.actors[0].model_from_joint, figure().rest_model_from_joint());
    close(joint_world(&snapshot, 0, HAND), v(0.9, 1.4, 0.0), 1e-6);
}

#[test]
fn a_fused_crossfade_is_the_general_fold() {
    // A third layer, empty, takes the general path.
    let f = figure();
    let cues = vec![cue(&f, RAISE, 0.0, 0.0), cue(&f, NOD, 1.0, 1.0)];
    let fused = playing(cues.clone());
    let mut general = playing(cues);
    general.actors[0].layers.push(Layer::default());
    for t in [1.1, 1.5, 1.9] {
        let (a, b) = (fused.at(secs(t)).unwrap(), general.at(secs(t)).unwrap());
        for joint in 0..5 {
            close(joint_world(&a, 0, joint), joint_world(&b, 0, joint), 1e-6);
        }
    }
}

#[test]
fn morph_weights_come_from_rest_clip_script_keys_and_hooks_in_this_order() {
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
    struct Hook;
    impl FrameHook for Hook {
        fn run(&self, _: Time, edits: &mut FrameEdits) -> Result<(), StageError> {
            edits.actors.push(ActorEdit::Morph { actor: 0, instance: 0, target: 0, weight: 0.7 });
            Ok(())
        }
    }
    stage.hooks.push(Arc::new(Hook));
    near(weights(&stage, 1.5), [0.7, 0.3]);
    assert_eq!(stage.check().len(), 0);
}
