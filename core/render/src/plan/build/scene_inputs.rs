//! Inputs of effects on images: which of them the frame draws and computes, and the draws of the pass.

use crate::affine::Affine3x4;
use crate::plan::build::Planner;
use crate::plan::build::effects::active_uses;
use crate::plan::build::items::{DrawItem, DrawMerger};
use crate::plan::build::mesh::{MeshContext, PrimitiveContext, copy_transform};
use crate::plan::build::skins::SkinMatrices;
use crate::plan::options::PlanOptions;
use crate::plan::scene_inputs::InputPass;
use crate::plan::{
    ActiveMorph, Draw, Features, Instance, LightType, PipelineKey, Plan, PlanLight, TopologyKey, View,
};
use choreo_asset::Asset;
use choreo_motion::Time;
use choreo_plugin::{EffectFrame, FrameWish, Hook, Passes, SceneInputs};
use choreo_stage::{ActorState, Snapshot, Stage};
use glam::{DAffine3, DMat4, Vec3, Vec4};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The scene inputs that the active effects on images read, and those that the passes of the frame need.
pub(crate) fn inputs_of(stage: &Stage, snapshot: &Snapshot, options: &PlanOptions) -> SceneInputs {
    let images =
        active_uses(stage, snapshot, options.effects).filter(|(effect, ..)| effect.hook() == Hook::Image);
    let wanted = match options.wish {
        FrameWish::Scene(Passes { depth, normal, motion, id, .. }) => {
            SceneInputs { surface: depth || normal, motion: motion || id, ..SceneInputs::default() }
        }
        _ => SceneInputs::default(),
    };
    images.fold(wanted, |all, (effect, ..)| all.union(effect.scene_inputs()))
}

/// Whether motion vectors are read. ID passes are drawn with them, but do not need the frame before.
pub(crate) fn reads_motion(stage: &Stage, snapshot: &Snapshot, options: &PlanOptions) -> bool {
    let wish = match options.wish {
        FrameWish::Scene(passes) => FrameWish::Scene(Passes { id: false, ..passes }),
        other => other,
    };
    inputs_of(stage, snapshot, &PlanOptions { wish, ..options.clone() }).motion
}

/// The frame before, for motion vectors.
pub(super) struct FrameBefore<'a> {
    snapshot: &'a Snapshot,
    view: View,
    /// Skins of the current actor in the frame before: index of the skin in the asset, and its first joint in the plan.
    skins: Vec<(u32, u32)>,
}

impl<'a> FrameBefore<'a> {
    pub(super) fn new(snapshot: &'a Snapshot, size: [u32; 2]) -> FrameBefore<'a> {
        FrameBefore { snapshot, view: View::new(&snapshot.camera, size), skins: Vec::new() }
    }
}

impl<'a> Planner<'a> {
    /// Forgets the skins of the actor before, when the next one begins.
    pub(super) fn forget_skins_before(&mut self) {
        self.before.iter_mut().for_each(|before| before.skins.clear());
    }

    /// A copy's instance one frame before, relative to the camera of that frame. An actor that was not in view then keeps its
    /// current state.
    pub(super) fn instance_before(
        &mut self,
        p: &PrimitiveContext,
        mesh: &MeshContext<'a>,
        number: usize,
    ) -> Option<Instance> {
        let before = self.before.as_mut()?;
        let then = before.snapshot.actors.get(mesh.actor).filter(|then| then.visible && !then.culled);
        let state: &ActorState = then.unwrap_or(mesh.state);
        let relative_from_model = DAffine3 {
            translation: state.world_from_model.translation - before.view.position,
            ..state.world_from_model
        };
        let then = MeshContext {
            state,
            relative_from_model,
            weights: state.morph_weights.get(mesh.index).unwrap_or(&mesh.instance.weights),
            morphs: None,
            ..*mesh
        };
        let (place, copy) = mesh.asset.drawn_copies(mesh.instance, state.copies).nth(number)?;
        let relative_from_mesh = copy_transform(p, &then, place, copy);
        let mut instance = Instance { relative_from_mesh, ..Instance::default() };
        if let (Some(_), Some(skin)) = (p.skin, mesh.instance.skin) {
            let known = before.skins.iter().find(|(known, _)| *known == skin).map(|(_, first)| *first);
            instance.first_joint = known.unwrap_or_else(|| {
                let matrices = SkinMatrices::new(relative_from_model, mesh.asset, skin, state);
                let first = self.joint_matrices.len() as u32;
                self.joint_matrices.extend(matrices.rows());
                before.skins.push((skin, first));
                first
            });
        } else if self.options.force_all {
            instance.first_joint = self.joint_matrices.len() as u32;
            self.joint_matrices.push(relative_from_mesh);
        }
        self.add_morphs_before(p, then.weights, &mut instance);
        Some(instance)
    }

