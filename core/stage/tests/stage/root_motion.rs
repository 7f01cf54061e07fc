//! Root motion against closed forms and against a finer integration: turns, loops, fades, and times of 100 h.

use crate::support::*;
use choreo_motion::{Clip, Path, RootMotion, RootParts, Time};
use choreo_stage::*;
use glam::{DQuat, DVec3, Quat};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// Hips from the origin 1 m along a quarter circle to the left in a second: an arc of radius 2/π about (2/π, 0, 0).
fn quarter_turn_clip() -> Arc<Clip> {
    let keys = 64;
    let (mut places, mut turns) = (Vec::new(), Vec::new());
    for i in 0..=keys {
        let t = f64::from(i) / f64::from(keys);
        let angle = FRAC_PI_2 * t;
        let r = 1.0 / FRAC_PI_2;
        places.push((t, [r * (1.0 - libm::cos(angle)), 0.9, r * libm::sin(angle)].map(|v| v as f32)));
        turns.push((t, Quat::from_rotation_y(angle as f32).to_array()));
    }
    let places: Vec<(f64, &[f32])> = places.iter().map(|(t, v)| (*t, &v[..])).collect();
    let turns: Vec<(f64, &[f32])> = turns.iter().map(|(t, v)| (*t, &v[..])).collect();
    clip("bend", 5, vec![curve(HIPS, Path::Translation, &places), curve(HIPS, Path::Rotation, &turns)])
}

/// Hips along +Z at a speed, for a second.
fn straight_clip(speed: f32) -> Arc<Clip> {
    let keys: [(f64, &[f32]); 2] = [(0.0, &[0.0, 0.9, 0.0]), (1.0, &[0.0, 0.9, speed])];
    clip("straight", 5, vec![curve(HIPS, Path::Translation, &keys)])
}

fn with_root_motion(cue: Cue) -> Cue {
    let figure = figure();
    let motion = RootMotion::new(&figure.skeleton, &cue.clip, Some(HIPS), RootParts::default(), cue.trim);
    Cue { root: Some(Arc::new(CueRootMotion { motion: motion.unwrap(), carries: true })), ..cue }
}

fn stage_with_cues(cues: Vec<Cue>) -> Stage {
    let mut stage = Stage::default();
    let anna = stage.cast("anna", figure());
    cues.into_iter().for_each(|cue| stage.play(anna, with_root_motion(cue)));
    assert_eq!(stage.check().len(), 0, "{:?}", stage.check());
    stage
}

fn hips_position(stage: &Stage, t: f64) -> DVec3 {
    joint_world(&stage.at(secs(t)).unwrap(), 0, HIPS)
}

#[test]
fn looped_quarter_circle_root_motion_walks_a_circle_for_100_hours() {
    let stage = stage_with_cues(vec![Cue::new(quarter_turn_clip())]);
    let r = 1.0 / FRAC_PI_2;
    let worst = (0..=160)
        .map(|i| f64::from(i) / 40.0)
        .map(|t| {
            let angle = FRAC_PI_2 * t;
            let circle = v(r * (1.0 - libm::cos(angle)), 0.9, r * libm::sin(angle));
            (hips_position(&stage, t) - circle).length()
        })
        .fold(0.0, f64::max);
    assert!(worst < 1e-4, "{worst}");
    // 360 000 s are 90 000 times around; the keys are f32, and so is the turn of one loop.
    let (start, later) = (hips_position(&stage, 0.3), hips_position(&stage, 360_000.3));
    assert!((start - later).length() < 0.05, "{start} {later}");
    let forwards = stage.at(secs(360_000.3)).unwrap().content_hash();
    stage.at(secs(1.0)).unwrap();
    assert_eq!(stage.at(secs(360_000.3)).unwrap().content_hash(), forwards);
}

#[test]
fn straight_root_motion_loop_is_exact_after_100_hours() {
    let stage = stage_with_cues(vec![Cue::new(straight_clip(1.25))]);
    for t in [0.25, 17.5, 360_000.5] {
        assert!((hips_position(&stage, t).z - 1.25 * t).abs() < 1e-6, "{t}");
    }
}

