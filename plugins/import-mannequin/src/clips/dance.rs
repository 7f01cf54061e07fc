//! Dances on the beat, at 120 beats a minute.

use crate::keys::{cos, cycle, ease, keys};
use crate::pose::{Arm, Foot, Pose, turn};
use glam::vec3;

const BEATS_PER_SECOND: f32 = 2.0;
/// Length of the clip in beats.
const BEAT_COUNT: f32 = 16.0;

/// x and lift of a foot after steps: a step `(beat, x)` begins 0.1 beats after `beat` and takes 0.7 beats.
fn steps(beat: f32, start: f32, steps: &[(f32, f32)]) -> (f32, f32) {
    let (mut x, mut lift) = (start, 0.0);
    for &(when, to) in steps {
        let share = ease(beat, when + 0.1, when + 0.8);
        lift += 4.0 * share * (1.0 - share) * 0.055;
        x += (to - x) * share;
    }
    (x, lift)
}

/// 1 while a heel is lifted, from half a beat after `beat` until the foot moves away.
fn touch(beat: f32, beats: &[f32]) -> f32 {
    beats
        .iter()
        .map(|b| ease(beat, b + 0.25, b + 0.7) * (1.0 - ease(beat, b + 1.15, b + 1.6)))
        .fold(0.0, f32::max)
}

/// Sixteen beats in eight seconds: four two-steps to the sides with swinging arms, then hip sways, four beats with the hands
/// overhead and four pointing up and down.
pub(crate) fn groove(t: f32) -> Pose {
    let beat = t * BEATS_PER_SECOND;
    // Beats 8 to 16 stay on the spot.
    let spot = ease(beat, 7.7, 8.6) * (1.0 - ease(beat, 15.1, 16.0));
    let weight = |b: f32| {
        let travel =
            cycle(b, 4.0, &[(0.0, -1.0), (0.9, 0.86), (1.55, 1.0), (2.0, 1.0), (2.9, -0.86), (3.55, -1.0)]);
        travel + (-cos(b / 2.0) - travel) * spot
    };
    let now = weight(beat);
    let late = weight(beat - 0.22);
    // Down on the beat, up between beats, a little faster on the way down.
    let bounce = cos(beat) + 0.15 * cos(2.0 * beat);
    let nod = cos(beat - 0.10);

    let mut pose = Pose::default();
    let sway = 0.150 * now * (1.0 - spot) + (-0.045 + 0.080 * now) * spot;
    pose.hips = vec3(sway, -0.048 - 0.026 * bounce, -0.012 + 0.014 * cos(beat / 2.0 + 0.25));
    pose.pelvis = turn(6.0 + 3.0 * bounce, 9.0 * late * (1.0 - 0.4 * spot), -(5.0 + 5.0 * spot) * now);
    pose.spine = turn(1.0 - 2.0 * bounce, -15.0 * late, (8.0 + 5.0 * spot) * late + 2.0 * now);
    pose.head = turn(3.0 + 5.0 * nod, 11.0 * late * (1.0 - 0.6 * spot), -5.0 * now + 2.0 * late);

    pose.feet = feet(beat, spot, now);
    let accent = 0.5 + 0.5 * nod;
    // The arms swing higher in the second repetition.
    let high = ease(beat, 3.6, 4.4) * (1.0 - ease(beat, 7.4, 8.4));
    for (arm, s) in pose.arms.iter_mut().zip([1.0, -1.0]) {
        let out = s * late;
        let swing = Arm {
            raise: 24.0 + 15.0 * out + 12.0 * high * (0.5 + 0.5 * out),
            flex: 22.0 - 24.0 * out + 14.0 * high,
            twist: 16.0 - 6.0 * out - 10.0 * high,
            elbow: 74.0 + 12.0 * accent - 14.0 * out + 8.0 * high,
            pronate: 20.0,
            wrist: 4.0 + 14.0 * cos(beat - 0.3),
            tilt: 0.0,
            curl: 0.45 + 0.15 * nod,
            lift: 4.0 * accent,
            reach: -5.0 * out,
        };
        // Hands overhead, moving from one side to the other.
        let aloft = Arm {
            raise: 134.0 + 13.0 * out,
            flex: 16.0,
            twist: -38.0,
            elbow: 52.0 - 20.0 * out + 8.0 * accent,
            pronate: 0.0,
            wrist: -6.0 + 16.0 * s * weight(beat - 0.42),
            tilt: 0.0,
            curl: 0.12,
            lift: 3.0 * accent,
            reach: 0.0,
        };
        let up = ease(beat, 7.8, 8.8) * (1.0 - ease(beat, 11.4, 12.2));
        let mut mixed = swing.mix(&aloft, up);
        let last = ease(beat, 11.5, 12.3) * (1.0 - ease(beat, 15.0, 15.95));
        mixed = mixed.mix(&if s < 0.0 { point(beat) } else { on_hip(accent) }, last);
        *arm = mixed;
    }
    pose
}