    fn add_morphs_before(&mut self, p: &PrimitiveContext, weights: &[f32], instance: &mut Instance) {
        if p.morph_count == 0 {
            return;
        }
        instance.first_morph = self.morphs.len() as u32;
        let targets = p.primitive.info.morph_bounds.len();
        let active = weights.iter().take(targets).enumerate().filter(|(_, w)| **w != 0.0 && w.is_finite());
        self.morphs.extend(active.map(|(t, w)| ActiveMorph { target: t as u32, weight: *w }));
        instance.morph_count = self.morphs.len() as u32 - instance.first_morph;
    }

    /// The pass of the inputs, whose instances are appended to those of the frame; `None` if nothing reads depth, normals or
    /// motion.
    pub(super) fn input_pass(
        &self,
        inputs: SceneInputs,
        instances: &mut Vec<Instance>,
        instance_actors: &mut Vec<u32>,
    ) -> Option<InputPass> {
        if !inputs.is_drawn() {
            return None;
        }
        let drawn: Vec<&DrawItem> =
            self.items.iter().filter(|item| is_drawn_by_scene_input_pass(&item.pipeline)).collect();
        let wants_ids = matches!(self.options.wish, FrameWish::Scene(Passes { id: true, .. }));
        let materials = wants_ids.then(|| MaterialNames::of(self.stage));
        let first = instances.len();
        let mut merger = DrawMerger::new(self.options.no_instancing);
        for (i, item) in drawn.iter().enumerate() {
            let pipeline = self.input_key(item);
            let draw = Draw {
                pipeline,
                primitive: item.entry.primitive,
                material: item.entry.material,
                material_override: item.material_override,
                watertight: item.watertight,
                deferred: false,
                first_instance: (first + i) as u32,
                instance_count: 1,
            };
            merger.add(
                (pipeline, draw.primitive, draw.material, item.material_override, item.watertight),
                draw,
            );
            let before = if inputs.motion { first + drawn.len() + i } else { 0 };
            let material = materials.as_ref().map_or(0, |names| names.number(self.stage, item));
            let tint = Vec4::new((item.actor + 1) as f32, before as f32, material as f32, 1.0);
            instances.push(Instance { tint, ..item.instance });
            instance_actors.push(item.actor);
        }
        if inputs.motion {
            // The first frame has no motion.
            instances.extend(drawn.iter().map(|item| item.before.unwrap_or(item.instance)));
            instance_actors.extend(drawn.iter().map(|item| item.actor));
        }
        let view = self.before.as_ref().map_or(&self.view, |before| &before.view);
        Some(InputPass {
            draws: merger.draws,
            motion: inputs.motion,
            clip_before: view.clip_from_relative,
            camera_before: view.position.as_vec3(),
            inputs,
            effects: self.effects_with_inputs(),
            names: materials.map(|materials| {
                [self.stage.actors.iter().map(|actor| actor.name.clone()).collect(), materials.names]
            }),
        })
    }

    fn effects_with_inputs(&self) -> Vec<String> {
        let used = active_uses(self.stage, self.snapshot, self.options.effects);
        let reads = used.filter(|(e, ..)| e.hook() == Hook::Image && e.scene_inputs().is_drawn());
        reads.map(|(effect, ..)| effect.manifest().name.clone()).collect()
    }

    /// Pipeline key of an item in the pass of the inputs.
    fn input_key(&self, item: &DrawItem) -> PipelineKey {
        let key = item.pipeline;
        let shape = self.resources.primitives[item.entry.primitive as usize].primitive();
        let of_vertices = Features::EFFECT_NORMALS.with(Features::UV0);
        let features = key.features.of_depth().with(Features::EFFECT_NORMALS.when(!shape.normals.is_empty()));
        PipelineKey {
            features: match key.displaced {
                0 => features,
                _ => features.with(key.features.only(of_vertices)),
            },
            coverage: false,
            surface: 0,
            lighting: 0,
            ..key
        }
    }
}

/// The names of all materials of a stage, each once.
struct MaterialNames {
    names: Vec<String>,
    numbers: BTreeMap<String, u32>,
}

impl MaterialNames {
    fn of(stage: &Stage) -> MaterialNames {
        let mut all = MaterialNames { names: Vec::new(), numbers: BTreeMap::new() };
        all.add(UNNAMED_MATERIAL);
        let mut last: Option<&Arc<Asset>> = None;
        for asset in stage.actors.iter().map(|actor| &actor.asset) {
            // Consecutive actors of a crowd share one model.
            if !last.is_some_and(|last| Arc::ptr_eq(last, asset)) {
                asset.materials.iter().for_each(|material| all.add(&material.name));
            }
            last = Some(asset);
        }
        all
    }

