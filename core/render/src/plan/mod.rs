//! What one frame needs, as plain data: cameras, lights, instances, skin matrices, sorted draws; and what was left out, and why.
//!
//! All positions are camera-relative: world axes, with the origin at the camera. They are computed in f64 and stored as f32.
//! [`build`] makes a plan of a snapshot; the other modules are the plan's types.

pub mod build;
pub(crate) mod deferred;
pub(crate) mod depth_peeling;
pub mod dirty_rect;
pub(crate) mod draw;
pub(crate) mod features;
pub(crate) mod features_layers;
pub(crate) mod instance;
pub(crate) mod left_out;
pub mod light_clusters;
pub(crate) mod lights;
pub mod motion_blur;
pub(crate) mod options;
pub(crate) mod overlay;
pub(crate) mod pipeline_key;
pub(crate) mod post;
pub(crate) mod scene_color_copy;
pub(crate) mod shadow_maps;
pub mod tiles;
mod vertex_attributes;
pub mod view;

use crate::affine::Affine3x4;
use crate::layers_2d::LayerImage;
use crate::plan::dirty_rect::DirtyRect;
use crate::plan::light_clusters::LightClusters;
use crate::scene_resources::material::MaterialResource;
use choreo_asset::{AlphaMode, Shading};
use choreo_stage::{Background, SkinOnce};
use glam::Vec3;
use std::sync::Arc;

pub use crate::plan::deferred::{Deferred, DeferredCause};
pub use crate::plan::depth_peeling::{DepthPeeling, PeelCause};
pub use crate::plan::draw::Draw;
pub use crate::plan::instance::{ActiveMorph, Instance};
pub use crate::plan::left_out::{LEFT_OUT, LeftOut};
pub use crate::plan::lights::{LightType, PlanLight, PlanSky};
pub use crate::plan::overlay::{OverlayPart, OverlayVertex, PlanOverlay};
pub use crate::plan::pipeline_key::{Glass, PipelineKey, TopologyKey};
pub use crate::plan::post::PostPass;
pub use crate::plan::scene_color_copy::SceneColorCopy;
pub use crate::plan::shadow_maps::{ShadowMaps, ShadowView};
pub use crate::plan::view::View;

#[derive(Clone, Debug)]
pub struct Plan {
    /// Pixels.
    pub size: [u32; 2],
    /// Samples per pixel: 1 or 4.
    pub samples: u32,
    pub view: View,
    pub background: Background,
    /// Hemisphere light from +Y and −Y; both zero if nothing lit is drawn.
    pub ambient_up: Vec3,
    pub ambient_down: Vec3,
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
    /// several times ([`Features::SKIN_PLACED`]).
    /// Dual-quaternion skins: two entries for each joint, model-from-mesh: real part, dual part, nothing; then the stretch that
    /// is applied before them.
    pub joint_matrices: Vec<Affine3x4>,
    /// (target, weight) pairs with a weight other than 0; instances give ranges of them.
    pub morphs: Vec<ActiveMorph>,
    /// Opaque draws sorted for few state changes, then alpha-tested ones, then blended ones back to front.
    pub draws: Vec<Draw>,
    /// Per-frame overrides of scene materials; their textures are the same.
    pub material_overrides: Vec<Arc<MaterialResource>>,
    /// `None` if no light casts a visible shadow.
    pub shadow_maps: Option<ShadowMaps>,
    /// `None` if nothing drawn refracts.
    pub scene_color_copy: Option<SceneColorCopy>,
    /// `None` if transparent draws are blended in their sorted order.
    pub depth_peeling: Option<DepthPeeling>,
    /// `None` if all surfaces are shaded as they are drawn.
    pub deferred: Option<Deferred>,
    /// Effects in the scene's shaders, each a bit in [`PipelineKey::surface`], `displaced` and `lighting`.
    pub scene_effects: Vec<PostPass>,
    /// Largest displacement of surfaces by each of these, in meters.
    pub displacement_limits: [f32; 8],
    /// Bits of those that change the background, too.
    pub background_effects: u8,
    /// Part of the frame that anything is drawn into.
    pub dirty_rect: DirtyRect,
    /// Full-screen passes in order.
    pub post: Vec<PostPass>,
    /// Triangles, lines, points and grids of effects, over the scene and below the full-screen passes.
    pub overlay: PlanOverlay,
    /// Plans of the times while the shutter is open. If there are any, the frame is their mean in linear light, and this plan
    /// gives the stage at the frame's own time and the passes over the image. See [`motion_blur`].
    pub subframes: Vec<Plan>,
    /// Plans of the scene one frame ago, two frames ago and so on, for effects that read them; `subframes` is then not empty.
    pub history: Vec<Plan>,
    /// The image stays linear, to be accumulated.
    pub linear: bool,
    /// Whether vertices are pre-skinned; see [`crate::commands::preskin`].
    pub skin_once: SkinOnce,
    pub left_out: Vec<LeftOut>,
}

impl Plan {
    /// Every plan that is drawn for this one.
    pub fn sub_plans(&self) -> impl Iterator<Item = &Plan> {
        self.subframes.iter().chain(&self.history)
    }

