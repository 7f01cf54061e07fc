//! Who is drawn into which shadow map: the planner's part after all that is in view is known.

use crate::plan::build::Planner;
use crate::plan::build::shadow_cascades::{self, Fitted, MAX_VIEWS, Region};
use crate::plan::*;
use crate::scene_resources::PrimitiveEntry;
use crate::scene_resources::bounds::Aabb;
use crate::scene_resources::watertight::is_before;
use choreo_stage::Shadow;
use glam::Vec4;

/// One copy of one primitive that light does not go through, in view or not.
pub(crate) struct Caster {
    pub entry: PrimitiveEntry,
    pub changed: Option<u32>,
    /// What its depth needs.
    pub key: PipelineKey,
    pub instance: Instance,
    pub bounds: Aabb,
    /// Indices of closed surfaces, for a light that stands outside.
    pub closed: u32,
    /// Of the planner's posed skins.
    pub skin: Option<usize>,
    pub actor: u32,
}

/// A map of a light, with its place.
pub(crate) struct Placed {
    light: u32,
    at: [u32; 2],
    map: Fitted,
}

impl Planner<'_> {
    /// The maps of all lights, as many as there is room for; each light is told where its own are.
    pub fn fit_shadows(&mut self, lights: &mut [PlanLight], shadows: &[Option<Shadow>]) -> Vec<Placed> {
        let casters: Vec<Aabb> = self.casters.iter().map(|c| c.bounds).collect();
        let region = Region {
            view: &self.view,
            picture: self.options.size,
            receivers: &self.receivers,
            casters: &casters,
        };
        let mut all: Vec<Placed> = Vec::new();
        for (index, (light, shadow)) in lights.iter_mut().zip(shadows).enumerate() {
            let Some(shadow) = shadow else { continue };
            let maps = shadow_cascades::fit(light, *shadow, &region);
            let sizes: Vec<[u32; 2]> = all.iter().map(|p| &p.map).chain(&maps).map(|m| m.size).collect();
            let placed = if sizes.is_empty() { None } else { shadow_cascades::pack(&sizes) };
            match placed {
                Some((places, _)) if sizes.len() <= MAX_VIEWS => {
                    light.shadow_views = [all.len() as u16, maps.len() as u16];
                    let new = maps.into_iter().map(|map| Placed { light: index as u32, at: [0; 2], map });
                    all.extend(new);
                    all.iter_mut().zip(places).for_each(|(p, at)| p.at = at);
                }
                _ => self.facts.shadows_beyond += usize::from(!maps.is_empty()),
            }
        }
        all
    }

    /// Draws of each map, their instances behind those of the picture.
    pub fn draw_shadows(
        &mut self,
        maps: Vec<Placed>,
        instances: &mut Vec<Instance>,
        instance_actors: &mut Vec<u32>,
    ) -> Option<Shadows> {
        if maps.is_empty() {
            // Shaders that are made for shadows read a map of nothing.
            let nothing = Shadows { image: [1; 2], size: [1; 2], views: Vec::new() };
            return self.options.force_all.then_some(nothing);
        }
        let casters = std::mem::take(&mut self.casters);
        let mut views = Vec::with_capacity(maps.len());
        for Placed { light, at, map } in maps {
            // Materials count only where they cut holes.
            let state = |c: &Caster| {
                let cut_out = c.key.features.has(Features::ALPHA_MASK);
                let material = if cut_out { (c.entry.material, c.changed) } else { (0, None) };
                let closed = if is_before(c.bounds, &map.clip_from_relative) { c.closed } else { 0 };
                (c.key, material, c.entry.primitive, closed)
            };
            let mut drawn: Vec<&Caster> = map.casters.iter().map(|i| &casters[*i]).collect();
            drawn.sort_by_key(|c| state(c));
            let mut draws: Vec<Draw> = Vec::new();
            let mut previous = None;
            for caster in drawn {
                match draws.last_mut() {
                    Some(draw) if previous == Some(state(caster)) && !self.options.no_instancing => {
                        draw.instance_count += 1;
                    }
                    _ => draws.push(Draw {
                        pipeline: caster.key,
                        primitive: caster.entry.primitive,
                        material: state(caster).1.0,
                        changed: state(caster).1.1,
                        closed: state(caster).3,
                        deferred: false,
                        first_instance: instances.len() as u32,
                        instance_count: 1,
                    }),
                }
                previous = Some(state(caster));
                let mut instance = Instance { tint: Vec4::ONE, ..caster.instance };
                if let Some(skin) = caster.skin {
                    instance.first_joint = self.first_joint(skin);
                }
                instances.push(instance);
                instance_actors.push(caster.actor);
            }
            let Fitted { clip_from_relative, size, texel, .. } = map;
            views.push(ShadowView { light, at, size, clip_from_relative, texel, draws });
        }
        let end = |i: usize| views.iter().map(|v| v.at[i] + v.size[i]).max().unwrap_or(1);
        let size = [end(0), end(1)];
        Some(Shadows { image: size.map(u32::next_power_of_two), size, views })
    }
}
