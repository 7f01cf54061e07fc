//! Lights as shaders read them, and the light that a point receives from one of them.

use crate::lanes::{F4, V3};
use crate::plan::View;
use crate::view::camera_relative;
use choreo_asset::LightKind;
use choreo_stage::LightState;
use glam::{Vec2, Vec3};

/// The type of a light; shaders/lights.wgsl has the same constants.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::NoUninit)]
pub enum LightType {
    Directional = 0,
    Point = 1,
    Spot = 2,
}

impl From<LightKind> for LightType {
    fn from(kind: LightKind) -> LightType {
        match kind {
            LightKind::Directional => LightType::Directional,
            LightKind::Point => LightType::Point,
            LightKind::Spot { .. } => LightType::Spot,
        }
    }
}

/// A camera-relative light. Laid out as the shader reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::NoUninit)]
pub struct PlanLight {
    /// Position of point and spot lights.
    pub position: Vec3,
    pub kind: LightType,
    /// Unit direction in which the light shines.
    pub direction: Vec3,
    /// The light's first view in `ShadowMaps::views`, and its number of views.
    pub shadow_views: [u16; 2],
    /// Color · intensity / π, linear, intensity in lux or candela. The BRDFs are multiplied by π in return (glTF's diffuse BRDF
    /// has 1/π).
    pub color: Vec3,
    /// 1/range², or 0 without a range.
    pub inverse_range_squared: f32,
    /// Spot lights: scale and offset of the cosine (KHR_lights_punctual, "Inner and Outer Cone Angles").
    pub cone: Vec2,
    /// Weights of the linear and the quadratic term of a polynomial falloff over distance; the constant term has the rest, so
    /// that all sum to 1. [`PlanLight::INVERSE_SQUARE`]: physical falloff.
    pub polynomial: Vec2,
}

impl PlanLight {
    pub const INVERSE_SQUARE: Vec2 = Vec2::new(0.0, -1.0);

    /// The light relative to the camera; `None` if it does not shine.
    pub(crate) fn new(state: &LightState, view: &View) -> Option<PlanLight> {
        let light = &state.light;
        let local = !light.kind.is_directional();
        let color = light.color * (light.intensity * std::f32::consts::FRAC_1_PI);
        let position = if local { camera_relative(state.position, view) } else { Vec3::ZERO };
        let finite = color.is_finite() && position.is_finite() && state.direction.is_finite();
        if !finite || color == Vec3::ZERO {
            return None;
        }
        let inverse_range_squared = light.range.filter(|r| *r > 0.0 && local).map_or(0.0, |r| 1.0 / (r * r));
        // The coefficients are divided by their sum, and so is the color.
        let polynomial = state.attenuation.filter(|_| local).map(|a| (a, a[0] + a[1] + a[2]));
        let (inverse_range_squared, polynomial, color) = match polynomial {
            // The quadratic weight is rounded to a multiple of 2⁻²³, so that a negligible one becomes 0.
            Some((a, sum)) => (0.0, Vec2::new(a[1] / sum, (1.0 + a[2] / sum) - 1.0), color / sum),
            None => (inverse_range_squared, PlanLight::INVERSE_SQUARE, color),
        };
        // KHR_lights_punctual, "Inner and Outer Cone Angles".
        let cone = light.kind.cone().map_or(Vec2::ZERO, |[inner, outer]| {
            let (cos_inner, cos_outer) = (libm::cosf(inner), libm::cosf(outer));
            let scale = 1.0 / (cos_inner - cos_outer).max(0.001);
            Vec2::new(scale, -cos_outer * scale)
        });
        Some(PlanLight {
            position,
            kind: light.kind.into(),
            direction: state.direction,
            shadow_views: [0; 2],
            color,
            inverse_range_squared,
            cone,
            polynomial,
        })
    }

    /// Direction to the light and its strength, at four points. CPU reference of `incoming` in lights.wgsl.
    /// KHR_lights_punctual: inverse square, window max(1 − (d/range)⁴, 0), and the squared cone falloff clamp(cos · scale + offset).
    pub(crate) fn incoming(&self, relative: V3) -> (V3, F4) {
        let shines = V3::splat(self.direction);
        if self.kind == LightType::Directional {
            return (-shines, F4::ONE);
        }
        let offset = V3::splat(self.position) - relative;
        let d2 = offset.dot(offset).max(F4::splat(1e-8));
        let to_light = offset * (F4::ONE / d2.sqrt());
        let x = d2 * self.inverse_range_squared;
        let mut strength = (F4::ONE - x * x).clamp(0.0, 1.0) / d2;
        if self.is_polynomial() {
            let (first, square) = (self.polynomial.x, self.polynomial.y);
            let falloff = d2.sqrt() * first + d2 * square + F4::splat(1.0 - first - square);
            strength = F4::ONE / falloff;
        }
        if self.kind == LightType::Spot {
            let cos = -shines.dot(to_light);
            let cone = (cos * self.cone.x + self.cone.y).clamp(0.0, 1.0);
            strength *= cone * cone;
        }
        (to_light, strength)
    }

    pub fn is_local(&self) -> bool {
        self.kind != LightType::Directional
    }

    /// Whether the light has a polynomial falloff.
    pub(crate) fn is_polynomial(&self) -> bool {
        self.polynomial.y >= 0.0
    }

    /// Distance in metres beyond which a point or spot light has no effect.
    pub(crate) fn range(&self) -> Option<f32> {
        (self.inverse_range_squared > 0.0).then(|| 1.0 / self.inverse_range_squared.sqrt())
    }

    /// Cosine of a spot's outer cone angle, from clamp(cos · scale + offset); −1 for a light that shines in all directions.
    pub(crate) fn cos_outer(&self) -> f32 {
        if self.kind == LightType::Spot { -self.cone.y / self.cone.x } else { -1.0 }
    }
}

/// The sky; its maps are in the scene resources.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanSky {
    /// Cosine and sine of the sky's rotation about +Y.
    pub turn: [f32; 2],
    pub strength: f32,
    /// Whether the sky is drawn as the background.
    pub background: bool,
}
