//! Lights and sky of a frame.

use crate::plan::view::relative;
use crate::plan::{PlanLight, PlanSky, View};
use choreo_asset::LightKind;
use choreo_stage::{LightState, Shadow, SkyState};
use glam::{Vec3, Vec4};

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
        let (kind, inner, outer) = match light.kind {
            LightKind::Directional => (0.0, 0.0, 0.0),
            LightKind::Point => (1.0, 0.0, 0.0),
            LightKind::Spot { inner, outer } => (2.0, inner, outer),
        };
        let position = if kind == 0.0 { Vec3::ZERO } else { relative(state.position, view) };
        let finite = color.is_finite() && position.is_finite() && state.direction.is_finite();
        if !finite || color == Vec3::ZERO {
            continue;
        }
        let inverse_range_squared =
            light.range.filter(|r| *r > 0.0 && kind != 0.0).map_or(0.0, |r| 1.0 / (r * r));
        // Shares of the polynomial; its sum is divided out of the color.
        let polynomial = state.attenuation.filter(|_| kind != 0.0).map(|a| (a, a[0] + a[1] + a[2]));
        let (falloff, linear, color) = match polynomial {
            Some((a, sum)) => (-1.0 - a[2] / sum, a[1] / sum, color / sum),
            None => (inverse_range_squared, 0.0, color),
        };
        // KHR_lights_punctual, "Inner and Outer Cone Angles".
        let cone = if kind == 2.0 {
            let (cos_inner, cos_outer) = (libm::cosf(inner), libm::cosf(outer));
            let scale = 1.0 / (cos_inner - cos_outer).max(0.001);
            Vec4::new(scale, -cos_outer * scale, 0.0, 0.0)
        } else {
            Vec4::ZERO
        };
        shadows.push(state.shadow);
        out.push(PlanLight {
            position: position.extend(falloff),
            direction: state.direction.extend(kind),
            color: color.extend(linear),
            cone,
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
