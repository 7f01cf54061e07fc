//! Plan → recording → frame. The plan says what a frame needs and what was left out; the Vulkan renderer
//! (`gpu`, the only place that knows ash) and its CPU twin (`cpu`, the specification of each shader) draw the same plan.

pub mod area;
pub mod bounds;
pub mod catalog;
pub mod compare;
pub mod content;
pub mod cpu;
pub mod detail;
pub mod explain;
pub mod exposure;
pub mod flat;
pub mod flip;
pub mod gpu;
pub mod gpu_types;
pub mod light_lists;
pub mod mip;
mod needs;
mod needs_layers;
pub mod plan;
mod plan_options;
mod plan_post;
mod planner;
mod planner_effects;
mod planner_glass;
mod planner_items;
mod planner_lights;
mod planner_overlay;
mod planner_shadows;
mod planner_skins;
pub mod record;
mod record_text;
pub mod renderer;
pub mod shader;
mod shadows;
pub mod sky;
mod textures_fit;
pub mod vertex;
pub mod view;

pub use catalog::Catalog;
pub use cpu::CpuRenderer;
pub use gpu::{GpuOptions, SteadyRenderer, VulkanRenderer};
pub use plan::Plan;
pub use plan_options::PlanOptions;
pub use planner_effects::effect_parameters;
pub use renderer::{DeviceInfo, DeviceKind, Held, RenderError, Renderer, Work};
