//! Outlines (inverted hulls) and wireframes, of toon materials and of effects.

use crate::effect_faults::{FaultPlace, PlanFault};
use crate::plan::build::Planner;
use crate::plan::build::effects::active_uses;
use crate::plan::build::items::{DrawItem, DrawPhase};
use crate::plan::features::outline_features;
use crate::plan::options::PlanOptions;
use crate::plan::{Features, PipelineKey, TopologyKey};
use crate::scene_resources::material::{MaterialResource, TOON_SLOT};
use crate::scene_resources::{PrimitiveEntry, PrimitiveResource};
use choreo_asset::Outline;
use choreo_plugin::{Effect, InvertedHull};
use choreo_stage::{EffectTarget, Snapshot, Stage};
use glam::Vec3;
use std::sync::Arc;

/// Lines that an effect draws around or on surfaces.
#[derive(Clone, Debug)]
pub(super) enum SurfaceLine {
    Outline(Outline),
    /// Linear color.
    Wireframe(Vec3),
}

/// Index into `Planner::effect_lines`, the scene resources' material, its override.
pub(super) type OutlineKey = (usize, u32, Option<u32>);

impl SurfaceLine {
    /// The outline of this line's material. A wireframe only has a color.
    fn outline(&self) -> Outline {
        match self {
            SurfaceLine::Outline(outline) => outline.clone(),
            SurfaceLine::Wireframe(color) => Outline {
                width: 0.0,
                on_screen: false,
                width_texture: None,
                color: *color,
                lighting_mix: 0.0,
            },
        }
    }
}

/// Outlines and wireframes of the active effects with their targets. Faulty ones are reported and left out.
pub(super) fn effect_lines(
    stage: &Stage,
    snapshot: &Snapshot,
    options: &PlanOptions,
    faults: &mut Vec<PlanFault>,
) -> Vec<(SurfaceLine, Vec<EffectTarget>)> {
    let mut out = Vec::new();
    let mut is_good = |effect, result: &[f32], place| {
        let fault = PlanFault::of(effect, result, place);
        faults.extend(fault.clone());
        fault.is_none()
    };
    for (effect, used, state) in active_uses(stage, snapshot, options.effects) {
        let Effect::Outline(lines) = effect else { continue };
        let parameters = options.effect_parameters(effect, &state.parameters);
        let mut good_hull = |hull: &InvertedHull| {
            let Vec3 { x, y, z } = hull.color;
            is_good(effect, &[hull.width, x, y, z, hull.lighting_mix], FaultPlace::Outline)
        };
        let hull = lines.inverted_hull(&parameters).filter(|hull| good_hull(hull));
        if let Some(shell) = hull.filter(|hull| hull.width > 0.0) {
            let outline = Outline {
                width: shell.width / options.size[1].max(1) as f32,
                on_screen: true,
                width_texture: None,
                color: shell.color,
                lighting_mix: shell.lighting_mix,
            };
            out.push((SurfaceLine::Outline(outline), used.on.clone()));
        }
        let edges = lines.wireframe(&parameters);
        let edges = edges.filter(|color| is_good(effect, &color.to_array(), FaultPlace::Wireframe));
        out.extend(edges.map(|color| (SurfaceLine::Wireframe(color), used.on.clone())));
    }
    out
}

impl Planner<'_> {
    /// Largest outline width around a primitive of an actor: in metres, and as a share of the image's height.
    pub(crate) fn outline_width(
        &self,
        entry: &PrimitiveEntry,
        material_override: Option<u32>,
        actor: usize,
    ) -> (f32, f32) {
        let material = self.material(entry.material, material_override);
        let own = material.has_outline().then(|| material.material.toon.as_ref()?.outline.as_ref()).flatten();
        let on_it = self
            .effect_lines
            .iter()
            .filter(|(_, on)| EffectTarget::targets_include(on, actor, entry.of_asset));
        let of_effects = on_it.filter_map(|(line, _)| match line {
            SurfaceLine::Outline(outline) => Some(outline),
            SurfaceLine::Wireframe(_) => None,
        });
        own.into_iter().chain(of_effects).fold((0.0, 0.0), |(metres, share), outline| {
            match outline.on_screen {
                true => (metres, outline.width.max(share)),
                false => (outline.width.max(metres), share),
            }
        })
    }

    /// Adds the draws of the outlines and wireframes of a visible copy, whose own draw is `item`.
    pub(crate) fn add_outlines(
        &mut self,
        primitive: &PrimitiveResource,
        vertex_features: Features,
        item: &DrawItem,
    ) {
        for (wireframe, material_override) in self.outline_materials(item) {
            let key = item.pipeline;
            let material = self.material(item.entry.material, material_override);
            let features = match wireframe {
                true => key.features.of_alpha(key.blend).with(Features::WIREFRAME),
                false => outline_features(key.features, primitive, material, key.blend),
            };
            let topology = if wireframe { TopologyKey::Lines } else { key.topology };
            let features = features.with(vertex_features);
            let pipeline = PipelineKey { features, topology, double_sided: wireframe, ..key }.of_lit();
            // The outline of a transparent surface is drawn before it, so that it shows around the surface but not through it.
            let behind = item.phase == DrawPhase::Transparent && !wireframe;
            let depth = if behind { item.depth.next_up() } else { item.depth };
            self.items.push(DrawItem { pipeline, material_override, depth, watertight: 0, ..*item });
        }
    }

    /// (wireframe, material override) of a copy's lines: its own outline, then those of effects.
    fn outline_materials(&mut self, item: &DrawItem) -> Vec<(bool, Option<u32>)> {
        let (entry, material_override) = (&item.entry, item.material_override);
        let own = self.material(entry.material, material_override).has_outline();
        let mut out = Vec::from_iter(own.then_some((false, material_override)));
        for i in 0..self.effect_lines.len() {
            let (line, on) = &self.effect_lines[i];
            if !EffectTarget::targets_include(on, item.actor as usize, entry.of_asset) {
                continue;
            }
            let wireframe = matches!(line, SurfaceLine::Wireframe(_));
            let key = (i, entry.material, material_override);
            if let Some((_, at)) = self.outline_materials.iter().find(|(k, _)| *k == key) {
                out.push((wireframe, Some(*at)));
                continue;
            }
            let mut material = MaterialResource::clone(self.material(entry.material, material_override));
            let toon = material.material.toon.get_or_insert_default();
            Arc::make_mut(toon).outline = Some(line.outline());
            material.textures[TOON_SLOT] = None;
            let at = self.material_overrides.len() as u32;
            self.material_overrides.push(Arc::new(material));
            self.outline_materials.push((key, at));
            out.push((wireframe, Some(at)));
        }
        out
    }
}
