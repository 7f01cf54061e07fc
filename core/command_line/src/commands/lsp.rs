//! `choreo lsp`: the language server over standard input and output.

use crate::App;
use crate::args::{Cli, Command};
use crate::commands::check;
use crate::failure::Failure;
use crate::project_file;
use crate::scene;
use choreo_files::containing_folder;
use choreo_language_server::{Host, HostError, Project, SessionEnd, Task, serve};
use choreo_script::{Diagnostic, Limits, Places};
use choreo_stage::Stage;
use choreo_test_runner::collect::display_path;
use clap::Parser;
use std::ffi::OsString;
use std::io::{BufReader, stdin, stdout};
use std::path::Path;
use std::process;
use std::sync::Arc;

pub(crate) fn run(app: &App) -> Result<(), Failure> {
    let host = Arc::new(ProgramHost { app: app.clone() });
    match serve(BufReader::new(stdin()), stdout(), host) {
        SessionEnd::Exit => Ok(()),
        SessionEnd::Abruptly => Err(Failure::ClosedPipe),
    }
}

struct ProgramHost {
    app: App,
}

impl Host for ProgramHost {
    fn program(&self) -> (String, String) {
        (self.app.name.to_string(), self.app.version.to_string())
    }

    /// Settings that `choreo check SCRIPT` would use.
    fn project(&self, script: &Path) -> Result<Project, HostError> {
        let words = [OsString::from(self.app.name), "check".into(), script.into()];
        let words =
            project_file::with_project_options(&words, &self.app).map_err(|e| HostError(failure_text(&e)))?;
        let cli = Cli::try_parse_from(words).map_err(|e| HostError(e.to_string()))?;
        let Command::Check(args) = cli.command else {
            return Err(HostError("choreo.toml names another command".into()));
        };
        let registry = scene::registry_with_plugin_files(&args.scene, &self.app.registry)
            .map_err(|e| HostError(failure_text(&e)))?;
        let root = project_file::project_root(script);
        Ok(Project { registry, search: args.scene.search, root, limits: Limits::default() })
    }

    fn survey(&self, stage: &Arc<Stage>, places: &Places, project: &Project) -> Vec<Diagnostic> {
        let registry = project.registry.settled();
        let (problems, on_stage) = check::check_stage(stage, &registry, places, &project.limits, &|| true);
        problems.into_iter().map(Diagnostic::from).chain(places.findings(&on_stage)).collect()
    }

    /// Command that runs this program again, with the arguments that a user would type.
    fn command(&self, task: &Task) -> Result<process::Command, HostError> {
        let program = std::env::current_exe()
            .map_err(|e| HostError(format!("cannot find the path of {}: {e}", self.app.name)))?;
        let mut command = process::Command::new(program);
        match task {
            Task::Frame { script, secs, output } => {
                command
                    .arg("render")
                    .arg(script)
                    .args(["--quiet", "--at", &secs.to_string(), "-o"])
                    .arg(output);
                command.current_dir(containing_folder(script));
            }
            Task::Test { script, section, root } => {
                let beneath = script.strip_prefix(root).ok();
                let name = display_path(beneath.unwrap_or(script));
                command.current_dir(if beneath.is_some() { root } else { containing_folder(script) });
                command.args(["test", &name, "--json"]);
                command.args(section.map(|section| format!("--filter={name} > {section}")));
            }
            Task::View { script, secs } => {
                command
                    .arg("view")
                    .arg(script)
                    .args(["--at", &secs.to_string()])
                    .current_dir(containing_folder(script));
            }
        }
        Ok(command)
    }
}

fn failure_text(failure: &Failure) -> String {
    failure.message_lines().join("\n")
}
