//! Draws as commands: what is bound already is not bound again; layers of what is seen through.

use crate::Plan;
use crate::commands::texture_limit::fitting;
use crate::commands::{Command, Cull, RecordOptions, Target, UNIFORM_JOINTS, cull_of, texture_slots};
use crate::plan::build::deferred::Deferred;
use crate::plan::{Draw, Features, PipelineKey};
use crate::scene_resources::vertex_layout::VertexLayout;
use crate::shader::{DeferredPass, LightLoop, PeelPass, SceneVariant};
use glam::Vec4;

/// The picture's pass is ended; then each layer is found and mixed, and what is nearer than all of them is mixed as it is sorted.
pub fn layers(
    plan: &Plan,
    mut commands: Vec<Command>,
    (target, area, options): (Target, Option<[u32; 4]>, RecordOptions),
    layers: u32,
    draws: &[Draw],
    triangles: &dyn Fn(u32) -> usize,
) -> Vec<Command> {
    let samples = plan.samples;
    let mut pass = |begin: Command, peel: PeelPass| {
        commands.extend([Command::EndPass, begin]);
        let mut state = DrawState::new(plan, std::mem::take(&mut commands), false, options, triangles);
        state.peel = peel;
        draws.iter().for_each(|draw| state.draw(draw, cull_of(draw)));
        commands = state.commands;
    };
    let peel = if samples > 1 { PeelPass::Several } else { PeelPass::One };
    for layer in 0..layers {
        pass(Command::BeginPeel { layer, samples, area }, peel);
        pass(Command::BeginLayer { layer, rest: false, target, samples, area }, PeelPass::No);
    }
    pass(Command::BeginLayer { layer: layers - 1, rest: true, target, samples, area }, PeelPass::No);
    commands.push(Command::EndPass);
    commands
}

/// What is bound, so that nothing is bound twice.
pub struct DrawState<'a> {
    plan: &'a Plan,
    pub commands: Vec<Command>,
    shadow_pass: bool,
    cull: Option<Cull>,
    pub pipeline: Option<SceneVariant>,
    material: Option<(u32, Option<u32>, u32)>,
    mesh: Option<(u32, VertexLayout, bool)>,
    options: RecordOptions,
    /// Of one copy of a primitive.
    triangles: &'a dyn Fn(u32) -> usize,
    peel: PeelPass,
    /// Draws without light: what is kept of surfaces.
    pub geometry: bool,
}

impl<'a> DrawState<'a> {
    pub fn new(
        plan: &'a Plan,
        commands: Vec<Command>,
        shadow_pass: bool,
        options: RecordOptions,
        triangles: &'a dyn Fn(u32) -> usize,
    ) -> DrawState<'a> {
        DrawState {
            plan,
            commands,
            shadow_pass,
            cull: None,
            pipeline: None,
            material: None,
            mesh: None,
            options,
            triangles,
            peel: PeelPass::No,
            geometry: false,
        }
    }

    pub fn set_cull(&mut self, cull: Cull) {
        if self.cull != Some(cull) {
            self.commands.push(Command::SetCull(cull));
            self.cull = Some(cull);
        }
    }

    /// The faces that are wanted and may be seen: of closed surfaces the front ones alone.
    pub fn draw(&mut self, draw: &Draw, cull: Cull) {
        let all = 3 * (self.triangles)(draw.primitive) as u32;
        let closed = draw.closed.min(all);
        let parts = match cull {
            _ if closed == 0 => [(cull, None), (cull, Some([0, 0]))],
            Cull::None => [(Cull::Back, Some([0, closed])), (Cull::None, Some([closed, all - closed]))],
            Cull::Back => [(Cull::Back, None), (cull, Some([0, 0]))],
            Cull::Front => [(Cull::Front, Some([closed, all - closed])), (cull, Some([0, 0]))],
        };
        for (cull, indices) in parts {
            if indices.is_none_or(|[_, count]| count > 0) {
                self.draw_part(draw, cull, indices.filter(|i| *i != [0, all]));
            }
        }
    }

    fn draw_part(&mut self, draw: &Draw, cull: Cull, indices: Option<[u32; 2]>) {
        let variant = self.variant(draw);
        let features = variant.key.features;
        if self.pipeline != Some(variant) {
            self.commands.push(Command::BindPipeline(variant));
            self.pipeline = Some(variant);
        }
        self.set_cull(cull);
        let slots = texture_slots(features);
        let reads_material = !self.shadow_pass || features.has(Features::ALPHA_MASK);
        let Draw { material, changed, .. } = *draw;
        if reads_material && self.material != Some((material, changed, slots)) {
            self.commands.push(Command::BindMaterial { material, changed, slots });
            self.material = Some((material, changed, slots));
        }
        let order = if draw.closed > 0 { VertexLayout::CLOSED } else { 0 };
        let layout = VertexLayout(VertexLayout::of(features).0 | order);
        let mesh = (draw.primitive, layout, features.has(Features::MORPH));
        if self.mesh != Some(mesh) {
            self.commands.push(Command::BindMesh { primitive: mesh.0, layout: mesh.1, morphs: mesh.2 });
            self.mesh = Some(mesh);
        }
        let Draw { first_instance, instance_count, .. } = *draw;
        self.commands.push(Command::Draw { first_instance, instance_count, indices });
    }

    fn variant(&self, draw: &Draw) -> SceneVariant {
        let (plan, mut key) = (self.plan, draw.pipeline);
        if self.geometry {
            key = Deferred::geometry(key);
        }
        key.features = fitting(key.features, self.options.textures).0;
        key.coverage &= !self.options.no_coverage;
        key.peeled &= !self.options.no_layers;
        let first = draw.first_instance as usize;
        let end = (first + draw.instance_count as usize).min(plan.instances.len());
        let drawn = plan.instances.get(first..end).unwrap_or(&[]);
        SceneVariant {
            key,
            tint: drawn.iter().any(|i| i.tint != Vec4::ONE),
            joints_uniform: key.features.has(Features::SKIN) && plan.joint_matrices.len() <= UNIFORM_JOINTS,
            lights: match key.features.is_lit() && !self.geometry {
                true => light_loop(plan, &key),
                false => LightLoop::All,
            },
            shadow_pass: self.shadow_pass,
            peel: self.peel,
            deferred: if self.geometry { DeferredPass::Geometry } else { DeferredPass::No },
        }
    }
}

/// Which lights a lit pixel asks.
pub fn light_loop(plan: &Plan, key: &PipelineKey) -> LightLoop {
    match &plan.light_lists {
        // An effect on light may make something of lamps that do not reach.
        Some(_) if key.lighting == 0 => LightLoop::Lists,
        _ if plan.lights.len() == 1 => LightLoop::One,
        _ => LightLoop::All,
    }
}
