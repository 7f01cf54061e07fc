//! The scene color copy for refraction, with enough mip levels for the blur of the roughest refracting surface.

use super::context::Context;
use super::execute::{Execution, color_barrier};
use super::memory::{Image, ImageDesc};
use super::sampled_image::SampledImage;
use super::targets::FLOAT_FORMAT;
use crate::commands::Target;
use crate::error::RenderError;
use ash::vk;

/// Creates the copy. Its format is float, whatever the image's, so that the levels do not accumulate rounding.
pub(crate) fn scene_color_image(
    gpu: &Context,
    [width, height]: [u32; 2],
    levels: u32,
) -> Result<SampledImage, RenderError> {
    use vk::ImageUsageFlags as U;
    let desc = ImageDesc {
        name: "scene color copy",
        width,
        height,
        levels,
        samples: 1,
        format: FLOAT_FORMAT,
        usage: U::SAMPLED | U::TRANSFER_SRC | U::TRANSFER_DST,
        aspect: vk::ImageAspectFlags::COLOR,
    };
    let sampler = vk::SamplerCreateInfo::default()
        .mag_filter(vk::Filter::LINEAR)
        .min_filter(vk::Filter::LINEAR)
        .mipmap_mode(vk::SamplerMipmapMode::LINEAR)
        .max_lod(vk::LOD_CLAMP_NONE);
    SampledImage::new(gpu, &desc, sampler)
}

impl Execution<'_> {
    /// Copies the scene color between two passes. The target keeps its contents.
    pub(super) fn copy_scene_color(&self, from: Target) -> Result<(), RenderError> {
        let (Some(destination), Some(levels)) =
            (&self.targets.scene_color_copy, self.targets.needs.scene_color_copy)
        else {
            return Err(RenderError::Usage("the scene color copy was not prepared".into()));
        };
        let (source, copy) = (self.targets.image(from), &destination.image);
        use vk::{AccessFlags2 as A, ImageLayout as L, PipelineStageFlags2 as S};
        self.barriers(&[
            color_barrier(source)
                .src_stage_mask(S::COLOR_ATTACHMENT_OUTPUT)
                .src_access_mask(A::COLOR_ATTACHMENT_WRITE)
                .dst_stage_mask(S::BLIT)
                .dst_access_mask(A::TRANSFER_READ)
                .old_layout(L::COLOR_ATTACHMENT_OPTIMAL)
                .new_layout(L::TRANSFER_SRC_OPTIMAL),
            // The previous frame may still read the copy.
            color_barrier(copy)
                .src_stage_mask(S::FRAGMENT_SHADER)
                .dst_stage_mask(S::BLIT)
                .dst_access_mask(A::TRANSFER_WRITE)
                .new_layout(L::TRANSFER_DST_OPTIMAL),
        ]);
        let size = self.targets.needs.size;
        let half = |level: u32| size.map(|side| (side >> level).max(1));
        self.blit(source, (0, size), copy, (0, size), vk::Filter::NEAREST);
        for level in 0..levels {
            self.barriers(&[level_barrier(copy, level)
                .src_stage_mask(S::BLIT)
                .src_access_mask(A::TRANSFER_WRITE)
                .dst_stage_mask(S::BLIT)
                .dst_access_mask(A::TRANSFER_READ)
                .old_layout(L::TRANSFER_DST_OPTIMAL)
                .new_layout(L::TRANSFER_SRC_OPTIMAL)]);
            if level + 1 < levels {
                let (above, below) = ((level, half(level)), (level + 1, half(level + 1)));
                self.blit(copy, above, copy, below, vk::Filter::LINEAR);
            }
        }
        self.barriers(&[
            color_barrier(copy)
                .src_stage_mask(S::BLIT)
                .src_access_mask(A::TRANSFER_WRITE)
                .dst_stage_mask(S::FRAGMENT_SHADER)
                .dst_access_mask(A::SHADER_SAMPLED_READ)
                .old_layout(L::TRANSFER_SRC_OPTIMAL)
                .new_layout(L::SHADER_READ_ONLY_OPTIMAL),
            color_barrier(source)
                .src_stage_mask(S::BLIT)
                .dst_stage_mask(S::COLOR_ATTACHMENT_OUTPUT)
                .dst_access_mask(A::COLOR_ATTACHMENT_WRITE | A::COLOR_ATTACHMENT_READ)
                .old_layout(L::TRANSFER_SRC_OPTIMAL)
                .new_layout(L::COLOR_ATTACHMENT_OPTIMAL),
        ]);
        Ok(())
    }

    /// Copies a whole level of one image to a whole level of another, scaling if the sizes differ. (level, size in texels).
    fn blit(
        &self,
        from: &Image,
        (from_level, from_size): (u32, [u32; 2]),
        to: &Image,
        (to_level, to_size): (u32, [u32; 2]),
        filter: vk::Filter,
    ) {
        let layers = |level: u32| vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            mip_level: level,
            base_array_layer: 0,
            layer_count: 1,
        };
        let corners = |[width, height]: [u32; 2]| {
            [vk::Offset3D::default(), vk::Offset3D { x: width as i32, y: height as i32, z: 1 }]
        };
        let region = [vk::ImageBlit::default()
            .src_subresource(layers(from_level))
            .src_offsets(corners(from_size))
            .dst_subresource(layers(to_level))
            .dst_offsets(corners(to_size))];
        // SAFETY: the command buffer is being recorded, outside a pass; both images are in the layouts named, and Vulkan
        // promises that both formats can be copied and filtered so.
        unsafe {
            self.gpu.device.cmd_blit_image(
                self.frame.commands,
                from.raw,
                vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
                to.raw,
                vk::ImageLayout::TRANSFER_DST_OPTIMAL,
                &region,
                filter,
            );
        }
    }
}

fn level_barrier(image: &Image, level: u32) -> vk::ImageMemoryBarrier2<'static> {
    let barrier = color_barrier(image);
    let range =
        vk::ImageSubresourceRange { base_mip_level: level, level_count: 1, ..barrier.subresource_range };
    barrier.subresource_range(range)
}
