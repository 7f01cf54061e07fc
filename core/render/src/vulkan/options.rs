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
    /// WGSL modules here win over those in the program.
    pub shader_dir: Option<PathBuf>,
    /// Full-screen effects that plans may name.
    pub effects: Vec<Effect>,
    /// Part of a device's name, any case. Otherwise discrete before integrated before CPU.
    pub device: Option<String>,
    /// Extensions that a window system needs in addition.
    pub instance_extensions: Vec<CString>,
    pub device_extensions: Vec<CString>,
    /// Uses as little memory as possible: one frame in flight, small blocks, uploads in small parts.
    pub frugal: bool,
    /// Limit of the number of textures of a material bound at once, for tests.
    pub textures: Option<u32>,
    /// Limit of an image's longer side, pixels: larger ones are drawn in tiles.
    pub longest_side: Option<u32>,
    /// Limit of the bytes of a bound storage buffer (`maxStorageBufferRange`), for tests.
    pub storage_range: Option<u32>,
    /// Device features to ignore, for tests.
    pub without: Vec<Ability>,
    /// How many times as many texels are read along a slanted surface as across it, at most; 1: none more. Left out: 16 on a
    /// GPU, 1 on a device that draws on the CPU, where a first frame with more takes seconds.
    pub anisotropy: Option<f32>,
    /// Counter of the time that the device is busy, if any.
    pub device_time: Option<Arc<DeviceTime>>,
    /// Tests only.
    pub faults: Faults,
}

/// Number of frames in flight: on a GPU a third frame hides uneven frames; a driver that draws on the CPU is busy with two, and
/// each costs an image's memory three times.
pub(super) fn frames_in_flight(kind: DeviceKind, frugal: bool) -> usize {
    match kind {
        _ if frugal => 1,
        DeviceKind::VulkanCpu => 2,
        _ => 3,
    }
}
