//! Executes a recording, command by command, into a Vulkan command buffer.

use super::context::Context;
use super::descriptors::{Layouts, POST_TEXTURES, write_image};
use super::frame_in_flight::FrameInFlight;
use super::memory::{Image, all_mip_levels};
use super::pipelines::{PipelineId, Pipelines};
use super::resources::Resources;
use super::targets::Targets;
use crate::commands::{Command, Cull, PassPart, Recording, Target};
use crate::error::RenderError;
use crate::plan::Features;
use crate::scene_resources::SceneResources;
use crate::scene_resources::vertex_layout::VertexLayout;
use ash::vk;
use choreo_plugin::ImagePass;
use glam::Vec4;

pub(crate) struct Execution<'a> {
    pub gpu: &'a Context,
    pub layouts: &'a Layouts,
    pub scene_resources: &'a SceneResources,
    pub resources: &'a Resources,
    pub pipelines: &'a Pipelines,
    pub targets: &'a Targets,
    pub frame: &'a FrameInFlight,
    /// Whether a pass of this recording draws shadow maps.
    pub draws_shadows: bool,
}

impl Execution<'_> {
    pub(super) fn run(&self, recording: &Recording, ids: &[Option<PipelineId>]) -> Result<(), RenderError> {
        let device = &self.gpu.device;
        let commands = self.frame.commands;
        let pipeline_of = |i: usize| {
            let id = ids[i].as_ref();
            id.and_then(|id| self.pipelines.get(id)).ok_or_else(|| not_prepared("a pipeline"))
        };
        let mut index_count = 0;
        // The image that the effect pass before has read, which is still in the layout for reading.
        let mut read = None;
        for (i, command) in recording.commands.iter().enumerate() {
            match command {
                Command::Preskin { variant, primitive, layout, first, count } => {
                    let morphs = variant.features.has(Features::MORPH);
                    self.preskin_mesh(pipeline_of(i)?, (*primitive, *layout), morphs, [*first, *count])?;
                }
                Command::BindPipeline(variant) => {
                    self.bind_pipeline(pipeline_of(i)?);
                    if variant.key.features.has(Features::PRE_SKINNED) {
                        self.bind_preskinned()?;
                    }
                }
                Command::BindMaterial { material, material_override, slots } => {
                    self.bind_material(*material, *material_override, *slots)?;
                }
                Command::BindMesh { primitive, layout, morphs } => {
                    index_count = self.bind_mesh(*primitive, *layout, *morphs)?;
                }
                Command::Draw { first_instance, instance_count, indices } => {
                    let [first, count] = indices.unwrap_or([0, index_count]);
                    let (copies, from) = (*instance_count, *first_instance);
                    // SAFETY: pipeline, sets and mesh are bound; indices were checked when the mesh was packed, and the range
                    // lies in them.
                    unsafe { device.cmd_draw_indexed(commands, count, copies, first, 0, from) };
                }
                Command::DrawBackground { .. } | Command::DrawSky { .. } | Command::DrawLayersBehind => {
                    self.bind_pipeline(pipeline_of(i)?);
                    // SAFETY: the pipeline reads no vertices, and its one set is bound.
                    unsafe { device.cmd_draw(commands, 3, 1, 0, 0) };
                }
                Command::PostPass { from, .. } => {
                    self.draw_full_screen(pipeline_of(i)?, command, read != Some(*from));
                    read = Some(*from);
                }
                Command::DrawOverlay { first, count, .. } => {
                    self.bind_pipeline(pipeline_of(i)?);
                    // SAFETY: the pipeline reads its vertices from the bound set, which holds as many.
                    unsafe { device.cmd_draw(commands, *count, 1, *first, 0) };
                }
                other => self.pass_command(other)?,
            }
        }
        Ok(())
    }

    /// Executes a command that begins or ends a pass, copies an image or sets a state.
    fn pass_command(&self, command: &Command) -> Result<(), RenderError> {
        match command {
            Command::EndPreskin => self.end_preskin(),
            Command::CopyBackground => self.copy_background(),
            Command::SetCull(cull) => self.set_cull(*cull),
            Command::BeginShadows { size, clear, .. } => self.begin_shadows(*size, *clear)?,
            Command::SetShadowView { index, at, size, clear } => {
                self.set_area(*at, *size);
                if *clear {
                    self.clear_depth(*at, *size);
                }
                let set = self.frame.view_sets.get(*index).ok_or_else(|| not_prepared("a shadow view"))?;
                self.bind_set(self.pipelines.layout, 0, set.raw);
            }
            Command::BeginGBuffer => {
                self.begin_geometry()?;
                self.bind_scene_sets();
            }
            Command::BeginInputs { .. } => self.begin_inputs()?,
            Command::EndInputs => self.end_inputs(),
            Command::ReadBackInputs => self.read_back_inputs(),
            Command::DrawDeferredLighting { area } => self.light(*area)?,
            Command::CopySceneColor { from, .. } => self.copy_scene_color(*from)?,
            Command::BeginPass { target, clear, part, loads_depth, area, .. } => {
                self.begin_scene(*target, *clear, (*part, *loads_depth), *area);
                self.bind_scene_sets();
            }
            Command::BeginPeel { layer, area, .. } => {
                // The depth that the pass reads: the scene's for the first layer, then that of even and odd layers in turn.
                let set = self.frame.peel_sets.get(if *layer == 0 { 0 } else { 2 - *layer as usize % 2 });
                let set = set.ok_or_else(|| not_prepared("a set of peeled layers"))?;
                self.begin_peel(*layer, *area)?;
                self.bind_set(self.pipelines.layout, 0, self.frame.frame_set.raw);
                self.bind_set(self.pipelines.layout, 2, set.raw);
            }
            Command::BeginLayer { layer, nearer, target, area, .. } => {
                self.begin_layer(*layer, *nearer, *target, *area)?;
                self.bind_scene_sets();
            }
            Command::EndPass => {
                // SAFETY: `BeginPass` began it.
                unsafe { self.gpu.device.cmd_end_rendering(self.frame.commands) };
            }
            Command::ReadBack => self.read_back(Target::Image),
            Command::ReadBackLinear => self.read_back(Target::Float(0)),
            // Uploaded before the recording, or executed in `run`.
            Command::UploadFrameData { .. }
            | Command::KeepShadows { .. }
            | Command::Preskin { .. }
            | Command::BindPipeline(_)
            | Command::BindMaterial { .. }
            | Command::BindMesh { .. }
            | Command::Draw { .. }
            | Command::DrawBackground { .. }
            | Command::DrawSky { .. }
            | Command::DrawLayersBehind
            | Command::PostPass { .. }
            | Command::DrawOverlay { .. } => {}
        }
        Ok(())
    }

    fn bind_material(&self, material: u32, changed: Option<u32>, slots: u32) -> Result<(), RenderError> {
        let kept = || self.scene_resources.materials.get(material as usize);
        let set = match changed {
            Some(changed) => self.frame.override_set(changed, slots),
            None => kept().and_then(|m| self.resources.material_set(m.hash, slots)),
        };
        let layout = self.layouts.material(slots)?.pipeline;
        self.bind_set(layout, 3, set.ok_or_else(|| not_prepared("a material"))?);
        Ok(())
    }

    /// Binds a mesh and returns its number of indices.
    fn bind_mesh(&self, primitive: u32, layout: VertexLayout, morphs: bool) -> Result<u32, RenderError> {
        let (device, commands) = (&self.gpu.device, self.frame.commands);
        let hash = self.scene_resources.primitives[primitive as usize].hash;
        let mesh = self.resources.mesh(hash, layout).ok_or_else(|| not_prepared("a mesh"))?;
        // SAFETY: the command buffer is being recorded; the buffer outlives the frame.
        unsafe {
            device.cmd_bind_vertex_buffers(commands, 0, &[mesh.buffer.raw], &[0]);
            device.cmd_bind_index_buffer(commands, mesh.buffer.raw, mesh.index_offset, mesh.index_type);
        }
        if morphs {
            let set = self.resources.morph_set(hash, layout);
            self.bind_set(
                self.pipelines.layout,
                1,
                set.ok_or_else(|| not_prepared("a set of morph targets"))?,
            );
        }
        Ok(mesh.index_count)
    }

    pub(super) fn bind_scene_sets(&self) {
        self.bind_set(self.pipelines.layout, 0, self.frame.frame_set.raw);
        if let Some((set, _)) = &self.frame.scene_set {
            self.bind_set(self.pipelines.layout, 2, set.raw);
        }
    }

    pub(super) fn set_cull(&self, cull: Cull) {
        let mode = match cull {
            Cull::None => vk::CullModeFlags::NONE,
            Cull::Back => vk::CullModeFlags::BACK,
            Cull::Front => vk::CullModeFlags::FRONT,
        };
        // SAFETY: the command buffer is being recorded; every pipeline has this state dynamic.
        unsafe { self.gpu.device.cmd_set_cull_mode(self.frame.commands, mode) };
    }

    fn bind_pipeline(&self, pipeline: vk::Pipeline) {
        // SAFETY: the command buffer is being recorded; the pipeline outlives the frame.
        unsafe {
            let bind = vk::PipelineBindPoint::GRAPHICS;
            self.gpu.device.cmd_bind_pipeline(self.frame.commands, bind, pipeline);
        }
    }

    pub(super) fn bind_set(&self, layout: vk::PipelineLayout, index: u32, set: vk::DescriptorSet) {
        // SAFETY: the command buffer is being recorded; the set fits the layout and outlives the frame.
        unsafe {
            let bind = vk::PipelineBindPoint::GRAPHICS;
            self.gpu.device.cmd_bind_descriptor_sets(self.frame.commands, bind, layout, index, &[set], &[]);
        }
    }

    pub(super) fn barriers(&self, barriers: &[vk::ImageMemoryBarrier2<'_>]) {
        let info = vk::DependencyInfo::default().image_memory_barriers(barriers);
        // SAFETY: the command buffer is being recorded, outside a pass; the images are alive.
        unsafe { self.gpu.device.cmd_pipeline_barrier2(self.frame.commands, &info) };
    }

    /// Copies the background from the host over the whole image.
    fn copy_background(&self) {
        let (image, Some(rows)) = (&self.targets.frame_image, self.targets.background()) else { return };
        self.barriers(&[color_barrier(image)
            .src_stage_mask(vk::PipelineStageFlags2::COPY)
            .dst_stage_mask(vk::PipelineStageFlags2::COPY)
            .dst_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
            .new_layout(vk::ImageLayout::TRANSFER_DST_OPTIMAL)]);
        let region = [self.whole_image_copy()];
        // SAFETY: the command buffer is being recorded; the buffer holds one image.
        unsafe {
            let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
            let commands = self.frame.commands;
            self.gpu.device.cmd_copy_buffer_to_image(commands, rows, image.raw, layout, &region);
        }
    }

    fn whole_image_copy(&self) -> vk::BufferImageCopy {
        let [width, height] = self.targets.needs.size;
        let layer =
            vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1);
        let extent = vk::Extent3D { width, height, depth: 1 };
        vk::BufferImageCopy::default().image_subresource(layer).image_extent(extent)
    }

    /// Begins the depth-only pass of the shadow maps, in the used part of their image.
    fn begin_shadows(&self, [width, height]: [u32; 2], clear: bool) -> Result<(), RenderError> {
        let Some(target) = &self.targets.shadow else {
            return Err(RenderError::Usage("the shadow maps were not prepared".into()));
        };
        // The previous frame may still read the maps.
        let read = vk::PipelineStageFlags2::FRAGMENT_SHADER;
        let barrier = barrier_to_depth_target(&target.image);
        let barrier = barrier.src_stage_mask(barrier.src_stage_mask | read);
        let (barrier, load) = match clear {
            true => (barrier, vk::AttachmentLoadOp::CLEAR),
            false => (
                keeping_contents(barrier, vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL),
                vk::AttachmentLoadOp::LOAD,
            ),
        };
        self.barriers(&[barrier]);
        let depth = depth_attachment(&target.image, load, vk::AttachmentStoreOp::STORE);
        let area = vk::Rect2D { offset: vk::Offset2D::default(), extent: vk::Extent2D { width, height } };
        let info = vk::RenderingInfo::default().render_area(area).layer_count(1).depth_attachment(&depth);
        // SAFETY: the command buffer is being recorded, outside a pass; the image is in the layout named.
        unsafe { self.gpu.device.cmd_begin_rendering(self.frame.commands, &info) };
        Ok(())
    }

    /// Clears a part of the depth attachment within the current pass.
    fn clear_depth(&self, at: [u32; 2], [width, height]: [u32; 2]) {
        let clear = vk::ClearAttachment::default().aspect_mask(vk::ImageAspectFlags::DEPTH);
        let offset = vk::Offset2D { x: at[0] as i32, y: at[1] as i32 };
        let rect = vk::Rect2D { offset, extent: vk::Extent2D { width, height } };
        let rect = vk::ClearRect { rect, base_array_layer: 0, layer_count: 1 };
        // SAFETY: a pass with a depth attachment has been begun, and the part lies in its area.
        unsafe { self.gpu.device.cmd_clear_attachments(self.frame.commands, &[clear], &[rect]) };
    }

    /// Sets viewport and scissor.
    pub(super) fn set_area(&self, at: [u32; 2], [width, height]: [u32; 2]) {
        let viewport = vk::Viewport {
            x: at[0] as f32,
            y: at[1] as f32,
            width: width as f32,
            height: height as f32,
            min_depth: 0.0,
            max_depth: 1.0,
        };
        let offset = vk::Offset2D { x: at[0] as i32, y: at[1] as i32 };
        let area = vk::Rect2D { offset, extent: vk::Extent2D { width, height } };
        // SAFETY: the command buffer is being recorded; every pipeline has this state dynamic.
        unsafe {
            self.gpu.device.cmd_set_viewport(self.frame.commands, 0, &[viewport]);
            self.gpu.device.cmd_set_scissor(self.frame.commands, 0, &[area]);
        }
    }

    /// Begins a pass of the scene. `after_geometry`: the G-buffer pass has completed the depth, and the G-buffer is read.
    fn begin_scene(
        &self,
        target: Target,
        clear: Option<Vec4>,
        (part, after_geometry): (PassPart, bool),
        area: Option<[u32; 4]>,
    ) {
        let resolved = self.targets.image(target);
        let multisampled = self.targets.multisampled.as_ref();
        let kept = part != PassPart::Whole;
        let resumed = matches!(part, PassPart::AfterCopy | PassPart::AfterLayers);
        let goes_on = matches!(part, PassPart::UntilCopy | PassPart::UntilLayers);
        self.begin_scene_barriers(resolved, clear.is_some() && area.is_none(), resumed, after_geometry);
        use vk::{AttachmentLoadOp as Load, AttachmentStoreOp as Store};
        let load = if clear.is_some() { Load::CLEAR } else { Load::LOAD };
        let float32 = clear.unwrap_or_default().to_array();
        let clear = vk::ClearValue { color: vk::ClearColorValue { float32 } };
        let view = multisampled.unwrap_or(resolved).view;
        let mut color = color_attachment(view, load, Store::STORE).clear_value(clear);
        if multisampled.is_some() {
            color = color
                .store_op(if goes_on { Store::STORE } else { Store::DONT_CARE })
                .resolve_mode(vk::ResolveModeFlags::AVERAGE)
                .resolve_image_view(resolved.view)
                .resolve_image_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL);
            if part == PassPart::UntilLayers {
                color = color.resolve_mode(vk::ResolveModeFlags::NONE);
            }
        }
        let load = if resumed || after_geometry { Load::LOAD } else { Load::CLEAR };
        let store = if kept { Store::STORE } else { Store::DONT_CARE };
        let depth = self.targets.depth.as_ref().map(|image| depth_attachment(image, load, store));
        self.begin(&[color], depth.as_ref(), area);
    }

    /// Transitions the images of a scene pass to their layouts. `clears_all`: the pass clears the whole image; `resumed`: it
    /// continues after a copy or after peeled layers.
    fn begin_scene_barriers(&self, resolved: &Image, clears_all: bool, resumed: bool, after_geometry: bool) {
        let mut barriers = vec![match clears_all {
            // The copy left the image in the layout for drawing; a multisampled pass only resolves into it.
            _ if resumed => {
                keeping_contents(barrier_to_color_target(resolved), vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
            }
            true => barrier_to_color_target(resolved),
            // The copy of the background left the image in the transfer layout; it fills the whole image or surrounds the render
            // area.
            false => color_barrier(resolved)
                .src_stage_mask(vk::PipelineStageFlags2::COPY)
                .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
                .dst_stage_mask(vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT)
                .dst_access_mask(
                    vk::AccessFlags2::COLOR_ATTACHMENT_WRITE | vk::AccessFlags2::COLOR_ATTACHMENT_READ,
                )
                .old_layout(vk::ImageLayout::TRANSFER_DST_OPTIMAL)
                .new_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL),
        }];
        let (of_samples, of_depth) = (
            self.targets.multisampled.as_ref().map(barrier_to_color_target),
            self.targets.depth.as_ref().map(barrier_to_depth_target),
        );
        if resumed {
            barriers
                .extend(of_samples.map(|b| keeping_contents(b, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)));
            barriers.extend(of_depth.map(|b| keeping_contents(b, vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL)));
        } else {
            barriers.extend(of_samples);
            barriers.extend(of_depth.map(|b| match after_geometry {
                true => keeping_contents(b, vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL),
                false => b,
            }));
            if after_geometry {
                barriers.extend(self.targets.gbuffer.iter().map(barrier_color_to_sampled));
            }
            let drawn = self.targets.shadow.as_ref().filter(|_| self.draws_shadows);
            barriers.extend(drawn.map(|s| barrier_depth_to_sampled(&s.image)));
        }
        self.barriers(&barriers);
    }

    pub(super) fn begin(
        &self,
        colors: &[vk::RenderingAttachmentInfo<'_>],
        depth: Option<&vk::RenderingAttachmentInfo<'_>>,
        part: Option<[u32; 4]>,
    ) {
        let [width, height] = self.targets.needs.size;
        let [x, y, w, h] = part.unwrap_or([0, 0, width, height]);
        let offset = vk::Offset2D { x: x as i32, y: y as i32 };
        let area = vk::Rect2D { offset, extent: vk::Extent2D { width: w, height: h } };
        let mut info =
            vk::RenderingInfo::default().render_area(area).layer_count(1).color_attachments(colors);
        if let Some(depth) = depth {
            info = info.depth_attachment(depth);
        }
        // SAFETY: the command buffer is being recorded, outside a pass; the attachments are in the layouts named.
        unsafe { self.gpu.device.cmd_begin_rendering(self.frame.commands, &info) };
        self.set_area([0; 2], [width, height]);
        // SAFETY: the command buffer is being recorded; every pipeline has this state dynamic.
        unsafe { self.gpu.device.cmd_set_scissor(self.frame.commands, 0, &[area]) };
    }

    /// Runs a full-screen pass. `is_new`: its input was drawn by the pass before and is not yet in the layout for reading.
    fn draw_full_screen(&self, pipeline: vk::Pipeline, command: &Command, is_new: bool) {
        let Command::PostPass { index, from, original, textures, to, size: [w, h], .. } = command else {
            return;
        };
        // Later passes of an effect find the effect's input in the layout for reading already.
        let (from, original) = (self.targets.image(*from), self.targets.image(*original));
        let set = self.frame.post_sets[*index].raw;
        let sampled = vk::DescriptorType::SAMPLED_IMAGE;
        write_image(self.gpu, set, 1, sampled, from.view, vk::Sampler::null());
        write_image(self.gpu, set, 2, sampled, original.view, vk::Sampler::null());
        // Every binding is written. A missing image is replaced by another one, which is not read.
        for (binding, i) in [(5, 0), (6, 1)] {
            let view = self.targets.inputs.get(i).map_or(from.view, |image| image.view);
            write_image(self.gpu, set, binding, sampled, view, vk::Sampler::null());
        }
        for (i, binding) in (POST_TEXTURES..).take(ImagePass::MOST_READ).enumerate() {
            let view = textures.get(i).map_or(from, |texture| self.targets.image(*texture)).view;
            write_image(self.gpu, set, binding, sampled, view, vk::Sampler::null());
        }
        let target = self.targets.image(*to);
        match is_new {
            true => self.barriers(&[barrier_color_to_sampled(from), barrier_to_color_target(target)]),
            false => self.barriers(&[barrier_to_color_target(target)]),
        }
        let color =
            color_attachment(target.view, vk::AttachmentLoadOp::DONT_CARE, vk::AttachmentStoreOp::STORE);
        self.begin(&[color], None, Some([0, 0, *w, *h]));
        self.set_cull(Cull::None);
        self.bind_pipeline(pipeline);
        self.bind_set(self.pipelines.post_layout, 0, set);
        // SAFETY: the pipeline reads no vertices, and its one set is bound.
        unsafe {
            self.gpu.device.cmd_draw(self.frame.commands, 3, 1, 0, 0);
            self.gpu.device.cmd_end_rendering(self.frame.commands);
        }
        // Several passes may read a texture, so it is made readable at once.
        if matches!(to, Target::Texture(_)) {
            self.barriers(&[barrier_color_to_sampled(target)]);
        }
    }

    fn read_back(&self, from: Target) {
        let image = self.targets.image(from);
        self.barriers(&[color_barrier(image)
            .src_stage_mask(vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT)
            .src_access_mask(vk::AccessFlags2::COLOR_ATTACHMENT_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::COPY)
            .dst_access_mask(vk::AccessFlags2::TRANSFER_READ)
            .old_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
            .new_layout(vk::ImageLayout::TRANSFER_SRC_OPTIMAL)]);
        let Some(readback) = &self.frame.readback else { return };
        self.copy_to_host(image, readback.raw, 0);
    }

    /// Copies a whole image, in the layout of a transfer source, to a buffer from the offset `at` on.
    pub(super) fn copy_to_host(&self, image: &Image, buffer: vk::Buffer, at: u64) {
        let region = [self.whole_image_copy().buffer_offset(at)];
        // The barrier covers the image and the fault records of shaders.
        let shaders = vk::PipelineStageFlags2::VERTEX_SHADER | vk::PipelineStageFlags2::FRAGMENT_SHADER;
        let to_host = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::COPY | shaders)
            .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE | vk::AccessFlags2::SHADER_STORAGE_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ)];
        // SAFETY: the command buffer is being recorded; the buffer holds at least one image.
        unsafe {
            self.gpu.device.cmd_copy_image_to_buffer(
                self.frame.commands,
                image.raw,
                vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
                buffer,
                &region,
            );
            let info = vk::DependencyInfo::default().memory_barriers(&to_host);
            self.gpu.device.cmd_pipeline_barrier2(self.frame.commands, &info);
        }
    }
}

