//! Each built-in effect.

mod closed_forms;
mod scene_effects;
