//! Looks: an effect changes pixels after the scene is shaded, on the GPU in WGSL and on the CPU in Rust.

use crate::{Manifest, PluginFile};
use glam::{Vec2, Vec4};

/// A full-screen post effect: a function of one pixel. Further hook points come beside it.
pub trait Effect: Send + Sync {
    fn manifest(&self) -> &Manifest;

    /// The file that it was read from, where it is no part of the program.
    fn file(&self) -> Option<&PluginFile> {
        None
    }

    /// WGSL source that defines `fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32>`.
    /// `color` is linear, `uv` is 0..1 from the top left, `p` holds the parameters in manifest order.
    fn wgsl(&self) -> &str;

    /// The same function, the specification of the WGSL.
    fn cpu(&self, color: Vec4, uv: Vec2, parameters: &[f32; 8]) -> Vec4;
}
