//! Bodies that several passes draw are posed once: a compute stage does what the vertex stage would do again in every pass (skin,
//! morphs, normals, tangents), and all passes read its vertices. Found from a recording, so that whatever a pass is for counts.
//!
//! What is drawn once stays with the vertex stage: no pipeline, no buffer. So does what needs more of a pose than its vertices
//! (effects that move corners, refraction, triplanar textures, joint colours, wide lines).

use crate::commands::{Command, RecordOptions, Recording, UNIFORM_JOINTS};
use crate::plan::{Features, LeftOut, Plan};
use crate::scene_resources::Catalog;
use crate::scene_resources::vertex_layout::VertexLayout;
use crate::shader::SceneVariant;
use crate::shader::features::names;
use choreo_stage::SkinOnce;
use std::collections::{BTreeMap, BTreeSet};

/// Mean draws of a body from which posing it once pays: measured on lavapipe (`cargo xtask report passes`), 1 to 8 % slower with one or
/// two, as fast with three and four, 0 to 6 % faster from five on, alone and 25 times. GPUs are not measured; with fewer draws a
/// crowd would pay megabytes for its vertices and nothing that is known.
pub const PAYS: f64 = 5.0;
/// Bodies of one mesh: work groups of one dimension that every device has.
const MOST_BODIES: usize = 65_535;

/// What a compute pipeline is made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PoseVariant {
    /// Of [`Features::SKINNING`].
    pub features: Features,
    pub normals: bool,
    pub tangents: bool,
    pub joints_uniform: bool,
}

impl PoseVariant {
    /// Names of the switches that are on, as the modules write them.
    pub fn switches(&self) -> Vec<&'static str> {
        let others =
            [("NORMAL", self.normals), ("TANGENT", self.tangents), ("JOINTS_UNIFORM", self.joints_uniform)];
        names(self.features).chain(others.into_iter().filter_map(|(name, on)| on.then_some(name))).collect()
    }

    /// Numbers (f32) of one vertex.
    pub fn numbers(&self) -> u64 {
        3 + if self.normals { 3 } else { 0 } + if self.tangents { 4 } else { 0 }
    }

    /// Of the vertices that are read.
    fn layout(&self, order: u16) -> VertexLayout {
        let skin = if self.features.has(Features::SKIN) { 1 << 6 | 1 << 7 } else { 0 };
        let more = if self.features.has(Features::SKIN_8) { 1 << 8 | 1 << 9 } else { 0 };
        VertexLayout(1 | u16::from(self.normals) << 1 | u16::from(self.tangents) << 2 | skin | more | order)
    }
}

/// A body in its pose, and who draws it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PosedBody {
    /// Indices into `Plan::instances`; all have the pose of the first.
    pub instances: Vec<u32>,
}

/// A mesh, the order of its vertices and how they are posed.
type Kind = (u32, u16, Features);

#[derive(Default)]
struct Of {
    normals: bool,
    tangents: bool,
    /// Draws of the whole mesh, of all bodies together.
    drawn: f64,
    bodies: BTreeMap<[u32; 15], PosedBody>,
}

/// Meshes that some draw takes with their closed surfaces first: what writes depth looks alike in any order, so that one body serves both.
type Sorted = BTreeSet<u32>;

fn sorted(commands: &[Command]) -> Sorted {
    let of = |command: &Command| match command {
        Command::BindMesh { primitive, layout, .. } if layout.0 & VertexLayout::CLOSED != 0 => {
            Some(*primitive)
        }
        _ => None,
    };
    commands.iter().filter_map(of).collect()
}

fn order(variant: &SceneVariant, primitive: u32, layout: VertexLayout, sorted: &Sorted) -> u16 {
    match variant.key.writes_depth() && sorted.contains(&primitive) {
        true => VertexLayout::CLOSED,
        false => layout.0 & VertexLayout::CLOSED,
    }
}

