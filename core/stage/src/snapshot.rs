//! The stage at one time, as read by the renderer, `choreo pose` and tests.

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
    /// The active camera.
    pub camera: CameraState,
    /// The dissolve from the camera before it, while there is one.
    pub dissolve: Option<Dissolve>,
    /// Lights in world space; only lights that shine (intensity and color above 0).
    pub lights: Vec<LightState>,
    /// The sky (image-based lighting); `None` if the stage has none.
    pub sky: Option<SkyState>,
    /// Visible 2D layers, in painter's order.
    pub layers_2d: Vec<Layer2dState>,
    /// The color or gradient behind everything, where no sky is shown.
    pub background: Background,
    /// Hemisphere light from above, linear, candela per square metre.
    pub ambient_up: Vec3,
    /// Hemisphere light from below, linear, candela per square metre.
    pub ambient_down: Vec3,
    /// Active effects, in the order of `Stage::effects`.
    pub effects: Vec<EffectState>,
}

/// An actor at one time.
#[derive(Clone, Debug)]
pub struct ActorState {
    /// Whether the actor and all its parents are visible.
    pub visible: bool,
    /// World transform of the actor's model, metres.
    pub world_from_model: DAffine3,
    /// World transform of the space in which the actor is placed: its parent's space, or the world.
    pub world_from_parent: DAffine3,
    /// Model-space joint matrices, one per joint of the asset's skeleton. Empty, like the weights, if the actor is invisible or culled and
    /// nothing visible depends on its joints, unless [`Evaluator::posing_hidden`](crate::evaluate::Evaluator::posing_hidden) requests them.
    pub model_from_joint: Vec<Affine3A>,
    /// Morph weights, one list per mesh instance of the asset; empty lists for meshes without morph targets.
    pub morph_weights: Vec<Vec<f32>>,
    /// Multiplies every base color, linear RGBA.
    pub tint: Vec4,
    /// Line width that replaces the material's.
    pub line_width: Option<f32>,
    /// Number of copies of its meshes that exist, counted from the first; `None`: all.
    pub copies: Option<u32>,
    /// Base color factors of the asset's materials, linear RGBA, if its clips animate any. Empty: the factors of the materials apply.
    pub base_colors: Vec<Vec4>,
    /// Skinning method for vertices with several joints.
    pub skinning: Skinning,
    /// Materials of which clips, expressions or their own animation change more than the base color, in the asset's order.
    pub materials: Vec<ChangedMaterial>,
    /// Whether the actor and its shadow are outside the image that the snapshot is for, so that the actor is posed only if something else
    /// needs its pose; see [`Evaluator::for_images`](crate::evaluate::Evaluator::for_images).
    pub culled: bool,
}

impl ActorState {
    /// World transform of a joint, metres: the f32 joint matrix is multiplied with the actor's transform in f64. `None` if the actor is not
    /// posed or has no such joint.
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
    /// Index into `Stage::cameras`; `None`: the framing camera of a stage without cameras.
    pub camera: Option<usize>,
    /// World transform of the camera: rotation and position without scale; the camera looks along −Z.
    pub world_from_view: DAffine3,
    /// Projection of the camera.
    pub projection: Projection,
}

/// Dissolve from the camera before the last cut to `Snapshot::camera`.
#[derive(Clone, Debug, PartialEq)]
pub struct Dissolve {
    /// The camera before the cut.
    pub camera: CameraState,
    /// Active effects in its image.
    pub effects: Vec<EffectState>,
    /// Share of its image in the frame, above 0, at most 1.
    pub share: f32,
}

/// A light that shines at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightState {
    /// Type, color and intensity.
    pub light: Light,
    /// World position, metres; unused for directional lights.
    pub position: DVec3,
    /// Unit vector in world space, along which the light shines.
    pub direction: Vec3,
    /// Settings of the shadow; `None`: the light casts no shadows.
    pub shadow: Option<Shadow>,
    /// See `crate::stage::StageLight::attenuation`.
    pub attenuation: Option<[f32; 3]>,
}

/// A sky at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct SkyState {
    /// Radiance from all directions.
    pub panorama: Arc<Panorama>,
    /// Rotation about +Y, radians, counter-clockwise seen from above.
    pub turn: f64,
    /// Factor of the panorama's radiance.
    pub strength: f32,
    /// Whether the panorama is visible as the background.
    pub background: bool,
}

/// An active effect.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectState {
    /// Index into `Stage::effects`.
    pub effect: usize,
    /// Parameters that the script sets, at this time, sorted by name. A spline may have left a parameter's range.
    pub parameters: Vec<(String, f64)>,
}

/// A visible 2D layer.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer2dState {
    /// Index into `Stage::layers_2d`.
    pub layer_2d: usize,
    /// Position of its anchor, as fractions of the image from the top left.
    pub at: DVec2,
    /// Opacity, above 0, at most 1.
    pub opacity: f32,
    /// Factor of its size, about its anchor.
    pub scale: f64,
    /// Text that replaces the words of the content.
    pub words: Option<String>,
}

/// An animated material of an actor's asset at one time. Its images are those of the file; only their texture coordinates may differ.
#[derive(Clone, Debug, PartialEq)]
pub struct ChangedMaterial {
    /// Index into `Asset::materials`.
    pub material: u32,
    /// The material at the time.
    pub now: Material,
}

impl Snapshot {
    /// Hash of every bit of the snapshot: two evaluations of one stage at one time must agree, wherever they ran.
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
