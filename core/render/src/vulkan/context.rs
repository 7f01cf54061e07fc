//! The Vulkan objects that everything else needs: loader, instance, validation, device, queue, allocator.

use super::device_features::{Abilities, Ability};
use super::error::Named;
use super::faults::{FaultPlace, Faults};
use crate::error::RenderError;
use crate::renderer::{DeviceInfo, DeviceKind};
use ash::{ext, vk};
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use gpu_allocator::{AllocationSizes, AllocatorDebugSettings};
use std::ffi::{CStr, CString, c_void};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

/// All messages of the validation layer with severity warning or error.
pub(super) type Messages = Arc<Mutex<Vec<String>>>;

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Lock for the validation layer's state of instances and devices, a map that the layer does not lock itself (`layer_data_map`,
/// seen in 1.3.239). Locked for writing while an instance or device is created or destroyed, for reading during all other calls.
static LAYER_STATE: RwLock<()> = RwLock::new(());

fn lock_layer_state() -> RwLockWriteGuard<'static, ()> {
    LAYER_STATE.write().unwrap_or_else(PoisonError::into_inner)
}

pub(crate) struct Context {
    // Keeps libvulkan loaded.
    _entry: ash::Entry,
    instance: ash::Instance,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    names: Option<ext::debug_utils::Device>,
    pub messages: Messages,
    pub properties: vk::PhysicalDeviceProperties,
    pub device: ash::Device,
    pub queue: vk::Queue,
    pub queue_family: u32,
    /// Number of valid bits of the queue's timestamps; 0: it has none.
    pub timestamp_bits: u32,
    pub abilities: Abilities,
    /// `None` only while being dropped.
    allocator: Option<Arc<Mutex<Allocator>>>,
    pub info: DeviceInfo,
    faults: Faults,
    /// Whether a test fault has lost the device: every later call then fails.
    lost: AtomicBool,
}

pub(crate) struct ContextOptions<'a> {
    pub validation: bool,
    /// Part of a device's name, in any case.
    pub device: Option<&'a str>,
    /// Further extensions for a window system; none for a renderer without a window.
    pub instance_extensions: &'a [CString],
    pub device_extensions: &'a [CString],
    /// Uses small blocks of memory, which waste less.
    pub frugal: bool,
    pub faults: Faults,
    /// Abilities to ignore, for tests.
    pub without: &'a [Ability],
    /// Replaces the limit `maxStorageBufferRange`, for tests.
    pub storage_range: Option<u32>,
}

fn no_vulkan(why: impl Into<String>) -> RenderError {
    RenderError::NoVulkan { why: why.into() }
}

/// Kind and name of the device that a `Context` would choose, without creating it.
pub fn chosen_device() -> Result<DeviceInfo, RenderError> {
    let options = ContextOptions {
        validation: false,
        device: None,
        instance_extensions: &[],
        device_extensions: &[],
        frugal: false,
        faults: Faults::default(),
        without: &[],
        storage_range: None,
    };
    let entry = load()?;
    let (instance, _) = create_instance(&entry, &options, &Messages::default())?;
    let info = choose_device(&instance, None).map(|(physical, _)| describe_device(&instance, physical).1);
    // SAFETY: nothing made from the instance is alive.
    unsafe { instance.destroy_instance(None) };
    info
}

/// Sets the number of threads that Mesa's software rasterizer (lavapipe) starts. The driver reads it while it is loaded. Call
/// this before the program starts threads.
pub fn limit_software_threads(count: usize) {
    // SAFETY: the caller has started no thread that reads the environment without the lock of std.
    unsafe { std::env::set_var("LP_NUM_THREADS", count.to_string()) };
}

fn load() -> Result<ash::Entry, RenderError> {
    // SAFETY: libvulkan is the system's loader; the caller keeps the entry as long as its functions are used.
    unsafe { ash::Entry::load() }.map_err(|e| {
        no_vulkan(format!(
            "no Vulkan loader ({e}); install libvulkan1 and a driver (Debian: mesa-vulkan-drivers)"
        ))
    })
}

