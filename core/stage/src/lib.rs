//! Assets, actors, cameras, lights and the timeline; `Stage::at(t)` evaluates them at a time.
//!
//! A stage is plain data: a script (or any Rust code) fills it, nothing in it changes while it is drawn.
//! `at` is a function of the time alone: any order, any thread, the same bits.

pub mod asset;
pub mod snapshot;
pub mod stage;

pub use asset::*;
pub use snapshot::*;
pub use stage::*;
