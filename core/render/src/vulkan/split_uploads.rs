//! Uploads of a frugal renderer.

use super::error::Named;
use super::upload::Uploads;
use super::{MAX_FRUGAL_UPLOAD_BYTES, VulkanRenderer};
use crate::error::RenderError;
use ash::vk;

impl VulkanRenderer {
    /// Sends uploads ahead of their frame in small parts, and waits for each before the next is made.
    pub(super) fn upload_in_parts(&mut self, index: usize, uploads: Uploads) -> Result<(), RenderError> {
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        for part in uploads.split(MAX_FRUGAL_UPLOAD_BYTES) {
            let (pool, commands) = (self.frames[index].pool, self.frames[index].commands);
            // SAFETY: the slot's last commands are done.
            unsafe {
                let device = &self.gpu.device;
                device.reset_command_pool(pool, vk::CommandPoolResetFlags::empty()).named("command pool")?;
                device.begin_command_buffer(commands, &begin).named("upload commands")?;
            }
            self.frames[index].staging = Some(part.record(&self.gpu, commands)?);
            // SAFETY: recording was begun above.
            unsafe { self.gpu.device.end_command_buffer(commands) }.named("upload commands")?;
            self.submit_commands(index)?;
            self.wait_idle()?;
            self.frames[index].release_staging(&self.gpu);
        }
        Ok(())
    }
}
