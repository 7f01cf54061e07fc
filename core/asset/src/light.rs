//! Lights of a file (KHR_lights_punctual).

use glam::Vec3;

/// A light of the file: shines along its joint's −Z.
#[derive(Clone, Debug, PartialEq)]
pub struct AssetLight {
    pub name: String,
    pub joint: u32,
    pub light: Light,
}

/// KHR_lights_punctual: colour is linear and multiplied by intensity
/// (lux for directional, candela for point and spot).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    pub kind: LightKind,
    pub color: Vec3,
    pub intensity: f32,
    /// Metres; `None` = unlimited. Point and spot only.
    pub range: Option<f32>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    Directional,
    Point,
    /// Half angles in radians, `0 ≤ inner < outer ≤ π/2`.
    Spot {
        inner: f32,
        outer: f32,
    },
}
