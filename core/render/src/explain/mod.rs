//! Costs of a frame: the passes, pipelines, shader features, buffers, textures and targets that its commands need, the size of
//! each, and the actors and materials that request it. The plan lists the features that were left out, with the reasons.

mod float_frames;
mod passes;
mod preskin;
mod targets;

use crate::affine::Affine3x4;
use crate::commands::{Command, Recording, Target};
use crate::plan::{ActiveMorph, Draw, Features, Glass, Instance, OverlayVertex, PeelCause, Plan, PlanLight};
use crate::scene_resources::SceneResources;
use crate::scene_resources::material::is_anisotropic;
use crate::scene_resources::mipmap::level_count;
use crate::scene_resources::morph_buffers::morphed_vertices;
use crate::scene_resources::vertex_layout::{VertexLayout, pack, pack_morphs};
use crate::shader::uniforms::{
    FrameUniform, LayersUniform, MaterialUniform, PostUniform, ShadowUniform, SkyUniform,
};
use crate::shader::{SceneVariant, switches};
use crate::sky::SkyMaps;
use choreo_asset::Topology;
use std::collections::{BTreeMap, BTreeSet};

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum CostKind {
    Pass,
    Pipeline,
    Feature,
    /// Data that is written for every frame.
    FrameData,
    Mesh,
    Material,
    Texture,
    Target,
}

impl CostKind {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            CostKind::Pass => "pass",
            CostKind::Pipeline => "pipeline",
            CostKind::Feature => "feature",
            CostKind::FrameData => "frame data",
            CostKind::Mesh => "mesh",
            CostKind::Material => "material",
            CostKind::Texture => "texture",
            CostKind::Target => "target",
        }
    }
}

/// The actors, materials and effects that request an item.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RequestedBy {
    /// Indices into `Stage::actors`, sorted.
    pub actors: BTreeSet<u32>,
    /// Indices into `SceneResources::materials`, sorted.
    pub materials: BTreeSet<u32>,
    /// Plugin names.
    pub effects: BTreeSet<String>,
    /// Name of anything else that requests the item, such as "the stage's background".
    pub other: Option<&'static str>,
}

impl RequestedBy {
    fn named(what: &'static str) -> RequestedBy {
        RequestedBy { other: Some(what), ..RequestedBy::default() }
    }

    fn effect(name: &str) -> RequestedBy {
        RequestedBy { effects: BTreeSet::from([name.to_string()]), ..RequestedBy::default() }
    }
}

/// A pass, pipeline, buffer, texture or other item that a frame needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Cost {
    pub kind: CostKind,
    pub what: String,
    /// Size on the device; `None` if it takes no memory.
    pub bytes: Option<u64>,
    pub requested_by: RequestedBy,
}

/// All costs of a frame, in the order of their kinds. The sizes are those of one frame in flight in the Vulkan renderer.
pub fn frame_costs(resources: &SceneResources, plan: &Plan, recording: &Recording) -> Vec<Cost> {
    let mut costs = Costs { resources, plan, all: Vec::new() };
    costs.add_passes(recording);
    costs.add_pipelines(recording);
    costs.add_scene_effects();
    costs.add_frame_data(recording);
    costs.add_meshes(recording);
    costs.add_materials_and_textures(recording);
    costs.add_sky(recording);
    costs.add_layers_2d();
    costs.add_targets(recording);
    costs.add_float_frame();
    costs.all.sort_by_key(|p| p.kind);
    costs.all
}

struct Costs<'a> {
    resources: &'a SceneResources,
    plan: &'a Plan,
    all: Vec<Cost>,
}

