//! Whether opaque surfaces are lit as they are drawn, or once a pixel after all of them are there; and which of them can be.

use crate::plan::build::Planner;
use crate::plan::build::light_clusters::LightLists;
use crate::plan::build::overdraw::InVain;
use crate::plan::features_layers;
use crate::plan::{Draw, Features, PipelineKey, TopologyKey};
use crate::scene_resources::CatalogMaterial;
use crate::shader::{DeferredPass, LightLoop, PeelPass, SceneVariant};
use choreo_asset::Shading;
use choreo_stage::Pipeline;
use std::collections::BTreeMap;

/// Opaque surfaces are drawn without light, and what lights need of the nearest one at each pixel is kept (shaders/deferred.wgsl);
/// then every pixel is lit once. What is kept does not hold everything: other surfaces are drawn after it as ever.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deferred {
    pub cause: DeferredCause,
    /// Of all surfaces together: what lighting them reads.
    pub features: Features,
    /// Of [`crate::Plan::surface`]: the effects that all of them have.
    pub surface: u8,
}

/// Why not forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DeferredCause {
    /// The stage asks for it.
    Asked,
    /// About so many lights are asked at a place, so many surfaces lie over each other, and so many lights would be asked in vain.
    Pays { lights: f32, surfaces: f32, in_vain: f32 },
}

/// Keeping what light needs and reading it again takes as long as so many lights of a list at each pixel: measured on lavapipe, where
/// a picture of 1280×720 pays about 27 ms for it and 7 ms a light, and a little more against the error of the estimate
/// (tests/report, "Forward and deferred"). GPUs are not measured: what is kept is 72 bytes a pixel of memory there and back, which by
/// their arithmetic a byte is worth 10 lights or more; there the picture is the same and either order is quick.
pub const KEEPING: f32 = 4.0;
/// With fewer lights, and no lists of them, nothing is estimated: over each other lie hardly as many surfaces as would pay.
const FEWEST: usize = 2;

/// What lighting reads of the scene rather than of the surface.
const LIGHTS: Features = Features::SHADOW
    .with(Features::SKY)
    .with(Features::LOCAL_LIGHTS)
    .with(Features::POLYNOMIAL)
    .with(Features::SEEN_SHADOW);

impl Deferred {
    /// What the geometry pass draws with, of the pipeline that would draw it forward.
    pub fn geometry(key: PipelineKey) -> PipelineKey {
        // Layers that are forced in and change no pixel.
        let layers = features_layers::TEXTURES.iter().fold(features_layers::ALL, |all, f| all.with(*f));
        let features = key.features.without(LIGHTS.with(layers).with(Features::SEEN_JOINTS));
        PipelineKey { features, surface: 0, ..key }
    }

    /// Of the pass that lights what was kept. `lights`: as scene shaders ask for them.
    pub fn light(&self, lights: LightLoop) -> SceneVariant {
        SceneVariant {
            key: PipelineKey { surface: self.surface, ..PipelineKey::of(self.features) },
            tint: false,
            joints_uniform: false,
            lights,
            shadow_pass: false,
            peel: PeelPass::No,
            deferred: DeferredPass::Light,
        }
    }
}

/// Whether what is kept of a surface says all that its light asks for: metallic-roughness without layers.
fn is_kept(key: &PipelineKey, material: &CatalogMaterial) -> bool {
    let m = &material.material;
    let layers = m.layers.as_deref();
    let on = features_layers::bits(layers, true, false);
    let has = |f: Features| key.features.has(f);
    m.shading == Shading::MetallicRoughness
        && has(Features::METALLIC_ROUGHNESS)
        && !on.iter().any(|(on, bit)| *on && *bit != Features::LAYERS)
        && key.topology == TopologyKey::Triangles
        && !key.is_see_through()
        && !has(Features::SHELL)
        && key.lighting == 0
}

impl Planner<'_> {
    /// Marks the draws that wait for their light; otherwise why none does.
    ///
    /// `lights`: as [`Overdraw::in_vain`] takes them.
    pub(crate) fn deferred(
        &self,
        pipeline: Pipeline,
        draws: &mut [Draw],
        lights: (usize, Option<&LightLists>),
    ) -> Result<Deferred, String> {
        if pipeline == Pipeline::Forward {
            return Err("the stage's pipeline is \"forward\"".into());
        }
        if self.options.samples > 1 {
            return Err(format!("{} samples a pixel, and of a surface one is kept", self.options.samples));
        }
        let cause = match &self.overdraw {
            None => DeferredCause::Asked,
            Some(_) if lights.0 < FEWEST => return Err("fewer than two lights shine".into()),
            Some(overdraw) => {
                let InVain { lights, surfaces, in_vain } =
                    overdraw.in_vain(&self.view, self.options.size, lights);
                if in_vain < KEEPING {
                    return Err(format!(
                        "about {lights:.1} lights a place and {surfaces:.1} surfaces over each other: {in_vain:.1} lights a pixel are \
                         asked in vain, and keeping surfaces until they are lit costs as much as {KEEPING}"
                    ));
                }
                DeferredCause::Pays { lights, surfaces, in_vain }
            }
        };
        let materials = &self.materials;
        let material = |d: &Draw| match d.changed {
            Some(changed) => &*materials[changed as usize],
            None => &self.catalog.materials[d.material as usize],
        };
        // Effects that see only the place are part of the light; where surfaces differ in them, most surfaces count.
        let mut copies: BTreeMap<u8, u32> = BTreeMap::new();
        for draw in
            draws.iter().filter(|d| is_kept(&d.pipeline, material(d)) && self.sees_places(&d.pipeline))
        {
            *copies.entry(draw.pipeline.surface).or_default() += draw.instance_count;
        }
        let most = copies.iter().max_by_key(|(surface, n)| (**n, std::cmp::Reverse(**surface)));
        let Some((&surface, _)) = most else {
            return Err("no opaque metallic-roughness surface without layers is in view".into());
        };
        let mut features = Features::METALLIC_ROUGHNESS;
        for draw in draws {
            draw.deferred = draw.pipeline.surface == surface && is_kept(&draw.pipeline, material(draw));
            if draw.deferred {
                let read = LIGHTS.with(Features::EMISSIVE).with(Features::SEEN_NORMALS);
                features = features.with(draw.pipeline.features.only(read));
            }
        }
        Ok(Deferred { cause, features, surface })
    }

    /// Of the effects on a surface none asks for its textures or joints.
    fn sees_places(&self, key: &PipelineKey) -> bool {
        let on = self.surface.iter().enumerate().filter(|(bit, _)| key.surface >> bit & 1 == 1);
        on.map(|(_, used)| &used.needs).all(|needs| !needs.uvs && !needs.joints)
    }
}
