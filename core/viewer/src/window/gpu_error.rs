//! Vulkan errors with the name of the operation or object that failed.

use ash::vk;
use thiserror::Error;

#[derive(Debug, Error)]
pub(crate) enum GpuError {
    #[error("Vulkan is not available: {0}")]
    Unavailable(String),
    /// The only driver draws on the CPU, and the user did not ask for Vulkan by name.
    #[error("{0}")]
    SoftwareOnly(String),
    #[error("Vulkan: {object}: {result:?}")]
    Vulkan { object: &'static str, result: vk::Result },
    #[error("Vulkan: {object}: {text}")]
    Other { object: &'static str, text: String },
}

pub(super) trait ForObject<T> {
    fn for_object(self, object: &'static str) -> Result<T, GpuError>;
}

impl<T> ForObject<T> for Result<T, vk::Result> {
    fn for_object(self, object: &'static str) -> Result<T, GpuError> {
        self.map_err(|result| GpuError::Vulkan { object, result })
    }
}

impl<T> ForObject<T> for Result<T, gpu_allocator::AllocationError> {
    fn for_object(self, object: &'static str) -> Result<T, GpuError> {
        self.map_err(|e| GpuError::Other { object, text: e.to_string() })
    }
}

impl<T> ForObject<T> for Result<T, egui_ash_renderer::RendererError> {
    fn for_object(self, object: &'static str) -> Result<T, GpuError> {
        self.map_err(|e| GpuError::Other { object, text: e.to_string() })
    }
}
