//! Commands of the program that the viewer runs beside itself: renders, exports, tests. Each is a process of its own, so that a render
//! neither holds up the window nor ends with it by accident, and does exactly what the command line does.

pub mod check;
pub mod external_editor;
mod process;
pub mod queue;
pub mod test_report;
pub mod test_run;

use choreo_plugin::Registry;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// The first argument with which the viewer is the program `choreo` itself.
pub const AS_PROGRAM: &str = "--run-command";

/// How the commands are called.
#[derive(Clone, Debug, Default)]
pub struct Commands {
    /// The program, and what comes before the name of a command.
    pub program: Vec<OsString>,
    pub input: PathBuf,
    /// Options of the scene, as the viewer got them.
    pub scene: Vec<OsString>,
    /// Options that `test` takes.
    pub test: Vec<OsString>,
    pub formats: Vec<Format>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputKind {
    Film,
    /// A file for each frame.
    Images,
    /// The scene itself for another program.
    Scene,
}

/// A file format that a plugin writes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Format {
    pub kind: OutputKind,
    /// Extension of the file, without the dot.
    pub extension: String,
    pub about: String,
    /// Names and explanations of its options.
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

    /// Takes another file, to which the parameters and the clip of the command line do not belong.
    pub fn take_file(&mut self, file: &Path) {
        if file != self.input {
            self.input = file.to_path_buf();
            self.scene = self.test.clone();
        }
    }

    /// Takes the script that is shown, where it is one.
    pub fn follow(&mut self, script: Option<&Path>) {
        if let Some(script) = script.filter(|script| *script != self.input) {
            self.input = script.to_path_buf();
        }
    }

    /// The words of a command: the program first.
    fn words(&self, command: &str, rest: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
        self.program.iter().cloned().chain([command.into()]).chain(rest).collect()
    }
}
