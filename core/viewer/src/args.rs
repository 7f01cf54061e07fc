//! The command line.

use choreo::App;
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
    /// A script (.rhai), or a model file
    #[arg(value_name = "SCRIPT|MODEL")]
    input: PathBuf,
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
    /// The program's own WGSL modules are read from here, and again when they change
    #[arg(long = "shaders", value_name = "DIR")]
    shaders: Option<PathBuf>,
    /// Begin at this time, in seconds
    #[arg(long, value_name = "SECS", default_value_t = 0.0)]
    at: f64,
    /// Begin playing
    #[arg(long)]
    play: bool,
    /// Lose the device at these frames of the window, for tests; repeatable
    #[arg(long = "lose-device-at", value_name = "FRAME", hide = true)]
    lose: Vec<u64>,
    /// Print what has been done and shown, and when, on standard output, for tests and measurements
    #[arg(long, hide = true)]
    event_log: bool,
}

/// Options of the program, checked.
pub(crate) struct ViewerOptions {
    pub source: SceneSource,
    pub at: f64,
    pub play: bool,
    /// Frames of the window at which its device is as good as lost.
    pub lose: Vec<u64>,
    /// Reports on standard output what is shown, a line each.
    pub event_log: bool,
}

/// The command line, for completions and manual pages.
pub fn command(app: &App) -> clap::Command {
    let name = format!("{}-view", app.name);
    Args::command().display_name(&name).bin_name(&name).version(app.version)
}

pub fn parse(args: impl IntoIterator<Item = OsString>, app: &App) -> Result<ViewerOptions, ExitCode> {
    let name = format!("{}-view", app.name);
    let matches = command(app).try_get_matches_from(args);
    let args = matches.and_then(|matches| Args::from_arg_matches(&matches)).map_err(|error| {
        // Help and version are answers, not errors; clap knows which stream and code.
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
    let mut set = Vec::new();
    for text in &args.set {
        let pair = text.split_once('=').filter(|(name, _)| !name.is_empty());
        let (name, value) = pair.ok_or_else(|| usage(format!("--set {text}: write NAME=VALUE")))?;
        set.push((name.to_string(), value.to_string()));
    }
    if !args.at.is_finite() {
        return Err(usage(format!("--at {}: write seconds", args.at)));
    }
    let source = SceneSource {
        set,
        search: [args.search, app.search.clone()].concat(),
        plugins: [args.plugins, app.plugins.clone()].concat(),
        limits,
        clip: args.clip,
        import: ImportChoice::default(),
        shaders: args.shaders,
        ..SceneSource::new(args.input)
    };
    Ok(ViewerOptions { source, at: args.at, play: args.play, lose: args.lose, event_log: args.event_log })
}
