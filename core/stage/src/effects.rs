//! Effects in use: on what, while what, with which parameters at a time.

use crate::snapshot::EffectState;
use crate::stage::Stage;
use crate::stage::edits::FrameEdits;
use crate::stage::effects::put;
use choreo_motion::Time;

/// `camera`: the one that is on.
pub(crate) fn evaluate(
    stage: &Stage,
    edits: &FrameEdits,
    time: Time,
    camera: Option<usize>,
    out: &mut Vec<EffectState>,
) {
    out.clear();
    for (effect, used) in stage.effects.iter().enumerate() {
        let in_time = used.start <= time && used.end.is_none_or(|end| time < end);
        let in_view = used.cameras.is_empty() || camera.is_some_and(|c| used.cameras.contains(&c));
        if !in_time || !in_view {
            continue;
        }
        let mut parameters = used.parameters_at(time);
        for edit in edits.effects.iter().filter(|e| e.effect == effect) {
            put(&mut parameters, &edit.parameter, edit.value);
        }
        out.push(EffectState { effect, parameters });
    }
}
