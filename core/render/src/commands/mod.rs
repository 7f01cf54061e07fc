//! Plan → recording: the commands of one frame as data, with as few state changes as the draws' order allows.
//! The Vulkan renderer executes them one by one; tests count and print them.

pub(crate) mod deferred;
pub(crate) mod draws;
pub mod preskin;
pub(crate) mod text;
pub(crate) mod texture_limit;

use crate::Plan;
use crate::commands::deferred::{geometry, light};
use crate::commands::draws::{DrawState, layers};
use crate::commands::preskin::{PoseVariant, PosedBody, pose_once};
pub use crate::commands::texture_limit::{LEAST_VISIBLE, fitting, textures_beyond};
use crate::plan::{Draw, Features, Glass, TopologyKey};
use crate::scene_resources::vertex_layout::VertexLayout;
use crate::shader::SceneVariant;
use crate::shader::uniforms::{BASE_SLOTS, TOON_SLOTS};
use choreo_stage::Background;
use glam::Vec4;

/// Joint matrices that fit the smallest uniform buffer range of lavapipe and of most GPUs (65 536 bytes of 48 each).
pub const UNIFORM_JOINTS: usize = 1365;
/// Lights that fit the smallest uniform buffer range that Vulkan guarantees (16 384 bytes of 64 each).
pub const MAX_LIGHTS: usize = 256;

#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// The per-frame data that this frame needs, counted.
    UploadFrameData {
        instances: usize,
        joints: usize,
        morphs: usize,
        lights: usize,
    },
    /// Bodies of one mesh, put into their poses by the compute stage: so many of `Recording::posed`.
    Pose {
        variant: PoseVariant,
        primitive: u32,
        layout: VertexLayout,
        first: u32,
        count: u32,
    },
    /// What follows reads them.
    EndPoses,
    /// Starts the image of all shadow maps: depth alone, this much of it.
    BeginShadows {
        image: [u32; 2],
        size: [u32; 2],
    },
    /// The next draws go into this map (of `Shadows::views`), seen from its light.
    ShadowView {
        index: usize,
        at: [u32; 2],
        size: [u32; 2],
    },
    /// The gradient or the one colour, computed on the host, into the picture before the pass that loads it or draws into a part.
    CopyBackground,
    /// Starts depth and what is kept of surfaces until they are lit. All of the picture.
    BeginGeometry,
    /// Starts from the clear colour, or (without one) from what is in the target.
    BeginPass {
        target: Target,
        samples: u32,
        clear: Option<Vec4>,
        depth: bool,
        part: Part,
        /// The depth is as the geometry pass left it.
        kept: bool,
        /// Left, top, width and height of what of the picture is drawn, over the copied background; `None`: all.
        area: Option<[u32; 4]>,
    },
    /// The picture so far, once more, with so many levels, for glass that bends light.
    CopyBehind {
        from: Target,
        levels: u32,
    },
    /// Starts the depths of a layer of what is seen through, and reads those of the layer before, or the scene's.
    BeginPeel {
        layer: u32,
        samples: u32,
        area: Option<[u32; 4]>,
    },
    /// Goes on with the picture: what has the depths of a layer, or (`rest`) what is nearer.
    BeginLayer {
        layer: u32,
        rest: bool,
        target: Target,
        samples: u32,
        area: Option<[u32; 4]>,
    },
    BindPipeline(SceneVariant),
    /// Which faces of the next draws are left out.
    SetCull(Cull),
    /// Index into `Catalog::materials`, and which of its textures the pipeline reads (see [`texture_slots`]).
    /// `changed`: index into `Plan::materials`, whose factors count then.
    BindMaterial {
        material: u32,
        changed: Option<u32>,
        slots: u32,
    },
    /// Index into `Catalog::primitives`, with the attributes that are bound, and its morph offsets.
    BindMesh {
        primitive: u32,
        layout: VertexLayout,
        morphs: bool,
    },
    Draw {
        first_instance: u32,
        instance_count: u32,
        /// First index and how many; `None`: all.
        indices: Option<[u32; 2]>,
    },
    /// Light on what was kept of surfaces, within left, top, width and height; `None`: wherever anything was drawn.
    DrawLight {
        area: Option<[u32; 4]>,
    },
    /// The gradient, or a colour that effects change, where nothing was drawn; a bit for each effect on it, of
    /// `Recording::surface`.
    DrawBackground {
        surface: u8,
    },
    /// The sky in its place, with the same effects.
    DrawSky {
        surface: u8,
    },
    /// Flat layers over either.
    DrawUnder,
    /// What an effect draws (of `PlanOverlay::parts`).
    DrawOverlay {
        effect: String,
        over: bool,
        first: u32,
        count: u32,
    },
    EndPass,
    /// A full-screen pass from the last target to the next one.
    PostPass {
        index: usize,
        effect: String,
        /// Number of earlier runs of an effect that runs more than once.
        number: u32,
        from: Target,
        /// What the effect's first pass got.
        original: Target,
        to: Target,
        /// Pixels of what it makes.
        size: [u32; 2],
    },
    ReadBack,
    /// The first float picture as it is.
    ReadBackLinear,
}

