//! Plan → recording: the commands of one frame as data, with as few state changes as the draws' order allows.
//! The Vulkan renderer executes them one by one; tests count and print them.

mod deferred;
mod draws;
mod inputs;
pub(crate) mod preskin;
mod scene;
mod text;
mod texture_limit;

use crate::commands::deferred::record_gbuffer;
use crate::commands::draws::DrawRecorder;
use crate::commands::preskin::{PreskinVariant, PreskinnedMesh};
use crate::commands::scene::record_scene;
use crate::plan::build::shadow_cascades::MAX_VIEWS;
pub use crate::plan::shader_features::texture_slots;
use crate::plan::{Draw, Features, Plan, PostPass, TopologyKey};
use crate::scene_resources::vertex_layout::VertexLayout;
use crate::shader::SceneVariant;
use glam::Vec4;

pub(crate) use crate::commands::texture_limit::textures_beyond_limit;

/// Number of joint matrices that fit the smallest uniform buffer range of lavapipe and of most GPUs (65 536 bytes of 48 each).
pub(crate) const MAX_UNIFORM_JOINTS: usize = 1365;

#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Uploads the frame's data. The fields are the numbers of elements.
    UploadFrameData {
        instances: usize,
        joints: usize,
        morphs: usize,
        lights: usize,
    },
    /// Pre-skins the deformations of one mesh by a compute pass: a range of `Recording::preskinned`.
    Preskin {
        variant: PreskinVariant,
        primitive: u32,
        layout: VertexLayout,
        first: u32,
        count: u32,
    },
    /// Ends pre-skinning; later commands read the vertices.
    EndPreskin,
    /// Begins the depth-only pass of all shadow maps. `image`: size of the image that the maps share; `size`: the part that is
    /// used; `clear`: the pass clears this part, because no map of the previous frame is kept.
    BeginShadows {
        image: [u32; 2],
        size: [u32; 2],
        clear: bool,
    },
    /// Selects the map (an element of `ShadowMaps::views`) that the next draws are drawn into. `clear`: clears this map, because
    /// other maps of the image are kept.
    SetShadowView {
        index: usize,
        at: [u32; 2],
        size: [u32; 2],
        clear: bool,
    },
    /// Keeps all shadow maps of the previous frame: none is drawn.
    KeepShadows {
        image: [u32; 2],
    },
    /// Copies the background, a gradient or color computed on the host, into the image. The next pass loads it, or draws only into
    /// a part of the image.
    CopyBackground,
    /// Begins the G-buffer pass of the whole image.
    BeginGBuffer,
    /// Begins the pass of the inputs of effects, with motion vectors or without.
    BeginInputs {
        motion: bool,
    },
    /// Ends the pass of the inputs of effects; later commands read its images.
    EndInputs,
    /// Begins a pass of the scene. Loads the target if there is no clear color.
    BeginPass {
        target: Target,
        samples: u32,
        clear: Option<Vec4>,
        depth: bool,
        part: PassPart,
        /// Whether the pass loads the depth of the G-buffer pass.
        loads_depth: bool,
        /// Render area: left, top, width and height, over the copied background; `None`: everything.
        area: Option<[u32; 4]>,
    },
    /// Copies the image as drawn so far, with mipmaps, for refraction.
    CopySceneColor {
        from: Target,
        levels: u32,
    },
    /// Begins the pass that finds the depth of a peeled layer. It reads the depth of the previous layer, or of the opaque scene.
    BeginPeel {
        layer: u32,
        samples: u32,
        area: Option<[u32; 4]>,
    },
    /// Begins the pass that blends the surfaces at a layer's depth, or (`nearer`) all surfaces in front of the layer.
    BeginLayer {
        layer: u32,
        nearer: bool,
        target: Target,
        samples: u32,
        area: Option<[u32; 4]>,
    },
    BindPipeline(SceneVariant),
    /// Sets which faces of the next draws are culled.
    SetCull(Cull),
    /// Binds a material of the scene resources with the textures that the pipeline reads (see [`texture_slots`]).
    BindMaterial {
        material: u32,
        /// Index into `Plan::material_overrides`, which replaces its factors.
        material_override: Option<u32>,
        slots: u32,
    },
    /// Binds a primitive of the scene resources with these attributes, and its morph targets.
    BindMesh {
        primitive: u32,
        layout: VertexLayout,
        morphs: bool,
    },
    Draw {
        first_instance: u32,
        instance_count: u32,
        /// First index and number of indices; `None`: all.
        indices: Option<[u32; 2]>,
    },
    /// Lights the G-buffer within left, top, width and height; `None`: everywhere.
    DrawDeferredLighting {
        area: Option<[u32; 4]>,
    },
    /// Draws the background (a gradient, or a color that effects change) where no surface was drawn. `surface`: effects, as bits of
    /// `Recording::scene_effects`.
    DrawBackground {
        surface: u8,
    },
    /// Draws the sky in place of the gradient or color, with the same effects.
    DrawSky {
        surface: u8,
        /// [`Plan::display`].
        display: Features,
    },
    /// Draws the 2D layers behind the scene.
    DrawLayersBehind,
    /// Draws the overlay of an effect: one of `PlanOverlay::parts`.
    DrawOverlay {
        effect: String,
        over: bool,
        first: u32,
        count: u32,
    },
    EndPass,
    /// A full-screen pass from one target to another.
    PostPass {
        index: usize,
        effect: String,
        /// Index of the pass among the passes of its effect.
        number: u32,
        from: Target,
        /// Input of the effect's first pass.
        original: Target,
        /// Textures that the pass reads, in the order of [`crate::plan::PostPass::reads`].
        textures: Vec<Target>,
        to: Target,
        /// Size of the output in pixels.
        size: [u32; 2],
    },
    ReadBack,
    /// Reads back the first float target.
    ReadBackLinear,
    /// Reads back the images of the inputs of effects, one after the other.
    ReadBackInputs,
}

