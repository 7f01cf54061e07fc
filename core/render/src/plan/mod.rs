//! The plan of one frame as plain data: camera, lights, instances, skin matrices, sorted draws; and the parts that are left out,
//! with the reasons.
//!
//! All positions are camera-relative: world axes, with the origin at the camera. They are computed in f64 and stored as f32.
//! [`build`] makes a plan from a snapshot; the other modules hold the plan's types.

pub mod build;
pub(crate) mod deferred;
pub(crate) mod depth_peeling;
pub mod dirty_rect;
pub(crate) mod dissolve;
pub(crate) mod draw;
pub(crate) mod features;
pub mod frame_key;
pub(crate) mod instance;
pub(crate) mod left_out;
pub mod light_clusters;
pub(crate) mod lights;
pub(crate) mod map_key;
pub mod motion_blur;
pub(crate) mod options;
pub(crate) mod overlay;
pub(crate) mod passes;
pub(crate) mod pipeline_key;
pub(crate) mod post;
pub(crate) mod scene_color_copy;
pub(crate) mod scene_inputs;
pub mod shader_features;
pub(crate) mod shadow_maps;
pub(crate) mod shutter_motion;
pub mod tiles;
mod vertex_attributes;

use crate::affine::Affine3x4;
use crate::effect_faults::{EffectFaults, PlanFault};
use crate::layers_2d::LayerImage;
use crate::plan::dirty_rect::DirtyRect;
use crate::plan::light_clusters::LightClusters;
use crate::scene_resources::material::MaterialResource;
use choreo_asset::{AlphaMode, Shading};
use choreo_plugin::{EffectFrame, FrameWish};
use choreo_stage::{Background, PreSkinning};
use glam::Vec3;
use std::sync::Arc;

pub use crate::plan::deferred::{Deferred, DeferredCause};
pub use crate::plan::depth_peeling::{DepthPeeling, PeelCause};
pub use crate::plan::dissolve::PlanDissolve;
pub use crate::plan::draw::Draw;
pub use crate::plan::instance::{ActiveMorph, Instance};
pub use crate::plan::left_out::{LeftOut, left_out_names};
pub use crate::plan::lights::{LightType, PlanLight, PlanSky};
pub use crate::plan::overlay::{OverlayPart, OverlayVertex, PlanOverlay};
pub use crate::plan::pipeline_key::{Glass, PipelineKey, TopologyKey};
pub use crate::plan::post::PostPass;
pub use crate::plan::scene_color_copy::SceneColorCopy;
pub use crate::plan::scene_inputs::InputPass;
pub use crate::plan::shader_features::Features;
pub use crate::plan::shadow_maps::{ShadowMaps, ShadowView};
pub use crate::plan::shutter_motion::ShutterMotion;
pub use crate::view::View;

/// Rows of the uniform buffer before the parameters of surface effects: the largest displacement of each effect, four in a row.
pub const REACH_ROWS: u32 = 2;

