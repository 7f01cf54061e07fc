//! A standing idle clip.

use crate::keys::{cos, sin};
use crate::pose::{Pose, turn};
use glam::vec3;

/// Two breaths and one weight shift in six seconds.
pub(super) fn idle(t: f32) -> Pose {
    let mut pose = Pose::default();
    let phase = t / 6.0;
    let breath = 0.5 - 0.5 * cos(2.0 * phase);
    // The weight stays on each leg longer than between them.
    let shift = sin(phase) + 0.18 * sin(3.0 * phase);
    pose.hips +=
        vec3(0.026 * shift, -0.002 - 0.003 * shift * shift + 0.002 * breath, 0.004 * sin(2.0 * phase));
    pose.pelvis = turn(-1.0, 2.5 * shift, -2.2 * shift);
    pose.spine = turn(1.5 - 1.6 * breath, -3.0 * shift, 3.0 * shift);
    pose.head = turn(2.0 - 1.0 * breath, 4.0 * sin(phase - 0.08), 1.2 * sin(phase - 0.05));
    for (arm, s) in pose.arms.iter_mut().zip([1.0, -1.0]) {
        arm.lift = 2.2 * breath;
        arm.raise += 0.8 * breath + 1.2 * s * shift;
        arm.flex += 1.5 * sin(phase - 0.1) * s;
        arm.elbow += 1.5 * breath + 1.5 * s * sin(phase - 0.12);
        arm.curl += 0.03 * breath;
    }
    pose
}
