//! The stage as a script leaves it: who is there, what plays when, from where it is seen.

use crate::surfaces::SurfaceRule;
use crate::{
    ActorSprings, Asset, CueRoot, EffectUse, Flat, FrameEdits, Goal, Light, Projection, Sky, Walk, Warp,
};
pub use choreo_motion::ik::Limit;
use choreo_motion::{Clip, FrameRate, Interpolation, PhaseMatchedFade, Time};
pub use choreo_motion::{Ease, Repeat, Skinning};
use glam::{DQuat, DVec3, Vec3, Vec4};
use std::sync::Arc;
use thiserror::Error;

#[derive(Clone, Debug, Default)]
pub struct Stage {
    pub settings: Settings,
    pub actors: Vec<Actor>,
    pub cameras: Vec<Camera>,
    /// Which camera is on from when; sorted by time. Before the first cut the first camera is on.
    pub cuts: Vec<Cut>,
    pub lights: Vec<StageLight>,
    /// Light from all around; a stage with it and no light of its own has no default sun.
    pub sky: Option<Sky>,
    /// In painter's order.
    pub flats: Vec<Flat>,
    pub effects: Vec<EffectUse>,
    /// Called in order for every frame, after keyed properties and before joint matrices are built.
    pub hooks: Vec<Arc<dyn FrameHook>>,
    /// Warnings of the script and the stage ("clip longer than its slot"), for `check`.
    pub warnings: Vec<String>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Pixels, 1..=16384 each.
    pub size: [u32; 2],
    pub fps: FrameRate,
    pub length: Time,
    pub background: Background,
    /// Light from everywhere, a hemisphere: from above and from below; linear, times albedo.
    pub ambient_up: Vec3,
    pub ambient_down: Vec3,
    /// MSAA samples, 1 or 4; `None` leaves it to the command line's default.
    pub samples: Option<u32>,
    pub cutouts: Cutouts,
    pub transparency: Transparency,
    pub pipeline: Pipeline,
    pub skin_once: SkinOnce,
}

/// Whether a body's vertices are put into their pose once a frame for all passes that draw it (shadow maps, layers, hulls), or by each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SkinOnce {
    /// Once where so many passes draw it that it pays.
    #[default]
    Auto,
    Always,
    Never,
}

/// Edges of leaves and hair: where a material's alpha is cut off (glTF's MASK).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Cutouts {
    /// With several samples a pixel each keeps its share of them (alpha to coverage).
    #[default]
    Smooth,
    /// Whole pixels, as with one sample.
    Hard,
}

/// In which order what is seen through is mixed (glTF's BLEND, thin glass).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Transparency {
    /// Independent of the order where sorting fails, else sorted.
    #[default]
    Auto,
    /// Meshes back to front, their triangles as they come.
    Sorted,
    /// Pixel by pixel back to front.
    Independent,
}

/// When what is opaque is lit: as each surface is drawn, or once a pixel when all of it is there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Pipeline {
    /// Deferred where that is quicker, by the lights and the surfaces over each other; never with several samples a pixel.
    #[default]
    Auto,
    Forward,
    /// With one sample a pixel; with more it is forward.
    Deferred,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Background {
    /// Linear RGBA.
    Color(Vec4),
    /// Linear, from the top row to the bottom row of the picture.
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
            samples: None,
            cutouts: Cutouts::default(),
            skin_once: SkinOnce::default(),
            transparency: Transparency::default(),
            pipeline: Pipeline::default(),
        }
    }
}

/// An asset on stage. The index in `Stage::actors` is its id; parents may come later than children.
#[derive(Clone, Debug)]
pub struct Actor {
    pub name: String,
    pub asset: Arc<Asset>,
    pub transform: Placement,
    pub parent: Option<Attachment>,
    /// Turned about its parent's +Y so that +Z points to where this actor stands; its own rotation comes first.
    pub face: Option<usize>,
    pub layers: Vec<Layer>,
    pub channels: Vec<Channel>,
    pub look_at: Vec<LookAt>,
    /// What the body does beside its clips; see [`crate::goals`] for the order.
    pub goals: Vec<Goal>,
    /// How far joints may turn, whatever clips and goals do.
    pub limits: Vec<(u32, Limit)>,
    /// Hair, skirts and tails.
    pub springs: Option<Arc<ActorSprings>>,
    /// Goes along a path, from where it is placed. Its clips' root motion then only sets the pace.
    pub walk: Option<Arc<Walk>>,
    /// An actor is seen where it and all that it is attached to are visible.
    pub visible: bool,
    /// Multiplies every base colour, linear.
    pub tint: Vec4,
    /// In place of the widths of its pens ([`crate::Pen`]).
    pub pen_width: Option<f32>,
    /// So many of the copies of its meshes are there, the first ones; `None`: all.
    pub copies: Option<u32>,
    /// Morph weights by name or index set in the script: (mesh instance, target, weight), over the clips'.
    pub morphs: Vec<(u32, u32, f32)>,
    /// Weights of expressions set in the script: (index into `Asset::expressions`, weight), over the clips'.
    pub expressions: Vec<(u32, f32)>,
    /// Whether the file's own lights shine when this actor is on stage.
    pub file_lights: bool,
    /// How vertices follow several joints.
    pub skinning: Skinning,
    /// How its surfaces are cut out and mixed; of those that say the same thing the last counts.
    pub surfaces: Vec<SurfaceRule>,
}

