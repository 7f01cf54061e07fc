//! What one frame needs, as plain data: cameras, lights, instances, skin matrices, sorted draws — and what was left out, and why.
//!
//! All positions are camera-relative: world axes, origin at the camera. They are computed in f64 and handed over as f32.

pub mod build;
pub(crate) mod draw;
pub(crate) mod features;
pub(crate) mod features_layers;
pub(crate) mod left_out;
pub mod motion_blur;
pub(crate) mod options;
pub(crate) mod post;
pub mod tiles;
pub mod view;

use crate::layers_2d::FlatPicture;
use crate::plan::build::dirty_rect::Area;
use crate::plan::build::light_clusters::LightLists;
use crate::scene_resources::CatalogMaterial;
use choreo_asset::{AlphaMode, Shading, Topology};
use choreo_stage::{Background, SkinOnce};
use glam::{DVec3, Mat4, Vec3, Vec4};
use std::sync::Arc;

pub use crate::plan::build::deferred::{Deferred, DeferredCause};
pub use crate::plan::build::transparency::{Peel, PeelCause};
pub use crate::plan::draw::Draw;
pub use crate::plan::left_out::{LEFT_OUT, LeftOut};
pub use crate::plan::post::PostPass;

#[derive(Clone, Debug)]
pub struct Plan {
    /// Pixels.
    pub size: [u32; 2],
    /// 1 or 4.
    pub samples: u32,
    pub view: View,
    pub background: Background,
    /// Hemisphere light along ±Y; both zero where no lit draw is in.
    pub ambient_up: Vec3,
    pub ambient_down: Vec3,
    /// Empty where no lit draw is in.
    pub lights: Vec<PlanLight>,
    /// Which of them reach where; `None` where too few have a range. See [`crate::plan::build::light_clusters`].
    pub light_lists: Option<LightLists>,
    /// `None` where the stage has none, or nothing shows its light.
    pub sky: Option<PlanSky>,
    /// Layers behind the scene, over its background, and those over the finished frame.
    pub under: Option<Arc<FlatPicture>>,
    pub over: Option<Arc<FlatPicture>>,
    pub instances: Vec<Instance>,
    /// Of each instance: index into `Stage::actors`.
    pub instance_actors: Vec<u32>,
    /// Linear skins, one a joint in use: relative-from-mesh, `world translation − camera`, rows of a 3×4 matrix; of bodies at
    /// places ([`Features::SKIN_PLACED`]) model-from-mesh.
    /// Dual-quaternion skins, two a joint, model-from-mesh: real part, dual part, nothing; then the stretch before them.
    pub joint_matrices: Vec<Rows>,
    /// (target, weight) pairs with weight ≠ 0, ranges given by the instances.
    pub morphs: Vec<ActiveMorph>,
    /// Opaque draws sorted for few state changes, then masked, then blended ones back to front.
    pub draws: Vec<Draw>,
    /// Materials that are not now as in the catalogue, with the textures that they have there.
    pub materials: Vec<Arc<CatalogMaterial>>,
    /// Maps that are drawn before all else; `None` where no light casts a shadow on what is seen.
    pub shadows: Option<Shadows>,
    /// A copy of the picture, made before the first glass that bends light is drawn, to be seen through it; `None` without such glass.
    pub behind: Option<Behind>,
    /// What is seen through is mixed pixel by pixel back to front; `None`: as `draws` are sorted.
    pub peel: Option<Peel>,
    /// Opaque surfaces are lit once a pixel, after all of them are drawn; `None`: as each is drawn.
    pub deferred: Option<Deferred>,
    /// Effects that are part of the scene's shaders; a bit each in [`PipelineKey::surface`], `displaced` and `lighting`.
    pub surface: Vec<PostPass>,
    /// Of each of them that moves surfaces: how far at most, metres.
    pub reaches: [f32; 8],
    /// Which of them change the background too; a bit each.
    pub background_effects: u8,
    /// Part of the picture that anything is drawn into.
    pub area: Area,
    /// Full-screen passes in order.
    pub post: Vec<PostPass>,
    /// Triangles, lines, points and lattices of effects, over the scene and below the passes.
    pub overlay: PlanOverlay,
    /// Where there are any, the frame is their mean in linear light, and this plan only says how the stage is at the frame's
    /// own time and what comes over the picture. See [`crate::plan::motion_blur`].
    pub exposed: Vec<Plan>,
    /// The scene a frame ago, two frames ago and so on, as effects with a history read it; then `exposed` is never empty.
    pub before: Vec<Plan>,
    /// The picture stays linear, to be added to others.
    pub linear: bool,
    /// Whether vertices are posed once for all passes; see [`crate::commands::preskin`].
    pub skin_once: SkinOnce,
    pub left_out: Vec<LeftOut>,
}

