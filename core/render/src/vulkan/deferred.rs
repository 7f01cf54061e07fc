//! The G-buffer on the device: its images, the pass that fills them and the draw that lights it.

use super::context::Context;
use super::descriptors::{Layouts, Pools, write_buffer, write_image};
use super::execute::{
    Execution, barrier_to_color_target, barrier_to_depth_target, color_attachment, depth_attachment,
};
use super::frame_in_flight::FrameInFlight;
use super::memory::Image;
use super::{Ability, VulkanRenderer};
use crate::commands::{Cull, RecordOptions};
use crate::error::RenderError;
use crate::plan::DeferredCause;
use crate::plan::Plan;
use crate::renderer::DeviceKind;
use crate::shader::uniforms::RebuiltUniform;
use ash::vk;

/// Formats of the G-buffer: normals and factors, colors, depth; see shaders/deferred.wgsl. Vulkan guarantees these formats and
/// this number of color attachments on every device (Vulkan 1.3, "Required Format Support", `maxColorAttachments`).
pub const FORMATS: [vk::Format; 3] =
    [vk::Format::R32G32B32A32_UINT, vk::Format::R32G32B32A32_UINT, vk::Format::R32_SFLOAT];
/// Bytes per pixel of each image.
pub(crate) const BYTES_PER_PIXEL: [u64; 3] = [16, 16, 4];

/// Bindings of set 3 in the lighting pass.
pub(crate) const BINDINGS: [(u32, vk::DescriptorType, vk::ShaderStageFlags); 4] = [
    (0, vk::DescriptorType::UNIFORM_BUFFER, vk::ShaderStageFlags::FRAGMENT),
    (1, vk::DescriptorType::SAMPLED_IMAGE, vk::ShaderStageFlags::FRAGMENT),
    (2, vk::DescriptorType::SAMPLED_IMAGE, vk::ShaderStageFlags::FRAGMENT),
    (3, vk::DescriptorType::SAMPLED_IMAGE, vk::ShaderStageFlags::FRAGMENT),
];

/// Whether a device can draw into the G-buffer's formats and read them.
pub fn color_attachments(instance: &ash::Instance, physical: vk::PhysicalDevice) -> bool {
    let wanted = vk::FormatFeatureFlags::COLOR_ATTACHMENT | vk::FormatFeatureFlags::SAMPLED_IMAGE;
    // SAFETY: the device belongs to the instance.
    let (limits, has) = unsafe {
        let has = FORMATS.map(|format| {
            let format = instance.get_physical_device_format_properties(physical, format);
            format.optimal_tiling_features.contains(wanted)
        });
        (instance.get_physical_device_properties(physical).limits, has)
    };
    limits.max_color_attachments as usize >= FORMATS.len() && has == [true; 3]
}

impl VulkanRenderer {
    /// Options of recordings for this device: faster ways of drawing, and missing abilities.
    pub(super) fn record_options(&mut self, plan: &Plan) -> RecordOptions {
        let has = |ability| self.gpu.abilities.has(ability);
        let no_deferred = !has(Ability::ColorAttachments);
        let options = RecordOptions {
            cpu_device: self.gpu.info.kind == DeviceKind::VulkanCpu,
            textures: Some(self.max_textures()),
            no_coverage: !has(Ability::AlphaToOne),
            no_depth_peeling: plan.samples > 1 && !has(Ability::SampleRateShading),
            no_deferred,
            no_compute: !has(Ability::Compute),
            kept_maps: 0,
        };
        // The note answers a script that requests deferred shading; the planner's own choice needs none.
        let asked = plan.deferred.as_ref().is_some_and(|d| d.cause == DeferredCause::Requested);
        if asked && no_deferred && !std::mem::replace(&mut self.noted_forward_shading, true) {
            let ability = Ability::ColorAttachments;
            let note = format!(
                "pipeline \"deferred\": this device lacks {}: {}",
                ability.name(),
                ability.fallback()
            );
            self.notes.push(note);
        }
        options
    }
}

impl FrameInFlight {
    /// Writes the G-buffer's descriptor set. `buffer`: buffer and offset of the [`RebuiltUniform`].
    pub(super) fn write_gbuffer(
        &mut self,
        gpu: &Context,
        layouts: &Layouts,
        pools: &mut Pools,
        views: [vk::ImageView; 3],
        (buffer, at): (vk::Buffer, u64),
    ) -> Result<(), RenderError> {
        let set = match self.gbuffer_set {
            Some(set) => set,
            None => *self.gbuffer_set.insert(pools.allocate(gpu, layouts.light()?.set, "G-buffer set")?),
        };
        let (uniform, image) = (vk::DescriptorType::UNIFORM_BUFFER, vk::DescriptorType::SAMPLED_IMAGE);
        write_buffer(gpu, set.raw, 0, uniform, buffer, at, size_of::<RebuiltUniform>() as u64);
        for (binding, view) in (1..).zip(views) {
            write_image(gpu, set.raw, binding, image, view, vk::Sampler::null());
        }
        Ok(())
    }
}

impl Execution<'_> {
    /// Begins the G-buffer pass. Pixels without a surface stay undefined; their depth stays 0, which marks them.
    pub(super) fn begin_geometry(&self) -> Result<(), RenderError> {
        let targets = self.targets;
        let (Some(depth), true) = (&targets.depth, targets.needs.gbuffer) else {
            return Err(RenderError::Usage("the G-buffer was not prepared".into()));
        };
        let mut barriers: Vec<_> = targets.gbuffer.iter().map(barrier_to_color_target).collect();
        barriers.push(barrier_to_depth_target(depth));
        self.barriers(&barriers);
        use vk::{AttachmentLoadOp as Load, AttachmentStoreOp as Store};
        let color = |image: &Image| color_attachment(image.view, Load::DONT_CARE, Store::STORE);
        let colors: Vec<_> = targets.gbuffer.iter().map(color).collect();
        self.begin(&colors, Some(&depth_attachment(depth, Load::CLEAR, Store::STORE)), None);
        Ok(())
    }

    /// Lights the G-buffer with the pipeline that was bound before.
    pub(super) fn light(&self, area: Option<[u32; 4]>) -> Result<(), RenderError> {
        let set = self
            .frame
            .gbuffer_set
            .ok_or_else(|| RenderError::Usage("the G-buffer set was not prepared".into()))?;
        self.bind_set(self.layouts.light()?.pipeline, 3, set.raw);
        self.set_cull(Cull::None);
        let [width, height] = self.targets.needs.size;
        let scissor = |[x, y, w, h]: [u32; 4]| vk::Rect2D {
            offset: vk::Offset2D { x: x as i32, y: y as i32 },
            extent: vk::Extent2D { width: w, height: h },
        };
        let whole = [0, 0, width, height];
        let (device, commands) = (&self.gpu.device, self.frame.commands);
        // SAFETY: the command buffer is being recorded; the pipeline reads no vertices, its sets are bound, and every pipeline
        // has the scissor dynamic.
        unsafe {
            device.cmd_set_scissor(commands, 0, &[scissor(area.unwrap_or(whole))]);
            device.cmd_draw(commands, 3, 1, 0, 0);
            device.cmd_set_scissor(commands, 0, &[scissor(whole)]);
        }
        Ok(())
    }
}
