//! The command line of the program `choreo`. [`run`] gets the [`App`] from its caller and knows no plugin, so that after a change in a
//! plugin only the plugin and `core/cli` are compiled. Each command is one module; `failure` defines how commands end.

mod app;
mod args;
mod commands;
mod drawing;
mod failure;
pub mod output;
mod plugins;
mod process;
mod project_file;
mod scene;
mod terminal;

pub use app::App;
pub use args::Device;
pub use commands::check::{SceneToSurvey, survey_scene};
pub use drawing::device::{cache_dir, software_vulkan_reason};
pub use process::panics::set_exit_code_of_abort;

use args::{Cli, Command, PluginsAction, PluginsArgs, RenderArgs, values};
use clap::FromArgMatches;
use commands::render::worker;
use commands::{
    check, explain, export, farm, format, help, info, join, lsp, measure, new, pack,
    plugins as plugins_command, pose, render, test, view,
};
use failure::{Failure, print_json, print_json_message, print_message};
use process::{interrupt, panics, scratch, threads};
use scene::pack::Unpacked;
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

/// Runs the program once. `args`: as in `std::env::args_os()`, with the program's name first. Writes to the standard streams, and handles
/// Ctrl-C and panics until the process ends.
pub fn run(args: impl IntoIterator<Item = OsString>, app: &App) -> ExitCode {
    let args = help::rewrite_help_as_flag(args.into_iter().collect());
    let extended = match project_file::with_project_options(&args, app) {
        Ok(extended) => extended,
        Err(failure) => return report_failure(&failure, args.iter().any(|a| a == "--json"), &args),
    };
    let parsed = help::command_with_plugin_options(&args, app).try_get_matches_from(&extended);
    let cli = match parsed.and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => cli,
        Err(error) => return report_parse_error(&args, &error),
    };
    panics::install();
    interrupt::install();
    let json = cli.command.prints_json();
    let result = panics::catch_panics(|| run_command(cli, &args, app));
    worker::write_final_report(result.as_ref().err());
    scratch::remove_folder();
    let Err(failure) = result else { return ExitCode::SUCCESS };
    report_failure(&failure, json, &args)
}

/// An error in the `choreo.toml` of a project, with hints.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{0}")]
pub struct ProjectFileError(String);

/// Viewer options for the search and plugin folders of the project that an input belongs to.
///
/// # Errors
/// The `choreo.toml` of the project is wrong.
pub fn project_folders(input: &Path, app: &App) -> Result<Vec<OsString>, ProjectFileError> {
    project_file::viewer_folder_options(input, app)
        .map_err(|failure| ProjectFileError(failure.message_lines().join("\n")))
}

/// The command line of a program, for completions and manual pages.
pub fn clap_command(app: &App) -> clap::Command {
    help::command_with_plugin_options(&[], app)
}

fn report_failure(failure: &Failure, json: bool, args: &[OsString]) -> ExitCode {
    failure.message_lines().iter().for_each(print_message);
    // The report of failed tests or rows contains it already.
    if json && !matches!(failure, Failure::Tests(_) | Failure::Rows(_)) {
        write_json(failure, writes_video_to_stdout(args));
    }
    ExitCode::from(failure.exit_code())
}

fn run_command(cli: Cli, args: &[OsString], app: &App) -> Result<(), Failure> {
    let Cli { mut command, no_project_file } = cli;
    match &command {
        Command::Render(given) => {
            let jobs = given.jobs.as_deref().map(values::parse_jobs).transpose()?;
            jobs.into_iter().for_each(choreo_render::vulkan::limit_software_threads);
            threads::start_pool(jobs)?;
        }
        Command::Plugins(PluginsArgs { action: Some(PluginsAction::Test { .. }), .. }) => {
            threads::start_pool(None)?
        }
        Command::New(_)
        | Command::View(_)
        | Command::Join(_)
        | Command::Plugins(_)
        | Command::Help(_)
        | Command::Format(_) => {}
        _ => threads::start_pool(None)?,
    }
    let packs = matches!(command, Command::Pack(_) | Command::Farm(_));
    if let Some(scene) = command.scene_args_mut() {
        scene.software = app.software();
        scratch::keep_until_exit(if packs { None } else { Unpacked::replace_input(scene)? });
    }
    let plugins = &app.registry;
    match command {
        Command::Render(given) => {
            render::run(RenderArgs { resume_command: interrupt::resume_command(args), ..given }, plugins)
        }
        Command::Join(args) => join::run(&args, plugins, &app.software()),
        Command::Check(args) => check::run(args, no_project_file, plugins),
        Command::Info(args) => info::run(args, plugins),
        Command::Explain(args) => explain::run(args, plugins),
        Command::Measure(args) => measure::run(args, plugins),
        Command::Pose(args) => pose::run(args, plugins),
        Command::Export(args) => export::run(&args, plugins),
        Command::Farm(given) => match &given.status {
            Some(folder) => farm::status(folder, &given),
            None => farm::run(&given, app, project_file::project_file_text(args, &given.scene.input)?),
        },
        Command::Pack(given) => {
            pack::run(&given, plugins, project_file::project_file_text(args, &given.scene.input)?)
        }
        Command::View(args) => view::run(args, no_project_file, app),
        Command::Test(args) => test::run(args, no_project_file, plugins),
        Command::Plugins(args) => plugins_command::run(args, app),
        Command::New(args) => new::run(args),
        Command::Help(args) => help::run(&args, app),
        Command::Format(args) => format::run(&args),
        Command::Lsp(_) => lsp::run(app),
    }
}

/// Prints the answer to a command line that asks for help or the version, or the error of one that is wrong. With `--json` anywhere in it,
/// an error is printed as JSON too.
fn report_parse_error(args: &[OsString], error: &clap::Error) -> ExitCode {
    // Help and version are answers, not errors; clap knows the stream and the exit code.
    let _ = error.print();
    if error.use_stderr() && args.iter().skip(1).take_while(|a| *a != "--").any(|a| a == "--json") {
        let text = error.render().to_string();
        // The usage text that follows is for people, not for programs.
        let what = text.split("\n\nUsage:").next().unwrap_or_default();
        let what = what.strip_prefix("error: ").unwrap_or(what).trim();
        write_json(&Failure::Usage(what.to_string()), writes_video_to_stdout(args));
    }
    ExitCode::from(error.exit_code() as u8)
}

/// Whether the video goes to standard output: `render -o -`, in any spelling.
fn writes_video_to_stdout(args: &[OsString]) -> bool {
    let named = |pair: &[OsString]| (pair[0] == "-o" || pair[0] == "--output") && pair[1] == "-";
    args.windows(2).any(named) || args.iter().any(|a| a == "-o-" || a == "-o=-" || a == "--output=-")
}

fn write_json(failure: &Failure, to_stderr: bool) {
    match to_stderr {
        true => print_json_message(&failure.json()),
        // If the reader of the pipe has gone, the exit code is the only report left.
        false => drop(print_json(&failure.json())),
    }
}
