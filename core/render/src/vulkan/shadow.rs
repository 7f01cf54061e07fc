//! The image of all shadow maps, and how shaders compare with it.

use super::context::Context;
use super::error::Named;
use super::memory::{Image, ImageDesc};
use super::targets::DEPTH;
use crate::error::RenderError;
use ash::vk;

pub(crate) struct ShadowTarget {
    pub image: Image,
    pub sampler: vk::Sampler,
}

impl ShadowTarget {
    pub fn new(gpu: &Context, [width, height]: [u32; 2]) -> Result<ShadowTarget, RenderError> {
        // Gathers compare texel by texel: lit where what is asked is as near to the light as what is stored, or nearer.
        let info = vk::SamplerCreateInfo::default()
            .address_mode_u(vk::SamplerAddressMode::CLAMP_TO_EDGE)
            .address_mode_v(vk::SamplerAddressMode::CLAMP_TO_EDGE)
            .address_mode_w(vk::SamplerAddressMode::CLAMP_TO_EDGE)
            .compare_enable(true)
            .compare_op(vk::CompareOp::GREATER_OR_EQUAL);
        let mut image = Image::new(
            gpu,
            &ImageDesc {
                name: "shadow maps",
                width,
                height,
                levels: 1,
                samples: 1,
                format: DEPTH,
                usage: vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT | vk::ImageUsageFlags::SAMPLED,
                aspect: vk::ImageAspectFlags::DEPTH,
            },
        )?;
        // SAFETY: the device is alive; destroyed by `destroy`.
        match unsafe { gpu.device.create_sampler(&info, None) }.named("shadow sampler") {
            Ok(sampler) => Ok(ShadowTarget { image, sampler }),
            Err(e) => {
                image.destroy(gpu);
                Err(e)
            }
        }
    }

    /// No frame may be in flight.
    pub fn destroy(&mut self, gpu: &Context) {
        self.image.destroy(gpu);
        // SAFETY: made from this device, no longer used.
        unsafe { gpu.device.destroy_sampler(self.sampler, None) };
        self.sampler = vk::Sampler::null();
    }
}
