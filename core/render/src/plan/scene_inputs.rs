//! The pass that draws what effects on images read of the scene: depth, normals, motion vectors, actors.

use crate::plan::Draw;
use choreo_plugin::SceneInputs;
use glam::{Mat4, Vec3};

/// One more pass over the opaque and cut-out triangles, with one sample per pixel and a depth image of its own, whatever the samples
/// of the frame. With `motion` it has two color targets instead of one.
#[derive(Clone, Debug)]
pub struct InputPass {
    /// The draws' instances are their own: their tint holds the actor's number, from 1, with `motion` the index of the instance
    /// as it was one frame before, and with `names` the material's number, from 1.
    pub draws: Vec<Draw>,
    pub motion: bool,
    /// Clip space from the camera-relative space of the frame before.
    pub clip_before: Mat4,
    /// World position of the camera in the frame before.
    pub camera_before: Vec3,
    /// All inputs that the frame's effects read.
    pub inputs: SceneInputs,
    /// Names of the effects that read any of it.
    pub effects: Vec<String>,
    /// Names of actors and materials by their numbers, where these are a pass of the frame.
    pub names: Option<[Vec<String>; 2]>,
}

impl InputPass {
    /// Bytes per pixel of the color targets.
    pub(crate) fn pixel_bytes(&self) -> usize {
        if self.motion { 32 } else { 16 }
    }
}
