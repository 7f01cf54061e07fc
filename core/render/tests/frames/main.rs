//! Frames: plan, deferred shading, dissolves, tiles and motion blur.

#[path = "../common/mod.rs"]
mod common;

mod deferred;
mod dissolve;
mod motion_blur;
mod plan;
mod tiles;
