//! The window's own Vulkan instance, surface and device; draws a frame of the window from triangles. With `device`, this is the only place besides
//! `choreo_render::vulkan` that uses ash.

use super::choose::choose_device;
use super::device::Device;
use super::gpu_error::{ForObject, GpuError};
use super::swapchain::surface_format;
use ash::{khr, vk};
use choreo_plugin::Frame;
use egui::{ClippedPrimitive, TextureId, TexturesDelta};
use std::collections::BTreeMap;
use winit::raw_window_handle::{HasDisplayHandle, HasWindowHandle};
use winit::window::Window;

pub(crate) struct Gpu {
    _entry: ash::Entry,
    instance: ash::Instance,
    surfaces: khr::surface::Instance,
    surface: vk::SurfaceKHR,
    physical: vk::PhysicalDevice,
    device: Option<Device>,
}

impl Gpu {
    /// Opens a device for a window. `accepts_software`: whether a driver that draws on the CPU is accepted, too.
    pub(super) fn new(window: &Window, accepts_software: bool) -> Result<Gpu, GpuError> {
        let other = |object: &'static str, text: String| GpuError::Other { object, text };
        // SAFETY: loading libvulkan runs its own initializers, as every Vulkan program does.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| {
            GpuError::Unavailable(format!("{e}\n    hint: apt install libvulkan1 mesa-vulkan-drivers"))
        })?;
        let display = window.display_handle().map_err(|e| other("display", e.to_string()))?.as_raw();
        let handle = window.window_handle().map_err(|e| other("window", e.to_string()))?.as_raw();
        let extensions =
            ash_window::enumerate_required_extensions(display).for_object("window extensions")?;
        let app =
            vk::ApplicationInfo::default().application_name(c"choreo-view").api_version(vk::API_VERSION_1_3);
        let info =
            vk::InstanceCreateInfo::default().application_info(&app).enabled_extension_names(extensions);
        // SAFETY: all pointers of `info` live until the call returns.
        let instance = unsafe { entry.create_instance(&info, None) }.map_err(|e| {
            GpuError::Unavailable(format!(
                "no Vulkan driver can draw into a window: {e:?}\n    hint: apt install mesa-vulkan-drivers"
            ))
        })?;
        let surfaces = khr::surface::Instance::new(&entry, &instance);
        let mut gpu = Gpu {
            _entry: entry,
            instance,
            surfaces,
            surface: vk::SurfaceKHR::null(),
            physical: vk::PhysicalDevice::null(),
            device: None,
        };
        // `drop` frees everything that is created below.
        // SAFETY: the handles are the window's, which outlives this.
        gpu.surface =
            unsafe { ash_window::create_surface(&gpu._entry, &gpu.instance, display, handle, None) }
                .for_object("surface of the window")?;
        let (physical, family) = choose_device(&gpu.instance, &gpu.surfaces, gpu.surface, accepts_software)?;
        gpu.physical = physical;
        let device = gpu.open_device(family)?;
        gpu.device = Some(device);
        Ok(gpu)
    }

    fn open_device(&self, family: u32) -> Result<Device, GpuError> {
        let priorities = [1.0];
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&priorities)];
        let extensions = [khr::swapchain::NAME.as_ptr()];
        let mut features =
            vk::PhysicalDeviceVulkan13Features::default().dynamic_rendering(true).synchronization2(true);
        let info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&extensions)
            .push_next(&mut features);
        // SAFETY: all pointers of `info` live until the call returns; Vulkan 1.3 has these features, and the window's surface the
        // extension.
        let raw = unsafe { self.instance.create_device(self.physical, &info, None) }.for_object("device")?;
        // SAFETY: the device was made with one queue of this family.
        let queue = unsafe { raw.get_device_queue(family, 0) };
        // SAFETY: surface and device are alive.
        let formats =
            unsafe { self.surfaces.get_physical_device_surface_formats(self.physical, self.surface) };
        // SAFETY: the device belongs to the instance, which is alive.
        let limits = unsafe { self.instance.get_physical_device_properties(self.physical) }.limits;
        let mut device = Device::new(&self.instance, raw, queue, limits.max_image_dimension2_d as usize);
        // `drop` frees everything that is created below.
        let formats = formats.for_object("formats of the window")?;
        device.format = surface_format(&formats).ok_or(GpuError::Other {
            object: "window",
            text: "its surface has no supported color format".into(),
        })?;
        device.create_objects(&self.instance, self.physical, family)?;
        Ok(device)
    }

    /// Largest width or height of a texture, pixels.
    pub(crate) fn largest_texture(&self) -> usize {
        self.device.as_ref().map_or(2048, |d| d.largest_texture)
    }

    /// Texture with the last frame of each view, if it has one.
    pub(super) fn view_textures(&self) -> Vec<Option<TextureId>> {
        self.device.iter().flat_map(|d| &d.view_images).map(|slot| slot.id).collect()
    }

    /// Draws one frame of the window. `frames`: new images of views; `before_present`: called directly before presenting. Returns whether the frame
    /// was drawn: a window without pixels, such as a minimized one, keeps its images waiting.
    pub(super) fn draw(
        &mut self,
        window: [u32; 2],
        primitives: &[ClippedPrimitive],
        pixels_per_point: f32,
        mut textures: TexturesDelta,
        frames: &BTreeMap<usize, Frame>,
        before_present: impl FnOnce(),
    ) -> Result<bool, GpuError> {
        let device = self.device.as_mut().ok_or_else(|| GpuError::Unavailable("the device was lost".into()));
        let ready = device.and_then(|d| d.wait_for_last_frame().map(|()| d));
        let device = ready.inspect_err(|_| textures.clear())?;
        device.update_textures(textures)?;
        // While a window is being resized, the first new swapchain may not fit.
        for _ in 0..3 {
            if device.swapchain.as_ref().is_none_or(|s| s.window != window) {
                // SAFETY: surface and device are alive.
                let capabilities = unsafe {
                    self.surfaces.get_physical_device_surface_capabilities(self.physical, self.surface)
                };
                let capabilities = capabilities.for_object("capabilities of the window surface")?;
                if capabilities.current_extent.width == 0 || capabilities.current_extent.height == 0 {
                    return Ok(false);
                }
                device.new_swapchain(self.surface, &capabilities, window)?;
            }
            let Some(swapchain) = &device.swapchain else { return Ok(false) };
            let Some(index) = swapchain.acquire_next(device.image_acquired)? else {
                device.drop_swapchain()?;
                continue;
            };
            // Only uploaded images are shown, since a texture that was never written must not be sampled.
            for (view, frame) in frames {
                device.prepare_view_image(*view, [frame.width, frame.height])?;
            }
            device.record(index, primitives, pixels_per_point, frames)?;
            device.submit(index)?;
            before_present();
            let fits = device.swapchain.as_ref().map_or(Ok(true), |s| s.present(device.queue, index))?;
            if !fits {
                device.drop_swapchain()?;
            }
            return Ok(true);
        }
        Ok(false)
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        self.device = None;
        // SAFETY: everything made from them has gone.
        unsafe {
            self.surfaces.destroy_surface(self.surface, None);
            self.instance.destroy_instance(None);
        }
    }
}
