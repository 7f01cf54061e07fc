//! What is drawn, before it is sorted into draws.

use crate::plan::build::Planner;
use crate::plan::{Draw, Features, Instance, PipelineKey};
use crate::scene_resources::PrimitiveEntry;
use choreo_stage::ActorState;
use std::sync::Arc;

/// One copy of one primitive before sorting.
pub(crate) struct Item {
    pub phase: Phase,
    pub pipeline: PipelineKey,
    pub entry: PrimitiveEntry,
    /// Of the plan's changed materials.
    pub changed: Option<u32>,
    /// Metres in front of the camera.
    pub depth: f32,
    /// The smallest depth among the copies that share its draw.
    pub nearest: f32,
    /// As [`crate::plan::Draw::closed`].
    pub closed: u32,
    pub instance: Instance,
    pub actor: u32,
    /// Of what is seen through: place among the planner's boxes.
    pub seen_through: Option<u32>,
}

impl Item {
    /// What one draw has in common.
    pub fn state(&self) -> (Phase, PipelineKey, u32, Option<u32>, u32, u32) {
        (self.phase, self.pipeline, self.entry.material, self.changed, self.entry.primitive, self.closed)
    }
}

/// Into the order of drawing; gives where what is seen through begins.
pub(crate) fn sort(items: &mut [Item]) -> usize {
    // Few state changes first; within one state near primitives before far ones and near copies before far
    // ones, so that the depth test spares the shading of what is hidden. Stable: equal keys stay in actor order.
    items.sort_by(|a, b| a.state().cmp(&b.state()).then(a.depth.total_cmp(&b.depth)));
    let mut nearest = f32::INFINITY;
    for i in 0..items.len() {
        if i == 0 || items[i].state() != items[i - 1].state() {
            nearest = items[i].depth;
        }
        items[i].nearest = nearest;
    }
    let batch = |i: &Item| (i.phase, i.pipeline, i.entry.material, i.changed);
    items.sort_by(|a, b| {
        let same = batch(a).cmp(&batch(b)).then(a.nearest.total_cmp(&b.nearest));
        same.then((a.entry.primitive, a.closed).cmp(&(b.entry.primitive, b.closed)))
    });
    let first_blended = items.partition_point(|i| i.phase < Phase::Blend);
    items[first_blended..].sort_by(|a, b| b.depth.total_cmp(&a.depth));
    first_blended
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Phase {
    Opaque,
    Mask,
    Blend,
}

impl Planner<'_> {
    /// The material of a primitive where it is not now as in the catalogue.
    pub fn changed_material(&mut self, entry: &PrimitiveEntry, state: &ActorState) -> Option<u32> {
        let index = entry.changes?;
        let known = self.changed.iter().find(|(m, c, _)| (*m, *c) == (index, entry.material));
        if let Some((_, _, place)) = known {
            return Some(*place);
        }
        let now = &state.materials.iter().find(|m| m.material == index)?.now;
        let place = self.materials.len() as u32;
        let base = &self.catalog.materials[entry.material as usize];
        self.materials.push(Arc::new(base.changed(now, entry.animated.is_some())));
        self.changed.push((index, entry.material, place));
        Some(place)
    }
}

impl Planner<'_> {
    /// The sorted items as draws, of which neighbours that have all in common are one, their instances, and the features of all.
    pub fn draws(&self) -> (Vec<Draw>, Vec<Instance>, Features) {
        let mut draws: Vec<Draw> = Vec::new();
        let mut instances = Vec::with_capacity(self.items.len());
        let mut previous = None;
        let mut all = Features::default();
        for item in &self.items {
            all = all.with(item.pipeline.features);
            match draws.last_mut() {
                Some(draw) if previous == Some(item.state()) && !self.options.no_instancing => {
                    draw.instance_count += 1;
                }
                _ => draws.push(Draw {
                    pipeline: item.pipeline,
                    primitive: item.entry.primitive,
                    material: item.entry.material,
                    changed: item.changed,
                    closed: item.closed,
                    deferred: false,
                    first_instance: instances.len() as u32,
                    instance_count: 1,
                }),
            }
            previous = Some(item.state());
            instances.push(item.instance);
        }
        (draws, instances, all)
    }
}
