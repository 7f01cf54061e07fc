//! Clips, poses and what changes them.

#[path = "../support/mod.rs"]
mod support;

mod additive;
mod clip;
mod compress;
mod contacts;
mod edit;
mod ik;
mod jobs;
mod laws;
mod mirror;
mod rest_poses;
mod retarget;
mod sample;
mod skin_dual;
mod springs;
mod time;
