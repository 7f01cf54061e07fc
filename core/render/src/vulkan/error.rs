//! Converts a `vk::Result` to an error that names the object.

use super::TIMEOUT_SECS;
use crate::error::RenderError;
use ash::vk;

pub(super) trait Named<T> {
    fn named(self, object: &str) -> Result<T, RenderError>;
}

impl<T> Named<T> for Result<T, vk::Result> {
    fn named(self, object: &str) -> Result<T, RenderError> {
        self.map_err(|r| {
            let object = object.to_string();
            match r {
                vk::Result::ERROR_DEVICE_LOST => RenderError::DeviceLost { object },
                vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
                    RenderError::OutOfMemory { object }
                }
                vk::Result::TIMEOUT => RenderError::TimedOut { object, secs: TIMEOUT_SECS },
                _ => RenderError::Vulkan { object, result: format!("{r:?}") },
            }
        })
    }
}
