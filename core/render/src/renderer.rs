//! Interface of both renderers, Vulkan and CPU: plans are submitted and frames are collected, with several frames in flight.

use crate::error::RenderError;
use crate::plan::Plan;
use crate::scene_resources::SceneResources;
use choreo_plugin::{Effect, FloatFrame, Frame};
use std::sync::Arc;

pub trait Renderer: Send {
    fn device(&self) -> &DeviceInfo;

    /// Number of frames that may be submitted before one is collected.
    fn frames_in_flight(&self) -> usize;

    /// Loads meshes, materials and textures. Objects whose content equals an already loaded object are reused.
    fn load(&mut self, resources: Arc<SceneResources>) -> Result<(), RenderError>;

    /// Starts drawing. Fails if `frames_in_flight` frames are submitted and not yet collected.
    fn submit(&mut self, plan: Plan) -> Result<(), RenderError>;

    /// Waits for the oldest submitted frame and returns it. Its pixels are written into the buffer of `reuse`.
    fn collect(&mut self, reuse: Option<Frame>) -> Result<Frame, RenderError>;

    /// Waits for the oldest submitted frame, whose plan must request floats, and returns it.
    fn collect_floats(&mut self) -> Result<FloatFrame, RenderError>;

    /// Replaces the effects that plans may name. All other objects of the renderer are kept.
    fn set_effects(&mut self, effects: &[Effect]) -> Result<(), RenderError>;

    /// Reads the shader folder again. After an error, the last valid shaders stay in use. Does nothing without a shader folder.
    fn reload_shaders(&mut self) -> Result<(), RenderError> {
        Ok(())
    }

    /// Numbers of device objects created so far.
    fn created_counts(&self) -> CreatedCounts {
        CreatedCounts::default()
    }

    /// Memory and objects in use on the device.
    fn usage(&self) -> DeviceUsage {
        DeviceUsage::default()
    }

    /// Messages for the user about problems since the last call from which the renderer has recovered.
    fn take_notes(&mut self) -> Vec<String> {
        Vec::new()
    }
}

/// Numbers of device objects created since the renderer started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CreatedCounts {
    pub meshes: u64,
    pub textures: u64,
    pub materials: u64,
    pub pipelines: u64,
}

/// Memory and objects that a renderer uses on its device. They must not grow when a scene is reloaded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceUsage {
    /// Number of buffers and images.
    pub memory_objects: usize,
    /// Allocated blocks of device memory, shared by buffers and images.
    pub memory_blocks: usize,
    pub bytes: u64,
    pub pipelines: usize,
    pub descriptor_pools: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceKind {
    /// The CPU reference renderer.
    CpuReference,
    /// A Vulkan driver that runs on the CPU (lavapipe).
    VulkanCpu,
    VulkanGpu,
}

#[derive(Clone, Debug, PartialEq)]
pub struct DeviceInfo {
    pub kind: DeviceKind,
    /// "NVIDIA H100", "llvmpipe (LLVM 15.0.6, 256 bits)", "choreo CPU renderer".
    pub name: String,
    /// Driver name and version, as the driver reports them.
    pub driver: String,
}
