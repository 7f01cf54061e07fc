//! Motion of a camera on top of its rig: it turns to targets one after the other, and shakes.

use crate::stage::actor::Target;
use choreo_motion::Time;

/// A target of a camera from a time on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraLook {
    /// `None`: where its rig looks.
    pub target: Option<Target>,
    /// Time from which it turns there.
    pub start: Time,
    /// How long it takes to turn there.
    pub blend: Time,
}

/// A handheld camera, or one in a collision: smooth noise about its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraShake {
    /// Time at which it begins.
    pub start: Time,
    /// Time at which it has ended; `None`: it goes on.
    pub end: Option<Time>,
    /// Duration of the fade-in and of the fade-out.
    pub fade: Time,
    /// Most that it pans and tilts to each side, radians; it rolls half as far.
    pub angle: f64,
    /// Most that it moves to each side, up and down, metres.
    pub shift: f64,
    /// How often it goes to and fro at most, Hz.
    pub frequency: f64,
    /// Shakes with different seeds are independent.
    pub seed: u32,
}