/// The pointing right arm: up to the side on even beats, across to the left hip on odd beats.
fn point(beat: f32) -> Arm {
    let high = cycle(beat - 0.05, 2.0, &[(0.0, 1.0), (0.25, 0.97), (1.0, 0.0), (1.25, 0.03)]);
    Arm {
        raise: -6.0 + 142.0 * high,
        flex: 38.0 * (1.0 - high) + 14.0 * high,
        twist: 34.0 * (1.0 - high),
        elbow: 46.0 - 34.0 * high + 90.0 * high * (1.0 - high),
        pronate: 24.0,
        wrist: 6.0 - 10.0 * high,
        tilt: 0.0,
        curl: 0.55 - 0.30 * high,
        lift: 5.0 * high,
        reach: 6.0 * (1.0 - high),
    }
}

/// The left arm, its hand on the hip.
fn on_hip(accent: f32) -> Arm {
    Arm {
        raise: 42.0 + 3.0 * accent,
        flex: -22.0,
        twist: 56.0,
        elbow: 98.0,
        pronate: 10.0,
        wrist: 30.0,
        tilt: 0.0,
        curl: 0.30,
        lift: 2.0,
        reach: 0.0,
    }
}

fn feet(beat: f32, spot: f32, weight: f32) -> [Foot; 2] {
    let left = [(0.0, 0.225), (3.0, -0.025), (4.0, 0.225), (7.0, -0.025), (8.0, 0.135), (15.0, -0.025)];
    let right = [(1.0, 0.025), (2.0, -0.225), (5.0, 0.025), (6.0, -0.225)];
    let (left_x, left_lift) = steps(beat, -0.025, &left);
    let (right_x, right_lift) = steps(beat, -0.225, &right);
    // A touch lifts the heel. The last one is repeated a loop earlier, so that it continues over the loop point.
    let left_touch = touch(beat, &[3.0, 7.0, 15.0]).max(touch(beat + BEAT_COUNT, &[15.0]));
    let right_touch = touch(beat, &[1.0, 5.0]);
    // The knee of the unweighted leg comes in on the spot, with its heel up.
    let free = |side: f32| spot * (-side * weight).max(0.0) * (-side * weight).max(0.0);
    let foot = |x: f32, lift: f32, touching: f32, free: f32| Foot {
        x,
        z: 0.0 + 0.02 * touching,
        lift,
        out: 12.0,
        pitch: 30.0 * touching + 20.0 * free,
        toes: 1.0,
        knee: 4.0 * (1.0 - free) - 14.0 * free,
    };
    [foot(left_x, left_lift, left_touch, free(1.0)), foot(right_x, right_lift, right_touch, free(-1.0))]
}

