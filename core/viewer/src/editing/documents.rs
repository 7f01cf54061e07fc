//! New scripts, and scripts saved under another name.

use super::{EditError, adding};
use crate::app::Viewer;
use crate::library::file_dialog::Purpose;
use choreo_files::write_whole;
use std::path::{Path, PathBuf};

impl Viewer {
    /// Completes the action that a file was chosen for, and opens the file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn take_file(&mut self, purpose: Purpose, file: &Path) -> Result<(), EditError> {
        match purpose {
            Purpose::Open => {}
            Purpose::New(template) => create_file(file, template.text)?,
            Purpose::Lesson(index) => self.copy_lesson(index, file)?,
            Purpose::SaveAs => self.save_as(file)?,
        }
        self.documents.file_to_open = Some(file.to_path_buf());
        self.documents.missing_script = None;
        Ok(())
    }

    /// Writes the script to another file.
    fn save_as(&mut self, to: &Path) -> Result<(), EditError> {
        let path = self.path.as_ref().ok_or(EditError::NoScript)?;
        copy_script(path, &self.documents.read_files, to)?;
        self.documents.keep_tempo(to, self.tempo);
        Ok(())
    }

    /// Writes a copy of a lesson, so that edits do not change the lesson.
    fn copy_lesson(&self, index: usize, to: &Path) -> Result<(), EditError> {
        let lesson = self.documents.lessons.get(index).ok_or(EditError::ObjectGone)?;
        copy_script(&lesson.file, &self.documents.thumbnails.files_of(&lesson.file), to)
    }
}

/// Writes a script to another file. In another folder, the files that it reads from its own folder are copied, too. `files_read`: canonical paths
/// of all files that the script reads.
fn copy_script(path: &Path, files_read: &[PathBuf], to: &Path) -> Result<(), EditError> {
    let text = super::read_script(path)?;
    let canonical = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    let folder = |path: &Path| path.parent().map(canonical).unwrap_or_default();
    let (own, from, into) = (canonical(path), folder(path), folder(to));
    if from != into {
        for file in files_read.iter().filter(|file| **file != own) {
            if let Ok(inside) = file.strip_prefix(&from) {
                adding::copy_file(file, &into.join(inside))?;
            }
        }
    }
    let failed = |source| EditError::Write { path: to.to_path_buf(), source };
    write_whole(to, text.as_bytes()).map_err(failed)
}

/// Writes a new script; an existing file is not overwritten.
fn create_file(file: &Path, text: &str) -> Result<(), EditError> {
    let failed =
        |source: std::io::Error| EditError::Write { path: file.to_path_buf(), source: source.into() };
    if let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(failed)?;
    }
    let mut new = std::fs::File::create_new(file).map_err(failed)?;
    std::io::Write::write_all(&mut new, text.as_bytes()).map_err(failed)
}
