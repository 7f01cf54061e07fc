//! Assets, actors, cameras, lights and the timeline; `Stage::at(t)` evaluates them at a time.
//!
//! A stage is plain data: a script (or any Rust code) fills it, nothing in it changes while it is drawn.
//! `at` is a function of the time alone: any order, any thread, the same bits.

#![warn(missing_docs)]

mod actors;
mod build;
mod camera;
mod camera_moves;
mod check;
mod constraints;
mod culling;
mod effects;
mod evaluate;
mod framing;
mod layers_2d;
mod lights;
mod mirroring;
mod morph_range;
pub mod noise;
mod placed;
mod pose;
mod properties;
mod root_motion;
mod snapshot;
mod springs;
mod stage;
mod survey;
mod timeline;
mod transforms;

pub use choreo_motion::ik::Limit;
pub use choreo_motion::{Ease, Repeat, Skinning};
pub use constraints::legs::find_legs;
pub use evaluate::{EvaluationCosts, Evaluator};
pub use lights::{DEFAULT_SUN_LUX, default_sun};
pub use mirroring::Mirroring;
pub use pose::posed_mesh::posed_meshes;
pub use properties::materials::uv_transform;
pub use snapshot::{
    ActorState, CameraState, ChangedMaterial, Dissolve, EffectState, Layer2dState, LightState, SkyState,
    Snapshot,
};
pub use stage::actor::{Actor, ActorShadow, Attachment, LookAt, Placement, Target};
pub use stage::camera::{Camera, Cut, Rig, RigOption};
pub use stage::camera_moves::{CameraLook, CameraShake};
pub use stage::channel::{Channel, Property};
pub use stage::clips::{Cue, Layer, LayerMode, Reference};
pub use stage::constraint::{
    AimConstraint, Constraint, ConstraintKind, FootLock, Leg, ReachConstraint, StandingFade,
};
pub use stage::described::{Described, Field, FieldType, FieldValue};
pub use stage::edits::{ActorEdit, CameraEdit, FrameEdits, LightEdit};
pub use stage::effects::{
    EffectDistance, EffectEdit, EffectImageUse, EffectTarget, EffectUse, OffScreenActors,
};
pub use stage::layers_2d::{Align, Fit, Font, Layer2d, Layer2dContent, Layer2dEdit, TextOutline, TextPanel};
pub use stage::light::{SUN_ANGLE, Shadow, StageLight};
pub use stage::parenting::{ParentChange, ParentScale, Parenting};
pub use stage::path::{Pace, Path, PathError, PathFollowing};
pub use stage::root_motion::CueRootMotion;
pub use stage::sky::{Sky, SkyEdit};
pub use stage::solvers::SolverSettings;
pub use stage::springs::{ActorSprings, SpringParameters};
pub use stage::surfaces::SurfaceRule;
pub use stage::tangents::Tangents;
pub use stage::time_remapping::{SpeedCurve, TimeRemapping};
pub use stage::{
    Background, Cutouts, FrameCallback, Pipeline, PreSkinning, Settings, Stage, StageError, Transparency,
    ViewTransform,
};
pub use survey::{Finding, Subject};
pub use timeline::active_clips::ActiveClip;
