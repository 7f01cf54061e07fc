//! The scene's passes: background, opaque draws, transparent draws and overlays.

use crate::commands::draws::{DrawRecorder, record_peeled_layers};
use crate::commands::{
    Command, Cull, PassPart, Recorder, Target, cull_of, deferred, record_gbuffer, separate_faces_are_faster,
};
use crate::plan::{Draw, Glass, Plan, TopologyKey};
use choreo_stage::Background;
use glam::Vec4;

/// Target, render area and background of a scene pass.
#[derive(Clone, Copy)]
pub(super) struct ScenePass {
    pub target: Target,
    pub samples: u32,
    /// Render area; `None`: everything.
    pub area: Option<[u32; 4]>,
    depth: bool,
    /// Whether the pass loads the depth of the G-buffer pass.
    loads_depth: bool,
    sky: bool,
    /// Whether the background is copied from the host instead of drawn.
    copies_background: bool,
    gradient: bool,
}

impl ScenePass {
    fn new(recorder: Recorder, target: Target, deferred: bool) -> ScenePass {
        let Recorder { plan, options, .. } = recorder;
        let sky = plan.sky.is_some_and(|sky| sky.background);
        let gradient = !sky && matches!(plan.background, Background::Gradient { .. });
        let no_effects = plan.background_effects == 0;
        let no_overlay = plan.overlay.parts.is_empty();
        let copies_background =
            gradient && no_effects && options.cpu_device && plan.samples == 1 && target == Target::Image;
        let resolves = plan.samples > 1 && target == Target::Image && plan.scene_color_copy.is_none();
        let only_surfaces = !sky && no_effects && plan.layers_behind.is_none() && no_overlay;
        let partial = options.cpu_device && resolves && only_surfaces;
        ScenePass {
            target,
            samples: plan.samples,
            area: if partial { plan.dirty_rect.part_of(plan.size) } else { None },
            // A gradient alone needs no depth test.
            depth: !plan.draws.is_empty() || !no_overlay,
            loads_depth: deferred,
            sky,
            copies_background,
            gradient,
        }
    }

    fn clear_color(&self, plan: &Plan) -> Option<Vec4> {
        match plan.background {
            _ if self.sky => Some(Vec4::ZERO),
            Background::Color(c) => Some(c),
            Background::Gradient { .. } => (!self.copies_background).then_some(Vec4::ZERO),
        }
    }

    fn begin_command(&self, clear: Option<Vec4>, part: PassPart) -> Command {
        let ScenePass { target, samples, area, depth, loads_depth, .. } = *self;
        Command::BeginPass { target, samples, clear, depth, part, loads_depth, area }
    }
}

pub(super) fn record_scene(recorder: Recorder, target: Target, commands: &mut Vec<Command>) {
    let Recorder { plan, options, .. } = recorder;
    let deferred = plan.deferred.as_ref().filter(|_| !options.no_deferred && plan.samples == 1);
    let peeling = plan.depth_peeling.filter(|_| !options.no_depth_peeling);
    let pass = ScenePass::new(recorder, target, deferred.is_some());
    if pass.copies_background || pass.area.is_some() {
        commands.push(Command::CopyBackground);
    }
    if deferred.is_some() {
        record_gbuffer(recorder, commands);
    }
    let part = match plan.scene_color_copy {
        Some(_) => PassPart::UntilCopy,
        None if peeling.is_some() => PassPart::UntilLayers,
        None => PassPart::Whole,
    };
    commands.push(pass.begin_command(pass.clear_color(plan), part));
    let mut draws = DrawRecorder::new(recorder, commands);
    if let Some(deferred) = deferred {
        deferred::record_lighting(deferred, &mut draws);
    }
    let is_transparent = |d: &Draw| d.pipeline.is_transparent();
    let first_transparent = plan.draws.iter().position(is_transparent).unwrap_or(plan.draws.len());
    let (opaque, transparent) = plan.draws.split_at(first_transparent);
    record_opaque(&mut draws, opaque, deferred.is_some());
    record_background(&mut draws, &pass);
    match peeling {
        Some(peeling) => {
            let commands = draws.commands;
            record_peeled_layers(recorder, commands, &pass, peeling.layers, transparent);
            commands.push(pass.begin_command(None, PassPart::AfterLayers));
            commands.extend((!plan.overlay.parts.is_empty()).then_some(Command::SetCull(Cull::None)));
        }
        None => {
            record_sorted_transparent(&mut draws, &pass, transparent);
            if !plan.overlay.parts.is_empty() {
                draws.set_cull(Cull::None);
            }
        }
    }
    commands.extend(plan.overlay.parts.iter().map(|part| Command::DrawOverlay {
        effect: part.effect.clone(),
        over: part.over,
        first: part.first,
        count: part.count,
    }));
    commands.push(Command::EndPass);
}

fn record_opaque(draws: &mut DrawRecorder, opaque: &[Draw], deferred: bool) {
    let Recorder { plan, options, triangles } = draws.recorder;
    let forward_draws = || opaque.iter().filter(|d| !deferred || !d.deferred);
    let split = options.cpu_device && separate_faces_are_faster(plan, forward_draws(), triangles);
    let draws_back_faces_last =
        |d: &Draw| split && d.pipeline.double_sided && d.pipeline.topology == TopologyKey::Triangles;
    for draw in forward_draws() {
        draws.draw(draw, if draws_back_faces_last(draw) { Cull::Back } else { cull_of(draw) });
    }
    for draw in forward_draws().filter(|d| draws_back_faces_last(d)) {
        draws.draw(draw, Cull::Front);
    }
}

/// Records the background. Transparent surfaces blend over it, so it is drawn before them.
fn record_background(draws: &mut DrawRecorder, pass: &ScenePass) {
    let plan = draws.recorder.plan;
    let surface = plan.background_effects;
    if pass.sky || ((pass.gradient || surface != 0) && !pass.copies_background) {
        draws.draw_full_screen(match pass.sky {
            true => Command::DrawSky { surface, display: plan.display },
            false => Command::DrawBackground { surface },
        });
    }
    if plan.layers_behind.is_some() {
        draws.draw_full_screen(Command::DrawLayersBehind);
    }
}

/// Records transparent draws in sorted order. The scene color is copied before the first refracting draw, so all refracting
/// surfaces show only surfaces that are farther away than that draw.
fn record_sorted_transparent(draws: &mut DrawRecorder, pass: &ScenePass, transparent: &[Draw]) {
    let first_refracting = transparent.iter().position(|d| d.pipeline.glass == Glass::Refract);
    for (index, draw) in transparent.iter().enumerate() {
        if let (Some(copy), true) = (draws.recorder.plan.scene_color_copy, Some(index) == first_refracting) {
            draws.commands.extend([
                Command::EndPass,
                Command::CopySceneColor { from: pass.target, levels: copy.levels },
                pass.begin_command(None, PassPart::AfterCopy),
            ]);
            draws.forget_bound_state();
        }
        draws.draw(draw, cull_of(draw));
    }
}
