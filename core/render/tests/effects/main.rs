//! Effects of plugins, by both renderers.

#[path = "../common/mod.rs"]
mod common;

mod both_renderers;
mod faults;
mod frame_numbers;
mod hooks;
mod images;
mod parameters;
mod passes;
mod scene_inputs;
