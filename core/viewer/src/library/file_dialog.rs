//! A list of files from which one is chosen. It is our own: that of the system needs a portal, which a bare window manager or a container
//! lacks.

use super::folder::{Entry, FileKind, list};
use super::templates::Template;
use std::path::{Path, PathBuf};

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Purpose {
    Open,
    /// A script that is made of a template.
    New(Template),
    /// A copy of a lesson; its number among [`super::documents::Documents::lessons`].
    Lesson(usize),
    /// The script that is shown, under another name.
    SaveAs,
}

#[derive(Clone, Debug)]
pub struct FileDialog {
    pub purpose: Purpose,
    pub folder: PathBuf,
    pub entries: Vec<Entry>,
    /// Name of the chosen or new file.
    pub name: String,
    /// Whether it has just been opened: the field of the name then gets the keyboard.
    pub fresh: bool,
    /// Why the choice cannot be taken.
    pub problem: Option<String>,
    /// The file that the next choice of the same name replaces.
    replaces: Option<PathBuf>,
    models: Vec<String>,
}

impl FileDialog {
    /// `models`: endings of files that are models, which can be opened.
    pub fn new(purpose: Purpose, folder: &Path, name: &str, models: &[String]) -> FileDialog {
        let models = if purpose == Purpose::Open { models.to_vec() } else { Vec::new() };
        let mut dialog = FileDialog {
            purpose,
            folder: PathBuf::new(),
            entries: Vec::new(),
            name: name.to_string(),
            fresh: true,
            problem: None,
            replaces: None,
            models,
        };
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        dialog.go(&folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf()));
        dialog
    }

    /// Shows another folder; one that cannot be read leaves the list as it is.
    pub fn go(&mut self, folder: &Path) {
        match list(folder, &self.models) {
            Ok(entries) => {
                (self.folder, self.entries, self.problem) = (folder.to_path_buf(), entries, None);
            }
            Err(error) => self.problem = Some(format!("{}: {error}", folder.display())),
        }
    }

    /// A click on an entry: its name goes into the field; a folder is entered.
    pub fn choose(&mut self, entry: &Entry) {
        match entry.kind {
            FileKind::Folder => self.go(&entry.path),
            FileKind::Script | FileKind::Model => self.name.clone_from(&entry.name),
        }
    }

    /// The chosen file, where it can be taken. A name without an ending is a script's; a folder is entered; a file that would be replaced is
    /// confirmed by a second choice.
    pub fn accept(&mut self) -> Option<PathBuf> {
        let name = self.name.trim();
        let path = self.folder.join(name);
        if name.is_empty() {
            self.problem = Some("write the name of a file".to_string());
            return None;
        }
        if path.is_dir() {
            self.go(&path.canonicalize().unwrap_or(path));
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
                self.problem = Some(format!("{shown} is there already: save once more to replace it"));
                self.replaces = Some(path);
            }
            _ => self.problem = Some(format!("{shown} is there already; choose another name")),
        }
        None
    }
}
