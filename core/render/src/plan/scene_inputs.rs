//! The pass that draws the inputs of effects on images: depth, normals, motion vectors, actors.

use crate::plan::Draw;
use choreo_plugin::SceneInputs;
use glam::{Mat4, Vec3};

/// One more pass over the opaque and cut-out triangles, with one sample per pixel and its own depth image, whatever the samples
/// of the frame. Has two color targets with `motion`, else one.
#[derive(Clone, Debug)]
pub struct InputPass {
    /// Draws with their own instances, whose tint holds numbers: the actor's, from 1; with `motion` the index of the instance one
    /// frame before; with `names` the material's, from 1.
    pub draws: Vec<Draw>,
    pub motion: bool,
    /// Clip space of the frame before, from its camera-relative space.
    pub clip_before: Mat4,
    /// World position of the camera in the frame before.
    pub camera_before: Vec3,
    /// All inputs that the frame's effects read.
    pub inputs: SceneInputs,
    /// Names of the effects that read the inputs.
    pub effects: Vec<String>,
    /// Names of actors and of materials by their numbers, if the frame has an ID pass.
    pub names: Option<[Vec<String>; 2]>,
}

impl InputPass {
    /// Bytes per pixel of the color targets.
    pub(crate) fn pixel_bytes(&self) -> usize {
        if self.motion { 32 } else { 16 }
    }
}