/// Where something stands in its parent: f64, so that 10 000 km from the origin looks as the origin does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    pub translation: DVec3,
    pub rotation: DQuat,
    pub scale: DVec3,
}

impl Default for Placement {
    fn default() -> Self {
        Placement { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attachment {
    pub actor: usize,
    /// Joint of the parent's skeleton; `None` = the parent's own transform.
    pub joint: Option<u32>,
}

/// A layer of clips on one actor. Layer 0 is the base; the others come over it by rank.
#[derive(Clone, Debug, Default)]
pub struct Layer {
    /// One weight a joint of the actor's skeleton, 0..=1; `None` = all joints.
    pub mask: Option<Arc<Vec<f32>>>,
    pub mode: LayerMode,
    /// Layers are sorted by rank, the base left out. A higher rank lies over a lower one. Those of one rank are equal: their
    /// order changes nothing but rounding. First those that override are mixed, by weight, over what is below
    /// ([`choreo_motion::WeightedBlend`]), then the additive ones are summed and laid on top ([`choreo_motion::AdditiveLayers`]).
    pub rank: u32,
    /// `Property::Weight` over stage time: of the layer as a whole, times its cues'; upper layers only.
    pub weight_keys: Option<Arc<Channel>>,
    /// Sorted by start. A cue fades in over what came before it.
    pub cues: Vec<Cue>,
}

/// What a layer does to what is below it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LayerMode {
    /// Goes towards the layer's pose, by its weight.
    #[default]
    Override,
    /// Adds what each of its clips does beyond a reference pose.
    Additive(Reference),
    /// Takes it away.
    Subtractive(Reference),
}

/// The pose that an additive clip is a difference to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reference {
    /// The clip where its trim begins.
    FirstFrame,
    /// The clip at this time.
    At(Time),
    /// The skeleton's rest pose.
    Rest,
}

/// A clip placed on the timeline.
#[derive(Clone, Debug)]
pub struct Cue {
    /// Bound to the actor's own skeleton (see `bind_clip`).
    pub clip: Arc<Clip>,
    pub start: Time,
    /// On the base layer: the pose is held from here on, where no cue follows at once (one that does fades in over the
    /// playing clip). On upper layers: faded out (over `fade_out`) by then. `None` = until the next cue or for ever.
    pub end: Option<Time>,
    pub fade_in: Time,
    pub fade_out: Time,
    pub ease: Ease,
    /// Clip seconds a stage second; negative plays backwards from `trim.1`.
    pub speed: f64,
    /// The part of the clip that is played.
    pub trim: (Time, Time),
    pub repeat: Repeat,
    /// 0..=1, times the fades. The first cue of the base layer always has all the weight.
    pub weight: f32,
    /// `Property::Weight` over stage time, in place of `weight`; what a spline overshoots is cut off at 0 and 1.
    pub weight_keys: Option<Arc<Channel>>,
    /// Clip time keyed over stage time, in place of the amount of `speed`, whose sign still says from which end.
    pub warp: Option<Arc<Warp>>,
    /// When the clip stands still, from and to on stage; sorted, one after the other.
    pub freezes: Vec<(Time, Time)>,
    /// Base layer: keeps step with the cue that fades into this one, or out of it.
    pub in_step: [Option<Arc<PhaseMatchedFade>>; 2],
    /// Base layer: above zero, it begins at once with all its weight, and what the cues before it were away from it dies
    /// down in this time ([`choreo_motion::Inertialization`]). In place of `fade_in`.
    pub inertial: Time,
    /// Base layer: the root motion that is taken out of the clip.
    pub root: Option<Arc<CueRoot>>,
}

/// Keyed property of an actor, camera, light, cue or effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    pub property: Property,
    pub interpolation: Interpolation,
    pub times: Vec<Time>,
    /// `property.width()` numbers a key (three times that for CubicSpline, glTF order).
    pub values: Vec<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Property {
    Translation,
    /// Quaternion x y z w.
    Rotation,
    Scale,
    /// 0 or 1.
    Visible,
    Tint,
    /// Of its lines and points.
    PenWidth,
    /// How many copies of its meshes, rounded down.
    Copies,
    Morph {
        instance: u32,
        target: u32,
    },
    /// Index into `Asset::expressions`.
    Expression {
        expression: u32,
    },
    /// Camera: vertical field of view, radians.
    FieldOfView,
    /// Light, sky.
    Intensity,
    Color,
    /// Of a cue.
    Weight,
    /// Of a cue: clip seconds a second.
    Speed,
    /// Of a cue: seconds of its clip.
    ClipTime,
    /// Of an effect: one of its numbers.
    Parameter,
    /// Sky: radians about +Y.
    Turn,
    /// Flat layer.
    Opacity,
    /// Light: metres; half angle of the cone, radians.
    Range,
    Cone,
}

impl Property {
    pub fn width(self) -> usize {
        match self {
            Property::Translation | Property::Scale | Property::Color => 3,
            Property::Rotation | Property::Tint => 4,
            _ => 1,
        }
    }
}

/// A joint turned towards a target: the direction that is the model's +Z in rest pose (glTF characters face +Z) is turned,
/// on the shortest way from the clip's pose, to point at it. See [`crate::LOOK_AT_LIMIT_RAD`].
#[derive(Clone, Debug, PartialEq)]
pub struct LookAt {
    pub joint: u32,
    pub target: Target,
    pub start: Time,
    pub end: Option<Time>,
    /// In after `start` and out before `end`, eased.
    pub fade: Time,
    pub weight: f32,
}

/// A place in the world, fixed or moving.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    Point(DVec3),
    /// The middle of the actor's rest bounds, moved with the actor.
    Actor(usize),
    Joint {
        actor: usize,
        joint: u32,
    },
}

