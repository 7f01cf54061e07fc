//! What one frame needs, as plain data: cameras, lights, instances, skin matrices, sorted draws — and what was left out, and why.
//!
//! All positions are camera-relative: world axes, origin at the camera. They are computed in f64 and handed over as f32.

pub mod build;
pub(crate) mod draw;
pub(crate) mod features;
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
use choreo_asset::{AlphaMode, Shading};
use choreo_stage::{Background, SkinOnce};
use glam::{DVec3, Mat4, Vec2, Vec3, Vec4};
use std::sync::Arc;

pub use crate::plan::build::deferred::{Deferred, DeferredCause};
pub use crate::plan::build::transparency::{Peel, PeelCause};
pub use crate::plan::draw::Draw;
pub use crate::plan::left_out::{LeftOut, left_out_names};
pub use crate::plan::post::PostPass;
pub use crate::shader::features::Features;
pub use crate::shader::key::{Glass, PipelineKey, TopologyKey};

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
    /// places ([`Features::SKIN_INSTANCED`]) model-from-mesh.
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

/// The type of a light; shaders/frame.wgsl has the same constants.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::NoUninit)]
pub enum LightType {
    Directional = 0,
    Point = 1,
    Spot = 2,
}

/// One light, camera-relative. Laid out as the shader reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::NoUninit)]
pub struct PlanLight {
    /// Position of point and spot lights.
    pub position: Vec3,
    pub kind: LightType,
    /// Unit direction in which it shines.
    pub direction: Vec3,
    /// Its first view among `Shadows::views`, and how many it has.
    pub shadow_views: [u16; 2],
    /// Color · intensity, linear.
    pub color: Vec3,
    /// 1/range²; 0: without end.
    pub inverse_range_squared: f32,
    /// Spot lights: scale and offset of the cosine (KHR_lights_punctual, "Inner and Outer Cone Angles").
    pub cone: Vec2,
    /// Falloff by a polynomial of the distance: the shares of its linear and its quadratic term, of which the rest is constant.
    /// [`PlanLight::INVERSE_SQUARE`]: physical falloff.
    pub polynomial: Vec2,
}

impl PlanLight {
    pub const INVERSE_SQUARE: Vec2 = Vec2::new(0.0, -1.0);

    pub fn is_local(&self) -> bool {
        self.kind != LightType::Directional
    }

    /// Whether it falls off by a polynomial.
    pub fn is_polynomial(&self) -> bool {
        self.polynomial.y >= 0.0
    }
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

/// Lit materials need normals and lights; the kind of a material's alpha decides order and discard.
pub fn is_lit(shading: Shading) -> bool {
    !matches!(shading, Shading::Unlit)
}

pub fn alpha_blends(mode: AlphaMode) -> bool {
    matches!(mode, AlphaMode::Blend)
}
