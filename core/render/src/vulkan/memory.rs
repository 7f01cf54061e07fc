//! Buffers and images with their device memory.

use super::context::Context;
use super::error::Named;
use super::faults::FaultPlace;
use crate::error::RenderError;
use ash::vk;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};
use gpu_allocator::{AllocationError, MemoryLocation};

pub(crate) struct Buffer {
    pub raw: vk::Buffer,
    allocation: Option<Allocation>,
    pub size: u64,
}

fn allocate(gpu: &Context, desc: &AllocationCreateDesc<'_>) -> Result<Allocation, RenderError> {
    let object = format!("memory of {}", desc.name);
    gpu.inject_fault(FaultPlace::Memory).named(&object)?;
    gpu.allocator().allocate(desc).map_err(|e| match e {
        AllocationError::OutOfMemory => RenderError::OutOfMemory { object },
        e => RenderError::Vulkan { object, result: e.to_string() },
    })
}

impl Buffer {
    pub(crate) fn new(
        gpu: &Context,
        name: &str,
        size: u64,
        usage: vk::BufferUsageFlags,
        location: MemoryLocation,
    ) -> Result<Buffer, RenderError> {
        Buffer::with_scheme(gpu, name, size, usage, location, |_| AllocationScheme::GpuAllocatorManaged)
    }

    /// A host-visible staging buffer with dedicated memory, which returns to the driver with the buffer. All meshes and textures
    /// pass through once, and a larger block would keep the memory.
    pub(crate) fn staging(gpu: &Context, size: u64) -> Result<Buffer, RenderError> {
        let usage = vk::BufferUsageFlags::TRANSFER_SRC;
        let scheme = AllocationScheme::DedicatedBuffer;
        Buffer::with_scheme(gpu, "staging buffer", size, usage, MemoryLocation::CpuToGpu, scheme)
    }

    fn with_scheme(
        gpu: &Context,
        name: &str,
        size: u64,
        usage: vk::BufferUsageFlags,
        location: MemoryLocation,
        scheme: impl FnOnce(vk::Buffer) -> AllocationScheme,
    ) -> Result<Buffer, RenderError> {
        let size = size.max(16);
        let info = vk::BufferCreateInfo::default().size(size).usage(usage);
        // SAFETY: the device is alive; the buffer is freed by `destroy`.
        let raw = unsafe { gpu.device.create_buffer(&info, None) }.named(name)?;
        gpu.set_name(raw, name);
        let mut buffer = Buffer { raw, allocation: None, size };
        // SAFETY: the buffer was just made.
        let requirements = unsafe { gpu.device.get_buffer_memory_requirements(raw) };
        let allocation_scheme = scheme(raw);
        let desc = AllocationCreateDesc { name, requirements, location, linear: true, allocation_scheme };
        let bound = allocate(gpu, &desc).and_then(|a| {
            // SAFETY: the memory was allocated for this buffer's requirements and is bound once.
            let bound = unsafe { gpu.device.bind_buffer_memory(raw, a.memory(), a.offset()) };
            buffer.allocation = Some(a);
            bound.named(&format!("memory of {name}"))
        });
        match bound {
            Ok(()) => Ok(buffer),
            Err(e) => {
                buffer.destroy(gpu);
                Err(e)
            }
        }
    }

    /// The bytes of a host-visible buffer; empty if it is not mapped.
    pub(crate) fn mapped(&self) -> &[u8] {
        self.allocation.as_ref().and_then(|a| a.mapped_slice()).unwrap_or(&[])
    }

    pub(crate) fn mapped_mut(&mut self) -> &mut [u8] {
        self.allocation.as_mut().and_then(|a| a.mapped_slice_mut()).unwrap_or(&mut [])
    }

