//! The stage at one time: what the renderer, `choreo pose` and tests look at.

use crate::stage::Background;
use crate::stage::light::Shadow;
use choreo_asset::hash::{Hashed, hash_of};
use choreo_asset::{ContentHash, Light, Material, Panorama, Projection, hashed};
use choreo_motion::{Skinning, Time};
use glam::{Affine3A, DAffine3, DVec2, DVec3, Mat3, Vec3, Vec4};
use std::sync::Arc;

/// Everything of a stage at one time.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    /// Stage time.
    pub time: Time,
    /// Index-aligned with `Stage::actors`.
    pub actors: Vec<ActorState>,
    /// The camera that is on.
    pub camera: CameraState,
    /// The camera before it, while that dissolves.
    pub dissolve: Option<Dissolve>,
    /// World space, only those that shine (intensity > 0).
    pub lights: Vec<LightState>,
    /// Light from all around; `None` without a sky.
    pub sky: Option<SkyState>,
    /// The visible ones, in painter's order.
    pub layers_2d: Vec<Layer2dState>,
    /// The color or gradient behind everything, where no sky is shown.
    pub background: Background,
    /// Hemisphere light from above, linear, candela per square metre.
    pub ambient_up: Vec3,
    /// Hemisphere light from below, linear, candela per square metre.
    pub ambient_down: Vec3,
    /// Effects on at this time, in the order of `Stage::effects`.
    pub effects: Vec<EffectState>,
}

/// An actor at one time.
#[derive(Clone, Debug)]
pub struct ActorState {
    /// Whether it and all that it is attached to are visible.
    pub visible: bool,
    /// Transform of its model into the world, metres.
    pub world_from_model: DAffine3,
    /// The space that the actor is placed in: of its parent, or the world.
    pub world_from_parent: DAffine3,
    /// One per joint of the asset's skeleton. Empty, like the weights, where the actor is invisible and nothing seen hangs on
    /// its joints, unless [`Evaluator::posing_hidden`](crate::evaluate::Evaluator::posing_hidden) requests them.
    pub model_from_joint: Vec<Affine3A>,
    /// One list per mesh instance of the asset; empty lists where the mesh has no morph targets.
    pub morph_weights: Vec<Vec<f32>>,
    /// Multiplies every base color, linear RGBA.
    pub tint: Vec4,
    /// Line width that replaces the material's.
    pub line_width: Option<f32>,
    /// Number of the copies of its meshes that exist, the first ones; `None`: all.
    pub copies: Option<u32>,
    /// Linear RGBA factors of the asset's materials where its clips animate any; else empty: those of the materials.
    pub base_colors: Vec<Vec4>,
    /// How vertices follow several joints.
    pub skinning: Skinning,
    /// Materials of which clips, expressions or they themselves change more than that, in the asset's order.
    pub materials: Vec<ChangedMaterial>,
    /// Neither it nor its shadow is in the image that the snapshot is for, so that it is not posed for its own sake; see
    /// [`Evaluator::for_images`](crate::evaluate::Evaluator::for_images).
    pub culled: bool,
}

impl ActorState {
    /// World transform of a joint, metres: f32 joints placed in the f64 world, exact but for the product. `None` where the actor
    /// is not posed or has no such joint.
    pub fn world_from_joint(&self, joint: usize) -> Option<DAffine3> {
        let model_from_joint = self.model_from_joint.get(joint)?;
        let rotation = Mat3::from(model_from_joint.matrix3).as_dmat3();
        let placed =
            DAffine3::from_mat3_translation(rotation, Vec3::from(model_from_joint.translation).as_dvec3());
        Some(self.world_from_model * placed)
    }
}

impl Default for ActorState {
    fn default() -> Self {
        ActorState {
            visible: false,
            world_from_model: DAffine3::IDENTITY,
            world_from_parent: DAffine3::IDENTITY,
            model_from_joint: Vec::new(),
            morph_weights: Vec::new(),
            tint: Vec4::ONE,
            line_width: None,
            copies: None,
            base_colors: Vec::new(),
            skinning: Skinning::default(),
            materials: Vec::new(),
            culled: false,
        }
    }
}

/// A camera at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraState {
    /// Index into `Stage::cameras`; `None` = the framing camera of a stage without any.
    pub camera: Option<usize>,
    /// Rotation and position only, no scale: looks along −Z.
    pub world_from_view: DAffine3,
    /// How it projects.
    pub projection: Projection,
}

/// The image of the camera before the last cut, which goes over into that of `Snapshot::camera`.
#[derive(Clone, Debug, PartialEq)]
pub struct Dissolve {
    /// The camera before the cut.
    pub camera: CameraState,
    /// Effects on in its image.
    pub effects: Vec<EffectState>,
    /// The share of the frame, above 0, at most 1.
    pub share: f32,
}

/// A light that shines at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightState {
    /// Type, color and intensity.
    pub light: Light,
    /// World, metres; of no effect for directional lights.
    pub position: DVec3,
    /// Unit vector in the world, along which it shines.
    pub direction: Vec3,
    /// `None`: it casts no shadows.
    pub shadow: Option<Shadow>,
    /// See `crate::stage::StageLight::attenuation`.
    pub attenuation: Option<[f32; 3]>,
}

/// A sky at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct SkyState {
    /// Radiance from all directions.
    pub panorama: Arc<Panorama>,
    /// Radians about +Y, counter-clockwise from above.
    pub turn: f64,
    /// Times the panorama's radiance.
    pub strength: f32,
    /// Whether it is seen behind everything.
    pub background: bool,
}

/// An effect that is on at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectState {
    /// Index into `Stage::effects`.
    pub effect: usize,
    /// The parameters that the script gives, at this time, sorted by name. A spline may have left the parameter's range.
    pub parameters: Vec<(String, f64)>,
}

/// One that is seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer2dState {
    /// Index into `Stage::layers_2d`.
    pub layer_2d: usize,
    /// Position of its anchor, as fractions of the image from the top left.
    pub at: DVec2,
    /// Above 0, at most 1.
    pub opacity: f32,
    /// Times its size, about its anchor.
    pub scale: f64,
    /// Words that replace those of the content.
    pub words: Option<String>,
}

/// A material of an actor's asset as it is at one time. Its textures are the file's; where they are read may differ.
#[derive(Clone, Debug, PartialEq)]
pub struct ChangedMaterial {
    /// Index into `Asset::materials`.
    pub material: u32,
    /// The material at the time.
    pub now: Material,
}

impl Snapshot {
    /// Every bit of it: two evaluations of one stage at one time must agree, wherever they ran.
    pub fn content_hash(&self) -> ContentHash {
        hash_of(|w| self.hash(w))
    }
}

hashed! {
    struct Snapshot { time, actors, camera, dissolve, lights, layers_2d, sky, background, ambient_up, ambient_down, effects }
    struct ActorState {
        visible, world_from_model, model_from_joint, morph_weights, tint, line_width, copies, base_colors, skinning, materials;
        // `culled` depends on the image, not on the stage; `world_from_parent` is in `world_from_model`.
        without culled, world_from_parent
    }
    struct CameraState { camera, world_from_view, projection }
    struct Dissolve { camera, effects, share }
    struct LightState { light, position, direction, shadow, attenuation }
    struct Layer2dState { layer_2d, at, scale, opacity, words }
    struct SkyState { panorama, turn, strength, background }
    struct EffectState { effect, parameters }
    struct ChangedMaterial { material, now }
}
