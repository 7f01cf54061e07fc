//! Drawing by the CPU renderer.

#[path = "../common/mod.rs"]
mod common;
mod wall;

mod films;
mod layers;
mod raster;
mod shading;
mod stages;
