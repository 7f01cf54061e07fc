//! Event loop and renderer at startup, with messages that name the package of a missing library.

use super::WindowMessage;
use super::error::ViewerError;
use super::event_log::EventLog;
use choreo_command_line::Device;
use choreo_plugin::Effect;
use choreo_render::vulkan::{GpuOptions, RecoveringRenderer, chosen_device};
use choreo_render::{CpuRenderer, DeviceKind, Renderer};
use choreo_session::StartRenderer;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind, set_hook, take_hook};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use winit::application::ApplicationHandler;
use winit::event_loop::EventLoop;

/// Part of the system's error message, and the Debian and Ubuntu packages that fix it.
const PACKAGES: [(&str, &str); 8] = [
    ("xkbcommon-x11", "libxkbcommon-x11-0 libxkbcommon0"),
    ("xkbcommon", "libxkbcommon0 libxkbcommon-x11-0"),
    ("libXcursor", "libxcursor1"),
    ("libXi", "libxi6"),
    ("libX11-xcb", "libx11-xcb1"),
    ("libX11", "libx11-6 libx11-xcb1 libxcursor1 libxi6"),
    // The message of winit does not name the missing library.
    ("xlib's shared libraries", "libx11-6 libx11-xcb1 libxcursor1 libxi6"),
    ("wayland library", "libwayland-client0"),
];

pub(crate) fn create_event_loop() -> Result<EventLoop<WindowMessage>, ViewerError> {
    let set = |name: &str| std::env::var_os(name).is_some_and(|v| !v.is_empty());
    let windows = cfg!(windows) || cfg!(target_os = "macos");
    if !windows && !set("DISPLAY") && !set("WAYLAND_DISPLAY") && !set("WAYLAND_SOCKET") {
        return Err(window_error("there is no display: neither WAYLAND_DISPLAY nor DISPLAY is set"));
    }
    // xkbcommon-dl panics if the library is missing; the panic is reported as our own error.
    let hook = take_hook();
    set_hook(Box::new(|_| ()));
    let made = catch_unwind(|| {
        let mut builder = EventLoop::<WindowMessage>::with_user_event();
        #[cfg(target_os = "linux")]
        if set("DISPLAY") && !set("WAYLAND_SOCKET") && set("WAYLAND_DISPLAY") && !wayland_answers() {
            // winit chooses Wayland if its variable is set, and an event loop can only be created once.
            winit::platform::x11::EventLoopBuilderExtX11::with_x11(&mut builder);
        }
        builder.build()
    });
    set_hook(hook);
    match made {
        Ok(Ok(events)) => Ok(events),
        Ok(Err(error)) => Err(window_error(&error.to_string())),
        Err(panic) => Err(window_error(panic_message(&*panic))),
    }
}

/// Whether a compositor listens at the socket of `WAYLAND_DISPLAY` (`man wl_display_connect`). The variable may be left over, or passed into a
/// container without the socket.
#[cfg(target_os = "linux")]
fn wayland_answers() -> bool {
    let name = PathBuf::from(std::env::var_os("WAYLAND_DISPLAY").unwrap_or_default());
    let folder = PathBuf::from(std::env::var_os("XDG_RUNTIME_DIR").unwrap_or_default());
    std::os::unix::net::UnixStream::connect(folder.join(name)).is_ok()
}

/// Runs the event loop. If the display disappears, winit panics (its X11 window unwraps every reply of the server); this function returns an error
/// instead.
pub(super) fn run(
    events: EventLoop<WindowMessage>,
    app: &mut impl ApplicationHandler<WindowMessage>,
) -> Result<(), ViewerError> {
    let gone = Arc::new(AtomicBool::new(false));
    let usual = take_hook();
    let (seen, thread) = (gone.clone(), std::thread::current().id());
    set_hook(Box::new(move |panic| {
        let winit = panic.location().is_some_and(|place| place.file().contains("winit"));
        match winit && std::thread::current().id() == thread {
            true => seen.store(true, Ordering::SeqCst),
            false => usual(panic),
        }
    }));
    let ran = catch_unwind(AssertUnwindSafe(|| events.run_app(app)));
    drop(take_hook());
    match ran {
        Ok(ran) => Ok(ran?),
        Err(panic) if gone.load(Ordering::SeqCst) => {
            Err(ViewerError::WindowSystemGone(panic_message(&*panic).to_string()))
        }
        Err(panic) => resume_unwind(panic),
    }
}

fn panic_message(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("a library is missing")
}

/// Error about a window that cannot be opened. `why`: message of the system.
pub(crate) fn window_error(why: &str) -> ViewerError {
    let why = without_source_location(why);
    let package = PACKAGES.iter().find(|(part, _)| why.contains(part));
    let package = package.map_or_else(String::new, |(_, names)| format!("\n    hint: apt install {names}"));
    ViewerError::NoWindow(format!(
        "cannot open a window: {why}{package}\n    choreo render draws the same frames without one"
    ))
}

/// The message without the position in winit's source, which winit prepends.
fn without_source_location(why: &str) -> &str {
    let place = why.strip_prefix("os error at ").and_then(|rest| rest.split_once(".rs:"));
    place.and_then(|(_, rest)| rest.split_once(": ")).map_or(why, |(_, words)| words)
}

/// Starts the renderer that `choreo render` would use. Custom shaders require Vulkan, so that a software driver is accepted for them, too.
pub(super) fn start_renderer(
    effects: Vec<Effect>,
    shaders: Option<PathBuf>,
    device: Device,
    event_log: EventLog,
) -> StartRenderer {
    let auto = device == Device::Auto && shaders.is_none();
    Box::new(move || {
        super::priority::lower_for_background_work();
        let slower = || chosen_device().is_ok_and(|found| found.kind == DeviceKind::VulkanCpu);
        if device == Device::Cpu || auto && slower() {
            event_log.log_step("renderer");
            return Ok((Box::new(CpuRenderer::new(&effects)), None));
        }
        let cache_dir = choreo_command_line::cache_dir();
        let options =
            GpuOptions { cache_dir, shader_dir: shaders, effects: effects.clone(), ..GpuOptions::default() };
        let renderer: (Box<dyn Renderer>, Option<String>) = match RecoveringRenderer::new(options) {
            Ok(renderer) => (Box::new(renderer), None),
            Err(error) if device == Device::Vulkan => return Err(error),
            Err(error) => {
                let note = format!("images are drawn on the CPU: {error}");
                (Box::new(CpuRenderer::new(&effects)), Some(note))
            }
        };
        event_log.log_step("renderer");
        Ok(renderer)
    })
}

#[cfg(test)]
mod tests {
    fn window_error(why: &str) -> String {
        super::window_error(why).to_string()
    }

    #[test]
    fn a_missing_library_is_reported_with_its_package() {
        let text = window_error("Library libxkbcommon-x11.so could not be loaded.");
        assert!(text.contains("apt install libxkbcommon-x11-0 libxkbcommon0\n"), "{text}");
        let text = window_error("os error at /a/b/mod.rs:788: Failed to load one of xlib's shared libraries");
        assert!(text.starts_with("cannot open a window: Failed to load one"), "{text}");
        assert!(text.contains("apt install libx11-6 libx11-xcb1 libxcursor1 libxi6\n"), "{text}");
        assert!(window_error("libX11.so.6: cannot open").contains("libx11-6"));
        assert!(window_error("The wayland library could not be loaded").contains("libwayland-client0"));
        // No library is missing here, only a compositor.
        assert!(!window_error("Could not find wayland compositor").contains("apt"));
        assert!(!window_error("something else").contains("apt"));
    }
}
