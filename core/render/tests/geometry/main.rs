//! Deformation of vertices, levels of detail, and culling.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/holes.rs"]
mod holes;

mod dual_quaternion;
mod lod;
mod morphs;
mod placed_models;
mod preskin;
mod watertight;
mod watertight_poses;
