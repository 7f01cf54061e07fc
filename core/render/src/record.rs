//! Plan → recording: the commands of one frame as data, with as few state changes as the draws' order allows.
//! The Vulkan renderer executes them one by one; tests count and print them.

use crate::Plan;
use crate::plan::{Features, PipelineKey};
use crate::shader::SceneVariant;
use crate::vertex::VertexLayout;
use choreo_stage::Background;
use glam::Vec4;
use std::fmt;

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
    BeginPass {
        target: Target,
        samples: u32,
        clear: Vec4,
        depth: bool,
    },
    BindPipeline(SceneVariant),
    /// Index into `Catalog::materials`, and which of its textures the pipeline reads (see [`texture_slots`]).
    BindMaterial {
        material: u32,
        slots: u8,
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
    },
    /// The gradient, where nothing was drawn.
    DrawBackground,
    EndPass,
    /// A full-screen pass from the last target to the next one.
    PostPass {
        index: usize,
        effect: String,
        from: Target,
        to: Target,
    },
    ReadBack,
}

/// Where pixels go. Float targets exist only where post passes read them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Target {
    /// sRGB-encoded 8 bits: what is read back.
    Picture,
    /// Linear 16-bit floats, one of two.
    Float(u8),
}

#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    pub size: [u32; 2],
    pub commands: Vec<Command>,
}

/// See [`Recording::reads`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reads {
    pub lights: bool,
    pub joints: bool,
    pub morphs: bool,
    pub joints_uniform: bool,
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
}

pub fn record(plan: &Plan) -> Recording {
    let mut commands = Vec::with_capacity(plan.draws.len() * 2 + 8);
    let any = |f: Features| plan.draws.iter().any(|d| d.pipeline.features.has(f));
    let lit = plan.draws.iter().any(|d| d.pipeline.features.is_lit());
    commands.push(Command::UploadFrameData {
        instances: if plan.draws.is_empty() { 0 } else { plan.instances.len() },
        joints: if any(Features::SKIN) { plan.joint_matrices.len() } else { 0 },
        morphs: if any(Features::MORPH) { plan.morphs.len() } else { 0 },
        lights: if lit { plan.lights.len() } else { 0 },
    });

    let scene = if plan.post.is_empty() { Target::Picture } else { Target::Float(0) };
    let gradient = matches!(plan.background, Background::Gradient { .. });
    let clear = match plan.background {
        Background::Color(c) => c,
        Background::Gradient { .. } => Vec4::ZERO,
    };
    // Without draws the gradient needs no depth to be tested against.
    let depth = !plan.draws.is_empty();
    commands.push(Command::BeginPass { target: scene, samples: plan.samples, clear, depth });
    let first_blended = plan.draws.iter().position(|d| d.pipeline.blend).unwrap_or(plan.draws.len());
    let joints_uniform = plan.joint_matrices.len() <= UNIFORM_JOINTS;
    let (mut pipeline, mut material, mut mesh) = (None, None, None);
    let mut gradient_pending = gradient;
    for (i, draw) in plan.draws.iter().enumerate() {
        // Blended surfaces mix with what is behind them, the background included.
        if i == first_blended && gradient_pending {
            commands.push(Command::DrawBackground);
            gradient_pending = false;
            pipeline = None;
        }
        let variant = variant(plan, draw.pipeline, draw.first_instance, draw.instance_count, joints_uniform);
        let features = variant.key.features;
        if pipeline != Some(variant) {
            commands.push(Command::BindPipeline(variant));
            pipeline = Some(variant);
        }
        let slots = texture_slots(features);
        if material != Some((draw.material, slots)) {
            commands.push(Command::BindMaterial { material: draw.material, slots });
            material = Some((draw.material, slots));
        }
        let wanted = (draw.primitive, VertexLayout::of(features), features.has(Features::MORPH));
        if mesh != Some(wanted) {
            commands.push(Command::BindMesh { primitive: wanted.0, layout: wanted.1, morphs: wanted.2 });
            mesh = Some(wanted);
        }
        commands
            .push(Command::Draw { first_instance: draw.first_instance, instance_count: draw.instance_count });
    }
    if gradient_pending {
        commands.push(Command::DrawBackground);
    }
    commands.push(Command::EndPass);

    let mut from = scene;
    for (index, pass) in plan.post.iter().enumerate() {
        let to = match (index + 1 == plan.post.len(), from) {
            (true, _) => Target::Picture,
            (false, Target::Float(0)) => Target::Float(1),
            (false, _) => Target::Float(0),
        };
        commands.push(Command::PostPass { index, effect: pass.effect.clone(), from, to });
        from = to;
    }
    commands.push(Command::ReadBack);
    Recording { size: plan.size, commands }
}

