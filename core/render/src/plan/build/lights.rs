//! Lights and sky of a frame.

use crate::plan::view::relative;
use crate::plan::{LightType, PlanLight, PlanSky, View};
use choreo_asset::LightKind;
use choreo_stage::{LightState, Shadow, SkyState};
use glam::{Vec2, Vec3};

/// Lights that shine, the shadow settings of each, and the number of lights that do not shine.
pub(super) fn plan_lights(
    lights: &[LightState],
    view: &View,
) -> (Vec<PlanLight>, Vec<Option<Shadow>>, usize) {
    let mut out = Vec::with_capacity(lights.len());
    let mut shadows = Vec::with_capacity(lights.len());
    for state in lights {
        let light = &state.light;
        let color = light.color * light.intensity;
        let kind = match light.kind {
            LightKind::Directional => LightType::Directional,
            LightKind::Point => LightType::Point,
            LightKind::Spot { .. } => LightType::Spot,
        };
        let local = kind != LightType::Directional;
        let position = if local { relative(state.position, view) } else { Vec3::ZERO };
        let finite = color.is_finite() && position.is_finite() && state.direction.is_finite();
        if !finite || color == Vec3::ZERO {
            continue;
        }
        let inverse_range_squared = light.range.filter(|r| *r > 0.0 && local).map_or(0.0, |r| 1.0 / (r * r));
        // Shares of the polynomial; its sum is divided out of the color.
        let polynomial = state.attenuation.filter(|_| local).map(|a| (a, a[0] + a[1] + a[2]));
        let (inverse_range_squared, polynomial, color) = match polynomial {
            // Rounded to multiples of 2⁻²³: a share that is next to nothing is nothing.
            Some((a, sum)) => (0.0, Vec2::new(a[1] / sum, (1.0 + a[2] / sum) - 1.0), color / sum),
            None => (inverse_range_squared, PlanLight::INVERSE_SQUARE, color),
        };
        // KHR_lights_punctual, "Inner and Outer Cone Angles".
        let cone = if let LightKind::Spot { inner, outer } = light.kind {
            let (cos_inner, cos_outer) = (libm::cosf(inner), libm::cosf(outer));
            let scale = 1.0 / (cos_inner - cos_outer).max(0.001);
            Vec2::new(scale, -cos_outer * scale)
        } else {
            Vec2::ZERO
        };
        shadows.push(state.shadow);
        out.push(PlanLight {
            position,
            kind,
            direction: state.direction,
            shadow_views: [0; 2],
            color,
            inverse_range_squared,
            cone,
            polynomial,
        });
    }
    let dark = lights.len() - out.len();
    (out, shadows, dark)
}

/// `None` if neither a surface nor the background shows the sky.
pub(super) fn plan_sky(sky: &SkyState, lights: bool) -> Option<PlanSky> {
    let turn = [libm::cos(sky.turn) as f32, libm::sin(sky.turn) as f32];
    let finite = turn.iter().all(|v| v.is_finite()) && sky.strength.is_finite();
    let used = finite && (lights || sky.background);
    used.then_some(PlanSky { turn, strength: sky.strength, background: sky.background })
}
