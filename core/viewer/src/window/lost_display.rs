//! The end of the program where its X server goes. libX11 then calls `exit`, which runs the destructors of the Vulkan driver while
//! the threads that draw still use it: one time in fifteen that was a segmentation fault.

use super::error::ViewerError;
use signal_hook::low_level;
use std::ffi::c_int;
use winit::event_loop::EventLoop;
use winit::platform::x11::EventLoopExtX11;
use x11_dl::xlib::{Display, Xlib};

/// The exit code of a window that cannot be shown any longer.
const FAILED: c_int = 4;

/// Has a lost connection end the program with a message.
pub(super) fn watch<T>(events: &EventLoop<T>) {
    if events.is_x11()
        && let Ok(xlib) = Xlib::open()
    {
        // SAFETY: libX11 keeps the handler for the whole process, and so does this function: it is no closure (Xlib, section
        // 11.8.2 "Using the default error handlers"). winit keeps the library open.
        unsafe { (xlib.XSetIOErrorHandler)(Some(lost)) };
    }
}

/// libX11 requires that it does not return.
unsafe extern "C" fn lost(_: *mut Display) -> c_int {
    leave(&ViewerError::WindowSystemGone("the X server no longer answers".into()))
}

/// Ends the program at once: neither destructors of libraries nor objects of the window system are run.
pub(super) fn leave(error: &ViewerError) -> ! {
    eprintln!("{error}");
    low_level::exit(FAILED)
}
