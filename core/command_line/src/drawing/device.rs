//! Choice of the renderer: Vulkan where a GPU driver works, else the CPU renderer.
//!
//! A Vulkan driver that runs on the CPU is used only on request: see `core/decisions/30-auto-device.md`.

use crate::args::Device;
use crate::drawing::pipeline::render_failure;
use crate::failure::Failure;
use crate::process::threads::{enough_threads_for_a_driver, too_few_threads};
use choreo_plugin::Effect;
use choreo_render::cpu::{CpuRenderer, StageTimes};
use choreo_render::vulkan::{DeviceTime, GpuOptions, RecoveringRenderer, chosen_device};
use choreo_render::{DeviceInfo, DeviceKind, RenderError, Renderer};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;

/// The requested device.
#[derive(Clone, Debug)]
pub(crate) struct DeviceRequest {
    pub device: Device,
    /// Part of the name of the Vulkan device.
    pub gpu: Option<String>,
    /// Whether the time that the device is busy is measured.
    pub timings: bool,
    /// See `GpuOptions::anisotropy`.
    pub anisotropy: Option<u8>,
}

impl From<Device> for DeviceRequest {
    fn from(device: Device) -> DeviceRequest {
        DeviceRequest { device, gpu: None, timings: false, anisotropy: None }
    }
}

/// A renderer that is ready, with the reasons for its choice.
pub(crate) struct StartedRenderer {
    pub renderer: Box<dyn Renderer>,
    /// The device's time, if it was requested and the device has a clock.
    pub time: Option<Arc<DeviceTime>>,
    /// Time of the CPU renderer's stages, if it was requested.
    pub stages: Option<Arc<StageTimes>>,
    /// Note that explains why no faster device was chosen.
    pub note: Option<String>,
    /// Reason for the choice, for the summary; `None` if the device was named.
    pub reason: Option<String>,
}

/// A renderer that is being started.
pub(crate) enum PendingRenderer {
    OnThread(JoinHandle<Result<StartedRenderer, Failure>>),
    /// No thread could be started: the caller of [`PendingRenderer::wait`] starts the renderer.
    OnWait(DeviceRequest, Vec<Effect>),
}

/// Starts the renderer of the requested device on a thread of its own.
pub(crate) fn start_renderer(request: impl Into<DeviceRequest>, effects: &[Effect]) -> PendingRenderer {
    let (request, effects) = (request.into(), effects.to_vec());
    let (request_of_thread, effects_of_thread) = (request.clone(), effects.clone());
    let thread = std::thread::Builder::new()
        .name("device".into())
        .spawn(move || create_renderer(request_of_thread, effects_of_thread));
    match thread {
        Ok(thread) => PendingRenderer::OnThread(thread),
        Err(_) => PendingRenderer::OnWait(request, effects),
    }
}

impl PendingRenderer {
    pub(crate) fn wait(self) -> Result<StartedRenderer, Failure> {
        let failed =
            |_| Err(Failure::Device("the thread that starts the renderer failed; try --device cpu".into()));
        match self {
            PendingRenderer::OnThread(thread) => thread.join().unwrap_or_else(failed),
            PendingRenderer::OnWait(request, effects) => create_renderer(request, effects),
        }
    }
}

fn create_renderer(request: DeviceRequest, effects: Vec<Effect>) -> Result<StartedRenderer, Failure> {
    let device = request.device;
    let cpu = |note, reason| {
        let renderer = CpuRenderer::new(&effects);
        let stages = request.timings.then(|| renderer.stage_times());
        Ok(StartedRenderer { renderer: Box::new(renderer), time: None, stages, note, reason })
    };
    if device == Device::Cpu {
        return cpu(None, None);
    }
    if !enough_threads_for_a_driver() {
        return match device == Device::Vulkan || request.gpu.is_some() {
            true => Err(too_few_threads("a Vulkan driver needs more of them; --device cpu needs fewer")),
            false => {
                let why = "rendering on the CPU: too few threads, or too little memory, for a Vulkan driver";
                cpu(Some(why.into()), None)
            }
        };
    }
    let auto = device == Device::Auto && request.gpu.is_none();
    let found = auto.then(chosen_device).and_then(Result::ok);
    if let Some(found) = found.as_ref().filter(|found| found.kind == DeviceKind::VulkanCpu) {
        return cpu(None, Some(software_vulkan_reason(&found.name)));
    }
    let time = request.timings.then(Arc::<DeviceTime>::default);
    let options = GpuOptions {
        cache_dir: cache_dir(),
        effects: effects.clone(),
        device: request.gpu.clone(),
        device_time: time.clone(),
        anisotropy: request.anisotropy.map(f32::from),
        ..GpuOptions::default()
    };
    match RecoveringRenderer::new(options) {
        Ok(renderer) => {
            let reason = found.map(|_| "the fastest Vulkan device".to_string());
            Ok(StartedRenderer { renderer: Box::new(renderer), time, stages: None, note: None, reason })
        }
        // A device that is named must be used: there is no fallback to the CPU.
        Err(error) if device == Device::Vulkan || request.gpu.is_some() => Err(render_failure(error)),
        Err(RenderError::NoVulkan { why }) => cpu(Some(cpu_fallback_note(&why)), None),
        Err(error) => cpu(Some(cpu_fallback_note(&error.to_string())), None),
    }
}

/// Reason why a Vulkan driver that runs on the CPU is not used unless it is named. `name`: name of its device.
pub fn software_vulkan_reason(name: &str) -> String {
    let name = name.split(" (").next().unwrap_or_default();
    format!("the only Vulkan device, {name}, draws on the CPU and is slower")
}

/// Note that rendering happens on the CPU: the reason, and the packages to install for a faster device.
fn cpu_fallback_note(why: &str) -> String {
    let why = why.lines().next().unwrap_or_default();
    let packages = match why.contains("mesa-vulkan-drivers") {
        true => "",
        false => "; faster with the packages libvulkan1 and mesa-vulkan-drivers (Debian, Ubuntu)",
    };
    format!("rendering on the CPU: {why}{packages}")
}

/// Folder of the pipeline cache, so that the first image of the next run appears at once.
pub fn cache_dir() -> Option<PathBuf> {
    Some(choreo_files::user_folder("XDG_CACHE_HOME", ".cache")?.join("choreo"))
}

/// Default samples per pixel: four on every device, since aliased edges are the first defect that people see. With four samples the CPU renderer
/// draws one Knight at 1280×720 at nine frames per second on two busy cores; with one sample, at 21.
pub(crate) fn default_samples(device: &DeviceInfo) -> u32 {
    match device.kind {
        DeviceKind::VulkanGpu | DeviceKind::VulkanCpu | DeviceKind::CpuReference => 4,
    }
}
