//! Access to files for scripts: only those in the script's own folder and in the search paths.

use crate::suggest::{closest, list};
use choreo_files::{FileError, Folder};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The error that a file cannot be read or imported.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LoadError {
    pub message: String,
    pub hint: Option<String>,
}

impl LoadError {
    pub fn new(message: impl Into<String>) -> LoadError {
        LoadError { message: message.into(), hint: None }
    }
    pub fn hint(mut self, hint: impl Into<String>) -> LoadError {
        self.hint = Some(hint.into());
        self
    }
}

impl std::fmt::Display for LoadError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.message)
    }
}

impl std::error::Error for LoadError {}

/// Folders that a script may read: its own, and the search paths.
#[derive(Clone, Debug)]
pub struct Folders {
    roots: Vec<Root>,
    /// Number of leading roots that are the script's own. Modules are read from these only.
    own_root_count: usize,
    max_bytes: u64,
}

/// A folder that may be read.
#[derive(Clone, Debug)]
struct Root {
    /// The path as the caller named it, for messages.
    given: PathBuf,
    canonical: PathBuf,
    /// Open handle of the folder. Files are opened relative to it, so that a link that replaces a found file is not followed.
    /// `None`: the folder can be entered but not opened.
    handle: Option<Arc<Folder>>,
}

impl Root {
    fn new(given: &Path) -> std::io::Result<Root> {
        let canonical = given.canonicalize()?;
        let handle = Folder::open(&canonical).ok().map(Arc::new);
        Ok(Root { given: given.to_path_buf(), canonical, handle })
    }
}

/// A file found within the folders.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct FoundFile {
    /// Canonical path.
    pub path: PathBuf,
}

const LINK_OUT: &str = "it is a link that leads out of the folders this script may read";

impl Folders {
    /// Opens the script's folder, then the search paths in order. `max_bytes`: the largest file that may be read.
    pub fn new(base: &Path, search: &[PathBuf], max_bytes: u64) -> Result<Folders, LoadError> {
        let mut roots = Vec::new();
        for (i, given) in std::iter::once(base).chain(search.iter().map(PathBuf::as_path)).enumerate() {
            let here = if given.as_os_str().is_empty() { Path::new(".") } else { given };
            let what = if i == 0 { "script folder" } else { "search path" };
            let root = Root::new(here)
                .map_err(|e| LoadError::new(format!("cannot use {what} \"{}\": {e}", here.display())))?;
            if !root.canonical.is_dir() {
                return Err(LoadError::new(format!(
                    "cannot use {what} \"{}\": it is not a folder",
                    here.display()
                )));
            }
            roots.push(root);
        }
        Ok(Folders { roots, own_root_count: 1, max_bytes })
    }

    /// Adds a root folder for tests. It must contain the script's folder; everything in it counts as the script's own, and names
    /// are looked up in the script's folder, then in `root`.
    pub fn with_root(mut self, root: &Path) -> Result<Folders, LoadError> {
        let outer = Root::new(root)
            .map_err(|e| LoadError::new(format!("cannot use folder \"{}\": {e}", root.display())))?;
        if !self.base().starts_with(&outer.canonical) {
            return Err(LoadError::new(format!(
                "\"{}\" does not lie in \"{}\"",
                self.base().display(),
                root.display()
            )));
        }
        if self.base() != outer.canonical {
            self.roots.insert(1, outer);
            self.own_root_count = 2;
        }
        Ok(self)
    }

    /// Access to the script's own folders only, for modules.
    pub(crate) fn without_search_paths(&self) -> Folders {
        Folders {
            roots: self.roots[..self.own_root_count].to_vec(),
            own_root_count: self.own_root_count,
            max_bytes: self.max_bytes,
        }
    }

    /// Canonical path of the script's folder.
    pub fn base(&self) -> &Path {
        &self.roots[0].canonical
    }

    /// Finds `name` relative to `start` (a canonical folder within the roots), else in each root.
    pub fn find(&self, start: Option<&Path>, name: &str) -> Result<FoundFile, LoadError> {
        self.find_reporting(start, name, &mut |_| ())
    }

