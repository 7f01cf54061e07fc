//! Objects of the window's Vulkan device, and the recording of a frame of the window. Only one frame is in flight: the window draws a few thousand
//! triangles and one texture per view, and waiting for the previous frame costs less than keeping all resources twice.

use super::gpu_error::{ForObject, GpuError};
use super::image::{WindowImage, color_subresource_range};
use super::swapchain::Swapchain;
use ash::{khr, vk};
use choreo_plugin::Frame;
use egui::{ClippedPrimitive, TextureId, TexturesDelta};
use egui_ash_renderer::allocator::GpuAllocator;
use egui_ash_renderer::vulkan::create_vulkan_descriptor_set_layout;
use egui_ash_renderer::{DynamicRendering, Options, RenderMode, Renderer};
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Timeout of the wait for a frame, so that a driver that hangs does not hang the program.
const TIMEOUT_NS: u64 = 60_000_000_000;
const MAX_VIEWS: u32 = crate::state::view::MAX_VIEWS as u32;

/// All objects created from the device, in one struct so that they are freed in order.
pub(super) struct Device {
    raw: ash::Device,
    pub queue: vk::Queue,
    swapchains: khr::swapchain::Device,
    pub format: vk::SurfaceFormatKHR,
    pub swapchain: Option<Swapchain>,
    command_pool: vk::CommandPool,
    command_buffer: vk::CommandBuffer,
    /// Signaled when the last frame is done.
    frame_done: vk::Fence,
    pub image_acquired: vk::Semaphore,
    sampler: vk::Sampler,
    set_layout: vk::DescriptorSetLayout,
    descriptor_pool: vk::DescriptorPool,
    allocator: Option<Arc<Mutex<Allocator>>>,
    egui: Option<Renderer<GpuAllocator>>,
    /// Images of the views, by view.
    pub view_images: Vec<ViewImage>,
    /// Textures that the frame in flight may still use.
    to_free: Vec<TextureId>,
    pub largest_texture: usize,
}

/// Image of a view, if it has one, and its texture in egui.
pub(super) struct ViewImage {
    descriptor_set: vk::DescriptorSet,
    image: Option<WindowImage>,
    pub id: Option<TextureId>,
}

impl Device {
    /// Creates the objects that do not depend on the window's size.
    pub(super) fn new(
        instance: &ash::Instance,
        raw: ash::Device,
        queue: vk::Queue,
        largest_texture: usize,
    ) -> Device {
        Device {
            swapchains: khr::swapchain::Device::new(instance, &raw),
            raw,
            queue,
            format: vk::SurfaceFormatKHR::default(),
            swapchain: None,
            command_pool: vk::CommandPool::null(),
            command_buffer: vk::CommandBuffer::null(),
            frame_done: vk::Fence::null(),
            image_acquired: vk::Semaphore::null(),
            sampler: vk::Sampler::null(),
            set_layout: vk::DescriptorSetLayout::null(),
            descriptor_pool: vk::DescriptorPool::null(),
            allocator: None,
            egui: None,
            view_images: Vec::new(),
            to_free: Vec::new(),
            largest_texture,
        }
    }

