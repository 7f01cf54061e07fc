//! A program on choreo, as data: its name, version, plugins and defaults.

use choreo_plugin::Registry;
use std::path::PathBuf;

/// A program built on choreo. [`crate::run`] is its command line and `choreo_viewer::run` its viewer; both take the same `App`, so a plugin
/// registered here works in both.
#[derive(Clone)]
#[non_exhaustive]
pub struct App {
    /// Name in help and in the provenance of outputs. The viewer is the program `NAME-view` in the same folder.
    pub name: &'static str,
    /// Version in `--version` and in the provenance of outputs.
    pub version: &'static str,
    /// Plugins that are compiled into the program. Plugin files found at run time are added to them.
    pub registry: Registry,
    /// Folders in which `load(…)` looks for files, after the folders of the command line.
    pub search: Vec<PathBuf>,
    /// Folders of plugin files, after the folders of the command line.
    pub plugins: Vec<PathBuf>,
    /// Default options of commands, in the form of `choreo.toml` (`[render]\nsamples = 1`). Options of the command line and of the
    /// project's `choreo.toml` win.
    pub defaults: String,
    /// Documentation pages for `choreo help`, in addition to those of choreo itself: path in the sources, and Markdown. The page of a
    /// built-in plugin is "plugins/import-NAME/README.md", "plugins/export-NAME/README.md" or "plugins/effects/NAME/README.md".
    pub pages: Vec<(&'static str, &'static str)>,
}

impl App {
    /// Creates a program without search folders, plugin folders, default options and pages.
    pub fn new(name: &'static str, version: &'static str, registry: Registry) -> App {
        App {
            name,
            version,
            registry,
            search: Vec::new(),
            plugins: Vec::new(),
            defaults: String::new(),
            pages: Vec::new(),
        }
    }

    /// Name and version: "choreo 0.1.0", or for another program "studio 2.0 (choreo 0.1.0)".
    pub fn software(&self) -> String {
        let choreo = format!("choreo {}", env!("CARGO_PKG_VERSION"));
        match format!("{} {}", self.name, self.version) {
            program if program == choreo => choreo,
            program => format!("{program} ({choreo})"),
        }
    }
}
