//! The inputs of effects on images: their targets, the pass that draws them, and the read-back to the host, where effects run on
//! the mean of several images or on an image assembled from tiles.

use super::VulkanRenderer;
use super::execute::{
    Execution, barrier_color_to_sampled, barrier_to_color_target, barrier_to_depth_target, color_attachment,
    color_barrier, depth_attachment,
};
use super::memory::Image;
use crate::cpu::scene_inputs::InputImages;
use crate::error::RenderError;
use crate::plan::Plan;
use crate::plan::tiles::{Tile, tiles};
use ash::vk;
use choreo_plugin::SceneImages;
use glam::Vec4;

/// Format of the color targets, which Vulkan guarantees as a color attachment on every device.
pub(crate) const FORMAT: vk::Format = vk::Format::R32G32B32A32_SFLOAT;
/// Bytes per pixel of one target.
const TARGET_PIXEL_BYTES: usize = 16;

impl Execution<'_> {
    /// Begins the pass of the inputs.
    pub(super) fn begin_inputs(&self) -> Result<(), RenderError> {
        let targets = self.targets;
        let missing = || RenderError::Usage("the targets of inputs were not prepared".into());
        let depth = targets.input_depth.as_ref().ok_or_else(missing)?;
        let mut barriers: Vec<_> = targets.inputs.iter().map(barrier_to_color_target).collect();
        barriers.push(barrier_to_depth_target(depth));
        self.barriers(&barriers);
        let cleared = [SceneImages::NO_SURFACE, Vec4::ZERO];
        use vk::{AttachmentLoadOp as Load, AttachmentStoreOp as Store};
        let color = |(image, clear): (&Image, Vec4)| {
            let float32 = clear.to_array();
            color_attachment(image.view, Load::CLEAR, Store::STORE)
                .clear_value(vk::ClearValue { color: vk::ClearColorValue { float32 } })
        };
        let colors: Vec<_> = targets.inputs.iter().zip(cleared).map(color).collect();
        self.begin(&colors, Some(&depth_attachment(depth, Load::CLEAR, Store::DONT_CARE)), None);
        self.bind_scene_sets();
        Ok(())
    }

    /// Ends the pass of the inputs and makes its targets readable.
    pub(super) fn end_inputs(&self) {
        // SAFETY: `begin_inputs` began it.
        unsafe { self.gpu.device.cmd_end_rendering(self.frame.commands) };
        self.barriers(&self.targets.inputs.iter().map(barrier_color_to_sampled).collect::<Vec<_>>());
    }

    /// Copies the targets into the read-back buffer, one after the other.
    pub(super) fn read_back_inputs(&self) {
        let Some(readback) = &self.frame.readback else { return };
        let [width, height] = self.targets.needs.size;
        for (i, image) in self.targets.inputs.iter().enumerate() {
            self.barriers(&[color_barrier(image)
                .src_stage_mask(vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT)
                .src_access_mask(vk::AccessFlags2::COLOR_ATTACHMENT_WRITE)
                .dst_stage_mask(vk::PipelineStageFlags2::COPY)
                .dst_access_mask(vk::AccessFlags2::TRANSFER_READ)
                .old_layout(vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL)
                .new_layout(vk::ImageLayout::TRANSFER_SRC_OPTIMAL)]);
            let at = i as u64 * u64::from(width) * u64::from(height) * TARGET_PIXEL_BYTES as u64;
            self.copy_to_host(image, readback.raw, at);
        }
    }
}

impl VulkanRenderer {
    /// Draws the inputs of a plan's effects and reads them back; empty if no effect reads any. Nothing may be in flight.
    pub(super) fn inputs_on_host(&mut self, plan: &Plan) -> Result<InputImages, RenderError> {
        let Some(inputs) = plan.of_inputs() else { return Ok(InputImages::default()) };
        let count = plan.size[0] as usize * plan.size[1] as usize;
        let targets = inputs.scene_inputs.as_ref().map_or(0, |pass| pass.pixel_bytes() / TARGET_PIXEL_BYTES);
        let mut images = vec![vec![Vec4::ZERO; count]; targets];
        let whole = [Tile { at: [0; 2], size: plan.size, keep: plan.size }];
        let tiles = match self.side_of_tiles(plan) {
            Some(side) => tiles(plan.size, side),
            None => whole.to_vec(),
        };
        for tile in tiles {
            self.submit_now(&inputs.tile(tile, &self.scene_resources.clone())?)?;
            let bytes = self.finish_oldest(targets * TARGET_PIXEL_BYTES, tile.at)?;
            let Tile { at, size, keep } = tile;
            let texels = size[0] as usize * size[1] as usize;
            for (image, bytes) in images.iter_mut().zip(bytes.chunks_exact(texels * TARGET_PIXEL_BYTES)) {
                let (texels, _) = bytes.as_chunks::<TARGET_PIXEL_BYTES>();
                for y in 0..keep[1] {
                    let from = (y * size[0]) as usize;
                    let to = (at[1] + y) as usize * plan.size[0] as usize + at[0] as usize;
                    let row = texels[from..].iter().zip(&mut image[to..]).take(keep[0] as usize);
                    row.for_each(|(texel, out)| *out = bytemuck::pod_read_unaligned(texel));
                }
            }
            self.gpu.check_messages()?;
        }
        let mut images = images.into_iter();
        Ok(InputImages {
            surface: images.next().unwrap_or_default(),
            motion: images.next().unwrap_or_default(),
        })
    }
}
