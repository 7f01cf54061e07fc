//! Motion of real characters.

#[path = "../common/mod.rs"]
mod common;

mod hips;
mod in_step;
mod retargeting;
