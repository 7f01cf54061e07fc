//! Looks: what an effect changes is named by its [`Hook`]; it does so on the GPU in WGSL and on the CPU in Rust.

use crate::{Manifest, PluginFile};
use glam::{Vec2, Vec3, Vec4};

/// Where an effect takes hold of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Hook {
    /// A function of one pixel of the finished picture: [`Effect::wgsl`] and [`Effect::cpu`].
    #[default]
    Pixel,
    /// A hull around surfaces, drawn as geometry of its own: [`Effect::shell`].
    Shell,
}

impl Hook {
    /// Whether single actors can have it.
    pub fn of_actors(self) -> bool {
        matches!(self, Hook::Shell)
    }
}

/// A hull around a surface, of which the inside is seen: an outline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shell {
    /// Pixels of the picture, whatever the distance.
    pub width: f32,
    /// Linear.
    pub color: Vec3,
    /// 0: the colour as it is, 1: times what the surface shows.
    pub lighting_mix: f32,
}

pub trait Effect: Send + Sync {
    fn manifest(&self) -> &Manifest;

    /// The file that it was read from, where it is no part of the program.
    fn file(&self) -> Option<&PluginFile> {
        None
    }

    fn hook(&self) -> Hook {
        Hook::Pixel
    }

    /// Of a [`Hook::Pixel`]: WGSL source that defines `fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32>`.
    /// `color` is linear, `uv` is 0..1 from the top left, `p` holds the parameters in manifest order.
    fn wgsl(&self) -> &str {
        ""
    }

    /// The same function, the specification of the WGSL.
    fn cpu(&self, color: Vec4, _uv: Vec2, _parameters: &[f32; 8]) -> Vec4 {
        color
    }

    /// Of a [`Hook::Shell`]. `None` draws nothing.
    fn shell(&self, _parameters: &[f32; 8]) -> Option<Shell> {
        None
    }
}