fn kind(variant: &SceneVariant, primitive: u32, layout: VertexLayout, sorted: &Sorted) -> Option<Kind> {
    let features = variant.key.features;
    let more = [
        Features::THICK_LINES,
        Features::EFFECT_JOINTS,
        Features::VOLUME,
        Features::REFRACTION,
        Features::TRIPLANAR,
    ];
    let pose = features.only(Features::SKINNING);
    let plain = variant.key.displaced == 0 && !more.iter().any(|f| features.has(*f));
    let order = order(variant, primitive, layout, sorted) | layout.0 & VertexLayout::WELDED;
    (pose != Features::default() && plain).then_some((primitive, order, pose))
}

/// Poses that pay come first, and their draws read them. `triangles`: of one copy of a catalogue's primitive.
pub fn pose_once(
    plan: &Plan,
    recording: Recording,
    options: RecordOptions,
    triangles: &dyn Fn(u32) -> usize,
) -> Recording {
    let least = match plan.skin_once {
        _ if options.no_compute => return recording,
        SkinOnce::Never => return recording,
        SkinOnce::Always => 0.0,
        SkinOnce::Auto => PAYS,
    };
    let sorted = sorted(&recording.commands);
    let mut kinds = kinds(plan, &recording, triangles, &sorted);
    kinds.retain(|_, of| of.bodies.len() <= MOST_BODIES && of.drawn >= least * of.bodies.len() as f64);
    if kinds.is_empty() {
        return recording;
    }
    let joints_uniform = plan.joint_matrices.len() <= UNIFORM_JOINTS;
    let mut posed = Vec::new();
    let mut poses = Vec::new();
    for ((primitive, order, features), of) in &mut kinds {
        let (normals, tangents) = (of.normals, of.tangents);
        let joints_uniform = joints_uniform && features.has(Features::SKIN);
        let variant = PoseVariant { features: *features, normals, tangents, joints_uniform };
        let layout = variant.layout(*order);
        let (first, count) = (posed.len() as u32, of.bodies.len() as u32);
        posed.extend(std::mem::take(&mut of.bodies).into_values());
        poses.push(Command::Pose { variant, primitive: *primitive, layout, first, count });
    }
    poses.push(Command::EndPoses);
    Recording {
        commands: rewritten(recording.commands, poses, &sorted, |k| kinds.contains_key(&k)),
        posed,
        ..recording
    }
}

fn kinds(
    plan: &Plan,
    recording: &Recording,
    triangles: &dyn Fn(u32) -> usize,
    sorted: &Sorted,
) -> BTreeMap<Kind, Of> {
    let mut kinds: BTreeMap<Kind, Of> = BTreeMap::new();
    let (mut variant, mut mesh) = (None, None);
    for command in &recording.commands {
        match command {
            Command::BindPipeline(v) => variant = Some(*v),
            Command::BindMesh { primitive, layout, .. } => mesh = Some((*primitive, *layout)),
            Command::Draw { first_instance, instance_count, indices } => {
                let (Some(v), Some((primitive, layout))) = (variant, mesh) else { continue };
                let Some(kind) = kind(&v, primitive, layout, sorted) else { continue };
                let of = kinds.entry(kind).or_default();
                of.normals |= layout.has(1);
                of.tangents |= layout.has(2);
                let share =
                    indices.map_or(1.0, |[_, n]| f64::from(n) / (3 * triangles(primitive)).max(1) as f64);
                of.drawn += share * f64::from(*instance_count);
                for i in *first_instance..first_instance + instance_count {
                    let Some(instance) = plan.instances.get(i as usize) else { continue };
                    let drawn_by = &mut of.bodies.entry(instance.pose()).or_default().instances;
                    if !drawn_by.contains(&i) {
                        drawn_by.push(i);
                    }
                }
            }
            _ => {}
        }
    }
    kinds
}