impl Context {
    pub(crate) fn new(options: &ContextOptions<'_>) -> Result<Context, RenderError> {
        let entry = load()?;
        let messages = Messages::default();
        let _creates = options.validation.then(lock_layer_state);
        let (instance, messenger) = create_instance(&entry, options, &messages)?;
        // Every object that exists by now is destroyed if a later step fails.
        let destroy = |error: RenderError| {
            // SAFETY: nothing made from the instance is alive.
            unsafe {
                if let Some((debug, messenger)) = &messenger {
                    debug.destroy_debug_utils_messenger(*messenger, None);
                }
                instance.destroy_instance(None);
            }
            error
        };
        let (physical, queue_family) = choose_device(&instance, options.device).map_err(destroy)?;
        let (mut properties, info) = describe_device(&instance, physical);
        let range = &mut properties.limits.max_storage_buffer_range;
        *range = options.storage_range.map_or(*range, |most| most.min(*range));
        options.faults.check(FaultPlace::Device).named(&format!("device {}", info.name)).map_err(destroy)?;
        let (device, abilities) =
            create_device(&instance, physical, queue_family, &info, options).map_err(destroy)?;
        // SAFETY: the device belongs to the instance; the family is one of its own.
        let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
        let timestamp_bits = families[queue_family as usize].timestamp_valid_bits;
        // SAFETY: the family and index 0 are those the device was created with.
        let queue = unsafe { device.get_device_queue(queue_family, 0) };
        // Blocks are small on CPU drivers, whose memory is the machine's own.
        let block = match properties.device_type {
            // The smallest block that the allocator supports.
            _ if options.frugal => 4 << 20,
            vk::PhysicalDeviceType::CPU => 16 << 20,
            _ => 64 << 20,
        };
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.clone(),
            device: device.clone(),
            physical_device: physical,
            debug_settings: AllocatorDebugSettings::default(),
            buffer_device_address: false,
            allocation_sizes: AllocationSizes::new(block, block.min(16 << 20)),
        })
        .map_err(|e| {
            // SAFETY: nothing was made from the device yet.
            unsafe { device.destroy_device(None) };
            destroy(RenderError::Vulkan { object: "memory allocator".into(), result: e.to_string() })
        })?;
        if info.kind == DeviceKind::VulkanCpu {
            keep_freed_memory();
        }
        let names = messenger.as_ref().map(|_| ext::debug_utils::Device::new(&instance, &device));
        Ok(Context {
            _entry: entry,
            instance,
            messenger,
            names,
            messages,
            properties,
            device,
            queue,
            queue_family,
            timestamp_bits,
            abilities,
            allocator: Some(Arc::new(Mutex::new(allocator))),
            info,
            faults: options.faults.clone(),
            lost: AtomicBool::new(false),
        })
    }

    /// Lock that each thread holds while it calls the device: with validation, no other thread may create or destroy a device
    /// meanwhile.
    pub(crate) fn lock_for_calls(&self) -> Option<RwLockReadGuard<'static, ()>> {
        self.messenger.is_some().then(|| LAYER_STATE.read().unwrap_or_else(PoisonError::into_inner))
    }

    /// Fails if a test has requested a fault at this place.
    pub(crate) fn inject_fault(&self, place: FaultPlace) -> Result<(), vk::Result> {
        if self.lost.load(Ordering::Relaxed) {
            return Err(vk::Result::ERROR_DEVICE_LOST);
        }
        let fault = self.faults.check(place);
        if fault == Err(vk::Result::ERROR_DEVICE_LOST) {
            self.lost.store(true, Ordering::Relaxed);
        }
        fault
    }

    pub(crate) fn limits(&self) -> &vk::PhysicalDeviceLimits {
        &self.properties.limits
    }

    pub(crate) fn allocator(&self) -> MutexGuard<'_, Allocator> {
        // The allocator is taken out only by `drop`; a panic elsewhere while it was locked leaves it usable.
        let allocator = self.allocator.as_ref().expect("present until drop");
        allocator.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives an object the name that validation messages show.
    pub(crate) fn set_name<T: vk::Handle>(&self, object: T, name: &str) {
        if let (Some(names), Ok(name)) = (&self.names, CString::new(name)) {
            let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
            // Names are only for debugging, so a failure is ignored.
            // SAFETY: the handle belongs to this device.
            let _ = unsafe { names.set_debug_utils_object_name(&info) };
        }
    }

    /// The validation layer's messages since the last call, as one error.
    pub(crate) fn check_messages(&self) -> Result<(), RenderError> {
        let mut messages = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        if messages.is_empty() {
            return Ok(());
        }
        Err(RenderError::Validation(messages.drain(..).collect::<Vec<_>>().join("\n")))
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        let calls = self.lock_for_calls();
        self.allocator = None;
        drop(calls);
        let _destroys = self.messenger.is_some().then(lock_layer_state);
        // SAFETY: the renderer destroyed every object of the device before; allocator, device, messenger and
        // instance go in the reverse order of their making.
        unsafe {
            self.device.destroy_device(None);
            if let Some((debug, messenger)) = self.messenger.take() {
                debug.destroy_debug_utils_messenger(messenger, None);
            }
            self.instance.destroy_instance(None);
        }
    }
}

