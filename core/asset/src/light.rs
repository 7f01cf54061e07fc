//! Lights of a file (KHR_lights_punctual).

use glam::Vec3;

/// A light of the file: shines along its joint's −Z.
#[derive(Clone, Debug, PartialEq)]
pub struct AssetLight {
    /// Name in the file.
    pub name: String,
    /// Joint that carries the light.
    pub joint: u32,
    /// The light; it shines along −Z of its joint.
    pub light: Light,
}

/// Color, intensity and type of a light as in KHR_lights_punctual: the linear color is multiplied by the intensity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Type of the light, with its parameters.
    pub kind: LightKind,
    /// Linear color, 1 = white.
    pub color: Vec3,
    /// Lux of directional lights, candela of others.
    pub intensity: f32,
    /// Range in metres; `None` = unlimited. Point and spot lights only.
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
    /// Name in reports: that of glTF's KHR_lights_punctual if it has the type.
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

    /// All types, in the order of their numbers, with parameters of 0.
    pub const ALL: [LightKind; 3] =
        [LightKind::Directional, LightKind::Point, LightKind::Spot { inner: 0.0, outer: 0.0 }];

    /// Number of the type, and its parameters, as used by content hashes and WebAssembly plugins. Types must keep their numbers,
    /// so that hashes stay valid.
    pub fn numbered(&self) -> (u8, Vec<f32>) {
        match *self {
            LightKind::Directional => (0, Vec::new()),
            LightKind::Point => (1, Vec::new()),
            LightKind::Spot { inner, outer } => (2, vec![inner, outer]),
        }
    }

    /// Mutable parameters, in the order of [`LightKind::numbered`].
    pub fn parameters_mut(&mut self) -> Vec<&mut f32> {
        match self {
            LightKind::Directional | LightKind::Point => Vec::new(),
            LightKind::Spot { inner, outer } => vec![inner, outer],
        }
    }

    /// Whether the light is infinitely far away: no position, no range, intensity in lux.
    pub fn is_directional(&self) -> bool {
        match self {
            LightKind::Directional => true,
            LightKind::Point | LightKind::Spot { .. } => false,
        }
    }

    /// Whether the direction of the light has an effect.
    pub fn has_direction(&self) -> bool {
        match self {
            LightKind::Directional | LightKind::Spot { .. } => true,
            LightKind::Point => false,
        }
    }

    /// Unit of the light's intensity.
    pub fn unit(&self) -> &'static str {
        if self.is_directional() { "lx" } else { "cd" }
    }

    /// Half angles of the inner and the outer cone, radians; `None` if the light is no spot.
    pub fn cone(&self) -> Option<[f32; 2]> {
        match *self {
            LightKind::Spot { inner, outer } => Some([inner, outer]),
            LightKind::Directional | LightKind::Point => None,
        }
    }

    /// Mutable half angles of [`LightKind::cone`].
    pub fn cone_mut(&mut self) -> Option<[&mut f32; 2]> {
        match self {
            LightKind::Spot { inner, outer } => Some([inner, outer]),
            LightKind::Directional | LightKind::Point => None,
        }
    }

    /// Describes invalid parameters; `None` if they are valid.
    pub fn problem(&self) -> Option<String> {
        let [inner, outer] = self.cone()?;
        let allowed = 0.0 <= inner && inner < outer && outer <= std::f32::consts::FRAC_PI_2 + 1e-6;
        (!allowed).then(|| format!("cone is {inner} to {outer} rad, must be 0 ≤ inner < outer ≤ π/2"))
    }
}

#[cfg(test)]
mod tests {
    use super::LightKind;

    #[test]
    fn numbers_and_parameters_of_light_types_match_their_order() {
        for (number, mut kind) in (0..).zip(LightKind::ALL) {
            let given = kind.parameters_mut().into_iter().zip(1u8..).map(|(parameter, value)| {
                *parameter = f32::from(value);
                f32::from(value)
            });
            let given: Vec<f32> = given.collect();
            assert_eq!(kind.numbered(), (number, given), "{}", kind.name());
        }
    }
}