#[test]
fn first_loop_with_root_motion_equals_the_plain_clip() {
    let stage = stage_with_cues(vec![Cue::new(quarter_turn_clip())]);
    let mut plain = stage.clone();
    plain.actors[0].layers[0].cues[0].root = None;
    for t in [0.0, 0.3, 0.99] {
        for joint in [HIPS, HEAD, HAND] {
            let [a, b] = [&stage, &plain].map(|s| joint_world(&s.at(secs(t)).unwrap(), 0, joint));
            assert_close(a, b, 1e-5);
        }
    }
    assert!(
        (hips_position(&stage, 1.5) - hips_position(&plain, 1.5)).length() > 0.5,
        "a clip that starts over would have passed"
    );
}

/// Runge–Kutta of order four over the mean of the two clips' velocities in the actor's own frame.
fn integrate_blended_velocities(speed: f64, from: f64, fade: f64, until: f64) -> DVec3 {
    let w = |t: f64| ((t - from) / fade).clamp(0.0, 1.0);
    // Straight first: along +Z. Then the bend: 1 m/s ahead, turning by π/2 a second.
    let rate = |t: f64, yaw: f64| {
        let ahead = DQuat::from_rotation_y(yaw) * DVec3::Z;
        (ahead * (speed * (1.0 - w(t)) + w(t)), FRAC_PI_2 * w(t))
    };
    let (mut place, mut yaw) = (DVec3::Z * speed * from, 0.0);
    let steps = 20_000;
    let h = (until - from) / f64::from(steps);
    for i in 0..steps {
        let t = from + h * f64::from(i);
        let (v1, r1) = rate(t, yaw);
        let (v2, r2) = rate(t + h / 2.0, yaw + r1 * h / 2.0);
        let (v3, r3) = rate(t + h / 2.0, yaw + r2 * h / 2.0);
        let (v4, r4) = rate(t + h, yaw + r3 * h);
        place += (v1 + 2.0 * v2 + 2.0 * v3 + v4) * (h / 6.0);
        yaw += (r1 + 2.0 * r2 + 2.0 * r3 + r4) * (h / 6.0);
    }
    place
}

#[test]
fn crossfade_blends_root_motion_velocities() {
    let (from, fade) = (1.5, 0.8);
    let second = Cue { start: secs(from), fade_in: secs(fade), ..Cue::new(quarter_turn_clip()) };
    let stage = stage_with_cues(vec![Cue::new(straight_clip(2.5)), second]);
    let mut places_blended: f64 = 0.0;
    for until in [1.6, 1.9, 2.2, 2.3, 2.9, 3.6] {
        let expected = integrate_blended_velocities(2.5, from, fade, until).with_y(0.9);
        assert_close(hips_position(&stage, until), expected, 2e-3);
        // A blend of places goes at the speed at which the clips part, too.
        let w = f64::min((until - from) / fade, 1.0);
        let first = 2.5 * until * (1.0 - w);
        places_blended = places_blended.max((first - expected.z).abs());
    }
    assert!(places_blended > 0.3);
}

#[test]
fn inertialized_switch_keeps_the_velocity_and_decays_it() {
    let switch = |start: f64, duration: f64, clip| Cue {
        start: secs(start),
        inertialization: secs(duration),
        ..Cue::new(clip)
    };
    let stop = stage_with_cues(vec![Cue::new(straight_clip(2.5)), switch(1.5, 0.4, straight_clip(0.0))]);
    for t in [1.49, 1.5, 1.53, 1.6, 1.7, 1.85, 1.9, 4.0] {
        // The integral of 1 − 10 s³ + 15 s⁴ − 6 s⁵.
        let s = f64::clamp((t - 1.5) / 0.4, 0.0, 1.0);
        let on = 0.4 * (s - 2.5 * s.powi(4) + 3.0 * s.powi(5) - s.powi(6));
        assert_close(hips_position(&stop, t), v(0.0, 0.9, 2.5 * (f64::min(t, 1.5) + on)), 1e-4);
    }
    // Out of a turn, and from a switch that has not settled: no velocity jumps, and at last it is the clip's own.
    let chain = stage_with_cues(vec![
        Cue::new(quarter_turn_clip()),
        switch(1.3, 0.6, straight_clip(0.5)),
        switch(1.5, 0.4, straight_clip(-1.0)),
        Cue { start: secs(1.7), fade_in: secs(0.3), ..Cue::new(straight_clip(2.0)) },
    ]);
    let h = 1e-3;
    let velocity = |t: f64| (hips_position(&chain, t + h) - hips_position(&chain, t - h)) / (2.0 * h);
    for t in [1.3, 1.5, 1.7, 1.9, 2.0] {
        let jump = (velocity(t + 0.004) - velocity(t - 0.004)).length();
        assert!(jump < 0.15, "{jump} m/s at {t} s");
    }
    let own = velocity(2.5);
    assert!((own.length() - 2.0).abs() < 1e-2 && own.x > 1.0, "it has turned: {own}");
}

