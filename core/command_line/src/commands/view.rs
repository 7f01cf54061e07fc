//! `choreo view`: starts the viewer, which is a separate program beside this one: `choreo-view`, or the viewer of another [`App`]. Its
//! toolkit takes longer to build than everything else together, and no other command needs it.

use crate::App;
use crate::args::{ViewArgs, values};
use crate::failure::{Failure, print_message};
use crate::process::{interrupt, scratch};
use crate::scene::pack::{self, Unpacked};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus};
use std::time::Duration;
use std::{env, io};

pub(crate) fn run(args: ViewArgs, no_project_file: bool, app: &App) -> Result<(), Failure> {
    let here = env::current_exe()
        .map_err(|e| Failure::Output(format!("cannot find the path of {}: {e}", app.name)))?;
    let viewer = here.with_file_name(format!("{}-view{}", app.name, env::consts::EXE_SUFFIX));
    let is_choreo = app.name == "choreo";
    // `cargo run` sets these variables: the viewer is then built too, so that it is not older than this program.
    if is_choreo && let (Some(cargo), Some(_)) = (env::var_os("CARGO"), env::var_os("CARGO_MANIFEST_DIR")) {
        build_viewer(Path::new(&cargo), &here, &viewer)?;
    }
    if !viewer.is_file() {
        let how = match is_choreo {
            true => {
                "; it is in the archive and in the Debian package of choreo, and cargo build --release -p choreo-viewer builds it"
            }
            false => "",
        };
        return Err(Failure::Device(format!(
            "the viewer is not beside {}: {}{how}",
            app.name,
            viewer.display()
        )));
    }
    let own = no_project_file.then_some("--no-project-file");
    let mut command = Command::new(&viewer);
    match &args.input {
        Some(input) if pack::is_packed(input) => {
            command.args(packed_scene_arguments(input, &args.viewer_options)?)
        }
        input => command.args(input).args(own),
    };
    let status = run_until_exit(command.args(&args.viewer_options))
        .map_err(|e| Failure::Device(format!("{}: cannot be started: {e}", viewer.display())))?;
    let Some(status) = status else { return Err(Failure::Interrupted) };
    match status.code() {
        Some(0) => Ok(()),
        // The viewer has printed the reason.
        Some(code) => Err(Failure::AlreadyReported(u8::try_from(code).unwrap_or(1))),
        None => Err(Failure::Device("the viewer was ended by a signal".into())),
    }
}

/// Arguments that show a packed scene. The archive stays unpacked until the viewer ends.
fn packed_scene_arguments(input: &Path, viewer_options: &[OsString]) -> Result<Vec<OsString>, Failure> {
    let limits = choreo_script::Limits::default();
    let unpacked = Unpacked::open(input, limits.file)?;
    let manifest = &unpacked.manifest;
    if manifest.importer.is_some() || !manifest.import.is_empty() {
        let what = format!("{}: the viewer takes no importer options", input.display());
        return Err(Failure::Usage(what));
    }
    // Options of the command line override packed ones.
    let given: Vec<&str> = viewer_options
        .iter()
        .filter_map(|word| word.to_str()?.trim_start_matches("--set=").split_once('='))
        .map(|(name, _)| name)
        .collect();
    let mut words =
        vec![unpacked.unpacked_path(&manifest.input).into_os_string(), "--no-project-file".into()];
    let mut option = |flag: &str, value: OsString| words.extend([flag.into(), value]);
    manifest.search.iter().for_each(|folder| option("--search", unpacked.unpacked_path(folder).into()));
    manifest.plugins.iter().for_each(|folder| option("--plugins", unpacked.unpacked_path(folder).into()));
    let set = manifest.set.iter().filter(|text| !given.contains(&values::name_of(text)));
    set.for_each(|text| option("--set", text.into()));
    if !viewer_options.iter().any(|word| word == "--clip") {
        manifest.clip.iter().for_each(|clip| option("--clip", clip.into()));
    }
    scratch::keep_until_exit(Some(unpacked));
    Ok(words)
}

/// Runs the viewer; `None` if a signal ended this program, which ends the viewer too.
fn run_until_exit(command: &mut Command) -> io::Result<Option<ExitStatus>> {
    interrupt::set_polled(true);
    let mut viewer = command.spawn()?;
    let ended = loop {
        if let Some(status) = viewer.try_wait()? {
            break Some(status);
        }
        if interrupt::is_interrupted() {
            viewer.kill()?;
            viewer.wait()?;
            break None;
        }
        std::thread::sleep(Duration::from_millis(100));
    };
    interrupt::set_polled(false);
    Ok(ended)
}

/// Builds the viewer with the profile of this program, which is the name of the folder that contains it.
fn build_viewer(cargo: &Path, here: &Path, viewer: &Path) -> Result<(), Failure> {
    let folder = here.parent().and_then(Path::file_name).map(|n| n.to_string_lossy().into_owned());
    let profile = match folder.as_deref() {
        None | Some("debug") => "dev".to_string(),
        Some(name) => name.to_string(),
    };
    if !viewer.is_file() {
        print_message("building the viewer, once: its toolkit takes some minutes");
    }
    let manifest = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../viewer/Cargo.toml");
    let quiet = ["build", "--quiet", "--profile", &profile, "--manifest-path"];
    let built = Command::new(cargo).args(quiet).arg(&manifest).status();
    match built {
        Ok(status) if status.success() => Ok(()),
        Ok(_) => Err(Failure::Device("the viewer could not be built; the lines above say why".into())),
        Err(e) => Err(Failure::Device(format!("the viewer could not be built: {e}"))),
    }
}