    /// Finds a file as [`Folders::find`] does. `report` receives each looked-up path that does not exist or is a link, because a
    /// change there would change the result.
    pub(crate) fn find_reporting(
        &self,
        start: Option<&Path>,
        name: &str,
        report: &mut dyn FnMut(&Path),
    ) -> Result<FoundFile, LoadError> {
        let refuse = |why: &str| {
            Err(LoadError::new(format!("cannot read \"{}\": {why}", shortened(name))).hint(format!(
                "a script reads files in its own folder and in the folders given with --search: {}",
                self.quoted_roots()
            )))
        };
        let name_slashes = name.replace('\\', "/");
        let has_drive = name_slashes.as_bytes().get(1) == Some(&b':');
        if name.is_empty() {
            return refuse("the name is empty");
        }
        if name.contains('\0') {
            return refuse("the name contains a zero byte");
        }
        if name_slashes.starts_with('/') || has_drive || Path::new(name).is_absolute() {
            return refuse("it is an absolute path");
        }
        let mut escapes = true;
        for (prefix, root) in self.lookup_folders(start) {
            let Some(components) = normalized_components(&prefix, &name_slashes) else { continue };
            escapes = false;
            let candidate = components.iter().fold(root.clone(), |p, component| p.join(component));
            let path = match candidate.canonicalize() {
                Ok(path) => {
                    if path != candidate {
                        report(&candidate);
                    }
                    path
                }
                Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                    report(&candidate);
                    continue;
                }
                Err(e) => {
                    report(&candidate);
                    let why = FileError::Io(e);
                    return Err(LoadError::new(format!("cannot read \"{}\": {why}", shortened(name))));
                }
            };
            if !self.roots.iter().any(|r| path.starts_with(&r.canonical)) {
                return refuse(LINK_OUT);
            }
            if path.is_dir() {
                return Err(LoadError::new(format!("cannot read \"{name}\": it is a folder, not a file")));
            }
            if !path.is_file() {
                return refuse("it is not a regular file");
            }
            return Ok(FoundFile { path });
        }
        if escapes {
            return refuse("it leads out of the folders this script may read");
        }
        Err(self.missing_file_error(start, name, &name_slashes))
    }

    /// Reads a found file, up to the limit.
    pub fn read(&self, found: &FoundFile, name: &str) -> Result<Vec<u8>, LoadError> {
        let in_root = |root: &Root| {
            Some((root.handle.clone()?, found.path.strip_prefix(&root.canonical).ok()?.to_path_buf()))
        };
        // The script itself may lie outside the roots, because the user named it.
        let read = match self.roots.iter().find_map(in_root) {
            Some((folder, relative)) => folder.read(&relative, self.max_bytes),
            None => choreo_files::read(&found.path, self.max_bytes),
        };
        read.map_err(|error| match error {
            FileError::TooLarge(most) => LoadError::new(format!("cannot read \"{name}\": it is too large"))
                .hint(crate::limits::raise_hint("file", format!("{most} bytes"))),
            FileError::Outside => LoadError::new(format!("cannot read \"{name}\": {LINK_OUT}")),
            error => LoadError::new(format!("cannot read \"{name}\": {error}")),
        })
    }

    /// Folders in which a name is looked up, each as (path components below the root, canonical root).
    fn lookup_folders(&self, start: Option<&Path>) -> Vec<(Vec<String>, PathBuf)> {
        let mut folders = Vec::new();
        if let Some(start) = start.or((self.own_root_count > 1).then(|| self.base())) {
            for root in &self.roots {
                if let Ok(below) = start.strip_prefix(&root.canonical) {
                    let components =
                        below.components().map(|c| c.as_os_str().to_string_lossy().into_owned()).collect();
                    folders.push((components, root.canonical.clone()));
                }
            }
        }
        folders.extend(self.roots.iter().map(|root| (Vec::new(), root.canonical.clone())));
        folders
    }

    /// Paths of the roots as the caller named them, in quotes.
    fn quoted_roots(&self) -> String {
        let names: Vec<String> =
            self.roots.iter().map(|root| format!("\"{}\"", root.given.display())).collect();
        names.join(", ")
    }

    /// The error that a file does not exist, with a suggestion from the files in its folder.
    fn missing_file_error(&self, start: Option<&Path>, name: &str, name_slashes: &str) -> LoadError {
        // Maximum number of names read from a folder, which can contain millions, to suggest one.
        const MAX_NAMES: usize = 2000;
        let (folder, file) = name_slashes.rsplit_once('/').unwrap_or(("", name_slashes));
        let mut names = Vec::new();
        for (prefix, root) in self.lookup_folders(start) {
            let Some(components) = normalized_components(&prefix, folder) else { continue };
            let dir = components.iter().fold(root, |p, component| p.join(component));
            // A folder outside the roots to which a link leads must not be listed.
            let is_inside =
                dir.canonicalize().is_ok_and(|d| self.roots.iter().any(|r| d.starts_with(&r.canonical)));
            if let (true, Ok(entries)) = (is_inside, std::fs::read_dir(&dir)) {
                names.extend(
                    entries
                        .flatten()
                        .take(MAX_NAMES)
                        .filter(|e| e.path().is_file())
                        .map(|e| e.file_name().to_string_lossy().into_owned()),
                );
            }
        }
        names.sort();
        names.dedup();
        let mut message =
            format!("cannot read \"{}\": no such file in {}", shortened(name), self.quoted_roots());
        if let Some(close) = closest(file, names.iter().map(String::as_str)) {
            let close = if folder.is_empty() { close.to_string() } else { format!("{folder}/{close}") };
            message.push_str(&format!("; did you mean \"{close}\"?"));
        }
        let error = LoadError::new(message);
        if names.is_empty() {
            return error.hint("give the folder of your assets with --search FOLDER");
        }
        error.hint(format!("files there: {}", list(names.iter().map(String::as_str), 12)))
    }
}

