//! Renders: outputs, interruptions, what is reused and what is left out.

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
