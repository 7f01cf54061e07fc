//! Commands that the viewer runs: renders, exports, tests. Each is a separate process, so that a render does not block the window and does not fail
//! with it, and gives the same result as on the command line.

pub mod check;
pub mod external_editor;
mod process;
pub mod queue;
pub mod test_report;
pub mod test_run;

use choreo_plugin::Registry;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// First argument that makes the viewer act as the program `choreo`.
pub const RUN_COMMAND_FLAG: &str = "--run-command";

/// Command lines of the commands.
#[derive(Clone, Debug, Default)]
pub struct Commands {
    /// The program and its arguments before the name of a command.
    pub program: Vec<OsString>,
    pub input: PathBuf,
    /// Options of the scene, as given to the viewer.
    pub scene_options: Vec<OsString>,
    /// Options that `test` accepts.
    pub test_options: Vec<OsString>,
    pub formats: Vec<Format>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputKind {
    Film,
    /// One file per frame.
    Images,
    /// The scene for another program.
    Scene,
}

/// A file format that a plugin writes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Format {
    pub kind: OutputKind,
    /// File name extension without the dot.
    pub extension: String,
    pub about: String,
    /// Names and descriptions of the options.
    pub options: Vec<(String, String)>,
}

impl Commands {
    pub fn formats_of(registry: &Registry) -> Vec<Format> {
        let format = |kind: OutputKind, manifest: &choreo_plugin::Manifest| {
            let extension = manifest.extensions.first()?.clone();
            let options = manifest.options.iter().map(|o| (o.name.clone(), o.about.clone())).collect();
            Some(Format { kind, extension, about: manifest.about.clone(), options })
        };
        let images = |one: bool| if one { OutputKind::Images } else { OutputKind::Film };
        let exporters = registry.exporters().iter();
        let frames = exporters.map(|e| format(images(e.one_frame_per_file()), e.manifest()));
        let scenes = registry.scene_exporters().iter().map(|e| format(OutputKind::Scene, e.manifest()));
        frames.chain(scenes).flatten().collect()
    }

    /// Changes to another file, without the parameters and the clip of the command line, which belong to the former file.
    pub fn set_input(&mut self, file: &Path) {
        if file != self.input {
            self.input = file.to_path_buf();
            self.scene_options = self.test_options.clone();
        }
    }

    /// Changes to the open script, if there is one.
    pub fn set_script(&mut self, script: Option<&Path>) {
        if let Some(script) = script.filter(|script| *script != self.input) {
            self.input = script.to_path_buf();
        }
    }

    /// Command line of a command, beginning with the program.
    fn command_line(&self, command: &str, rest: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
        self.program.iter().cloned().chain([command.into()]).chain(rest).collect()
    }
}
