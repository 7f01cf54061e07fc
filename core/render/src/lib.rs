//! Plan → recording → frame. The plan says what a frame needs and what was left out; the Vulkan renderer
//! (`gpu`, the only place that knows ash) and its CPU twin (`cpu`, the specification of each shader) draw the same plan.

pub mod catalog;
pub mod plan;
pub mod renderer;

pub use catalog::Catalog;
pub use plan::Plan;
pub use renderer::{DeviceInfo, DeviceKind, RenderError, Renderer};