/// Part of the scene that a pass draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PassPart {
    Whole,
    /// The pass up to the scene color copy: color, samples and depth are stored.
    UntilCopy,
    /// The pass continues after the copy: color, samples and depth are loaded.
    AfterCopy,
    /// The pass up to the peeled layers: color, samples and depth are stored.
    UntilLayers,
    /// The pass continues after the layers, with the scene's own depth.
    AfterLayers,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cull {
    None,
    Back,
    Front,
}

/// Features that the device lacks, and properties that decide how drawing is fastest on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecordOptions {
    /// Whether the Vulkan driver runs on the CPU. A full-screen draw then takes longer than everything else in a small scene, while
    /// copying rows takes almost no time. Shading hidden back faces of double-sided materials takes longer than drawing them
    /// separately, after the front faces.
    pub cpu_device: bool,
    /// Largest number of textures that a material's shader may bind; `None`: unlimited.
    pub textures: Option<u32>,
    /// Whether the device lacks the feature alphaToOne, so that the alpha test of cut-outs removes pixels instead of samples.
    pub no_coverage: bool,
    /// Whether the device lacks sample-rate shading, so that transparent surfaces are sorted.
    pub no_depth_peeling: bool,
    /// Whether the device cannot draw into a G-buffer, so that everything is shaded forward.
    pub no_deferred: bool,
    /// Whether the device's queue cannot compute, or a buffer would be too large, so that every pass skins vertices.
    pub no_compute: bool,
    /// Shadow maps of the previous frame that can be kept unchanged: one bit for each of `ShadowMaps::views`.
    pub kept_maps: u32,
}

const _: () = assert!(MAX_VIEWS <= u32::BITS as usize);

/// A color target. Float targets exist only if full-screen passes read them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Target {
    /// sRGB-encoded 8 bits, which are read back.
    Image,
    /// Linear 16-bit floats, one of three.
    Float(u8),
    /// Linear 16-bit floats: the texture of an effect pass, with its own size.
    Texture(u8),
}

/// An effect in the scene's shaders.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct EffectOnSurfaces {
    /// Bit of the effect in [`crate::plan::PipelineKey::effects`].
    pub bit: u8,
    /// Row of its first four parameters in the uniform buffer of all these effects.
    pub first_row: u32,
    /// Plugin name.
    pub name: String,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    pub size: [u32; 2],
    /// The effects in the scene's shaders, in the order of the bits of `PipelineKey::surface`.
    pub scene_effects: Vec<EffectOnSurfaces>,
    /// Meshes that `Command::Preskin` writes, in order.
    pub preskinned: Vec<PreskinnedMesh>,
    pub commands: Vec<Command>,
}

/// Buffers and images that the pipelines of a frame read; see [`Recording::reads`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ResourceReads {
    pub lights: bool,
    pub joints: bool,
    pub morphs: bool,
    pub joints_uniform: bool,
    /// The sky in any form: its maps or its image.
    pub sky: bool,
    pub sky_maps: bool,
    pub sky_background: bool,
    /// 2D layers behind the scene.
    pub layers_behind: bool,
}

/// Numbers of commands in a recording, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CommandCounts {
    pub passes: usize,
    pub pipeline_binds: usize,
    pub distinct_pipelines: usize,
    pub material_binds: usize,
    pub mesh_binds: usize,
    pub draws: usize,
    pub post_passes: usize,
    pub shadow_views: usize,
    /// Pre-skinned meshes.
    pub preskinned: usize,
}

