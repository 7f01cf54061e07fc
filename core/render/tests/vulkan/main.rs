//! The Vulkan renderer and its devices.

#[path = "../common/mod.rs"]
mod common;

mod device_features;
mod faults;
mod files;
mod scenes;
mod textures;