/// A recording uses a resource that no earlier call has prepared.
pub(super) fn not_prepared(what: &str) -> RenderError {
    RenderError::Usage(format!("{what} was not prepared"))
}

pub(super) fn color_barrier(image: &Image) -> vk::ImageMemoryBarrier2<'static> {
    vk::ImageMemoryBarrier2::default()
        .image(image.raw)
        .subresource_range(all_mip_levels(vk::ImageAspectFlags::COLOR))
}

/// Barrier after drawing: shaders read the image from now on.
pub(super) fn barrier_color_to_sampled(image: &Image) -> vk::ImageMemoryBarrier2<'static> {
    color_barrier(image)
        .src_stage_mask(vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT)
        .src_access_mask(vk::AccessFlags2::COLOR_ATTACHMENT_WRITE)
        .dst_stage_mask(vk::PipelineStageFlags2::FRAGMENT_SHADER)
        .dst_access_mask(vk::AccessFlags2::SHADER_SAMPLED_READ)
        .old_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
        .new_layout(vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL)
}

/// Changes a barrier to keep the image's contents, which are in this layout.
pub(super) fn keeping_contents(
    barrier: vk::ImageMemoryBarrier2<'static>,
    layout: vk::ImageLayout,
) -> vk::ImageMemoryBarrier2<'static> {
    barrier.old_layout(layout)
}

