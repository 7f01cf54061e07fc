//! The stage as a script leaves it: actors, cues over time, cameras.

pub(crate) mod actor;
pub(crate) mod camera;
pub(crate) mod camera_moves;
pub(crate) mod channel;
pub(crate) mod clips;
pub(crate) mod constraint;
pub(crate) mod described;
pub(crate) mod edits;
pub(crate) mod effects;
pub(crate) mod fade;
mod hash;
pub(crate) mod layers_2d;
pub(crate) mod light;
pub(crate) mod parenting;
pub(crate) mod path;
pub(crate) mod root_motion;
pub(crate) mod sky;
pub(crate) mod solvers;
pub(crate) mod springs;
pub(crate) mod surfaces;
pub(crate) mod tangents;
pub(crate) mod time_remapping;

use crate::stage::actor::Actor;
use crate::stage::camera::Camera;
use crate::stage::camera::Cut;
use crate::stage::edits::FrameEdits;
use crate::stage::effects::EffectUse;
use crate::stage::layers_2d::Layer2d;
use crate::stage::light::StageLight;
use crate::stage::sky::Sky;
use crate::stage::solvers::SolverSettings;
use choreo_motion::{FrameRate, Time};
use glam::{Vec3, Vec4};
use std::sync::Arc;

/// Everything that a script puts on stage: actors with their cues, cameras, lights, effects.
#[derive(Clone, Debug, Default)]
pub struct Stage {
    /// Size, length, background and the like.
    pub settings: Settings,
    /// Settings of the iterative solvers and of the spring simulation.
    pub solvers: SolverSettings,
    /// Assets on stage; the index is their id.
    pub actors: Vec<Actor>,
    /// Cameras of the script; the first is active until the first cut.
    pub cameras: Vec<Camera>,
    /// Camera changes, sorted by time. Before the first cut the first camera is active.
    pub cuts: Vec<Cut>,
    /// Lights of the script; those of files belong to actors.
    pub lights: Vec<StageLight>,
    /// Sky (image-based lighting). A stage with a sky has no default sun.
    pub sky: Option<Sky>,
    /// 2D layers in painter's order.
    pub layers_2d: Vec<Layer2d>,
    /// Effects in use, in the order in which they run.
    pub effects: Vec<EffectUse>,
    /// Named times. They change no image.
    pub markers: Vec<(String, Time)>,
    /// Called in order for every frame, after keyed properties and before joint matrices are built.
    pub frame_callbacks: Vec<Arc<dyn FrameCallback>>,
    /// Warnings of the script and the stage ("clip longer than its slot"), for `check`.
    pub warnings: Vec<String>,
}

/// Settings of a stage as a whole.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Width and height of the image in pixels, 1..=16384 each.
    pub size: [u32; 2],
    /// Frames per second.
    pub fps: FrameRate,
    /// Stage time at which the stage ends.
    pub length: Time,
    /// The color or gradient behind everything, where no sky is shown.
    pub background: Background,
    /// Ambient hemisphere light: luminance from above, linear, in candela per square metre.
    pub ambient_up: Vec3,
    /// Ambient hemisphere light: luminance from below, linear, in candela per square metre.
    pub ambient_down: Vec3,
    /// Exposure in stops: 1 more doubles the light that the camera takes in.
    pub exposure: f32,
    /// The curve from scene-linear light to the colors of a display.
    pub view_transform: ViewTransform,
    /// MSAA samples, 1 or 4; `None` leaves it to the command line's default.
    pub samples: Option<u32>,
    /// Edges of surfaces whose alpha is cut off.
    pub cutouts: Cutouts,
    /// Order in which transparent surfaces are blended.
    pub transparency: Transparency,
    /// The choice of forward or deferred shading of opaque surfaces.
    pub pipeline: Pipeline,
    /// Whether vertices are pre-skinned: once a frame, instead of in each pass.
    pub pre_skinning: PreSkinning,
    /// Whether small copies may be drawn with simplified meshes (levels of detail).
    pub levels_of_detail: bool,
}

impl Settings {
    /// Allowed exposures, stops.
    pub(crate) const EXPOSURES: std::ops::RangeInclusive<f32> = -20.0..=20.0;
}

/// The curve from scene-linear light to the colors of a display, for lit surfaces and the sky. Unlit and toon surfaces, 2D layers
/// and plain backgrounds are colors already and stay as they are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ViewTransform {
    /// Raw values, cut off at 1.
    None,
    /// Khronos PBR Neutral: base colors stay, highlights are compressed.
    #[default]
    Neutral,
    /// AgX by Troy Sobotka: the look of film, with less contrast and saturation.
    Agx,
}

