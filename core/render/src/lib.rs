//! Renders one frame of a stage: `Plan` (what the frame needs, and what is left out) → commands → pixels.
//!
//! Two renderers draw the same plan: [`vulkan`], the only module that uses ash, and [`cpu`], the reference for every shader.
//! Modules import in one direction: [`view`] ← [`scene_resources`] ← [`sky`], [`layers_2d`], `dither` ← [`plan`] ← [`shader`] ←
//! [`commands`] ← [`cpu`] ← [`vulkan`] ← [`explain`].

pub mod affine;
pub mod commands;
pub mod cpu;
mod dither;
mod effect_faults;
pub(crate) mod error;
pub mod explain;
mod lanes;
pub mod layers_2d;
pub mod plan;
pub mod renderer;
pub mod scene_resources;
pub mod shader;
pub mod sky;
pub mod view;
#[allow(unsafe_code, reason = "calls of Vulkan")]
pub mod vulkan;

pub use cpu::CpuRenderer;
pub use error::RenderError;
pub use plan::Plan;
pub use plan::build::effects::effect_parameters;
pub use plan::options::PlanOptions;
pub use renderer::{CreatedCounts, DeviceInfo, DeviceKind, DeviceUsage, Renderer};
pub use scene_resources::SceneResources;
pub use vulkan::{GpuOptions, RecoveringRenderer, VulkanRenderer};