/// A spin: winds up, turns once on the left ball, and ends in a pose.
pub(super) fn spin(t: f32) -> Pose {
    let mut pose = Pose::default();
    let facing = keys(t, &[(0.52, 0.0), (0.72, 50.0), (1.30, 322.0), (1.56, 360.0)]);
    pose.facing = facing;
    // Weight over the left foot while turning, then onto the right one.
    let over = keys(t, &[(0.08, 0.0), (0.52, 1.0), (1.50, 1.0), (1.85, 0.0)]);
    let wind = keys(t, &[(0.0, 0.0), (0.40, 1.0), (0.66, -0.25), (1.2, 0.0)]);
    let turning = ease(t, 0.50, 0.72) * (1.0 - ease(t, 1.36, 1.60));
    let show = keys(t, &[(1.42, 0.0), (1.84, 1.06), (1.98, 1.0), (2.25, 1.0), (2.85, 0.0)]);
    let knees = keys(
        t,
        &[
            (0.0, 0.0),
            (0.42, 1.0),
            (0.68, -0.30),
            (1.40, -0.30),
            (1.72, 0.75),
            (1.95, 0.2),
            (2.3, 0.2),
            (2.9, 0.0),
        ],
    );
    pose.hips = vec3(-0.015 * over - 0.105 * show, -0.004 - 0.060 * knees, -0.012 * (1.0 - over));
    pose.pelvis = turn(3.0 * knees, -16.0 * wind - 8.0 * show, 5.0 * show);
    pose.spine = turn(1.0 + 2.0 * knees - 5.0 * show, -26.0 * wind + 12.0 * show, 3.0 * turning - 9.0 * show);
    // Spotting: the eyes stay on the audience, then the head whips around ahead of the body.
    let spot = keys(facing, &[(0.0, 0.0), (75.0, -62.0), (190.0, 25.0), (262.0, 62.0), (360.0, 0.0)]);
    pose.head = turn(1.0 - 4.0 * show, spot + 10.0 * show, -4.0 * show);

    let open = keys(t, &[(0.0, 0.0), (0.40, 1.0), (0.78, 0.0)]);
    for (arm, lead) in pose.arms.iter_mut().zip([1.0, 0.0]) {
        let rest = Arm::default();
        let (wound, gathered, shown) = spin_arms(lead);
        *arm = rest.mix(&wound, open).mix(&gathered, turning).mix(&shown, show);
    }
    pose.feet = spin_feet(t, show);
    pose
}

/// Arm poses: wound up, gathered while turning, and extended at the end. `lead` is 1 for the left arm and 0 for the right one.
fn spin_arms(lead: f32) -> (Arm, Arm, Arm) {
    let rest = Arm::default();
    // Wound up to the right: the left arm crosses, the right arm opens.
    let wound = Arm {
        raise: 62.0 - 30.0 * lead,
        flex: 8.0 + 50.0 * lead,
        twist: 20.0,
        elbow: 24.0 + 40.0 * lead,
        curl: 0.15,
        ..rest
    };
    let gathered = Arm {
        raise: 26.0,
        flex: 52.0,
        twist: 34.0,
        elbow: 96.0,
        pronate: 20.0,
        curl: 0.30,
        reach: 6.0,
        ..rest
    };
    // Extended: one arm high, the other wide.
    let shown = Arm {
        raise: 92.0 + 46.0 * (1.0 - lead),
        flex: 8.0,
        twist: -20.0,
        elbow: 14.0,
        pronate: -30.0,
        wrist: -12.0,
        curl: 0.08,
        lift: 2.0,
        ..rest
    };
    (wound, gathered, shown)
}

fn spin_feet(t: f32, show: f32) -> [Foot; 2] {
    // Left foot: its ball moves below the axis of the turn. Right foot: drawn up to the knee, then set down wide.
    let left = ease(t, 0.10, 0.42) * (1.0 - ease(t, 2.42, 2.74));
    let hop = 4.0 * 0.035;
    let left_hop = hop * left * (1.0 - left);
    let start = Pose::default().feet;
    let left_foot = Foot {
        x: start[0].x * (1.0 - left),
        z: start[0].z * (1.0 - left) - 0.125 * left,
        lift: left_hop,
        out: 8.0 * (1.0 - left),
        pitch: keys(t, &[(0.40, 0.0), (0.52, 24.0), (1.56, 24.0), (1.80, 0.0)])
            + 16.0 * (show * ease(t, 1.8, 2.0) * (1.0 - ease(t, 2.2, 2.4))),
        knee: 0.0,
        ..start[0]
    };
    let drawn = keys(t, &[(0.44, 0.0), (0.74, 1.0), (1.34, 1.0), (1.66, 0.0)]);
    let wide = ease(t, 1.36, 1.66) * (1.0 - ease(t, 2.62, 2.92));
    let home = ease(t, 2.62, 2.92);
    let right_foot = Foot {
        x: start[1].x + 0.060 * drawn * (1.0 - wide) - 0.155 * wide,
        z: start[1].z + 0.02 * drawn,
        lift: 0.33 * drawn + hop * home * (1.0 - home),
        pitch: 52.0 * drawn,
        toes: 1.0 - drawn,
        knee: 34.0 * drawn + 4.0,
        out: 8.0 + 10.0 * drawn + 6.0 * wide,
    };
    [left_foot, right_foot]
}
