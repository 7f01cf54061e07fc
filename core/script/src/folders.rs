//! Which files a script may reach: those under its own folder and the search paths given, and no others.

use crate::suggest::{closest, list};
use std::io::Read;
use std::path::{Path, PathBuf};

/// A refusal or failure: what, and what to do.
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

#[derive(Clone, Debug)]
pub struct Folders {
    /// As given, for messages, and canonical.
    roots: Vec<(PathBuf, PathBuf)>,
    /// How many of them are the script's own: modules come from these only.
    own: usize,
    max_bytes: u64,
}

/// A file found within the folders.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Found {
    /// Canonical.
    pub path: PathBuf,
}

/// The system's words without "(os error 20)".
fn words(error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotADirectory => "a part of the path is a file, not a folder".to_string(),
        std::io::ErrorKind::PermissionDenied => "permission denied".to_string(),
        _ => {
            let text = error.to_string();
            text.split_once(" (os error").map_or(text.clone(), |(words, _)| words.to_string())
        }
    }
}

impl Folders {
    /// The script's folder first, then the search paths in order.
    pub fn new(base: &Path, search: &[PathBuf], max_bytes: u64) -> Result<Folders, LoadError> {
        let mut roots = Vec::new();
        for (i, given) in std::iter::once(base).chain(search.iter().map(PathBuf::as_path)).enumerate() {
            let here = if given.as_os_str().is_empty() { Path::new(".") } else { given };
            let what = if i == 0 { "script folder" } else { "search path" };
            let canonical = here
                .canonicalize()
                .map_err(|e| LoadError::new(format!("cannot use {what} \"{}\": {e}", here.display())))?;
            if !canonical.is_dir() {
                return Err(LoadError::new(format!(
                    "cannot use {what} \"{}\": it is not a folder",
                    here.display()
                )));
            }
            roots.push((here.to_path_buf(), canonical));
        }
        Ok(Folders { roots, own: 1, max_bytes })
    }

    /// For tests: all that lies in `root`, which holds the script's folder, is the script's own too, and a name is looked
    /// for from the script's folder on, up to there.
    pub fn with_root(mut self, root: &Path) -> Result<Folders, LoadError> {
        let canonical = root
            .canonicalize()
            .map_err(|e| LoadError::new(format!("cannot use folder \"{}\": {e}", root.display())))?;
        if !self.base().starts_with(&canonical) {
            return Err(LoadError::new(format!(
                "\"{}\" does not lie in \"{}\"",
                self.base().display(),
                root.display()
            )));
        }
        if self.base() != canonical {
            self.roots.insert(1, (root.to_path_buf(), canonical));
            self.own = 2;
        }
        Ok(self)
    }

    /// Only the script's own folder: for modules.
    pub fn base_only(&self) -> Folders {
        Folders { roots: self.roots[..self.own].to_vec(), own: self.own, max_bytes: self.max_bytes }
    }

    pub fn base(&self) -> &Path {
        &self.roots[0].1
    }

    /// Finds `name` relative to `start` (a canonical folder within the roots), else in each root.
    pub fn find(&self, start: Option<&Path>, name: &str) -> Result<Found, LoadError> {
        self.find_telling(start, name, &mut |_| ())
    }

