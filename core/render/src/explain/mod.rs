//! What one frame's commands need — passes, pipelines, shader features, buffers, textures, targets —, how large each is,
//! and which actors and materials asked for it. The other half, what was left out and why, is in the plan.

pub(crate) mod preskin;
pub(crate) mod targets;

use crate::commands::{Command, Part as PassPart, Recording, Target};
use crate::plan::{
    ActiveMorph, Draw, Features, Glass, Instance, OverlayVertex, PeelCause, Plan, PlanLight, Rows,
};
use crate::scene_resources::Catalog;
use crate::scene_resources::mipmap::level_count;
use crate::scene_resources::vertex_layout::{VertexLayout, pack, pack_morphs};
use crate::shader::uniforms::{
    FrameUniform, LayersUniform, MaterialUniform, PostUniform, ShadowUniform, SkyUniform,
};
use crate::shader::{DeferredPass, SceneVariant, switches};
use crate::sky::SkyMaps;
use choreo_asset::Sampler;
use std::collections::{BTreeMap, BTreeSet};

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    Pass,
    Pipeline,
    Feature,
    /// Made anew for every frame.
    FrameData,
    Mesh,
    Material,
    Texture,
    Target,
}

impl Kind {
    pub fn word(self) -> &'static str {
        match self {
            Kind::Pass => "pass",
            Kind::Pipeline => "pipeline",
            Kind::Feature => "feature",
            Kind::FrameData => "frame data",
            Kind::Mesh => "mesh",
            Kind::Material => "material",
            Kind::Texture => "texture",
            Kind::Target => "target",
        }
    }
}

/// Who wants something.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Askers {
    /// Indices into `Stage::actors`, sorted.
    pub actors: BTreeSet<u32>,
    /// Indices into `Catalog::materials`, sorted.
    pub materials: BTreeSet<u32>,
    /// Plugin names.
    pub effects: BTreeSet<String>,
    /// In words, where it is none of these: "the stage's background".
    pub other: Option<&'static str>,
}

/// One thing that is in.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    pub kind: Kind,
    pub what: String,
    /// On the device; `None` for what is no memory.
    pub bytes: Option<u64>,
    pub asked_by: Askers,
}

/// Everything that is in, in the order of the kinds. Sizes are of one frame in flight, as the Vulkan renderer makes them.
pub fn explain(catalog: &Catalog, plan: &Plan, recording: &Recording) -> Vec<Part> {
    let mut parts = Parts { catalog, plan, all: Vec::new() };
    parts.passes(recording);
    parts.pipelines(recording);
    parts.surface_effects();
    parts.frame_data(recording);
    parts.meshes(recording);
    parts.materials_and_textures(recording);
    parts.sky(recording);
    parts.flats();
    parts.targets(recording);
    parts.all.sort_by_key(|p| p.kind);
    parts.all
}

pub(crate) struct Parts<'a> {
    pub catalog: &'a Catalog,
    pub plan: &'a Plan,
    all: Vec<Part>,
}