/// Changes glibc's allocator thresholds. Lavapipe allocates and frees vertex buffers of some megabytes for every draw. By default
/// glibc returns such blocks to the kernel each time, and a fifth of a frame of 25 characters went into page faults.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn keep_freed_memory() {
    unsafe extern "C" {
        fn mallopt(parameter: std::ffi::c_int, value: std::ffi::c_int) -> std::ffi::c_int;
    }
    // Constants of malloc.h: M_TRIM_THRESHOLD and M_MMAP_THRESHOLD, whose largest value is 32 MB.
    const M_TRIM_THRESHOLD: std::ffi::c_int = -1;
    const M_MMAP_THRESHOLD: std::ffi::c_int = -3;
    // SAFETY: glibc's own function, safe to call at any time; it changes when memory is given back, nothing else.
    unsafe {
        mallopt(M_MMAP_THRESHOLD, 32 << 20);
        mallopt(M_TRIM_THRESHOLD, 128 << 20);
    }
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn keep_freed_memory() {}

/// Returns the memory freed by importing and compiling to the kernel, from the heaps of all threads: no thread can use another
/// thread's heap, and [`keep_freed_memory`] is meant for frames only.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub(crate) fn give_back_freed_memory() {
    unsafe extern "C" {
        fn malloc_trim(keep: usize) -> std::ffi::c_int;
    }
    // SAFETY: glibc's own function, safe to call at any time; it touches free memory only.
    unsafe {
        malloc_trim(0);
    }
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) fn give_back_freed_memory() {}

type Messenger = Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>;

fn create_instance(
    entry: &ash::Entry,
    options: &ContextOptions<'_>,
    messages: &Messages,
) -> Result<(ash::Instance, Messenger), RenderError> {
    let app = vk::ApplicationInfo::default()
        .application_name(c"choreo")
        .engine_name(c"choreo")
        .api_version(vk::API_VERSION_1_3);
    let mut extensions: Vec<_> = options.instance_extensions.iter().map(|e| e.as_ptr()).collect();
    let mut layers = Vec::new();
    if options.validation {
        // SAFETY: the loader is loaded.
        let available = unsafe { entry.enumerate_instance_layer_properties() }.named("instance layers")?;
        if !available.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
            return Err(no_vulkan(
                "the validation layer is requested but not installed; install it (Debian: vulkan-validationlayers)",
            ));
        }
        layers.push(VALIDATION_LAYER.as_ptr());
        extensions.push(ext::debug_utils::NAME.as_ptr());
    }
    let mut debug_info = vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(
            vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
        )
        .message_type(
            vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
        )
        .pfn_user_callback(Some(on_message))
        .user_data(Arc::as_ptr(messages) as *mut c_void);
    let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
    let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
    let mut info = vk::InstanceCreateInfo::default()
        .application_info(&app)
        .enabled_layer_names(&layers)
        .enabled_extension_names(&extensions);
    if options.validation {
        info = info.push_next(&mut features).push_next(&mut debug_info);
    }
    // SAFETY: all pointers of `info` live until the call returns; `messages` outlives the instance.
    let instance = unsafe { entry.create_instance(&info, None) }.map_err(|r| match r {
        vk::Result::ERROR_INCOMPATIBLE_DRIVER => no_vulkan(
            "there is a Vulkan loader but no driver; install a driver (Debian: mesa-vulkan-drivers)",
        ),
        vk::Result::ERROR_EXTENSION_NOT_PRESENT => {
            no_vulkan("the driver lacks an instance extension that the window system or validation needs")
        }
        r => RenderError::Vulkan { object: "instance".into(), result: format!("{r:?}") },
    })?;
    if !options.validation {
        return Ok((instance, None));
    }
    let debug = ext::debug_utils::Instance::new(entry, &instance);
    let info = vk::DebugUtilsMessengerCreateInfoEXT { p_next: std::ptr::null(), ..debug_info };
    // SAFETY: the callback's user data is kept alive by the context, which destroys the messenger first.
    match unsafe { debug.create_debug_utils_messenger(&info, None) } {
        Ok(messenger) => Ok((instance, Some((debug, messenger)))),
        Err(r) => {
            // SAFETY: nothing was made from the instance.
            unsafe { instance.destroy_instance(None) };
            Err(r).named("debug messenger")
        }
    }
}

/// Collects a validation message. The layer calls this on the thread that made the mistake.
unsafe extern "system" fn on_message(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: `user` is the context's `Messages`, alive as long as the messenger; `data` and its text are valid during the call.
    let (messages, text) = unsafe {
        let messages = &*(user as *const Mutex<Vec<String>>);
        let text = (*data).message_as_c_str().map(|t| t.to_string_lossy().into_owned());
        (messages, text.unwrap_or_default())
    };
    let mut messages = messages.lock().unwrap_or_else(PoisonError::into_inner);
    // A mistake in every draw would otherwise fill the memory.
    if messages.len() < 100 {
        messages.push(text);
    }
    vk::FALSE
}