    /// Destroys the buffer. No frame in flight may use it.
    pub(crate) fn destroy(&mut self, gpu: &Context) {
        // SAFETY: made from this device, no longer used; null after the first call.
        unsafe { gpu.device.destroy_buffer(self.raw, None) };
        self.raw = vk::Buffer::null();
        if let Some(a) = self.allocation.take() {
            // Fails only for an allocation from another allocator.
            let _ = gpu.allocator().free(a);
        }
    }
}

pub(crate) struct Image {
    pub raw: vk::Image,
    pub view: vk::ImageView,
    allocation: Option<Allocation>,
}

pub(crate) struct ImageDesc<'a> {
    pub name: &'a str,
    pub width: u32,
    pub height: u32,
    pub levels: u32,
    pub samples: u32,
    pub format: vk::Format,
    pub usage: vk::ImageUsageFlags,
    pub aspect: vk::ImageAspectFlags,
}

impl Image {
    pub(crate) fn new(gpu: &Context, d: &ImageDesc<'_>) -> Result<Image, RenderError> {
        let limit = gpu.limits().max_image_dimension2_d;
        for (what, value) in [("width", d.width), ("height", d.height)] {
            if value > limit || value == 0 {
                return Err(RenderError::Limit {
                    what: format!("{what} of {}", d.name),
                    value: value as u64,
                    limit: limit as u64,
                });
            }
        }
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(d.format)
            .extent(vk::Extent3D { width: d.width, height: d.height, depth: 1 })
            .mip_levels(d.levels)
            .array_layers(1)
            .samples(vk::SampleCountFlags::from_raw(d.samples))
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(d.usage);
        // SAFETY: the device is alive; the image is freed by `destroy`.
        let raw = unsafe { gpu.device.create_image(&info, None) }.named(d.name)?;
        gpu.set_name(raw, d.name);
        let mut image = Image { raw, view: vk::ImageView::null(), allocation: None };
        match image.bind_and_view(gpu, d) {
            Ok(()) => Ok(image),
            Err(e) => {
                image.destroy(gpu);
                Err(e)
            }
        }
    }

    fn bind_and_view(&mut self, gpu: &Context, d: &ImageDesc<'_>) -> Result<(), RenderError> {
        // SAFETY: the image was just made.
        let requirements = unsafe { gpu.device.get_image_memory_requirements(self.raw) };
        let desc = AllocationCreateDesc {
            name: d.name,
            requirements,
            location: MemoryLocation::GpuOnly,
            linear: false,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        };
        let allocation = allocate(gpu, &desc)?;
        // SAFETY: the memory was allocated for this image's requirements and is bound once.
        let bound =
            unsafe { gpu.device.bind_image_memory(self.raw, allocation.memory(), allocation.offset()) };
        self.allocation = Some(allocation);
        bound.named(&format!("memory of {}", d.name))?;
        let info = vk::ImageViewCreateInfo::default()
            .image(self.raw)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(d.format)
            .subresource_range(all_mip_levels(d.aspect));
        // SAFETY: the image has memory and a format that the view repeats.
        self.view = unsafe { gpu.device.create_image_view(&info, None) }.named(d.name)?;
        gpu.set_name(self.view, d.name);
        Ok(())
    }

    /// Destroys the image. No frame in flight may use it.
    pub(crate) fn destroy(&mut self, gpu: &Context) {
        // SAFETY: made from this device, no longer used; null after the first call.
        unsafe {
            gpu.device.destroy_image_view(self.view, None);
            gpu.device.destroy_image(self.raw, None);
        }
        self.view = vk::ImageView::null();
        self.raw = vk::Image::null();
        if let Some(a) = self.allocation.take() {
            // Fails only for an allocation from another allocator.
            let _ = gpu.allocator().free(a);
        }
    }
}

/// Subresource range of all mip levels.
pub(super) fn all_mip_levels(aspect: vk::ImageAspectFlags) -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange {
        aspect_mask: aspect,
        base_mip_level: 0,
        level_count: vk::REMAINING_MIP_LEVELS,
        base_array_layer: 0,
        layer_count: 1,
    }
}
