//! The command line of choreo as a library, for programs with plugins of their own: [`run`] with the program's [`registry`] and
//! what is added to it; `examples/my_plugin.rs` shows how. Each command is one module; `failure` says how commands end.

mod args;
mod budget;
mod character;
mod check;
mod compressed;
mod device;
mod draw;
mod explain;
mod failure;
mod help;
mod importing;
mod info;
mod inputs;
mod interrupt;
mod measure;
mod memory;
mod model;
mod new;
mod output;
mod pictures;
mod pipeline;
mod plot;
mod plugin_files;
mod pose;
mod progress;
mod provenance;
mod ranges;
mod registry;
mod remember;
mod render;
mod render_watch;
mod scene;
mod stages;
mod summary;
mod test;
mod video;
mod view;

pub use device::cache_dir;
pub use registry::registry;

use args::{Cli, Command, RenderArgs};
use choreo_plugin::Registry;
use clap::FromArgMatches;
use std::ffi::OsString;
use std::process::ExitCode;

/// One call of the program: `args` as in `std::env::args_os()`, the program's name first. Plugin files beside scripts are added to
/// `plugins`. Writes to the process's standard streams, and takes Ctrl-C for the length of the process.
pub fn run(args: impl IntoIterator<Item = OsString>, plugins: &Registry) -> ExitCode {
    let args: Vec<OsString> = args.into_iter().collect();
    let parsed = help::command(&args, plugins).try_get_matches_from(&args);
    let cli = match parsed.and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version are answers, not errors; clap knows which stream and code.
            let code = error.exit_code();
            let _ = error.print();
            return ExitCode::from(code as u8);
        }
    };
    interrupt::install();
    let json = cli.command.json();
    let to_stdout = matches!(&cli.command, Command::Render(a) if a.output == "-");
    let result = match cli.command {
        Command::Render(given) => {
            render::run(RenderArgs { again: interrupt::command_to_resume(&args), ..given }, plugins)
        }
        Command::Check(args) => check::run(args, plugins),
        Command::Info(args) => info::run(args, plugins),
        Command::Explain(args) => explain::run(args, plugins),
        Command::Measure(args) => measure::run(args, plugins),
        Command::Pose(args) => pose::run(args, plugins),
        Command::View(args) => view::run(args),
        Command::Test(args) => test::run(args, plugins),
        Command::Plugins(args) => registry::run(args, plugins),
        Command::New(args) => new::run(args),
    };
    let Err(failure) = result else { return ExitCode::SUCCESS };
    for line in failure.lines() {
        eprintln!("{line}");
    }
    // A report of failed tests has said it already.
    if json && !to_stdout && !matches!(failure, failure::Failure::Tests(_)) {
        let _ = failure::print_json(&failure.json());
    }
    ExitCode::from(failure.code())
}
