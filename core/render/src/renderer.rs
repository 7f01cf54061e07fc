//! What the program sees of a renderer, Vulkan or CPU: plans in, frames out, several in flight.

use crate::{Catalog, Plan};
use choreo_plugin::{Effect, Frame};
use std::sync::Arc;
use thiserror::Error;

pub trait Renderer: Send {
    fn device(&self) -> &DeviceInfo;

    /// How many frames may be submitted and not yet collected.
    fn frames_in_flight(&self) -> usize;

    /// Makes the catalogue's meshes, materials and textures known; what was there before is kept where its content is equal.
    fn load(&mut self, catalog: Arc<Catalog>) -> Result<(), RenderError>;

    /// Starts drawing. Waits where `frames_in_flight` are not yet collected… an error then: collect first.
    fn submit(&mut self, plan: Plan) -> Result<(), RenderError>;

    /// The oldest submitted frame, waiting for it. The given frame's buffer is reused.
    fn collect(&mut self, reuse: Option<Frame>) -> Result<Frame, RenderError>;

    /// Effects that plans may name from now on, in place of those before. What else the renderer has made stays.
    fn set_effects(&mut self, effects: &[Arc<dyn Effect>]) -> Result<(), RenderError>;

    /// Reads the shader folder again; on an error the last good shaders stay. Nothing where there is none.
    fn reload_shaders(&mut self) -> Result<(), RenderError> {
        Ok(())
    }

    /// What it has made so far.
    fn work(&self) -> Work {
        Work::default()
    }

    /// What it has on its device now.
    fn held(&self) -> Held {
        Held::default()
    }

    /// What went wrong and was made good since the last call, for the user.
    fn take_notes(&mut self) -> Vec<String> {
        Vec::new()
    }
}

/// Counts of what was made on a device since the renderer is there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    pub meshes: u64,
    pub textures: u64,
    pub materials: u64,
    pub pipelines: u64,
}

/// What a renderer has on its device: reloads must not make it grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Held {
    /// Buffers and images.
    pub memory_objects: usize,
    /// Blocks of memory that they lie in.
    pub memory_blocks: usize,
    pub bytes: u64,
    pub pipelines: usize,
    pub descriptor_pools: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceKind {
    /// Our own CPU renderer.
    CpuTwin,
    /// A Vulkan driver that runs on the CPU (lavapipe).
    VulkanCpu,
    VulkanGpu,
}

#[derive(Clone, Debug, PartialEq)]
pub struct DeviceInfo {
    pub kind: DeviceKind,
    /// "NVIDIA H100", "llvmpipe (LLVM 15.0.6, 256 bits)", "choreo CPU renderer".
    pub name: String,
    /// Driver name and version, as the driver says.
    pub driver: String,
}

#[derive(Debug, Error)]
pub enum RenderError {
    /// No Vulkan loader, driver or device; the text says what to install.
    #[error("Vulkan is not available: {why}")]
    NoVulkan { why: String },
    /// A Vulkan call failed.
    #[error("Vulkan: {object}: {result}")]
    Vulkan { object: String, result: String },
    /// The device is gone for good; another one can be made.
    #[error("Vulkan: {object}: the device was lost; the kernel log may say why the driver gave it up")]
    DeviceLost { object: String },
    /// Of the device or of the machine.
    #[error("Vulkan: {object}: out of memory")]
    OutOfMemory { object: String },
    /// The driver may hang: what it was given is never touched again.
    #[error("Vulkan: {object}: not finished after {secs} s")]
    TimedOut { object: String, secs: u64 },
    /// Failed twice, the second time on a device made afresh and asked for less.
    #[error("{second}; tried twice, before that: {first}")]
    Twice { first: Box<RenderError>, second: Box<RenderError> },
    /// The validation layer said something (tests only).
    #[error("Vulkan validation: {0}")]
    Validation(String),
    #[error("shader {file}: {text}")]
    Shader { file: String, text: String },
    #[error("{what} is {value}, the limit of this device is {limit}")]
    Limit { what: String, value: u64, limit: u64 },
    #[error("{0}")]
    Usage(String),
}