#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    pub name: String,
    pub projection: Projection,
    pub rig: Rig,
    pub channels: Vec<Channel>,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Rig {
    /// Stands at `position`; looks at the target, else along −Z of `rotation`.
    Fixed { position: DVec3, rotation: DQuat, look_at: Option<Target> },
    /// Stands at target + offset (world axes) and looks at the target.
    Follow { target: Target, offset: DVec3 },
    /// Circles the target: angles in radians at time 0, radians a second. Azimuth 0 stands at +Z (before a glTF
    /// character's face), π/2 at +X; elevation π/2 looks straight down.
    Orbit { target: Target, distance: f64, elevation: f64, azimuth: f64, speed: f64 },
    /// The camera of an actor's file.
    File { actor: usize, camera: u32 },
    /// Stands still and fits everything that is visible at some time of the stage's length, from an azimuth and
    /// elevation in radians, as `Orbit` counts them. Flat ground is left out where there is anything else.
    Frame { azimuth: f64, elevation: f64 },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut {
    pub at: Time,
    pub camera: usize,
}

#[derive(Clone, Debug, PartialEq)]
pub struct StageLight {
    pub name: String,
    pub light: Light,
    pub position: DVec3,
    /// Unit vector along which the light shines (directional and spot).
    pub direction: Vec3,
    /// Moves with an actor or joint: position and direction are then in its space.
    pub parent: Option<Attachment>,
    pub channels: Vec<Channel>,
    /// Casts one, drawn so; `None`: shines through everything.
    pub shadow: Option<Shadow>,
    /// Falls off by 1 / (constant + linear · d + square · d²) in place of 1 / d²; points and spots.
    pub attenuation: Option<[f32; 3]>,
}

/// How the shadow of a light is drawn: a map of depths seen from the light, looked up by what is lit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shadow {
    /// The most texels along a side of a map; 64 to 4096.
    pub size: u32,
    /// Metres over which an edge goes from dark to light, ≥ 0. A map is as coarse as this allows: a soft shadow costs less.
    pub softness: f32,
}

impl Shadow {
    pub const SIZES: std::ops::RangeInclusive<u32> = 64..=4096;
}

impl Default for Shadow {
    fn default() -> Shadow {
        Shadow { size: 2048, softness: 0.01 }
    }
}

/// A callback of the script, a pure function of the time.
pub trait FrameHook: Send + Sync + std::fmt::Debug {
    fn run(&self, time: Time, edits: &mut FrameEdits) -> Result<(), StageError>;

    /// What tells this hook from another (source text and captured values), for [`Stage::content_hash`].
    fn identity(&self) -> String {
        format!("{self:?}")
    }
}

#[derive(Clone, Debug, Error)]
pub enum StageError {
    /// A script callback failed; the error's text is complete, with file and line.
    #[error("{error}\n    at {} s", time.as_secs())]
    Hook { error: Arc<dyn std::error::Error + Send + Sync>, time: Time },
    /// An actor and those between it and itself.
    #[error("actor \"{0}\" is attached to itself, through {1}")]
    Cycle(String, String),
    /// An actor and the one it faces.
    #[error(
        "actor \"{0}\" cannot face \"{1}\": where \"{1}\" stands depends on how \"{0}\" is turned; \
         turn \"{0}\" by hand, or face something that it does not carry"
    )]
    FacingCycle(String, String),
    /// Something that no frame can be made of: NaN, an index out of range, keys out of order.
    #[error("{place}: {what}")]
    Bad { place: String, what: String },
}
