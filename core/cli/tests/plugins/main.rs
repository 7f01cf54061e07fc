//! Plugins in single files and in packages, and faulty plugins.

#[path = "../common/mod.rs"]
mod common;

mod effect_samples;
mod faulty_plugins;
mod packages;
mod plugin_files;
