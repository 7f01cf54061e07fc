//! Lights of a file (KHR_lights_punctual).

use glam::Vec3;

/// A light of the file: shines along its joint's −Z.
#[derive(Clone, Debug, PartialEq)]
pub struct AssetLight {
    /// Name in the file.
    pub name: String,
    /// Joint that carries it.
    pub joint: u32,
    /// The light; it shines along −Z of its joint.
    pub light: Light,
}

/// KHR_lights_punctual: color is linear and multiplied by intensity
/// (lux for directional, candela for point and spot).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// The shape of its light.
    pub kind: LightKind,
    /// Linear color, 1 = white.
    pub color: Vec3,
    /// Lux of directional lights, candela of others.
    pub intensity: f32,
    /// Metres; `None` = unlimited. Point and spot only.
    pub range: Option<f32>,
}

/// The type of a light, with the parameters that only this type has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Parallel rays, as of the sun.
    Directional,
    /// Rays in all directions from a point.
    Point,
    /// Half angles in radians, `0 ≤ inner < outer ≤ π/2`.
    Spot {
        /// The light is full within this angle from the axis.
        inner: f32,
        /// There is no light beyond this angle from the axis.
        outer: f32,
    },
}

impl LightKind {
    /// Its name in KHR_lights_punctual.
    pub fn name(&self) -> &'static str {
        match self {
            LightKind::Directional => "directional",
            LightKind::Point => "point",
            LightKind::Spot { .. } => "spot",
        }
    }

    /// The name in scripts' messages and in reports.
    pub fn title(&self) -> &'static str {
        match self {
            LightKind::Directional => "sun",
            LightKind::Point => "point light",
            LightKind::Spot { .. } => "spot light",
        }
    }

    /// Its number and its parameters as content hashes have them. The numbers stay, so that hashes do.
    pub fn hashed(&self) -> (u8, Vec<f32>) {
        match *self {
            LightKind::Directional => (0, Vec::new()),
            LightKind::Point => (1, Vec::new()),
            LightKind::Spot { inner, outer } => (2, vec![inner, outer]),
        }
    }

    /// Whether it shines from infinitely far away: without a position and a range, in lux.
    pub fn is_directional(&self) -> bool {
        *self == LightKind::Directional
    }

    /// Whether its direction has a meaning.
    pub fn has_direction(&self) -> bool {
        *self != LightKind::Point
    }

    /// Unit of its intensity.
    pub fn unit(&self) -> &'static str {
        if self.is_directional() { "lx" } else { "cd" }
    }

    /// Half angles of the inner and the outer cone, radians.
    pub fn cone(&self) -> Option<[f32; 2]> {
        match *self {
            LightKind::Spot { inner, outer } => Some([inner, outer]),
            _ => None,
        }
    }

    /// The half angles of [`LightKind::cone`], to be changed.
    pub fn cone_mut(&mut self) -> Option<[&mut f32; 2]> {
        match self {
            LightKind::Spot { inner, outer } => Some([inner, outer]),
            _ => None,
        }
    }

    /// The error of its parameters, if any.
    pub fn problem(&self) -> Option<String> {
        let [inner, outer] = self.cone()?;
        let allowed = 0.0 <= inner && inner < outer && outer <= std::f32::consts::FRAC_PI_2 + 1e-6;
        (!allowed).then(|| format!("cone is {inner} to {outer} rad, must be 0 ≤ inner < outer ≤ π/2"))
    }
}
