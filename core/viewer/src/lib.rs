//! The viewer of the program `choreo-view` or of another [`App`]: a window that shows a script while it is being written. This is the only crate
//! that depends on egui.
//!
//! ```text
//! SessionThread ─ scene versions ─► Viewer (app) ─ frame requests ─► FrameRenderer ─ frames ─┐
//!                                    ▲ panels (egui)                                        │
//!                                    └─────── window (winit, Vulkan or CPU) ◄──────────────┘
//! ```

pub mod app;
mod args;
pub mod commands;
pub mod editing;
pub mod geometry;
pub mod library;
pub mod panels;
pub mod state;
#[allow(unsafe_code, reason = "calls of Vulkan")]
mod window;

pub use args::clap_command;
pub use window::raster;

use choreo::App;
use std::ffi::OsString;
use std::process::ExitCode;

/// Runs the viewer of a program. `args`: command line as in `std::env::args_os()`.
pub fn run(args: impl IntoIterator<Item = OsString>, app: &App) -> ExitCode {
    let args: Vec<OsString> = args.into_iter().collect();
    if args.get(1).is_some_and(|word| word == commands::RUN_COMMAND_FLAG) {
        let words = [OsString::from(app.name)].into_iter().chain(args.into_iter().skip(2));
        return choreo::run(words, app);
    }
    let asked = match args::parse(args, app) {
        Ok(asked) => asked,
        Err(code) => return code,
    };
    match window::run(asked, app) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(error.exit_code())
        }
    }
}