/// Records a plan's commands. `triangles` gives the number of triangles of a primitive.
pub fn record(plan: &Plan, options: RecordOptions, triangles: impl Fn(u32) -> usize) -> Recording {
    let recorder = Recorder { plan, options, triangles: &triangles };
    let mut commands = vec![upload_command(plan)];
    inputs::record_inputs(recorder, &mut commands);
    if plan.inputs_only {
        commands.push(Command::ReadBackInputs);
        let recording = Recording {
            size: plan.size,
            scene_effects: scene_effects(plan),
            preskinned: Vec::new(),
            commands,
        };
        return preskin::add_preskinning(recorder, recording);
    }
    record_shadow_maps(recorder, &mut commands);
    let scene = match plan.post.is_empty() && !plan.linear {
        true => Target::Image,
        false => Target::Float(0),
    };
    record_scene(recorder, scene, &mut commands);
    record_post_passes(plan, scene, &mut commands);
    commands.push(if plan.linear { Command::ReadBackLinear } else { Command::ReadBack });
    let recording =
        Recording { size: plan.size, scene_effects: scene_effects(plan), preskinned: Vec::new(), commands };
    preskin::add_preskinning(recorder, recording)
}

fn scene_effects(plan: &Plan) -> Vec<EffectOnSurfaces> {
    let effects = (0..).zip(plan.scene_effects.iter().zip(plan.first_rows()));
    effects
        .map(|(bit, (used, first_row))| EffectOnSurfaces { bit, first_row, name: used.effect.clone() })
        .collect()
}

/// Inputs of the functions that record commands.
#[derive(Clone, Copy)]
struct Recorder<'a> {
    plan: &'a Plan,
    options: RecordOptions,
    triangles: &'a dyn Fn(u32) -> usize,
}

fn upload_command(plan: &Plan) -> Command {
    let any_draw_has = |f: Features| plan.all_draws().any(|d| d.pipeline.features.has(f));
    let lit = plan.draws.iter().any(|d| d.pipeline.features.is_lit());
    Command::UploadFrameData {
        instances: if plan.all_draws().next().is_none() { 0 } else { plan.instances.len() },
        joints: if any_draw_has(Features::SKIN) { plan.joint_matrices.len() } else { 0 },
        morphs: if any_draw_has(Features::MORPH) { plan.morphs.len() } else { 0 },
        lights: if lit { plan.lights.len() } else { 0 },
    }
}

fn record_shadow_maps(recorder: Recorder, commands: &mut Vec<Command>) {
    let Some(shadow_maps) = &recorder.plan.shadow_maps else { return };
    let (image, size) = (shadow_maps.image, shadow_maps.size);
    let is_kept = |index: usize| recorder.options.kept_maps >> index & 1 == 1;
    let none_kept = recorder.options.kept_maps == 0;
    if !none_kept && (0..shadow_maps.views.len()).all(is_kept) {
        return commands.push(Command::KeepShadows { image });
    }
    commands.push(Command::BeginShadows { image, size, clear: none_kept });
    let mut draws = DrawRecorder::new(recorder, commands);
    draws.shadow_pass = true;
    for (index, view) in shadow_maps.views.iter().enumerate().filter(|(index, _)| !is_kept(*index)) {
        draws.commands.push(Command::SetShadowView {
            index,
            at: view.at,
            size: view.size,
            clear: !none_kept,
        });
        view.draws.iter().for_each(|draw| draws.draw(draw, cull_of(draw)));
    }
    commands.push(Command::EndPass);
}

fn record_post_passes(plan: &Plan, scene: Target, commands: &mut Vec<Command>) {
    let (mut from, mut original) = (scene, scene);
    let mut slots = TextureSlots::default();
    for (index, pass) in plan.post.iter().enumerate() {
        // All passes of an effect with named textures read the image that the effect received.
        if pass.number == 0 || pass.texture.is_some() {
            original = from;
        }
        // Overwrites neither the input of the pass nor the effect's input, which its later passes may read.
        let free = (0..3).map(Target::Float).find(|t| *t != from && *t != original);
        let size = pass.size(plan.size);
        let textures = slots.targets_of(&pass.reads);
        let to = match pass.texture {
            Some(_) => slots.allocate(pass.number, size),
            None if index + 1 == plan.post.len() => Target::Image,
            None => free.unwrap_or(Target::Float(2)),
        };
        let (effect, number) = (pass.effect.clone(), pass.number);
        commands.push(Command::PostPass { index, effect, number, from, original, textures, to, size });
        slots.release_unread(&plan.post[index..]);
        if pass.texture.is_none() {
            from = to;
        }
    }
}

