//! Meshes that are drawn more than once per frame (into the image, shadow maps, outlines) are pre-skinned. CPU reference of
//! preskin.wgsl: the vertices of [`VertexStage::skinned_vertices`], shared by all draws.

use super::CpuRenderer;
use super::vertex::{OutlineHull, Vertex, VertexStage};
use crate::plan::{Draw, Features, Instance, Plan};
use choreo_stage::PreSkinning;
use glam::Mat4;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Primitive, features that deform it, whether its normals are those of an outline hull, and the instance's deformation.
type DeformedKey = (u32, Features, bool, [u32; 15]);

/// Pre-skinned vertices, not yet projected.
#[derive(Default)]
pub(super) struct DeformedMeshes(BTreeMap<DeformedKey, Vec<Vertex>>);

fn deformed_key(draw: &Draw, instance: &Instance) -> Option<DeformedKey> {
    let features = draw.pipeline.features;
    let deforming = features.only(Features::SKINNING);
    // Displacement effects read vertex data that depends on the draw's features, so such draws share nothing.
    let shared = deforming != Features::default() && draw.pipeline.displaced == 0;
    shared.then(|| (draw.primitive, deforming, features.has(Features::OUTLINE), instance.deformation()))
}

impl DeformedMeshes {
    /// The meshes of the plan that are drawn more than once.
    pub(super) fn of(renderer: &CpuRenderer, plan: &Plan) -> DeformedMeshes {
        if plan.pre_skinning == PreSkinning::Never {
            return DeformedMeshes::default();
        }
        // The features that any draw of a mesh needs, one of its instances, and its number of draws.
        let mut wanted: BTreeMap<DeformedKey, (Features, &Instance, u32)> = BTreeMap::new();
        for draw in plan.draws.iter().chain(plan.shadow_draws()) {
            let first = draw.first_instance as usize;
            for instance in &plan.instances[first..first + draw.instance_count as usize] {
                let Some(key) = deformed_key(draw, instance) else { continue };
                let entry = wanted.entry(key).or_insert((Features::default(), instance, 0));
                entry.0 = entry.0.with(draw.pipeline.features);
                entry.2 += 1;
            }
        }
        wanted.retain(|_, (.., draws)| *draws > 1);
        let wanted: Vec<_> = wanted.into_iter().collect();
        let skin_mesh = |(key, (features, instance, _)): (DeformedKey, (Features, &Instance, u32))| {
            let entry = &renderer.resources.primitives[key.0 as usize];
            let stage = VertexStage::new(entry, features, plan, instance, &Mat4::IDENTITY);
            let welded =
                key.2.then(|| crate::scene_resources::vertex_layout::welded_normals(stage.primitive));
            (key, stage.skinned_vertices(welded.as_deref()))
        };
        DeformedMeshes(wanted.into_par_iter().map(skin_mesh).collect())
    }

    /// Projected vertices of a draw: from the pre-skinned mesh if there is one, else skinned now.
    pub(super) fn vertices(&self, draw: &Draw, stage: &VertexStage<'_>) -> Vec<Vertex> {
        match deformed_key(draw, stage.instance).and_then(|key| self.0.get(&key)) {
            Some(vertices) => stage.project(vertices.clone()),
            None => stage.project(
                stage.skinned_vertices(stage.hull.as_ref().map(|hull: &OutlineHull| &hull.normals[..])),
            ),
        }
    }
}
