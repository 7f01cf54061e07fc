//! Feet of characters on the ground.

#[path = "../common/mod.rs"]
mod common;

mod footsteps;
mod held;
