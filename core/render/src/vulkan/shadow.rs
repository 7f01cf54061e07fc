//! The image of all shadow maps, and how shaders compare with it.

use super::context::Context;
use super::memory::ImageDesc;
use super::sampled_image::SampledImage;
use super::targets::DEPTH;
use crate::error::RenderError;
use ash::vk;

pub(crate) fn shadow_maps(gpu: &Context, [width, height]: [u32; 2]) -> Result<SampledImage, RenderError> {
    let desc = ImageDesc {
        name: "shadow maps",
        width,
        height,
        levels: 1,
        samples: 1,
        format: DEPTH,
        usage: vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT | vk::ImageUsageFlags::SAMPLED,
        aspect: vk::ImageAspectFlags::DEPTH,
    };
    // Gathers compare texel by texel: lit where what is asked is as near to the light as what is stored, or nearer.
    let sampler =
        vk::SamplerCreateInfo::default().compare_enable(true).compare_op(vk::CompareOp::GREATER_OR_EQUAL);
    SampledImage::new(gpu, &desc, sampler)
}
