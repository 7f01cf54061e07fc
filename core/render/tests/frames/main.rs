//! How a frame is put together: plan, passes, tiles, shutter.

#[path = "../common/mod.rs"]
mod common;

mod deferred;
mod dissolve;
mod motion_blur;
mod plan;
mod tiles;