    /// Draws into all shadow maps.
    pub fn shadow_draws(&self) -> impl Iterator<Item = &Draw> {
        self.shadow_maps.iter().flat_map(|s| &s.views).flat_map(|v| &v.draws)
    }

    /// Draws into the frame, then into shadow maps.
    pub(crate) fn all_draws(&self) -> impl Iterator<Item = &Draw> {
        self.draws.iter().chain(self.shadow_draws())
    }
}

/// Shader features: a bit set. One bit, one `@if` or override in the WGSL, one branch in the CPU reference.
///
/// A bit may be set where primitive or material lacks the data (`PlanOptions::force_all`). The shader then reads:
/// uv 0, colour 1, tangent 0, joint indices 0 with weights (1,0,0,0 | 0,0,0,0), normal scale 0, cutoff 0,
/// identity uv transforms, and a white texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Features(pub u64);

impl Features {
    pub const SKIN: Features = Features(1 << 0);
    /// 8 influences instead of 4.
    pub const SKIN_8: Features = Features(1 << 1);
    pub const MORPH: Features = Features(1 << 2);
    pub const VERTEX_COLOR: Features = Features(1 << 3);
    pub const UV0: Features = Features(1 << 4);
    pub const UV1: Features = Features(1 << 5);
    /// Lit by metallic-roughness.
    pub const METALLIC_ROUGHNESS: Features = Features(1 << 6);
    /// Lit by Blinn–Phong. Neither this nor METALLIC_ROUGHNESS nor TOON: unlit.
    pub const BLINN_PHONG: Features = Features(1 << 7);
    pub const BASE_COLOR_TEXTURE: Features = Features(1 << 8);
    pub const METALLIC_ROUGHNESS_TEXTURE: Features = Features(1 << 9);
    pub const NORMAL_TEXTURE: Features = Features(1 << 10);
    pub const OCCLUSION_TEXTURE: Features = Features(1 << 11);
    pub const EMISSIVE: Features = Features(1 << 12);
    pub const EMISSIVE_TEXTURE: Features = Features(1 << 13);
    pub const SPECULAR_TEXTURE: Features = Features(1 << 14);
    pub const SPECULAR_COLOR_TEXTURE: Features = Features(1 << 15);
    pub const ALPHA_MASK: Features = Features(1 << 16);
    /// Some texture has a uv transform other than identity.
    pub const UV_TRANSFORM: Features = Features(1 << 17);
    /// Point or spot lights are in, beside directional ones.
    pub const LOCAL_LIGHTS: Features = Features(1 << 18);

    /// Lit by toon shading. Its textures stand in the slots of those it does not read: matcap in metallic-roughness, rim in
    /// occlusion, shading shift in specular, shade colour in specular colour.
    pub const TOON: Features = Features(1 << 19);

    /// Some light's shadow may fall on it.
    pub const SHADOW: Features = Features(1 << 20);
    /// A hull around the surface in place of it: pushed out along the normals, seen from inside, in the outline's colour.
    pub const SHELL: Features = Features(1 << 21);
    pub const OUTLINE_WIDTH_TEXTURE: Features = Features(1 << 22);
    /// A mask says how much of a motion of the textures each place makes.
    pub const UV_MASK: Features = Features(1 << 23);
    /// Normals and joint colours are for effects on the surface, whatever its light.
    pub const SEEN_NORMALS: Features = Features(1 << 24);
    pub const SEEN_JOINTS: Features = Features(1 << 25);
    /// The share of light that shadows take is for effects on the surface.
    pub const SEEN_SHADOW: Features = Features(1 << 27);
    /// The edges of triangles as lines, a little nearer than the surface, in the outline's colour.
    pub const EDGES: Features = Features(1 << 26);
    /// The skin's joints are dual quaternions. Another way rather than more of one: never forced in.
    pub const SKIN_DUAL: Features = Features(1 << 31);
    /// The character is posed once, in model space, for all its placements: the joints' matrices lead to the model, the copy's on from
    /// there, as a dual-quaternion skin's always do. Never forced in.
    pub const SKIN_PLACED: Features = Features(1 << 55);

    /// Clearcoat, sheen or transmission is on: the layers' uniform is read.
    pub const LAYERS: Features = Features(1 << 32);
    pub const CLEARCOAT: Features = Features(1 << 33);
    pub const CLEARCOAT_TEXTURE: Features = Features(1 << 34);
    pub const CLEARCOAT_ROUGHNESS_TEXTURE: Features = Features(1 << 35);
    pub const CLEARCOAT_NORMAL_TEXTURE: Features = Features(1 << 36);
    pub const SHEEN: Features = Features(1 << 37);
    pub const SHEEN_COLOR_TEXTURE: Features = Features(1 << 38);
    pub const SHEEN_ROUGHNESS_TEXTURE: Features = Features(1 << 39);
    pub const TRANSMISSION: Features = Features(1 << 40);
    pub const TRANSMISSION_TEXTURE: Features = Features(1 << 41);
    /// What is let through is absorbed on its way.
    pub const VOLUME: Features = Features(1 << 42);
    pub const THICKNESS_TEXTURE: Features = Features(1 << 43);

