//! Ends the program when its X server is gone. libX11 would call `exit`, which runs the destructors of the Vulkan driver while other threads still
//! draw: one time in fifteen that was a segmentation fault.

use super::error::ViewerError;
use signal_hook::low_level;
use std::ffi::c_int;
use winit::event_loop::EventLoop;
use winit::platform::x11::EventLoopExtX11;
use x11_dl::xlib::{Display, Xlib};

/// Exit code when the window can no longer be displayed.
const EXIT_FAILED: c_int = 4;

/// Installs a handler that ends the program with a message when the connection is lost.
pub(super) fn install_handler<T>(events: &EventLoop<T>) {
    if events.is_x11()
        && let Ok(xlib) = Xlib::open()
    {
        // SAFETY: libX11 keeps the handler for the whole process, and so does this function: it is no closure (Xlib, section
        // 11.8.2 "Using the default error handlers"). winit keeps the library open.
        unsafe { (xlib.XSetIOErrorHandler)(Some(exit_on_lost_display)) };
    }
}

/// Handler for a lost connection; libX11 requires that it does not return.
unsafe extern "C" fn exit_on_lost_display(_: *mut Display) -> c_int {
    exit_now(&ViewerError::WindowSystemGone("the X server no longer answers".into()))
}

/// Ends the program at once, without running destructors of libraries or freeing objects of the window system.
pub(super) fn exit_now(error: &ViewerError) -> ! {
    eprintln!("{error}");
    low_level::exit(EXIT_FAILED)
}
