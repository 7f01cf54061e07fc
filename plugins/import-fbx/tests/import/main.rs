//! Files, what is read of them, and what is refused.

#[path = "../common/mod.rs"]
mod common;

mod bad_input;
mod blend_shapes;
mod facts;
mod features;
mod properties;
mod truth;
