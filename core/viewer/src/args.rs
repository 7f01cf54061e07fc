//! Command line of the viewer.

use crate::commands::{Commands, RUN_COMMAND_FLAG};
use choreo::App;
use choreo_command_line::Device;
use choreo_script::{ImportChoice, Limits};
use choreo_session::SceneSource;
use clap::{CommandFactory, FromArgMatches, Parser};
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

/// Shows a script, or a model, while it is being written: every save is seen at once.
#[derive(Parser, Debug)]
#[command(version)]
struct Args {
    /// A script (.rhai), or a model file; without one a page with recent files, lessons and templates
    #[arg(value_name = "SCRIPT|MODEL")]
    input: Option<PathBuf>,
    /// A parameter of the script, read there with param("NAME"); repeatable
    #[arg(long = "set", value_name = "NAME=VALUE")]
    set: Vec<String>,
    /// Model files: the clip to play (default: the first)
    #[arg(long, value_name = "NAME")]
    clip: Option<String>,
    /// A further folder in which load(…) looks for files; repeatable
    #[arg(long = "search", value_name = "DIR")]
    search: Vec<PathBuf>,
    /// A further folder of plugin files: NAME.importer.rhai, NAME.wgsl; repeatable
    #[arg(long = "plugins", value_name = "DIR")]
    plugins: Vec<PathBuf>,
    /// Raise or lower a limit; repeatable
    #[arg(long = "limit", value_name = "NAME=NUMBER")]
    limit: Vec<String>,
    /// Do not read choreo.toml, which names search folders and plugin folders of the project
    #[arg(long)]
    no_project_file: bool,
    /// The program's own WGSL modules are read from here, and again when they change
    #[arg(long = "shaders", value_name = "DIR")]
    shaders: Option<PathBuf>,
    /// The device that draws images and window: Vulkan, the CPU, or the faster of them (with --shaders: Vulkan)
    #[arg(long, value_enum, value_name = "DEVICE", default_value = "auto")]
    device: Device,
    /// Begin at this time, in seconds
    #[arg(long, value_name = "SECS", default_value_t = 0.0)]
    at: f64,
    /// Begin playing
    #[arg(long)]
    play: bool,
    /// Draw images in the size that render uses, in place of one that fills the viewport
    #[arg(long)]
    full_size: bool,
    /// Lose the device at these frames of the window, for tests; repeatable
    #[arg(long = "lose-device-at", value_name = "FRAME", hide = true)]
    lose_device_at: Vec<u64>,
    /// Print what has been done and shown, and when, on standard output, for tests and measurements
    #[arg(long, hide = true)]
    event_log: bool,
}

/// Validated options of the program.
pub(crate) struct ViewerOptions {
    /// File to open first. `None`: the start page.
    pub first_file: Option<PathBuf>,
    pub files: FileOptions,
    pub device: Device,
    /// Initial time, seconds.
    pub start_secs: f64,
    pub plays_at_start: bool,
    /// Whether images have the size that `render` uses.
    pub full_size: bool,
    /// Numbers of window frames at which a lost device is simulated.
    pub lose_device_at: Vec<u64>,
    /// Whether events are reported on standard output, one line each.
    pub event_log: bool,
    pub commands: Commands,
}

/// Command lines for renders, exports and tests of the same scene.
fn commands(args: &Args, app: &App) -> Commands {
    let each = |flag: &'static str, values: Vec<OsString>| {
        values.into_iter().flat_map(move |value| [OsString::from(flag), value])
    };
    let texts = |values: &[String]| values.iter().map(OsString::from).collect();
    let folders = |values: &[PathBuf]| values.iter().map(OsString::from).collect();
    let mut test: Vec<OsString> = each("--search", folders(&args.search)).collect();
    test.extend(each("--plugins", folders(&args.plugins)));
    test.extend(each("--limit", texts(&args.limit)));
    test.extend(args.no_project_file.then(|| "--no-project-file".into()));
    let scene =
        each("--set", texts(&args.set)).chain(each("--clip", args.clip.iter().map(Into::into).collect()));
    // If the path of the program is unknown, no command can be run, and the panels report that.
    let program =
        std::env::current_exe().map(|exe| vec![exe.into(), RUN_COMMAND_FLAG.into()]).unwrap_or_default();
    Commands {
        program,
        input: args.input.clone().unwrap_or_default(),
        scene_options: scene.chain(test.iter().cloned()).collect(),
        test_options: test,
        formats: Commands::formats_of(&app.registry),
    }
}

/// Options for every file that the window opens.
pub(crate) struct FileOptions {
    /// The options without a file and without the folders of a project.
    base_source: SceneSource,
    /// Whether a project's `choreo.toml` is read.
    project_file: bool,
    app: App,
}