/// Barrier before drawing: discards the contents, and waits for all uses by the frame before.
pub(super) fn barrier_to_color_target(image: &Image) -> vk::ImageMemoryBarrier2<'static> {
    color_barrier(image)
        .src_stage_mask(
            vk::PipelineStageFlags2::COPY
                | vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT
                | vk::PipelineStageFlags2::FRAGMENT_SHADER,
        )
        .src_access_mask(vk::AccessFlags2::COLOR_ATTACHMENT_WRITE)
        .dst_stage_mask(vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT)
        .dst_access_mask(vk::AccessFlags2::COLOR_ATTACHMENT_WRITE | vk::AccessFlags2::COLOR_ATTACHMENT_READ)
        .new_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
}

/// A color attachment of a pass; `load` and `store` decide about its contents.
pub(super) fn color_attachment(
    view: vk::ImageView,
    load: vk::AttachmentLoadOp,
    store: vk::AttachmentStoreOp,
) -> vk::RenderingAttachmentInfo<'static> {
    vk::RenderingAttachmentInfo::default()
        .image_view(view)
        .image_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
        .load_op(load)
        .store_op(store)
}

/// The depth attachment of a pass; if cleared, it is infinitely far.
pub(super) fn depth_attachment(
    image: &Image,
    load: vk::AttachmentLoadOp,
    store: vk::AttachmentStoreOp,
) -> vk::RenderingAttachmentInfo<'static> {
    // Reversed Z: 0 is infinitely far.
    let far = vk::ClearDepthStencilValue { depth: 0.0, stencil: 0 };
    vk::RenderingAttachmentInfo::default()
        .image_view(image.view)
        .image_layout(vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL)
        .load_op(load)
        .store_op(store)
        .clear_value(vk::ClearValue { depth_stencil: far })
}

