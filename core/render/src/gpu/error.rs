//! A `vk::Result` becomes an error that names the object.

use crate::RenderError;
use ash::vk;

pub trait Named<T> {
    fn named(self, object: &str) -> Result<T, RenderError>;
}

impl<T> Named<T> for Result<T, vk::Result> {
    fn named(self, object: &str) -> Result<T, RenderError> {
        self.map_err(|r| RenderError::Vulkan { object: object.into(), result: describe(r) })
    }
}

fn describe(r: vk::Result) -> String {
    let more = match r {
        vk::Result::ERROR_OUT_OF_HOST_MEMORY => "the machine is out of memory",
        vk::Result::ERROR_OUT_OF_DEVICE_MEMORY => {
            "the device is out of memory; a smaller picture or fewer textures may fit"
        }
        vk::Result::ERROR_DEVICE_LOST => "the driver gave the device up; the kernel log may say why",
        vk::Result::TIMEOUT => "it did not finish in time",
        _ => return format!("{r:?}"),
    };
    format!("{r:?}: {more}")
}
