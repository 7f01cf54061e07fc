//! The stage at a time: actors, cameras, lights, constraints.

#[path = "../support/mod.rs"]
mod support;

mod bounds;
mod camera_moves;
mod cameras;
mod constraints;
mod extremes;
mod facing;
mod hashes;
mod keys;
mod lights;
mod look_at;
mod parents;
mod places;
mod real_files;
mod root_motion;
mod same_bits;
mod springs;
mod timeline;
