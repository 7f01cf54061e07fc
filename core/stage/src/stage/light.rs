//! Lights of a stage, and their shadows.

use crate::stage::actor::Attachment;
use crate::stage::channel::Channel;
use choreo_asset::Light;
use glam::{DVec3, Vec3};

#[derive(Clone, Debug, PartialEq)]
pub struct StageLight {
    pub name: String,
    pub light: Light,
    pub position: DVec3,
    /// Unit vector along which the light shines (directional and spot).
    pub direction: Vec3,
    /// Moves with an actor or joint: position and direction are then in its space.
    pub parent: Option<Attachment>,
    pub channels: Vec<Channel>,
    /// Casts one, drawn so; `None`: shines through everything.
    pub shadow: Option<Shadow>,
    /// Falls off by 1 / (constant + linear · d + square · d²) in place of 1 / d²; points and spots.
    pub attenuation: Option<[f32; 3]>,
}

/// How the shadow of a light is drawn: a map of depths seen from the light, looked up by what is lit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shadow {
    /// The most texels along a side of a map; 64 to 4096.
    pub size: u32,
    /// Metres over which an edge goes from dark to light, ≥ 0. A map is as coarse as this allows: a soft shadow costs less.
    pub softness: f32,
}

impl Shadow {
    pub const SIZES: std::ops::RangeInclusive<u32> = 64..=4096;
}

impl Default for Shadow {
    fn default() -> Shadow {
        Shadow { size: 2048, softness: 0.01 }
    }
}
