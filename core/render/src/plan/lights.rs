//! Lights as shaders read them.

use glam::Vec4;

/// A camera-relative light. Laid out as the shader reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct PlanLight {
    /// xyz: position (point, spot). w: 1/range², or 0 without a range; negative: −1 − the quadratic share of a polynomial.
    pub position: Vec4,
    /// xyz: unit direction in which it shines. w: 0 directional, 1 point, 2 spot; see [`PlanLight::light_type`].
    pub direction: Vec4,
    /// xyz: color · intensity, linear. w: the linear share of a polynomial, whose rest is constant.
    pub color: Vec4,
    /// Spot: x = angle scale, y = angle offset (KHR_lights_punctual, "Inner and Outer Cone Angles").
    /// z = its first view in `ShadowMaps::views`, w = its number of views.
    pub cone: Vec4,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightType {
    Directional,
    Point,
    Spot,
}

impl PlanLight {
    pub fn light_type(&self) -> LightType {
        match self.direction.w {
            0.0 => LightType::Directional,
            2.0 => LightType::Spot,
            _ => LightType::Point,
        }
    }

    /// Distance in meters beyond which a point or spot light has no effect.
    pub(crate) fn range(&self) -> Option<f32> {
        let ranged = self.light_type() != LightType::Directional && self.position.w > 0.0;
        ranged.then(|| 1.0 / self.position.w.sqrt())
    }

    /// Cosine of a spot's outer cone angle, from clamp(cos · scale + offset).
    pub(crate) fn cos_outer(&self) -> f32 {
        -self.cone.y / self.cone.x
    }
}

/// The sky; its maps are in the scene resources.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanSky {
    /// Cosine and sine of its rotation about +Y.
    pub turn: [f32; 2],
    pub strength: f32,
    /// Drawn behind everything, in place of the background.
    pub background: bool,
}