/// Pipelines and meshes are bound right before the draw that needs them, where they are not bound yet.
fn rewritten(
    commands: Vec<Command>,
    poses: Vec<Command>,
    sorted: &Sorted,
    is_posed: impl Fn(Kind) -> bool,
) -> Vec<Command> {
    let mut out = Vec::with_capacity(commands.len() + poses.len());
    let (mut variant, mut mesh) = (None, None);
    let (mut bound_variant, mut bound_mesh) = (None, None);
    // Bound, and not yet used.
    let mut waits = None;
    let mut poses = Some(poses);
    for command in commands {
        match command {
            Command::BindPipeline(v) => (variant, waits) = (Some(v), Some(v)),
            Command::BindMesh { primitive, layout, morphs } => mesh = Some((primitive, layout, morphs)),
            Command::Draw { .. } => {
                waits = None;
                let now = variant.zip(mesh).map(|(v, m)| {
                    match kind(&v, m.0, m.1, sorted).filter(|k| is_posed(*k)) {
                        Some(_) => drawn_posed(v, m.0, order(&v, m.0, m.1, sorted)),
                        None => (v, m),
                    }
                });
                if let Some((v, m)) = now {
                    if bound_variant != Some(v) {
                        out.push(Command::BindPipeline(v));
                        bound_variant = Some(v);
                    }
                    if bound_mesh != Some(m) {
                        out.push(Command::BindMesh { primitive: m.0, layout: m.1, morphs: m.2 });
                        bound_mesh = Some(m);
                    }
                }
                out.push(command);
            }
            Command::SetCull(_) | Command::BindMaterial { .. } | Command::ShadowView { .. } => {
                out.push(command)
            }
            Command::UploadFrameData { .. } => {
                out.push(command);
                out.extend(poses.take().into_iter().flatten());
            }
            // Another pass, or a draw without a mesh.
            _ => {
                out.extend(waits.take().map(Command::BindPipeline));
                (bound_variant, bound_mesh) = (None, None);
                out.push(command);
            }
        }
    }
    out
}

fn drawn_posed(v: SceneVariant, primitive: u32, order: u16) -> (SceneVariant, (u32, VertexLayout, bool)) {
    let features = v.key.features.without(Features::SKINNING).with(Features::PRE_SKINNED);
    let key = crate::plan::PipelineKey { features, ..v.key };
    let layout = VertexLayout(VertexLayout::of(features).0 | order);
    (SceneVariant { key, joints_uniform: false, ..v }, (primitive, layout, false))
}

impl Recording {
    /// Bodies posed by the compute stage and their vertices.
    pub fn posed_vertices(&self, catalog: &Catalog) -> (usize, u64) {
        self.poses(catalog).fold((0, 0), |(bodies, all), (count, vertices, _)| {
            (bodies + count, all + count as u64 * vertices)
        })
    }

    /// Of the buffer that holds them.
    pub fn posed_bytes(&self, catalog: &Catalog) -> u64 {
        self.poses(catalog).map(|(count, vertices, numbers)| 4 * count as u64 * vertices * numbers).sum()
    }

    /// Bodies, vertices of each and numbers of each vertex.
    fn poses(&self, catalog: &Catalog) -> impl Iterator<Item = (usize, u64, u64)> {
        self.commands.iter().filter_map(|command| match command {
            Command::Pose { variant, primitive, count, .. } => {
                let mesh = catalog.primitives.get(*primitive as usize);
                let vertices = mesh.map_or(0, |m| m.primitive().positions.len());
                Some((*count as usize, vertices as u64, variant.numbers()))
            }
            _ => None,
        })
    }

    /// Why nothing is posed once, where something is posed.
    pub fn left_out(&self, plan: &Plan) -> Option<LeftOut> {
        let posed = |c: &Command| match c {
            Command::BindPipeline(v) => v.key.features.has_any(Features::SKINNING),
            _ => false,
        };
        if !self.posed.is_empty() || !self.commands.iter().any(posed) {
            return None;
        }
        let why = match plan.skin_once {
            SkinOnce::Never => "the stage's skin_once is false".to_string(),
            _ => {
                format!("no mesh is drawn often enough: {PAYS} times a frame and body (on GPUs not measured)")
            }
        };
        Some(LeftOut { what: "skinning once for all passes".into(), why })
    }
}
