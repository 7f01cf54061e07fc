//! Motion of a camera on top of its rig: looks, which turn it to targets one after the other, and shakes.

use crate::stage::actor::Target;
use choreo_motion::Time;

/// A target of a camera from a time on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraLook {
    /// Target of the look; `None`: the direction of the rig.
    pub target: Option<Target>,
    /// Stage time at which the camera starts to turn.
    pub start: Time,
    /// Duration of the turn.
    pub blend: Time,
}

/// Camera shake, as of a handheld camera or a collision: smooth noise added to position and rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraShake {
    /// Stage time at which the shake begins.
    pub start: Time,
    /// Stage time at which the shake ends; `None`: never.
    pub end: Option<Time>,
    /// Duration of the fade-in and of the fade-out.
    pub fade: Time,
    /// Largest pan and tilt to each side, radians; the roll is half as large.
    pub angle: f64,
    /// Largest offset to each side, up and down, metres.
    pub shift: f64,
    /// Highest frequency of the oscillation, Hz.
    pub frequency: f64,
    /// Shakes with different seeds are independent.
    pub seed: u32,
}
