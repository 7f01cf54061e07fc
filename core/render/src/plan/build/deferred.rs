//! Deferred or forward shading: which is estimated to be faster, and which surfaces can be deferred.

use crate::plan::build::Planner;
use crate::plan::build::overdraw::WastedLights;
use crate::plan::features::layer_features;
use crate::plan::left_out::NotNeeded;
use crate::plan::light_clusters::LightClusters;
use crate::plan::{Deferred, DeferredCause, Draw, Features, PipelineKey, TopologyKey};
use crate::scene_resources::material::MaterialResource;
use choreo_asset::Shading;
use choreo_stage::Pipeline;
use std::collections::BTreeMap;

/// Light evaluations per pixel that writing and reading the G-buffer cost: measured on lavapipe, where an image of 1280×720 pays
/// about 27 ms for it and 7 ms per light of a cluster, and a little more for the error of the estimate (tests/report, "Forward
/// and deferred"). GPUs are not measured: the G-buffer moves 72 bytes of memory per pixel, which by their ratio of arithmetic to
/// bandwidth is worth 10 lights or more; the image is the same there and either order is fast.
const GBUFFER_COST: f32 = 4.0;
/// Number of lights from which the cost is estimated: with fewer, surfaces rarely overlap enough for deferred shading to pay.
const FEWEST: usize = 2;

/// Whether the G-buffer describes a surface: opaque metallic-roughness without layers.
fn fits_gbuffer(key: &PipelineKey, material: &MaterialResource) -> bool {
    let m = &material.material;
    let layers = layer_features(m.layers.as_deref(), true, false).without(Features::LAYERS);
    let has = |f: Features| key.features.has(f);
    m.shading == Shading::MetallicRoughness
        && has(Features::METALLIC_ROUGHNESS)
        && layers.is_empty()
        && key.topology == TopologyKey::Triangles
        && !key.is_transparent()
        && !has(Features::OUTLINE)
        && key.lighting == 0
}

impl Planner<'_> {
    /// Marks the draws that are deferred; otherwise the reason why none is. `lights`: see [`super::overdraw::OverdrawEstimate`].
    pub(super) fn deferred(
        &self,
        draws: &mut [Draw],
        lights: (usize, Option<&LightClusters>),
    ) -> Result<Deferred, NotNeeded> {
        let cause = self.deferred_cause(lights)?;
        // The lighting pass either applies shadows to all its surfaces or to none.
        let shadow = |d: &Draw| d.pipeline.features.has(Features::SHADOW);
        let shadows = draws.iter().any(shadow);
        let fits = |d: &Draw| {
            shadow(d) == shadows && fits_gbuffer(&d.pipeline, self.material(d.material, d.material_override))
        };
        // Effects that read only the position are part of the lighting pass. Where surfaces differ in them, the most common
        // combination is deferred.
        let mut copies: BTreeMap<u8, u32> = BTreeMap::new();
        for draw in draws.iter().filter(|d| fits(d) && self.effects_read_position_only(d.pipeline.surface)) {
            *copies.entry(draw.pipeline.surface).or_default() += draw.instance_count;
        }
        let most = copies.iter().max_by_key(|(surface, n)| (**n, std::cmp::Reverse(**surface)));
        let Some((&surface, _)) = most else {
            return Err("no opaque metallic-roughness surface without layers is in view".into());
        };
        let mut features = Features::METALLIC_ROUGHNESS;
        for draw in draws {
            draw.deferred = draw.pipeline.surface == surface && fits(draw);
            if draw.deferred {
                let read = Features::LIGHTS.with(Features::EMISSIVE).with(Features::EFFECT_NORMALS);
                features = features.with(draw.pipeline.features.only(read));
            }
        }
        Ok(Deferred { cause, features, surface })
    }

    fn deferred_cause(&self, lights: (usize, Option<&LightClusters>)) -> Result<DeferredCause, NotNeeded> {
        if self.stage.settings.pipeline == Pipeline::Forward {
            return Err("the stage's pipeline is \"forward\"".into());
        }
        if self.options.samples > 1 {
            return Err(format!("{} samples per pixel; a G-buffer holds one", self.options.samples).into());
        }
        let Some(overdraw) = &self.overdraw else { return Ok(DeferredCause::Requested) };
        if lights.0 < FEWEST {
            return Err("fewer than two lights shine".into());
        }
        let WastedLights { lights, surfaces, wasted } =
            overdraw.wasted(&self.view, self.options.size, lights);
        if wasted < GBUFFER_COST {
            return Err(format!(
                "about {lights:.1} lights per surface and {surfaces:.1} overlapping surfaces waste {wasted:.1} light evaluations per \
                 pixel, and a G-buffer costs as much as {GBUFFER_COST}"
            )
            .into());
        }
        Ok(DeferredCause::Pays { lights, surfaces, wasted })
    }
}
