//! Items to draw, before they are sorted and merged into draw calls.

use crate::plan::build::Planner;
use crate::plan::{Draw, Features, Instance, PipelineKey};
use crate::scene_resources::PrimitiveEntry;
use choreo_stage::ActorState;
use std::sync::Arc;

/// One copy of one primitive.
#[derive(Clone, Copy)]
pub(super) struct DrawItem {
    pub phase: DrawPhase,
    pub pipeline: PipelineKey,
    pub entry: PrimitiveEntry,
    pub material_override: Option<u32>,
    /// Distance in front of the camera, metres.
    pub depth: f32,
    /// The smallest depth among the copies that share its draw.
    pub nearest: f32,
    /// Number of indices, as in [`Draw::watertight`].
    pub watertight: u32,
    pub instance: Instance,
    /// The instance one frame before, if an effect reads motion.
    pub before: Option<Instance>,
    pub actor: u32,
    /// Index into `Planner::transparent`, if it is transparent.
    pub transparent: Option<u32>,
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum DrawPhase {
    Opaque,
    AlphaTested,
    Transparent,
}

impl DrawItem {
    /// State that the instances of one draw share.
    fn state(&self) -> (DrawPhase, PipelineKey, u32, Option<u32>, u32, u32) {
        let entry = &self.entry;
        (self.phase, self.pipeline, entry.material, self.material_override, entry.primitive, self.watertight)
    }
}

/// Sorts items into drawing order, and returns the index of the first transparent one.
pub(super) fn sort(items: &mut [DrawItem]) -> usize {
    // Few state changes first; within one state near primitives before far ones and near copies before far
    // ones, so that the depth test saves the shading of hidden surfaces. Stable: equal keys stay in actor order.
    items.sort_by(|a, b| a.state().cmp(&b.state()).then(a.depth.total_cmp(&b.depth)));
    let mut nearest = f32::INFINITY;
    for i in 0..items.len() {
        if i == 0 || items[i].state() != items[i - 1].state() {
            nearest = items[i].depth;
        }
        items[i].nearest = nearest;
    }
    let batch = |i: &DrawItem| (i.phase, i.pipeline, i.entry.material, i.material_override);
    items.sort_by(|a, b| {
        let same = batch(a).cmp(&batch(b)).then(a.nearest.total_cmp(&b.nearest));
        same.then((a.entry.primitive, a.watertight).cmp(&(b.entry.primitive, b.watertight)))
    });
    let first_transparent = items.partition_point(|i| i.phase < DrawPhase::Transparent);
    items[first_transparent..].sort_by(|a, b| b.depth.total_cmp(&a.depth));
    first_transparent
}

/// Draw calls of sorted instances. Adjacent instances with the same state share one.
pub(super) struct DrawMerger<S> {
    pub draws: Vec<Draw>,
    state: Option<S>,
    no_instancing: bool,
}

impl<S: PartialEq> DrawMerger<S> {
    pub(super) fn new(no_instancing: bool) -> DrawMerger<S> {
        DrawMerger { draws: Vec::new(), state: None, no_instancing }
    }

    /// Adds an instance: to the last draw if its state is the same, else to a new one, `draw`.
    pub(super) fn add(&mut self, state: S, draw: Draw) {
        match self.draws.last_mut() {
            Some(last) if self.state.as_ref() == Some(&state) && !self.no_instancing => {
                last.instance_count += 1
            }
            _ => self.draws.push(draw),
        }
        self.state = Some(state);
    }
}

impl Planner<'_> {
    /// Index of the override of a material that differs from the scene resources in this frame.
    pub(super) fn material_override(&mut self, entry: &PrimitiveEntry, state: &ActorState) -> Option<u32> {
        let index = entry.animated?;
        let known = self.overrides_of_actor.iter().find(|(m, r, _)| (*m, *r) == (index, entry.material));
        if let Some((_, _, at)) = known {
            return Some(*at);
        }
        let now = &state.materials.iter().find(|m| m.material == index)?.now;
        let at = self.material_overrides.len() as u32;
        let base = &self.resources.materials[entry.material as usize];
        self.material_overrides.push(Arc::new(base.with_values(now, entry.animated_color.is_some())));
        self.overrides_of_actor.push((index, entry.material, at));
        Some(at)
    }

    /// Draw calls of the sorted items, their instances, and the union of their features.
    pub(super) fn draws(&self) -> (Vec<Draw>, Vec<Instance>, Features) {
        let mut merger = DrawMerger::new(self.options.no_instancing);
        let mut instances = Vec::with_capacity(self.items.len());
        let mut all = Features::default();
        for item in &self.items {
            all = all.with(item.pipeline.features);
            let draw = Draw {
                pipeline: item.pipeline,
                primitive: item.entry.primitive,
                material: item.entry.material,
                material_override: item.material_override,
                watertight: item.watertight,
                deferred: false,
                first_instance: instances.len() as u32,
                instance_count: 1,
            };
            merger.add(item.state(), draw);
            instances.push(item.instance);
        }
        (merger.draws, instances, all)
    }
}