#[test]
fn next_clip_with_root_motion_starts_where_the_previous_one_ended() {
    // The second clip's hips begin 3 m to the side: on stage they do not.
    let keys: [(f64, &[f32]); 2] = [(0.0, &[3.0, 0.9, 0.0]), (1.0, &[3.0, 0.9, 1.0])];
    let aside = clip("aside", 5, vec![curve(HIPS, Path::Translation, &keys)]);
    let second = Cue { start: secs(1.0), ..Cue::new(aside) };
    let stage = stage_with_cues(vec![Cue::new(straight_clip(2.0)), second]);
    assert_close(hips_position(&stage, 1.0), v(0.0, 0.9, 2.0), 1e-5);
    assert_close(hips_position(&stage, 1.75), v(0.0, 0.9, 2.75), 1e-5);
}

#[test]
fn root_motion_follows_backward_ping_pong_and_single_playback() {
    let back = stage_with_cues(vec![Cue { speed: -2.0, ..Cue::new(straight_clip(1.5)) }]);
    // The clip starts at its end and goes backwards.
    assert!((hips_position(&back, 4.0).z - (1.5 - 12.0)).abs() < 1e-5, "{}", hips_position(&back, 4.0));
    let forth = stage_with_cues(vec![Cue { repeat: Repeat::PingPong, ..Cue::new(quarter_turn_clip()) }]);
    assert_close(hips_position(&forth, 2.0), hips_position(&forth, 0.0), 1e-5);
    assert_close(hips_position(&forth, 1.25), hips_position(&forth, 0.75), 1e-5);
    let once = stage_with_cues(vec![Cue { repeat: Repeat::Once, ..Cue::new(straight_clip(1.5)) }]);
    assert_close(hips_position(&once, 9.0), v(0.0, 0.9, 1.5), 1e-5);
}

#[test]
fn clip_time_follows_the_speed_curve_and_freezes_to_the_tick() {
    let keys = |values: Vec<f64>| Channel {
        property: Property::Speed,
        interpolation: choreo_motion::Interpolation::Linear,
        times: vec![secs(0.0), secs(2.0)],
        values,
    };
    let curve = SpeedCurve::new(keys(vec![0.0, 2.0]));
    let cue =
        Cue { time_remapping: Some(Arc::new(TimeRemapping::Speed(curve))), ..Cue::new(straight_clip(1.0)) };
    for (t, clip_secs) in [(0.0, 0.0), (1.0, 0.5), (2.0, 2.0), (3.0, 4.0), (360_000.0, 719_998.0)] {
        assert_eq!(cue.played_ticks(secs(t)), i128::from(secs(clip_secs).0), "at {t} s");
    }
    assert_eq!(cue.time_of_played(i128::from(secs(4.0).0)), Some(secs(3.0)));
    let frozen = Cue { freezes: vec![(secs(1.0), secs(2.5))], ..cue };
    assert_eq!(frozen.played_ticks(secs(2.0)), i128::from(secs(0.5).0));
    // Frozen, the speed goes on as keyed: what is left out is the integral over the freeze.
    assert_eq!(frozen.played_ticks(secs(3.0)), i128::from(secs(0.5 + 1.0).0));
    let mut broken = stage_with_cues(vec![Cue::new(straight_clip(1.0))]);
    broken.actors[0].layers[0].cues[0].freezes = vec![(Time(9), Time(3))];
    assert_eq!(broken.check().len(), 1);
}
