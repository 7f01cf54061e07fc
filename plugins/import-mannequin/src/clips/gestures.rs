//! Wave, bow and jump, which begin and end in the relaxed standing pose.

use crate::keys::{ease, keys, sin};
use crate::pose::{Pose, turn};
use glam::vec3;

/// Three waves of the right hand, with a reaction of the body.
pub(super) fn wave(t: f32) -> Pose {
    let mut pose = Pose::default();
    // The body moves first, then the arm, then the hand.
    let body = keys(t, &[(0.0, 0.0), (0.45, 1.0), (2.15, 1.0), (2.85, 0.0)]);
    let up = keys(t, &[(0.05, 0.0), (0.18, -0.04), (0.70, 1.05), (0.85, 1.0), (2.15, 1.0), (2.85, 0.0)]);
    let swinging = ease(t, 0.45, 0.8) * (1.0 - ease(t, 2.0, 2.4));
    let swing = sin((t - 0.6) / 0.5) * swinging;
    let hand = sin((t - 0.68) / 0.5) * swinging;
    pose.hips += vec3(0.022 * body, -0.004 * body, 0.0);
    pose.pelvis = turn(0.0, 2.0 * body, -2.0 * body);
    pose.spine = turn(1.0 - 2.5 * body, -5.0 * body, 6.0 * body + 1.2 * swing);
    pose.head = turn(2.0 - 4.0 * body, -3.0 * body, -6.0 * body + 2.0 * hand);
    let arm = &mut pose.arms[1];
    arm.raise += 88.0 * up + 4.0 * swing;
    arm.flex += 18.0 * up;
    arm.twist += -92.0 * up;
    arm.elbow += (84.0 + 20.0 * swing) * up;
    arm.pronate += -6.0 * up;
    arm.wrist -= 4.0 * up;
    arm.tilt = 18.0 * hand;
    arm.curl = 0.22 - 0.20 * up;
    arm.lift = 3.0 * up;
    let other = &mut pose.arms[0];
    other.raise += 3.0 * body;
    other.elbow += 6.0 * body;
    pose
}

/// The right hand comes in front of the body, the left opens to the side, and the body folds at the hips.
pub(super) fn bow(t: f32) -> Pose {
    let mut pose = Pose::default();
    let down = keys(t, &[(0.15, 0.0), (0.35, -0.06), (1.25, 1.0), (1.95, 1.0), (2.95, -0.02), (3.35, 0.0)]);
    let head = keys(t, &[(0.2, 0.0), (1.15, 1.0), (2.1, 1.05), (3.2, 0.0)]);
    let arms = keys(t, &[(0.0, 0.0), (0.75, 1.0), (2.2, 1.0), (3.2, 0.0)]);
    pose.hips += vec3(0.0, -0.028 * down, -0.105 * down);
    pose.pelvis = turn(30.0 * down, 0.0, 0.0);
    pose.spine = turn(1.0 + 26.0 * down, 0.0, 0.0);
    pose.head = turn(2.0 + 62.0 * head, 0.0, 0.0);
    let right = &mut pose.arms[1];
    right.raise += -2.0 * arms;
    right.flex += 26.0 * arms;
    right.twist += 58.0 * arms;
    right.elbow += 88.0 * arms;
    right.pronate += 10.0 * arms;
    right.wrist += 6.0 * arms;
    right.curl = 0.22 - 0.10 * arms;
    let left = &mut pose.arms[0];
    left.raise += 44.0 * arms;
    left.flex += -14.0 * arms;
    left.twist += -24.0 * arms;
    left.elbow += 6.0 * arms;
    left.pronate += -40.0 * arms;
    left.wrist += -8.0 * keys(t, &[(0.3, 0.0), (1.0, 1.0), (2.4, 1.0), (3.3, 0.0)]);
    left.curl = 0.22 - 0.12 * arms;
    pose
}

const TAKEOFF_SECS: f32 = 0.62;
const LANDING_SECS: f32 = 1.12;

/// A crouch, half a second in the air (30 cm high, by gravity), and a soft landing.
pub(super) fn jump(t: f32) -> Pose {
    let mut pose = Pose::default();
    let air = t.clamp(TAKEOFF_SECS, LANDING_SECS) - TAKEOFF_SECS;
    let flight = 0.5 * 9.81 * air * (LANDING_SECS - TAKEOFF_SECS - air);
    let crouch = keys(
        t,
        &[
            (0.0, 0.0),
            (0.38, 1.0),
            (0.46, 0.95),
            (TAKEOFF_SECS, -0.22),
            (0.87, -0.1),
            (LANDING_SECS, 0.0),
            (1.30, 0.82),
            (1.70, 0.0),
        ],
    );
    let air_borne = ease(t, 0.60, 0.76) * (1.0 - ease(t, 0.94, LANDING_SECS - 0.03));
    let tuck = keys(t, &[(TAKEOFF_SECS, 0.0), (0.87, 1.0), (LANDING_SECS, 0.0)]);
    pose.hips += vec3(0.0, flight - 0.20 * crouch - 0.006, -0.06 * crouch.max(0.0));
    pose.pelvis = turn(24.0 * crouch - 4.0 * air_borne, 0.0, 0.0);
    pose.spine = turn(1.0 + 20.0 * crouch - 8.0 * air_borne, 0.0, 0.0);
    pose.head = turn(2.0 + 6.0 * crouch - 10.0 * air_borne, 0.0, 0.0);
    let flex = keys(
        t,
        &[(0.0, 0.0), (0.33, -46.0), (0.78, 122.0), (0.92, 132.0), (1.20, 30.0), (1.36, -10.0), (1.74, 0.0)],
    );
    let open = keys(t, &[(0.0, 0.0), (0.36, 14.0), (0.56, 8.0), (0.80, 18.0), (1.20, 8.0), (1.74, 0.0)]);
    let bend = keys(t, &[(0.0, 0.0), (0.36, 8.0), (0.56, 26.0), (0.84, 12.0), (1.20, 20.0), (1.74, 0.0)]);
    let reach = keys(t, &[(0.40, 0.0), (0.76, 1.0), (0.95, 1.0), (1.30, 0.0)]);
    for arm in &mut pose.arms {
        arm.flex += flex;
        arm.raise += open;
        arm.elbow += bend;
        arm.curl = 0.22 - 0.16 * reach;
        arm.lift = 5.0 * reach;
    }
    // Heels lift first and land last; the toes point down in the air.
    let heel = keys(t, &[(0.46, 0.0), (TAKEOFF_SECS, 52.0), (0.78, 40.0), (LANDING_SECS, 22.0), (1.24, 0.0)]);
    for foot in &mut pose.feet {
        foot.pitch = heel;
        foot.lift = flight + 0.05 * tuck;
        foot.z -= 0.04 * tuck;
        foot.toes = 1.0 - air_borne;
        foot.knee = 4.0 * crouch.max(0.0);
    }
    pose
}
