//! Pre-skinning: meshes that several passes draw are skinned and morphed once, by a compute pass, whose vertices all passes read.
//! Runs on a finished recording, in which the draws of all passes can be counted.
//!
//! Meshes that are drawn once are skinned by the vertex shader, which needs no compute pipeline and no buffer. So are meshes whose
//! shader needs more than deformed vertices (displacement effects, refraction, triplanar textures, joint colors, thick lines).

use crate::commands::{Command, MAX_UNIFORM_JOINTS, Recorder, Recording};
use crate::plan::shader_features::names;
use crate::plan::{Features, LeftOut, PipelineKey, Plan};
use crate::scene_resources::SceneResources;
use crate::scene_resources::vertex_layout::VertexLayout;
use crate::shader::{InputTargets, SceneVariant};
use choreo_stage::PreSkinning;
use std::collections::{BTreeMap, BTreeSet};

/// Mean number of draws of a mesh from which pre-skinning is faster. Measured on lavapipe (`cargo xtask report passes`) with one
/// character and with 25: 1 to 8 % slower with one or two draws, as fast with three and four, 0 to 6 % faster from five on. GPUs
/// are not measured. With fewer draws, the vertices of a crowd would take megabytes of memory without a known gain.
const MIN_MEAN_DRAWS: f64 = 5.0;
/// Largest number of deformations of one mesh: the work groups of one dimension that every device supports.
const MAX_DEFORMATIONS: usize = 65_535;

/// Key of a pre-skinning pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PreskinVariant {
    /// A subset of [`Features::SKINNING`].
    pub features: Features,
    pub normals: bool,
    pub tangents: bool,
    pub joints_uniform: bool,
}

impl PreskinVariant {
    /// Names of the shader switches that are on.
    pub fn switches(&self) -> Vec<&'static str> {
        let switches =
            [("NORMAL", self.normals), ("TANGENT", self.tangents), ("JOINTS_UNIFORM", self.joints_uniform)];
        names(self.features).chain(switches.into_iter().filter_map(|(name, on)| on.then_some(name))).collect()
    }

    /// Number of f32 values in a pre-skinned vertex.
    pub(crate) fn floats_per_vertex(&self) -> u64 {
        3 + if self.normals { 3 } else { 0 } + if self.tangents { 4 } else { 0 }
    }

    /// Layout of the vertices that the compute pass reads.
    fn layout(&self, order: u16) -> VertexLayout {
        let skin = if self.features.has(Features::SKIN) { 1 << 6 | 1 << 7 } else { 0 };
        let more = if self.features.has(Features::SKIN_8) { 1 << 8 | 1 << 9 } else { 0 };
        VertexLayout(1 | u16::from(self.normals) << 1 | u16::from(self.tangents) << 2 | skin | more | order)
    }
}

/// A mesh with one set of joint matrices and morph weights.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PreskinnedMesh {
    /// Indices into `Plan::instances` that draw the mesh, all with the same deformation.
    pub instances: Vec<u32>,
}

/// Primitive, order of vertices, and features that deform them.
type MeshKey = (u32, u16, Features);

/// Draws of one mesh, counted over all passes.
#[derive(Default)]
struct MeshDraws {
    normals: bool,
    tangents: bool,
    /// Number of draws of the whole mesh, of all its deformations together.
    draw_count: f64,
    deformations: BTreeMap<[u32; 15], PreskinnedMesh>,
}

/// Primitives that at least one draw reads with the watertight surfaces first. Draws that write depth give the same image in any
/// order of triangles, so all of them read this order and share the vertices.
type SortedPrimitives = BTreeSet<u32>;

fn sorted_primitives(commands: &[Command]) -> SortedPrimitives {
    let of = |command: &Command| match command {
        Command::BindMesh { primitive, layout, .. } if layout.0 & VertexLayout::WATERTIGHT_FIRST != 0 => {
            Some(*primitive)
        }
        _ => None,
    };
    commands.iter().filter_map(of).collect()
}

fn vertex_order(
    variant: &SceneVariant,
    primitive: u32,
    layout: VertexLayout,
    sorted: &SortedPrimitives,
) -> u16 {
    match variant.key.writes_depth() && sorted.contains(&primitive) {
        true => VertexLayout::WATERTIGHT_FIRST,
        false => layout.0 & VertexLayout::WATERTIGHT_FIRST,
    }
}