impl Parts<'_> {
    pub fn add(&mut self, kind: Kind, what: String, bytes: Option<u64>, asked_by: Askers) {
        self.all.push(Part { kind, what, bytes, asked_by });
    }

    pub fn askers<'d>(&self, draws: impl Iterator<Item = &'d Draw>) -> Askers {
        let mut askers = Askers::default();
        for draw in draws {
            let first = draw.first_instance as usize;
            let copies = self.plan.instance_actors.get(first..first + draw.instance_count as usize);
            askers.actors.extend(copies.unwrap_or_default());
            askers.materials.insert(draw.material);
        }
        askers
    }

    pub fn shadow_draws(&self) -> impl Iterator<Item = &Draw> {
        self.plan.shadows.iter().flat_map(|s| &s.views).flat_map(|v| &v.draws)
    }

    /// Into the picture, then into shadow maps.
    pub fn all_draws(&self) -> impl Iterator<Item = &Draw> {
        self.plan.draws.iter().chain(self.shadow_draws())
    }

    /// Glass that bends light.
    pub fn refracting(&self) -> impl Iterator<Item = &Draw> {
        self.plan.draws.iter().filter(|d| d.pipeline.glass == Glass::Refract)
    }

    /// Why what is seen through is not just sorted.
    pub fn of_peel(&self) -> Askers {
        let mut askers = Askers::default();
        match self.plan.peel.map(|peel| peel.cause) {
            Some(PeelCause::Each(a, b)) => {
                askers.actors.extend([a, b]);
                askers.other = Some("sorting fails: copies cross, or stand in the wrong order");
            }
            Some(PeelCause::Itself(actor)) => {
                askers.actors.insert(actor);
                askers.other = Some("sorting fails: it is bent, and seen from both sides");
            }
            Some(PeelCause::AskedBy(actor)) => {
                askers.actors.insert(actor);
                askers.other = Some("its transparency \"independent\"");
            }
            _ => askers.other = Some("the stage's transparency \"independent\""),
        }
        askers
    }

    /// Without materials.
    pub fn actors<'d>(&self, draws: impl Iterator<Item = &'d Draw>) -> Askers {
        Askers { materials: BTreeSet::new(), ..self.askers(draws) }
    }

    fn passes(&mut self, recording: &Recording) {
        let stage = |other| Askers { other: Some(other), ..Askers::default() };
        if !recording.posed.is_empty() {
            self.poses(recording);
        }
        for command in &recording.commands {
            match command {
                Command::BeginPass { target, samples, depth, part, area, .. } => {
                    let depth = if *depth { ", depth" } else { "" };
                    let plural = if *samples == 1 { "" } else { "s" };
                    let part = match part {
                        PassPart::Whole | PassPart::UntilCopy | PassPart::UntilLayers => "",
                        PassPart::AfterLayers => ", the rest after the layers of what is seen through",
                        PassPart::AfterCopy => ", the rest after the copy behind glass",
                    };
                    let area = area.map_or(String::new(), |[_, _, w, h]| format!(", {w}×{h} of it"));
                    let what = format!(
                        "scene → {}, {samples} sample{plural} a pixel{depth}{part}{area}",
                        name(*target)
                    );
                    let askers = match self.plan.draws.is_empty() {
                        true => stage("the stage's background: nothing else is in view"),
                        false => self.actors(self.plan.draws.iter()),
                    };
                    self.add(Kind::Pass, what, None, askers);
                }
                Command::BeginGeometry => self.geometry(),
                Command::BindPipeline(v) if v.deferred == DeferredPass::Light => self.light(v),
                Command::BeginPeel { layer, .. } => {
                    let what = format!("depths of layer {} of what is seen through", layer + 1);
                    let askers = self.of_peel();
                    self.add(Kind::Pass, what, None, askers);
                }
                Command::BeginLayer { layer, rest, .. } => {
                    let what = match rest {
                        true => "what is nearer than all layers, sorted".to_string(),
                        false => format!("colours of layer {} of what is seen through", layer + 1),
                    };
                    let askers = self.of_peel();
                    self.add(Kind::Pass, what, None, askers);
                }
                Command::BeginShadows { size: [w, h], .. } => {
                    let maps = self.plan.shadows.as_ref().map_or(0, |s| s.views.len());
                    let plural = if maps == 1 { "" } else { "s" };
                    let what = format!("{maps} shadow map{plural}, {w}×{h} texels");
                    let askers = self.actors(self.shadow_draws());
                    self.add(Kind::Pass, what, None, askers);
                }
                Command::DrawOverlay { effect, count, .. } => {
                    let mut askers = Askers::default();
                    askers.effects.insert(effect.clone());
                    let what = format!("in the scene: {} triangles of {effect}", count / 3);
                    self.add(Kind::Pass, what, None, askers);
                }
                Command::PostPass { effect, from, to, size: [w, h], .. } => {
                    let mut askers = Askers::default();
                    askers.effects.insert(effect.clone());
                    let what = format!("effect {effect}: {} → {}, {w}×{h}", name(*from), name(*to));
                    self.add(Kind::Pass, what, None, askers);
                }
                Command::CopyBehind { from, levels } => {
                    let plural = if *levels == 1 { "" } else { "s" };
                    let what = format!("copy of the {} behind glass, {levels} level{plural}", name(*from));
                    let askers = self.askers(self.refracting());
                    self.add(Kind::Pass, what, None, askers);
                }
                Command::CopyBackground => {
                    let what = "copy of the background".to_string();
                    self.add(Kind::Pass, what, None, stage("the stage's background"));
                }
                Command::DrawUnder => {
                    let what = "pipeline of the layers under the scene".to_string();
                    self.add(Kind::Pipeline, what, None, stage("text, pictures and panels"));
                }
                Command::DrawSky { .. } => {
                    let what = "pipeline of the sky, behind all else".to_string();
                    self.add(Kind::Pipeline, what, None, stage("the stage's sky"));
                }
                Command::DrawBackground { .. } => {
                    let what = "pipeline of the gradient, behind all else".to_string();
                    self.add(Kind::Pipeline, what, None, stage("the stage's background"));
                }
                _ => {}
            }
        }
    }

    fn pipelines(&mut self, recording: &Recording) {
        // Each draw follows the commands that bind its state; a draw may be made twice, for back and front faces.
        let mut of_variant: BTreeMap<SceneVariant, Vec<Draw>> = BTreeMap::new();
        let mut bound = None;
        for command in &recording.commands {
            match command {
                Command::BindPipeline(variant) => bound = Some(*variant),
                Command::Draw { first_instance, .. } => {
                    let drawn = self.all_draws().find(|d| d.first_instance == *first_instance);
                    if let (Some(variant), Some(draw)) = (bound, drawn) {
                        let draws = of_variant.entry(variant).or_default();
                        if !draws.contains(draw) {
                            draws.push(*draw);
                        }
                    }
                }
                _ => {}
            }
        }
        let mut of_feature: BTreeMap<&'static str, Vec<Draw>> = BTreeMap::new();
        for (variant, draws) in &of_variant {
            let triangles: usize = draws.iter().map(|d| self.elements(d)).sum();
            let copies: u32 = draws.iter().map(|d| d.instance_count).sum();
            let mut topology = format!("{:?}", variant.key.topology).to_lowercase();
            if variant.key.mirrored {
                topology += ", mirrored";
            }
            let features = switches(variant);
            let many = |n: usize, one: &str, more: &str| format!("{n} {}", if n == 1 { one } else { more });
            let what = format!(
                "{topology} {}: {}, {}, {triangles} elements",
                features.join(" "),
                many(draws.len(), "draw", "draws"),
                many(copies as usize, "copy", "copies")
            );
            let askers = self.askers(draws.iter());
            self.add(Kind::Pipeline, what, None, askers);
            for feature in features {
                of_feature.entry(feature).or_default().extend(draws);
            }
        }
        for (feature, draws) in of_feature {
            let askers = self.askers(draws.iter());
            self.add(Kind::Feature, feature.to_string(), None, askers);
        }
    }

    /// Functions that the pipelines of their surfaces call.
    fn surface_effects(&mut self) {
        for (bit, used) in self.plan.surface.iter().enumerate() {
            let mut askers =
                self.askers(self.plan.draws.iter().filter(|d| d.pipeline.effects() >> bit & 1 == 1));
            askers.effects.insert(used.effect.clone());
            self.add(Kind::Feature, format!("effect {} on surfaces", used.effect), None, askers);
            let mut askers = Askers::default();
            askers.effects.insert(used.effect.clone());
            let bytes = Some(size_of::<[f32; 8]>() as u64);
            self.add(Kind::FrameData, format!("parameters of {}", used.effect), bytes, askers);
        }
    }

    /// Triangles, lines or points of all copies.
    fn elements(&self, draw: &Draw) -> usize {
        let primitive = self.catalog.primitives[draw.primitive as usize].primitive();
        let corners = match primitive.topology {
            choreo_asset::Topology::Triangles => 3,
            choreo_asset::Topology::Lines => 2,
            choreo_asset::Topology::Points => 1,
        };
        primitive.indices.len() / corners * draw.instance_count as usize
    }

    fn frame_data(&mut self, recording: &Recording) {
        let Some(Command::UploadFrameData { instances, joints, morphs, lights }) = recording.commands.first()
        else {
            return;
        };
        let size = |n: usize, each: usize| Some((n * each) as u64);
        let with = |feature: Features| self.all_draws().filter(move |d| d.pipeline.features.has(feature));
        let lit = self.plan.draws.iter().filter(|d| d.pipeline.features.is_lit());
        let frame = Askers { other: Some("every frame"), ..Askers::default() };
        let (all, skinned, morphed, lit) = (
            self.actors(self.plan.draws.iter()),
            self.actors(with(Features::SKIN)),
            self.actors(with(Features::MORPH)),
            self.actors(lit),
        );
        self.add(
            Kind::FrameData,
            "camera and ambient light".into(),
            size(1, size_of::<FrameUniform>()),
            frame,
        );
        for (n, each, what, askers) in [
            (*instances, size_of::<Instance>(), "copies", all),
            (*joints, size_of::<Rows>(), "joint matrices", skinned),
            (*morphs, size_of::<ActiveMorph>(), "active morph targets", morphed),
            (*lights, size_of::<PlanLight>(), "lights", lit),
        ] {
            if n > 0 {
                self.add(Kind::FrameData, format!("{n} {what}"), size(n, each), askers);
            }
        }
        for part in &self.plan.overlay.parts {
            let mut askers = Askers::default();
            askers.effects.insert(part.effect.clone());
            let what = format!("corners of {}", part.effect);
            self.add(Kind::FrameData, what, size(part.count as usize, size_of::<OverlayVertex>()), askers);
        }
        if !self.plan.materials.is_empty() {
            let n = self.plan.materials.len();
            let askers = self.actors(self.all_draws().filter(|d| d.changed.is_some()));
            let bytes = size(n, size_of::<MaterialUniform>());
            self.add(Kind::FrameData, format!("{n} materials that change"), bytes, askers);
        }
        if let Some(shadows) = &self.plan.shadows {
            let askers = self.actors(self.shadow_draws());
            let bytes = size(shadows.views.len(), size_of::<FrameUniform>() + size_of::<ShadowUniform>());
            self.add(Kind::FrameData, "views of shadow maps".into(), bytes, askers);
        }
        for pass in &self.plan.post {
            let mut askers = Askers::default();
            askers.effects.insert(pass.effect.clone());
            let what = format!("parameters of {}", pass.effect);
            self.add(Kind::FrameData, what, size(1, size_of::<PostUniform>()), askers);
        }
    }

    fn meshes(&mut self, recording: &Recording) {
        let mut meshes: BTreeSet<(u32, VertexLayout, bool)> = BTreeSet::new();
        for command in &recording.commands {
            match command {
                Command::BindMesh { primitive, layout, morphs } => {
                    meshes.insert((*primitive, *layout, *morphs));
                }
                Command::Pose { variant, primitive, layout, .. } => {
                    meshes.insert((*primitive, *layout, variant.features.has(Features::MORPH)));
                }
                _ => {}
            }
        }
        for (primitive, layout, morphs) in meshes {
            let entry = &self.catalog.primitives[primitive as usize];
            let packed = pack(entry.primitive(), entry.indices(layout), layout);
            let mut bytes = packed.vertices.len().next_multiple_of(4) + packed.indices.len();
            let mut what = format!(
                "\"{}\" {}: {} vertices of {} bytes, {} indices",
                entry.mesh.name,
                entry.index,
                packed.vertex_count,
                layout.attributes().1,
                packed.index_count
            );
            if morphs {
                bytes += pack_morphs(entry.primitive(), entry.indices(layout), layout).len();
                let (p, moved) = (
                    entry.primitive(),
                    crate::scene_resources::morph_buffers::moved_vertices(entry.primitive()),
                );
                what +=
                    &format!(", {} morph targets that move {moved} of {}", p.morphs.len(), p.positions.len());
            }
            let draws: Vec<Draw> = self.all_draws().filter(|d| d.primitive == primitive).copied().collect();
            let askers = self.askers(draws.iter());
            self.add(Kind::Mesh, what, Some(bytes as u64), askers);
        }
    }

    fn materials_and_textures(&mut self, recording: &Recording) {
        let mut slots_of: BTreeMap<u32, u32> = BTreeMap::new();
        for command in &recording.commands {
            if let Command::BindMaterial { material, slots, .. } = command {
                *slots_of.entry(*material).or_default() |= slots;
            }
        }
        let mut textures: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        let mut slanted: BTreeSet<u32> = BTreeSet::new();
        for (material, slots) in &slots_of {
            let entry = &self.catalog.materials[*material as usize];
            for (slot, texture) in entry.texture_refs().iter().enumerate() {
                if let Some(texture) = texture.filter(|_| slots >> slot & 1 == 1) {
                    textures.entry(texture.texture).or_default().push(*material);
                    if is_anisotropic(&texture.sampler) {
                        slanted.insert(texture.texture);
                    }
                }
            }
            let draws: Vec<Draw> =
                self.plan.draws.iter().filter(|d| d.material == *material).copied().collect();
            let askers = self.actors(draws.iter());
            let what = format!("\"{}\"", entry.material.name);
            let layers = if entry.material.layers.is_some() { size_of::<LayersUniform>() } else { 0 };
            self.add(Kind::Material, what, Some((size_of::<MaterialUniform>() + layers) as u64), askers);
        }
        for (texture, materials) in textures {
            let entry = &self.catalog.textures[texture as usize];
            let (w, h) = (entry.image.width, entry.image.height);
            let levels = if entry.mipmaps { level_count(w, h) } else { 1 };
            let bytes =
                (0..levels).map(|l| 4 * u64::from((w >> l).max(1)) * u64::from((h >> l).max(1))).sum();
            let color = if entry.srgb { "colors" } else { "data" };
            // What the plan cannot know: the device. See `GpuOptions::anisotropy`.
            let filter = if slanted.contains(&texture) { ", anisotropic on GPUs" } else { "" };
            let what = format!("\"{}\": {w}×{h}, {levels} levels, {color}{filter}", entry.image.name);
            let draws = self.plan.draws.iter().filter(|d| materials.contains(&d.material));
            let askers = self.askers(draws);
            self.add(Kind::Texture, what, Some(bytes), askers);
        }
    }

    fn flats(&mut self) {
        let asked = || Askers { other: Some("text, pictures and panels"), ..Askers::default() };
        if let Some(under) = &self.plan.under {
            let [w, h] = under.size;
            let bytes = Some(8 * u64::from(w) * u64::from(h));
            self.add(
                Kind::Texture,
                format!("layers under the scene: {w}×{h}, 16-bit floats"),
                bytes,
                asked(),
            );
        }
        if let Some(over) = &self.plan.over {
            let [w, h] = over.area;
            self.add(Kind::Pass, format!("layers over the frame, {w}×{h} pixels, by the CPU"), None, asked());
        }
    }

    fn sky(&mut self, recording: &Recording) {
        let reads = recording.reads();
        let Some(panorama) = self.catalog.sky.clone().filter(|_| reads.sky) else { return };
        let lit = || self.plan.draws.iter().filter(|d| d.pipeline.features.has(Features::SKY));
        let stage = Askers { other: Some("the stage's sky"), ..Askers::default() };
        let bytes = Some(size_of::<SkyUniform>() as u64);
        let askers = if reads.sky_maps { self.actors(lit()) } else { stage.clone() };
        self.add(Kind::FrameData, "turn and strength of the sky".into(), bytes, askers);
        let texel = size_of::<[f32; 2]>() as u64;
        if reads.sky_maps {
            let maps = SkyMaps::of(&panorama);
            let ([w, h], levels) = (maps.size, maps.levels.len());
            let what = format!("sky \"{}\": {w}×{h}, {levels} roughnesses, 16-bit floats", panorama.name);
            let askers = self.actors(lit());
            self.add(Kind::Texture, what, Some(texel * u64::from(w) * u64::from(h)), askers);
        }
        if reads.sky_picture {
            let [w, h] = panorama.size();
            let what = format!("picture of the sky \"{}\": {w}×{h}, 16-bit floats", panorama.name);
            self.add(Kind::Texture, what, Some(texel * u64::from(w) * u64::from(h)), stage);
        }
    }
}

fn name(target: Target) -> String {
    match target {
        Target::Picture => "picture".into(),
        Target::Float(i) => format!("linear picture {i}"),
    }
}

/// Only where levels are mixed: what asks for hard texels gets them.
pub(crate) fn is_anisotropic(sampler: &Sampler) -> bool {
    sampler.mag_linear && sampler.min_linear && sampler.mip_linear == Some(true)
}
