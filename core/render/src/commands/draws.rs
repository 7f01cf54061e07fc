//! Draws as commands. State that is already bound is not bound again.

use crate::commands::deferred::gbuffer_key;
use crate::commands::scene::ScenePass;
use crate::commands::texture_limit::fit_texture_limit;
use crate::commands::{Command, Cull, MAX_UNIFORM_JOINTS, Recorder, cull_of, texture_slots};
use crate::plan::{Draw, Features, PipelineKey, Plan};
use crate::scene_resources::vertex_layout::VertexLayout;
use crate::shader::{DeferredPass, InputTargets, LightLoop, PeelPass, SceneVariant};
use glam::Vec4;

/// Depth peeling: ends the scene's pass, finds and blends each layer, then blends nearer surfaces in sorted order.
pub(super) fn record_peeled_layers(
    recorder: Recorder,
    commands: &mut Vec<Command>,
    &ScenePass { target, samples, area, .. }: &ScenePass,
    layers: u32,
    transparent: &[Draw],
) {
    let mut pass = |begin: Command, peel: PeelPass| {
        commands.extend([Command::EndPass, begin]);
        let mut draws = DrawRecorder::new(recorder, commands);
        draws.peel = peel;
        transparent.iter().for_each(|draw| draws.draw(draw, cull_of(draw)));
    };
    let peel = if samples > 1 { PeelPass::Several } else { PeelPass::One };
    for layer in 0..layers {
        pass(Command::BeginPeel { layer, samples, area }, peel);
        pass(Command::BeginLayer { layer, nearer: false, target, samples, area }, PeelPass::No);
    }
    pass(Command::BeginLayer { layer: layers - 1, nearer: true, target, samples, area }, PeelPass::No);
    commands.push(Command::EndPass);
}

/// Records the draws of a pass, and keeps track of the bound state.
pub(super) struct DrawRecorder<'a> {
    pub recorder: Recorder<'a>,
    pub commands: &'a mut Vec<Command>,
    /// Whether the pass draws into shadow maps.
    pub shadow_pass: bool,
    /// Whether the pass draws into the G-buffer.
    pub gbuffer: bool,
    /// Whether and how the pass draws the inputs of effects.
    pub inputs: InputTargets,
    pub peel: PeelPass,
    bound: BoundState,
}

#[derive(Default)]
struct BoundState {
    cull: Option<Cull>,
    pipeline: Option<SceneVariant>,
    material: Option<(u32, Option<u32>, u32)>,
    mesh: Option<(u32, VertexLayout, bool)>,
}