fn mesh_key(
    variant: &SceneVariant,
    primitive: u32,
    layout: VertexLayout,
    sorted: &SortedPrimitives,
) -> Option<MeshKey> {
    let features = variant.key.features;
    let excluded = [
        Features::THICK_LINES,
        Features::EFFECT_JOINTS,
        Features::VOLUME,
        Features::REFRACTION,
        Features::TRIPLANAR,
    ];
    let deforming = features.only(Features::SKINNING);
    // Motion vectors need the vertices of two frames.
    let has_motion = variant.inputs == InputTargets::Motion;
    let is_supported =
        variant.key.displaced == 0 && !has_motion && !excluded.iter().any(|f| features.has(*f));
    let order = vertex_order(variant, primitive, layout, sorted) | layout.0 & VertexLayout::WELDED;
    (deforming != Features::default() && is_supported).then_some((primitive, order, deforming))
}

/// Adds pre-skinning of the meshes that are drawn often enough, and makes their draws read the pre-skinned vertices.
pub(super) fn add_preskinning(recorder: Recorder, recording: Recording) -> Recording {
    let plan = recorder.plan;
    let min_draws = match plan.pre_skinning {
        _ if recorder.options.no_compute => return recording,
        PreSkinning::Never => return recording,
        PreSkinning::Always => 0.0,
        PreSkinning::Auto => MIN_MEAN_DRAWS,
    };
    let sorted = sorted_primitives(&recording.commands);
    let mut meshes = mesh_draws(recorder, &recording, &sorted);
    meshes.retain(|_, m| {
        m.deformations.len() <= MAX_DEFORMATIONS && m.draw_count >= min_draws * m.deformations.len() as f64
    });
    if meshes.is_empty() {
        return recording;
    }
    let joints_uniform = plan.joint_matrices.len() <= MAX_UNIFORM_JOINTS;
    let (mut preskinned, mut dispatches) = (Vec::new(), Vec::new());
    for ((primitive, order, features), draws) in &mut meshes {
        let (normals, tangents) = (draws.normals, draws.tangents);
        let joints_uniform = joints_uniform && features.has(Features::SKIN);
        let variant = PreskinVariant { features: *features, normals, tangents, joints_uniform };
        let layout = variant.layout(*order);
        let (first, count) = (preskinned.len() as u32, draws.deformations.len() as u32);
        preskinned.extend(std::mem::take(&mut draws.deformations).into_values());
        dispatches.push(Command::Preskin { variant, primitive: *primitive, layout, first, count });
    }
    dispatches.push(Command::EndPreskin);
    Recording {
        commands: with_preskinned_draws(recording.commands, dispatches, &sorted, |k| meshes.contains_key(&k)),
        preskinned,
        ..recording
    }
}

fn mesh_draws(
    recorder: Recorder,
    recording: &Recording,
    sorted: &SortedPrimitives,
) -> BTreeMap<MeshKey, MeshDraws> {
    let Recorder { plan, triangles, .. } = recorder;
    let mut meshes: BTreeMap<MeshKey, MeshDraws> = BTreeMap::new();
    let (mut variant, mut mesh) = (None, None);
    for command in &recording.commands {
        match command {
            Command::BindPipeline(v) => variant = Some(*v),
            Command::BindMesh { primitive, layout, .. } => mesh = Some((*primitive, *layout)),
            Command::Draw { first_instance, instance_count, indices } => {
                let (Some(v), Some((primitive, layout))) = (variant, mesh) else { continue };
                let Some(key) = mesh_key(&v, primitive, layout, sorted) else { continue };
                let draws = meshes.entry(key).or_default();
                draws.normals |= layout.has(1);
                draws.tangents |= layout.has(2);
                let share =
                    indices.map_or(1.0, |[_, n]| f64::from(n) / (3 * triangles(primitive)).max(1) as f64);
                draws.draw_count += share * f64::from(*instance_count);
                for i in *first_instance..first_instance + instance_count {
                    let Some(instance) = plan.instances.get(i as usize) else { continue };
                    let mesh = draws.deformations.entry(instance.deformation()).or_default();
                    if !mesh.instances.contains(&i) {
                        mesh.instances.push(i);
                    }
                }
            }
            _ => {}
        }
    }
    meshes
}

