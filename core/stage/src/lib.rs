//! Assets, actors, cameras, lights and the timeline; `Stage::at(t)` evaluates them at a time.
//!
//! A stage is plain data: a script (or any Rust code) fills it, nothing in it changes while it is drawn.
//! `at` is a function of the time alone: any order, any thread, the same bits.

pub mod build;
mod camera;
mod carry;
mod channels;
pub mod check;
mod edits;
mod effects;
pub mod evaluate;
mod faces;
pub mod flat;
mod framing;
pub mod goals;
mod hash;
mod inertia;
mod layers;
mod lights;
mod look_at;
mod material_changes;
pub mod mirroring;
mod order;
mod out_of_view;
pub mod path;
pub mod playing;
mod pose;
mod posed_mesh;
mod posing;
mod properties;
pub mod sky;
pub mod snapshot;
pub mod stage;
mod surfaces;
mod survey;
mod timeline;
pub mod travel;

pub use channels::slerp;
pub use edits::{ActorEdit, FrameEdits, LightEdit};
pub use effects::{EffectEdit, EffectState, EffectTarget, EffectUse};
pub use evaluate::Evaluator;
pub use flat::{Align, Fit, Flat, FlatContent, FlatEdit, FlatState, Font};
pub use goals::{ActorSprings, AimGoal, Goal, GoalKind, Leg, Plant, Reach, find_legs};
pub use lights::default_sun;
pub use look_at::LOOK_AT_LIMIT_RAD;
pub use material_changes::{ChangedMaterial, uv_transform};
pub use mirroring::Mirroring;
pub use path::{Pace, Path, Walk};
pub use playing::{SpeedCurve, Warp};
pub use posed_mesh::posed_meshes;
pub use sky::{Sky, SkyEdit, SkyState};
pub use snapshot::*;
pub use stage::*;
pub use surfaces::SurfaceRule;
pub use survey::{Finding, Subject};
pub use timeline::Heard;
pub use travel::CueRoot;
