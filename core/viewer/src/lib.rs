//! The viewer: a window in which a script is seen as it is being written. The only crate that knows egui, a program of its own:
//! `choreo-view`.
//!
//! ```text
//! choreo_session::SessionThread ─ versions ─► Viewer (app: plain state) ─ wishes ─► choreo_session::FrameRenderer ─ frames ─┐
//!                                    ▲ panels (egui)                                                   │
//!                                    └─────────────── window (winit, Vulkan) ◄─────────────────────────┘
//! ```

pub mod app;
mod args;
mod difference;
pub mod editing;
mod editor;
pub mod events;
pub mod gizmo;
pub mod lens;
pub mod orbit;
pub mod panels;
pub mod performance;
pub mod pick;
pub mod placing;
pub mod playhead;
pub mod selection;
pub mod settings;
pub mod span;
pub mod timeline;
pub mod view;
#[allow(unsafe_code, reason = "calls of Vulkan")]
mod window;

use std::ffi::OsString;
use std::process::ExitCode;

/// One call of the program: `args` as in `std::env::args_os()`.
pub fn run(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let asked = match args::parse(args) {
        Ok(asked) => asked,
        Err(code) => return code,
    };
    match window::run(asked) {
        Ok(()) => ExitCode::SUCCESS,
        Err(text) => {
            eprintln!("{text}");
            ExitCode::from(4)
        }
    }
}
