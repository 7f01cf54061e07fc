//! Plugins as files and packages, and those that fail.

#[path = "../common/mod.rs"]
mod common;

mod effect_samples;
mod faulty_plugins;
mod packages;
mod plugin_files;