/// Whether a character's vertices are pre-skinned once a frame for all passes that draw it (shadow maps, layers, hulls), or by each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PreSkinning {
    /// Pre-skinned if enough passes draw the mesh for that to be cheaper.
    #[default]
    Auto,
    /// Pre-skinned, however many passes draw the mesh.
    Always,
    /// Skinned anew by each pass.
    Never,
}

/// Edges of leaves and hair: where a material's alpha is cut off (glTF's MASK).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Cutouts {
    /// Alpha to coverage: with several samples per pixel each surface keeps its share of them.
    #[default]
    Smooth,
    /// Whole pixels, as with one sample.
    Hard,
}

/// Order in which transparent surfaces are blended (glTF's BLEND, thin glass).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Transparency {
    /// Independent of the order where sorting fails, else sorted.
    #[default]
    Auto,
    /// Meshes are sorted back to front; triangles within a mesh are not sorted.
    Sorted,
    /// Order-independent transparency: back to front in each pixel.
    Independent,
}

/// The step at which opaque surfaces are lit: as each is drawn (forward), or once per pixel when all are drawn (deferred).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Pipeline {
    /// Deferred if it is estimated to be faster, by the lights and the overlapping surfaces; never with several samples per pixel.
    #[default]
    Auto,
    /// Forward shading.
    Forward,
    /// Deferred shading with one sample per pixel; with more it is forward.
    Deferred,
}

/// The background of the image.
#[allow(missing_docs, reason = "the documentation of each variant names its fields")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Background {
    /// Linear RGBA.
    Color(Vec4),
    /// Linear, from the top row to the bottom row of the image.
    Gradient { top: Vec3, bottom: Vec3 },
}

impl Default for Background {
    /// Black.
    fn default() -> Self {
        Background::Color(Vec4::new(0.0, 0.0, 0.0, 1.0))
    }
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            size: [1280, 720],
            fps: FrameRate { num: 30, den: 1 },
            length: Time::from_secs(4.0),
            background: Background::Gradient {
                top: Vec3::new(0.32, 0.42, 0.55),
                bottom: Vec3::new(0.72, 0.76, 0.80),
            },
            ambient_up: Vec3::splat(0.45),
            ambient_down: Vec3::splat(0.25),
            exposure: 0.0,
            view_transform: ViewTransform::default(),
            samples: None,
            cutouts: Cutouts::default(),
            pre_skinning: PreSkinning::default(),
            levels_of_detail: true,
            transparency: Transparency::default(),
            pipeline: Pipeline::default(),
        }
    }
}

/// A callback of the script, a pure function of the time.
pub trait FrameCallback: Send + Sync + std::fmt::Debug {
    /// The changes at a time.
    ///
    /// # Errors
    /// The callback has failed.
    fn run(&self, time: Time, edits: &mut FrameEdits) -> Result<(), StageError>;

    /// Text that distinguishes this callback from others (source text and captured values), for [`Stage::content_hash`].
    fn identity(&self) -> String {
        format!("{self:?}")
    }
}

/// Reason why a stage cannot be evaluated at a time.
#[allow(missing_docs, reason = "the documentation of each variant names its fields")]
#[derive(Clone, Debug)]
pub enum StageError {
    /// A script callback failed; the error's text is complete, with file and line.
    Callback { error: Arc<dyn std::error::Error + Send + Sync>, time: Time },
    /// An actor is attached to itself: its name, and the names of the actors in between.
    Cycle(String, String),
    /// An actor faces another whose position depends on how it is turned: the names of both.
    FacingCycle(String, String),
    /// An invalid part of the stage: NaN, an index out of range, keys out of order.
    Invalid { place: String, what: String },
}

choreo_motion::error_texts! { StageError:
    Self::Callback { error, time } => "{error}\n    at {} s", time.as_secs();
    Self::Cycle(actor, between) => "actor \"{actor}\" is attached to itself, through {between}";
    Self::FacingCycle(actor, faced) => "actor \"{actor}\" cannot face \"{faced}\": the position of \"{faced}\" depends on the rotation of \"{actor}\"; \
        rotate \"{actor}\" with .turn, or face something that is not attached to it";
    Self::Invalid { place, what } => "{place}: {what}";
}
