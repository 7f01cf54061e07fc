//! Lights and sky of a frame.

use crate::plan::{PlanLight, PlanSky, View};
use choreo_stage::{LightState, Shadow, SkyState};

/// Lights that shine, the shadow settings of each, and the number of lights that do not shine.
pub(super) fn plan_lights(
    lights: &[LightState],
    view: &View,
) -> (Vec<PlanLight>, Vec<Option<Shadow>>, usize) {
    let shining = lights.iter().filter_map(|state| Some((PlanLight::new(state, view)?, state.shadow)));
    let (out, shadows): (Vec<_>, Vec<_>) = shining.unzip();
    let dark = lights.len() - out.len();
    (out, shadows, dark)
}

/// The sky as the plan stores it; `None` if neither a surface nor the background shows it.
pub(super) fn plan_sky(sky: &SkyState, lights: bool) -> Option<PlanSky> {
    let turn = [libm::cos(sky.turn) as f32, libm::sin(sky.turn) as f32];
    let finite = turn.iter().all(|v| v.is_finite()) && sky.strength.is_finite();
    let used = finite && (lights || sky.background);
    used.then_some(PlanSky { turn, strength: sky.strength, background: sky.background })
}
