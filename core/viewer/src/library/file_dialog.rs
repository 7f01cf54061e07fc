//! File dialog. The viewer has its own, because that of the system needs a desktop portal, which is missing under a bare window manager or in a
//! container.

use super::folder::{Entry, FileKind, list_folder};
use super::templates::Template;
use std::path::{Path, PathBuf};

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Purpose {
    Open,
    /// Creates a script from a template.
    New(Template),
    /// Creates a copy of a lesson, given by its index in [`super::documents::Documents::lessons`].
    Lesson(usize),
    /// Saves the open script under another name.
    SaveAs,
}

#[derive(Clone, Debug)]
pub struct FileDialog {
    pub purpose: Purpose,
    pub folder: PathBuf,
    pub entries: Vec<Entry>,
    /// Name of the chosen or new file.
    pub name: String,
    /// Whether the dialog was just opened: the name field then gets the keyboard focus.
    pub was_just_opened: bool,
    /// Reason why the choice was refused.
    pub problem: Option<String>,
    /// Existing file that is replaced if the user confirms by choosing the same name again.
    replaces: Option<PathBuf>,
    model_extensions: Vec<String>,
}

impl FileDialog {
    /// Opens the dialog in a folder. `model_extensions`: file name extensions of models that can be opened.
    pub fn new(purpose: Purpose, folder: &Path, name: &str, model_extensions: &[String]) -> FileDialog {
        let model_extensions = if purpose == Purpose::Open { model_extensions.to_vec() } else { Vec::new() };
        let mut dialog = FileDialog {
            purpose,
            folder: PathBuf::new(),
            entries: Vec::new(),
            name: name.to_string(),
            was_just_opened: true,
            problem: None,
            replaces: None,
            model_extensions,
        };
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        dialog.change_folder(&folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf()));
        dialog
    }

    /// Changes to another folder; if it cannot be read, the list stays.
    pub fn change_folder(&mut self, folder: &Path) {
        match list_folder(folder, &self.model_extensions) {
            Ok(entries) => {
                (self.folder, self.entries, self.problem) = (folder.to_path_buf(), entries, None);
            }
            Err(error) => self.problem = Some(format!("{}: {error}", folder.display())),
        }
    }

    /// Handles a click on an entry: enters a folder, or puts the name of a file into the name field.
    pub fn choose(&mut self, entry: &Entry) {
        match entry.kind {
            FileKind::Folder => self.change_folder(&entry.path),
            FileKind::Script | FileKind::Model => self.name.clone_from(&entry.name),
        }
    }

    /// Returns the chosen file if it can be used. Adds the extension of scripts if it is missing, and enters a folder. Replacing a file must be
    /// confirmed by a second call.
    pub fn accept(&mut self) -> Option<PathBuf> {
        let name = self.name.trim();
        let path = self.folder.join(name);
        if name.is_empty() {
            self.problem = Some("type a file name".to_string());
            return None;
        }
        if path.is_dir() {
            self.change_folder(&path.canonicalize().unwrap_or(path));
            self.name.clear();
            return None;
        }
        if self.purpose == Purpose::Open {
            let is_there = path.is_file();
            self.problem = (!is_there).then(|| format!("{name}: there is no such file"));
            return is_there.then_some(path);
        }
        let path = match path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("rhai")) {
            true => path,
            false => PathBuf::from(format!("{}.rhai", path.display())),
        };
        if !path.exists() {
            return Some(path);
        }
        let shown = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        match self.purpose {
            Purpose::SaveAs if self.replaces.as_ref() == Some(&path) => return Some(path),
            Purpose::SaveAs => {
                self.problem = Some(format!("{shown} already exists: save once more to replace it"));
                self.replaces = Some(path);
            }
            _ => self.problem = Some(format!("{shown} already exists; choose another name")),
        }
        None
    }
}