/// An error in the `choreo.toml` of a file's project.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ProjectError {
    #[error(transparent)]
    File(#[from] choreo_command_line::ProjectFileError),
    #[error(transparent)]
    Options(#[from] clap::Error),
}

impl FileOptions {
    /// The options without a file.
    pub(crate) fn base_source(&self) -> &SceneSource {
        &self.base_source
    }

    /// The source of a file, including the folders of its project. Fails if its `choreo.toml` has an error.
    pub(crate) fn source(&self, input: PathBuf) -> Result<SceneSource, ProjectError> {
        let name = format!("{}-view", self.app.name);
        let of_project = match self.project_file {
            true => choreo_command_line::project_folders(&input, &self.app)?,
            false => Vec::new(),
        };
        // The folders are options of this program, so they are parsed as such.
        let words = [name.into(), input.clone().into()].into_iter().chain(of_project);
        let of_project = Args::try_parse_from(words)?;
        let base_source = &self.base_source;
        Ok(SceneSource {
            search_folders: [base_source.search_folders.clone(), of_project.search, self.app.search.clone()]
                .concat(),
            plugin_folders: [
                base_source.plugin_folders.clone(),
                of_project.plugins,
                self.app.plugins.clone(),
            ]
            .concat(),
            input,
            ..base_source.clone()
        })
    }
}

/// The command line, for completions and manual pages.
pub fn clap_command(app: &App) -> clap::Command {
    let name = format!("{}-view", app.name);
    Args::command().display_name(&name).bin_name(&name).version(app.version)
}

pub(crate) fn parse(args: impl IntoIterator<Item = OsString>, app: &App) -> Result<ViewerOptions, ExitCode> {
    let name = format!("{}-view", app.name);
    let matches = clap_command(app).try_get_matches_from(args);
    let args = matches.and_then(|matches| Args::from_arg_matches(&matches)).map_err(|error| {
        // Help and version are answers, not errors; clap knows the right stream and exit code.
        let code = error.exit_code();
        let _ = error.print();
        ExitCode::from(code as u8)
    })?;
    let usage = |text: String| {
        eprintln!("{text}\n    see {name} --help");
        ExitCode::from(2)
    };
    let mut limits = Limits::default();
    for limit in &args.limit {
        limits.set(limit).map_err(|e| usage(format!("--limit {limit}: {e}")))?;
    }
    let mut set_parameters = Vec::new();
    for text in &args.set {
        let pair = text.split_once('=').filter(|(name, _)| !name.is_empty());
        let (name, value) = pair.ok_or_else(|| usage(format!("--set {text}: write NAME=VALUE")))?;
        set_parameters.push((name.to_string(), value.to_string()));
    }
    if !args.at.is_finite() {
        return Err(usage(format!("--at {}: write seconds", args.at)));
    }
    let commands = commands(&args, app);
    let base_source = SceneSource {
        set_parameters,
        search_folders: args.search,
        plugin_folders: args.plugins,
        limits,
        clip: args.clip,
        import: ImportChoice::default(),
        shader_folder: args.shaders,
        ..SceneSource::new("")
    };
    let files = FileOptions { base_source, project_file: !args.no_project_file, app: app.clone() };
    let Args { input: first_file, device, at, play, full_size, lose_device_at, event_log, .. } = args;
    Ok(ViewerOptions {
        first_file,
        files,
        device,
        start_secs: at,
        plays_at_start: play,
        full_size,
        lose_device_at,
        event_log,
        commands,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn project_folders_are_searched_unless_the_project_file_is_disabled() {
        let dir = tempfile::tempdir().unwrap();
        let d = dir.path().canonicalize().unwrap();
        for folder in ["scenes", "assets", "more"] {
            std::fs::create_dir(d.join(folder)).unwrap();
        }
        std::fs::write(d.join("scenes/a.rhai"), "").unwrap();
        std::fs::write(d.join("choreo.toml"), "search = [\"assets\"]\n[render]\nsamples = 1\n").unwrap();
        let app = App::new("choreo", "1", choreo_plugin::Registry::default());
        let search = |more: &[&str]| {
            let script = d.join("scenes/a.rhai").into_os_string();
            let words = [OsString::from("choreo-view"), script].into_iter();
            let asked = parse(words.chain(more.iter().map(OsString::from)), &app).map_err(|_| "refused")?;
            let source = asked.files.source(asked.first_file.ok_or("no input")?);
            source.map(|source| source.search_folders).map_err(|_| "refused")
        };
        assert_eq!(search(&[]), Ok(vec![d.join("assets")]));
        assert_eq!(search(&["--search", "x"]), Ok(vec!["x".into(), d.join("assets")]));
        assert_eq!(search(&["--no-project-file"]), Ok(Vec::new()));
        std::fs::write(d.join("choreo.toml"), "serach = []\n").unwrap();
        assert_eq!(search(&[]), Err("refused"));
    }
}
