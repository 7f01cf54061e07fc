//! Cameras of a stage, and the cuts between them.

use crate::stage::actor::Target;
use crate::stage::channel::Channel;
use choreo_asset::Projection;
use choreo_motion::Time;
use glam::{DQuat, DVec3};

#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    pub name: String,
    pub projection: Projection,
    pub rig: Rig,
    pub channels: Vec<Channel>,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Rig {
    /// Stands at `position`; looks at the target, else along −Z of `rotation`.
    Fixed { position: DVec3, rotation: DQuat, look_at: Option<Target> },
    /// Stands at target + offset (world axes) and looks at the target.
    Follow { target: Target, offset: DVec3 },
    /// Circles the target: angles in radians at time 0, radians a second. Azimuth 0 stands at +Z (before a glTF
    /// character's face), π/2 at +X; elevation π/2 looks straight down.
    Orbit { target: Target, distance: f64, elevation: f64, azimuth: f64, speed: f64 },
    /// The camera of an actor's file.
    File { actor: usize, camera: u32 },
    /// Stands still and fits everything that is visible at some time of the stage's length, from an azimuth and
    /// elevation in radians, as `Orbit` counts them. Flat ground is left out where there is anything else.
    Frame { azimuth: f64, elevation: f64 },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut {
    pub at: Time,
    pub camera: usize,
}
