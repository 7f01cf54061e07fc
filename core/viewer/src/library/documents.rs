//! The open file, and the files that can be opened.

use super::file_dialog::{FileDialog, Purpose};
use super::folder::{Entry, built_in, model_extensions};
use super::lessons::Lesson;
use super::thumbnails::Thumbnails;
use crate::state::tempo::Tempo;
use choreo_plugin::Registry;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Largest number of recent files.
const MAX_RECENT_FILES: usize = 12;

#[derive(Default)]
pub struct Documents {
    /// Whether the start page is displayed in place of the panels.
    pub shows_start_page: bool,
    /// Recent files, the newest first.
    pub recent: Vec<PathBuf>,
    /// Tempos of recent scripts, by canonical path.
    pub tempos: BTreeMap<PathBuf, Tempo>,
    pub lessons: Vec<Lesson>,
    /// File that the window will open next.
    pub file_to_open: Option<PathBuf>,
    /// The open file dialog.
    pub dialog: Option<FileDialog>,
    /// Script that was to be opened and does not exist.
    pub missing_script: Option<PathBuf>,
    pub thumbnails: Thumbnails,
    /// File name extensions that importers read.
    pub model_extensions: Vec<String>,
    /// Built-in models, which are not files.
    pub built_in: Vec<Entry>,
    /// Canonical paths of the files that the displayed version has read.
    pub read_files: Vec<PathBuf>,
}

impl Documents {
    pub fn new(registry: &Registry) -> Documents {
        Documents {
            model_extensions: model_extensions(registry),
            built_in: built_in(registry),
            ..Documents::default()
        }
    }

    /// Records an opened file as the most recent one.
    pub fn record_opened(&mut self, file: &Path) {
        let file = file.canonicalize().unwrap_or_else(|_| file.to_path_buf());
        self.recent.retain(|other| *other != file);
        self.recent.insert(0, file);
        self.recent.truncate(MAX_RECENT_FILES);
        self.tempos.retain(|script, _| self.recent.contains(script));
    }

    /// Remembers the tempo of a script.
    pub fn keep_tempo(&mut self, script: &Path, tempo: Tempo) {
        let Ok(script) = script.canonicalize() else { return };
        match tempo.beat_secs() {
            Some(_) => drop(self.tempos.insert(script, tempo)),
            None => drop(self.tempos.remove(&script)),
        }
    }

    /// The remembered tempo of a script.
    pub fn tempo_of(&self, script: &Path) -> Tempo {
        let kept = script.canonicalize().ok().and_then(|script| self.tempos.get(&script).copied());
        kept.unwrap_or_default()
    }

    /// Opens the file dialog in the folder of a file, else in that of the most recent file, else in the working folder.
    pub fn open_dialog(&mut self, purpose: Purpose, shown: Option<&Path>) {
        let beside = shown.or(self.recent.first().map(PathBuf::as_path));
        let folder = beside.and_then(Path::parent).unwrap_or(Path::new("")).to_path_buf();
        let name = match (purpose, shown.and_then(Path::file_name)) {
            (Purpose::SaveAs, Some(name)) => name.to_string_lossy().into_owned(),
            (Purpose::New(_), _) => free_name(&folder, "scene"),
            (Purpose::Lesson(index), _) => {
                self.lessons.get(index).map(|lesson| free_name(&folder, &lesson.name)).unwrap_or_default()
            }
            _ => String::new(),
        };
        self.dialog = Some(FileDialog::new(purpose, &folder, &name, &self.model_extensions));
    }
}

/// A script name that does not exist in a folder: `stem.rhai`, `stem_2.rhai` …
fn free_name(folder: &Path, stem: &str) -> String {
    let names = (1..).map(|n| if n == 1 { format!("{stem}.rhai") } else { format!("{stem}_{n}.rhai") });
    names.into_iter().find(|name| !folder.join(name).exists()).unwrap_or_default()
}
