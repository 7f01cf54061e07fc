//! Files, what is read of them, and what is refused.

#[path = "../common/mod.rs"]
mod common;
#[path = "../oracle/mod.rs"]
mod oracle;

mod bad_input;
mod camera_moves;
mod compressed;
mod facts;
mod features;
mod layers;
mod other_writers;
mod packed;
mod pointers;
mod poses;
mod resources;
mod tangents;
