//! What a script holds in its variables: handles onto the stage being built.
//!
//! A handle made by a call that failed is dead: whatever is done with it is skipped without a word, so that one
//! wrong name is one message and the script goes on to its next mistake.

use crate::load::Load;
pub use crate::made::ImageRef;
use crate::testing::PlanOptions;
use choreo_asset::Asset;
use choreo_motion::Clip;
use std::sync::Arc;

/// Index of a dead handle.
pub const DEAD: usize = usize::MAX;

#[derive(Clone, Debug)]
pub struct AssetRef {
    pub from: Arc<Load>,
    pub dead: bool,
}

#[derive(Clone, Debug)]
pub struct ClipRef {
    pub clip: Arc<Clip>,
    pub asset: Arc<Asset>,
    pub dead: bool,
}

#[derive(Clone, Debug)]
pub struct ActorRef {
    pub id: usize,
    pub asset: Arc<Asset>,
}

#[derive(Clone, Debug)]
pub struct JointRef {
    pub actor: usize,
    pub joint: u32,
    pub asset: Arc<Asset>,
}

#[derive(Clone, Copy, Debug)]
pub struct CueRef(pub usize);

#[derive(Clone, Copy, Debug)]
pub struct LookRef {
    pub actor: usize,
    pub index: usize,
}

/// A reach, an aim or planted feet.
#[derive(Clone, Copy, Debug)]
pub struct GoalRef {
    pub actor: usize,
    pub index: usize,
}

#[derive(Clone, Copy, Debug)]
pub struct CameraRef(pub usize);

#[derive(Clone, Copy, Debug)]
pub struct LightRef(pub usize);

/// A text, picture, panel or letterbox.
#[derive(Clone, Copy, Debug)]
pub struct FlatRef(pub usize);

/// Handle of the one sky of a stage.
#[derive(Clone, Copy, Debug)]
pub struct SkyRef(pub usize);

#[derive(Clone, Debug)]
pub struct EffectRef {
    pub id: usize,
    /// Callbacks run when the list of effects has left the script.
    pub plugin: Arc<str>,
}

/// A stage in a test: the section's own or one of `stage_of`.
#[derive(Clone, Copy, Debug)]
pub struct StageRef(pub usize);

/// The plan of a frame, in a test.
#[derive(Clone, Copy, Debug)]
pub struct PlanRef {
    pub options: PlanOptions,
    pub dead: bool,
}

/// What another script has put on the stage of a test.
#[derive(Clone, Copy, Debug)]
pub struct SceneRef(pub usize);

/// The types of handles, by the names that scripts and messages use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// No receiver: a function.
    None,
    Asset,
    Image,
    Clip,
    Actor,
    Joint,
    Cue,
    Look,
    Goal,
    Camera,
    Light,
    Sky,
    Flat,
    Effect,
    Expect,
    Stage,
    Plan,
    Scene,
}

impl Kind {
    pub const HANDLES: [Kind; 17] = [
        Kind::Asset,
        Kind::Image,
        Kind::Clip,
        Kind::Actor,
        Kind::Joint,
        Kind::Cue,
        Kind::Look,
        Kind::Goal,
        Kind::Camera,
        Kind::Light,
        Kind::Sky,
        Kind::Flat,
        Kind::Effect,
        Kind::Expect,
        Kind::Stage,
        Kind::Plan,
        Kind::Scene,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Kind::None => "",
            Kind::Asset => "Asset",
            Kind::Image => "Image",
            Kind::Clip => "Clip",
            Kind::Actor => "Actor",
            Kind::Joint => "Joint",
            Kind::Cue => "Cue",
            Kind::Look => "Look",
            Kind::Goal => "Goal",
            Kind::Camera => "Camera",
            Kind::Light => "Light",
            Kind::Sky => "Sky",
            Kind::Flat => "Flat",
            Kind::Effect => "Effect",
            Kind::Expect => "Expect",
            Kind::Stage => "Stage",
            Kind::Plan => "Plan",
            Kind::Scene => "Scene",
        }
    }

    pub fn from_name(name: &str) -> Option<Kind> {
        Kind::HANDLES.into_iter().find(|k| k.name() == name)
    }
}
