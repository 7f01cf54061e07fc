//! Renders: outputs, interruptions, reused frames and culling.

#[path = "../common/mod.rs"]
mod common;

mod auto_device;
mod culling;
mod interrupt;
mod levels_of_detail;
mod render;
mod render_watch;
mod resume;
mod reused_frames;
