//! Choice of the device that draws the window.

use super::gpu_error::{ForObject, GpuError};
use ash::{khr, vk};
use choreo_command_line::software_vulkan_reason;

/// The best device that can present to the surface. A GPU is preferred to a driver that draws on the CPU, which is refused unless the user asked
/// for Vulkan by name.
pub(super) fn choose_device(
    instance: &ash::Instance,
    surfaces: &khr::surface::Instance,
    surface: vk::SurfaceKHR,
    accepts_software: bool,
) -> Result<(vk::PhysicalDevice, u32), GpuError> {
    let mut best: Option<(u32, vk::PhysicalDevice, u32)> = None;
    // SAFETY: the instance is alive.
    for physical in unsafe { instance.enumerate_physical_devices() }.for_object("list of devices")? {
        // SAFETY: the instance is alive, and so are the devices that it lists.
        let (properties, families) = unsafe {
            (
                instance.get_physical_device_properties(physical),
                instance.get_physical_device_queue_family_properties(physical),
            )
        };
        let rank = match properties.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => 4,
            vk::PhysicalDeviceType::INTEGRATED_GPU => 3,
            vk::PhysicalDeviceType::VIRTUAL_GPU => 2,
            _ => 1,
        };
        let family = (0u32..).zip(&families).find(|(index, family)| {
            // SAFETY: the device and the surface belong to the instance; the index is one of the device's families.
            let shows = unsafe { surfaces.get_physical_device_surface_support(physical, *index, surface) };
            family.queue_flags.contains(vk::QueueFlags::GRAPHICS) && shows.unwrap_or(false)
        });
        if let Some((family, _)) = family
            && properties.api_version >= vk::API_VERSION_1_3
            && best.is_none_or(|(r, ..)| rank > r)
        {
            best = Some((rank, physical, family));
        }
    }
    let (_, physical, family) = best.ok_or_else(|| {
        let why = "no device with Vulkan 1.3 can show images in this window";
        GpuError::Unavailable(format!("{why}\n    hint: apt install mesa-vulkan-drivers"))
    })?;
    // SAFETY: the instance is alive, and the device one of those that it lists.
    let properties = unsafe { instance.get_physical_device_properties(physical) };
    if !accepts_software && properties.device_type == vk::PhysicalDeviceType::CPU {
        let name = properties.device_name_as_c_str().unwrap_or_default().to_string_lossy();
        return Err(GpuError::SoftwareOnly(software_vulkan_reason(&name)));
    }
    Ok((physical, family))
}
