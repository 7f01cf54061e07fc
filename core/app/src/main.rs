//! The command line of choreo. Each command is one module; `failure` says how commands end.

mod args;
mod budget;
mod character;
mod check;
mod device;
mod draw;
mod explain;
mod failure;
mod info;
mod interrupt;
mod measure;
mod memory;
mod model;
mod new;
mod output;
mod part;
mod pictures;
mod pipeline;
mod plot;
mod plugin_files;
mod pose;
mod progress;
mod provenance;
mod ranges;
mod registry;
mod render;
mod scene;
mod summary;
mod test;
mod video;

use args::{Cli, Command};
use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
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
        Command::Render(args) => render::run(args),
        Command::Check(args) => check::run(args),
        Command::Info(args) => info::run(args),
        Command::Explain(args) => explain::run(args),
        Command::Measure(args) => measure::run(args),
        Command::Pose(args) => pose::run(args),
        Command::Test(args) => test::run(args),
        Command::Plugins(args) => registry::run(args),
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
