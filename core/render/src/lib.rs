//! Plan → recording → frame. The plan says what a frame needs and what was left out; the Vulkan renderer
//! (`gpu`, the only place that knows ash) and its CPU twin (`cpu`, the specification of each shader) draw the same plan.

pub mod commands;
pub mod cpu;
pub mod explain;
pub mod layers_2d;
pub mod plan;
pub mod renderer;
pub mod scene_resources;
pub mod shader;
pub mod sky;
#[allow(unsafe_code, reason = "calls of Vulkan")]
pub mod vulkan;

pub use cpu::CpuRenderer;
pub use plan::Plan;
pub use plan::build::effects::effect_parameters;
pub use plan::options::PlanOptions;
pub use renderer::{DeviceInfo, DeviceKind, Held, RenderError, Renderer, Work};
pub use scene_resources::Catalog;
pub use vulkan::{GpuOptions, SteadyRenderer, VulkanRenderer};