/// A name shortened for messages.
fn shortened(name: &str) -> String {
    name.chars().take(200).collect()
}

/// The components of `prefix/name` with `.` and `..` resolved; `None` if `..` leads above the root.
fn normalized_components(prefix: &[String], name: &str) -> Option<Vec<String>> {
    let mut components = prefix.to_vec();
    for component in name.split('/') {
        match component {
            "" | "." => {}
            ".." => {
                components.pop()?;
            }
            component => components.push(component.to_string()),
        }
    }
    Some(components)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::symlink;

    #[test]
    fn a_link_that_replaces_a_found_file_is_not_followed() {
        let outer = tempfile::tempdir().unwrap();
        let inside = outer.path().join("inside");
        fs::create_dir_all(inside.join("below")).unwrap();
        fs::write(outer.path().join("secret"), "secret").unwrap();
        fs::write(inside.join("a"), "text").unwrap();
        fs::write(inside.join("below/secret"), "text").unwrap();
        let folders = Folders::new(&inside, &[], 100).unwrap();
        let (a, below) = (folders.find(None, "a").unwrap(), folders.find(None, "below/secret").unwrap());
        assert_eq!(folders.read(&a, "a").unwrap(), b"text");
        fs::remove_file(inside.join("a")).unwrap();
        symlink("../secret", inside.join("a")).unwrap();
        let message = |found, name: &str| folders.read(found, name).unwrap_err().message;
        let refused = "it is a link that leads out of the folders this script may read";
        assert_eq!(message(&a, "a"), format!("cannot read \"a\": {refused}"));
        fs::remove_dir_all(inside.join("below")).unwrap();
        symlink("..", inside.join("below")).unwrap();
        assert_eq!(message(&below, "b"), format!("cannot read \"b\": {refused}"));
        fs::remove_file(inside.join("a")).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(inside.join("a")).status().unwrap().success());
        assert_eq!(message(&a, "a"), "cannot read \"a\": it is a pipe or device, not a regular file");
    }
}
