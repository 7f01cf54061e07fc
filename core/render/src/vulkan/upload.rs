//! Uploads to the device: collected while a frame is prepared, and copied through one staging buffer at its start.

use super::context::Context;
use super::memory::{Buffer, all_mip_levels};
use crate::error::RenderError;
use ash::vk;

#[derive(Default)]
pub(crate) struct Uploads {
    bytes: Vec<u8>,
    buffers: Vec<(vk::Buffer, u64, u64)>,
    images: Vec<ImageUpload>,
}

struct ImageUpload {
    image: vk::Image,
    levels: Vec<vk::BufferImageCopy>,
    /// Bytes per texel.
    texel_bytes: usize,
}

impl Uploads {
    pub(crate) fn is_empty(&self) -> bool {
        self.buffers.is_empty() && self.images.is_empty()
    }

    fn append(&mut self, bytes: &[u8]) -> u64 {
        // Copies into images of 4-byte texels need offsets that are multiples of 4; 16 suits every device.
        self.bytes.resize(self.bytes.len().next_multiple_of(16), 0);
        let at = self.bytes.len() as u64;
        self.bytes.extend_from_slice(bytes);
        at
    }

    pub(crate) fn add_buffer(&mut self, to: vk::Buffer, bytes: &[u8]) {
        let at = self.append(bytes);
        self.buffers.push((to, at, bytes.len() as u64));
    }

    /// Adds an image: (width, height, bytes) of each level, the largest first.
    pub(crate) fn add_image<'a>(
        &mut self,
        to: vk::Image,
        levels: impl Iterator<Item = (u32, u32, &'a [u8])>,
    ) {
        let mut texel = 4;
        let levels = levels
            .enumerate()
            .map(|(i, (width, height, bytes))| {
                texel = bytes.len() / (width as usize * height as usize).max(1);
                let at = self.append(bytes);
                vk::BufferImageCopy::default()
                    .buffer_offset(at)
                    .image_subresource(
                        vk::ImageSubresourceLayers::default()
                            .aspect_mask(vk::ImageAspectFlags::COLOR)
                            .mip_level(i as u32)
                            .layer_count(1),
                    )
                    .image_extent(vk::Extent3D { width, height, depth: 1 })
            })
            .collect();
        self.images.push(ImageUpload { image: to, levels, texel_bytes: texel });
    }

    /// Splits the uploads into parts of at most `bytes` each, unless a single buffer or image is larger.
    pub(crate) fn split(self, bytes: usize) -> Vec<Uploads> {
        let mut full_parts = Vec::new();
        let mut part = Uploads::default();
        for (to, at, size) in &self.buffers {
            part = part.start_part_if_full(*size as usize, bytes, &mut full_parts);
            part.add_buffer(*to, &self.bytes[*at as usize..(*at + *size) as usize]);
        }
        for image in &self.images {
            let sizes = image
                .levels
                .iter()
                .map(|l| l.image_extent.width as usize * l.image_extent.height as usize * image.texel_bytes);
            part = part.start_part_if_full(sizes.clone().sum(), bytes, &mut full_parts);
            let levels = image.levels.iter().zip(sizes).map(|(level, size)| {
                let at = level.buffer_offset as usize;
                (level.image_extent.width, level.image_extent.height, &self.bytes[at..at + size])
            });
            part.add_image(image.image, levels);
        }
        full_parts.push(part);
        full_parts
    }

    fn start_part_if_full(self, size: usize, max_bytes: usize, full_parts: &mut Vec<Uploads>) -> Uploads {
        if self.bytes.is_empty() || self.bytes.len() + size <= max_bytes {
            return self;
        }
        full_parts.push(self);
        Uploads::default()
    }

    /// Records the copies; the staging buffer must live until the commands have run.
    pub(crate) fn record(self, gpu: &Context, commands: vk::CommandBuffer) -> Result<Buffer, RenderError> {
        let mut staging = Buffer::staging(gpu, self.bytes.len() as u64)?;
        staging.mapped_mut()[..self.bytes.len()].copy_from_slice(&self.bytes);
        let to_write: Vec<_> = self
            .images
            .iter()
            .map(|i| {
                vk::ImageMemoryBarrier2::default()
                    .dst_stage_mask(vk::PipelineStageFlags2::COPY)
                    .dst_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
                    .new_layout(vk::ImageLayout::TRANSFER_DST_OPTIMAL)
                    .image(i.image)
                    .subresource_range(all_mip_levels(vk::ImageAspectFlags::COLOR))
            })
            .collect();
        let to_read: Vec<_> = self
            .images
            .iter()
            .map(|i| {
                vk::ImageMemoryBarrier2::default()
                    .src_stage_mask(vk::PipelineStageFlags2::COPY)
                    .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
                    .dst_stage_mask(
                        vk::PipelineStageFlags2::VERTEX_SHADER | vk::PipelineStageFlags2::FRAGMENT_SHADER,
                    )
                    .dst_access_mask(vk::AccessFlags2::SHADER_SAMPLED_READ)
                    .old_layout(vk::ImageLayout::TRANSFER_DST_OPTIMAL)
                    .new_layout(vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL)
                    .image(i.image)
                    .subresource_range(all_mip_levels(vk::ImageAspectFlags::COLOR))
            })
            .collect();
        let buffers_written = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::COPY)
            .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
            .dst_stage_mask(
                vk::PipelineStageFlags2::VERTEX_INPUT
                    | vk::PipelineStageFlags2::VERTEX_SHADER
                    | vk::PipelineStageFlags2::FRAGMENT_SHADER
                    | vk::PipelineStageFlags2::COMPUTE_SHADER,
            )
            .dst_access_mask(
                vk::AccessFlags2::VERTEX_ATTRIBUTE_READ
                    | vk::AccessFlags2::INDEX_READ
                    | vk::AccessFlags2::SHADER_STORAGE_READ
                    | vk::AccessFlags2::UNIFORM_READ,
            )];
        // SAFETY: the command buffer is being recorded; source and targets are alive, ranges lie inside them.
        unsafe {
            let device = &gpu.device;
            if !to_write.is_empty() {
                let before = vk::DependencyInfo::default().image_memory_barriers(&to_write);
                device.cmd_pipeline_barrier2(commands, &before);
            }
            for (to, at, size) in &self.buffers {
                let region = [vk::BufferCopy { src_offset: *at, dst_offset: 0, size: *size }];
                device.cmd_copy_buffer(commands, staging.raw, *to, &region);
            }
            for i in &self.images {
                device.cmd_copy_buffer_to_image(
                    commands,
                    staging.raw,
                    i.image,
                    vk::ImageLayout::TRANSFER_DST_OPTIMAL,
                    &i.levels,
                );
            }
            let after = vk::DependencyInfo::default()
                .image_memory_barriers(&to_read)
                .memory_barriers(&buffers_written);
            device.cmd_pipeline_barrier2(commands, &after);
        }
        Ok(staging)
    }
}