impl<'a> DrawRecorder<'a> {
    pub(super) fn new(recorder: Recorder<'a>, commands: &'a mut Vec<Command>) -> DrawRecorder<'a> {
        let bound = BoundState::default();
        let (inputs, peel) = (InputTargets::No, PeelPass::No);
        DrawRecorder { recorder, commands, shadow_pass: false, gbuffer: false, inputs, peel, bound }
    }

    /// Forgets the bound state. A pass begins with nothing bound.
    pub(crate) fn forget_bound_state(&mut self) {
        self.bound = BoundState::default();
    }

    pub(crate) fn set_cull(&mut self, cull: Cull) {
        if self.bound.cull != Some(cull) {
            self.commands.push(Command::SetCull(cull));
            self.bound.cull = Some(cull);
        }
    }

    /// Records a full-screen draw, which binds its own pipeline.
    pub(crate) fn draw_full_screen(&mut self, command: Command) {
        self.set_cull(Cull::None);
        self.commands.push(command);
        self.bound.pipeline = None;
    }

    /// Records a draw without the faces that `cull` names, and without the back faces of watertight surfaces.
    pub(super) fn draw(&mut self, draw: &Draw, cull: Cull) {
        let index_count = 3 * (self.recorder.triangles)(draw.primitive) as u32;
        let watertight = draw.watertight.min(index_count);
        let ranges = match cull {
            _ if watertight == 0 => [(cull, None), (cull, Some([0, 0]))],
            Cull::None => [
                (Cull::Back, Some([0, watertight])),
                (Cull::None, Some([watertight, index_count - watertight])),
            ],
            Cull::Back => [(Cull::Back, None), (cull, Some([0, 0]))],
            Cull::Front => {
                [(Cull::Front, Some([watertight, index_count - watertight])), (cull, Some([0, 0]))]
            }
        };
        for (cull, indices) in ranges {
            if indices.is_none_or(|[_, count]| count > 0) {
                self.draw_indices(draw, cull, indices.filter(|i| *i != [0, index_count]));
            }
        }
    }

    fn draw_indices(&mut self, draw: &Draw, cull: Cull, indices: Option<[u32; 2]>) {
        let variant = self.scene_variant(draw);
        let features = variant.key.features;
        if self.bound.pipeline != Some(variant) {
            self.commands.push(Command::BindPipeline(variant));
            self.bound.pipeline = Some(variant);
        }
        self.set_cull(cull);
        let slots = texture_slots(features);
        let depth_only = self.shadow_pass || self.inputs != InputTargets::No;
        let reads_material = !depth_only || features.has(Features::ALPHA_MASK);
        let Draw { material, material_override, .. } = *draw;
        if reads_material && self.bound.material != Some((material, material_override, slots)) {
            self.commands.push(Command::BindMaterial { material, material_override, slots });
            self.bound.material = Some((material, material_override, slots));
        }
        let order = if draw.watertight > 0 { VertexLayout::WATERTIGHT_FIRST } else { 0 };
        let layout = VertexLayout(VertexLayout::of(features).0 | order);
        let mesh = (draw.primitive, layout, features.has(Features::MORPH));
        if self.bound.mesh != Some(mesh) {
            self.commands.push(Command::BindMesh { primitive: mesh.0, layout: mesh.1, morphs: mesh.2 });
            self.bound.mesh = Some(mesh);
        }
        let Draw { first_instance, instance_count, .. } = *draw;
        self.commands.push(Command::Draw { first_instance, instance_count, indices });
    }

    fn scene_variant(&self, draw: &Draw) -> SceneVariant {
        let Recorder { plan, options, .. } = self.recorder;
        let mut key = if self.gbuffer { gbuffer_key(draw.pipeline) } else { draw.pipeline };
        key.features = fit_texture_limit(key.features, options.textures).0;
        key.coverage &= !options.no_coverage;
        key.peeled &= !options.no_depth_peeling;
        let first = draw.first_instance as usize;
        let end = (first + draw.instance_count as usize).min(plan.instances.len());
        let drawn = plan.instances.get(first..end).unwrap_or(&[]);
        SceneVariant {
            key,
            // The inputs of effects store indices in `Instance::tint`, not a color.
            tint: self.inputs == InputTargets::No && drawn.iter().any(|i| i.tint != Vec4::ONE),
            joints_uniform: key.features.has(Features::SKIN)
                && plan.joint_matrices.len() <= MAX_UNIFORM_JOINTS,
            lights: match key.features.is_lit() && !self.gbuffer {
                true => light_loop(plan, &key),
                false => LightLoop::All,
            },
            shadow_pass: self.shadow_pass,
            peel: self.peel,
            inputs: self.inputs,
            deferred: if self.gbuffer { DeferredPass::Geometry } else { DeferredPass::No },
        }
    }
}

/// The lights that a lit pixel evaluates.
pub(super) fn light_loop(plan: &Plan, key: &PipelineKey) -> LightLoop {
    match &plan.light_clusters {
        // A lighting effect may add light beyond the range of a light, so it needs all of them.
        Some(_) if key.lighting == 0 => LightLoop::Clusters,
        _ if plan.lights.len() == 1 => LightLoop::One,
        _ => LightLoop::All,
    }
}
