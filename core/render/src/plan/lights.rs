//! Lights as shaders read them.

use glam::{Vec2, Vec3};

/// The type of a light; shaders/frame.wgsl has the same constants.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::NoUninit)]
pub enum LightType {
    Directional = 0,
    Point = 1,
    Spot = 2,
}

/// A camera-relative light. Laid out as the shader reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::NoUninit)]
pub struct PlanLight {
    /// Position of point and spot lights.
    pub position: Vec3,
    pub kind: LightType,
    /// Unit direction in which it shines.
    pub direction: Vec3,
    /// Its first view in `ShadowMaps::views`, and its number of views.
    pub shadow_views: [u16; 2],
    /// Color · intensity, linear.
    pub color: Vec3,
    /// 1/range², or 0 without a range.
    pub inverse_range_squared: f32,
    /// Spot lights: scale and offset of the cosine (KHR_lights_punctual, "Inner and Outer Cone Angles").
    pub cone: Vec2,
    /// Falloff by a polynomial of the distance: the shares of its linear and its quadratic term, whose rest is constant.
    /// [`PlanLight::INVERSE_SQUARE`]: physical falloff.
    pub polynomial: Vec2,
}

impl PlanLight {
    pub const INVERSE_SQUARE: Vec2 = Vec2::new(0.0, -1.0);

    pub fn is_local(&self) -> bool {
        self.kind != LightType::Directional
    }

    /// Whether it falls off by a polynomial.
    pub fn is_polynomial(&self) -> bool {
        self.polynomial.y >= 0.0
    }

    /// Distance in meters beyond which a point or spot light has no effect.
    pub(crate) fn range(&self) -> Option<f32> {
        (self.inverse_range_squared > 0.0).then(|| 1.0 / self.inverse_range_squared.sqrt())
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