#[derive(Clone, Debug)]
pub struct Plan {
    /// Pixels.
    pub size: [u32; 2],
    /// Samples per pixel: 1 or 4.
    pub samples: u32,
    /// The requested kind of pixels. Unless they are bytes, the frame is collected with
    /// [`collect_floats`](crate::Renderer::collect_floats).
    pub wish: FrameWish,
    pub view: View,
    pub background: Background,
    /// Hemisphere light from +Y and −Y; both zero if nothing lit is drawn.
    pub ambient_up: Vec3,
    pub ambient_down: Vec3,
    /// Factor on the light of surfaces and of the sky.
    pub exposure: f32,
    /// The features of [`Features::DISPLAY`] that the frame uses.
    pub display: Features,
    /// Empty if nothing lit is drawn.
    pub lights: Vec<PlanLight>,
    /// `None` if too few lights have a range.
    pub light_clusters: Option<LightClusters>,
    /// `None` if the stage has no sky, or nothing shows its light.
    pub sky: Option<PlanSky>,
    /// 2D layers over the background, behind the scene.
    pub layers_behind: Option<Arc<LayerImage>>,
    /// 2D layers over the finished frame.
    pub layers_in_front: Option<Arc<LayerImage>>,
    pub instances: Vec<Instance>,
    /// Index into `Stage::actors` for each instance.
    pub instance_actors: Vec<u32>,
    /// Linear skins: one matrix for each joint in use, relative-from-mesh; model-from-mesh if an actor's file places its model
    /// several times ([`Features::SKIN_INSTANCED`]). Dual-quaternion skins: two entries for each joint, model-from-mesh: real
    /// part, dual part and an unused row; then the stretch that is applied before them.
    pub joint_matrices: Vec<Affine3x4>,
    /// (target, weight) pairs with a weight other than 0; each instance has a range of them.
    pub morphs: Vec<ActiveMorph>,
    /// Opaque draws sorted for few state changes, then alpha-tested ones, then blended ones back to front.
    pub draws: Vec<Draw>,
    /// Per-frame overrides of scene materials, which keep their textures.
    pub material_overrides: Vec<Arc<MaterialResource>>,
    /// `None` if no light casts a visible shadow.
    pub shadow_maps: Option<ShadowMaps>,
    /// `None` if nothing drawn refracts.
    pub scene_color_copy: Option<SceneColorCopy>,
    /// `None` if transparent draws are blended in their sorted order.
    pub depth_peeling: Option<DepthPeeling>,
    /// `None` if all surfaces are shaded forward.
    pub deferred: Option<Deferred>,
    /// Effects in the scene's shaders, each a bit in [`PipelineKey::surface`], `displaced` and `lighting`.
    pub scene_effects: Vec<PostPass>,
    /// Largest displacement by each of the scene effects, in metres.
    pub displacement_limits: [f32; 8],
    /// Bits of the scene effects that also change the background.
    pub background_effects: u8,
    /// The part of the frame that is drawn into.
    pub dirty_rect: DirtyRect,
    /// Full-screen passes in order.
    pub post: Vec<PostPass>,
    /// Depth, normals and motion that effects on images read; `None` if none does.
    pub scene_inputs: Option<InputPass>,
    /// Whether only `scene_inputs` is drawn and read back.
    pub inputs_only: bool,
    /// Time, camera and sun, as far as effects on images read them.
    pub effect_frame: EffectFrame,
    /// Triangles, lines, points and grids of effects, over the scene and below the full-screen passes.
    pub overlay: PlanOverlay,
    /// Plans of the sub-frames while the shutter is open. If there are any, the frame is their mean in linear light, and this
    /// plan gives the stage at the frame's own time and the passes over the image. See [`motion_blur`].
    pub subframes: Vec<Plan>,
    /// The reason for the number of sub-frames; `None` without motion blur, or if all are drawn.
    pub shutter_motion: Option<ShutterMotion>,
    /// Plans of the scene one frame ago, two frames ago and so on, for effects that read them; `subframes` is then not empty.
    pub history: Vec<Plan>,
    /// The camera before a cut, while its image dissolves.
    pub dissolve: Option<Box<PlanDissolve>>,
    /// Whether the image stays linear, to be accumulated.
    pub linear: bool,
    /// Whether vertices are pre-skinned; see `crate::commands::preskin`.
    pub pre_skinning: PreSkinning,
    pub left_out: Vec<LeftOut>,
    /// Faults of effects whose results the plan holds: outlines, edges, the shutter, overlays.
    pub effect_faults: Vec<PlanFault>,
}

impl Plan {
    /// Row of the first four parameters of each effect in the scene's shaders, in their common uniform buffer.
    pub(crate) fn first_rows(&self) -> impl Iterator<Item = u32> {
        self.scene_effects.iter().scan(REACH_ROWS, |next, used| {
            let first = *next;
            *next += used.rows() as u32;
            Some(first)
        })
    }

    /// Number of rows of that buffer; 0 without effects.
    pub fn surface_rows(&self) -> usize {
        let last = self.scene_effects.last().map_or(0, PostPass::rows);
        self.first_rows().last().map_or(0, |first| first as usize + last)
    }

    /// Records the faults that were found when the frame and its parts were planned.
    pub(crate) fn record_faults(&self, faults: &EffectFaults) {
        for found in std::iter::once(self).chain(self.sub_plans()).flat_map(|part| &part.effect_faults) {
            faults.record_by_name(&found.effect, found.fault, found.place);
        }
    }

    /// The plan of the scene alone with a linear image: without sub-frames, effects on images and layers over it.
    pub(crate) fn scene_alone(&self) -> Plan {
        Plan {
            linear: true,
            post: Vec::new(),
            scene_inputs: None,
            layers_in_front: None,
            subframes: Vec::new(),
            history: Vec::new(),
            dissolve: None,
            ..self.clone()
        }
    }

    /// Every further plan that is drawn for this one.
    pub(crate) fn sub_plans(&self) -> impl Iterator<Item = &Plan> {
        let dissolve = self.dissolve.iter().map(|dissolve| &dissolve.plan);
        let of_dissolve = dissolve.flat_map(|p| std::iter::once(p).chain(&p.subframes).chain(&p.history));
        self.subframes.iter().chain(&self.history).chain(of_dissolve)
    }

    /// The draws of all shadow maps.
    pub fn shadow_draws(&self) -> impl Iterator<Item = &Draw> {
        self.shadow_maps.iter().flat_map(|s| &s.views).flat_map(|v| &v.draws)
    }

    /// All draws: those of the frame, of shadow maps and of the inputs of effects.
    pub(crate) fn all_draws(&self) -> impl Iterator<Item = &Draw> {
        let inputs = self.scene_inputs.iter().flat_map(|pass| &pass.draws);
        self.draws.iter().chain(self.shadow_draws()).chain(inputs)
    }
}

pub(crate) fn is_lit(shading: Shading) -> bool {
    !matches!(shading, Shading::Unlit)
}

pub(crate) fn alpha_blends(mode: AlphaMode) -> bool {
    matches!(mode, AlphaMode::Blend)
}