    fn add(&mut self, name: &str) {
        if !name.is_empty() && !self.numbers.contains_key(name) {
            self.names.push(name.to_string());
            self.numbers.insert(name.to_string(), self.names.len() as u32);
        }
    }

    fn number(&self, stage: &Stage, item: &DrawItem) -> u32 {
        let materials = &stage.actors[item.actor as usize].asset.materials;
        let material = item.entry.of_asset.and_then(|index| materials.get(index as usize));
        let name = material.map_or("", |material| material.name.as_str());
        // Number 1 is the name of materials without one.
        self.numbers.get(name).copied().unwrap_or(1)
    }
}

/// The name of materials that have none, and of surfaces without a material.
const UNNAMED_MATERIAL: &str = "unnamed";

/// Whether the pass of the inputs draws a key: opaque and cut-out triangles, without outlines and wireframes.
fn is_drawn_by_scene_input_pass(key: &PipelineKey) -> bool {
    let lines = Features::OUTLINE.with(Features::WIREFRAME).with(Features::THICK_LINES);
    key.topology == TopologyKey::Triangles && !key.is_transparent() && !key.features.has_any(lines)
}

/// Time in seconds and number of the frame.
pub(super) fn frame_times(stage: &Stage, snapshot: &Snapshot) -> EffectFrame {
    let fps = stage.settings.fps;
    EffectFrame {
        time: snapshot.time.as_secs() as f32,
        frame: u32::try_from(fps.frames_in(snapshot.time + Time(1)) - 1).unwrap_or(0),
        delta: fps.time_of(1).as_secs() as f32,
        ..EffectFrame::default()
    }
}

/// Numbers of the frame that the effects on images read.
pub(super) fn effect_frame(
    stage: &Stage,
    snapshot: &Snapshot,
    inputs: SceneInputs,
    view: &View,
    lights: &[PlanLight],
) -> EffectFrame {
    let mut frame = if inputs.time { frame_times(stage, snapshot) } else { EffectFrame::default() };
    if inputs.camera {
        let from_world = DMat4::from_translation(-view.position);
        frame.view_from_world = (view.view_from_relative.as_dmat4() * from_world).as_mat4();
        frame.clip_from_view = view.clip_from_view;
    }
    if inputs.sun {
        let suns = lights.iter().filter(|light| light.kind == LightType::Directional);
        let strength = |light: &&PlanLight| light.color.dot(Vec3::new(0.2126, 0.7152, 0.0722));
        let brightest = suns.max_by(|a, b| strength(a).total_cmp(&strength(b)));
        frame.sun = brightest.map(|sun| -sun.direction);
    }
    frame
}

impl Plan {
    /// The plan that draws only the inputs of its effects, to be read back.
    pub(crate) fn of_inputs(&self) -> Option<Plan> {
        let pass = self.scene_inputs.clone()?;
        Some(Plan {
            scene_inputs: Some(pass),
            inputs_only: true,
            linear: true,
            samples: 1,
            draws: Vec::new(),
            post: Vec::new(),
            subframes: Vec::new(),
            history: Vec::new(),
            dissolve: None,
            layers_behind: None,
            layers_in_front: None,
            shadow_maps: None,
            scene_color_copy: None,
            depth_peeling: None,
            deferred: None,
            light_clusters: None,
            sky: None,
            overlay: Default::default(),
            ..self.clone()
        })
    }
}

/// Rows of a skin as the plan stores them.
impl SkinMatrices {
    fn rows(&self) -> Vec<Affine3x4> {
        match self.dual_quaternions.is_empty() {
            true => self.matrices.clone(),
            false => self.dual_quaternions.iter().flat_map(super::skins::dual_quaternion_rows).collect(),
        }
    }
}