/// Images that hold the textures of effect passes. An image whose texture no later pass reads is reused for a texture of the same
/// size.
#[derive(Default)]
struct TextureSlots {
    /// Size of each image, and the number of the pass whose texture it holds.
    images: Vec<([u32; 2], Option<u32>)>,
}

impl TextureSlots {
    fn targets_of(&self, passes: &[u32]) -> Vec<Target> {
        let slot = |pass: &u32| self.images.iter().position(|(_, stored_pass)| stored_pass == &Some(*pass));
        passes.iter().filter_map(slot).map(|slot| Target::Texture(slot as u8)).collect()
    }

    fn allocate(&mut self, pass: u32, size: [u32; 2]) -> Target {
        let free = self.images.iter().position(|slot| *slot == (size, None));
        let slot = free.unwrap_or_else(|| {
            self.images.push((size, None));
            self.images.len() - 1
        });
        self.images[slot].1 = Some(pass);
        Target::Texture(slot as u8)
    }

    /// Frees the images whose textures no later pass of the current effect reads. `passes`: the current pass and all after it.
    fn release_unread(&mut self, passes: &[PostPass]) {
        let own = passes.iter().position(|pass| pass.texture.is_none()).unwrap_or(passes.len());
        let later = passes.get(1..=own).unwrap_or_default();
        for (_, stored_pass) in &mut self.images {
            *stored_pass = stored_pass.filter(|pass| later.iter().any(|later| later.reads.contains(pass)));
        }
    }
}

fn cull_of(draw: &Draw) -> Cull {
    match draw.pipeline.topology {
        TopologyKey::Triangles if draw.pipeline.features.has(Features::OUTLINE) => Cull::Front,
        TopologyKey::Triangles if !draw.pipeline.double_sided => Cull::Back,
        _ => Cull::None,
    }
}

/// Whether it is faster on a CPU device to draw back faces separately, after front faces. It is if a double-sided triangle covers
/// many pixels: shading them then takes longer than a second run of the vertex shader. Measured on lavapipe at 1280×720 with
/// characters of 7,000 triangles: 18.3 → 13 ms with one, no gain with 25.
fn separate_faces_are_faster<'a>(
    plan: &Plan,
    draws: impl Iterator<Item = &'a Draw>,
    triangles: &dyn Fn(u32) -> usize,
) -> bool {
    let double_sided = draws.filter(|d| d.pipeline.double_sided);
    let open_triangles = |d: &Draw| triangles(d.primitive).saturating_sub(d.watertight as usize / 3);
    let count: usize = double_sided.map(|d| open_triangles(d) * d.instance_count as usize).sum();
    count > 0 && plan.size[0] as usize * plan.size[1] as usize / count >= 16
}

impl Recording {
    /// Buffers and images that any pipeline reads.
    pub fn reads(&self) -> ResourceReads {
        let mut reads = ResourceReads::default();
        for command in &self.commands {
            reads.layers_behind |= *command == Command::DrawLayersBehind;
            if matches!(command, Command::DrawSky { .. }) {
                (reads.sky, reads.sky_background) = (true, true);
            }
            if let Command::Preskin { variant: v, .. } = command {
                reads.joints |= v.features.has(Features::SKIN);
                reads.morphs |= v.features.has(Features::MORPH);
                reads.joints_uniform |= v.joints_uniform;
            }
            if let Command::BindPipeline(v) = command {
                reads.sky_maps |= v.key.features.has(Features::SKY);
                reads.lights |= v.key.features.is_lit();
                reads.joints |= v.key.features.has(Features::SKIN);
                reads.morphs |= v.key.features.has(Features::MORPH);
                reads.joints_uniform |= v.joints_uniform;
            }
        }
        reads.sky |= reads.sky_maps;
        reads
    }

    pub fn counts(&self) -> CommandCounts {
        let mut counts = CommandCounts::default();
        let mut variants = std::collections::BTreeSet::new();
        for command in &self.commands {
            match command {
                Command::BeginGBuffer
                | Command::BeginInputs { .. }
                | Command::BeginPass { .. }
                | Command::BeginShadows { .. }
                | Command::KeepShadows { .. }
                | Command::BeginPeel { .. }
                | Command::BeginLayer { .. } => counts.passes += 1,
                Command::SetShadowView { .. } => counts.shadow_views += 1,
                Command::Preskin { count, .. } => counts.preskinned += *count as usize,
                Command::BindPipeline(v) => {
                    counts.pipeline_binds += 1;
                    variants.insert(*v);
                }
                Command::BindMaterial { .. } => counts.material_binds += 1,
                Command::BindMesh { .. } => counts.mesh_binds += 1,
                Command::Draw { .. } => counts.draws += 1,
                Command::PostPass { .. } => counts.post_passes += 1,
                _ => {}
            }
        }
        counts.distinct_pipelines = variants.len();
        counts
    }
}
