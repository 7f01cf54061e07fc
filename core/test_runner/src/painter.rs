//! Draws the image of a stage at a time: with the CPU renderer, which gives the same bytes on every machine, or with Vulkan.

use choreo_motion::Time;
use choreo_plugin::{Effect, Frame};
use choreo_render::plan::motion_blur::plan_at;
use choreo_render::{
    CpuRenderer, DeviceInfo, DeviceKind, GpuOptions, PlanOptions, RenderError, Renderer, SceneResources,
    VulkanRenderer,
};
use choreo_stage::{Evaluator, Stage};
use std::path::PathBuf;
use std::sync::Arc;

/// Largest number of pixels of a test image, so that a mistyped size does not fill the memory.
pub const MAX_PIXELS: u64 = 4 << 20;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Device {
    /// The CPU renderer, which draws all test images unless scripts name another device.
    #[default]
    Cpu,
    Vulkan,
}

/// Reason why there is no image.
#[derive(Clone, Debug, PartialEq)]
pub enum DrawError {
    /// This machine has no such device; the message says what to install.
    NoDevice(String),
    Failed(String),
}

/// Renderers of one worker thread, started when they are first used.
pub struct Painter {
    effects: Vec<Effect>,
    /// Folder for the pipeline cache, kept between runs.
    gpu_cache: Option<PathBuf>,
    /// Whether Vulkan runs under the validation layer; each of its messages makes an image fail.
    pub validation: bool,
    cpu: Option<CpuRenderer>,
    vulkan: Option<Result<Box<VulkanRenderer>, DrawError>>,
    /// Stage that each renderer has loaded: consecutive images often show the same stage.
    loaded: [Option<(Arc<Stage>, Arc<SceneResources>)>; 2],
}

/// An image to draw.
#[derive(Clone, Debug)]
pub struct ImageRequest {
    pub at: Time,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Samples per pixel: 1 or 4.
    pub samples: u32,
    pub device: Device,
}

impl Painter {
    pub fn new(effects: &[Effect], gpu_cache: Option<PathBuf>) -> Painter {
        Painter {
            effects: effects.to_vec(),
            gpu_cache,
            validation: false,
            cpu: None,
            vulkan: None,
            loaded: [None, None],
        }
    }

    /// Sets the effects for the following images: those of the program and of the plugin files that a section uses.
    pub fn set_effects(&mut self, effects: &[Effect]) -> Result<(), DrawError> {
        let unchanged = self.effects.len() == effects.len()
            && self.effects.iter().zip(effects).all(|(a, b)| a.is_same(b));
        if unchanged {
            return Ok(());
        }
        self.effects = effects.to_vec();
        let failed = |e: RenderError| DrawError::Failed(e.to_string());
        if let Some(cpu) = &mut self.cpu {
            cpu.set_effects(effects).map_err(failed)?;
        }
        if let Some(Ok(vulkan)) = &mut self.vulkan {
            vulkan.set_effects(effects).map_err(failed)?;
        }
        Ok(())
    }

    /// Draws an image. Returns it with the class of the device that drew it (see [`device_class`]).
    pub fn draw(&mut self, stage: &Arc<Stage>, request: &ImageRequest) -> Result<(Frame, String), DrawError> {
        let [width, height] = request.size;
        let pixels = u64::from(width) * u64::from(height);
        if pixels == 0 || pixels > MAX_PIXELS {
            return Err(DrawError::Failed(format!(
                "a test image of {width}x{height} pixels: it must have 1 to {MAX_PIXELS} pixels; give another size: #{{ size: [256, 144] }}"
            )));
        }
        let mut stage = stage.clone();
        if stage.settings.size != request.size {
            // The size is set on the stage too, since automatic camera framing depends on the image's aspect ratio.
            Arc::make_mut(&mut stage).settings.size = request.size;
        }
        let failed = |e: RenderError| DrawError::Failed(e.to_string());
        let slot = usize::from(request.device == Device::Vulkan);
        let effects = self.effects.clone();
        let loaded = self.loaded[slot].take().filter(|(s, _)| have_same_assets(s, &stage));
        let renderer: &mut dyn Renderer = match request.device {
            Device::Cpu => self.cpu.get_or_insert_with(|| CpuRenderer::new(&effects)),
            Device::Vulkan => {
                let cache_dir = self.gpu_cache.clone();
                let validation = self.validation;
                let effects = effects.clone();
                let start =
                    || start_vulkan(GpuOptions { validation, cache_dir, effects, ..GpuOptions::default() });
                match self.vulkan.get_or_insert_with(start) {
                    Ok(renderer) => renderer.as_mut(),
                    Err(why) => return Err(why.clone()),
                }
            }
        };
        let resources = match loaded {
            Some((_, resources)) => resources,
            None => {
                let resources = Arc::new(SceneResources::new(&stage));
                renderer.load(resources.clone()).map_err(failed)?;
                resources
            }
        };
        let options =
            PlanOptions { effects: &self.effects, ..PlanOptions::new(request.size, request.samples) };
        let planned = plan_at(&resources, &mut Evaluator::new(stage.clone()), request.at, &options, None);
        let (_, plan) = planned.map_err(|e| DrawError::Failed(e.to_string()))?;
        renderer.submit(plan).map_err(failed)?;
        let frame = renderer.collect(None).map_err(failed)?;
        let class = device_class(renderer.device());
        self.loaded[slot] = Some((stage, resources));
        Ok((frame, class))
    }
}

/// Whether two stages can share scene resources: they have the same assets in the same order.
fn have_same_assets(a: &Stage, b: &Stage) -> bool {
    a.actors.len() == b.actors.len()
        && a.actors.iter().zip(&b.actors).all(|(a, b)| Arc::ptr_eq(&a.asset, &b.asset))
}

fn start_vulkan(options: GpuOptions) -> Result<Box<VulkanRenderer>, DrawError> {
    match VulkanRenderer::new(options) {
        Ok(renderer) => Ok(Box::new(renderer)),
        Err(RenderError::NoVulkan { why }) => {
            Err(DrawError::NoDevice(format!("no Vulkan: {}", why.lines().next().unwrap_or_default())))
        }
        Err(e) => Err(DrawError::Failed(e.to_string())),
    }
}

/// Class of a device. Images of the same class are compared by default: `cpu`, which is the same everywhere, or `vulkan:DEVICE/DRIVER` with
/// the driver's version.
pub fn device_class(info: &DeviceInfo) -> String {
    match info.kind {
        DeviceKind::CpuReference => "cpu".to_string(),
        DeviceKind::VulkanCpu | DeviceKind::VulkanGpu => format!("vulkan:{}/{}", info.name, info.driver),
    }
}