    /// The same; `told` gets each path at which something, appearing or being pointed elsewhere, would be found instead.
    pub fn find_telling(
        &self,
        start: Option<&Path>,
        name: &str,
        told: &mut dyn FnMut(&Path),
    ) -> Result<Found, LoadError> {
        let refuse = |why: &str| {
            Err(LoadError::new(format!("cannot read \"{}\": {why}", cut(name))).hint(format!(
                "a script reads files in its own folder and in the folders given with --search: {}",
                self.shown()
            )))
        };
        let name_slashes = name.replace('\\', "/");
        let drive = name_slashes.as_bytes().get(1) == Some(&b':');
        if name.is_empty() {
            return refuse("the name is empty");
        }
        if name.contains('\0') {
            return refuse("the name holds a zero byte");
        }
        if name_slashes.starts_with('/') || drive || Path::new(name).is_absolute() {
            return refuse("it is an absolute path");
        }
        let mut escapes = true;
        for (prefix, root) in self.starts(start) {
            let Some(parts) = flatten(&prefix, &name_slashes) else { continue };
            escapes = false;
            let candidate = parts.iter().fold(root.clone(), |p, part| p.join(part));
            let path = match candidate.canonicalize() {
                Ok(path) => {
                    if path != candidate {
                        told(&candidate);
                    }
                    path
                }
                Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                    told(&candidate);
                    continue;
                }
                Err(e) => {
                    told(&candidate);
                    return Err(LoadError::new(format!("cannot read \"{}\": {}", cut(name), words(&e))));
                }
            };
            if !self.roots.iter().any(|(_, r)| path.starts_with(r)) {
                return refuse("it is a link that leads out of the folders this script may read");
            }
            if path.is_dir() {
                return Err(LoadError::new(format!("cannot read \"{name}\": it is a folder, not a file")));
            }
            if !path.is_file() {
                return refuse("it is not a regular file");
            }
            return Ok(Found { path });
        }
        if escapes {
            return refuse("it leads out of the folders this script may read");
        }
        Err(self.missing(start, name, &name_slashes))
    }

    /// Reads a found file, up to the limit.
    pub fn read(&self, found: &Found, name: &str) -> Result<Vec<u8>, LoadError> {
        let fail = |e: std::io::Error| LoadError::new(format!("cannot read \"{name}\": {}", words(&e)));
        let file = std::fs::File::open(&found.path).map_err(fail)?;
        let mut bytes = Vec::new();
        file.take(self.max_bytes.saturating_add(1)).read_to_end(&mut bytes).map_err(fail)?;
        if bytes.len() as u64 > self.max_bytes {
            return Err(LoadError::new(format!("cannot read \"{name}\": it is too large"))
                .hint(crate::limits::raise_hint("file", format!("{} bytes", self.max_bytes))));
        }
        Ok(bytes)
    }

    /// Folders to start from, as (parts below the root, canonical root).
    fn starts(&self, start: Option<&Path>) -> Vec<(Vec<String>, PathBuf)> {
        let mut starts = Vec::new();
        if let Some(start) = start.or((self.own > 1).then(|| self.base())) {
            for (_, root) in &self.roots {
                if let Ok(below) = start.strip_prefix(root) {
                    let parts =
                        below.components().map(|c| c.as_os_str().to_string_lossy().into_owned()).collect();
                    starts.push((parts, root.clone()));
                }
            }
        }
        starts.extend(self.roots.iter().map(|(_, root)| (Vec::new(), root.clone())));
        starts
    }

    fn shown(&self) -> String {
        let names: Vec<String> =
            self.roots.iter().map(|(given, _)| format!("\"{}\"", given.display())).collect();
        names.join(", ")
    }

    fn missing(&self, start: Option<&Path>, name: &str, name_slashes: &str) -> LoadError {
        // Names of one folder, enough to find a slip of the hand, not enough to hang on a folder of millions.
        const MOST: usize = 2000;
        let (folder, file) = name_slashes.rsplit_once('/').unwrap_or(("", name_slashes));
        let mut names = Vec::new();
        for (prefix, root) in self.starts(start) {
            let Some(parts) = flatten(&prefix, folder) else { continue };
            let dir = parts.iter().fold(root, |p, part| p.join(part));
            // A link out of the folders must not be listed either.
            let inside =
                dir.canonicalize().is_ok_and(|d| self.roots.iter().any(|(_, root)| d.starts_with(root)));
            if let (true, Ok(entries)) = (inside, std::fs::read_dir(&dir)) {
                names.extend(
                    entries
                        .flatten()
                        .take(MOST)
                        .filter(|e| e.path().is_file())
                        .map(|e| e.file_name().to_string_lossy().into_owned()),
                );
            }
        }
        names.sort();
        names.dedup();
        let mut message = format!("cannot read \"{}\": no such file in {}", cut(name), self.shown());
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

/// A name in a message, where it must not take pages.
fn cut(name: &str) -> String {
    name.chars().take(200).collect()
}

/// The parts of `prefix/name` with `.` and `..` resolved; `None` where `..` climbs above the root.
fn flatten(prefix: &[String], name: &str) -> Option<Vec<String>> {
    let mut parts = prefix.to_vec();
    for part in name.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop()?;
            }
            part => parts.push(part.to_string()),
        }
    }
    Some(parts)
}