/// A picture with glass that bends light is drawn in two passes, with a copy of it between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    Whole,
    /// Colour, samples and depth are kept.
    UntilCopy,
    /// They are as the first part left them.
    AfterCopy,
    /// Layers of what is seen through follow: colour, samples and depth are kept.
    UntilLayers,
    /// After them, with the scene's own depth.
    AfterLayers,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cull {
    None,
    Back,
    Front,
}

/// What pays on which device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecordOptions {
    /// A full-screen draw costs such a driver more than all the rest of a small scene, a copy of rows hardly anything;
    /// and shading hidden back faces of double-sided materials costs more than drawing them again behind the front faces.
    pub cpu_device: bool,
    /// Textures that a material's shader may read at once; `None`: as many as there are.
    pub textures: Option<u32>,
    /// Cut-outs lose whole pixels: the device cannot set alpha to one once it has made samples of it.
    pub no_coverage: bool,
    /// What is seen through is sorted: the device cannot tell a pixel's samples apart.
    pub no_layers: bool,
    /// Everything is lit as it is drawn: the device cannot draw into what would be kept.
    pub no_deferred: bool,
    /// The device's queue cannot compute, or a buffer for what it would compute is too large: vertices are posed by every pass.
    pub no_compute: bool,
}

/// Where pixels go. Float targets exist only where post passes read them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Target {
    /// sRGB-encoded 8 bits: what is read back.
    Picture,
    /// Linear 16-bit floats, one of three.
    Float(u8),
}

#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    pub size: [u32; 2],
    /// Names of the effects on surfaces, in the order of the bits of `PipelineKey::surface`.
    pub surface: Vec<String>,
    /// What `Command::Pose` poses, in order.
    pub posed: Vec<PosedBody>,
    pub commands: Vec<Command>,
}

/// See [`Recording::reads`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reads {
    pub lights: bool,
    pub joints: bool,
    pub morphs: bool,
    pub joints_uniform: bool,
    /// Of the sky: anything, its maps, its picture.
    pub sky: bool,
    pub sky_maps: bool,
    pub sky_picture: bool,
    /// Layers under the scene.
    pub under: bool,
}

/// How many of each a frame needs; what "leaves things out" means in numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    pub passes: usize,
    pub pipeline_binds: usize,
    pub distinct_pipelines: usize,
    pub material_binds: usize,
    pub mesh_binds: usize,
    pub draws: usize,
    pub post_passes: usize,
    pub shadow_views: usize,
    /// Bodies posed by the compute stage.
    pub posed: usize,
}

