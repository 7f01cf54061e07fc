//! The stage at a time: actors, cameras, lights, constraints.

#[path = "../support/mod.rs"]
mod support;

mod bounds;
mod camera_moves;
mod cameras;
mod constraints;
mod determinism;
mod extremes;
mod facing;
mod hashes;
mod lights;
mod look_at;
mod parents;
mod placements;
mod root_motion;
mod sample_files;
mod springs;
mod tangents;
mod timeline;