impl Costs<'_> {
    fn add(&mut self, kind: CostKind, what: String, bytes: Option<u64>, requested_by: RequestedBy) {
        self.all.push(Cost { kind, what, bytes, requested_by });
    }

    fn requested_by<'d>(&self, draws: impl Iterator<Item = &'d Draw>) -> RequestedBy {
        let mut requested_by = RequestedBy::default();
        let in_shadow: BTreeSet<u32> = self.plan.shadow_draws().map(|draw| draw.first_instance).collect();
        for draw in draws {
            let first = draw.first_instance as usize;
            let copies = self.plan.instance_actors.get(first..first + draw.instance_count as usize);
            requested_by.actors.extend(copies.unwrap_or_default());
            // Shadow maps read a material only if it has an alpha test.
            if !in_shadow.contains(&draw.first_instance) || draw.pipeline.features.has(Features::ALPHA_MASK) {
                requested_by.materials.insert(draw.material);
            }
        }
        requested_by
    }

    fn refracting_draws(&self) -> impl Iterator<Item = &Draw> {
        self.plan.draws.iter().filter(|d| d.pipeline.glass == Glass::Refract)
    }

    /// The cause of depth peeling: actors, or the stage.
    fn depth_peeling_cause(&self) -> RequestedBy {
        let mut requested_by = RequestedBy::default();
        match self.plan.depth_peeling.map(|peel| peel.cause) {
            Some(PeelCause::Order(a, b)) => {
                requested_by.actors.extend([a, b]);
                requested_by.other = Some("sorting fails: copies intersect, or their sorted order is wrong");
            }
            Some(PeelCause::SelfOverlap(actor)) => {
                requested_by.actors.insert(actor);
                requested_by.other =
                    Some("sorting fails: the mesh is not flat, and both its sides are visible");
            }
            Some(PeelCause::RequestedBy(actor)) => {
                requested_by.actors.insert(actor);
                requested_by.other = Some("its transparency \"independent\"");
            }
            _ => requested_by.other = Some("the stage's transparency \"independent\""),
        }
        requested_by
    }

    /// The actors of the draws, without their materials.
    fn requested_by_actors<'d>(&self, draws: impl Iterator<Item = &'d Draw>) -> RequestedBy {
        RequestedBy { materials: BTreeSet::new(), ..self.requested_by(draws) }
    }

    /// The draws of each scene pipeline. A draw uses the pipeline that was bound last. It occurs twice if its back and front faces are
    /// drawn separately, and is listed once.
    fn draws_of_variants(&self, recording: &Recording) -> BTreeMap<SceneVariant, Vec<Draw>> {
        let mut draws_of_variant: BTreeMap<SceneVariant, Vec<Draw>> = BTreeMap::new();
        let mut bound = None;
        for command in &recording.commands {
            match command {
                Command::BindPipeline(variant) => bound = Some(*variant),
                Command::Draw { first_instance, .. } => {
                    let drawn = self.plan.all_draws().find(|d| d.first_instance == *first_instance);
                    if let (Some(variant), Some(draw)) = (bound, drawn) {
                        let draws = draws_of_variant.entry(variant).or_default();
                        if !draws.contains(draw) {
                            draws.push(*draw);
                        }
                    }
                }
                _ => {}
            }
        }
        draws_of_variant
    }

    fn add_pipelines(&mut self, recording: &Recording) {
        let mut draws_of_feature: BTreeMap<&'static str, Vec<Draw>> = BTreeMap::new();
        for (variant, draws) in self.draws_of_variants(recording) {
            let elements: usize = draws.iter().map(|d| self.element_count(d)).sum();
            let copies: u32 = draws.iter().map(|d| d.instance_count).sum();
            let topology = format!("{:?}", variant.key.topology).to_lowercase();
            let mirrored = if variant.key.mirrored { ", mirrored" } else { "" };
            let features = switches(&variant);
            let what = format!(
                "{topology}{mirrored} {}: {}, {copies} {}, {}",
                features.join(" "),
                plural(draws.len(), "draw"),
                if copies == 1 { "copy" } else { "copies" },
                plural(elements, "element"),
            );
            self.add(CostKind::Pipeline, what, None, self.requested_by(draws.iter()));
            for feature in features {
                draws_of_feature.entry(feature).or_default().extend(&draws);
            }
        }
        for (feature, draws) in draws_of_feature {
            self.add(CostKind::Feature, feature.to_string(), None, self.requested_by(draws.iter()));
        }
    }

    fn add_scene_effects(&mut self) {
        for (bit, used) in self.plan.scene_effects.iter().enumerate() {
            let draws = self.plan.draws.iter().filter(|d| d.pipeline.effects() >> bit & 1 == 1);
            let mut requested_by = self.requested_by(draws);
            requested_by.effects.insert(used.effect.clone());
            self.add(CostKind::Feature, format!("effect {} on surfaces", used.effect), None, requested_by);
            self.add_frame_buffer(
                &format!("parameters of {}", used.effect),
                1,
                size_of_val(&used.parameters[..]),
                RequestedBy::effect(&used.effect),
            );
        }
    }

    /// Number of triangles, lines or points of all copies.
    fn element_count(&self, draw: &Draw) -> usize {
        let primitive = self.resources.primitives[draw.primitive as usize].primitive();
        let vertices = match primitive.topology {
            Topology::Triangles => 3,
            Topology::Lines => 2,
            Topology::Points => 1,
        };
        primitive.indices.len() / vertices * draw.instance_count as usize
    }

    /// Adds a buffer of `count` elements of `size` bytes that is written for every frame.
    fn add_frame_buffer(&mut self, what: &str, count: usize, size: usize, requested_by: RequestedBy) {
        self.add(CostKind::FrameData, what.into(), Some((count * size) as u64), requested_by);
    }

    fn add_frame_data(&mut self, recording: &Recording) {
        let Some(Command::UploadFrameData { instances, joints, morphs, lights }) = recording.commands.first()
        else {
            return;
        };
        let plan = self.plan;
        let draws_with =
            |feature: Features| plan.all_draws().filter(move |d| d.pipeline.features.has(feature));
        let lit = plan.draws.iter().filter(|d| d.pipeline.features.is_lit());
        let every_frame = RequestedBy::named("every frame");
        self.add_frame_buffer("camera and ambient light", 1, size_of::<FrameUniform>(), every_frame);
        for (n, each, what, requested_by) in [
            (
                *instances,
                size_of::<Instance>(),
                ["copy", "copies"],
                self.requested_by_actors(plan.draws.iter()),
            ),
            (
                *joints,
                size_of::<Affine3x4>(),
                ["joint matrix", "joint matrices"],
                self.requested_by_actors(draws_with(Features::SKIN)),
            ),
            (
                *morphs,
                size_of::<ActiveMorph>(),
                ["active morph target", "active morph targets"],
                self.requested_by_actors(draws_with(Features::MORPH)),
            ),
            (*lights, size_of::<PlanLight>(), ["light", "lights"], self.requested_by_actors(lit)),
        ] {
            if n > 0 {
                self.add_frame_buffer(&format!("{n} {}", what[usize::from(n > 1)]), n, each, requested_by);
            }
        }
        for part in &plan.overlay.parts {
            let what = format!("vertices of {}", part.effect);
            let requested_by = RequestedBy::effect(&part.effect);
            self.add_frame_buffer(&what, part.count as usize, size_of::<OverlayVertex>(), requested_by);
        }
        if !plan.material_overrides.is_empty() {
            let n = plan.material_overrides.len();
            let requested_by =
                self.requested_by_actors(plan.all_draws().filter(|d| d.material_override.is_some()));
            self.add_frame_buffer(
                &plural(n, "overridden material"),
                n,
                size_of::<MaterialUniform>(),
                requested_by,
            );
        }
        if let Some(shadow_maps) = &plan.shadow_maps {
            let each = size_of::<FrameUniform>() + size_of::<ShadowUniform>();
            let requested_by = self.requested_by_actors(plan.shadow_draws());
            self.add_frame_buffer("views of shadow maps", shadow_maps.views.len(), each, requested_by);
        }
        for pass in &plan.post {
            let what = format!("parameters of {}", pass.effect);
            self.add_frame_buffer(&what, 1, PostUniform::bytes(pass), RequestedBy::effect(&pass.effect));
        }
    }

    fn add_meshes(&mut self, recording: &Recording) {
        let bound = recording.commands.iter().filter_map(|command| match command {
            Command::BindMesh { primitive, layout, morphs } => Some((*primitive, *layout, *morphs)),
            Command::Preskin { variant, primitive, layout, .. } => {
                Some((*primitive, *layout, variant.features.has(Features::MORPH)))
            }
            _ => None,
        });
        for (index, layout, morphs) in bound.collect::<BTreeSet<(u32, VertexLayout, bool)>>() {
            let entry = &self.resources.primitives[index as usize];
            let (primitive, indices) = (entry.primitive(), entry.indices(layout));
            let packed = pack(primitive, indices, layout);
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
                bytes += pack_morphs(primitive, indices, layout).len();
                let (targets, moved) = (primitive.morphs.len(), morphed_vertices(primitive));
                what +=
                    &format!(", {targets} morph targets that move {moved} of {}", primitive.positions.len());
            }
            let draws = self.plan.all_draws().filter(|d| d.primitive == index);
            self.add(CostKind::Mesh, what, Some(bytes as u64), self.requested_by(draws));
        }
    }

    fn add_materials_and_textures(&mut self, recording: &Recording) {
        let mut slots_of: BTreeMap<u32, u32> = BTreeMap::new();
        for command in &recording.commands {
            if let Command::BindMaterial { material, slots, .. } = command {
                *slots_of.entry(*material).or_default() |= slots;
            }
        }
        let plan = self.plan;
        let mut textures: BTreeMap<u32, (Vec<u32>, bool)> = BTreeMap::new();
        for (material, slots) in &slots_of {
            let entry = &self.resources.materials[*material as usize];
            for (slot, texture) in entry.textures.iter().enumerate() {
                if let Some(texture) = texture.filter(|_| slots >> slot & 1 == 1) {
                    let (materials, anisotropic) = textures.entry(texture.texture).or_default();
                    materials.push(*material);
                    *anisotropic |= is_anisotropic(&texture.sampler);
                }
            }
            let requested_by =
                self.requested_by_actors(plan.draws.iter().filter(|d| d.material == *material));
            let what = format!("\"{}\"", entry.material.name);
            let layers = if entry.material.layers.is_some() { size_of::<LayersUniform>() } else { 0 };
            let bytes = (size_of::<MaterialUniform>() + layers) as u64;
            self.add(CostKind::Material, what, Some(bytes), requested_by);
        }
        for (texture, (materials, anisotropic)) in textures {
            let entry = &self.resources.textures[texture as usize];
            let (w, h) = (entry.image.width, entry.image.height);
            let levels = if entry.mipmaps { level_count(w, h) } else { 1 };
            let bytes =
                (0..levels).map(|l| 4 * u64::from((w >> l).max(1)) * u64::from((h >> l).max(1))).sum();
            let color = if entry.srgb { "colors" } else { "data" };
            // The plan does not know the device, so the text names when the filter applies; see `GpuOptions::anisotropy`.
            let filter = if anisotropic { ", anisotropic on GPUs" } else { "" };
            let levels = plural(levels as usize, "level");
            let what = format!("\"{}\": {w}×{h}, {levels}, {color}{filter}", entry.image.name);
            let draws = plan.draws.iter().filter(|d| materials.contains(&d.material));
            self.add(CostKind::Texture, what, Some(bytes), self.requested_by(draws));
        }
    }

    fn add_layers_2d(&mut self) {
        let requested_by = || RequestedBy::named("text, images and panels");
        if let Some(layers) = &self.plan.layers_behind {
            let [w, h] = layers.size;
            let bytes = Some(8 * u64::from(w) * u64::from(h));
            let what = format!("2D layers behind the scene: {w}×{h}, 16-bit floats");
            self.add(CostKind::Texture, what, bytes, requested_by());
        }
        if let Some(layers) = &self.plan.layers_in_front {
            let [w, h] = layers.area;
            let what = format!("2D layers over the frame, {w}×{h} pixels, by the CPU");
            self.add(CostKind::Pass, what, None, requested_by());
        }
    }

    fn add_sky(&mut self, recording: &Recording) {
        let reads = recording.reads();
        let Some(panorama) = self.resources.sky.clone().filter(|_| reads.sky) else { return };
        let lit = self.plan.draws.iter().filter(|d| d.pipeline.features.has(Features::SKY));
        let requested_by = if reads.sky_maps {
            self.requested_by_actors(lit)
        } else {
            RequestedBy::named("the stage's sky")
        };
        let bytes = |[w, h]: [u32; 2]| Some(size_of::<[f32; 2]>() as u64 * u64::from(w) * u64::from(h));
        self.add_frame_buffer(
            "rotation and strength of the sky",
            1,
            size_of::<SkyUniform>(),
            requested_by.clone(),
        );
        if reads.sky_maps {
            let maps = SkyMaps::of(&panorama);
            let ([w, h], levels) = (maps.size, maps.levels.len());
            let what = format!("sky \"{}\": {w}×{h}, {levels} roughnesses, 16-bit floats", panorama.name);
            self.add(CostKind::Texture, what, bytes([w, h]), requested_by);
        }
        if reads.sky_background {
            let [w, h] = panorama.size();
            let what = format!("background of the sky \"{}\": {w}×{h}, 16-bit floats", panorama.name);
            self.add(CostKind::Texture, what, bytes([w, h]), RequestedBy::named("the stage's sky"));
        }
    }
}

/// "1 sample", "4 samples".
fn plural(n: usize, one: &str) -> String {
    format!("{n} {one}{}", if n == 1 { "" } else { "s" })
}

fn target_name(target: Target) -> String {
    match target {
        Target::Image => "image".into(),
        Target::Float(i) => format!("linear image {i}"),
        Target::Texture(i) => format!("texture {i} of passes"),
    }
}
