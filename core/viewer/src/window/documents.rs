//! Opens another file in the window.

use super::{ViewerWindow, WindowMessage, start_session};
use crate::app::Viewer;
use crate::args::FileOptions;
use crate::library::documents::Documents;
use crate::library::lessons;
use crate::library::thumbnails::Thumbnails;
use crate::state::settings::Settings;
use crate::state::shortcuts::Shortcuts;
use choreo_plugin::Registry;
use choreo_session::SceneSource;
use std::path::Path;

/// The viewer of the first file, or of the start page if there is none.
pub(crate) fn first_viewer(
    source: Option<&SceneSource>,
    registry: &Registry,
    options: &FileOptions,
    settings: &Settings,
) -> Viewer {
    let mut viewer = Viewer::new(source.map_or("start".to_string(), name_of));
    let thumbnails = Thumbnails::new(registry, options.base_source(), choreo_command_line::cache_dir());
    let (recent, tempos) = (settings.recent.clone(), settings.tempos.clone());
    let lessons = lessons::find_lessons();
    viewer.documents = Documents { recent, tempos, lessons, thumbnails, ..Documents::new(registry) };
    match source {
        Some(source) => {
            viewer.path = source.is_script().then(|| source.input.clone());
            viewer.documents.missing_script = viewer.path.clone().filter(|path| !path.exists());
            viewer.record_opened(&source.input);
        }
        None => viewer.documents.shows_start_page = true,
    }
    viewer
}

/// Reads the user's keyboard shortcuts. Returns a message if the file has an error.
pub(crate) fn read_shortcuts(viewer: &mut Viewer, file: Option<&Path>) -> Option<String> {
    let (shortcuts, problem) = file.map(Shortcuts::read).unwrap_or_default();
    viewer.shortcuts = shortcuts;
    problem.or_else(|| crate::panels::shortcuts_problem(viewer))
}

/// File name for titles.
pub(super) fn name_of(source: &SceneSource) -> String {
    source.input.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

impl ViewerWindow {
    /// Opens the requested file in place of the present one, which stays if the new file cannot be watched.
    pub(super) fn open_document(&mut self) {
        let Some(file) = self.viewer.documents.file_to_open.take() else { return };
        let opened =
            self.options.source(file.clone()).map_err(|error| error.to_string()).and_then(|mut source| {
                // Clip and parameters of the command line belong to its own file.
                if source.input != self.source.input {
                    (source.clip, source.set_parameters) = (None, Vec::new());
                }
                let session =
                    start_session(source.clone(), &self.registry, &self.proxy, self.newest_session + 1);
                Ok((session.map_err(|error| error.to_string())?, source))
            });
        let (session, source) = match opened {
            Ok(opened) => opened,
            Err(why) => {
                self.viewer.message = Some(why);
                return self.request_redraw();
            }
        };
        self.newest_session += 1;
        (self.open_file_number, self.session, self.last_good_version) =
            (self.newest_session, Some(session), None);
        (self.preview_session, self.model_session) = (None, None);
        self.checker.cancel();
        self.unchecked = None;
        self.frames.clear();
        self.viewer = self.viewer.for_other_file(name_of(&source));
        self.viewer.path = source.is_script().then(|| source.input.clone());
        self.viewer.commands.set_input(&source.input);
        let documents = &mut self.viewer.documents;
        documents.shows_start_page = false;
        documents.missing_script =
            (source.is_script() && !source.input.exists()).then(|| source.input.clone());
        documents.thumbnails.forget();
        self.viewer.record_opened(&source.input);
        self.source = source;
        if let Some(open) = &self.open_window {
            open.window.set_title(&format!("{} – {}", self.viewer.name, self.program));
        }
        self.save_settings();
        // The window is drawn again without the former content.
        let _ = self.proxy.send_event(WindowMessage::Repaint(std::time::Duration::ZERO));
    }
}
