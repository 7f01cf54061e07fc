//! Shadow casters: which copies are drawn into which shadow map. Planned after everything in view is known.

use crate::plan::build::Planner;
use crate::plan::build::items::DrawMerger;
use crate::plan::build::shadow_cascades::{FittedMap, MAX_VIEWS, ShadowRegion, fit, pack};
use crate::plan::build::shadow_volumes::CasterBounds;
use crate::plan::{Draw, Features, Instance, PipelineKey, PlanLight, ShadowMaps, ShadowView};
use crate::scene_resources::PrimitiveEntry;
use crate::scene_resources::bounds::is_beyond_near_plane;
use choreo_stage::Shadow;
use glam::Vec4;

/// One opaque copy of one primitive, in view or not.
pub(super) struct ShadowCaster {
    pub entry: PrimitiveEntry,
    pub material_override: Option<u32>,
    /// Pipeline key of the caster's depth pass.
    pub key: PipelineKey,
    pub instance: Instance,
    pub bounds: CasterBounds,
    /// Number of indices of watertight surfaces, whose back faces are culled for lights outside the caster.
    pub watertight: u32,
    /// Index into `Planner::skins`.
    pub skin: Option<usize>,
    pub actor: u32,
}

/// A light's shadow map with its position in the shared image.
pub(super) struct PlacedMap {
    light: u32,
    at: [u32; 2],
    map: FittedMap,
}

impl Planner<'_> {
    /// Fits the shadow maps of all lights, as many as fit the image, and gives each light the range of its views.
    pub(crate) fn fit_shadow_maps(
        &mut self,
        lights: &mut [PlanLight],
        shadows: &[Option<Shadow>],
    ) -> Vec<PlacedMap> {
        let casters: Vec<CasterBounds> = self.casters.iter().map(|c| c.bounds).collect();
        let region = ShadowRegion {
            view: &self.view,
            size: self.options.size,
            receivers: &self.receivers,
            casters: &casters,
        };
        let mut all: Vec<PlacedMap> = Vec::new();
        for (index, (light, shadow)) in lights.iter_mut().zip(shadows).enumerate() {
            let Some(shadow) = shadow else { continue };
            let maps = fit(light, *shadow, &region);
            let sizes: Vec<[u32; 2]> = all.iter().map(|p| &p.map).chain(&maps).map(|m| m.size).collect();
            let placed = if sizes.is_empty() { None } else { pack(&sizes) };
            match placed {
                Some((places, _)) if sizes.len() <= MAX_VIEWS => {
                    light.shadow_views = [all.len() as u16, maps.len() as u16];
                    let new = maps.into_iter().map(|map| PlacedMap { light: index as u32, at: [0; 2], map });
                    all.extend(new);
                    all.iter_mut().zip(places).for_each(|(p, at)| p.at = at);
                }
                _ => self.facts.shadows_beyond += usize::from(!maps.is_empty()),
            }
        }
        all
    }

    /// The maps with their draws, whose instances are appended to those of the frame.
    pub(super) fn shadow_maps(
        &mut self,
        maps: Vec<PlacedMap>,
        instances: &mut Vec<Instance>,
        instance_actors: &mut Vec<u32>,
    ) -> Option<ShadowMaps> {
        if maps.is_empty() {
            // Shaders with the shadow feature forced on sample an empty map.
            let empty = ShadowMaps { image: [1; 2], size: [1; 2], views: Vec::new() };
            return self.options.force_all.then_some(empty);
        }
        let casters = std::mem::take(&mut self.casters);
        let mut views = Vec::with_capacity(maps.len());
        for PlacedMap { light, at, map } in maps {
            let state = |c: &ShadowCaster| {
                // Depth depends on a material only if that cuts holes.
                let cut_out = c.key.features.has(Features::ALPHA_MASK);
                let material = if cut_out { (c.entry.material, c.material_override) } else { (0, None) };
                let outside = is_beyond_near_plane(c.bounds.bounds, &map.clip_from_relative);
                (c.key, material, c.entry.primitive, if outside { c.watertight } else { 0 })
            };
            let mut drawn: Vec<&ShadowCaster> = map.casters.iter().map(|i| &casters[*i]).collect();
            drawn.sort_by_key(|c| state(c));
            let mut merger = DrawMerger::new(self.options.no_instancing);
            for caster in drawn {
                let (pipeline, (material, material_override), primitive, watertight) = state(caster);
                let draw = Draw {
                    pipeline,
                    primitive,
                    material,
                    material_override,
                    watertight,
                    deferred: false,
                    first_instance: instances.len() as u32,
                    instance_count: 1,
                };
                merger.add(state(caster), draw);
                let mut instance = Instance { tint: Vec4::ONE, ..caster.instance };
                if let Some(skin) = caster.skin {
                    instance.first_joint = self.first_joint(skin);
                }
                instances.push(instance);
                instance_actors.push(caster.actor);
            }
            let FittedMap { clip_from_relative, size, texel, penumbra, .. } = map;
            views.push(ShadowView {
                light,
                at,
                size,
                clip_from_relative,
                texel,
                penumbra,
                draws: merger.draws,
            });
        }
        let end = |i: usize| views.iter().map(|v| v.at[i] + v.size[i]).max().unwrap_or(1);
        let size = [end(0), end(1)];
        Some(ShadowMaps { image: size.map(u32::next_power_of_two), size, views })
    }
}