/// Triangles on the screen, in drawing order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlanOverlay {
    pub vertices: Vec<OverlayVertex>,
    pub parts: Vec<OverlayPart>,
}

/// What one effect draws.
#[derive(Clone, Debug, PartialEq)]
pub struct OverlayPart {
    /// Plugin name.
    pub effect: String,
    /// Not hidden by what is nearer.
    pub over: bool,
    /// Range of the vertices, three a triangle.
    pub first: u32,
    pub count: u32,
}

/// A corner; see shaders/overlay.wgsl. Laid out as the shader reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct OverlayVertex {
    pub clip: Vec4,
    /// Linear, straight alpha.
    pub color: Vec4,
    /// Stroke: pixels along and across, length, radius. Lattice: cells along both axes, way from the middle, 1 at the rim.
    pub shape: Vec4,
    /// 0: a stroke, 2: all of a triangle. Lattice: 1, each so manieth line is thick, pixels of thin lines and of thick ones.
    pub lattice: Vec4,
}

impl Plan {
    /// Every plan that is drawn for this one.
    pub fn parts(&self) -> impl Iterator<Item = &Plan> {
        self.exposed.iter().chain(&self.before)
    }

    /// Of all shadow maps.
    pub fn shadow_draws(&self) -> impl Iterator<Item = &Draw> {
        self.shadows.iter().flat_map(|s| &s.views).flat_map(|v| &v.draws)
    }
}

/// Three rows of an affine 3×4 matrix: `dot(row.xyz, p) + row.w`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Rows(pub [Vec4; 3]);

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Vulkan clip space: x right, y DOWN, depth 1 at the near plane and 0 at infinity or the far plane (reversed Z).
    pub clip_from_view: Mat4,
    /// Rotation only: the camera stands at the origin of relative space.
    pub view_from_relative: Mat4,
    pub clip_from_relative: Mat4,
    /// World position of the camera.
    pub position: DVec3,
    /// Orthographic views look along one direction: `w` 0 and xyz = direction to the viewer; perspective: `w` 1, xyz 0 (the eye).
    pub eye: Vec4,
}

/// One light, camera-relative. Laid out as the shader reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct PlanLight {
    /// xyz position (point, spot), w = 1/range² or 0; below 0: −1 − the square's share of a polynomial.
    pub position: Vec4,
    /// xyz unit direction in which it shines, w = kind: 0 directional, 1 point, 2 spot.
    pub direction: Vec4,
    /// xyz colour · intensity, linear; w = the first power's share of a polynomial, whose rest is constant.
    pub color: Vec4,
    /// Spot: x = angle scale, y = angle offset (KHR_lights_punctual, "Inner and Outer Cone Angles").
    /// z = its first view among `Shadows::views`, w = how many it has.
    pub cone: Vec4,
}

/// The sky; its maps are in the catalogue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanSky {
    /// Cosine and sine of its turn.
    pub turn: [f32; 2],
    pub strength: f32,
    /// Seen behind everything, in place of the background.
    pub background: bool,
}

/// Depths seen from the lights that cast shadows.
#[derive(Clone, Debug, PartialEq)]
pub struct Shadows {
    /// Texels of the image that all maps share: powers of two, so that it seldom changes.
    pub image: [u32; 2],
    /// The part of it that the maps lie in.
    pub size: [u32; 2],
    /// Of one light together; of a sun the finest first.
    pub views: Vec<ShadowView>,
}

/// The picture as glass that bends light sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Behind {
    /// The copy itself, and below it as many halves as the roughest glass in view blurs with.
    pub levels: u32,
}

/// One map: what it shows and who is drawn into it.
#[derive(Clone, Debug, PartialEq)]
pub struct ShadowView {
    /// Index into `Plan::lights`.
    pub light: u32,
    /// Its first texel in the image, and its texels.
    pub at: [u32; 2],
    pub size: [u32; 2],
    /// Depth as the camera's: greater is nearer to the light.
    pub clip_from_relative: Mat4,
    /// Metres of a texel where clip w is 1.
    pub texel: f32,
    pub draws: Vec<Draw>,
}

