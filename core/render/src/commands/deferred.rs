//! Deferred shading as commands: surfaces into the G-buffer, then lighting.

use crate::commands::draws::{DrawRecorder, light_loop};
use crate::commands::{Command, Cull, Recorder, cull_of};
use crate::plan::{Deferred, Features, PipelineKey};
use crate::shader::{DeferredPass, SceneVariant};

/// Records the G-buffer pass, which precedes the scene pass: depth and G-buffer of the deferred surfaces.
pub(super) fn record_gbuffer(recorder: Recorder, commands: &mut Vec<Command>) {
    commands.push(Command::BeginGBuffer);
    let mut draws = DrawRecorder::new(recorder, commands);
    draws.gbuffer = true;
    recorder.plan.draws.iter().filter(|d| d.deferred).for_each(|draw| draws.draw(draw, cull_of(draw)));
    commands.push(Command::EndPass);
}

/// Records the lighting of the G-buffer, the first draw of the scene pass.
pub(super) fn record_lighting(deferred: &Deferred, draws: &mut DrawRecorder) {
    let plan = draws.recorder.plan;
    let key = PipelineKey { surface: deferred.surface, ..PipelineKey::of(deferred.features) };
    let lights = light_loop(plan, &key);
    let variant = SceneVariant { lights, deferred: DeferredPass::Light, ..SceneVariant::of(key) };
    draws.set_cull(Cull::None);
    draws.commands.push(Command::BindPipeline(variant));
    draws.draw_full_screen(Command::DrawDeferredLighting { area: plan.dirty_rect.part_of(plan.size) });
}

/// Pipeline key of a draw in the G-buffer pass, from its key in forward shading.
pub(super) fn gbuffer_key(key: PipelineKey) -> PipelineKey {
    // The G-buffer pass reads no lights. A material layer is set here only if it is forced on, and then it changes no pixel.
    let unread = Features::LIGHTS.with(Features::ALL_LAYERS).with(Features::EFFECT_JOINTS);
    let features = key.features.without(unread);
    PipelineKey { features, surface: 0, ..key }
}
