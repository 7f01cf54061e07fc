//! The rendered frame as a texture of the window's own device.
//!
//! The frame is copied through host memory: the renderer has a device of its own, which can be lost, replaced or not be a Vulkan device at all
//! without an effect on the window, and draws on a thread of its own. At 1280×720 the copy is 3.7 MB per frame.

use super::gpu_error::{ForObject, GpuError};
use ash::vk;
use choreo_plugin::Frame;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator};

pub(crate) struct WindowImage {
    pub size: [u32; 2],
    image: vk::Image,
    view: vk::ImageView,
    memory: Option<Allocation>,
    staging: vk::Buffer,
    staging_memory: Option<Allocation>,
    /// Whether the image has never been written.
    is_unwritten: bool,
}

impl WindowImage {
    pub(super) fn new(
        device: &ash::Device,
        allocator: &mut Allocator,
        size: [u32; 2],
    ) -> Result<WindowImage, GpuError> {
        let mut window_image = WindowImage {
            size,
            image: vk::Image::null(),
            view: vk::ImageView::null(),
            memory: None,
            staging: vk::Buffer::null(),
            staging_memory: None,
            is_unwritten: true,
        };
        match window_image.create_objects(device, allocator) {
            Ok(()) => Ok(window_image),
            Err(e) => {
                window_image.destroy(device, allocator);
                Err(e)
            }
        }
    }

    fn create_objects(&mut self, device: &ash::Device, allocator: &mut Allocator) -> Result<(), GpuError> {
        let [width, height] = self.size;
        // The format is sRGB: sampling decodes and writing encodes again, so that the bytes do not change.
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(vk::Format::R8G8B8A8_SRGB)
            .extent(vk::Extent3D { width, height, depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST);
        // SAFETY: the device is alive; what is made is destroyed by `destroy`, here and below.
        let requirements = unsafe {
            self.image = device.create_image(&info, None).for_object("image")?;
            device.get_image_memory_requirements(self.image)
        };
        let memory = allocator.allocate(&AllocationCreateDesc {
            name: "picture",
            requirements,
            location: MemoryLocation::GpuOnly,
            linear: false,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        });
        let memory = self.memory.insert(memory.for_object("memory of the image")?);
        // SAFETY: the memory is the image's own, of the size that it requested.
        unsafe { device.bind_image_memory(self.image, memory.memory(), memory.offset()) }
            .for_object("image")?;
        let range = color_subresource_range();
        let info = vk::ImageViewCreateInfo::default()
            .image(self.image)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(vk::Format::R8G8B8A8_SRGB)
            // The window shows transparent pixels of a file as opaque.
            .components(vk::ComponentMapping { a: vk::ComponentSwizzle::ONE, ..Default::default() })
            .subresource_range(range);
        // SAFETY: as above.
        self.view = unsafe { device.create_image_view(&info, None) }.for_object("view of the image")?;
        let bytes = u64::from(width) * u64::from(height) * 4;
        let info = vk::BufferCreateInfo::default().size(bytes).usage(vk::BufferUsageFlags::TRANSFER_SRC);
        // SAFETY: as above.
        let requirements = unsafe {
            self.staging = device.create_buffer(&info, None).for_object("staging buffer")?;
            device.get_buffer_memory_requirements(self.staging)
        };
        let memory = allocator.allocate(&AllocationCreateDesc {
            name: "staging buffer",
            requirements,
            location: MemoryLocation::CpuToGpu,
            linear: true,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        });
        let memory = self.staging_memory.insert(memory.for_object("memory of the staging buffer")?);
        // SAFETY: as above.
        unsafe { device.bind_buffer_memory(self.staging, memory.memory(), memory.offset()) }
            .for_object("staging buffer")
    }

    pub(super) fn view(&self) -> vk::ImageView {
        self.view
    }

    /// Records the upload of a frame with the size of the image. The image must not be in use by a frame in flight.
    pub(super) fn upload(&mut self, device: &ash::Device, commands: vk::CommandBuffer, frame: &Frame) {
        let Some(to) = self.staging_memory.as_mut().and_then(Allocation::mapped_slice_mut) else { return };
        let bytes = frame.rgba.len().min(to.len());
        to[..bytes].copy_from_slice(&frame.rgba[..bytes]);
        let barrier = |from, to, before: (vk::PipelineStageFlags2, vk::AccessFlags2), after: (_, _)| {
            vk::ImageMemoryBarrier2::default()
                .image(self.image)
                .subresource_range(color_subresource_range())
                .old_layout(from)
                .new_layout(to)
                .src_stage_mask(before.0)
                .src_access_mask(before.1)
                .dst_stage_mask(after.0)
                .dst_access_mask(after.1)
                .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        };
        use vk::{AccessFlags2 as A, ImageLayout as L, PipelineStageFlags2 as S};
        let old = if self.is_unwritten { L::UNDEFINED } else { L::SHADER_READ_ONLY_OPTIMAL };
        self.is_unwritten = false;
        let write = (S::COPY, A::TRANSFER_WRITE);
        let read = (S::FRAGMENT_SHADER, A::SHADER_SAMPLED_READ);
        let before = [barrier(old, L::TRANSFER_DST_OPTIMAL, (S::FRAGMENT_SHADER, A::NONE), write)];
        let after = [barrier(L::TRANSFER_DST_OPTIMAL, L::SHADER_READ_ONLY_OPTIMAL, write, read)];
        let region = vk::BufferImageCopy::default()
            .image_subresource(vk::ImageSubresourceLayers {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                mip_level: 0,
                base_array_layer: 0,
                layer_count: 1,
            })
            .image_extent(vk::Extent3D { width: self.size[0], height: self.size[1], depth: 1 });
        // SAFETY: commands are being recorded; image and buffer live until they are done, as the caller waits for it.
        unsafe {
            device.cmd_pipeline_barrier2(
                commands,
                &vk::DependencyInfo::default().image_memory_barriers(&before),
            );
            device.cmd_copy_buffer_to_image(
                commands,
                self.staging,
                self.image,
                L::TRANSFER_DST_OPTIMAL,
                &[region],
            );
            device.cmd_pipeline_barrier2(
                commands,
                &vk::DependencyInfo::default().image_memory_barriers(&after),
            );
        }
    }

    /// Frees the image, which must not be in use by a frame in flight.
    pub(super) fn destroy(&mut self, device: &ash::Device, allocator: &mut Allocator) {
        // SAFETY: made from this device, no longer used; null handles are ignored.
        unsafe {
            device.destroy_image_view(self.view, None);
            device.destroy_image(self.image, None);
            device.destroy_buffer(self.staging, None);
        }
        for memory in self.memory.take().into_iter().chain(self.staging_memory.take()) {
            // Freeing only fails for memory of another allocator.
            let _ = allocator.free(memory);
        }
    }
}

pub(super) fn color_subresource_range() -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange {
        aspect_mask: vk::ImageAspectFlags::COLOR,
        base_mip_level: 0,
        level_count: 1,
        base_array_layer: 0,
        layer_count: 1,
    }
}