impl Instance {
    /// All that its vertices' places depend on, bit by bit.
    pub(crate) fn pose(&self) -> [u32; 15] {
        let rows = self.relative_from_mesh.0.map(|r| r.to_array().map(f32::to_bits));
        let numbers = [self.first_joint, self.first_morph, self.morph_count];
        std::array::from_fn(|i| if i < 12 { rows[i / 4][i % 4] } else { numbers[i - 12] })
    }
}

/// What one drawn copy of a primitive needs. Laid out as the shader reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Instance {
    /// relative-from-mesh; relative-from-model of dual-quaternion skins and of bodies at places; unused by other skins.
    pub relative_from_mesh: Rows,
    pub tint: Vec4,
    /// First entry in `joint_matrices`.
    pub first_joint: u32,
    pub first_morph: u32,
    pub morph_count: u32,
    /// Of lines and points: pixels; below 0: metres. See [`crate::scene_resources::thick_lines`].
    pub width: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct ActiveMorph {
    pub target: u32,
    pub weight: f32,
}

/// What selects a pipeline. As few different ones as the scene needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PipelineKey {
    pub features: Features,
    pub topology: TopologyKey,
    /// Both faces are drawn (double-sided material).
    pub double_sided: bool,
    /// The transform mirrors: front faces are clockwise.
    pub mirrored: bool,
    /// Mixed with what is behind by its alpha.
    pub blend: bool,
    /// Its cut-outs keep samples instead of whole pixels (alpha to coverage).
    pub coverage: bool,
    /// Mixed in its place among [`Plan::peel`]'s layers.
    pub peeled: bool,
    pub glass: Glass,
    /// Which of `Plan::surface` change what is seen.
    pub surface: u8,
    /// Which of them move its corners.
    pub displaced: u8,
    /// Which of them say what light does on it.
    pub lighting: u8,
}

impl PipelineKey {
    /// Opaque triangles seen from the front, with these features and no effect.
    pub const fn of(features: Features) -> PipelineKey {
        PipelineKey {
            features,
            topology: TopologyKey::Triangles,
            double_sided: false,
            mirrored: false,
            blend: false,
            coverage: false,
            peeled: false,
            glass: Glass::No,
            surface: 0,
            displaced: 0,
            lighting: 0,
        }
    }

    /// Drawn back to front after everything opaque.
    pub fn is_see_through(&self) -> bool {
        self.blend || self.glass != Glass::No
    }

    /// Without what only light needs where none counts: MToon has its own.
    pub fn of_lit(self) -> PipelineKey {
        let lit = self.features.is_lit() && !self.features.has(Features::TOON);
        PipelineKey { lighting: if lit { self.lighting } else { 0 }, ..self }
    }

    /// All of `Plan::surface` that its shader calls.
    pub fn effects(&self) -> u8 {
        self.surface | self.displaced | self.lighting
    }

    /// What is mixed with what is behind it leaves the depth as it is.
    pub fn writes_depth(&self) -> bool {
        !self.blend && matches!(self.glass, Glass::No | Glass::Refract)
    }
}

/// Thin surfaces that let light through are drawn twice, `Filter` before `Light`; those that bend it once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Glass {
    #[default]
    No,
    /// What is behind is multiplied by the colour of what comes through.
    Filter,
    /// What the surface itself shows is added.
    Light,
    /// Shows itself and, through itself, [`Plan::behind`].
    Refract,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum TopologyKey {
    Triangles,
    Lines,
    Points,
}

impl From<Topology> for TopologyKey {
    fn from(t: Topology) -> Self {
        match t {
            Topology::Triangles => TopologyKey::Triangles,
            Topology::Lines => TopologyKey::Lines,
            Topology::Points => TopologyKey::Points,
        }
    }
}

/// Shader features: a bit set. One bit, one `@if` or override in the WGSL, one branch in the CPU twin.
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
    /// The body is posed once, in model space, and stands at places: the joints' matrices lead to the model, the copy's on from
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

/// Lit materials need normals and lights; the kind of a material's alpha decides order and discard.
pub fn is_lit(shading: Shading) -> bool {
    !matches!(shading, Shading::Unlit)
}

pub fn alpha_blends(mode: AlphaMode) -> bool {
    matches!(mode, AlphaMode::Blend)
}