    pub(super) fn create_objects(
        &mut self,
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        family: u32,
    ) -> Result<(), GpuError> {
        let raw = &self.raw;
        let pool = vk::CommandPoolCreateInfo::default()
            .queue_family_index(family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        let fence = vk::FenceCreateInfo::default().flags(vk::FenceCreateFlags::SIGNALED);
        let sampler = vk::SamplerCreateInfo::default()
            .mag_filter(vk::Filter::LINEAR)
            .min_filter(vk::Filter::LINEAR)
            .address_mode_u(vk::SamplerAddressMode::CLAMP_TO_EDGE)
            .address_mode_v(vk::SamplerAddressMode::CLAMP_TO_EDGE);
        let sizes = [vk::DescriptorPoolSize {
            ty: vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
            descriptor_count: MAX_VIEWS,
        }];
        let sets = vk::DescriptorPoolCreateInfo::default().max_sets(MAX_VIEWS).pool_sizes(&sizes);
        // SAFETY: the device is alive; what is made is destroyed by `drop`.
        unsafe {
            self.command_pool = raw.create_command_pool(&pool, None).for_object("command pool")?;
            let info = vk::CommandBufferAllocateInfo::default()
                .command_pool(self.command_pool)
                .command_buffer_count(1);
            self.command_buffer = raw.allocate_command_buffers(&info).for_object("commands")?[0];
            self.frame_done = raw.create_fence(&fence, None).for_object("fence")?;
            let semaphore = raw.create_semaphore(&vk::SemaphoreCreateInfo::default(), None);
            self.image_acquired = semaphore.for_object("semaphore")?;
            self.sampler = raw.create_sampler(&sampler, None).for_object("sampler")?;
            self.descriptor_pool = raw.create_descriptor_pool(&sets, None).for_object("descriptor pool")?;
        }
        self.set_layout = create_vulkan_descriptor_set_layout(raw).for_object("descriptor layout")?;
        let layouts = [self.set_layout; MAX_VIEWS as usize];
        let info = vk::DescriptorSetAllocateInfo::default()
            .descriptor_pool(self.descriptor_pool)
            .set_layouts(&layouts);
        // SAFETY: as above.
        let sets = unsafe { raw.allocate_descriptor_sets(&info) }.for_object("descriptor sets")?;
        self.view_images =
            sets.into_iter().map(|set| ViewImage { descriptor_set: set, image: None, id: None }).collect();
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.clone(),
            device: raw.clone(),
            physical_device: physical,
            debug_settings: Default::default(),
            buffer_device_address: false,
            allocation_sizes: Default::default(),
        });
        let allocator = Arc::new(Mutex::new(allocator.for_object("allocator")?));
        let mode = RenderMode::DynamicRendering(DynamicRendering {
            color_attachment_format: self.format.format,
            depth_attachment_format: None,
            stencil_attachment_format: None,
        });
        let srgb_framebuffer = matches!(
            self.format.format,
            vk::Format::B8G8R8A8_SRGB | vk::Format::R8G8B8A8_SRGB | vk::Format::A8B8G8R8_SRGB_PACK32
        );
        let options = Options { in_flight_frames: 1, srgb_framebuffer, ..Options::default() };
        let egui = Renderer::with_gpu_allocator(allocator.clone(), raw.clone(), mode, options);
        self.allocator = Some(allocator);
        self.egui = Some(egui.for_object("renderer of the panels")?);
        Ok(())
    }

    /// Waits until the last frame is done.
    pub(super) fn wait_for_last_frame(&mut self) -> Result<(), GpuError> {
        // SAFETY: the fence is alive; it is signaled at first.
        unsafe { self.raw.wait_for_fences(&[self.frame_done], true, TIMEOUT_NS) }.for_object("last frame")?;
        for id in std::mem::take(&mut self.to_free) {
            if let Some(egui) = &mut self.egui {
                egui.free_texture(id).for_object("texture")?;
            }
        }
        Ok(())
    }

    pub(super) fn update_textures(&mut self, mut textures: TexturesDelta) -> Result<(), GpuError> {
        // The list is emptied at once: egui reports an error if it is dropped with content.
        let set = std::mem::take(&mut textures.set);
        self.to_free.extend(std::mem::take(&mut textures.free));
        let Some(egui) = &mut self.egui else { return Ok(()) };
        for (id, deltas) in &set {
            for delta in deltas {
                egui.set_texture(self.queue, self.command_pool, *id, delta)
                    .for_object("texture of the panels")?;
            }
        }
        Ok(())
    }

    pub(crate) fn prepare_view_image(&mut self, view: usize, size: [u32; 2]) -> Result<(), GpuError> {
        let (Some(slot), Some(allocator)) = (self.view_images.get_mut(view), self.allocator.clone()) else {
            return Ok(());
        };
        if slot.image.as_ref().is_some_and(|p| p.size == size) {
            return Ok(());
        }
        let mut allocator = lock_allocator(&allocator);
        if let Some(mut old) = slot.image.take() {
            old.destroy(&self.raw, &mut allocator);
        }
        let window_image = WindowImage::new(&self.raw, &mut allocator, size)?;
        let image = [vk::DescriptorImageInfo::default()
            .sampler(self.sampler)
            .image_view(window_image.view())
            .image_layout(vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL)];
        let write = [vk::WriteDescriptorSet::default()
            .dst_set(slot.descriptor_set)
            .descriptor_type(vk::DescriptorType::COMBINED_IMAGE_SAMPLER)
            .image_info(&image)];
        // SAFETY: no frame in flight uses the set.
        unsafe { self.raw.update_descriptor_sets(&write, &[]) };
        slot.image = Some(window_image);
        slot.id =
            slot.id.or_else(|| self.egui.as_mut().map(|egui| egui.add_user_texture(slot.descriptor_set)));
        Ok(())
    }

    pub(crate) fn new_swapchain(
        &mut self,
        surface: vk::SurfaceKHR,
        capabilities: &vk::SurfaceCapabilitiesKHR,
        window: [u32; 2],
    ) -> Result<(), GpuError> {
        self.drop_swapchain()?;
        let made =
            Swapchain::new(&self.raw, self.swapchains.clone(), surface, capabilities, self.format, window);
        self.swapchain = Some(made?);
        Ok(())
    }

    pub(crate) fn drop_swapchain(&mut self) -> Result<(), GpuError> {
        if let Some(mut old) = self.swapchain.take() {
            // SAFETY: the queue is only used on this thread.
            unsafe { self.raw.device_wait_idle() }.for_object("device")?;
            old.destroy(&self.raw);
        }
        Ok(())
    }

    pub(super) fn record(
        &mut self,
        index: u32,
        primitives: &[ClippedPrimitive],
        pixels_per_point: f32,
        frames: &BTreeMap<usize, Frame>,
    ) -> Result<(), GpuError> {
        let (Some(swapchain), Some(egui)) = (&self.swapchain, &mut self.egui) else { return Ok(()) };
        let (raw, commands, extent) = (&self.raw, self.command_buffer, swapchain.extent);
        let (image, view) = (swapchain.images[index as usize], swapchain.views[index as usize]);
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the last frame is done, so its commands are not pending.
        unsafe {
            raw.reset_command_buffer(commands, vk::CommandBufferResetFlags::empty())
                .for_object("commands")?;
            raw.begin_command_buffer(commands, &begin).for_object("commands")?;
        }
        for (view, frame) in frames {
            if let Some(window_image) = self.view_images.get_mut(*view).and_then(|slot| slot.image.as_mut()) {
                window_image.upload(raw, commands, frame);
            }
        }
        use vk::{AccessFlags2 as A, ImageLayout as L, PipelineStageFlags2 as S};
        let barrier = |from, to, access: (vk::AccessFlags2, vk::AccessFlags2), after| {
            [vk::ImageMemoryBarrier2::default()
                .image(image)
                .subresource_range(color_subresource_range())
                .old_layout(from)
                .new_layout(to)
                .src_stage_mask(S::COLOR_ATTACHMENT_OUTPUT)
                .src_access_mask(access.0)
                .dst_stage_mask(after)
                .dst_access_mask(access.1)
                .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)]
        };
        let write = A::COLOR_ATTACHMENT_WRITE | A::COLOR_ATTACHMENT_READ;
        let to_draw =
            barrier(L::UNDEFINED, L::COLOR_ATTACHMENT_OPTIMAL, (A::NONE, write), S::COLOR_ATTACHMENT_OUTPUT);
        let to_show = barrier(L::COLOR_ATTACHMENT_OPTIMAL, L::PRESENT_SRC_KHR, (write, A::NONE), S::NONE);
        let color = [vk::RenderingAttachmentInfo::default()
            .image_view(view)
            .image_layout(L::COLOR_ATTACHMENT_OPTIMAL)
            .load_op(vk::AttachmentLoadOp::CLEAR)
            .store_op(vk::AttachmentStoreOp::STORE)];
        let info = vk::RenderingInfo::default()
            .render_area(vk::Rect2D { offset: vk::Offset2D::default(), extent })
            .layer_count(1)
            .color_attachments(&color);
        // SAFETY: commands are being recorded; the image was acquired; all pointers live until each call returns.
        unsafe {
            raw.cmd_pipeline_barrier2(
                commands,
                &vk::DependencyInfo::default().image_memory_barriers(&to_draw),
            );
            raw.cmd_begin_rendering(commands, &info);
        }
        let drawn = egui.cmd_draw(commands, extent, pixels_per_point, primitives);
        // SAFETY: as above.
        unsafe {
            raw.cmd_end_rendering(commands);
            raw.cmd_pipeline_barrier2(
                commands,
                &vk::DependencyInfo::default().image_memory_barriers(&to_show),
            );
            raw.end_command_buffer(commands).for_object("commands")?;
        }
        drawn.for_object("panels")
    }

    pub(super) fn submit(&self, index: u32) -> Result<(), GpuError> {
        let Some(swapchain) = &self.swapchain else { return Ok(()) };
        let stage = vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT;
        let wait = [vk::SemaphoreSubmitInfo::default().semaphore(self.image_acquired).stage_mask(stage)];
        let signal = [vk::SemaphoreSubmitInfo::default()
            .semaphore(swapchain.image_drawn[index as usize])
            .stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)];
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(self.command_buffer)];
        let submit = [vk::SubmitInfo2::default()
            .wait_semaphore_infos(&wait)
            .signal_semaphore_infos(&signal)
            .command_buffer_infos(&commands)];
        // SAFETY: fence and semaphores are free: the last frame is done and the image was just acquired.
        unsafe {
            self.raw.reset_fences(&[self.frame_done]).for_object("fence")?;
            self.raw.queue_submit2(self.queue, &submit, self.frame_done).for_object("frame of the window")
        }
    }
}

fn lock_allocator(allocator: &Mutex<Allocator>) -> MutexGuard<'_, Allocator> {
    allocator.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: nothing else submits; an error (device lost) means that nothing runs any more.
        let _ = unsafe { self.raw.device_wait_idle() };
        if let Some(mut swapchain) = self.swapchain.take() {
            swapchain.destroy(&self.raw);
        }
        for slot in &mut self.view_images {
            if let (Some(mut window_image), Some(allocator)) = (slot.image.take(), &self.allocator) {
                window_image.destroy(&self.raw, &mut lock_allocator(allocator));
            }
        }
        // Buffers are freed before the allocator, and the allocator before the device.
        self.egui = None;
        self.allocator = None;
        // SAFETY: made from this device, no longer used; null handles are ignored.
        unsafe {
            self.raw.destroy_descriptor_pool(self.descriptor_pool, None);
            self.raw.destroy_descriptor_set_layout(self.set_layout, None);
            self.raw.destroy_sampler(self.sampler, None);
            self.raw.destroy_semaphore(self.image_acquired, None);
            self.raw.destroy_fence(self.frame_done, None);
            self.raw.destroy_command_pool(self.command_pool, None);
            self.raw.destroy_device(None);
        }
    }
}