const DEPTH_STAGES: vk::PipelineStageFlags2 = vk::PipelineStageFlags2::from_raw(
    vk::PipelineStageFlags2::EARLY_FRAGMENT_TESTS.as_raw()
        | vk::PipelineStageFlags2::LATE_FRAGMENT_TESTS.as_raw(),
);

/// A barrier after depth was written.
fn barrier_after_depth_write(image: &Image) -> vk::ImageMemoryBarrier2<'static> {
    vk::ImageMemoryBarrier2::default()
        .image(image.raw)
        .subresource_range(all_mip_levels(vk::ImageAspectFlags::DEPTH))
        .src_stage_mask(DEPTH_STAGES)
        .src_access_mask(vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE)
}

/// Barrier before drawing: discards the depth, and waits for all uses by the frame before.
pub(super) fn barrier_to_depth_target(image: &Image) -> vk::ImageMemoryBarrier2<'static> {
    barrier_after_depth_write(image)
        .dst_stage_mask(DEPTH_STAGES)
        .dst_access_mask(
            vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE
                | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_READ,
        )
        .new_layout(vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL)
}

/// Barrier after drawing: shaders read the depth from now on.
pub(super) fn barrier_depth_to_sampled(image: &Image) -> vk::ImageMemoryBarrier2<'static> {
    barrier_after_depth_write(image)
        .dst_stage_mask(vk::PipelineStageFlags2::FRAGMENT_SHADER)
        .dst_access_mask(vk::AccessFlags2::SHADER_SAMPLED_READ)
        .old_layout(vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL)
        .new_layout(vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL)
}
