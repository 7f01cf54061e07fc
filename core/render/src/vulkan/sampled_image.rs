//! An image that the device draws and then samples, with its own sampler.

use super::context::Context;
use super::error::Named;
use super::memory::{Image, ImageDesc};
use crate::error::RenderError;
use ash::vk;

pub(crate) struct SampledImage {
    pub image: Image,
    pub sampler: vk::Sampler,
}

impl SampledImage {
    /// Creates the image and a sampler that clamps to the edge.
    pub(super) fn new(
        gpu: &Context,
        desc: &ImageDesc<'_>,
        sampler: vk::SamplerCreateInfo<'_>,
    ) -> Result<SampledImage, RenderError> {
        let sampler = sampler
            .address_mode_u(vk::SamplerAddressMode::CLAMP_TO_EDGE)
            .address_mode_v(vk::SamplerAddressMode::CLAMP_TO_EDGE)
            .address_mode_w(vk::SamplerAddressMode::CLAMP_TO_EDGE);
        let mut image = Image::new(gpu, desc)?;
        // SAFETY: the device is alive; destroyed by `destroy`.
        match unsafe { gpu.device.create_sampler(&sampler, None) }.named(&format!("sampler of {}", desc.name))
        {
            Ok(sampler) => Ok(SampledImage { image, sampler }),
            Err(e) => {
                image.destroy(gpu);
                Err(e)
            }
        }
    }

    /// Destroys the image and its sampler. No frame may be in flight.
    pub(super) fn destroy(&mut self, gpu: &Context) {
        self.image.destroy(gpu);
        // SAFETY: made from this device, no longer used.
        unsafe { gpu.device.destroy_sampler(self.sampler, None) };
        self.sampler = vk::Sampler::null();
    }
}
