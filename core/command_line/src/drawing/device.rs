//! Which renderer draws: Vulkan where a driver works, else our own on the CPU.

use crate::args::Device;
use crate::drawing::pipeline::render_failure;
use crate::failure::Failure;
use crate::process::threads::{room_for_a_driver, too_few};
use choreo_plugin::Effect;
use choreo_render::cpu::CpuRenderer;
use choreo_render::vulkan::{DeviceTime, GpuOptions, SteadyRenderer};
use choreo_render::{DeviceInfo, DeviceKind, RenderError, Renderer};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;

/// What is asked for.
#[derive(Clone, Debug)]
pub struct Wanted {
    pub device: Device,
    /// Part of the name of Vulkan's device.
    pub gpu: Option<String>,
    /// How long it is busy.
    pub timings: bool,
    /// See `GpuOptions::anisotropy`.
    pub anisotropy: Option<u8>,
}

impl From<Device> for Wanted {
    fn from(device: Device) -> Wanted {
        Wanted { device, gpu: None, timings: false, anisotropy: None }
    }
}

pub struct Started {
    pub renderer: Box<dyn Renderer>,
    /// The device's time, if it was asked for and the device has a clock.
    pub time: Option<Arc<DeviceTime>>,
    /// Why it is not a faster one.
    pub note: Option<String>,
}

/// A renderer on its way.
pub enum Starting {
    OnThread(JoinHandle<Result<Started, Failure>>),
    /// No thread could be had: it is started by the one that waits for it.
    WhenWaitedFor(Wanted, Vec<Arc<dyn Effect>>),
}

pub fn start(wanted: impl Into<Wanted>, effects: &[Arc<dyn Effect>]) -> Starting {
    let (wanted, effects) = (wanted.into(), effects.to_vec());
    let (its_wanted, its_effects) = (wanted.clone(), effects.clone());
    let thread =
        std::thread::Builder::new().name("device".into()).spawn(move || open(its_wanted, its_effects));
    match thread {
        Ok(thread) => Starting::OnThread(thread),
        Err(_) => Starting::WhenWaitedFor(wanted, effects),
    }
}

impl Starting {
    pub fn wait(self) -> Result<Started, Failure> {
        let failed = |_| Err(Failure::Device("the renderer failed to start".into()));
        match self {
            Starting::OnThread(thread) => thread.join().unwrap_or_else(failed),
            Starting::WhenWaitedFor(wanted, effects) => open(wanted, effects),
        }
    }
}

fn open(wanted: Wanted, effects: Vec<Arc<dyn Effect>>) -> Result<Started, Failure> {
    let device = wanted.device;
    let cpu = |note| Ok(Started { renderer: Box::new(CpuRenderer::new(&effects)), time: None, note });
    if device == Device::Cpu {
        return cpu(None);
    }
    if !room_for_a_driver() {
        return match device == Device::Vulkan || wanted.gpu.is_some() {
            true => Err(too_few("a Vulkan driver needs more of them; --device cpu needs fewer")),
            false => cpu(Some(
                "rendering on the CPU: too few threads, or too little memory, for a Vulkan driver".into(),
            )),
        };
    }
    let time = wanted.timings.then(Arc::<DeviceTime>::default);
    let options = GpuOptions {
        cache_dir: cache_dir(),
        effects: effects.clone(),
        device: wanted.gpu.clone(),
        device_time: time.clone(),
        anisotropy: wanted.anisotropy.map(f32::from),
        ..GpuOptions::default()
    };
    match SteadyRenderer::new(options) {
        Ok(renderer) => Ok(Started { renderer: Box::new(renderer), time, note: None }),
        // A device that is named is the only one wanted.
        Err(error) if device == Device::Vulkan || wanted.gpu.is_some() => Err(render_failure(error)),
        Err(RenderError::NoVulkan { why }) => cpu(Some(on_the_cpu(&why))),
        Err(error) => cpu(Some(on_the_cpu(&error.to_string()))),
    }
}

/// One line: why, and the packages that make it faster.
fn on_the_cpu(why: &str) -> String {
    let why = why.lines().next().unwrap_or_default();
    let packages = match why.contains("mesa-vulkan-drivers") {
        true => "",
        false => "; faster with the packages libvulkan1 and mesa-vulkan-drivers (Debian, Ubuntu)",
    };
    format!("rendering on the CPU: {why}{packages}")
}

/// The folder in which compiled pipelines are kept, so that the next first image comes at once.
pub fn cache_dir() -> Option<PathBuf> {
    let folder = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    folder("XDG_CACHE_HOME")
        .or_else(|| folder("HOME").map(|home| home.join(".cache")))
        .or_else(|| folder("LOCALAPPDATA"))
        .map(|cache| cache.join("choreo"))
}

/// Four, for smooth edges, on every device: even the CPU renderer then draws one Knight at 1280×720 at nine frames a second
/// on two busy cores (21 with one sample), and stairs on edges are the first thing that people see.
pub fn default_samples(device: &DeviceInfo) -> u32 {
    match device.kind {
        DeviceKind::VulkanGpu | DeviceKind::VulkanCpu | DeviceKind::CpuReference => 4,
    }
}
