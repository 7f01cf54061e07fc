//! Assets, actors, cameras, lights and the timeline; `Stage::at(t)` evaluates them at a time.
//!
//! A stage is plain data: a script (or any Rust code) fills it, nothing in it changes while it is drawn.
//! `at` is a function of the time alone: any order, any thread, the same bits.

pub mod asset;
pub mod bounds;
pub mod build;
mod camera;
mod carry;
mod channels;
pub mod check;
pub mod derived;
mod effects;
pub mod evaluate;
pub mod expression;
pub mod eyes;
pub mod flat;
mod framing;
pub mod goals;
pub mod hash;
mod inertia;
mod layers;
mod lights;
mod look_at;
mod material_changes;
mod material_layers;
pub mod mirroring;
mod order;
pub mod path;
pub mod playing;
mod pose;
pub mod posed_mesh;
mod posing;
mod properties;
pub mod sky;
pub mod snapshot;
pub mod stage;
mod survey;
mod timeline;
pub mod toon;
pub mod travel;

pub use asset::*;
pub use bounds::{Aabb, BoundsPart, DAabb, InstanceBounds};
pub use channels::slerp;
pub use derived::Derived;
pub use effects::{EffectEdit, EffectState, EffectTarget, EffectUse};
pub use evaluate::Evaluator;
pub use expression::{ColorBind, Expression, ExpressionGroup, MaterialColor, MorphBind, Override, UvBind};
pub use eyes::{Eyes, EyesMovedBy, GAZE, RangeMap};
pub use flat::{Align, Fit, Flat, FlatContent, FlatEdit, FlatState, Font};
pub use goals::{ActorSprings, AimGoal, Goal, GoalKind, Leg, Plant, Reach, find_legs};
pub use hash::ContentHash;
pub use lights::default_sun;
pub use look_at::LOOK_AT_LIMIT_RAD;
pub use material_changes::{ChangedMaterial, uv_transform};
pub use material_layers::MaterialLayers;
pub use mirroring::Mirroring;
pub use path::{Pace, Path, Walk};
pub use playing::{SpeedCurve, Warp};
pub use posed_mesh::{PosedInstance, PosedPrimitive, posed_meshes, posed_meshes_in};
pub use sky::{Panorama, PanoramaError, Sky, SkyEdit, SkyState};
pub use snapshot::*;
pub use stage::*;
pub use survey::{Finding, Subject};
pub use timeline::Heard;
pub use toon::{Outline, Toon, UvMotion};
pub use travel::CueRoot;
