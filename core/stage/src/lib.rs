//! Assets, actors, cameras, lights and the timeline; `Stage::at(t)` evaluates them at a time.
//!
//! A stage is plain data: a script (or any Rust code) fills it, nothing in it changes while it is drawn.
//! `at` is a function of the time alone: any order, any thread, the same bits.

pub mod asset;
pub mod bounds;
pub mod derived;
pub mod hash;
pub mod posed_mesh;
pub mod snapshot;
pub mod stage;

pub use asset::*;
pub use bounds::{Aabb, BoundsPart, DAabb, InstanceBounds};
pub use derived::Derived;
pub use hash::ContentHash;
pub use snapshot::*;
pub use stage::*;