/// `triangles`: of one copy of a catalogue's primitive.
pub fn record(plan: &Plan, options: RecordOptions, triangles: impl Fn(u32) -> usize) -> Recording {
    let mut commands = Vec::with_capacity(plan.draws.len() * 2 + 8);
    let shadow_draws = || plan.shadows.iter().flat_map(|s| &s.views).flat_map(|v| &v.draws);
    let any = |f: Features| plan.draws.iter().chain(shadow_draws()).any(|d| d.pipeline.features.has(f));
    let lit = plan.draws.iter().any(|d| d.pipeline.features.is_lit());
    commands.push(Command::UploadFrameData {
        instances: if plan.draws.is_empty() { 0 } else { plan.instances.len() },
        joints: if any(Features::SKIN) { plan.joint_matrices.len() } else { 0 },
        morphs: if any(Features::MORPH) { plan.morphs.len() } else { 0 },
        lights: if lit { plan.lights.len() } else { 0 },
    });

    if let Some(shadows) = &plan.shadows {
        commands.push(Command::BeginShadows { image: shadows.image, size: shadows.size });
        let mut state = DrawState::new(plan, commands, true, options, &triangles);
        for (index, view) in shadows.views.iter().enumerate() {
            state.commands.push(Command::ShadowView { index, at: view.at, size: view.size });
            view.draws.iter().for_each(|draw| state.draw(draw, cull_of(draw)));
        }
        commands = state.commands;
        commands.push(Command::EndPass);
    }

    let scene = match plan.post.is_empty() && !plan.linear {
        true => Target::Picture,
        false => Target::Float(0),
    };
    let sky = plan.sky.is_some_and(|sky| sky.background);
    let gradient = !sky && matches!(plan.background, Background::Gradient { .. });
    let surface = plan.background_effects;
    let copied =
        gradient && surface == 0 && options.cpu_device && plan.samples == 1 && scene == Target::Picture;
    let samples = plan.samples > 1 && scene == Target::Picture && plan.behind.is_none();
    let nothing_else = !sky && surface == 0 && plan.under.is_none() && plan.overlay.parts.is_empty();
    let area = match options.cpu_device && samples && nothing_else {
        true => plan.area.part_of(plan.size),
        false => None,
    };
    let clear = match plan.background {
        _ if sky => Some(Vec4::ZERO),
        Background::Color(c) => Some(c),
        Background::Gradient { .. } => (!copied).then_some(Vec4::ZERO),
    };
    // Without draws the gradient needs no depth to be tested against.
    let depth = !plan.draws.is_empty() || !plan.overlay.parts.is_empty();
    if copied || area.is_some() {
        commands.push(Command::CopyBackground);
    }
    let deferred = plan.deferred.as_ref().filter(|_| !options.no_deferred && plan.samples == 1);
    let begin = |clear, part| {
        let (target, samples, kept) = (scene, plan.samples, deferred.is_some());
        Command::BeginPass { target, samples, clear, depth, part, kept, area }
    };
    let peel = plan.peel.filter(|_| !options.no_layers);
    let first_part = match plan.behind {
        Some(_) => Part::UntilCopy,
        None if peel.is_some() => Part::UntilLayers,
        None => Part::Whole,
    };
    if deferred.is_some() {
        commands = geometry(plan, commands, &plan.draws, options, &triangles);
    }
    commands.push(begin(clear, first_part));
    let mut state = DrawState::new(plan, commands, false, options, &triangles);
    if let Some(deferred) = deferred {
        light(plan, deferred, &mut state);
    }
    let first_blended =
        plan.draws.iter().position(|d| d.pipeline.is_see_through()).unwrap_or(plan.draws.len());
    let (solid, blended) = plan.draws.split_at(first_blended);
    // What is lit already is not drawn again.
    let solid = || solid.iter().filter(|d| deferred.is_none() || !d.deferred);
    let split = options.cpu_device && faces_apart_pay(plan, solid(), &triangles);
    let apart = |d: &Draw| split && d.pipeline.double_sided && d.pipeline.topology == TopologyKey::Triangles;
    for draw in solid() {
        state.draw(draw, if apart(draw) { Cull::Back } else { cull_of(draw) });
    }
    for draw in solid().filter(|d| apart(d)) {
        state.draw(draw, Cull::Front);
    }
    // Blended surfaces mix with what is behind them, the background included.
    if sky || ((gradient || surface != 0) && !copied) {
        state.set_cull(Cull::None);
        let behind = if sky { Command::DrawSky { surface } } else { Command::DrawBackground { surface } };
        state.commands.push(behind);
        state.pipeline = None;
    }
    if plan.under.is_some() {
        state.set_cull(Cull::None);
        state.commands.push(Command::DrawUnder);
        state.pipeline = None;
    }
    // What is farther than the first glass that bends light is seen through all such glass.
    let first_refracting = blended.iter().position(|d| d.pipeline.glass == Glass::Refract);
    let sorted = if peel.is_some() { &[][..] } else { blended };
    for (index, draw) in sorted.iter().enumerate() {
        if let (Some(behind), true) = (plan.behind, Some(index) == first_refracting) {
            state.commands.extend([
                Command::EndPass,
                Command::CopyBehind { from: scene, levels: behind.levels },
                begin(None, Part::AfterCopy),
            ]);
            state = DrawState::new(plan, state.commands, false, options, &triangles);
        }
        state.draw(draw, cull_of(draw));
    }
    if !plan.overlay.parts.is_empty() {
        state.set_cull(Cull::None);
    }
    let mut commands = state.commands;
    if let Some(peel) = peel {
        let to = (scene, area, options);
        commands = layers(plan, commands, to, peel.layers, blended, &triangles);
        commands.push(begin(None, Part::AfterLayers));
        if !plan.overlay.parts.is_empty() {
            commands.push(Command::SetCull(Cull::None));
        }
    }
    commands.extend(plan.overlay.parts.iter().map(|part| Command::DrawOverlay {
        effect: part.effect.clone(),
        over: part.over,
        first: part.first,
        count: part.count,
    }));
    commands.push(Command::EndPass);

    let mut from = scene;
    let mut original = scene;
    for (index, pass) in plan.post.iter().enumerate() {
        if pass.number == 0 {
            original = from;
        }
        // Into what is neither read now nor by a later pass of the same effect.
        let free = (0..3).map(Target::Float).find(|t| *t != from && *t != original);
        let to = match index + 1 == plan.post.len() {
            true => Target::Picture,
            false => free.unwrap_or(Target::Float(2)),
        };
        let (effect, number, size) = (pass.effect.clone(), pass.number, pass.size(plan.size));
        commands.push(Command::PostPass { index, effect, number, from, original, to, size });
        from = to;
    }
    commands.push(if plan.linear { Command::ReadBackLinear } else { Command::ReadBack });
    let surface = plan.surface.iter().map(|s| s.effect.clone()).collect();
    let recording = Recording { size: plan.size, surface, posed: Vec::new(), commands };
    pose_once(plan, recording, options, &triangles)
}

