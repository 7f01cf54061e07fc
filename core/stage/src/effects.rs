//! Effects in use: which are on at a time, and with which parameters.

use crate::snapshot::{ActorState, CameraState, EffectState};
use crate::stage::Stage;
use crate::stage::edits::FrameEdits;
use crate::stage::effects::set_parameter;
use crate::transforms::target_position;
use choreo_motion::Time;

/// Fills `out` with the effects that are active at a time. `camera`: state of the camera whose image they change.
pub(crate) fn evaluate_effects(
    stage: &Stage,
    edits: &FrameEdits,
    time: Time,
    camera: &CameraState,
    actors: &[ActorState],
    out: &mut Vec<EffectState>,
) {
    out.clear();
    for (effect, used) in stage.effects.iter().enumerate() {
        let in_view = used.cameras.is_empty() || camera.camera.is_some_and(|c| used.cameras.contains(&c));
        if !used.is_active(time) || !in_view {
            continue;
        }
        let mut parameters = used.parameters_at(time);
        for distance in &used.distances {
            if let Some(target) = target_position(stage, actors, &distance.target) {
                let metres = -camera.world_from_view.inverse().transform_point3(target).z;
                set_parameter(
                    &mut parameters,
                    &distance.parameter,
                    metres.clamp(distance.least, distance.most),
                );
            }
        }
        for edit in edits.effects.iter().filter(|e| e.effect == effect) {
            set_parameter(&mut parameters, &edit.parameter, edit.value);
        }
        out.push(EffectState { effect, parameters });
    }
}