/// Inserts the dispatches after the upload, and makes the draws of pre-skinned meshes bind the pre-skinned vertices. Pipelines
/// and meshes are bound right before the draw that needs them, if they are not bound yet.
fn with_preskinned_draws(
    commands: Vec<Command>,
    dispatches: Vec<Command>,
    sorted: &SortedPrimitives,
    is_preskinned: impl Fn(MeshKey) -> bool,
) -> Vec<Command> {
    let mut out = Vec::with_capacity(commands.len() + dispatches.len());
    let (mut variant, mut mesh) = (None, None);
    let (mut bound_variant, mut bound_mesh) = (None, None);
    // The pipeline that the recording has bound, until a draw uses it.
    let mut unused_pipeline = None;
    let mut dispatches = Some(dispatches);
    for command in commands {
        match command {
            Command::BindPipeline(v) => (variant, unused_pipeline) = (Some(v), Some(v)),
            Command::BindMesh { primitive, layout, morphs } => mesh = Some((primitive, layout, morphs)),
            Command::Draw { .. } => {
                unused_pipeline = None;
                let bindings = variant.zip(mesh).map(|(v, m)| {
                    match mesh_key(&v, m.0, m.1, sorted).filter(|k| is_preskinned(*k)) {
                        Some(_) => preskinned_bindings(v, m.0, vertex_order(&v, m.0, m.1, sorted)),
                        None => (v, m),
                    }
                });
                if let Some((v, m)) = bindings {
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
            Command::SetCull(_) | Command::BindMaterial { .. } | Command::SetShadowView { .. } => {
                out.push(command)
            }
            Command::UploadFrameData { .. } => {
                out.push(command);
                out.extend(dispatches.take().into_iter().flatten());
            }
            // Another pass, or a draw without a mesh.
            _ => {
                out.extend(unused_pipeline.take().map(Command::BindPipeline));
                (bound_variant, bound_mesh) = (None, None);
                out.push(command);
            }
        }
    }
    out
}

fn preskinned_bindings(
    v: SceneVariant,
    primitive: u32,
    order: u16,
) -> (SceneVariant, (u32, VertexLayout, bool)) {
    let features = v.key.features.without(Features::SKINNING).with(Features::PRE_SKINNED);
    let key = PipelineKey { features, ..v.key };
    let layout = VertexLayout(VertexLayout::of(features).0 | order);
    (SceneVariant { key, joints_uniform: false, ..v }, (primitive, layout, false))
}

impl Recording {
    /// Numbers of pre-skinned meshes and of their vertices.
    pub fn preskinned_vertices(&self, resources: &SceneResources) -> (usize, u64) {
        self.dispatches(resources).fold((0, 0), |(meshes, all), (count, vertices, _)| {
            (meshes + count, all + count as u64 * vertices)
        })
    }

    /// Size of the buffer of the pre-skinned vertices in bytes.
    pub fn preskinned_bytes(&self, resources: &SceneResources) -> u64 {
        self.dispatches(resources)
            .map(|(count, vertices, numbers)| 4 * count as u64 * vertices * numbers)
            .sum()
    }

    /// (meshes, vertices of each, f32 of each vertex) of each dispatch.
    fn dispatches(&self, resources: &SceneResources) -> impl Iterator<Item = (usize, u64, u64)> {
        self.commands.iter().filter_map(|command| match command {
            Command::Preskin { variant, primitive, count, .. } => {
                let mesh = resources.primitives.get(*primitive as usize);
                let vertices = mesh.map_or(0, |m| m.primitive().positions.len());
                Some((*count as usize, vertices as u64, variant.floats_per_vertex()))
            }
            _ => None,
        })
    }

    /// The reason why no mesh is pre-skinned; `None` if one is, or if none is skinned or morphed.
    pub fn preskinning_left_out(&self, plan: &Plan) -> Option<LeftOut> {
        let deformed = |c: &Command| match c {
            Command::BindPipeline(v) => v.key.features.only(Features::SKINNING) != Features::default(),
            _ => false,
        };
        if !self.preskinned.is_empty() || !self.commands.iter().any(deformed) {
            return None;
        }
        let why = match plan.pre_skinning {
            PreSkinning::Never => "the stage's skin_once is false".to_string(),
            _ => {
                format!(
                    "no mesh is drawn often enough: pre-skinning needs {MIN_MEAN_DRAWS} draws per frame and instance (a limit not measured on GPUs)"
                )
            }
        };
        Some(LeftOut { part: "pre-skinning".into(), why })
    }
}
