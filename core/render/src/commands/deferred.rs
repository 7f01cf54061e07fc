//! Deferred shading as commands: surfaces into the G-buffer, then lighting.

use crate::commands::draws::{DrawRecorder, light_loop};
use crate::commands::{Command, Cull, Recorder, cull_of};
use crate::plan::deferred::LIGHTS;
use crate::plan::{Deferred, Features, PipelineKey, features_layers};
use crate::shader::{DeferredPass, PeelPass, SceneVariant};

/// The pass before the scene's own: depth and G-buffer of the deferred surfaces.
pub(super) fn record_gbuffer(recorder: Recorder, commands: &mut Vec<Command>) {
    commands.push(Command::BeginGeometry);
    let mut draws = DrawRecorder::new(recorder, commands);
    draws.gbuffer = true;
    recorder.plan.draws.iter().filter(|d| d.deferred).for_each(|draw| draws.draw(draw, cull_of(draw)));
    commands.push(Command::EndPass);
}

/// Lights the G-buffer, first in the scene's pass.
pub(super) fn record_lighting(deferred: &Deferred, draws: &mut DrawRecorder) {
    let plan = draws.recorder.plan;
    let key = PipelineKey { surface: deferred.surface, ..PipelineKey::of(deferred.features) };
    let variant = SceneVariant {
        key,
        tint: false,
        joints_uniform: false,
        lights: light_loop(plan, &key),
        shadow_pass: false,
        peel: PeelPass::No,
        deferred: DeferredPass::Light,
    };
    draws.set_cull(Cull::None);
    draws.commands.push(Command::BindPipeline(variant));
    draws.draw_full_screen(Command::DrawLight { area: plan.dirty_rect.part_of(plan.size) });
}

/// The G-buffer pass's key of a draw with a forward key.
pub(super) fn gbuffer_key(key: PipelineKey) -> PipelineKey {
    // Layers that are forced on and change no pixel.
    let layers = features_layers::TEXTURES.iter().fold(features_layers::ALL, |all, f| all.with(*f));
    let features = key.features.without(LIGHTS.with(layers).with(Features::SEEN_JOINTS));
    PipelineKey { features, surface: 0, ..key }
}
