//! Walk and run in place: the standing foot moves back with the floor, at `speed`.
//!
//! Timing and ranges follow Perry & Burnfield, "Gait Analysis" (2010): the foot strikes with the heel, lies flat, rolls off over
//! the ball, and swings. The pelvis is lowest when both feet are down, and rotates against the shoulders.

use crate::keys::{cos, cycle, ease, hermite, sin};
use crate::pose::{Foot, Pose, turn};
use glam::vec3;

pub(super) struct Gait {
    /// Duration of a full cycle of two steps, seconds.
    pub period: f32,
    /// Speed of the floor, metres a second.
    pub speed: f32,
    /// Fraction of the cycle in which a foot is on the floor.
    stance: f32,
    /// Distance in front of the hips at which the foot strikes, metres.
    strike: f32,
    /// Lateral distance of each foot from the center line, metres.
    track: f32,
    /// Keys over the cycle, from strike to strike: (phase, degrees) and (phase, metres above the floor).
    pitch: &'static [(f32, f32)],
    lift: &'static [(f32, f32)],
    /// Factor of the swinging foot's end speeds; at 1 they match the floor's speed.
    carry: f32,
}

pub(super) const WALK: Gait = Gait {
    period: 1.0,
    speed: 1.2,
    stance: 0.62,
    strike: 0.315,
    track: 0.075,
    pitch: &[(0.0, -17.0), (0.09, 0.0), (0.36, 0.0), (0.50, 20.0), (0.62, 50.0), (0.72, 44.0), (0.88, -10.0)],
    lift: &[(0.0, 0.0), (0.62, 0.0), (0.64, 0.007), (0.73, 0.055), (0.86, 0.032), (0.975, 0.007)],
    carry: 1.0,
};

pub(crate) const RUN: Gait = Gait {
    period: 2.0 / 3.0,
    speed: 2.7,
    stance: 0.36,
    strike: 0.24,
    track: 0.05,
    pitch: &[(0.0, -6.0), (0.05, 0.0), (0.17, 0.0), (0.36, 52.0), (0.52, 92.0), (0.70, 48.0), (0.88, -4.0)],
    lift: &[(0.0, 0.0), (0.36, 0.0), (0.38, 0.010), (0.54, 0.23), (0.72, 0.25), (0.90, 0.07), (0.98, 0.008)],
    carry: 0.7,
};

impl Gait {
    fn foot(&self, phase: f32) -> Foot {
        let phase = phase - libm::floorf(phase);
        let stride = self.speed * self.period;
        let z = if phase < self.stance {
            self.strike - stride * phase
        } else {
            let leave = (self.stance, self.strike - stride * self.stance);
            hermite(phase, leave, -stride * self.carry, (1.0, self.strike), -stride * self.carry)
        };
        let swing = ease(phase, self.stance, self.stance + 0.12) * (1.0 - ease(phase, 0.9, 1.0));
        Foot {
            x: self.track,
            z,
            lift: if phase < self.stance { 0.0 } else { cycle(phase, 1.0, self.lift) },
            out: 6.0,
            pitch: cycle(phase, 1.0, self.pitch),
            toes: 1.0 - 0.8 * swing,
            knee: -3.0,
        }
    }

    fn feet(&self, phase: f32) -> [Foot; 2] {
        let right = self.foot(phase + 0.5);
        [self.foot(phase), Foot { x: -right.x, ..right }]
    }
}

/// A walk, with the left heel strike at 0.
pub(super) fn walk(t: f32) -> Pose {
    let p = t / WALK.period;
    let mut pose = Pose { feet: WALK.feet(p), ..Pose::default() };
    pose.hips = vec3(0.020 * cos(p - 0.30), -0.030 + 0.017 * cos(2.0 * (p - 0.30)), 0.006 * sin(2.0 * p));
    let stride = cos(p - 0.02);
    pose.pelvis = turn(3.0, -6.5 * stride, -3.2 * cos(p - 0.20));
    pose.spine = turn(0.5 + 1.0 * cos(2.0 * (p - 0.1)), 13.0 * cos(p - 0.04), 4.2 * cos(p - 0.20));
    pose.head = turn(3.0 + 1.0 * cos(2.0 * (p - 0.16)), 1.5 * stride, 0.8 * cos(p - 0.25));
    for (arm, half) in pose.arms.iter_mut().zip([0.0, 0.5]) {
        let swing = -cos(p + half - 0.03);
        arm.raise = 11.0 - 1.0 * swing;
        arm.flex = 3.0 + 21.0 * swing;
        arm.twist = 4.0 + 4.0 * swing;
        // Elbow and wrist follow with a delay.
        arm.elbow = 24.0 - 15.0 * cos(p + half - 0.09);
        arm.wrist = 4.0 + 7.0 * cos(p + half - 0.22);
        arm.curl = 0.28;
        arm.reach = 3.0 * swing;
    }
    pose
}

pub(super) fn run(t: f32) -> Pose {
    let p = t / RUN.period;
    let mut pose = Pose { feet: RUN.feet(p), ..Pose::default() };
    pose.hips = vec3(0.012 * cos(p - 0.18), -0.030 - 0.036 * cos(2.0 * (p - 0.16)), 0.01 * sin(2.0 * p));
    let stride = cos(p - 0.02);
    pose.pelvis = turn(10.0, -9.0 * stride, -3.5 * cos(p - 0.14));
    pose.spine = turn(3.0 + 2.0 * cos(2.0 * (p - 0.2)), 22.0 * stride, 4.5 * cos(p - 0.14));
    pose.head = turn(5.0 + 1.5 * cos(2.0 * (p - 0.2)), 1.5 * stride, 0.0);
    for (arm, half) in pose.arms.iter_mut().zip([0.0, 0.5]) {
        let swing = -cos(p + half - 0.02);
        arm.raise = 13.0 - 7.0 * swing;
        arm.flex = -6.0 + 40.0 * swing;
        arm.twist = 22.0 + 12.0 * swing;
        arm.elbow = 92.0 - 14.0 * cos(p + half - 0.06);
        arm.pronate = 18.0;
        arm.wrist = 4.0 * cos(p + half - 0.15);
        arm.curl = 0.62;
        arm.lift = 2.0;
        arm.reach = 8.0 * swing;
    }
    pose
}