/// Those of every material, in the order of their slots.
pub(crate) const BASE_TEXTURES: [Features; BASE_SLOTS] = [
    Features::BASE_COLOR_TEXTURE,
    Features::METALLIC_ROUGHNESS_TEXTURE,
    Features::NORMAL_TEXTURE,
    Features::OCCLUSION_TEXTURE,
    Features::EMISSIVE_TEXTURE,
    Features::SPECULAR_TEXTURE,
    Features::SPECULAR_COLOR_TEXTURE,
];

const TOON_TEXTURES: [Features; TOON_SLOTS] = [Features::OUTLINE_WIDTH_TEXTURE, Features::UV_MASK];

/// Texture slots that the features read, a bit each.
pub fn texture_slots(features: Features) -> u32 {
    let all = BASE_TEXTURES.iter().chain(&crate::plan::features_layers::TEXTURES).chain(&TOON_TEXTURES);
    all.enumerate().map(|(i, f)| u32::from(features.has(*f)) << i).sum()
}

pub(crate) fn cull_of(draw: &Draw) -> Cull {
    match draw.pipeline.topology {
        TopologyKey::Triangles if draw.pipeline.features.has(Features::SHELL) => Cull::Front,
        TopologyKey::Triangles if !draw.pipeline.double_sided => Cull::Back,
        _ => Cull::None,
    }
}

/// Many pixels a triangle that shows both faces: shading weighs more than a second run of the vertex shader. Measured on lavapipe with one
/// and with 25 characters of 7,000 triangles at 1280×720: 18.3 → 13 ms, and no gain.
fn faces_apart_pay<'a>(
    plan: &Plan,
    draws: impl Iterator<Item = &'a Draw>,
    triangles: impl Fn(u32) -> usize,
) -> bool {
    let double_sided = draws.filter(|d| d.pipeline.double_sided);
    let open = |d: &Draw| triangles(d.primitive).saturating_sub(d.closed as usize / 3);
    let count: usize = double_sided.map(|d| open(d) * d.instance_count as usize).sum();
    count > 0 && plan.size[0] as usize * plan.size[1] as usize / count >= 16
}

impl Recording {
    /// Which of the frame's buffers any pipeline reads.
    pub fn reads(&self) -> Reads {
        let mut reads = Reads::default();
        for command in &self.commands {
            reads.under |= *command == Command::DrawUnder;
            if matches!(command, Command::DrawSky { .. }) {
                (reads.sky, reads.sky_picture) = (true, true);
            }
            if let Command::Pose { variant: v, .. } = command {
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

    pub fn counts(&self) -> Counts {
        let mut counts = Counts::default();
        let mut variants = std::collections::BTreeSet::new();
        for command in &self.commands {
            match command {
                Command::BeginGeometry
                | Command::BeginPass { .. }
                | Command::BeginShadows { .. }
                | Command::BeginPeel { .. }
                | Command::BeginLayer { .. } => counts.passes += 1,
                Command::ShadowView { .. } => counts.shadow_views += 1,
                Command::Pose { count, .. } => counts.posed += *count as usize,
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
