//! Swapchain of the window.

use super::gpu_error::{ForObject, GpuError};
use super::image::color_subresource_range;
use ash::{khr, vk};

pub(crate) struct Swapchain {
    loader: khr::swapchain::Device,
    raw: vk::SwapchainKHR,
    pub images: Vec<vk::Image>,
    pub views: Vec<vk::ImageView>,
    /// One semaphore per image, signaled when the image has been drawn.
    pub image_drawn: Vec<vk::Semaphore>,
    pub extent: vk::Extent2D,
    /// Size of the window that the swapchain was created for, pixels.
    pub window: [u32; 2],
}

/// Format of a surface, sRGB if available, so that blending is linear and the bytes of images are shown unchanged.
pub(crate) fn surface_format(formats: &[vk::SurfaceFormatKHR]) -> Option<vk::SurfaceFormatKHR> {
    let wanted = [
        vk::Format::B8G8R8A8_SRGB,
        vk::Format::R8G8B8A8_SRGB,
        vk::Format::A8B8G8R8_SRGB_PACK32,
        vk::Format::B8G8R8A8_UNORM,
        vk::Format::R8G8B8A8_UNORM,
    ];
    let best = wanted.iter().find_map(|w| formats.iter().find(|f| f.format == *w));
    best.or(formats.first()).copied()
}

impl Swapchain {
    pub(super) fn new(
        device: &ash::Device,
        loader: khr::swapchain::Device,
        surface: vk::SurfaceKHR,
        capabilities: &vk::SurfaceCapabilitiesKHR,
        format: vk::SurfaceFormatKHR,
        window: [u32; 2],
    ) -> Result<Swapchain, GpuError> {
        // A surface whose size the application chooses reports the maximum value.
        let extent = match capabilities.current_extent {
            vk::Extent2D { width: u32::MAX, .. } => vk::Extent2D {
                width: window[0]
                    .clamp(capabilities.min_image_extent.width, capabilities.max_image_extent.width),
                height: window[1]
                    .clamp(capabilities.min_image_extent.height, capabilities.max_image_extent.height),
            },
            given => given,
        };
        let most = if capabilities.max_image_count == 0 { u32::MAX } else { capabilities.max_image_count };
        let alpha = match capabilities.supported_composite_alpha.contains(vk::CompositeAlphaFlagsKHR::OPAQUE)
        {
            true => vk::CompositeAlphaFlagsKHR::OPAQUE,
            false => vk::CompositeAlphaFlagsKHR::INHERIT,
        };
        let info = vk::SwapchainCreateInfoKHR::default()
            .surface(surface)
            .min_image_count((capabilities.min_image_count + 1).min(most))
            .image_format(format.format)
            .image_color_space(format.color_space)
            .image_extent(extent)
            .image_array_layers(1)
            .image_usage(vk::ImageUsageFlags::COLOR_ATTACHMENT)
            .pre_transform(capabilities.current_transform)
            .composite_alpha(alpha)
            .present_mode(vk::PresentModeKHR::FIFO)
            .clipped(true);
        // SAFETY: surface and device are alive; destroyed by `destroy`, here and below.
        let raw = unsafe { loader.create_swapchain(&info, None) }.for_object("swapchain")?;
        let mut made = Swapchain {
            loader,
            raw,
            images: Vec::new(),
            views: Vec::new(),
            image_drawn: Vec::new(),
            extent,
            window,
        };
        match made.create_views(device, format.format) {
            Ok(()) => Ok(made),
            Err(e) => {
                made.destroy(device);
                Err(e)
            }
        }
    }

    fn create_views(&mut self, device: &ash::Device, format: vk::Format) -> Result<(), GpuError> {
        // SAFETY: as above.
        self.images =
            unsafe { self.loader.get_swapchain_images(self.raw) }.for_object("images of the swapchain")?;
        for image in &self.images {
            let info = vk::ImageViewCreateInfo::default()
                .image(*image)
                .view_type(vk::ImageViewType::TYPE_2D)
                .format(format)
                .subresource_range(color_subresource_range());
            // SAFETY: as above.
            unsafe {
                self.views.push(device.create_image_view(&info, None).for_object("view of the swapchain")?);
                let semaphore = device.create_semaphore(&vk::SemaphoreCreateInfo::default(), None);
                self.image_drawn.push(semaphore.for_object("semaphore")?);
            }
        }
        Ok(())
    }

    /// Acquires the next image. `None` if the surface has changed and a new swapchain is needed.
    pub(super) fn acquire_next(&self, signal: vk::Semaphore) -> Result<Option<u32>, GpuError> {
        const NANOS_PER_SEC: u64 = 1_000_000_000;
        // SAFETY: the semaphore is unsignaled and no frame waits for it.
        match unsafe {
            self.loader.acquire_next_image(self.raw, 5 * NANOS_PER_SEC, signal, vk::Fence::null())
        } {
            // A suboptimal swapchain is still presented, and replaced afterwards.
            Ok((index, _)) => Ok(Some(index)),
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => Ok(None),
            Err(e) => Err(e).for_object("next image of the window"),
        }
    }

    /// Presents an image. Returns whether the swapchain still fits the window.
    pub(super) fn present(&self, queue: vk::Queue, index: u32) -> Result<bool, GpuError> {
        let (chains, indices, wait) = ([self.raw], [index], [self.image_drawn[index as usize]]);
        let info =
            vk::PresentInfoKHR::default().swapchains(&chains).image_indices(&indices).wait_semaphores(&wait);
        // SAFETY: the image was acquired and drawn; the semaphore is signaled by the frame.
        match unsafe { self.loader.queue_present(queue, &info) } {
            Ok(suboptimal) => Ok(!suboptimal),
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => Ok(false),
            Err(e) => Err(e).for_object("showing a frame"),
        }
    }

    /// Frees all objects. No frame may be in flight.
    pub(super) fn destroy(&mut self, device: &ash::Device) {
        // SAFETY: made from this device, no longer used.
        unsafe {
            self.views.drain(..).for_each(|view| device.destroy_image_view(view, None));
            self.image_drawn.drain(..).for_each(|semaphore| device.destroy_semaphore(semaphore, None));
            self.loader.destroy_swapchain(self.raw, None);
        }
        self.raw = vk::SwapchainKHR::null();
    }
}