    /// A thin film colours what the surface reflects.
    pub const IRIDESCENCE: Features = Features(1 << 44);
    pub const IRIDESCENCE_TEXTURE: Features = Features(1 << 45);
    pub const IRIDESCENCE_THICKNESS_TEXTURE: Features = Features(1 << 46);
    /// Highlights are drawn out along the tangent. Never forced in: it needs tangents.
    pub const ANISOTROPY: Features = Features(1 << 47);
    pub const ANISOTROPY_TEXTURE: Features = Features(1 << 48);
    /// Light from behind comes out in front.
    pub const DIFFUSE_TRANSMISSION: Features = Features(1 << 49);
    pub const DIFFUSE_TRANSMISSION_TEXTURE: Features = Features(1 << 50);
    pub const DIFFUSE_TRANSMISSION_COLOR_TEXTURE: Features = Features(1 << 51);

    /// What is behind is seen where the bent ray leaves the volume.
    pub const REFRACTION: Features = Features(1 << 52);
    /// Each colour is bent by an index of its own.
    pub const DISPERSION: Features = Features(1 << 53);
    /// Textures are shifted by the heights in the normal texture's alpha. Never forced in: other files keep other things there.
    pub const RELIEF: Features = Features(1 << 54);
    /// A sky's maps light it. Another light rather than more of one: never forced in.
    pub const SKY: Features = Features(1 << 60);
    /// Blinn–Phong that mirrors its surroundings. Its textures stand in the slots of those it does not read: the reflection map in
    /// specular, the environment map in metallic-roughness.
    pub const REFLECTION: Features = Features(1 << 56);
    /// Highlights of Phong in place of Blinn's. Never forced in.
    pub const PHONG: Features = Features(1 << 61);
    /// Some light falls off by a polynomial of the distance. Never forced in.
    pub const POLYNOMIAL: Features = Features(1 << 62);

    /// Lines and points are thick. Another way of drawing rather than more of one: never forced in.
    pub const WIDE: Features = Features(1 << 28);
    /// Points are discs, thick lines have round ends.
    pub const ROUND: Features = Features(1 << 29);
    /// Triplanar mapping. Another way rather than more of one: never forced in.
    pub const TRIPLANAR: Features = Features(1 << 30);
    /// Reads pre-skinned vertices. Set in recordings only: a plan keeps how vertices are deformed.
    pub const POSED: Features = Features(1 << 63);
    /// Everything that deforms vertices.
    pub const POSE: Features =
        Features(Self::SKIN.0 | Self::SKIN_8.0 | Self::SKIN_DUAL.0 | Self::SKIN_PLACED.0 | Self::MORPH.0);

    /// What of a draw's features its depth depends on.
    pub const fn of_depth(self) -> Features {
        self.of_alpha(false)
    }
    /// The same, and where it is `blended` its alpha.
    pub const fn of_alpha(self, blended: bool) -> Features {
        let shape = Self::SKIN.0 | Self::SKIN_8.0 | Self::SKIN_DUAL.0 | Self::SKIN_PLACED.0 | Self::MORPH.0;
        let cut_out = Self::ALPHA_MASK.0
            | Self::BASE_COLOR_TEXTURE.0
            | Self::TRIPLANAR.0
            | Self::VERTEX_COLOR.0
            | Self::UV0.0
            | Self::UV1.0
            | Self::UV_MASK.0
            | Self::UV_TRANSFORM.0;
        Features(self.0 & if blended || self.has(Self::ALPHA_MASK) { shape | cut_out } else { shape })
    }
    /// Some normal map is read, or highlights follow the tangents.
    pub const fn has_tangents(self) -> bool {
        self.0 & (Self::NORMAL_TEXTURE.0 | Self::CLEARCOAT_NORMAL_TEXTURE.0 | Self::ANISOTROPY.0) != 0
    }
    pub const fn has_normals(self) -> bool {
        self.is_lit() || self.0 & (Self::SHELL.0 | Self::SEEN_NORMALS.0 | Self::TRIPLANAR.0) != 0
    }
    pub const fn is_lit(self) -> bool {
        self.0 & (Self::METALLIC_ROUGHNESS.0 | Self::BLINN_PHONG.0 | Self::TOON.0) != 0
    }
    pub const fn has(self, other: Features) -> bool {
        self.0 & other.0 == other.0
    }
    pub const fn with(self, other: Features) -> Features {
        Features(self.0 | other.0)
    }
    pub const fn only(self, other: Features) -> Features {
        Features(self.0 & other.0)
    }
    pub const fn without(self, other: Features) -> Features {
        Features(self.0 & !other.0)
    }
}

pub fn is_lit(shading: Shading) -> bool {
    !matches!(shading, Shading::Unlit)
}

pub fn alpha_blends(mode: AlphaMode) -> bool {
    matches!(mode, AlphaMode::Blend)
}