/// Chooses a device: discrete before integrated before CPU. Only devices with Vulkan 1.3 and a graphics queue qualify.
fn choose_device(
    instance: &ash::Instance,
    wanted: Option<&str>,
) -> Result<(vk::PhysicalDevice, u32), RenderError> {
    // SAFETY: the instance is alive, and so are the devices it lists.
    let devices = unsafe { instance.enumerate_physical_devices() }.named("list of devices")?;
    let mut seen = Vec::new();
    let mut best: Option<(u32, vk::PhysicalDevice, u32)> = None;
    for device in devices {
        // SAFETY: as above.
        let (p, families) = unsafe {
            (
                instance.get_physical_device_properties(device),
                instance.get_physical_device_queue_family_properties(device),
            )
        };
        let name = p.device_name_as_c_str().unwrap_or(c"?").to_string_lossy().into_owned();
        seen.push(name.clone());
        if wanted.is_some_and(|w| !name.to_lowercase().contains(&w.to_lowercase()))
            || p.api_version < vk::API_VERSION_1_3
        {
            continue;
        }
        let graphics = families.iter().position(|f| f.queue_flags.contains(vk::QueueFlags::GRAPHICS));
        let rank = match p.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => 4,
            vk::PhysicalDeviceType::INTEGRATED_GPU => 3,
            vk::PhysicalDeviceType::VIRTUAL_GPU => 2,
            _ => 1,
        };
        if let Some(family) = graphics
            && best.is_none_or(|(r, _, _)| rank > r)
        {
            best = Some((rank, device, family as u32));
        }
    }
    best.map(|(_, device, family)| (device, family)).ok_or_else(|| {
        let seen = if seen.is_empty() { "none".to_string() } else { seen.join(", ") };
        match wanted {
            Some(w) => {
                no_vulkan(format!("no Vulkan 1.3 device whose name contains \"{w}\"; devices: {seen}"))
            }
            None => no_vulkan(format!("no device with Vulkan 1.3 and a graphics queue; devices: {seen}")),
        }
    })
}

fn describe_device(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
) -> (vk::PhysicalDeviceProperties, DeviceInfo) {
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut all = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
    // SAFETY: the device belongs to the instance; the chain lives until the call returns.
    unsafe { instance.get_physical_device_properties2(physical, &mut all) };
    let properties = all.properties;
    let text = |c: Result<&CStr, _>| -> String {
        c.map(|c: &CStr| c.to_string_lossy().into_owned())
            .unwrap_or_else(|_: std::ffi::FromBytesUntilNulError| String::new())
    };
    let info = DeviceInfo {
        kind: if properties.device_type == vk::PhysicalDeviceType::CPU {
            DeviceKind::VulkanCpu
        } else {
            DeviceKind::VulkanGpu
        },
        name: text(properties.device_name_as_c_str()),
        driver: format!("{} {}", text(driver.driver_name_as_c_str()), text(driver.driver_info_as_c_str())),
    };
    (properties, info)
}

fn create_device(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    queue_family: u32,
    info: &DeviceInfo,
    options: &ContextOptions<'_>,
) -> Result<(ash::Device, Abilities), RenderError> {
    let mut has12 = vk::PhysicalDeviceVulkan12Features::default();
    let mut has13 = vk::PhysicalDeviceVulkan13Features::default();
    let mut has = vk::PhysicalDeviceFeatures2::default().push_next(&mut has12).push_next(&mut has13);
    // SAFETY: the device belongs to the instance; the chain lives until the call returns.
    unsafe { instance.get_physical_device_features2(physical, &mut has) };
    let color_attachments = super::deferred::color_attachments(instance, physical);
    // SAFETY: the device belongs to the instance.
    let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
    let queue = families[queue_family as usize].queue_flags;
    let abilities = Abilities::of(&has.features, color_attachments, queue, options.without);
    let optional = abilities.features();
    for (name, has) in [
        ("timelineSemaphore", has12.timeline_semaphore),
        ("dynamicRendering", has13.dynamic_rendering),
        ("synchronization2", has13.synchronization2),
    ] {
        if has == vk::FALSE {
            return Err(no_vulkan(format!("{} lacks the feature {name}", info.name)));
        }
    }
    let priorities = [1.0];
    let queues =
        [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&priorities)];
    let extensions: Vec<_> = options.device_extensions.iter().map(|e| e.as_ptr()).collect();
    let mut features12 = vk::PhysicalDeviceVulkan12Features::default().timeline_semaphore(true);
    let mut features13 =
        vk::PhysicalDeviceVulkan13Features::default().dynamic_rendering(true).synchronization2(true);
    let create = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(&extensions)
        .enabled_features(&optional)
        .push_next(&mut features12)
        .push_next(&mut features13);
    // SAFETY: features were requested above; all pointers live until the call returns.
    let device = unsafe { instance.create_device(physical, &create, None) };
    Ok((device.named(&format!("device {}", info.name))?, abilities))
}
