//! The options of a Vulkan renderer.

use super::faults::Faults;
use super::{Ability, DeviceTime};
use crate::renderer::DeviceKind;
use choreo_plugin::Effect;
use std::ffi::CString;
use std::path::PathBuf;
use std::sync::Arc;

#[derive(Clone, Default)]
pub struct GpuOptions {
    /// The Khronos layer with synchronization validation; every message becomes `RenderError::Validation`.
    pub validation: bool,
    /// Folder in which the pipeline cache is kept between runs.
    pub cache_dir: Option<PathBuf>,
    /// Folder with WGSL modules that take precedence over the built-in ones.
    pub shader_dir: Option<PathBuf>,
    /// Full-screen effects that plans may name.
    pub effects: Vec<Effect>,
    /// Part of a device's name, in any case. Without it a discrete device is preferred to an integrated one, and that to a CPU.
    pub device: Option<String>,
    /// Extensions that a window system needs in addition.
    pub instance_extensions: Vec<CString>,
    pub device_extensions: Vec<CString>,
    /// Uses as little memory as possible: one frame in flight, small blocks, uploads in small parts.
    pub frugal: bool,
    /// Limits the number of textures that a material may bind, for tests.
    pub textures: Option<u32>,
    /// Limits the longer side of an image in pixels; larger images are drawn in tiles.
    pub longest_side: Option<u32>,
    /// Limits the bytes of a bound storage buffer (`maxStorageBufferRange`), for tests.
    pub storage_range: Option<u32>,
    /// Device features to ignore, for tests.
    pub without: Vec<Ability>,
    /// Largest anisotropy of texture filters; 1: isotropic. Default: 16 on a GPU, 1 on a device that draws on the CPU, where a
    /// first frame with more takes seconds.
    pub anisotropy: Option<f32>,
    /// Counter to which the time is added that the device is busy.
    pub device_time: Option<Arc<DeviceTime>>,
    /// Failures to inject, for tests.
    pub faults: Faults,
}

/// Number of frames in flight. On a GPU a third one evens out uneven frames; a driver that draws on the CPU is busy with two, and
/// each costs three times the memory of an image.
pub(super) fn frames_in_flight(kind: DeviceKind, frugal: bool) -> usize {
    match kind {
        _ if frugal => 1,
        DeviceKind::VulkanCpu => 2,
        _ => 3,
    }
}
