//! The figure and its clips.

#[path = "../common/mod.rs"]
mod common;

mod clips;
mod figure;
