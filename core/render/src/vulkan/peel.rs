//! Depth peeling: passes that find the depths of a layer of transparent surfaces, and passes that blend it into the image.

use super::execute::{
    Execution, barrier_depth_to_sampled, barrier_to_color_target, barrier_to_depth_target, color_attachment,
    depth_attachment, keeping_contents,
};
use super::memory::Image;
use crate::commands::Target;
use crate::error::RenderError;
use ash::vk;

impl Execution<'_> {
    fn layer_depth(&self, layer: u32) -> Result<&Image, RenderError> {
        let missing = || RenderError::Usage("the layers were not prepared".into());
        self.targets.layers.get(layer as usize % 2).ok_or_else(missing)
    }

    /// Begins the depth-only pass that finds a layer. Depth is cleared to the nearest, so that of all surfaces nearer than the
    /// layer before the farthest stays.
    pub(super) fn begin_peel(&self, layer: u32, area: Option<[u32; 4]>) -> Result<(), RenderError> {
        let missing = || RenderError::Usage("the depth was not prepared".into());
        let before = match layer {
            0 => self.targets.depth.as_ref().ok_or_else(missing)?,
            _ => self.layer_depth(layer - 1)?,
        };
        let image = self.layer_depth(layer)?;
        // The layer before was found by reading this image.
        let read = vk::PipelineStageFlags2::FRAGMENT_SHADER;
        let barrier = barrier_to_depth_target(image);
        self.barriers(&[
            barrier_depth_to_sampled(before),
            barrier.src_stage_mask(barrier.src_stage_mask | read),
        ]);
        let nearest = vk::ClearDepthStencilValue { depth: 1.0, stencil: 0 };
        let depth = depth_attachment(image, vk::AttachmentLoadOp::CLEAR, vk::AttachmentStoreOp::STORE)
            .clear_value(vk::ClearValue { depth_stencil: nearest });
        self.begin(&[], Some(&depth), area);
        Ok(())
    }

    /// Begins the pass that blends surfaces at the depth of a layer, or (`nearer`) all surfaces in front of it.
    pub(super) fn begin_layer(
        &self,
        layer: u32,
        nearer: bool,
        target: Target,
        area: Option<[u32; 4]>,
    ) -> Result<(), RenderError> {
        let target_image = self.targets.multisampled.as_ref().unwrap_or(self.targets.image(target));
        let image = self.layer_depth(layer)?;
        let mut barriers = vec![
            keeping_contents(
                barrier_to_color_target(target_image),
                vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
            ),
            keeping_contents(barrier_to_depth_target(image), vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL),
        ];
        if let (0, false, Some(depth)) = (layer, nearer, &self.targets.depth) {
            // The first layer was found by reading the scene's depth; later passes test against it.
            let read = vk::PipelineStageFlags2::FRAGMENT_SHADER;
            barriers.push(keeping_contents(
                barrier_to_depth_target(depth).src_stage_mask(read).src_access_mask(vk::AccessFlags2::NONE),
                vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
            ));
        }
        self.barriers(&barriers);
        let (load, store) = (vk::AttachmentLoadOp::LOAD, vk::AttachmentStoreOp::STORE);
        let color = color_attachment(target_image.view, load, store);
        self.begin(&[color], Some(&depth_attachment(image, load, store)), area);
        // Reversed Z: nearer is greater.
        let compare = if nearer { vk::CompareOp::GREATER } else { vk::CompareOp::EQUAL };
        // SAFETY: the command buffer is being recorded; the pipelines of this pass have this state dynamic.
        unsafe { self.gpu.device.cmd_set_depth_compare_op(self.frame.commands, compare) };
        Ok(())
    }
}