/// Texture slots that the features read, a bit each.
pub fn texture_slots(features: Features) -> u8 {
    let order = [
        Features::BASE_COLOR_TEXTURE,
        Features::METALLIC_ROUGHNESS_TEXTURE,
        Features::NORMAL_TEXTURE,
        Features::OCCLUSION_TEXTURE,
        Features::EMISSIVE_TEXTURE,
        Features::SPECULAR_TEXTURE,
        Features::SPECULAR_COLOR_TEXTURE,
    ];
    order.iter().enumerate().map(|(i, f)| (features.has(*f) as u8) << i).sum()
}

fn variant(plan: &Plan, key: PipelineKey, first: u32, count: u32, joints_uniform: bool) -> SceneVariant {
    let end = (first as usize + count as usize).min(plan.instances.len());
    let drawn = plan.instances.get(first as usize..end).unwrap_or(&[]);
    SceneVariant {
        key,
        tint: drawn.iter().any(|i| i.tint != Vec4::ONE),
        joints_uniform: joints_uniform && key.features.has(Features::SKIN),
    }
}

impl Recording {
    /// Which of the frame's buffers any pipeline reads.
    pub fn reads(&self) -> Reads {
        let mut reads = Reads::default();
        for command in &self.commands {
            if let Command::BindPipeline(v) = command {
                reads.lights |= v.key.features.is_lit();
                reads.joints |= v.key.features.has(Features::SKIN);
                reads.morphs |= v.key.features.has(Features::MORPH);
                reads.joints_uniform |= v.joints_uniform;
            }
        }
        reads
    }

    pub fn counts(&self) -> Counts {
        let mut counts = Counts::default();
        let mut variants = std::collections::BTreeSet::new();
        for command in &self.commands {
            match command {
                Command::BeginPass { .. } => counts.passes += 1,
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

impl fmt::Display for Recording {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}×{}", self.size[0], self.size[1])?;
        for command in &self.commands {
            match command {
                Command::UploadFrameData { instances, joints, morphs, lights } => writeln!(
                    f,
                    "upload {instances} instances, {joints} joints, {morphs} morphs, {lights} lights"
                )?,
                Command::BeginPass { target, samples, clear, depth } => writeln!(
                    f,
                    "begin {target:?}, {samples} samples, clear {clear}{}",
                    if *depth { ", depth" } else { "" }
                )?,
                Command::BindPipeline(v) => {
                    writeln!(f, "  pipeline {:?} {}", v.key.topology, crate::shader::switches(v).join(" "))?
                }
                Command::BindMaterial { material, .. } => writeln!(f, "  material {material}")?,
                Command::BindMesh { primitive, morphs, .. } => {
                    writeln!(f, "  mesh {primitive}{}", if *morphs { ", morphs" } else { "" })?
                }
                Command::Draw { first_instance, instance_count } => {
                    writeln!(f, "  draw {instance_count} from {first_instance}")?
                }
                Command::DrawBackground => writeln!(f, "  background")?,
                Command::EndPass => writeln!(f, "end")?,
                Command::PostPass { effect, from, to, .. } => writeln!(f, "post {effect} {from:?} → {to:?}")?,
                Command::ReadBack => writeln!(f, "read back")?,
            }
        }
        Ok(())
    }
}
